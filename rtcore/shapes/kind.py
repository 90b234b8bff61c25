"""What the flattener and the kernels share of every shape: primitive kinds, their tables, and the placing of a unit shape.

A *shape* is what a person writes; a *kind* is what a kernel traces. Most shapes are of one kind; a sphere that a transform keeps round
stays a sphere, under any other it becomes an ellipsoid; a mesh is many triangles.

Every kind's module has two kernels with these signatures:

    intersect(rays, n, tree, table, first, opacity)     rays 0 .. n-1 against all primitives; reports through wave.record
    surface(rays, n, out, table, first)                 wave.Surface rows of the rays that hit primitive first .. first + len(table) - 1
"""
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline
from rtcore.lanes import splat3, vec3
from rtcore.scene import Shape
from rtcore.wave import DX, ERR, GX, GY, GZ, NX, NY, NZ, OX, PX, PY, PZ, T, U, V

FRONT, BACK, MIRRORED = 1, 2, 4     # Table.side: 0 both sides are visible; MIRRORED is added where a transform turned the winding around
SIDES = {"both": 0, "front": FRONT, "back": BACK}


class Table(NamedTuple):
    """The primitives of one kind: rows of numbers in precision P, further rows (normals, outlines), and which sides are visible."""

    data: np.ndarray    # P (n, w)
    extra: np.ndarray   # P (m, k); float64 for kinds with `shared_extra`
    side: np.ndarray    # int8 (n)
    exact: np.ndarray   # float64 (n, k), whatever P is: numbers, mostly as pairs, from which a kernel can work out a certain answer


class Packed(NamedTuple):
    """A shape under its transform as primitives of one kind, in float64."""

    kind: "Kind"
    data: np.ndarray                    # (n, w)
    extra: np.ndarray | None = None     # (n, k), or what `Kind.shared_extra` says
    mirrored: bool = False              # the transform turned the winding around
    dropped: int = 0                    # degenerate primitives left out
    exact: np.ndarray | None = None     # (n, k), for kinds that have it


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of primitive. `bounds(data, extra)` gives low and high, (n, 3) each; None: unbounded, traced without a tree."""

    name: str
    intersect: Callable
    surface: Callable
    bounds: Callable | None
    example: tuple[Shape, tuple]        # a shape and transforms that become this kind, to compile the kernels with
    leaf_most: int = 4
    singly: int = 1 << 30               # from how many on rays that scatter are walked singly, see `walk.begin`
    doubtful: bool = False              # its hits may lack a proof; then it writes Rays.doubt
    lasting: bool = False               # its surface rows take far longer than looking them up: the live picture keeps them
    shared_extra: bool = False          # extra is no row per primitive: data's last two columns are its first row and its length
    textbook: Callable | None = None    # as `intersect`, by the formula of a first course in plain floats, to be compared with


# --- unit shapes placed by a matrix ---

def power_near(size):
    """A power of two that brings numbers of this size near 1, where their squares neither overflow nor vanish; 1 for ordinary sizes.
    It and its inverse are float32 numbers wherever `size` is one."""
    exponent = np.clip(np.frexp(size)[1], -120, 1000)
    return np.where(np.abs(exponent) > 24, np.ldexp(1.0, exponent), 1.0)


#: Columns of a placed unit shape: centre c, rows of the matrix L with p_unit = L (p - c), rows of its inverse M, reach; a kind's own
#: numbers follow.
CENTER, INVERSE, FORWARD, REACH, OWN = 0, 3, 12, 21, 22


def placed(matrix: np.ndarray, inverse: np.ndarray, *own: float) -> np.ndarray:
    """One row: a unit shape (within -1 .. 1) under a 4 x 4 matrix. Reach bounds |centre| plus the size, for error bounds."""
    center = matrix[:3, 3]
    reach = np.abs(center).max() + np.abs(matrix[:3, :3]).sum(1).max()
    return np.concatenate([center, inverse[:3, :3].ravel(), matrix[:3, :3].ravel(), [reach], own])


def placed_bounds(data: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Low and high of placed rows whose half extents in the world are `half` (n, 3), a little padded."""
    half = half * (1 + 1e-12)
    return data[:, :3] - half, data[:, :3] + half


