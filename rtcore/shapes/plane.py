"""Plane: the ray's height above it over the speed at which it falls (the notes' first form)."""
from typing import Annotated

import numpy as np

from rtcore.fields import Vec, Vector
from rtcore.jit import kernel
from rtcore.lanes import dot, load3, splat3
from rtcore.scene import Shape, invertible
from rtcore.shapes.kind import BACK, FRONT, Kind, Packed, normalized, put_surface
from rtcore.wave import DX, OX, T, record


class Plane(Shape, frozen=True):
    """The unbounded plane through `point`; `sides="front"` makes it the notes' one-sided plane."""

    point: Annotated[Vec, Vector(help="any point of it", unit="scene units")]
    normal: Annotated[Vec, Vector(nonzero=True, help="at right angles to it, on its front; of any length")]

    def kind(self, matrix: np.ndarray) -> Kind:
        return PLANE

    def pack(self, matrix: np.ndarray) -> Packed:
        normal = invertible(matrix)[:3, :3].T @ (np.array(self.normal) / np.abs(self.normal).max())
        normal /= np.abs(normal).max()
        return Packed(PLANE, np.array([[*(matrix[:3, :3] @ self.point + matrix[:3, 3]), *(normal / np.linalg.norm(normal))]]))


@kernel
def intersect(rays, n, tree, table, first, opacity):
    for q in range(table.data.shape[0]):
        point, normal, side = splat3(table.data, q, 0), splat3(table.data, q, 3), table.side[q]
        for i in range(0, n, 8):
            speed = dot(normal, load3(rays.ray, DX, i))
            ok = speed * speed > 0
            if side == FRONT:
                ok = speed < 0
            elif side == BACK:
                ok = speed > 0
            record(rays, i, first + q, dot(normal, point - load3(rays.ray, OX, i)) / speed, ok, opacity)


@kernel
def surface(rays, n, out, table, first):
    last = first + table.data.shape[0]
    for i in range(n):
        if first <= rays.prim[i] < last:
            q = rays.prim[i] - first
            t = np.float64(rays.ray[T, i])
            cx, cy, cz = table.data[q, 0], table.data[q, 1], table.data[q, 2]
            nx, ny, nz = normalized(table.data[q, 3], table.data[q, 4], table.data[q, 5])
            x, y, z = rays.ray[OX, i] + t * rays.ray[DX, i] - cx, rays.ray[OX + 1, i] + t * rays.ray[DX + 1, i] - cy, rays.ray[OX + 2, i] + t * rays.ray[DX + 2, i] - cz
            height = x * nx + y * ny + z * nz
            x, y, z = x - height * nx, y - height * ny, z - height * nz
            # texture coordinates along the two axes that the normal points at least
            u, v = (y, z) if abs(nx) >= max(abs(ny), abs(nz)) else (z, x) if abs(ny) >= abs(nz) else (x, y)
            put_surface(out, i, cx + x, cy + y, cz + z, nx, ny, nz, u, v, max(abs(cx), max(abs(cy), abs(cz))))


PLANE = Kind("plane", intersect, surface, None, (Plane((0, 0, 0), (0, 1, 0)), ()))
