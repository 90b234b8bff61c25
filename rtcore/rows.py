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
    words = np.empty(2, np.int64)
    numbers = words.view(np.float64)
    for i in range(n):
        x, y, z = origins[i, 0], origins[i, 1], origins[i, 2]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        start, end = low[min(i, last_low)], high[min(i, last_high)]
        longest = np.float64(max(abs(dx), max(abs(dy), abs(dz))))
        # 0 · inf and 0 · NaN are NaN
        good &= (0 * x + 0 * y + 0 * z + 0 * dx + 0 * dy + 0 * dz == 0) & (longest > 0) & (start >= 0) & (end == end)
        # the bits of a float64: its exponent, 1022 for 0.5 .. 1, begins at bit 52
        numbers[0] = longest
        exponent = min(max(words[0] >> 52, 1022 - MOST), 1022 + MOST)
        words[0], words[1] = (2045 - exponent) << 52, (exponent + 1) << 52
        power, back = numbers[0], numbers[1]
        put_ray(rays, i, x, y, z, dx * power, dy * power, dz * power, end * back)
        rays.ray[START, i] = start * back
        stretch[i] = power
    finish(rays, n)
    return good


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
