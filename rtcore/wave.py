"""A wave of rays as a structure of arrays, and the one function by which every shape's kernel reports a hit.

Arrays are C-contiguous, a row a quantity, a column a ray; the number of columns is a multiple of 8 and columns past the last ray are
dead (T = -inf). P is the precision of the render, float32 or float64.
"""
from typing import NamedTuple

import numpy as np

from rtcore.indices import among
from rtcore.jit import inline, kernel
from rtcore.lanes import LANES, add_where, any_lane, exceeds, load, select, store, store_where, wide
from rtcore.memory import carved

# rows of Rays.ray: origin, direction, the open interval (START, T) in which hits count; T becomes the nearest hit
OX, OY, OZ, DX, DY, DZ, START, T = range(8)
RAY_ROWS = 8
DEAD = -np.inf

# rows of Surface: hit point, geometric normal (unit, on the front), bound on the point's error, shading normal, texture coordinates
PX, PY, PZ, GX, GY, GZ, ERR, NX, NY, NZ, U, V = range(12)
SURFACE_ROWS = 12
# a picture needs no texture coordinates, which took 6 % of the time of whitted.yaml, and shading normals only where a mesh brings them
SMOOTH_ROWS, FLAT_ROWS = U, NX

#: Optical depth of an opaque primitive, and what one unit of it is worth: light · exp(-depth·DEPTH_UNIT). Depths are integers, so
#: that the order in which a shadow ray meets transparent things can't change a bit of the picture.
OPAQUE = 1 << 24
DEPTH_UNIT = 2.0 ** -16

#: In place of the opacities of all primitives: then `record` keeps the nearest hit.
CLOSEST = np.zeros(0, np.int32)


#: Places in Rays.tally: rays that were sent to a slow exact solver, hits recorded without a proof, and whether (not 0) the answers are not
#: wanted any more, which kernels that walk a tree see after each packet.
SLOW, UNCERTIFIED, UNWANTED = range(3)
COUNTED = slice(UNWANTED)


class Rays(NamedTuple):
    """What the intersection kernels read and write."""

    ray: np.ndarray     # P (8, n)
    prim: np.ndarray    # int32 (n): the primitive hit, -1 none
    depth: np.ndarray   # int32 (n): optical depth met so far; shadow waves only
    doubt: np.ndarray   # uint8 (n): 1 where the hit is not certified; means something only for primitives of kinds that can doubt
    tally: np.ndarray   # int64 (3): as named above; several waves may share one


