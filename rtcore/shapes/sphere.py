"""Sphere: by the stable quadratic about the point of closest approach; under a transform that doesn't keep it round, an ellipsoid.

Discriminant from the perpendicular from the centre to the ray (Haines, Günther, Akenine-Möller, *Precision Improvements for Ray/Sphere
Intersection*, Ray Tracing Gems ch. 7), roots by the lecture's pair: one without cancellation, the other from their product; what makes
the answer certain is in `_ball.py`.
"""
import functools
from fractions import Fraction
from typing import Annotated

import numpy as np

from rtcore.across import lowest_bit
from rtcore.directions import normalized
from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import inverse, moved, parts
from rtcore.expansions import LONG, expand, noise_of
from rtcore.fields import Number, Vec, Vector
from rtcore.indices import among, common, pick, pick3, rows_of
from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import LANES, any_lane, bits, dot, load, load3, rounded, size, splat3, vec3, wide
from rtcore.pairs import two_sum
from rtcore.scene import Scale, Shape, invertible
from rtcore.shapes import _textbook
from rtcore.shapes._ball import U32, U64, choose, closest, extent, leads_away, lowest, may_meet, settle_one
from rtcore.shapes._unit import PLACE, into_plain, line_expanded, line_in_pairs, noise_here
from rtcore.shapes._surface import extent_of, hits_from, new_room, put_all_placed, put_globe, put_surfaces, unit_hits
from rtcore.shapes.kind import CENTER, OWN, Kind, Packed, forward, into, placed, placed_bounds, power_near
from rtcore.wave import DX, OX, START, T, alive, record, until


MOST = OWN      # ellipsoids: column of the largest number of the matrix L into unit space


class Sphere(Shape, frozen=True):
    """All points at `radius` from `center`."""

    center: Annotated[Vec, Vector(help="the middle", unit="scene units")]
    radius: Annotated[float, Number(above=0, help="distance of the surface from the centre", unit="scene units")]

    def kind(self, matrix: np.ndarray) -> Kind:
        return ELLIPSOID if round_scale(matrix) is None else SPHERE

    def pack(self, matrix: np.ndarray) -> Packed:
        factor = round_scale(matrix)
        center = matrix[:3, :3] @ self.center + matrix[:3, 3]
        if factor is not None:
            radius = factor * self.radius
            power = power_near(radius)
            if factor == 1 and not matrix[:3, 3].any() and matrix[0, 0] * matrix[1, 1] * matrix[2, 2] == 1:
                exact = [*center, 0, 0, 0, radius / power, 0]
            else:
                exact = [*parts(moved(matrix, self.center)), *parts([Fraction(factor) * Fraction(self.radius) / Fraction(float(power))])]
            return Packed(SPHERE, np.array([[*center, radius / power, power, 1 / power]]), exact=np.array([exact], float))
        local = matrix @ np.diag([self.radius] * 3 + [1.0])
        local[:3, 3] = center
        back = invertible(local)
        into = [x / Fraction(self.radius) for row in inverse(matrix) for x in row]
        exact = [*parts(moved(matrix, self.center), 3), *parts(into, 3)]
        return Packed(ELLIPSOID, placed(local, back, *parts([max(map(abs, into))], 1))[None], exact=np.array([exact]))


def round_scale(matrix: np.ndarray) -> float | None:
    """The scale of a 4 x 4 matrix that, beside moving, only scales evenly, mirrors and swaps axes: exactly, so that a sphere stays one
    to the last bit; else None. A turn by another angle is no similarity any more once it has been rounded."""
    return _round_scale(matrix[:3, :3].tobytes())


@functools.lru_cache(maxsize=4096)      # thousands of leaves share a few matrices, and are asked twice
def _round_scale(linear: bytes) -> float | None:
    m = np.abs(np.frombuffer(linear).reshape(3, 3))
    there = m > 0
    factor = float(m.max())
    once = (there.sum(0) == 1).all() and (there.sum(1) == 1).all() and (m[there] == factor).all() and factor < np.inf
    return factor if once else None


@inline
def quick_sphere(rays, i, data, q):
    """Whether any of eight rays may meet sphere q, by float32 arithmetic alone."""
    d = load3(rays.ray, DX, i)
    c, unpower = splat3(data, q, 0), data[q, 5]
    f = (load3(rays.ray, OX, i) - c) * unpower
    return any_lane(may_meet(closest(f, d, data[q, 3], extent(f) + extent(c) * unpower, U32)))


