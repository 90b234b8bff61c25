"""Rough mirrors and frosted glass: rays that were reflected or refracted at a smooth surface take the direction that a facet of a rough one
gives them, so that many samples of a pixel blur what they show.

Facets lie about the normal as the GGX distribution says (Walter and others, "Microfacet Models for Refraction through Rough Surfaces", EGSR
2007) and are drawn as the ray sees them (Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4), 2018). A ray has the same
weight whatever its direction, and one that would end up on the wrong side of the surface is mirrored back at it: so a rough surface returns
exactly as much light as a smooth one, and before an even background there is no noise.
"""
import numpy as np

from rtcore.jit import inline, kernel
from rtcore.sampling import GLOSS, centered, disk, hash32
from rtcore.shading import IOR, REFRACTED, ROUGHNESS
from rtcore.wave import DX, DY, DZ, GX, GY, GZ, shading_normal


@inline
def _unit(x, y, z):
    """An ordinary vector at length 1."""
    shrink = 1 / np.sqrt(max(x * x + y * y + z * z, 1e-300))
    return x * shrink, y * shrink, z * shrink


@inline
def facet(u, v, cosine, alpha):
    """A facet's normal (x, y, z) in axes in which the surface's is z and the direction to the eye is (sine, 0, cosine), for two numbers in
    0 .. 1. alpha: GGX's width. The middle of the square gives the surface's own normal."""
    # the eye's direction in the space where the facets are a hemisphere
    x, _, z = _unit(alpha * np.sqrt(max(1 - cosine * cosine, 0.0)), 0.0, cosine)
    bent = 0.5 * (1 + z)
    # the hemisphere, seen from there, is a disk whose upper half is compressed; its pole is at (0, x). The square is shifted, around its
    # edge, until its middle comes there
    v += 0.5 * (x - (1 - bent)) / bent
    a, b = disk(u, v - np.floor(v))
    b = (1 - bent) * np.sqrt(max(1 - a * a, 0.0)) + bent * b
    c = np.sqrt(max(1 - a * a - b * b, 0.0))
    # axes: a along y, b along (-z, 0, x), c along (x, 0, z)
    return _unit(alpha * (c * x - b * z), alpha * a, max(b * x + c * z, 0.0))


@inline
def place(pixel, sample, dimension, seed):
    """`centered`, about the middle the other way round for half the dimensions: a pixel's first points have their places on the same side
    of the middle in all, and a ray that meets facet upon facet would turn the same way at each."""
    u, v = centered(pixel, sample, dimension, seed)
    turn = hash32(hash32(dimension ^ seed) ^ np.uint32(pixel))
    return u if turn & 1 else 1 - u, v if turn & 2 else 1 - v


@inline
def _faced(ray, surface, i):
    """Unit geometric and shading normal on the side that ray i comes from, and 1 if that is the front, else -1."""
    n = shading_normal(surface)
    side = 1.0 if ray[DX, i] * surface[GX, i] + ray[DY, i] * surface[GY, i] + ray[DZ, i] * surface[GZ, i] < 0 else -1.0
    return (side * surface[GX, i], side * surface[GY, i], side * surface[GZ, i],
            side * surface[n, i], side * surface[n + 1, i], side * surface[n + 2, i], side)


@kernel
def roughen(wave, child, n, look, before, path, target, number, seed):
    """Turn the directions of the child wave's n rays, which `shading.bounce` has sent on from `wave`, by the roughness of what they come
    from. before, path: int32, for each ray of the wave and of the child the turns that led to it, 1 for the eye's and one binary digit more
    for each reflection (0) or refraction (1), a hash of them where they are many: so rays of one sample draw from different dimensions.
    target, number: pixels and sample numbers of the primary rays. Not for a pixel's sample 0, which goes the smooth way."""
    ray, prim, surface, m, of = wave.rays.ray, wave.rays.prim, wave.surface, look.material, look.of
    out, source, owners = child.rays.ray, child.source, child.owner
    for j in range(n):
        i, way = source[j] >> 1, source[j] & 1
        path[j] = 2 * before[i] + way if before[i] < GLOSS // 2 else hash32(2 * before[i] + way) % GLOSS
        row, owner = of[prim[i]], owners[j]
        if m[row, ROUGHNESS] == 0:
            continue
        gx, gy, gz, nx, ny, nz, side = _faced(ray, surface, i)
        dx, dy, dz = np.float64(ray[DX, i]), np.float64(ray[DY, i]), np.float64(ray[DZ, i])
        cosine = -(dx * nx + dy * ny + dz * nz)
        if cosine <= 0:     # as in `shading.bounce`
            nx, ny, nz = gx, gy, gz
            cosine = -(dx * nx + dy * ny + dz * nz)
        u, v = place(target[owner], number[owner], GLOSS + path[j], seed)
        a, b, c = facet(u, v, cosine, m[row, ROUGHNESS] * m[row, ROUGHNESS])
        # axes across the normal: tx toward the eye, where there is such a side
        tx, ty, tz = -dx - cosine * nx, -dy - cosine * ny, -dz - cosine * nz
        if cosine > 1 - 1e-12:
            tx, ty, tz = (0.0, -nz, ny) if abs(nx) < 0.5 else (-nz, 0.0, nx)
        tx, ty, tz = _unit(tx, ty, tz)
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        hx, hy, hz = a * tx + b * bx + c * nx, a * ty + b * by + c * ny, a * tz + b * bz + c * nz
        cosine = -(dx * hx + dy * hy + dz * hz)
        if way != REFRACTED:
            x, y, z = dx + 2 * cosine * hx, dy + 2 * cosine * hy, dz + 2 * cosine * hz
            wrong = min(x * gx + y * gy + z * gz, 0.0)
        else:
            eta = 1 / m[row, IOR] if side > 0 else m[row, IOR]
            square = 1 - eta * eta * (1 - cosine * cosine)
            if square <= 0:     # the facet lets nothing through: the ray goes the smooth surface's way
                continue
            k = eta * cosine - np.sqrt(square)
            x, y, z = eta * dx + k * hx, eta * dy + k * hy, eta * dz + k * hz
            wrong = max(x * gx + y * gy + z * gz, 0.0)
        out[DX, j], out[DY, j], out[DZ, j] = _unit(x - 2 * wrong * gx, y - 2 * wrong * gy, z - 2 * wrong * gz)
