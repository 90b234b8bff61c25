"""Formulas along a line: their roots are not algebraic but certified by intervals, to a few units in the last place."""
from collections import Counter

from rtcore.algebra.curved import Crossing, Find
from rtcore.algebra.lines import Line, Place
from rtcore.algebra.roots import Rational
from rtcore.shapes.implicit import line_roots
from rtcore.shapes.kind import BACK, FRONT, SIDES


def implicit(shape, place: Place) -> Find:
    side = SIDES[shape.sides]
    facing = {FRONT: -1, BACK: 1}.get(side, 0)

    def find(line: Line) -> list[Crossing]:
        # a direction whose numbers are floats: u = t · scale / unit
        unit = 1 << max(abs(x).bit_length() for x in line.direction)
        origin, direction = [x / line.scale for x in line.origin], [x / unit for x in line.direction]
        found = Counter(line_roots(shape, place.matrix, origin, direction, side))
        return [Crossing(Rational(Rational(t) * line.scale / unit), times, facing if times == 1 else 0) for t, times in found.items()]
    return find