def padded(n: int) -> int:
    """`n` rounded up to whole vectors."""
    return -(-n // LANES) * LANES


def new_tally() -> np.ndarray:
    """Nothing counted yet."""
    return np.zeros(3, np.int64)


def new_rays(n: int, dtype) -> Rays:
    """Rays for `n` rays, with nothing set."""
    return _cleared(*carved(*_rays(padded(n), dtype)), new_tally())


def _rays(n: int, dtype) -> tuple:
    return ((RAY_ROWS, n), dtype), ((n,), np.int32), ((n,), np.int32), ((n,), np.uint8)


def _cleared(ray: np.ndarray, prim: np.ndarray, depth: np.ndarray, doubt: np.ndarray, tally: np.ndarray) -> Rays:
    doubt.fill(0)
    return Rays(ray, prim, depth, doubt, tally)


@inline
def shading_normal(surface):
    """The first of the rows that hold it."""
    return NX if surface.shape[0] > NX else GX


@inline
def alive(ray, i):
    """Lanes i .. i+7 whose interval is not empty: rays that have ended are in the same vector as others."""
    return load(ray, T, i) > load(ray, START, i)


@inline
def until(ray, i):
    """The ends of the intervals of rays i .. i+7 as float64, and for float32 rays a rounding further: of hits that are rounded to the same
    float32, `record` must see all, or the order of the walk would show."""
    return wide(load(ray, T, i)) * (1 + 2.0 ** -23 if ray.itemsize == 4 else 1.0)


@inline
def record(rays, i, p, t, ok, opacity):
    """Lanes i .. i+7 meet primitive p at t where ok. Without opacities the nearest hit is kept, and of equally near ones that of the
    lower number, so that no order of the walk shows; with them (shadow rays) an opaque hit ends the ray, others add up."""
    far = load(rays.ray, T, i)
    ok = ok & (t > load(rays.ray, START, i)) & (t <= far)
    if any_lane(ok):
        ok = ok & ((t < far) | exceeds(rays.prim, i, p))
        if opacity.shape[0] == 0:
            store(rays.ray, T, i, select(ok, t, far))
            store_where(rays.prim, i, ok, p)
        elif opacity[p] == OPAQUE:
            store(rays.ray, T, i, select(ok, DEAD, far))
            store_where(rays.prim, i, ok, p)
        else:
            add_where(rays.depth, i, ok, opacity[p])


@inline
def record_one(rays, i, p, t, opacity):
    """`record` for ray i alone, t a float64; says whether it was kept."""
    ray = rays.ray
    start, far = ray[START, i], ray[T, i]
    ray[T, i] = t       # rounded to the precision of the ray
    t = ray[T, i]
    ray[T, i] = far
    if not (start < t <= far) or (t == far and rays.prim[i] <= p):
        return False
    if opacity.shape[0] == 0:
        ray[T, i], rays.prim[i] = t, p
    elif opacity[p] == OPAQUE:
        ray[T, i], rays.prim[i] = DEAD, p
    else:
        rays.depth[i] += opacity[p]
    return True


class Wave(NamedTuple):
    """Rays with what they carry and what is found where they hit. n columns, as many as `rays` has."""

    rays: Rays
    surface: np.ndarray     # P (7, 10 or 12, n), rows as named above; only columns that hit something
    light: np.ndarray       # float32 (3, n): radiance that comes along the ray
    weight: np.ndarray      # float32 (3, n): how much of it the pixel gets
    fade: np.ndarray        # float32 (n): what fog lets through
    owner: np.ndarray       # int32 (n): the column of the primary ray it descends from
    source: np.ndarray      # int32 (n): twice the column of the wave before that it comes from, plus 1 if refracted; not for primary rays


class Beam(NamedTuple):
    """Rays from a wave's hits toward lights, with what they would bring if nothing were in the way."""

    rays: Rays
    bring: np.ndarray       # float32 (3, columns)
    owner: np.ndarray       # int32 (columns): the column of the lit wave
    answer: np.ndarray      # float32 (5, n), a column a hit: what it returns of a light, as named below


# rows of Beam.answer: diffuse red, green and blue; specular and its exponent
GLOSS, POLISH, ANSWER_ROWS = 3, 4, 5
NO_ANSWER = np.zeros((ANSWER_ROWS, 0), np.float32)      # where there is no light to answer


def new_wave(n: int, dtype, tally: np.ndarray | None = None, smooth: bool = True) -> Wave:
    """A wave for `n` rays, with nothing set; smooth: with room for shading normals that are not the geometric ones."""
    n = padded(n)
    *rays, surface, light, weight, fade, owner, source = carved(
        *_rays(n, dtype), ((SMOOTH_ROWS if smooth else FLAT_ROWS, n), dtype), ((3, n), np.float32), ((3, n), np.float32),
        ((n,), np.float32), ((n,), np.int32), ((n,), np.int32))
    return Wave(_cleared(*rays, new_tally() if tally is None else tally), surface, light, weight, fade, owner, source)


def new_beam(n: int, lights: int, dtype, tally: np.ndarray | None = None) -> Beam:
    """A beam with room for rays from `n` hits toward so many lights, with nothing set."""
    n, columns = padded(n), padded(n) * lights + LANES
    *rays, bring, owner, answer = carved(
        *_rays(columns, dtype), ((3, columns), np.float32), ((columns,), np.int32), ((ANSWER_ROWS, n), np.float32))
    return Beam(_cleared(*rays, new_tally() if tally is None else tally), bring, owner, answer)


@inline
def put_ray(rays, i, x, y, z, dx, dy, dz, far):
    """Ray i: from (x, y, z) along (dx, dy, dz), hits counting from 0 to `far`."""
    ray = rays.ray
    ray[OX, i], ray[OY, i], ray[OZ, i] = x, y, z
    ray[DX, i], ray[DY, i], ray[DZ, i] = dx, dy, dz
    ray[START, i], ray[T, i] = 0.0, far
    rays.prim[i], rays.depth[i] = -1, 0


@inline
def finish(rays, n):
    """Let the columns after the last of n rays, up to a whole vector, be dead."""
    for i in range(n, (n + LANES - 1) // LANES * LANES):
        put_ray(rays, i, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, DEAD)


@kernel
def find_kinds(prim, n, ends, found):
    """Which kinds rays 0 .. n-1 have hit. ends: int64, one past the last primitive of each; found: bool, False to begin with."""
    for k in range(len(ends)):
        first = ends[k - 1] if k > 0 else 0
        for i in range(0, n, LANES):
            if any_lane(among(prim, i, first, ends[k])):
                found[k] = True
                break
