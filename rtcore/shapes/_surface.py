"""Surface rows of eight hits at a time: what the shapes' `surface` kernels share. Lanes in which no primitive of the kind is hit hold
anything; only those of the mask are written."""
import numpy as np

from rtcore.directions import normalized
from rtcore.indices import pick, pick3, put, put3
from rtcore.jit import inline, inline_new
from rtcore.lanes import LANES, greatest, load, load3, select, size, store, vec3, wide
from rtcore.shapes.kind import REACH
from rtcore.wave import DX, ERR, GX, NX, OX, PX, T, U, V


@inline
def extent_of(v):
    """The largest of |x|, |y|, |z|."""
    return greatest(size(v.x), greatest(size(v.y), size(v.z)))


@inline
def hits_from(rays, i, p):
    """The hits of rays i .. i+7, each seen from the point p."""
    ray = rays.ray
    t, o, d = wide(load(ray, T, i)), wide(load3(ray, OX, i)), wide(load3(ray, DX, i))
    return vec3(o.x + t * d.x - p.x, o.y + t * d.y - p.y, o.z + t * d.z - p.z)


@inline
def put_surfaces(out, i, ok, p, normal, reach):
    """Columns i .. i+7 where ok: point, unit normal (shading too if there is room), and a bound on the point's error, 8 roundings of the
    largest number it was made from: its own coordinates, or `reach`."""
    eps = 2.0 ** -20 if out.itemsize == 4 else 2.0 ** -49
    put3(out, PX, i, ok, p)
    put3(out, GX, i, ok, normal)
    put(out, ERR, i, ok, eps * greatest(reach, extent_of(p)))
    if out.shape[0] > NX:
        put3(out, NX, i, ok, normal)


@inline
def put_coordinates(out, i, ok, u, v):
    """Texture coordinates, where there are rows for them."""
    if out.shape[0] > U:
        put(out, U, i, ok, u)
        put(out, V, i, ok, v)


@inline_new
def new_room():
    """Room in which eight angles are worked out."""
    return np.empty((2, LANES))


@inline
def angles(room, y, x):
    """The angles of (x, y) as 0 .. 1."""
    store(room, 0, 0, y)
    store(room, 1, 0, x)
    for k in range(LANES):
        room[0, k] = np.arctan2(room[0, k], room[1, k]) / (2 * np.pi) % 1.0
    return load(room, 0, 0)


@inline
def put_globe(out, i, ok, room, v):
    """Texture coordinates, where there are rows for them: longitudes and latitudes of unit vectors, each 0 .. 1; the poles are on z."""
    if out.shape[0] > U:
        longitude = angles(room, v.y, v.x)
        store(room, 0, 0, v.z)
        for k in range(LANES):
            room[0, k] = np.arccos(min(max(-room[0, k], -1.0), 1.0)) / np.pi
        put_coordinates(out, i, ok, longitude, load(room, 0, 0))


@inline
def put_flats(rays, i, ok, out, data, q, column):
    """Surface rows of hits on planes through data[q, 0..2] with normals data[q, column..]."""
    c, n = pick3(data, q, 0), normalized(pick3(data, q, column))
    s = hits_from(rays, i, c)
    height = s.x * n.x + s.y * n.y + s.z * n.z
    s = vec3(s.x - height * n.x, s.y - height * n.y, s.z - height * n.z)
    put_surfaces(out, i, ok, c + s, n, extent_of(c))
    put_flat_coordinates(out, i, ok, s, n)


@inline
def put_flat_coordinates(out, i, ok, s, n):
    """Texture coordinates of points s on planes with normals n: along the two axes that the normal points at least."""
    x, y, z = size(n.x), size(n.y), size(n.z)
    along_x, along_y = (x >= y) & (x >= z), y >= z
    put_coordinates(out, i, ok, select(along_x, s.y, select(along_y, s.z, s.x)), select(along_x, s.z, select(along_y, s.x, s.y)))


@inline
def into_units(data, q, v):
    """World vectors in the unit spaces of the placed primitives q."""
    a, b, c = pick3(data, q, 3), pick3(data, q, 6), pick3(data, q, 9)
    return vec3(a.x * v.x + a.y * v.y + a.z * v.z, b.x * v.x + b.y * v.y + b.z * v.z, c.x * v.x + c.y * v.y + c.z * v.z)


@inline
def unit_hits(rays, i, data, q):
    """Where rays i .. i+7 meet the placed primitives q, in their unit spaces."""
    return into_units(data, q, hits_from(rays, i, pick3(data, q, 0)))


@inline
def put_all_placed(out, i, ok, data, q, p, n):
    """Surface rows of placed primitives from points and normals in unit space. The points come from the unit shape, not from the ray, so
    their error does not grow with the distance of the eye."""
    a, b, c = pick3(data, q, 3), pick3(data, q, 6), pick3(data, q, 9)
    normal = normalized(vec3(a.x * n.x + b.x * n.y + c.x * n.z, a.y * n.x + b.y * n.y + c.y * n.z, a.z * n.x + b.z * n.y + c.z * n.z))
    at, a, b, c = pick3(data, q, 0), pick3(data, q, 12), pick3(data, q, 15), pick3(data, q, 18)
    put_surfaces(out, i, ok, vec3(at.x + a.x * p.x + a.y * p.y + a.z * p.z, at.y + b.x * p.x + b.y * p.y + b.z * p.z,
                                  at.z + c.x * p.x + c.y * p.y + c.z * p.z), normal, pick(data, q, REACH))
