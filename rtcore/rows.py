"""What callers give and get, a row a ray, from and to what kernels work on: checked, scaled and transposed in one pass."""
import math

import numpy as np

from rtcore.jit import kernel
from rtcore.wave import START, T, finish, put_ray

MOST = 1000     # directions are scaled by a power of two of at most this exponent, so that it and its inverse are ordinary numbers


@kernel
def take(origins, directions, low, high, rays, stretch):
    """Fill `rays` with origins and directions, (n, 3) of P each, that count hits in low .. high, float64 (n) or (1).

    A direction is scaled until its longest part is in 0.5 .. 1, so that no length of it overflows in a kernel; t counts in these lengths
    meanwhile, and stretch, float64 (n), brings it back. Returns whether all numbers are finite, no direction is 0, no low below 0, no
    limit NaN; the rays are good for nothing otherwise.
    """
    n = len(origins)
    last_low, last_high = len(low) - 1, len(high) - 1
    good = True
    floor, power, back = math.inf, 1.0, 1.0
    for i in range(n):
        x, y, z = origins[i, 0], origins[i, 1], origins[i, 2]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        start, end = low[min(i, last_low)], high[min(i, last_high)]
        longest = np.float64(max(abs(dx), max(abs(dy), abs(dz))))
        # 0 · inf and 0 · NaN are NaN
        good &= (0 * x + 0 * y + 0 * z + 0 * dx + 0 * dy + 0 * dz == 0) & (longest > 0) & (start >= 0) & (end == end)
        if not floor <= longest < 2 * floor:    # most rays are as long as the last
            exponent = math.frexp(longest)[1]
            floor = math.ldexp(0.5, exponent)
            exponent = min(max(exponent, -MOST), MOST)
            power, back = math.ldexp(1.0, -exponent), math.ldexp(1.0, exponent)
        put_ray(rays, i, x, y, z, dx * power, dy * power, dz * power, end * back)
        rays.ray[START, i] = start * back
        stretch[i] = power
    finish(rays, n)
    return good


@kernel
def give(rays, stretch, leaf, t, node):
    """The distance and the leaf that each ray hit, in the caller's lengths: t of P (n), inf for nothing; node int32 (n), -1 for nothing."""
    for i in range(len(t)):
        prim = rays.prim[i]
        t[i] = rays.ray[T, i] * stretch[i] if prim >= 0 else math.inf
        node[i] = leaf[prim] if prim >= 0 else -1
