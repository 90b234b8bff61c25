"""Box: the unit cube -1 .. 1 by slabs, placed by a matrix; in plain float64 with a bound on its errors first, then in double-double, and in
some hundred digits where most of those cancel."""
from fractions import Fraction
from typing import Annotated

import numpy as np

from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import inverse_parts, moved, parts, rationals
from rtcore.fields import FieldError, Vec, Vector
from rtcore.expansions import LONG, expand
from rtcore.indices import among, common, rows_of
from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import (LANES, any_lane, bits, greatest, least, load, load3, rounded, select, size, splat3, vec3, wide, with_sign, zero)
from rtcore.pairs import divide, subtract
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import U64, extent, lowest
from rtcore.shapes._unit import BEYOND, PLACE, into_plain, line_expanded, line_in_pairs
from rtcore.shapes._surface import put_all_placed, put_coordinates, unit_hits
from rtcore.shapes.kind import FRONT, OWN, Kind, Packed, forward, placed, placed_bounds
from rtcore.wave import DX, OX, SLOW, START, alive, record, record_one, until

HALF = BEYOND       # columns of Table.exact: half the box's edges, in two parts
NEAR = 2.0 ** -60   # what t may be off, as a share of it, before pairs will not do


class Box(Shape, frozen=True):
    """The box from corner `low` to corner `high`, along the axes."""

    low: Annotated[Vec, Vector(help="the corner with the smallest coordinates", unit="scene units")]
    high: Annotated[Vec, Vector(help="the corner with the largest coordinates", unit="scene units")]

    def check(self):
        if not all(a < b for a, b in zip(self.low, self.high)):
            raise FieldError(f"three numbers each greater than those of low, {self.low}", self.high, "high")

    def kind(self, matrix: np.ndarray) -> Kind:
        return BOX

    def pack(self, matrix: np.ndarray) -> Packed:
        low, high = np.array(self.low), np.array(self.high)
        unit = np.diag([*(high - low) / 2, 1.0])
        unit[:3, 3] = low / 2 + high / 2
        local = matrix @ unit
        back = invertible(local)
        middle = [(p + q) / 2 for p, q in zip(rationals(low), rationals(high))]
        power = float(np.ldexp(1.0, np.frexp((high - low).max())[1]))     # the unit of length: what is a binary fraction stays one
        half = [(q - p) / 2 / Fraction(power) for p, q in zip(rationals(low), rationals(high))]
        into = inverse_parts(matrix) / power
        exact = [*parts(moved(matrix, middle), 3), *into, *parts(half)]
        return Packed(BOX, placed(local, back, np.abs(into[:9]).max())[None], exact=np.array([exact]))


@inline
def slab(f, v, half, blur):
    """Where eight rays enter and leave -half .. half in one axis, plainly, each moved outward by what that may be off: `blur` is a bound
    on the error of f. A NaN, from a ray in the plane of a face, is for the caller to pass over."""
    side = with_sign(half, v)
    enter, leave = (-side - f) / v, (side - f) / v
    slack = blur / size(v)
    return enter - slack - 2.0 ** -40 * size(enter), leave + slack + 2.0 ** -40 * size(leave)


@inline
def approach(ray, i, exact, q, most):
    """Of eight rays, plainly: those that may meet box q in their interval."""
    g, v = (wide(load3(ray, OX, i)) - splat3(exact, q, PLACE)) - splat3(exact, q, PLACE + 3), wide(load3(ray, DX, i))
    f, d, half = into_plain(exact, q, g), into_plain(exact, q, v), splat3(exact, q, HALF)
    blur = 32 * U64 * (most * extent(g) + 1)
    x0, x1 = slab(f.x, d.x, half.x, blur)
    y0, y1 = slab(f.y, d.y, half.y, blur)
    z0, z1 = slab(f.z, d.z, half.z, blur)
    enter = greatest(z0, greatest(y0, greatest(x0, 0 * blur - np.inf)))
    leave = least(z1, least(y1, least(x1, 0 * blur + np.inf)))
    return (enter <= leave) & (leave > wide(load(ray, START, i))) & (enter < until(ray, i)) & alive(ray, i)


