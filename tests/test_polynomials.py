"""Exact real roots: counted with multiplicity, in order, and rounded to the nearest float; polynomials are made from known factors."""
import functools
import math
import warnings
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcore.algebra.polynomials import (changes_at, derivative, gcd, plus, quotient, real_root_count, remainder, scaled, square_free, sturm,
                                        times, value)
from rtcore.algebra.roots import Isolated, Rational, Surd, compare, nearest, real_roots

from rtcore.reports.oracle import mp

F64, F32 = (53, -1074), (24, -149)
whole = st.integers(-2**70, 2**70)
polynomials = st.lists(whole, min_size=2, max_size=6).filter(lambda p: p[-1] != 0)
fractions = st.fractions(-1000, 1000, max_denominator=10**6)
#: Factors whose roots are irrational and sit close together: (t - a)² - e.
surds = st.tuples(fractions, st.sampled_from([2, 3, 5, Fraction(2, 10**12), Fraction(7, 10**30)]))
linear = st.tuples(fractions, st.integers(1, 3))
COMPLEX = [[1, 0, 1], [7, -3, 1], [1, 2, 3, 4, 5]]      # factors without real roots


def product(factors) -> list[int]:
    return functools.reduce(times, factors, [1])


def of_fraction(f: Fraction) -> list[int]:
    return [-f.numerator, f.denominator]


def of_surd(a: Fraction, e: Fraction) -> list[int]:
    c = a * a - e
    unit = math.lcm(c.denominator, (2 * a).denominator)
    return [int(c * unit), int(-2 * a * unit), int(unit)]


def truth(p) -> list:
    """Real roots in 80 digits, ascending; for polynomials without multiple roots."""
    with mp.workdps(80), warnings.catch_warnings():     # newer releases of mpmath want the order of coefficients said
        warnings.simplefilter("ignore", DeprecationWarning)
        roots = mp.polyroots([mp.mpf(c) for c in reversed(p)], maxsteps=1000, extraprec=1000)
        return sorted(mp.re(r) for r in roots if abs(mp.im(r)) <= mp.mpf(10) ** -60 * (1 + abs(r)))


