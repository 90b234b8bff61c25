"""Quadric: Ax² + By² + Cz² + Dxy + Exz + Fyz + Gx + Hy + Iz + J = 0, within a box if one is given.

The quadratic is taken about the ray's closest approach to the box's middle, its discriminant by differences of products with one
rounding (Kahan), the roots by the lecture's stable pair; where A is 0 or nearly, one of them is infinite and drops out.
"""
from typing import Annotated

import numpy as np

from rtcore.bvh import PACKET, begin, new_walk, next_leaf, shrink
from rtcore.fields import FieldError, Maybe, Numbers, Vec, Vector
from rtcore.jit import inline, kernel
from rtcore.lanes import along, dot, fma, load, load3, root, select, splat3, vec3, with_sign
from rtcore.scene import Shape, invertible
from rtcore.shapes.kind import (CENTER, FRONT, OWN, Kind, Packed, around, forward, into, normalized, placed, placed_bounds, put_placed,
                                unit_hit)
from rtcore.wave import DX, OX, START, record

LOW, HIGH = OWN + 10, OWN + 13


class Quadric(Shape, frozen=True):
    """The points where the quadratic form of the ten `coefficients`, of x², y², z², xy, xz, yz, x, y, z and 1, is 0. Its front is where
    the form is positive. `low` and `high` cut off what lies outside a box."""

    coefficients: Annotated[tuple[float, ...], Numbers(count=10, help="of x², y², z², xy, xz, yz, x, y, z and 1")]
    low: Annotated[Vec | None, Maybe(inner=Vector(), help="corner of the box with the smallest coordinates", unit="scene units")] = None
    high: Annotated[Vec | None, Maybe(inner=Vector(), help="corner of the box with the largest coordinates", unit="scene units")] = None

    def check(self):
        if not any(self.coefficients[:9]):
            raise FieldError("a coefficient other than 0 besides the last", self.coefficients, "coefficients")
        if (self.low is None) != (self.high is None):
            raise FieldError("both corners of the box, or neither", None, "low" if self.low is None else "high")
        if self.low is not None and not all(a < b for a, b in zip(self.low, self.high)):
            raise FieldError(f"three numbers each greater than those of low, {self.low}", self.high, "high")

    def kind(self, matrix: np.ndarray) -> Kind:
        return OPEN_QUADRIC if self.low is None else QUADRIC

    def pack(self, matrix: np.ndarray) -> Packed:
        low, high = (np.full(3, -np.inf), np.full(3, np.inf)) if self.low is None else (np.array(self.low), np.array(self.high))
        middle, half = (np.zeros(3), 1.0) if self.low is None else (low / 2 + high / 2, float((high / 2 - low / 2).max()))
        unit = np.diag([half] * 3 + [1.0])
        unit[:3, 3] = middle
        local = matrix @ unit
        biggest = np.finfo(np.float32).max      # no end, in either precision
        box = np.clip(np.concatenate([(low - middle) / half, (high - middle) / half]), -biggest, biggest)
        return Packed(self.kind(matrix), placed(local, invertible(local), *moved(self.coefficients, middle, half), *box)[None])


def moved(coefficients, middle: np.ndarray, half: float) -> np.ndarray:
    """The coefficients (10) after p = middle + half·p', scaled so that the largest is 1."""
    a, b, c, d, e, f, g, h, i, j = coefficients
    form = np.array([[a, d / 2, e / 2], [d / 2, b, f / 2], [e / 2, f / 2, c]])
    slope = np.array([g, h, i])
    constant = middle @ form @ middle + slope @ middle + j
    slope, form = (slope + 2 * form @ middle) * half, form * half * half
    result = np.array([*np.diag(form), 2 * form[0, 1], 2 * form[0, 2], 2 * form[1, 2], *slope, constant])
    return result / np.abs(result).max()


@inline
def difference(a, b, c, d):
    """a·b - c·d with a rounding error of the result's own size (Kahan; Jeannerod, Louvet, Muller 2013)."""
    w = c * d
    return fma(a, b, -w) - fma(c, d, -w)