@inline
def approach(ray, i, data, exact, q):
    """Of eight rays and sphere q: a bound on the size of the origins seen from the centre, in units of the sphere's; what `closest` says;
    the lanes that lead away."""
    f = ((wide(load3(ray, OX, i)) - splat3(exact, q, 0)) - splat3(exact, q, 3)) * np.float64(data[q, 5])
    far, radius = extent(f), exact[q, 6]
    near = closest(f, wide(load3(ray, DX, i)), radius, far, U64)
    # each part of f is off by 2 roundings of itself, f² by 8 of f², radius² by 3
    return far, near, leads_away(f, near, radius, 16 * U64 * dot(f, f))


@inline
def apart(o, c, c1):
    """o - (c + c1) as a pair whose first number is the nearest, also where o is so near to c that c1 counts."""
    f, f1 = two_sum(o, -c)
    return two_sum(f, f1 - c1)


@inline
def meet(ray, i, data, exact, q, todo, far, near, side, where):
    """Where the lanes `todo` first meet sphere q: as `choose`, t in the rays' precision."""
    o, d, c, unpower = wide(load3(ray, OX, i)), wide(load3(ray, DX, i)), splat3(exact, q, 0), np.float64(data[q, 5])
    c1 = splat3(exact, q, 3)
    x, x1 = apart(o.x, c.x, c1.x)
    y, y1 = apart(o.y, c.y, c1.y)
    z, z1 = apart(o.z, c.z, c1.z)
    f, f1 = vec3(x, y, z) * unpower, vec3(x1, y1, z1) * unpower
    end, zero = load(ray, T, i), 0 * x
    s, found, unsure = choose(todo, near, f, f1, d, vec3(zero, zero, zero), exact[q, 6] + zero, exact[q, 7] + zero,
                              far + extent(c) * unpower, extent(d), wide(load(ray, START, i)) * unpower, until(ray, i) * unpower, side, end,
                              where)
    return rounded(s * np.float64(data[q, 4]), end), found, unsure


@kernel
def settle_sphere(rays, i, p, table, q, opacity):
    """Ray i against sphere q, the slow and certain way."""
    out_of_line()
    exact, terms = table.exact, np.empty(3 + LONG)
    f, d = np.zeros((3, LONG)), np.zeros((3, LONG))
    for k in range(3):
        terms[0], terms[1], terms[2] = rays.ray[OX + k, i], -exact[q, k], -exact[q, 3 + k]
        for j in range(3):
            terms[j] *= table.data[q, 5]
        expand(terms, 3, f[k])
        d[k, 0] = rays.ray[DX + k, i]
    settle_one(rays, i, p, f, d, (0.0, 0.0, 0.0, 0.0), exact[q, 6], exact[q, 7], np.float64(table.data[q, 4]), table.side[q], opacity)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk, where = new_walk(rays), opacity.shape[0] == 0
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            touched = 0
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                active = walk.state[ACTIVE]
                while active:
                    i = start + 8 * lowest_bit(active)
                    active &= active - 1
                    if table.data.itemsize == 8 or quick_sphere(rays, i, table.data, q):
                        far, near, gone = approach(rays.ray, i, table.data, table.exact, q)
                        todo = may_meet(near) & alive(rays.ray, i) & ~gone
                        if any_lane(todo):
                            touched |= 1 << (i - start) // 8
                            t, found, unsure = meet(rays.ray, i, table.data, table.exact, q, todo, far, near, table.side[q], where)
                            record(rays, i, first + q, t, found, opacity)
                            late = bits(unsure)
                            while late:
                                settle_sphere(rays, i + lowest(late), first + q, table, q, opacity)
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
                _put_spheres(rays, i, ok, out, data, row, room)
            else:
                _put_spheres(rays, i, ok, out, data, rows, room)


@inline
def _put_spheres(rays, i, ok, out, data, q, room):
    """Surface rows of hits on spheres q."""
    c, r = pick3(data, q, 0), pick(data, q, 3) * pick(data, q, 4)
    normal = normalized(hits_from(rays, i, c))
    # the point is brought back onto the sphere: its error does not grow with the distance of the eye
    put_surfaces(out, i, ok, c + normal * r, normal, extent_of(c) + r)
    put_globe(out, i, ok, room, normal)


@inline
def quick_ellipsoid(rays, i, data, q):
    """Whether any of eight rays may meet ellipsoid q, by float32 arithmetic alone."""
    c = splat3(data, q, CENTER)
    g, v = load3(rays.ray, OX, i) - c, load3(rays.ray, DX, i)
    f, d = into(data, q, g), into(data, q, v)
    return any_lane(may_meet(closest(f, d, 1, reach(data[q, MOST], g, v, f, d) + data[q, MOST] * extent(c), U32)))