@given(polynomials, polynomials)
def test_division(a, b):
    assert quotient(times(a, b), gcd(b, b)) == scaled(a, b[-1] // gcd(b, b)[-1])
    rest = remainder(a, b)
    assert len(rest) < len(b)
    if len(a) >= len(b):        # a positive multiple of a minus the rest is divisible by b
        assert any(remainder(plus(scaled(a, abs(b[-1]) ** k), scaled(rest, -1)), b) == [] for k in range(len(a) - len(b) + 2))


@given(polynomials, polynomials, polynomials)
def test_gcd_holds_the_common_factor(a, b, common):
    found = gcd(times(a, common), times(b, common))
    assert remainder(found, common) == [] and remainder(times(a, common), found) == [] and remainder(times(b, common), found) == []


@given(polynomials, st.integers(-2**40, 2**40), st.integers(-20, 60))
def test_value(p, n, shift):
    exact = sum(c * Fraction(n) ** i / Fraction(2) ** (shift * i) for i, c in enumerate(p))
    assert value(p, n, shift) == exact * (Fraction(2) ** (shift * (len(p) - 1)) if shift > 0 else 1)


@given(st.dictionaries(fractions, st.integers(1, 3), min_size=1, max_size=3), st.sampled_from(COMPLEX))
def test_multiplicities(roots, other):
    p = product([of_fraction(root) for root, times_ in roots.items() for _ in range(times_)] + [other])
    found = real_roots(p)
    assert [(compare(root, Rational(true)), m) for (root, m), true in zip(found, sorted(roots))] == [(0, roots[r]) for r in sorted(roots)]
    assert len(found) == len(roots)
    assert [nearest(r, 0, *F64) for r, _ in found] == [float(f) for f in sorted(roots)]
    assert sorted(m for _, m in square_free(p)) == sorted({*roots.values(), 1})


@given(st.lists(surds, min_size=1, max_size=3, unique_by=lambda s: s[0]), st.integers(1, 2), st.sampled_from([-1, 1]))
def test_irrational_roots(factors, multiplicity, way):
    p = scaled(product([of_surd(a, Fraction(e)) for a, e in factors] * multiplicity), way)
    with mp.workdps(80):
        true = sorted(mp.mpf(a.numerator) / a.denominator + s * mp.sqrt(mp.mpf(Fraction(e).numerator) / Fraction(e).denominator)
                      for a, e in factors for s in (-1, 1))
    found = real_roots(p)
    assert [m for _, m in found] == [multiplicity] * len(true)
    assert [nearest(r, 0, *F64) for r, _ in found] == [float(t) for t in true]
    assert all(compare(a, b) == -1 == -compare(b, a) for (a, _), (b, _) in zip(found, found[1:]))


@given(st.lists(st.integers(-1000, 1000), min_size=2, max_size=6).filter(lambda p: p[-1] != 0))
def test_any_polynomial(p):
    if any(m > 1 for _, m in square_free(p)):
        return
    true = truth(p)
    found = real_roots(p)
    assert len(found) == len(true)
    for (root, m), t in zip(found, true):
        assert m == 1
        assert nearest(root, 0, *F64) == pytest.approx(float(t), rel=2.0 ** -52, abs=1e-300)
        assert root.sign_of(p) == 0 and root.sign_of(derivative(p)) == np.sign(p[-1]) * (-1) ** (len(true) - 1 - true.index(t))


@given(polynomials, whole, st.integers(0, 80))
def test_sturm_counts(p, n, shift):
    """The roots to the left and to the right of any number are all of them."""
    chain = sturm(p)
    if len(chain[-1]) > 1:
        return
    left = sum(compare(root, Rational(n, 1 << shift)) <= 0 for root, _ in real_roots(p))
    most_left = changes_at(chain, -2**400, 0)
    assert most_left - changes_at(chain, n, shift) == left and real_root_count(chain) == len(real_roots(p))


@pytest.mark.parametrize("p", [[105887601, -5303520, 101796, -960, 4], [-16, 0, 0, 2, 1]])
def test_quartics_of_the_catalogue(p):
    """u⁴ - 240u³ + 25449u² - 1325880u + 26471900.25 and x⁴ + 2x³ - 16."""
    true = truth(p)
    assert len(true) == 2 and [nearest(r, 0, *F64) for r, m in real_roots(p) if m == 1] == [float(t) for t in true]


def test_the_kinds_of_roots():
    (a, _), (b, _), (c, _) = real_roots(times([-2, 0, 1], [-3, 1]))
    assert isinstance(a, Isolated) and compare(b, Rational(3)) == -1 and compare(c, Rational(3)) == 0     # -√2 < √2 < 3
    low, high = (r for r, _ in real_roots([-2, 0, 1]))
    assert isinstance(low, Surd) and (compare(a, low), compare(a, high), compare(high, b), compare(c, high)) == (0, -1, 0, 1)
    assert a.sign_of([-2, 0, 1]) == 0 and a.sign_of([-2, 0, 1, 5, 7]) == 1 and b.sign_of([]) == 0
    assert [type(r) for r, _ in real_roots([2, -3, 1])] == [Rational, Rational] and real_roots([5]) == real_roots([]) == []


@given(st.integers(-2**80, 2**80), st.integers(-1200, 1100), st.sampled_from([F64, F32]))
def test_rounding_of_dyadic_numbers(n, power, precision):
    """Ties to even, subnormals and overflow, as IEEE 754 has it; a number just above a tie is rounded up."""
    dtype = np.float64 if precision == F64 else np.float32
    exact = Fraction(n) * Fraction(2) ** power
    found = nearest(Rational(n), power, *precision)
    most = Fraction(float(np.finfo(dtype).max))
    if abs(exact) > most:
        assert found > 0 if n > 0 else found < 0
        assert dtype is np.float32 or abs(found) in (np.inf, float(most))
        return
    assert float(dtype(found)) == found
    best = abs(Fraction(found) - exact)
    for way in (-np.inf, np.inf):
        other = float(np.nextafter(dtype(found), dtype(way)))
        if np.isfinite(other):
            rest = abs(Fraction(other) - exact)
            assert best < rest or best == rest and int(np.array(found, dtype).view(f"i{dtype().itemsize}")) % 2 == 0


@pytest.mark.parametrize("precision", [F64, F32])
def test_rounding_beside_a_tie(precision):
    digits, _ = precision
    tie = Fraction(1) + Fraction(1, 2**digits)
    for true, up in ((tie, 0), (tie + Fraction(1, 2**3000), 1), (tie - Fraction(1, 2**3000), 0), (tie + Fraction(1, 3**99), 1)):
        assert nearest(Rational(true), 0, *precision) == 1 + up * 2.0 ** (1 - digits)
        assert nearest(Rational(-true), 7, *precision) == -128 - up * 2.0 ** (8 - digits)