@inline
def hit_quadric(rays, i, p, o, d, data, q, side, opacity):
    """Eight rays, o and d in the unit space of quadric q."""
    k = OWN
    start = load(rays.ray, START, i)
    shift = -dot(o, d) / dot(d, d)
    n = along(o, shift, d)
    pull, mixed, slope = splat3(data, q, k), splat3(data, q, k + 3), splat3(data, q, k + 6)
    # half the gradient's form at d and at n
    md = vec3(2 * pull.x * d.x + mixed.x * d.y + mixed.y * d.z, mixed.x * d.x + 2 * pull.y * d.y + mixed.z * d.z,
              mixed.y * d.x + mixed.z * d.y + 2 * pull.z * d.z)
    mn = vec3(2 * pull.x * n.x + mixed.x * n.y + mixed.y * n.z, mixed.x * n.x + 2 * pull.y * n.y + mixed.z * n.z,
              mixed.y * n.x + mixed.z * n.y + 2 * pull.z * n.z)
    a = 0.5 * dot(md, d)
    b = 0.5 * (dot(mn, d) + dot(slope, d))
    c = 0.5 * dot(mn, n) + dot(slope, n) + data[q, k + 9]
    w = -(b + with_sign(root(difference(b, b, a, c)), b))
    s0, s1 = w / a, c / w
    best = 0 * start + np.inf
    low, high = splat3(data, q, LOW), splat3(data, q, HIGH)
    for j in range(2):
        s = s0 if j == 0 else s1
        h = along(n, s, d)
        t = s + shift
        ok = (t > start) & (h.x >= low.x) & (h.y >= low.y) & (h.z >= low.z) & (h.x <= high.x) & (h.y <= high.y) & (h.z <= high.z)
        if side != 0:
            facing = a * s + b
            ok = ok & (facing < 0) if side & FRONT else ok & (facing > 0)
        best = select(ok & (t < best), t, best)
    record(rays, i, p, best, best < np.inf, opacity)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    data = table.data
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree)
        node = next_leaf(walk, tree)
        while node >= 0:
            for q in range(tree.link[node, 0], tree.link[node, 0] + tree.link[node, 1]):
                for g in range(PACKET // 8):
                    if (walk.state[1] >> g) & 1:
                        i = start + g * 8
                        o = into(data, q, load3(rays.ray, OX, i) - splat3(data, q, CENTER))
                        hit_quadric(rays, i, first + q, o, into(data, q, load3(rays.ray, DX, i)), data, q, table.side[q], opacity)
            shrink(walk, rays, start)
            node = next_leaf(walk, tree)


@kernel
def intersect_open(rays, n, tree, table, first, opacity):
    data = table.data
    for q in range(data.shape[0]):
        for i in range(0, n, 8):
            o = into(data, q, load3(rays.ray, OX, i) - splat3(data, q, CENTER))
            hit_quadric(rays, i, first + q, o, into(data, q, load3(rays.ray, DX, i)), data, q, table.side[q], opacity)


@kernel
def surface(rays, n, out, table, first):
    last = first + table.data.shape[0]
    data = table.data
    for i in range(n):
        if first <= rays.prim[i] < last:
            q = rays.prim[i] - first
            x, y, z = unit_hit(rays, i, data, q)
            k = OWN
            gx, gy, gz = 0.0, 0.0, 0.0
            for _ in range(2):      # the point is brought onto the surface along the gradient
                gx = 2 * data[q, k] * x + data[q, k + 3] * y + data[q, k + 4] * z + data[q, k + 6]
                gy = data[q, k + 3] * x + 2 * data[q, k + 1] * y + data[q, k + 5] * z + data[q, k + 7]
                gz = data[q, k + 4] * x + data[q, k + 5] * y + 2 * data[q, k + 2] * z + data[q, k + 8]
                value = 0.5 * (x * (gx + data[q, k + 6]) + y * (gy + data[q, k + 7]) + z * (gz + data[q, k + 8])) + data[q, k + 9]
                square = gx * gx + gy * gy + gz * gz
                # at an apex the gradient vanishes, and a step along it would lead far away
                step = value / square if square > 1e-12 and abs(value) < 0.01 * square else 0.0
                x, y, z = x - step * gx, y - step * gy, z - step * gz
            nx, ny, nz = normalized(gx, gy, gz)
            put_placed(out, i, data, q, x, y, z, nx, ny, nz, around(out, y, x), z)


def _bounds(data, extra):
    m = forward(data)
    low, high = data[:, LOW:LOW + 3], data[:, HIGH:HIGH + 3]
    middle = ((low + high) / 2)[:, None, :]
    centred = data.copy()
    centred[:, :3] += (m * middle).sum(2)
    return placed_bounds(centred, (np.abs(m) * ((high - low) / 2)[:, None, :]).sum(2))


_BALL = (1, 1, 1, 0, 0, 0, 0, 0, 0, -1)
QUADRIC = Kind("quadric", intersect, surface, _bounds, (Quadric(_BALL, (-1, -1, -1), (1, 1, 1)), ()))
OPEN_QUADRIC = Kind("open-quadric", intersect_open, surface, None, (Quadric(_BALL), ()))