@inline
def approach_ellipsoid(ray, i, data, exact, q):
    """As `approach`, in the unit space of ellipsoid q."""
    g, v = (wide(load3(ray, OX, i)) - splat3(exact, q, PLACE)) - splat3(exact, q, PLACE + 3), wide(load3(ray, DX, i))
    f, d = into_plain(exact, q, g), into_plain(exact, q, v)
    far = reach(np.float64(data[q, MOST]), g, v, f, d)
    near = closest(f, d, 1, far, U64)
    # f is off by 4 roundings of `far`, f² by 14 of its square
    return far, near, leads_away(f, near, 1, 32 * U64 * (far * far))


@inline
def meet_ellipsoid(ray, i, data, exact, q, todo, far, near, side, where):
    """As `meet`."""
    f, f1, v, v1 = line_in_pairs(ray, i, exact, q)
    most, end, zero = np.float64(data[q, MOST]), load(ray, T, i), 0 * f.x
    s, found, unsure = choose(todo, near, f, f1, v, v1, 1 + zero, zero, far + most * extent(splat3(exact, q, PLACE)),
                              most * extent(wide(load3(ray, DX, i))), wide(load(ray, START, i)), until(ray, i), side, end, where)
    return rounded(s, end), found, unsure


@inline
def reach(most, g, v, f, d):
    """What the errors of f = L g and d = L v are roundings of, `most` being the largest number of L: that of f, and that of d where the
    ray comes closest."""
    return most * (extent(g) + extent(v) * size(dot(f, d) / dot(d, d)))


@kernel
def settle_ellipsoid(rays, i, p, table, q, opacity):
    """Ray i against ellipsoid q, the slow and certain way."""
    out_of_line()
    f, d = np.empty((3, LONG)), np.empty((3, LONG))
    far, speed = line_expanded(rays.ray, i, table.exact, q, f, d)
    noise = noise_of(f, d, far, speed, 1.0, 0.0, 1.0, noise_here(table.exact, q, 0, 0))
    settle_one(rays, i, p, f, d, noise, 1.0, 0.0, 1.0, table.side[q], opacity)


@kernel
def intersect_ellipsoid(rays, n, tree, table, first, opacity):
    walk, where = new_walk(rays), opacity.shape[0] == 0
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            touched = 0
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                active = walk.state[ACTIVE]
                while active:
                    i = start + 8 * lowest_bit(active)
                    active &= active - 1
                    if table.data.itemsize == 8 or quick_ellipsoid(rays, i, table.data, q):
                        far, near, gone = approach_ellipsoid(rays.ray, i, table.data, table.exact, q)
                        todo = may_meet(near) & alive(rays.ray, i) & ~gone
                        if any_lane(todo):
                            touched |= 1 << (i - start) // 8
                            side = table.side[q]
                            t, found, unsure = meet_ellipsoid(rays.ray, i, table.data, table.exact, q, todo, far, near, side, where)
                            record(rays, i, first + q, t, found, opacity)
                            late = bits(unsure)
                            while late:
                                settle_ellipsoid(rays, i + lowest(late), first + q, table, q, opacity)
                                late &= late - 1
            shrink(walk, rays, start, touched)
            leaf = next_leaf(walk, tree, table)


@kernel
def surface_ellipsoid(rays, n, out, table, first):
    prim, data, room = rays.prim, table.data, new_room()
    for i in range(0, n, LANES):
        ok = among(prim, i, first, first + data.shape[0])
        if any_lane(ok):
            rows = rows_of(prim, i, first, ok)
            row = common(rows)
            if row >= 0:
                _put_ellipsoids(rays, i, ok, out, data, row, room)
            else:
                _put_ellipsoids(rays, i, ok, out, data, rows, room)


@inline
def _put_ellipsoids(rays, i, ok, out, data, q, room):
    """Surface rows of hits on ellipsoids q."""
    p = normalized(unit_hits(rays, i, data, q))
    put_all_placed(out, i, ok, data, q, p, p)
    put_globe(out, i, ok, room, p)


def _bounds(data, extra):
    radius = data[:, 3:4] * data[:, 4:5]
    return data[:, :3] - radius, data[:, :3] + radius


def _bounds_ellipsoid(data, extra):
    return placed_bounds(data, np.sqrt((forward(data) ** 2).sum(2)))


SPHERE = Kind("sphere", intersect, surface, _bounds, (Sphere((0, 0, 0), 1), ()), textbook=_textbook.intersect_sphere)
ELLIPSOID = Kind("ellipsoid", intersect_ellipsoid, surface_ellipsoid, _bounds_ellipsoid, (Sphere((0, 0, 0), 1), (Scale((1, 2, 3)),)),
                 textbook=_textbook.intersect_ellipsoid)
