"""Triangle and Mesh: one kind. Watertight at edges and vertices (Woop, Benthin, Wald, *Watertight Ray/Triangle Intersection*, JCGT 2013).

The ray is sheared onto its main axis; then the corners are 2-D points and the ray is the origin. A vertex gets the same 2-D coordinates
from every triangle that shares it, and each edge function is exact in sign, so rays through shared edges and vertices always hit.
"""
from typing import Annotated

import numpy as np

from rtcore.directions import normalized
from rtcore.walk import ACTIVE, PACKET, TOP, begin, leaf_end, leaf_first, new_walk, next_leaf, only_ray, shrink
from rtcore.across import lowest_bit
from rtcore.fields import Field, FieldError, Maybe, Text, Vec, Vector, Vectors
from rtcore.indices import among, common, flagged, pick3, put3, rows_of
from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import LANES, any_lane, bits, fma, greatest, least, load, load3, select, size, store, vec3
from rtcore.powers import exponent, power_of_two
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import lowest
from rtcore.shapes._surface import extent_of, hits_from, put_coordinates, put_surfaces
from rtcore.shapes.kind import BACK, FRONT, MIRRORED, Kind, Packed
from rtcore.wave import DX, NX, OX, SLOW, record, record_one


#: Twice a triangle's area, seen along the ray, below which products may have lost digits to underflow.
TINY32, TINY64 = 2.0 ** -100, 2.0 ** -900
SINGLY = 20_000         # triangles, see `Kind.singly`: some 2,000 nodes


class Triangle(Shape, frozen=True):
    """Three corners; with `normals`, one a corner, it is shaded as if curved."""

    a: Annotated[Vec, Vector(help="first corner", unit="scene units")]
    b: Annotated[Vec, Vector(help="second corner; counter-clockwise seen from the front", unit="scene units")]
    c: Annotated[Vec, Vector(help="third corner", unit="scene units")]
    normals: Annotated[tuple[Vec, Vec, Vec] | None, Maybe(inner=Vectors(least=3), help="normals at the corners")] = None

    def check(self):
        if self.normals is not None and len(self.normals) != 3:
            raise FieldError("three normals", self.normals, "normals")

    def kind(self, matrix: np.ndarray) -> Kind:
        return TRIANGLE

    def pack(self, matrix: np.ndarray) -> Packed:
        normals = None if self.normals is None else np.array([self.normals])
        return pack_triangles(np.array([[self.a, self.b, self.c]]), normals, matrix)


class Array(Field):
    """A read-only array with three columns: float64, or int32 for faces."""

    def __init__(self, dtype, **words):
        super().__init__(**words)
        object.__setattr__(self, "dtype", dtype)

    def take(self, value):
        integer = np.issubdtype(self.dtype, np.integer)
        expected = "a list of " + ("faces, three vertex indices each" if integer else "points, three finite numbers each")
        try:
            array = np.asarray(value)
            if array.size == 0:
                array = np.zeros((0, 3), self.dtype)
            if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in ("iu" if integer else "iuf"):
                raise TypeError
        except (TypeError, ValueError):
            raise FieldError(expected, value) from None
        bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
        if len(bad):
            raise FieldError("three finite numbers", array[bad[0]].tolist(), f"[{bad[0]}]")
        if integer and (array.max(initial=0) > 2**31 - 1 or array.min(initial=0) < 0):
            raise FieldError(expected, value)
        array = np.ascontiguousarray(array, dtype=self.dtype)
        if array is value and array.flags.writeable or array.base is not None:
            array = array.copy()
        array.flags.writeable = False
        return array


