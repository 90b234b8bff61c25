"""Torus: quartics, eight at once; what makes the answer certain is in `_torus.py`."""
from fractions import Fraction
from typing import Annotated

import numpy as np

from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import inverse, moved, parts
from rtcore.fields import Number
from rtcore.jit import inline, kernel
from rtcore.lanes import any_lane, bits, dot, load, load3, root, rounded, size, splat3, wide
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import U32, U64, closest, extent, lowest, may_meet
from rtcore.shapes._torus import CONSTANTS, RADII, first_root, isolate, may_cross, settle
from rtcore.shapes._unit import PLACE, into_plain, line_in_pairs
from rtcore.shapes.kind import CENTER, OWN, Kind, Packed, around, forward, into, placed, placed_bounds, put_placed, unit_hit
from rtcore.wave import DX, OX, START, T, record, until

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
        begin(walk, rays, start, n, tree, 1 << 30)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
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
            shrink(walk, rays, start)
            leaf = next_leaf(walk, tree, table)


@kernel
def surface(rays, n, out, table, first):
    last = first + table.data.shape[0]
    data = table.data
    for i in range(n):
        if first <= rays.prim[i] < last:
            q = rays.prim[i] - first
            x, y, z = unit_hit(rays, i, data, q)
            major, minor = np.float64(data[q, MAJOR]), np.float64(data[q, MINOR])
            off = np.sqrt(x * x + y * y)
            cx, cy = (x / off * major, y / off * major) if off > 0 else (major, 0.0)
            out_ = 1.0
            if abs((off + major) ** 2 + z * z - minor * minor) < abs((off - major) ** 2 + z * z - minor * minor):
                cx, cy, out_ = -cx, -cy, -1.0       # the inner skin of a spindle
            nx, ny, nz = x - cx, y - cy, z
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            if length > 0:
                nx, ny, nz = nx / length, ny / length, nz / length
            else:
                nx, ny, nz = 0.0, 0.0, 1.0
            u, v = around(out, y, x), around(out, z, off - major)
            put_placed(out, i, data, q, cx + minor * nx, cy + minor * ny, minor * nz, out_ * nx, out_ * ny, out_ * nz, u, v)


def _bounds(data, extra):
    m = forward(data)
    half = data[:, MAJOR, None] * np.hypot(m[:, :, 0], m[:, :, 1]) + data[:, MINOR, None] * np.sqrt((m ** 2).sum(2))
    return placed_bounds(data, half)


TORUS = Kind("torus", intersect, surface, _bounds, (Torus(1, 0.25), ()))
