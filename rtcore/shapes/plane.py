"""Plane: the ray's height above it over the speed at which it falls (the notes' first form); what makes it certain is in `_flat.py`."""
from typing import Annotated

import numpy as np

from rtcore.exact import moved
from rtcore.fields import Vec, Vector
from rtcore.indices import among, common, rows_of
from rtcore.jit import kernel
from rtcore.lanes import LANES, any_lane, bits
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import lowest
from rtcore.shapes._flat import NORMAL, approach, exact_plane, meet, settle
from rtcore.shapes._surface import put_flats
from rtcore.shapes.kind import Kind, Packed
from rtcore.wave import record


class Plane(Shape, frozen=True):
    """The unbounded plane through `point`; `sides="front"` makes it the notes' one-sided plane."""

    point: Annotated[Vec, Vector(help="any point of it", unit="scene units")]
    normal: Annotated[Vec, Vector(nonzero=True, help="at right angles to it, on its front; of any length")]

    def kind(self, matrix: np.ndarray) -> Kind:
        return PLANE

    def pack(self, matrix: np.ndarray) -> Packed:
        invertible(matrix)
        exact = np.array(exact_plane(matrix, moved(matrix, self.point), self.normal))
        normal = exact[NORMAL:NORMAL + 3]
        return Packed(PLANE, np.array([[*exact[:3], *(normal / np.linalg.norm(normal))]]), exact=exact[None])


@kernel
def intersect(rays, n, tree, table, first, opacity):
    for q in range(table.data.shape[0]):
        for i in range(0, n, 8):
            _, _, todo = approach(rays.ray, i, table.exact, q)
            if any_lane(todo):
                t, hit, unsure = meet(rays.ray, i, table.exact, q, todo, table.side[q])
                record(rays, i, first + q, t, hit, opacity)
                late = bits(unsure)
                while late:
                    settle(rays, i + lowest(late), first + q, table, q, opacity)
                    late &= late - 1


@kernel
def surface(rays, n, out, table, first):
    prim, data = rays.prim, table.data
    for i in range(0, n, LANES):
        ok = among(prim, i, first, first + data.shape[0])
        if any_lane(ok):
            rows = rows_of(prim, i, first, ok)
            row = common(rows)
            if row >= 0:
                put_flats(rays, i, ok, out, data, row, 3)
            else:
                put_flats(rays, i, ok, out, data, rows, 3)


PLANE = Kind("plane", intersect, surface, None, (Plane((0, 0, 0), (0, 1, 0)), ()))
