"""Cylinder and Cone: one kind, the frustum x² + y² = (base + slope·z)² over z = 0 .. 1, placed by a matrix.

What the rays meet is the exact form of second degree that the author's numbers say, |p|² - (A·p)²/A·A = (r + k A·p)² about the middle of
the axis A, in the author's own space, by `_second.py`; the caps are planes on which the form is at most 0. A ray along a generator or
through the apex has A = 0: then one root is infinite and drops out.
"""
import math
from typing import Annotated

import numpy as np

from rtcore.across import lowest_bit
from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import inverse_parts, moved, parts, rationals
from rtcore.expansions import LONG, NOISE, clear, expand, put_products
from rtcore.fields import FieldError, Flag, Number, Vec, Vector
from rtcore.indices import among, pick, rows_of
from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import (LANES, along, any_lane, bits, dot, fma, least, load, load3, root, rounded, select, size, splat3, vec3, wide, zero)
from rtcore.pairs import add, divide, multiply, two_sum
from rtcore.scene import UNMOVED, Shape, invertible
from rtcore.shapes import _second
from rtcore.shapes._ball import U64, advance, extent, lowest
from rtcore.shapes._second import FORM, IN_SLAB, LAST, NEXT, SLAB, form_of, heights, line_form, may_meet, noise_along
from rtcore.shapes._unit import BEYOND, INTO, PLACE, into_plain, line_expanded, line_in_unit
from rtcore.shapes._surface import angles, new_room, put_all_placed, put_coordinates, unit_hits
from rtcore.shapes.kind import BACK, FRONT, OWN, Kind, Packed, forward, placed
from rtcore.wave import DX, OX, SLOW, START, T, U, alive, record, record_one, until

#: Columns after the placing: radius at z = 0 and what it grows by; whether there are caps below and above.
BASE, SLOPE, LOWER, UPPER = range(OWN, OWN + 4)

#: Columns of Table.exact after the slab's vector: all that plain arithmetic needs, in neighbouring cache lines. The form is SCALE |p|²
#: - BEND (e·p)² - 2 TAPER e·p - ROUND; two parts of the middle; the largest number of L; the power of two by which L is the identity, or 0;
#: what bounds the errors; caps, 1 below and 2 above; how far the frustum reaches from its middle in the form's units.
SCALE, BEND, TAPER, ROUND, MIDDLE = range(SLAB + 3, SLAB + 8)
MOST, EVEN, ROUGH, CAPS, LIMIT = range(MIDDLE + 6, MIDDLE + 11)


class Cylinder(Shape, frozen=True):
    """A round cylinder from `base` to `apex`, open or with flat caps."""

    base: Annotated[Vec, Vector(help="centre of the one end", unit="scene units")]
    apex: Annotated[Vec, Vector(help="centre of the other end", unit="scene units")]
    radius: Annotated[float, Number(above=0, help="radius", unit="scene units")]
    capped: Annotated[bool, Flag(help="whether the ends are closed")] = True

    def check(self):
        if self.base == self.apex:
            raise FieldError("a point other than base", self.apex, "apex")

    def kind(self, matrix: np.ndarray) -> Kind:
        return CONE

    def pack(self, matrix: np.ndarray) -> Packed:
        return frustum(self.base, self.radius, self.apex, self.radius, self.capped, matrix)


