"""Box: the unit cube -1 .. 1 by slabs, placed by a matrix."""
from typing import Annotated

import numpy as np

from rtcore.bvh import PACKET, begin, new_walk, next_leaf, shrink
from rtcore.fields import FieldError, Vec, Vector
from rtcore.jit import inline, kernel
from rtcore.lanes import greatest, least, load, load3, rounded, select, splat3, wide, with_sign
from rtcore.scene import Shape, invertible
from rtcore.shapes.kind import CENTER, FRONT, Kind, Packed, forward, into, placed, placed_bounds, put_placed, unit_hit
from rtcore.wave import DX, OX, START, record


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
        row = placed(local, invertible(local))[None]
        return Packed(BOX, row, exact=row)


@inline
def hit_cube(ray, i, exact, q, side):
    """Where eight rays meet box q, a cube in its unit space, and whether they do; in float64. A ray in the plane of a face (0·inf, a NaN)
    is left to the other slabs."""
    o = into(exact, q, wide(load3(ray, OX, i)) - splat3(exact, q, CENTER))
    d = into(exact, q, wide(load3(ray, DX, i)))
    ix, iy, iz = 1 / d.x, 1 / d.y, 1 / d.z
    one = 1 + 0 * d.x
    # the face through which a slab is left; its counterpart is entered. A sign knows them apart where a minimum sees a NaN
    x, y, z = with_sign(one, d.x), with_sign(one, d.y), with_sign(one, d.z)
    enter = greatest((-z - o.z) * iz, greatest((-y - o.y) * iy, greatest((-x - o.x) * ix, -np.inf)))
    leave = least((z - o.z) * iz, least((y - o.y) * iy, least((x - o.x) * ix, np.inf)))
    start = load(ray, START, i)
    t = select(enter > wide(start), enter, leave)
    if side != 0:
        t = enter if side & FRONT else leave
    return rounded(t, start), enter <= leave


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree)
        node = next_leaf(walk, tree)
        while node >= 0:
            for q in range(tree.link[node, 0], tree.link[node, 0] + tree.link[node, 1]):
                for g in range(PACKET // 8):
                    if (walk.state[1] >> g) & 1:
                        i = start + g * 8
                        t, ok = hit_cube(rays.ray, i, table.exact, q, table.side[q])
                        record(rays, i, first + q, t, ok, opacity)
            shrink(walk, rays, start)
            node = next_leaf(walk, tree)


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
