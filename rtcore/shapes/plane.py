"""Plane: the ray's height above it over the speed at which it falls (the notes' first form)."""
from typing import Annotated

import numpy as np

from rtcore.fields import Vec, Vector
from rtcore.jit import kernel
from rtcore.lanes import dot, load3, splat3
from rtcore.scene import Shape, invertible
from rtcore.shapes.kind import BACK, FRONT, Kind, Packed, put_flat
from rtcore.wave import DX, OX, record


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
            ok = (speed < 0) | (speed > 0)
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
            put_flat(rays, i, out, table.data, q, 3)


PLANE = Kind("plane", intersect, surface, None, (Plane((0, 0, 0), (0, 1, 0)), ()))