@inline
def crossing(face, face1, f, f1, v, v1):
    """(face - f) / v in pairs."""
    h, h1 = subtract(face, face1, f, f1)
    return divide(h, h1, v, v1)


@inline
def later(enter, enter1, pace, f, f1, v, v1, half, half1):
    """The later one of `enter` and where a slab is entered, in pairs, and the v of that slab. A ray along it is in it always or never."""
    t, t1 = crossing(-with_sign(half, v), -half1 * with_sign(1 + 0 * v, v), f, f1, v, v1)
    along = v == 0
    sign = with_sign(1 + 0 * f, f)
    beside = (sign * f - half) + (sign * f1 - half1) > 0
    t = select(along, select(beside, np.inf, 0 * f - np.inf), t)
    more = (t > enter) | ((t == enter) & (t1 > enter1))
    return select(more, t, enter), select(more, select(along, 0, t1), enter1), select(more, v, pace)


@inline
def earlier(leave, leave1, pace, f, f1, v, v1, half, half1):
    """The earlier one of `leave` and where a slab is left, likewise."""
    t, t1 = crossing(with_sign(half, v), half1 * with_sign(1 + 0 * v, v), f, f1, v, v1)
    less = ((t < leave) | ((t == leave) & (t1 < leave1))) & ~(v == 0)
    return select(less, t, leave), select(less, t1, leave1), select(less, v, pace)


@inline
def meet(ray, i, exact, q, most, todo, side):
    """Where the lanes `todo` meet box q, in the rays' precision, whether they do, and for which that is left to `settle`; in double-double.
    Rays that miss an edge by less than 2⁻⁹⁸ of the way count as touching it."""
    f, f1, v, v1 = line_in_pairs(ray, i, exact, q)
    half, half1, start, zero = splat3(exact, q, HALF), splat3(exact, q, HALF + 3), load(ray, START, i), 0 * f.x
    far = 16 * U64 ** 2 * (most * extent(wide(load3(ray, OX, i)) - splat3(exact, q, PLACE)) + 1)
    speed = 8 * U64 ** 2 * most * extent(wide(load3(ray, DX, i)))
    enter, enter1, pace = later(zero - np.inf, zero, zero, f.x, f1.x, v.x, v1.x, half.x, half1.x)
    enter, enter1, pace = later(enter, enter1, pace, f.y, f1.y, v.y, v1.y, half.y, half1.y)
    enter, enter1, pace = later(enter, enter1, pace, f.z, f1.z, v.z, v1.z, half.z, half1.z)
    leave, leave1, pace1 = earlier(zero + np.inf, zero, zero, f.x, f1.x, v.x, v1.x, half.x, half1.x)
    leave, leave1, pace1 = earlier(leave, leave1, pace1, f.y, f1.y, v.y, v1.y, half.y, half1.y)
    leave, leave1, pace1 = earlier(leave, leave1, pace1, f.z, f1.z, v.z, v1.z, half.z, half1.z)
    ok = todo & (enter < np.inf) & ((leave - enter) + (leave1 - enter1) >= -2.0 ** -98 * (size(enter) + size(leave)))
    t, last = rounded(enter, start), rounded(leave, start)
    outside, begin = wide(t) > wide(start), wide(start)
    # in doubt: the t that is wanted, or whether the ray starts before it enters; h and v are off by `far` and `speed`
    off, off1 = far + size(enter) * speed, far + size(leave) * speed
    close, close1 = off > NEAR * size(enter * pace), off1 > NEAR * size(leave * pace1)
    unsure = (outside & close) | (~outside & (((enter - begin) * size(pace) + off > 0) | close1))
    t = select(t > start, t, last)
    if side != 0:
        t = rounded(enter, start) if side & FRONT else last
        unsure = close | close1
    # rays that leave a face have few digits of how far behind it is, but it is behind: a quarter of all rays over a chessboard
    ok = ok & ((leave - begin) * size(pace1) + off1 >= 0)
    return t, ok & ~unsure, ok & unsure