class Cone(Shape, frozen=True):
    """A cone from `base` to `apex`, pointed (one radius 0) or cut off, open or with flat caps."""

    base: Annotated[Vec, Vector(help="centre of the one end", unit="scene units")]
    base_radius: Annotated[float, Number(least=0, help="radius at the base", unit="scene units")]
    apex: Annotated[Vec, Vector(help="centre of the other end", unit="scene units")]
    apex_radius: Annotated[float, Number(least=0, help="radius at the apex", unit="scene units")] = 0.0
    capped: Annotated[bool, Flag(help="whether the ends are closed")] = True

    def check(self):
        if self.base == self.apex:
            raise FieldError("a point other than base", self.apex, "apex")
        if self.base_radius == 0 and self.apex_radius == 0:
            raise FieldError("at least one radius greater than 0", 0, "base_radius")

    def kind(self, matrix: np.ndarray) -> Kind:
        return CONE

    def pack(self, matrix: np.ndarray) -> Packed:
        return frustum(self.base, self.base_radius, self.apex, self.apex_radius, self.capped, matrix)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b; numpy's takes 30 us, a third of what a cone takes to pack."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def frustum(base, base_radius, apex, apex_radius, capped, matrix) -> Packed:
    """The frustum with its greater radius scaled to 1, its axis to z and its height to 1; and its exact form."""
    base, apex = np.array(base), np.array(apex)
    axis = apex - base
    length = np.abs(axis).max()
    z = axis / length / np.linalg.norm(axis / length)
    x = _cross(z, UNMOVED[np.abs(z).argmin(), :3])
    x /= np.linalg.norm(x)
    most = max(base_radius, apex_radius)
    unit = np.eye(4)
    unit[:3, :3] = np.stack([x * most, _cross(z, x) * most, axis], axis=1)
    unit[:3, 3] = base
    local = matrix @ unit
    back = invertible(local)
    power = float(np.ldexp(1.0, np.frexp(most)[1]))     # the form's unit of length
    exact = np.zeros(LIMIT + 1)
    exact_frustum(base, apex, base_radius, apex_radius, power, exact)
    if np.array_equal(matrix, UNMOVED):
        exact[INTO:INTO + 9] = np.eye(3).ravel() / power
        even = True
    else:
        middle = [(p + q) / 2 for p, q in zip(rationals(base), rationals(apex))]
        exact[PLACE:INTO] = parts(moved(matrix, middle), 3)
        exact[INTO:BEYOND] = inverse_parts(matrix) / power
        even = np.frexp(matrix[0, 0])[0] == 0.5 and np.array_equal(matrix[:3, :3], matrix[0, 0] * np.eye(3))
    lower, upper = capped and base_radius > 0, capped and apex_radius > 0
    exact[MIDDLE:MOST] = exact[PLACE:PLACE + 6]
    exact[MOST], exact[EVEN] = np.abs(exact[INTO:INTO + 9]).max(), even * exact[INTO]
    exact[ROUGH] *= (32 if even else 128) * U64
    exact[CAPS], exact[LIMIT] = lower + 2 * upper, np.linalg.norm(axis / power) / 2 + 2
    numbers = base_radius / most, (apex_radius - base_radius) / most, float(lower), float(upper)
    return Packed(CONE, placed(local, back, *numbers)[None], exact=exact[None])


@kernel
def exact_frustum(base, apex, base_radius, apex_radius, power, out):
    """Into a row of Table.exact: the middle as pairs; the form |p|² - K (e·p)² - 2 r g e·p - r², lengths over `power`, in three parts,
    where e·p is -1/2 .. 1/2 between the ends, r the radius in the middle, g what it grows by, K = A·A + g²; the slab's vector
    e = A / A·A. The form is scaled by a power of two to numbers of at most about 1."""
    terms, axis, e = np.empty(2 * LONG * LONG + 2 * LONG), np.zeros((3, LONG)), np.zeros((3, LONG))
    whole, curl, p, form = np.empty(LONG), np.empty(LONG), np.empty(LONG), np.empty((10, LONG))
    radius, grown = two_sum(0.5 * base_radius / power, 0.5 * apex_radius / power), two_sum(apex_radius / power, -base_radius / power)
    n = 0
    for k in range(3):
        out[PLACE + k], out[PLACE + 3 + k] = two_sum(0.5 * base[k], 0.5 * apex[k])
        axis[k, 0], axis[k, 1] = two_sum(apex[k] / power, -base[k] / power)
        n = put_products(terms, n, 1.0, axis[k, :2], axis[k, :2])
    expand(terms, n, whole)
    terms[:LONG] = whole
    expand(terms, put_products(terms, LONG, 1.0, grown, grown), curl)
    for k in range(3):
        rest = axis[k].copy()
        for part in range(3):
            e[k, part] = out[(SLAB, NEXT, LAST)[part] + k] = rest[0] / whole[0]
            terms[:LONG] = rest
            expand(terms, put_products(terms, LONG, -1.0, e[k, part:part + 1], whole), rest)
    for k in range(3):
        expand(terms, put_products(terms, 0, 1.0, curl, e[k]), p)
        terms[0] = 1.0
        expand(terms, put_products(terms, 1, -1.0, p, e[k]), form[k])
        for j in range(k + 1, 3):
            expand(terms, put_products(terms, 0, -2.0, p, e[j]), form[2 + k + j])
        expand(terms, put_products(terms, 0, -2.0, radius, grown), p)
        expand(terms, put_products(terms, 0, 1.0, p, e[k]), form[6 + k])
    expand(terms, put_products(terms, 0, -1.0, radius, radius), form[9])
    scale = math.ldexp(1.0, -math.frexp(np.abs(form[:, 0]).max())[1])
    for k in range(10):
        for part in range(3):
            out[FORM + 10 * part + k] = form[k, part] * scale
    expand(terms, put_products(terms, 0, 1.0, radius, grown), p)
    out[SCALE], out[BEND], out[TAPER], out[ROUND] = scale, curl[0] * scale, p[0] * scale, -out[FORM + 9]
    out[ROUGH] = max(1.0, scale, out[BEND] * (e[0, 0] * e[0, 0] + e[1, 0] * e[1, 0] + e[2, 0] * e[2, 0]))


