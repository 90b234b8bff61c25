"""Sphere: by the stable quadratic about the point of closest approach; under a transform that is no similarity, an ellipsoid.

Discriminant from the perpendicular from the centre to the ray (Haines, Günther, Akenine-Möller, *Precision Improvements for Ray/Sphere
Intersection*, Ray Tracing Gems ch. 7), roots by the lecture's pair: one without cancellation, the other from their product.
"""
from typing import Annotated

import numpy as np

from rtcore.fields import Number, Vec, Vector
from rtcore.bvh import PACKET, begin, new_walk, next_leaf, shrink
from rtcore.jit import inline, kernel
from rtcore.lanes import along, dot, load, load3, root, select, splat3, with_sign
from rtcore.scene import Scale, Shape, invertible
from rtcore.shapes.kind import (CENTER, Kind, Packed, around, forward, into, normalized, placed, placed_bounds, power_near, put_placed,
                                put_surface, similarity, unit_hit)
from rtcore.wave import DX, OX, START, T, U, record


class Sphere(Shape, frozen=True):
    """All points at `radius` from `center`."""

    center: Annotated[Vec, Vector(help="the middle", unit="scene units")]
    radius: Annotated[float, Number(above=0, help="distance of the surface from the centre", unit="scene units")]

    def kind(self, matrix: np.ndarray) -> Kind:
        return ELLIPSOID if similarity(matrix) is None else SPHERE

    def pack(self, matrix: np.ndarray) -> Packed:
        scale = similarity(matrix)
        center = matrix[:3, :3] @ self.center + matrix[:3, 3]
        if scale is not None:
            radius = scale * self.radius
            power = power_near(radius)
            return Packed(SPHERE, np.array([[*center, radius / power, power, 1 / power]]))
        local = matrix @ np.diag([self.radius] * 3 + [1.0])
        local[:3, 3] = center
        return Packed(ELLIPSOID, placed(local, invertible(local))[None])


@inline
def hit_ball(rays, i, p, f, d, radius, power, side, opacity):
    """Eight rays (f + t / power d) against the sphere of the radius about the origin. f, d: Vec3 of lanes; radius: lanes or a number."""
    square = dot(d, d)
    middle = -dot(f, d) / square
    nearest = along(f, middle, d)
    half = root((radius * radius - dot(nearest, nearest)) / square)         # NaN where the ray misses: then nothing below is true
    far = middle + with_sign(half, middle)
    near = (dot(f, f) - radius * radius) / (square * far)
    near, far = near * power, far * power
    enter, leave = select(middle > 0, near, far), select(middle > 0, far, near)
    if side == 0:
        t = select(enter > load(rays.ray, START, i), enter, leave)
    else:
        t = enter if side & 1 else leave
    record(rays, i, p, t, half >= 0, opacity)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree)
        node = next_leaf(walk, tree)
        while node >= 0:
            for q in range(tree.link[node, 0], tree.link[node, 0] + tree.link[node, 1]):
                center, power = splat3(table.data, q, 0), table.data[q, 4]
                for g in range(PACKET // 8):
                    if (walk.state[1] >> g) & 1:
                        i = start + g * 8
                        d = load3(rays.ray, DX, i)
                        f = (load3(rays.ray, OX, i) - center) * table.data[q, 5]
                        hit_ball(rays, i, first + q, f, d, table.data[q, 3] + 0 * d.x, power, table.side[q], opacity)
            shrink(walk, rays, start)
            node = next_leaf(walk, tree)


@kernel
def surface(rays, n, out, table, first):
    last = first + table.data.shape[0]
    for i in range(n):
        p = rays.prim[i]
        if first <= p < last:
            q = p - first
            t, r = np.float64(rays.ray[T, i]), np.float64(table.data[q, 3]) * table.data[q, 4]
            cx, cy, cz = np.float64(table.data[q, 0]), np.float64(table.data[q, 1]), np.float64(table.data[q, 2])
            nx, ny, nz = normalized(rays.ray[OX, i] + t * rays.ray[DX, i] - cx, rays.ray[OX + 1, i] + t * rays.ray[DX + 1, i] - cy,
                                    rays.ray[OX + 2, i] + t * rays.ray[DX + 2, i] - cz)
            # the point is brought back onto the sphere: its error does not grow with the distance of the eye
            put_surface(out, i, cx + r * nx, cy + r * ny, cz + r * nz, nx, ny, nz, *globe(out, nx, ny, nz),
                        max(abs(cx), max(abs(cy), abs(cz))) + r)


@inline
def globe(out, x, y, z):
    """Longitude and latitude of a unit vector, each 0 .. 1; the poles are on z."""
    return around(out, y, x), np.arccos(min(max(-z, -1.0), 1.0)) / np.pi if out.shape[0] > U else 0.0


@kernel
def intersect_ellipsoid(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree)
        node = next_leaf(walk, tree)
        while node >= 0:
            for q in range(tree.link[node, 0], tree.link[node, 0] + tree.link[node, 1]):
                for g in range(PACKET // 8):
                    if (walk.state[1] >> g) & 1:
                        i = start + g * 8
                        f = into(table.data, q, load3(rays.ray, OX, i) - splat3(table.data, q, CENTER))
                        d = into(table.data, q, load3(rays.ray, DX, i))
                        hit_ball(rays, i, first + q, f, d, 1 + 0 * d.x, 1, table.side[q], opacity)
            shrink(walk, rays, start)
            node = next_leaf(walk, tree)


@kernel
def surface_ellipsoid(rays, n, out, table, first):
    last = first + table.data.shape[0]
    for i in range(n):
        if first <= rays.prim[i] < last:
            q = rays.prim[i] - first
            x, y, z = normalized(*unit_hit(rays, i, table.data, q))
            u, v = globe(out, x, y, z)
            put_placed(out, i, table.data, q, x, y, z, x, y, z, u, v)


def _bounds(data, extra):
    radius = data[:, 3:4] * data[:, 4:5]
    return data[:, :3] - radius, data[:, :3] + radius


def _bounds_ellipsoid(data, extra):
    return placed_bounds(data, np.sqrt((forward(data) ** 2).sum(2)))


SPHERE = Kind("sphere", intersect, surface, _bounds, (Sphere((0, 0, 0), 1), ()))
ELLIPSOID = Kind("ellipsoid", intersect_ellipsoid, surface_ellipsoid, _bounds_ellipsoid, (Sphere((0, 0, 0), 1), (Scale((1, 2, 3)),)))
