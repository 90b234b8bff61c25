"""Box: the unit cube -1 .. 1 by slabs, placed by a matrix; in plain float64 with a bound on its errors first, then in double-double."""
from fractions import Fraction
from typing import Annotated

import numpy as np

from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import inverse_parts, moved, parts, rationals
from rtcore.fields import FieldError, Vec, Vector
from rtcore.jit import inline, kernel
from rtcore.lanes import any_lane, greatest, least, load, load3, rounded, select, size, splat3, wide, with_sign
from rtcore.pairs import divide, subtract
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import U64, extent
from rtcore.shapes._unit import BEYOND, PLACE, into_plain, line_in_pairs
from rtcore.shapes.kind import FRONT, OWN, Kind, Packed, forward, placed, placed_bounds, put_placed, unit_hit
from rtcore.wave import DX, OX, START, alive, record, until

HALF = BEYOND       # columns of Table.exact: half the box's edges, in two parts


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
def later(enter, enter1, f, f1, v, v1, half, half1):
    """The later one of `enter` and where a slab is entered, in pairs. A ray along the slab is in it always or never."""
    t, t1 = crossing(-with_sign(half, v), -half1 * with_sign(1 + 0 * v, v), f, f1, v, v1)
    along = v == 0
    sign = with_sign(1 + 0 * f, f)
    beside = (sign * f - half) + (sign * f1 - half1) > 0
    t = select(along, select(beside, np.inf, 0 * f - np.inf), t)
    more = (t > enter) | ((t == enter) & (t1 > enter1))
    return select(more, t, enter), select(more, select(along, 0, t1), enter1)


@inline
def earlier(leave, leave1, f, f1, v, v1, half, half1):
    """The earlier one of `leave` and where a slab is left."""
    t, t1 = crossing(with_sign(half, v), half1 * with_sign(1 + 0 * v, v), f, f1, v, v1)
    less = ((t < leave) | ((t == leave) & (t1 < leave1))) & ~(v == 0)
    return select(less, t, leave), select(less, t1, leave1)


@inline
def meet(ray, i, exact, q, todo, side):
    """Where the lanes `todo` meet box q, in the rays' precision, and whether they do; in double-double. Rays that miss an edge by less than
    2⁻⁹⁸ of the way count as touching it."""
    f, f1, v, v1 = line_in_pairs(ray, i, exact, q)
    half, half1, start, zero = splat3(exact, q, HALF), splat3(exact, q, HALF + 3), load(ray, START, i), 0 * f.x
    enter, enter1 = later(zero - np.inf, zero, f.x, f1.x, v.x, v1.x, half.x, half1.x)
    enter, enter1 = later(enter, enter1, f.y, f1.y, v.y, v1.y, half.y, half1.y)
    enter, enter1 = later(enter, enter1, f.z, f1.z, v.z, v1.z, half.z, half1.z)
    leave, leave1 = earlier(zero + np.inf, zero, f.x, f1.x, v.x, v1.x, half.x, half1.x)
    leave, leave1 = earlier(leave, leave1, f.y, f1.y, v.y, v1.y, half.y, half1.y)
    leave, leave1 = earlier(leave, leave1, f.z, f1.z, v.z, v1.z, half.z, half1.z)
    ok = todo & (enter < np.inf) & ((leave - enter) + (leave1 - enter1) >= -2.0 ** -98 * (size(enter) + size(leave)))
    t = rounded(enter, start)
    t = select(t > start, t, rounded(leave, start))
    if side != 0:
        t = rounded(enter, start) if side & FRONT else rounded(leave, start)
    return t, ok


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, 1 << 30)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                most = np.float64(table.data[q, OWN])
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        i = start + g * 8
                        todo = approach(rays.ray, i, table.exact, q, most)
                        if any_lane(todo):
                            t, ok = meet(rays.ray, i, table.exact, q, todo, table.side[q])
                            record(rays, i, first + q, t, ok, opacity)
            shrink(walk, rays, start)
            leaf = next_leaf(walk, tree, table)


@kernel
def surface(rays, n, out, table, first):
    last = first + table.data.shape[0]
    for i in range(n):
        if first <= rays.prim[i] < last:
            q = rays.prim[i] - first
            x, y, z = unit_hit(rays, i, table.data, q)
            nx, ny, nz = 0.0, 0.0, 0.0
            # the face is the one whose plane the point is nearest to; the point is put onto it
            if abs(x) >= max(abs(y), abs(z)):
                nx = np.copysign(1.0, x)
                x, u, v = nx, y, z
            elif abs(y) >= abs(z):
                ny = np.copysign(1.0, y)
                y, u, v = ny, z, x
            else:
                nz = np.copysign(1.0, z)
                z, u, v = nz, x, y
            put_placed(out, i, table.data, q, x, y, z, nx, ny, nz, (u + 1) / 2, (v + 1) / 2)


def _bounds(data, extra):
    return placed_bounds(data, np.abs(forward(data)).sum(2))


BOX = Kind("box", intersect, surface, _bounds, (Box((-1, -1, -1), (1, 1, 1)), ()))