@inline
def approach(ray, i, exact, q, even):
    """As `_second.approach`, with four numbers of the form instead of ten: half the instructions.

    How many roundings of what they are made of the results are off, if L is `even` or not: f 2 or 6, d 0 or 4, n 3 or 7, e·d 6 or 18, e·n 9
    or 23. With SCALE + BEND |e|² for 2 that makes 18 or 102 for a, 28 or 128 for b, in which n·d is taken for 0, and at most 64 or 256
    for c; ROUGH holds 32 or 128.
    """
    g, v = (wide(load3(ray, OX, i)) - splat3(exact, q, MIDDLE)) - splat3(exact, q, MIDDLE + 3), wide(load3(ray, DX, i))
    f, d = into_unit(exact, q, g, even), into_unit(exact, q, v, even)
    most, rough, taper, e = exact[q, MOST], exact[q, ROUGH], exact[q, TAPER], splat3(exact, q, SLAB)
    square = dot(d, d)
    shift = -dot(f, d) / square
    n = along(f, shift, d)
    rise, level = dot(d, e), dot(n, e)
    fall = fma(level, exact[q, BEND], taper)
    a, b = exact[q, SCALE] * square - rise * rise * exact[q, BEND], -rise * fall
    c = exact[q, SCALE] * dot(n, n) - level * (fall + taper) - exact[q, ROUND]
    speed, reach = most * extent(v), extent(n)
    far = most * extent(g) + speed * size(shift)
    steep, long = rough * speed, far + 1
    return _second.judged(shift, a, b, c, steep * speed, steep * long, 2 * rough * long * (reach + 1), n, d, far, speed, reach)


@inline
def into_unit(exact, q, v, even):
    """L v plainly; even: see `line_in_unit`."""
    return into_plain(exact, q, v) if even == 0 else v * even


@inline
def near_cap(ray, i, exact, q, even, near, end):
    """Of eight rays, plainly: those that may cross the plane of the cap at e·p = end, a number, where the frustum is."""
    g, v = (wide(load3(ray, OX, i)) - splat3(exact, q, PLACE)) - splat3(exact, q, PLACE + 3), wide(load3(ray, DX, i))
    f, d, e = into_unit(exact, q, g, even), into_unit(exact, q, v, even), splat3(exact, q, SLAB)
    rise = dot(e, d)
    t = (end - dot(e, f)) / rise
    p = along(f, t, d)
    pull, mixed, slope = splat3(exact, q, FORM), splat3(exact, q, FORM + 3), splat3(exact, q, FORM + 6)
    form = 0.5 * dot(_second.steepness(pull, mixed, p), p) + dot(slope, p) + exact[q, FORM + 9]
    grow = 1 + extent(p)
    slack = 32 * U64 * (extent(e) * near.far / size(rise) + size(t))
    out = form > 64 * U64 * (near.far + 1) * grow + 4 * grow * near.speed * slack
    return alive(ray, i) & ~(out | (t + slack < wide(load(ray, START, i))) | (t - slack > until(ray, i)))