@kernel
def settle(rays, i, p, exact, q, side, opacity):
    """Record where ray i alone meets box q, the slow and certain way."""
    out_of_line()
    rays.tally[SLOW] += 1
    f, v, h, terms = np.empty((3, LONG)), np.empty((3, LONG)), np.empty(LONG), np.empty(2 * LONG + 2)
    line_expanded(rays.ray, i, exact, q, f, v)
    enter, enter1, leave, leave1 = -np.inf, 0.0, np.inf, 0.0
    for k in range(3):
        for way in (-1.0, 1.0):
            sign = way if v[k, 0] >= 0 else -way
            terms[0], terms[1], terms[2:2 + LONG] = sign * exact[q, HALF + k], sign * exact[q, HALF + 3 + k], -f[k]
            expand(terms, 2 + LONG, h)
            if v[k, 0] == 0:
                if sign * h[0] < 0:
                    return
                continue
            t, t1 = divide(h[0], h[1], v[k, 0], v[k, 1])
            if way < 0 and (t > enter or t == enter and t1 > enter1):
                enter, enter1 = t, t1
            elif way > 0 and (t < leave or t == leave and t1 < leave1):
                leave, leave1 = t, t1
    if (leave - enter) + (leave1 - enter1) < -2.0 ** -98 * (abs(enter) + abs(leave)):
        return
    first = np.float64(np.float32(enter)) if rays.ray.itemsize == 4 else enter
    if side == 0:
        t = first if first > rays.ray[START, i] else leave
    else:
        t = first if side & FRONT else leave
    record_one(rays, i, p, t, opacity)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            touched = 0
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                most = np.float64(table.data[q, OWN])
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        i = start + g * 8
                        todo = approach(rays.ray, i, table.exact, q, most)
                        if any_lane(todo):
                            touched |= 1 << g
                            t, ok, unsure = meet(rays.ray, i, table.exact, q, most, todo, table.side[q])
                            record(rays, i, first + q, t, ok, opacity)
                            late = bits(unsure)
                            while late:
                                settle(rays, i + lowest(late), first + q, table.exact, q, table.side[q], opacity)
                                late &= late - 1
            shrink(walk, rays, start, touched)
            leaf = next_leaf(walk, tree, table)


@kernel
def surface(rays, n, out, table, first):
    prim, data = rays.prim, table.data
    for i in range(0, n, LANES):
        ok = among(prim, i, first, first + data.shape[0])
        if any_lane(ok):
            rows = rows_of(prim, i, first, ok)
            row = common(rows)
            if row >= 0:
                _put_boxes(rays, i, ok, out, data, row)
            else:
                _put_boxes(rays, i, ok, out, data, rows)


@inline
def _put_boxes(rays, i, ok, out, data, q):
    """Surface rows of hits on boxes q."""
    p = unit_hits(rays, i, data, q)
    x, y, z, one = size(p.x), size(p.y), size(p.z), 1 + zero(p.x)
    # the face is the one whose plane the point is nearest to; the point is put onto it
    on_x = (x >= y) & (x >= z)
    on_y = (y >= z) & ~on_x
    on_z = ~on_x & ~on_y
    a, b, c = with_sign(one, p.x), with_sign(one, p.y), with_sign(one, p.z)
    put_all_placed(out, i, ok, data, q, vec3(select(on_x, a, p.x), select(on_y, b, p.y), select(on_z, c, p.z)),
                   vec3(select(on_x, a, 0), select(on_y, b, 0), select(on_z, c, 0)))
    u, v = select(on_x, p.y, select(on_y, p.z, p.x)), select(on_x, p.z, select(on_y, p.x, p.y))
    put_coordinates(out, i, ok, (u + 1) / 2, (v + 1) / 2)


def _bounds(data, extra):
    return placed_bounds(data, np.abs(forward(data)).sum(2))


BOX = Kind("box", intersect, surface, _bounds, (Box((-1, -1, -1), (1, 1, 1)), ()))
