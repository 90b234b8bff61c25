"""What callers give and get, a row a ray, from and to what kernels work on: checked, scaled and transposed in one pass."""
import math

import numpy as np

from rtcore.jit import inline, kernel
from rtcore.lanes import LANES, any_lane, fill, greatest, least, rounded, size, splat, store, wide
from rtcore.neighbours import load1, load_triples, store1
from rtcore.powers import exponent, power_of_two
from rtcore.wave import DX, OX, START, T, finish

MOST = 1000     # directions are scaled by a power of two of at most this exponent, so that it and its inverse are ordinary numbers


@kernel
def take(origins, directions, low, high, rays, stretch):
    """Fill `rays` with origins and directions, (n, 3) of P each, that count hits in low .. high, float64 (n) or (1).

    A direction is scaled until its longest part is in 0.5 .. 1, so that no length of it overflows in a kernel; t counts in these lengths
    meanwhile, and stretch, float64 (n, rounded up to whole vectors), brings it back. Returns whether all numbers are finite, no direction
    is 0, no low below 0, no limit NaN; the rays are good for nothing otherwise.
    """
    n = len(origins)
    good, whole = True, n - n % LANES
    for i in range(0, whole, LANES):
        good &= _take(origins, directions, low, high, i, rays, stretch, i)
    if whole < n:
        # the last one fills the vector
        o, d, limits = np.empty((LANES, 3), origins.dtype), np.empty((LANES, 3), origins.dtype), np.empty((2, LANES))
        for k in range(LANES):
            i = min(whole + k, n - 1)
            for part in range(3):
                o[k, part], d[k, part] = origins[i, part], directions[i, part]
            limits[0, k], limits[1, k] = low[min(i, len(low) - 1)], high[min(i, len(high) - 1)]
        good &= _take(o, d, limits[0], limits[1], 0, rays, stretch, whole)
    finish(rays, n)
    return good


@inline
def _take(origins, directions, low, high, j, rays, stretch, i):
    """Let rays i .. i+7 be what the callers' rows j .. j+7 tell; whether they are right."""
    ray, o, d = rays.ray, load_triples(origins, j), load_triples(directions, j)
    start = splat(low[0]) if len(low) == 1 else load1(low, j)
    end = splat(high[0]) if len(high) == 1 else load1(high, j)
    x, y, z = wide(d.x), wide(d.y), wide(d.z)
    longest = greatest(greatest(size(x), size(y)), size(z))
    scale = least(greatest(exponent(longest) + 1, -MOST), MOST)
    power, back = power_of_two(-scale), power_of_two(scale)
    store(ray, OX, i, o.x)
    store(ray, OX + 1, i, o.y)
    store(ray, OX + 2, i, o.z)
    store(ray, DX, i, rounded(x * power, o.x))
    store(ray, DX + 1, i, rounded(y * power, o.x))
    store(ray, DX + 2, i, rounded(z * power, o.x))
    store(ray, START, i, rounded(start * back, o.x))
    store(ray, T, i, rounded(end * back, o.x))
    store1(stretch, i, power)
    fill(rays.prim, i, -1)
    fill(rays.depth, i, 0)
    # 0 * inf and 0 * NaN are NaN
    finite = (0 * o.x + 0 * o.y + 0 * o.z == 0) & (0 * x + 0 * y + 0 * z == 0)
    return not any_lane(~(finite & (longest > 0) & (start >= 0) & (end == end)))


@kernel
def give(rays, stretch, leaf, t, node):
    """The distance and the leaf that each ray hit, in the caller's lengths: t of P (n), inf for nothing; node int32 (n), -1 for nothing.
    leaf: int32, of each primitive, at least one number."""
    for i in range(len(t)):
        prim = rays.prim[i]
        # no branch: nobody can guess what a ray hits
        far, owner = rays.ray[T, i] * stretch[i], leaf[max(prim, 0)]
        t[i] = far if prim >= 0 else math.inf
        node[i] = owner if prim >= 0 else -1
