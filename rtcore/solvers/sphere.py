"""Solvers of the sphere; numbers: centre, radius."""
import numpy as np

from rtcore.jit import inline, kernel
from rtcore.solvers._quadratic import put_stable, put_textbook

MOST = 2


def numbers(shape) -> np.ndarray:
    return np.array([*shape.center, shape.radius])


@inline
def centred(rays, numbers, i):
    """Origin relative to the centre, and direction."""
    return rays[0, i] - numbers[0], rays[1, i] - numbers[1], rays[2, i] - numbers[2], rays[3, i], rays[4, i], rays[5, i]


@kernel
def textbook(rays, numbers, roots, count):
    """The quadratic as the notes derive it, |f + t d|² = r², solved with b² - 4ac."""
    for i in range(rays.shape[1]):
        x, y, z, u, v, w = centred(rays, numbers, i)
        b = x * u + y * v + z * w
        put_textbook(u * u + v * v + w * w, b + b, x * x + y * y + z * z - numbers[3] * numbers[3], roots, count, i)


@kernel
def stable(rays, numbers, roots, count):
    """The same quadratic, its roots by the lecture's "avoid rounding errors": t₁ = q/A without cancellation, t₂ = C/(A t₁)."""
    for i in range(rays.shape[1]):
        x, y, z, u, v, w = centred(rays, numbers, i)
        b = x * u + y * v + z * w
        put_stable(u * u + v * v + w * w, b + b, x * x + y * y + z * z - numbers[3] * numbers[3], roots, count, i)


@kernel
def geometric(rays, numbers, roots, count):
    """The discriminant from the perpendicular from the centre to the ray: Haines, Günther, Akenine-Möller, *Precision Improvements for
    Ray/Sphere Intersection*, Ray Tracing Gems ch. 7 (2019)."""
    for i in range(rays.shape[1]):
        x, y, z, u, v, w = centred(rays, numbers, i)
        a, r = u * u + v * v + w * w, numbers[3]
        b = -(x * u + y * v + z * w)
        s = b / a
        lx, ly, lz = x + s * u, y + s * v, z + s * w
        square = r * r - (lx * lx + ly * ly + lz * lz)
        if square >= 0:
            half = np.sqrt(a * square)
            q = b + half if b > 0 else b - half
            roots[i, 0], roots[i, 1], count[i] = (x * x + y * y + z * z - r * r) / q, q / a, 2


SOLVERS = {"textbook": textbook, "stable": stable, "geometric": geometric}
