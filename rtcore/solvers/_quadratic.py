"""Two ways to the roots of a quadratic."""
import numpy as np

from rtcore.jit import inline


@inline
def put_textbook(a, b, c, roots, count, i):
    """Roots of a t² + b t + c by the formula of school."""
    product = a * c
    square = b * b - (product + product + product + product)
    if square >= 0:
        half = np.sqrt(square)
        roots[i, 0], roots[i, 1], count[i] = (-b - half) / (a + a), (-b + half) / (a + a), 2


@inline
def put_stable(a, b, c, roots, count, i):
    """The lecture's pair: the root whose numerator does not cancel, the other from their product c / a."""
    product = a * c
    square = b * b - (product + product + product + product)
    if square >= 0:
        half = np.sqrt(square)
        q = -b - half if b > 0 else -b + half
        roots[i, 0], roots[i, 1], count[i] = q / (a + a), c / (q / (a + a) * a), 2