def forward(data: np.ndarray) -> np.ndarray:
    """(n, 3, 3): the matrices M of placed rows, unit shape to world."""
    return data[:, FORWARD:FORWARD + 9].reshape(-1, 3, 3)


@inline
def into(data, p, v):
    """L v: a world vector (lanes) in the unit space of placed primitive p."""
    a, b, c = splat3(data, p, 3), splat3(data, p, 6), splat3(data, p, 9)
    return vec3(a.x * v.x + a.y * v.y + a.z * v.z, b.x * v.x + b.y * v.y + b.z * v.z, c.x * v.x + c.y * v.y + c.z * v.z)


@inline
def into1(data, p, x, y, z):
    """L v of one vector, as three float64."""
    return (data[p, 3] * x + data[p, 4] * y + data[p, 5] * z, data[p, 6] * x + data[p, 7] * y + data[p, 8] * z,
            data[p, 9] * x + data[p, 10] * y + data[p, 11] * z)


@inline
def hit_from(rays, i, x, y, z):
    """The hit of ray i seen from (x, y, z), as three float64."""
    ray = rays.ray
    t = np.float64(ray[T, i])
    return ray[OX, i] + t * ray[DX, i] - x, ray[OX + 1, i] + t * ray[DX + 1, i] - y, ray[OX + 2, i] + t * ray[DX + 2, i] - z


@inline
def unit_hit(rays, i, data, p):
    """Where ray i meets placed primitive p, in its unit space: three float64."""
    return into1(data, p, *hit_from(rays, i, data[p, 0], data[p, 1], data[p, 2]))


@inline
def put_placed(out, i, data, p, x, y, z, nx, ny, nz, u, v):
    """Surface rows of a placed primitive from its point and normal in unit space. The point comes from the unit shape, not from the
    ray, so its error does not grow with the distance of the eye."""
    wx, wy, wz = out_normal(data, p, nx, ny, nz)
    put_surface(out, i, data[p, 0] + data[p, 12] * x + data[p, 13] * y + data[p, 14] * z,
                data[p, 1] + data[p, 15] * x + data[p, 16] * y + data[p, 17] * z,
                data[p, 2] + data[p, 18] * x + data[p, 19] * y + data[p, 20] * z, wx, wy, wz, u, v, np.float64(data[p, REACH]))


@inline
def out_normal(data, p, x, y, z):
    """A unit-space normal in the world: the inverse transpose's product, of length 1."""
    return normalized(data[p, 3] * x + data[p, 6] * y + data[p, 9] * z, data[p, 4] * x + data[p, 7] * y + data[p, 10] * z,
                      data[p, 5] * x + data[p, 8] * y + data[p, 11] * z)


@inline
def normalized(x, y, z):
    """A vector at length 1, without overflow or underflow; the zero vector becomes z."""
    most = max(abs(x), max(abs(y), abs(z)))
    if not most > 0:
        return 0.0, 0.0, 1.0
    x, y, z = x / most, y / most, z / most
    length = np.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


# --- the surface rows ---

@inline
def around(out, y, x):
    """The angle of (x, y) as 0 .. 1; 0 where `out` has no rows for texture coordinates."""
    return np.arctan2(y, x) / (2 * np.pi) % 1.0 if out.shape[0] > U else 0.0


@inline
def put_surface(out, i, px, py, pz, nx, ny, nz, u, v, reach):
    """Fill column i: point, unit normal (shading too if there is room), texture coordinates; the point's error is bounded by 8 roundings
    of the largest number it was made from: its own coordinates, or `reach`."""
    eps = 2.0 ** -20 if out.itemsize == 4 else 2.0 ** -49
    out[PX, i], out[PY, i], out[PZ, i] = px, py, pz
    out[GX, i], out[GY, i], out[GZ, i] = nx, ny, nz
    out[ERR, i] = eps * max(reach, max(abs(px), max(abs(py), abs(pz))))
    if out.shape[0] > NX:
        out[NX, i], out[NY, i], out[NZ, i] = nx, ny, nz
    if out.shape[0] > U:
        out[U, i], out[V, i] = u, v

