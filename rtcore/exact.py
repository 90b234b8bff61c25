"""Exact numbers for packing: floats are rationals, so what a kernel relies on is computed in rationals and rounded once, to two or three
floats."""
import functools
import math
from collections.abc import Iterable
from fractions import Fraction

import numpy as np


def parts(values: Iterable[Fraction | float], count: int = 2) -> list[float]:
    """The numbers as sums of `count` floats: all their leading parts, then all their second ones ... A number too large becomes inf.

    In integers, for fractions seek common divisors at every step: a quarter of the time.
    """
    values = list(values)
    try:
        rest, result = [x.as_integer_ratio() for x in values], []
        for _ in range(count):
            result += (leading := [above / below for above, below in rest])     # of integers: rounded once
            rest = [(above * q - p * below, below * q) for (above, below), (p, q) in zip(rest, map(float.as_integer_ratio, leading))]
    except OverflowError:
        return [np.inf] * (count * len(values))
    return result


def rationals(values) -> list[Fraction]:
    """Floats, or rationals, as rationals."""
    return [Fraction(x) for x in values]


def _whole(values) -> tuple[list[int], int]:
    """Floats, or rationals, as integers over one denominator."""
    ratios = [x.as_integer_ratio() for x in values]
    unit = math.lcm(*(below for _, below in ratios))
    return [above * (unit // below) for above, below in ratios], unit


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


def inverse_parts(matrix: np.ndarray) -> np.ndarray:
    """The inverse of the linear part of a 4 x 4 matrix in three parts: (27,), the rows' leading parts first. Not to be written to."""
    return _inverse_parts(np.ascontiguousarray(matrix[:3, :3], np.float64).tobytes())


@functools.lru_cache(maxsize=4096)
def _inverse_parts(linear: bytes) -> np.ndarray:
    return np.array(parts([x for row in _inverse(linear) for x in row], 3))


def turned(matrix: np.ndarray, normal) -> list[Fraction]:
    """The direction of a normal under a 4 x 4 matrix: the inverse transpose's product, its largest number brought to 1/2 .. 1 by a positive
    factor that makes all of them binary fractions, which three floats mostly hold exactly."""
    result = [dot(column, rationals(normal)) for column in zip(*inverse(matrix))]
    whole = math.lcm(*(x.denominator for x in result))
    numbers = [int(x * whole) for x in result]
    return [Fraction(n, 1 << max(map(abs, numbers)).bit_length()) for n in numbers]


def moved(matrix: np.ndarray, point) -> list[Fraction]:
    """A point under a 4 x 4 matrix, exactly."""
    (x, y, z), unit = _whole(point)
    result = []
    for row in matrix[:3].tolist():
        (a, b, c, d), below = _whole(row)
        result.append(Fraction(a * x + b * y + c * z + d * unit, below * unit))
    return result
