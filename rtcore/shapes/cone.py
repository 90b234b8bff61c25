"""Cylinder and Cone: one kind, the frustum x² + y² = (base + slope·z)² over z = 0 .. 1, placed by a matrix.

The quadratic is taken about the ray's closest approach to the frustum's middle, so a far eye costs no digits; roots by the
lecture's stable pair. A ray along a generator or through the apex has A = 0: then one root is infinite and fails the height test.
"""
from typing import Annotated

import numpy as np

from rtcore.bvh import PACKET, begin, new_walk, next_leaf, shrink
from rtcore.fields import FieldError, Flag, Number, Vec, Vector
from rtcore.jit import inline, kernel
from rtcore.lanes import along, dot, load, load3, root, select, splat3, vec3, with_sign
from rtcore.scene import Shape, invertible
from rtcore.shapes.kind import CENTER, FRONT, OWN, Kind, Packed, around, forward, into, placed, put_placed, unit_hit
from rtcore.wave import DX, OX, START, record

BASE, SLOPE, CAPPED = OWN, OWN + 1, OWN + 2


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


def frustum(base, base_radius, apex, apex_radius, capped, matrix) -> Packed:
    """The frustum with its greater radius scaled to 1, its axis to z and its height to 1."""
    base, axis = np.array(base), np.subtract(apex, base)
    length = np.abs(axis).max()
    z = axis / length / np.linalg.norm(axis / length)
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    most = max(base_radius, apex_radius)
    unit = np.eye(4)
    unit[:3, :3] = np.stack([x * most, np.cross(z, x) * most, axis], axis=1)
    unit[:3, 3] = base
    local = matrix @ unit
    return Packed(CONE, placed(local, invertible(local), base_radius / most, (apex_radius - base_radius) / most, float(capped))[None])


@inline
def hit_frustum(rays, i, p, o, d, base, slope, capped, side, opacity):
    """Eight rays against the frustum. o, d: Vec3 of lanes in its unit space."""
    start = load(rays.ray, START, i)
    centre = vec3(o.x, o.y, o.z - 0.5)
    shift = -dot(centre, d) / dot(d, d)
    near = along(o, shift, d)
    radius = base + slope * near.z
    a = d.x * d.x + d.y * d.y - slope * slope * d.z * d.z
    b = near.x * d.x + near.y * d.y - slope * d.z * radius
    c = near.x * near.x + near.y * near.y - radius * radius
    q = -(b + with_sign(root(b * b - a * c), b))
    s0, s1 = q / a, c / q
    far = 0 * shift + np.inf
    for k in range(2):
        s = s0 if k == 0 else s1
        z = near.z + s * d.z
        t = s + shift
        ok = (z >= 0) & (z <= 1) & (t > start)
        if side != 0:
            facing = (near.x + s * d.x) * d.x + (near.y + s * d.y) * d.y - slope * (base + slope * z) * d.z
            ok = ok & (facing < 0) if side & FRONT else ok & (facing > 0)
        far = select(ok & (t < far), t, far)
    if capped:
        for k in range(2):
            s = (k - near.z) / d.z
            x, y, r = near.x + s * d.x, near.y + s * d.y, base + slope * k
            t = s + shift
            ok = (x * x + y * y <= r * r) & (t > start)
            if side != 0:
                outward = d.z * (2 * k - 1)
                ok = ok & (outward < 0) if side & FRONT else ok & (outward > 0)
            far = select(ok & (t < far), t, far)
    record(rays, i, p, far, far < np.inf, opacity)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree)
        node = next_leaf(walk, tree)
        while node >= 0:
            for q in range(tree.link[node, 0], tree.link[node, 0] + tree.link[node, 1]):
                data = table.data
                for g in range(PACKET // 8):
                    if (walk.state[1] >> g) & 1:
                        i = start + g * 8
                        o = into(data, q, load3(rays.ray, OX, i) - splat3(data, q, CENTER))
                        d = into(data, q, load3(rays.ray, DX, i))
                        hit_frustum(rays, i, first + q, o, d, data[q, BASE], data[q, SLOPE], data[q, CAPPED] > 0, table.side[q], opacity)
            shrink(walk, rays, start)
            node = next_leaf(walk, tree)


@kernel
def surface(rays, n, out, table, first):
    last = first + table.data.shape[0]
    data = table.data
    for i in range(n):
        if first <= rays.prim[i] < last:
            q = rays.prim[i] - first
            x, y, z = unit_hit(rays, i, data, q)
            base, slope = np.float64(data[q, BASE]), np.float64(data[q, SLOPE])
            radius, off = base + slope * z, np.sqrt(x * x + y * y)
            beside, below, above = abs(off - radius), abs(z), abs(z - 1)
            if data[q, CAPPED] > 0 and min(below, above) < beside:
                z = 0.0 if below < above else 1.0
                put_placed(out, i, data, q, x, y, z, 0.0, 0.0, 2 * z - 1, (x + 1) / 2, (y + 1) / 2)
            else:
                u = around(out, y, x)
                if off > 0 and radius > 0:
                    x, y = x / off * radius, y / off * radius
                    put_placed(out, i, data, q, x, y, z, x / radius, y / radius, -slope, u, z)
                else:       # the apex has no normal: the axis stands in
                    put_placed(out, i, data, q, x, y, z, 0.0, 0.0, 1.0 if slope < 0 else -1.0, u, z)


def _bounds(data, extra):
    m = forward(data)
    discs = [data[:, :3] + m[:, :, 2] * z for z in (0, 1)]
    halves = [np.hypot(m[:, :, 0], m[:, :, 1]) * (data[:, BASE] + data[:, SLOPE] * z)[:, None] for z in (0, 1)]
    pad = 1e-9 * np.abs(m).sum(2)
    return (np.minimum(discs[0] - halves[0], discs[1] - halves[1]) - pad, np.maximum(discs[0] + halves[0], discs[1] + halves[1]) + pad)


CONE = Kind("cone", intersect, surface, _bounds, (Cone((0, 0, 0), 1, (0, 0, 1)), ()))