@inline
def meet_cap(ray, i, exact, q, most, even, end, todo, near, side):
    """Where the lanes `todo` cross the cap at e·p = end: t in the rays' precision, the lanes that do, the uncertain ones."""
    f, f1, v, v1 = line_in_unit(ray, i, exact, q, even)
    zero = 0 * f.x
    e, e1 = splat3(exact, q, SLAB), splat3(exact, q, NEXT)
    h, h1 = height(e, e1, f, f1)
    w, w1 = height(e, e1, v, v1)
    h, h1 = add(end + zero, zero, -h, -h1)
    t, _ = divide(h, h1, w, w1)
    m = form_of(exact, q, zero)
    x, x1 = advance(f.x, f1.x, t, v.x, v1.x)
    y, y1 = advance(f.y, f1.y, t, v.y, v1.y)
    z, z1 = advance(f.z, f1.z, t, v.z, v1.z)
    form = _second.value(m, x, x1, y, y1, z, z1)
    grow = 1 + extent(vec3(x, y, z))
    blur = 64 * U64 * U64 * extent(e)
    far = near.far + most * extent(splat3(exact, q, PLACE)) + 1
    left = blur * (far + near.speed * size(t)) / size(w)
    first, last = wide(load(ray, START, i)), until(ray, i)
    outside = (t + left < first) | (t - left > last)
    margin = 4 * grow * near.speed * (left + U64 * size(t)) + 256 * U64 * U64 * far * grow
    sure = (size(w) > blur * near.speed) & (outside | (form > margin) | ((form < -margin) & (left <= U64 * size(t))))
    hit = todo & sure & ~outside & (form < 0)
    outward = w * end
    if side & FRONT:
        hit = hit & (outward < 0)
    elif side & BACK:
        hit = hit & (outward > 0)
    return rounded(t, load(ray, T, i)), hit, todo & ~sure


@inline
def height(e, e1, p, p1):
    """e·p in pairs."""
    x, x1 = multiply(e.x, e1.x, p.x, p1.x)
    y, y1 = multiply(e.y, e1.y, p.y, p1.y)
    z, z1 = multiply(e.z, e1.z, p.z, p1.z)
    s, s1 = add(x, x1, y, y1)
    return add(s, s1, z, z1)


@kernel
def settle_cap(rays, i, p, table, q, end, opacity):
    """Ray i against the cap at e·p = end, the slow and certain way."""
    out_of_line()
    rays.tally[SLOW] += 1
    exact, side = table.exact, table.side[q]
    f, d, form, low, rise = np.empty((3, LONG)), np.empty((3, LONG)), np.empty((3, LONG)), np.empty(LONG), np.empty(LONG)
    terms, square = np.empty(6 * LONG * LONG + LONG), np.empty((3, LONG))
    far, speed = line_expanded(rays.ray, i, exact, q, f, d)
    heights(exact, q, f, low)
    heights(exact, q, d, rise)
    steep = max(abs(exact[q, SLAB]), max(abs(exact[q, SLAB + 1]), abs(exact[q, SLAB + 2])))
    off_low, off_rise = NOISE * (steep * far + 0.5), NOISE * steep * speed
    clear(rise, off_rise)
    if rise[0] == 0 or (side & FRONT and rise[0] * end > 0) or (side & BACK and rise[0] * end < 0):
        return
    for k in range(LONG):
        terms[k] = -low[k]
    terms[LONG] = end
    expand(terms, LONG + 1, low)
    clear(low, off_low)
    # within the rim: the form at t = low / rise, times rise², without a division
    line_form(exact, q, f, d, form)
    expand(terms, put_products(terms, 0, 1.0, low, low), square[0])
    expand(terms, put_products(terms, 0, 2.0, low, rise), square[1])
    expand(terms, put_products(terms, 0, 1.0, rise, rise), square[2])
    n = 0
    for k in range(3):
        n = put_products(terms, n, 1.0, form[k], square[k])
    expand(terms, n, square[0])
    noise, x, y = noise_along(exact, q, f, d, far, speed), abs(low[0]), abs(rise[0])
    slack = (noise[0] * x + 2 * noise[1] * y) * x + noise[2] * y * y        # a line within the wall meets the rims
    a, b, c = abs(form[0, 0]), abs(form[1, 0]), abs(form[2, 0])
    if square[0, 0] <= slack + 2 * ((a * x + b * y) * off_low + (b * x + c * y) * off_rise):
        record_one(rays, i, p, divide(low[0], low[1], rise[0], rise[1])[0], opacity)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk, where, exact = new_walk(rays), opacity.shape[0] == 0, table.exact
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            touched = 0
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                most, even, limit, caps, side = exact[q, MOST], exact[q, EVEN], exact[q, LIMIT], exact[q, CAPS], table.side[q]
                active = walk.state[ACTIVE]
                while active:
                    i = start + 8 * lowest_bit(active)
                    active &= active - 1
                    near = approach(rays.ray, i, exact, q, even)
                    todo = may_meet(near) & alive(rays.ray, i)
                    late = 0
                    if any_lane(todo):
                        touched |= 1 << (i - start) // 8
                        t, found, unsure = _second.meet(rays.ray, i, exact, q, most, even, IN_SLAB, limit, todo, near, side, where)
                        record(rays, i, first + q, t, found, opacity)
                        late = bits(unsure)
                    while late:
                        _second.settle(rays, i + lowest(late), first + q, table, q, IN_SLAB, opacity)
                        late &= late - 1
                    for cap in range(2):
                        if caps == cap + 1 or caps == 3:
                            todo = near_cap(rays.ray, i, exact, q, even, near, cap - 0.5)
                            if any_lane(todo):
                                touched |= 1 << (i - start) // 8
                                t, found, unsure = meet_cap(rays.ray, i, exact, q, most, even, cap - 0.5, todo, near, side)
                                record(rays, i, first + q, t, found, opacity)
                                late = bits(unsure)
                            while late:
                                settle_cap(rays, i + lowest(late), first + q, table, q, cap - 0.5, opacity)
                                late &= late - 1
            shrink(walk, rays, start, touched)
            leaf = next_leaf(walk, tree, table)