class Mesh(Shape, frozen=True, eq=False):
    """Triangles over shared vertices; with `normals`, one a vertex, they are shaded as if curved.

    vertices (V, 3), faces (F, 3) indices from 0, normals (V, 3) or None. A mesh that came from a file remembers it in
    `file`, so that a saved scene can name it instead of writing every number out.
    """

    vertices: Annotated[np.ndarray, Array(np.float64, help="points", unit="scene units")]
    faces: Annotated[np.ndarray, Array(np.int32, help="three vertex indices each, from 0")]
    normals: Annotated[np.ndarray | None, Maybe(inner=Array(np.float64), help="normals at the vertices")] = None
    file: Annotated[str, Text(help="the mesh file these came from")] = ""

    def check(self):
        if len(self.faces) == 0:
            raise FieldError("at least one face", 0, "faces")
        over = np.flatnonzero((self.faces >= len(self.vertices)).any(axis=1))
        if len(over):
            expected = f"indices less than the number of vertices, {len(self.vertices)}"
            raise FieldError(expected, self.faces[over[0]].tolist(), f"faces[{over[0]}]")
        if self.normals is not None and len(self.normals) != len(self.vertices):
            raise FieldError(f"as many normals as vertices, {len(self.vertices)}", len(self.normals), "normals")

    def kind(self, matrix: np.ndarray) -> Kind:
        return TRIANGLE

    def pack(self, matrix: np.ndarray) -> Packed:
        return pack_triangles(self.vertices[self.faces], None if self.normals is None else self.normals[self.faces], matrix)

    def count(self) -> int:
        return len(self.faces)

    def __eq__(self, other):
        if not isinstance(other, Mesh) or (self.sides, self.file, self.normals is None) != (other.sides, other.file, other.normals is None):
            return False
        pairs = [(self.vertices, other.vertices), (self.faces, other.faces), (self.normals, other.normals)]
        return all(a is b or np.array_equal(a, b) for a, b in pairs)

    def __hash__(self):
        return id(self)


# --- packing ---

def pack_triangles(corners: np.ndarray, normals: np.ndarray | None, matrix: np.ndarray) -> Packed:
    """Triangles (n, 3, 3) and their corner normals or None, brought to the world; those without area are dropped."""
    corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    size = np.maximum(np.abs(b - a).max(1), np.abs(c - a).max(1))
    with np.errstate(invalid="ignore", divide="ignore"):
        area = np.abs(np.cross((b - a) / size[:, None], (c - a) / size[:, None])).max(1)
    good = area > 0     # false for the NaN of a point-like one
    extra = None
    if normals is not None:
        normals = normals @ invertible(matrix)[:3, :3]
        extra = (normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), np.finfo(float).tiny)).reshape(-1, 9)[good]
    return Packed(TRIANGLE, corners.reshape(-1, 9)[good], extra, bool(np.linalg.det(matrix[:3, :3]) < 0), int(len(good) - good.sum()))


# --- kernels ---

