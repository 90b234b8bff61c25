"""Formulas in double-double: elementary functions and whole tapes against 50 digits, and what the search gains by them."""
import numpy as np
import pytest

import rtcore
from rtcore import Implicit, Scene
from rtcore.reports import formulas
from rtcore.reports.oracle import crossings, mp
from rtcore.shapes import _elementary as elementary
from rtcore.shapes._formula import compiled
from rtcore.shapes._precise import new_rows, value_of

EYE, CLOSE = np.eye(4), elementary.CLOSE
HERE = ((-1, -1, -1), (1, 1, 1))
UNION = Implicit("smin(((x/1)^2+(y/1)^2+(z/1)^2)-0.484957, ((x/1)-0.7)^2+(y/1)^2+(z/1)^2-0.2, 0.3)", *HERE)


def pairs(rng, low: float, high: float, n: int = 300):
    """Pairs of that many digits, their sizes spread evenly over the powers of ten."""
    high_parts = 10 ** rng.uniform(low, high, n)
    return [(float(x), float(x * r)) for x, r in zip(high_parts, rng.uniform(-2.0 ** -54, 2.0 ** -54, n))]


def exact(pair):
    return mp.mpf(pair[0]) + mp.mpf(pair[1])


@pytest.mark.parametrize(("function", "low", "high", "true", "size"), [
    (elementary.exponential, -20, 2.8, mp.exp, lambda y: abs(y)), (elementary.logarithm, -290, 290, mp.log, lambda y: 1 + abs(y)),
    (lambda x, y: elementary.sine_cosine(x, y)[:2], -20, 6, mp.sin, lambda y: 1),
    (lambda x, y: elementary.sine_cosine(x, y)[2:], -20, 6, mp.cos, lambda y: 1)], ids=["exp", "log", "sin", "cos"])
def test_elementary_functions(function, low, high, true, size):
    for pair in pairs(np.random.default_rng(1), low, high):
        for sign in (1, -1) if true != mp.log else (1,):
            x = sign * pair[0], sign * pair[1]
            y = true(exact(x))
            assert abs(exact(function(*x)) - y) <= CLOSE * size(y), x


def test_angles():
    rng = np.random.default_rng(2)
    for y, x in zip(pairs(rng, -9, 9), pairs(rng, -9, 9)):
        for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            y, x = (signs[0] * y[0], signs[0] * y[1]), (signs[1] * x[0], signs[1] * x[1])
            assert abs(exact(elementary.angle(*y, *x)) - mp.atan2(exact(y), exact(x))) <= CLOSE


def test_outside_their_range_there_is_nothing():
    assert np.isnan([elementary.exponential(800.0, 0.0)[0], elementary.logarithm(-1.0, 0.0)[0], elementary.sine_cosine(1e9, 0.0)[0],
                     elementary.angle(0.0, 0.0, 0.0, 0.0)[0]]).all()


@pytest.mark.parametrize("text", [
    "x^2 + y^2 + z^2 - 1", "(x*y - z)/(x + 3) - 2/(y + 4)", "x^7 - y^5*z + 0.375", "sqrt(x^2 + 0.1) - z", "(x + 2)^2.5 - (y + 3)^-0.3",
    "sin(4*x)*cos(4*y) + sin(4*y)*cos(4*z)", "tan(x) - exp(y)*log(z + 2)", "min(x, y) + max(y, z) - abs(x - z)", "smin(x, y, 0.8) - z",
    "atan2(y, x + 2) - z", "floor(3*x) + mod(y, 0.3) - z", "exp(-40*x^2) - 1e-300*y", "1e300*(x^2 - y)", "(x - 0.25)*(x - 0.25)",
    UNION.expression])
def test_a_tape_is_within_its_bound(text):
    rng = np.random.default_rng(len(text))
    node, names, told = formulas.tree(text), formulas.precise(mp), 0
    for _ in range(100):
        p = rng.uniform(-1, 1, (3, 3)) * (1, 2.0 ** -54, 0)
        value, off = value_of(compiled(text), new_rows(), p)
        at = dict(zip("xyz", (mp.mpf(row[0]) + mp.mpf(row[1]) for row in p)))
        true = formulas.value(node, names | at, mp.mpf)
        if off < np.inf:
            assert abs(mp.mpf(float(value)) - true) <= mp.mpf(float(off)) + abs(true) * 2.0 ** -53     # its leading part is returned
            assert off <= 2.0 ** -80 * (1e301 if "1e300" in text else 1)
            told += 1
    assert told > 95


def test_what_may_be_undefined_or_jump_is_not_known():
    point = np.array([(0.0, 0, 2.0 ** -90), (1, 0, 0), (-1, 0, 0)])
    for text in ("1/x", "sqrt(x)", "log(x)", "floor(x)", "mod(x, 0.5)", "x^0.3", "atan2(x, z)", "y/(x*z)", "sqrt(z)", "exp(1e9*y)"):
        assert value_of(compiled(text), new_rows(), point)[1] == np.inf, text


# --- what the search gains ---

def test_a_chord_of_a_thousandth_of_a_thousandth_is_met_at_its_start():
    """The ray dips into the union for 1e-6 of its length, by 7e-10: samples of the surface see nothing of it."""
    o, d = (-37.94284298753067, 18.93221674523672, -19.188355677119254), (38.1292981374267, -19.169149206957194, 18.56061808469816)
    true = [c.t for c in crossings(UNION, EYE, o, d)]
    assert len(true) == 2 and true[1] - true[0] < 2e-6
    t = rtcore.intersect(Scene(objects=[UNION]), [o], [d]).t[0]
    assert abs(mp.mpf(float(t)) - true[0]) < 1e-12


@pytest.mark.parametrize("text", ["(x^2+y^2+z^2+0.24)^2-1.2*(x^2+y^2)", "x^2+y^2+z^2-0.5", "x^6+y^4*2+z^2-x*y*z-0.3"])
def test_a_start_within_a_rounding_of_the_surface_is_on_its_true_side(text):
    """Float64 can't tell the sign of the value there; what is met first depends on it."""
    shape, rng = Implicit(text, *HERE), np.random.default_rng(3)
    scene, eye = Scene(objects=[shape]), rng.normal(size=(60, 3)) * 3
    d = rng.uniform(-0.5, 0.5, (60, 3)) - eye
    hits = rtcore.intersect(scene, eye, d)
    met = np.isfinite(hits.t)
    count = tiny = 0
    for p in (eye + hits.t[:, None] * d)[met]:
        for way in rng.normal(size=(4, 3)):
            true = [c.t for c in crossings(shape, EYE, p, way) if c.t > 1e-40]
            t = rtcore.intersect(scene, [p], [way]).t[0]
            assert np.isfinite(t) == bool(true), (p.tolist(), way.tolist())
            if true:
                assert abs(mp.mpf(float(t)) - true[0]) < 1e-11, (p.tolist(), way.tolist())
                tiny += true[0] < 1e-14
            count += 1
    assert count > 60 and tiny > 10
