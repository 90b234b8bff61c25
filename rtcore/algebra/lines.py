"""A line and a shape's numbers as whole numbers, and the exact way of a line into a shape's own space."""
from typing import NamedTuple

import numpy as np

from rtcore.fields import FieldError

Whole3 = tuple[int, int, int]


def dot(a, b) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b) -> Whole3:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def minus(a, b) -> Whole3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def times(s: int, a) -> Whole3:
    return s * a[0], s * a[1], s * a[2]


def dyadic(*numbers: float) -> tuple[list[int], int]:
    """Whole numbers n and a shift of at least 0 such that the floats are n / 2^shift."""
    ratios = [float(x).as_integer_ratio() for x in numbers]
    shift = max((below.bit_length() for _, below in ratios), default=1) - 1
    return [above << shift + 1 - below.bit_length() for above, below in ratios], shift


class Line(NamedTuple):
    """The points (origin + u · direction) / scale."""

    origin: Whole3
    direction: Whole3
    scale: int      # greater than 0


def line_of(origin, direction) -> tuple[Line, int]:
    """The line o + t d of floats, and the power with t = u · 2^power: so one of the two need not be stretched to fit the other."""
    o, low = dyadic(*origin)
    d, high = dyadic(*direction)
    return Line(tuple(o), tuple(d), 1 << low), high - low


class Place:
    """Where a shape stands: its 4 x 4 matrix, exactly."""

    def __init__(self, matrix: np.ndarray):
        self.matrix = matrix
        try:
            numbers, self.shift = dyadic(*matrix[:3].ravel())
        except (ValueError, OverflowError):
            raise FieldError("a matrix of finite numbers", matrix.tolist()) from None
        rows = [tuple(numbers[k:k + 3]) for k in (0, 4, 8)]
        self.rows, self.offset = rows, (numbers[3], numbers[7], numbers[11])
        cofactors = cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])
        self.determinant = dot(rows[0], cofactors[0])
        if not self.determinant:
            raise FieldError("transforms that together are invertible", matrix.tolist())
        self._adjugate = tuple(zip(*cofactors)) if self.determinant > 0 else tuple(zip(*(times(-1, c) for c in cofactors)))
        self._same = bool((matrix == np.eye(4)).all())

    def local(self, line: Line) -> Line:
        """A line of the world in the shape's own space."""
        if self._same:
            return line
        seen = [(p << self.shift) - c * line.scale for p, c in zip(line.origin, self.offset)]
        way = times(1 << self.shift, line.direction)
        return Line(tuple(dot(row, seen) for row in self._adjugate), tuple(dot(row, way) for row in self._adjugate),
                    abs(self.determinant) * line.scale)