@inline
def shear(rays, start, n, slant, axes):
    """Per ray: the axis it runs along most, and the shear that brings it onto that axis. Returns the axes of all of them, as bits."""
    every = 0
    for g in range(min(PACKET, n - start + 7) // 8):
        d = load3(rays.ray, DX, start + g * 8)
        x, y, z = size(d.x), size(d.y), size(d.z)
        along_x = (x >= y) & (x >= z)
        along_y = (y >= z) & ~along_x
        inverse = 1 / select(along_x, d.x, select(along_y, d.y, d.z))
        store(slant, 0, g * 8, select(along_x, d.y, select(along_y, d.z, d.x)) * inverse)
        store(slant, 1, g * 8, select(along_x, d.z, select(along_y, d.x, d.y)) * inverse)
        store(slant, 2, g * 8, inverse)
        store(slant, 3, g * 8, select(along_x, 0, select(along_y, 1, 2 + 0 * inverse)))
        axes[g] = (bits(along_x) != 0) * 1 + (bits(along_y) != 0) * 2 + (bits(along_x | along_y) != 255) * 4
        every |= axes[g]
    return every


@inline
def corners(data, q, axis):
    """The corners of triangle q, nine numbers: each the two coordinates that follow that along `axis`, then that one."""
    kx, ky = (axis + 1) % 3, (axis + 2) % 3
    return (data[q, kx], data[q, ky], data[q, axis], data[q, 3 + kx], data[q, 3 + ky], data[q, 3 + axis],
            data[q, 6 + kx], data[q, 6 + ky], data[q, 6 + axis])


@inline
def edges(ray, i, j, three, slant, axis):
    """Of eight rays and a triangle, its corners as `corners` gives them: the three edge functions, and the corners' distances along `axis`.
    i: the rays' column in ray, j: in the packet."""
    kx, ky = (axis + 1) % 3, (axis + 2) % 3
    sx, sy = load(slant, 0, j), load(slant, 1, j)
    ox, oy, oz = load(ray, OX + kx, i), load(ray, OX + ky, i), load(ray, OX + axis, i)
    az, bz, cz = three[2] - oz, three[5] - oz, three[8] - oz
    ax, ay = fma(-sx, az, three[0] - ox), fma(-sy, az, three[1] - oy)
    bx, by = fma(-sx, bz, three[3] - ox), fma(-sy, bz, three[4] - oy)
    cx, cy = fma(-sx, cz, three[6] - ox), fma(-sy, cz, three[7] - oy)
    # a difference of two rounded products never has the wrong sign, only 0: no ray falls between two triangles. Not to be fused.
    return cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax, az, bz, cz


@kernel
def settle(rays, i, p, table, q, axis, opacity):
    """Ray i against triangle q where the edge functions are so small that digits of them are lost: as above, in units of the triangle."""
    out_of_line()
    rays.tally[SLOW] += 1
    ray, data = rays.ray, table.data
    kx, ky = (axis + 1) % 3, (axis + 2) % 3
    inverse = 1 / np.float64(ray[DX + axis, i])
    sx, sy = ray[DX + kx, i] * inverse, ray[DX + ky, i] * inverse
    x, y, z = np.empty(3), np.empty(3), np.empty(3)
    most = 0.0
    for k in range(3):
        z[k] = np.float64(data[q, 3 * k + axis]) - ray[OX + axis, i]
        x[k] = (np.float64(data[q, 3 * k + kx]) - ray[OX + kx, i]) - sx * z[k]
        y[k] = (np.float64(data[q, 3 * k + ky]) - ray[OX + ky, i]) - sy * z[k]
        most = max(most, max(abs(x[k]), abs(y[k])))
    if most == 0:
        return
    for k in range(3):
        x[k], y[k] = x[k] / most, y[k] / most
    u, v, w = x[2] * y[1] - y[2] * x[1], x[0] * y[2] - y[0] * x[2], x[1] * y[0] - y[1] * x[0]
    det = u + v + w
    front = det * inverse > 0
    if table.side[q] & MIRRORED:
        front = not front
    seen = front if table.side[q] & FRONT else not front if table.side[q] & BACK else True
    if seen and det != 0 and (min(u, min(v, w)) >= 0 or max(u, max(v, w)) <= 0):
        record_one(rays, i, p, (u * z[0] + v * z[1] + w * z[2]) / det * inverse, opacity)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    slant, axes = np.empty((4, PACKET), rays.ray.dtype), np.empty(PACKET // 8, np.int64)
    tiny = TINY32 if rays.ray.itemsize == 4 else TINY64
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, table.side.shape[0] >= SINGLY)
        if walk.state[TOP] == 0:
            continue
        every = shear(rays, start, n, slant, axes)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            ray = only_ray(walk)
            seen, touched = every if ray < 0 else 1 << int(slant[3, ray]), 0
            while seen:
                axis = lowest_bit(seen)
                seen &= seen - 1
                for q in range(leaf_first(leaf), leaf_end(leaf)):
                    three, side = corners(table.data, q, axis), table.side[q]
                    active = walk.state[ACTIVE]
                    while active:
                        g = lowest_bit(active)
                        active &= active - 1
                        i = start + g * 8
                        u, v, w, az, bz, cz = edges(rays.ray, i, g * 8, three, slant, axis)
                        ok = ((u <= 0) & (v <= 0) & (w <= 0)) | ((u >= 0) & (v >= 0) & (w >= 0))
                        if axes[g] != 1 << axis:
                            ok = ok & (load(slant, 3, g * 8) == axis)
                        if any_lane(ok):
                            touched |= 1 << g
                            det, inverse = u + v + w, load(slant, 2, g * 8)
                            late = bits(ok & (size(det) < tiny))
                            if side & (FRONT | BACK):
                                # a ray along -axis, inverse < 0, sees the front where det < 0
                                facing = det * inverse
                                ok = ok & (facing > 0) if side == FRONT or side == BACK + MIRRORED else ok & (facing < 0)
                            ok = ok & (size(det) >= tiny)
                            record(rays, i, first + q, (u * az + v * bz + w * cz) / det * inverse, ok, opacity)
                            while late:
                                settle(rays, i + lowest(late), first + q, table, q, axis, opacity)
                                late &= late - 1
            shrink(walk, rays, start, touched)
            leaf = next_leaf(walk, tree, table)


@kernel
def surface(rays, n, out, table, first):
    prim, data, extra, side = rays.prim, table.data, table.extra, table.side
    for i in range(0, n, LANES):
        ok = among(prim, i, first, first + data.shape[0])
        if any_lane(ok):
            rows = rows_of(prim, i, first, ok)
            row = common(rows)
            if row >= 0:
                _put_triangles(rays, i, ok, out, data, extra, side, row)
            else:
                _put_triangles(rays, i, ok, out, data, extra, side, rows)


@inline
def _put_triangles(rays, i, ok, out, data, extra, side, q):
    """Surface rows of hits on triangles q."""
    a = pick3(data, q, 0)
    e, f, s = pick3(data, q, 3) - a, pick3(data, q, 6) - a, hits_from(rays, i, a)
    longest = greatest(extent_of(e), extent_of(f))
    scale = exponent(longest)
    unit = power_of_two(-scale)     # nothing is rounded, and it takes no division: nine of them were a third of the time
    e, f, s = e * unit, f * unit, s * unit
    normal = across(e, f)
    square = normal.x * normal.x + normal.y * normal.y + normal.z * normal.z
    # barycentrics of the foot of the hit on the triangle's plane
    p, r = across(s, f), across(e, s)
    over = 1 / square
    beta = (p.x * normal.x + p.y * normal.y + p.z * normal.z) * over
    gamma = (r.x * normal.x + r.y * normal.y + r.z * normal.z) * over
    beta = least(greatest(beta, 0), 1)
    gamma = least(greatest(gamma, 0), 1 - beta)
    normal = normalized(normal)
    normal = select(flagged(side, q, MIRRORED), -normal, normal)
    put_surfaces(out, i, ok, a + (e * beta + f * gamma) * power_of_two(scale), normal, extent_of(a) + longest)
    put_coordinates(out, i, ok, beta, gamma)
    if extra.shape[0] > 0 and out.shape[0] > NX:
        m = pick3(extra, q, 0)
        m = m + (pick3(extra, q, 3) - m) * beta + (pick3(extra, q, 6) - m) * gamma
        put3(out, NX, i, ok & (m.x * m.x + m.y * m.y + m.z * m.z > 0), normalized(m))


@inline
def across(e, f):
    """e x f with no product fused."""
    return vec3(e.y * f.z - e.z * f.y, e.z * f.x - e.x * f.z, e.x * f.y - e.y * f.x)


def _bounds(data, extra):
    # corner by corner and column by column: numpy is four times slower along an axis of three
    a, b, c = data[:, 0:3], data[:, 3:6], data[:, 6:9]
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    most = np.maximum(-low, high)
    pad = 1e-14 * np.maximum(np.maximum(most[:, 0], most[:, 1]), most[:, 2])[:, None]
    low -= pad
    high += pad
    return low, high


TRIANGLE = Kind("triangle", intersect, surface, _bounds, (Triangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), ()), singly=SINGLY)