@kernel
def surface(rays, n, out, table, first):
    prim, data, room = rays.prim, table.data, new_room()
    for i in range(0, n, LANES):
        ok = among(prim, i, first, first + data.shape[0])
        if any_lane(ok):
            q = rows_of(prim, i, first, ok)
            p, slope, none = unit_hits(rays, i, data, q), pick(data, q, SLOPE), zero(pick(data, q, BASE))
            radius, off = pick(data, q, BASE) + slope * p.z, root(p.x * p.x + p.y * p.y)
            below = select(pick(data, q, LOWER) > 0, size(p.z), np.inf)
            above = select(pick(data, q, UPPER) > 0, size(p.z - 1), np.inf)
            cap = least(below, above) < size(off - radius)
            end = select(below < above, none, 1)
            # the apex has no normal: the axis stands in
            side = ~cap & (off > 0) & (radius > 0)
            x, y = select(side, p.x / off * radius, p.x), select(side, p.y / off * radius, p.y)
            axis = select(cap, 2 * end - 1, select(side, -slope, select(slope < 0, 1 + none, -1)))
            normal = vec3(select(side, x / radius, 0), select(side, y / radius, 0), axis)
            put_all_placed(out, i, ok, data, q, vec3(x, y, select(cap, end, p.z)), normal)
            if out.shape[0] > U:
                put_coordinates(out, i, ok, select(cap, (p.x + 1) / 2, angles(room, p.y, p.x)), select(cap, (p.y + 1) / 2, p.z))


def _bounds(data, extra):
    m = forward(data)
    discs = [data[:, :3] + m[:, :, 2] * z for z in (0, 1)]
    halves = [np.hypot(m[:, :, 0], m[:, :, 1]) * (data[:, BASE] + data[:, SLOPE] * z)[:, None] for z in (0, 1)]
    pad = 1e-9 * np.abs(m).sum(2)
    return (np.minimum(discs[0] - halves[0], discs[1] - halves[1]) - pad, np.maximum(discs[0] + halves[0], discs[1] + halves[1]) + pad)


# single cones as leaves: the box of a slanted one rejects more rays than it costs, 6 % of the time of tree.nff's cones
CONE = Kind("cone", intersect, surface, _bounds, (Cone((0, 0, 0), 1, (0, 0, 1)), ()), leaf_most=1)
