"""Solvers of the quadric; numbers: the ten coefficients, then the corners of its box, infinite where it has none."""
import numpy as np

from rtcore.jit import inline, kernel
from rtcore.lanes import fma
from rtcore.solvers._quadratic import put_stable, put_textbook

MOST = 2


def numbers(shape) -> np.ndarray:
    box = (-np.inf,) * 3 + (np.inf,) * 3 if shape.low is None else (*shape.low, *shape.high)
    return np.array([*shape.coefficients, *box])


@inline
def quadratic(k, x, y, z, u, v, w):
    """a, b and c of a t² + b t + c, the form at (x, y, z) + t (u, v, w)."""
    gx, gy, gz = k[3] * y + k[4] * z + k[6], k[3] * x + k[5] * z + k[7], k[4] * x + k[5] * y + k[8]
    px, py, pz = k[0] * x, k[1] * y, k[2] * z
    a = k[0] * u * u + k[1] * v * v + k[2] * w * w + k[3] * u * v + k[4] * u * w + k[5] * v * w
    b = (px + px + gx) * u + (py + py + gy) * v + (pz + pz + gz) * w
    c = px * x + py * y + pz * z + k[3] * x * y + k[4] * x * z + k[5] * y * z + k[6] * x + k[7] * y + k[8] * z + k[9]
    return a, b, c


@inline
def keep_inside(k, rays, roots, count, i):
    """Drop the roots outside the box."""
    kept = 0
    for j in range(count[i]):
        t = roots[i, j]
        inside = True
        for axis in range(3):
            p = rays[axis, i] + t * rays[3 + axis, i]
            inside = inside and k[10 + axis] <= p and p <= k[13 + axis]
        if inside or np.isnan(t):       # what is no number is a failure to be seen, not a miss
            roots[i, kept] = t
            kept += 1
    count[i] = kept


@kernel
def textbook(rays, numbers, roots, count):
    """The form's quadratic in t, solved with b² - 4ac."""
    for i in range(rays.shape[1]):
        a, b, c = quadratic(numbers, rays[0, i], rays[1, i], rays[2, i], rays[3, i], rays[4, i], rays[5, i])
        put_textbook(a, b, c, roots, count, i)
        keep_inside(numbers, rays, roots, count, i)


@kernel
def stable(rays, numbers, roots, count):
    """The form's quadratic in t by the lecture's pair: t₁ = q/A without cancellation, t₂ = C/(A t₁)."""
    for i in range(rays.shape[1]):
        a, b, c = quadratic(numbers, rays[0, i], rays[1, i], rays[2, i], rays[3, i], rays[4, i], rays[5, i])
        put_stable(a, b, c, roots, count, i)
        keep_inside(numbers, rays, roots, count, i)


@kernel
def kahan(rays, numbers, roots, count):
    """About the ray's closest approach to the origin, the discriminant by Kahan's difference of products with one rounding (Jeannerod,
    Louvet, Muller, *Further Analysis of Kahan's Algorithm*, Mathematics of Computation 82, 2013), A = 0 a branch of its own."""
    kind = numbers.dtype.type
    for i in range(rays.shape[1]):
        x, y, z, u, v, w = rays[0, i], rays[1, i], rays[2, i], rays[3, i], rays[4, i], rays[5, i]
        shift = -(x * u + y * v + z * w) / (u * u + v * v + w * w)
        a, b, c = quadratic(numbers, x + shift * u, y + shift * v, z + shift * w, u, v, w)
        b = b / kind(2)
        product = np.float64(a * c)
        square = fma(np.float64(b), np.float64(b), -product) - fma(np.float64(a), np.float64(c), -product)
        if square >= 0:
            half = kind(np.sqrt(square))
            q = -(b + half) if b > 0 else half - b
            n = 0
            if q != 0:
                roots[i, n] = c / q + shift
                n += 1
            if a != 0:
                roots[i, n] = q / a + shift
                n += 1
            count[i] = n
            keep_inside(numbers, rays, roots, count, i)


SOLVERS = {"textbook": textbook, "stable": stable, "kahan": kahan}
