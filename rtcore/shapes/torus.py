"""Torus: quartics, eight at once; what makes the answer certain is in `_torus.py`."""
from fractions import Fraction
from typing import Annotated

import numpy as np

from rtcore.directions import normalized
from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import inverse, moved, parts
from rtcore.fields import Number
from rtcore.indices import among, common, pick, rows_of
from rtcore.jit import inline, kernel
from rtcore.lanes import LANES, any_lane, bits, dot, load, load3, root, rounded, select, size, splat3, vec3, wide, zero
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import U32, U64, closest, extent, lowest, may_meet
from rtcore.shapes._torus import CONSTANTS, RADII, first_root, isolate, may_cross, settle
from rtcore.shapes._unit import PLACE, into_plain, line_in_pairs
from rtcore.shapes._surface import angles, new_room, put_all_placed, put_coordinates, unit_hits
from rtcore.shapes.kind import CENTER, OWN, Kind, Packed, forward, into, placed, placed_bounds
from rtcore.wave import DX, OX, START, T, U, record, until

MAJOR, MINOR, MOST = OWN, OWN + 1, OWN + 2      # the radii in the unit shape's lengths; the largest number of the matrix L into it


class Torus(Shape, frozen=True):
    """All points at `minor_radius` from a circle of `major_radius` about the origin in the plane z = 0. A minor radius above the major
    one gives a spindle, whose inner skin is part of the surface."""

    major_radius: Annotated[float, Number(above=0, help="radius of the circle in the middle of the tube", unit="scene units")]
    minor_radius: Annotated[float, Number(above=0, help="radius of the tube", unit="scene units")]

    def kind(self, matrix: np.ndarray) -> Kind:
        return TORUS

    def pack(self, matrix: np.ndarray) -> Packed:
        # in lengths of a power of two above R + r, so that the radii keep their digits
        unit = float(np.ldexp(1.0, np.frexp(self.major_radius / 2 + self.minor_radius / 2)[1] + 1))
        major, minor = Fraction(self.major_radius) / Fraction(unit), Fraction(self.minor_radius) / Fraction(unit)
        local = matrix @ np.diag([unit] * 3 + [1.0])
        around_center = invertible(local)
        back = [x / Fraction(unit) for row in inverse(matrix) for x in row]
        exact = [*parts(moved(matrix, (0, 0, 0)), 3), *parts(back, 3), float(major), float(minor),
                 *parts([major * major - minor * minor]), *parts([4 * major * major])]
        return Packed(TORUS, placed(local, around_center, float(major), float(minor), float(max(map(abs, back))))[None],
                      exact=np.array([exact]))


@inline
def spread(most, g, v, f, d):
    """What the errors of f = L g and d = L v are roundings of wherever f + t d is within 1 of its closest approach, `most` being the
    largest number of L."""
    dd = dot(d, d)
    return most * (extent(g) + extent(v) * (size(dot(f, d) / dd) + 1 / root(dd)))


@inline
def quick(rays, i, data, q):
    """Whether any of eight rays may meet the ball about torus q, by float32 arithmetic alone."""
    c = splat3(data, q, CENTER)
    g, v = load3(rays.ray, OX, i) - c, load3(rays.ray, DX, i)
    f, d = into(data, q, g), into(data, q, v)
    far = spread(data[q, MOST], g, v, f, d) + data[q, MOST] * extent(c)
    return any_lane(may_meet(closest(f, d, data[q, MAJOR] + data[q, MINOR], far, U32)))


@inline
def approach(ray, i, data, exact, q):
    """Of eight rays and torus q: origins and directions in its unit space, what `spread` says, and what `closest` says of the ball."""
    g, v = (wide(load3(ray, OX, i)) - splat3(exact, q, PLACE)) - splat3(exact, q, PLACE + 3), wide(load3(ray, DX, i))
    f, d = into_plain(exact, q, g), into_plain(exact, q, v)
    far = spread(np.float64(data[q, MOST]), g, v, f, d)
    return f, d, far, closest(f, d, exact[q, RADII] + exact[q, RADII + 1], far, U64)


@inline
def window(ray, i):
    """The interval of eight rays, in float64."""
    return wide(load(ray, START, i)), until(ray, i)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    exact = table.exact
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            touched = 0
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                for g in range(PACKET // 8):
                    i = start + g * 8
                    if (walk.state[ACTIVE] >> g) & 1 and (table.data.itemsize == 8 or quick(rays, i, table.data, q)):
                        f, d, far, near = approach(rays.ray, i, table.data, exact, q)
                        begins, ends = window(rays.ray, i)
                        todo = may_meet(near) & (begins < ends)
                        if any_lane(todo):
                            course = isolate(todo, f, d, near, far, exact[q, RADII], exact[q, RADII + 1])
                            todo = may_cross(todo, course)
                            if any_lane(todo):
                                touched |= 1 << g
                                f1, v, v1 = f, d, d
                                if table.data.itemsize == 8:
                                    f, f1, v, v1 = line_in_pairs(rays.ray, i, exact, q)
                                t, found, unsure = first_root(
                                    todo, course, near[1], root(dot(d, d)), f, f1, v, v1, exact[q, CONSTANTS], exact[q, CONSTANTS + 1],
                                    exact[q, CONSTANTS + 2], exact[q, CONSTANTS + 3], far, begins, ends, table.side[q],
                                    table.data.itemsize == 8)
                                record(rays, i, first + q, rounded(t, load(rays.ray, T, i)), found, opacity)
                                late = bits(unsure)
                                while late:
                                    settle(rays, i + lowest(late), first + q, table, q, opacity)
                                    late &= late - 1
            shrink(walk, rays, start, touched)
            leaf = next_leaf(walk, tree, table)


@kernel
def surface(rays, n, out, table, first):
    prim, data, room = rays.prim, table.data, new_room()
    for i in range(0, n, LANES):
        ok = among(prim, i, first, first + data.shape[0])
        if any_lane(ok):
            rows = rows_of(prim, i, first, ok)
            row = common(rows)
            if row >= 0:
                _put_tori(rays, i, ok, out, data, row, room)
            else:
                _put_tori(rays, i, ok, out, data, rows, room)


@inline
def _put_tori(rays, i, ok, out, data, q, room):
    """Surface rows of hits on tori q."""
    p, major, minor = unit_hits(rays, i, data, q), pick(data, q, MAJOR), pick(data, q, MINOR)
    off, height = root(p.x * p.x + p.y * p.y), p.z * p.z - minor * minor
    inner = size((off + major) * (off + major) + height) < size((off - major) * (off - major) + height)     # the skin within a spindle
    side = select(inner, -1, 1 + zero(off))
    x, y = select(off > 0, p.x / off * major, major) * side, select(off > 0, p.y / off * major, 0) * side
    normal = normalized(vec3(p.x - x, p.y - y, p.z))
    put_all_placed(out, i, ok, data, q, vec3(x + minor * normal.x, y + minor * normal.y, minor * normal.z), normal * side)
    if out.shape[0] > U:
        around = angles(room, p.y, p.x)
        put_coordinates(out, i, ok, around, angles(room, p.z, off - major))


def _bounds(data, extra):
    m = forward(data)
    half = data[:, MAJOR, None] * np.hypot(m[:, :, 0], m[:, :, 1]) + data[:, MINOR, None] * np.sqrt((m ** 2).sum(2))
    return placed_bounds(data, half)


TORUS = Kind("torus", intersect, surface, _bounds, (Torus(1, 0.25), ()))
