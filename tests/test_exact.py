"""Exact numbers for packing, against the same in plain rationals."""
from fractions import Fraction

import numpy as np
from hypothesis import given, strategies as st

from rtcore.exact import dot, moved, parts, rationals

floats = st.floats(-1e300, 1e300) | st.floats(-100, 100) | st.sampled_from([0.0, 5e-324, 2.0 ** -1022, 1 / 3])
ratios = floats | st.builds(Fraction, st.integers(-10 ** 30, 10 ** 30), st.integers(1, 10 ** 30))


@given(st.lists(ratios, max_size=4), st.integers(1, 3))
def test_parts_are_each_the_nearest_float_of_what_is_left(values, count):
    found = np.array(parts(values, count)).reshape(count, len(values)).tolist()
    for k, value in enumerate(rationals(values)):
        for part in found:
            assert part[k] == float(value)
            value -= Fraction(part[k])


def test_a_number_beyond_all_floats_is_infinite():
    assert parts([Fraction(10) ** 400, 1.0], 2) == parts([float("inf"), 1.0], 2) == [np.inf] * 4


@given(st.lists(floats, min_size=12, max_size=12), st.lists(ratios, min_size=3, max_size=3))
def test_a_moved_point_is_the_matrix_times_it(numbers, point):
    matrix = np.vstack([np.array(numbers).reshape(3, 4), [0, 0, 0, 1]])
    wanted = [dot(rationals(row[:3]), rationals(point)) + Fraction(row[3]) for row in matrix[:3].tolist()]
    assert moved(matrix, point) == wanted
