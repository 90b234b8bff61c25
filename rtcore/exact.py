"""Exact numbers for packing: floats are rationals, so what a kernel is to rely on is computed in rationals and rounded once, to pairs."""
import functools
from collections.abc import Iterable
from fractions import Fraction

import numpy as np


def pairs(values: Iterable[Fraction | float]) -> list[float]:
    """The numbers as double-double: all their high parts, then all their low parts. A number too large for float64 becomes inf."""
    high, low = [], []
    for value in values:
        try:
            high.append(float(value))
            low.append(float(value - Fraction(high[-1])) if isinstance(value, Fraction) else 0.0)
        except OverflowError:
            high.append(np.inf)
            low.append(0.0)
    return high + low


def rationals(values) -> list[Fraction]:
    """Floats as rationals."""
    return [Fraction(float(x)) for x in values]


def dot(a, b) -> Fraction:
    """The sum of products of two sequences of rationals."""
    return sum((x * y for x, y in zip(a, b)), Fraction(0))


def inverse(matrix: np.ndarray) -> tuple[tuple[Fraction, ...], ...]:
    """Rows of the inverse of the linear part of a 4 x 4 matrix. ZeroDivisionError where there is none."""
    return _inverse(np.ascontiguousarray(matrix[:3, :3], np.float64).tobytes())


@functools.lru_cache(maxsize=4096)      # thousands of leaves share a few matrices
def _inverse(linear: bytes) -> tuple[tuple[Fraction, ...], ...]:
    """By the adjugate, in integers: a tenth of the time of elimination in rationals."""
    ratios = [x.as_integer_ratio() for x in np.frombuffer(linear).tolist()]
    unit = max(below for _, below in ratios)
    a, b, c, d, e, f, g, h, i = (above * (unit // below) for above, below in ratios)
    adjugate = ((e * i - f * h, c * h - b * i, b * f - c * e), (f * g - d * i, a * i - c * g, c * d - a * f),
                (d * h - e * g, b * g - a * h, a * e - b * d))
    whole = a * adjugate[0][0] + b * adjugate[1][0] + c * adjugate[2][0]
    return tuple(tuple(Fraction(x * unit, whole) for x in row) for row in adjugate)


def moved(matrix: np.ndarray, point) -> list[Fraction]:
    """A point under a 4 x 4 matrix, exactly."""
    point = rationals(point)
    return [dot(rationals(row[:3]), point) + Fraction(float(row[3])) for row in matrix[:3]]
