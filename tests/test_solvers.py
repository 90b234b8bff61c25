"""The named solvers: right on easy rays, wrong in the ways they are known for on hard ones, and never a part of the renderer."""
import ast
import math
from pathlib import Path

import numpy as np
import pytest

import rtcore
from rtcore import Implicit, Plane, Polygon, Quadric, Sphere, Torus, Triangle, solvers
from rtcore.jit import kernel
from rtcore.reports.oracle import crossings, mp
from rtcore.solvers import implicit
from rtcore.solvers._orellana import put_orellana
from rtcore.solvers._quartic import put_ferrari, put_sturm

PARABOLOID = Quadric((1, 1, 0, 0, 0, 0, 0, 0, -1, 0))
SHAPES = (Sphere((0.1, 0.2, 0.3), 1.2), Plane((0.1, 0.2, 0.3), (1, 2, 3)), Triangle((-2, -2, 0.1), (3, -1, 0.5), (0.2, 3, 0)),
          Quadric((1, 2, 0.5, 0.1, 0.2, 0.3, 0.1, 0.2, 0.3, -2)), Quadric(PARABOLOID.coefficients, (-1, -1, -1), (1, 1, 1)),
          Torus(1, 0.25), Torus(1, 0.9), Torus(0.5, 1))
ALL = [(shape, name) for shape in SHAPES for name in solvers.names(type(shape))[1:]]


def one(shape, name, origin, direction, dtype=np.float64):
    """A solver's roots of one ray, ascending."""
    found, count = solvers.roots(shape, name, np.array([*origin, *direction], dtype)[:, None])
    return sorted(found[0, :count[0]].tolist())


def test_names():
    assert solvers.names(Sphere) == ("renderer", "textbook", "stable", "geometric")
    assert solvers.names(Plane) == ("renderer", "point-normal", "height-and-secant")
    assert solvers.names(Triangle) == ("renderer", "cramer", "moeller-trumbore")
    assert solvers.names(Polygon) == ("renderer",)
    assert {"textbook", "stable", "kahan"} < set(solvers.names(Quadric))
    assert {"ferrari", "ferrari-near", "companion", "sturm", "orellana"} < set(solvers.names(Torus))
    assert all(solver.solve.__doc__ for methods in solvers.METHODS.values() for solver in methods.values())


@pytest.mark.parametrize(("shape", "name"), ALL, ids=lambda x: x if isinstance(x, str) else "")
def test_every_root_of_easy_rays(shape, name):
    rng = np.random.default_rng(3)
    o, d = rng.uniform(-3, 3, (60, 3)), rng.uniform(-1, 1, (60, 3))
    d -= o
    truth = [[c.t for c in crossings(shape, np.eye(4), *ray)] for ray in zip(o, d)]
    assert sum(map(len, truth)) > 30
    for dtype, off in ((np.float64, 1e-9), (np.float32, 2e-2)):
        found, count = solvers.roots(shape, name, np.concatenate([o.T, d.T]).astype(dtype))
        assert found.dtype == dtype
        for true, row, n in zip(truth, found, count):
            assert len(true) == n
            for a, b in zip(true, sorted(row[:n].tolist())):
                assert abs(b - a) <= off


FORMULAS = ("x^2+y^2+z^2-0.6", "sin(4*x)*cos(4*y)+sin(4*y)*cos(4*z)+sin(4*z)*cos(4*x)", "smin(x,y+0.1,0.3)-z/2", "x^3-2/(y+3)+0.3-z",
            "exp(x)-log(y+2)*sqrt(z+2)+abs(x-y)-0.8", "min(x,y)+max(y,z)-atan2(x+2,y+3)", "floor(2*x)+mod(3*y,0.7)-tan(z)",
            "(x+2)^2.5-y^4-6")


@pytest.mark.parametrize("text", FORMULAS)
def test_formulas(text):
    """The tape in plain arithmetic against Python's own; then where each solver says the value is 0, it nearly is."""
    shape = Implicit(text, (-1, -1, -1), (1, 1, 1))
    points = np.random.default_rng(6).uniform(-1, 1, (3, 200))
    found = np.empty(200)
    implicit.values_at(implicit.numbers(shape), points, found)
    assert found == pytest.approx([of(text, *p) for p in points.T], rel=1e-13, abs=1e-13)
    o = np.random.default_rng(7).uniform(-3, 3, (3, 60))
    d = points[:, :60] - o
    for name, off in (("sphere-tracing", 1e-3), ("bracketing", 1e-9)):
        roots, count = solvers.roots(shape, name, np.concatenate([o, d]))
        hits = o + roots[:, 0] * d
        good = [abs(of(text, *p)) < off or "floor" in text for p in hits.T[count > 0]]
        assert len(good) > 15 and all(good)


def of(text, x, y, z):
    """A formula's value, by Python."""
    names = {**vars(math), "x": x, "y": y, "z": z, "abs": abs, "min": min, "max": max, "mod": lambda a, b: a - b * math.floor(a / b),
             "smin": lambda a, b, k: min(a, b) - max(k - abs(a - b), 0) ** 2 / (4 * k)}
    return eval(text.replace("^", "**"), names)


def test_bracketing_takes_a_pole_for_a_root_and_misses_a_touch():
    pole, ring = Implicit("1/x", (-1, -1, -1), (1.5, 1, 1)), Implicit("(x^2+y^2+z^2-1)^2", (-2, -2, -2), (2, 2, 2))
    assert one(pole, "bracketing", (-2, 0, 0), (1, 0, 0)) == pytest.approx([2])
    assert one(ring, "bracketing", (0, 0, -3), (0, 0, 1)) == []


def test_arithmetic_is_of_the_precision():
    """Bit for bit what numpy makes of the formula in float32."""
    rng = np.random.default_rng(4)
    o, d = rng.uniform(-1, 1, (2, 3, 200)).astype(np.float32)
    a, b, c = (d * d).sum(0), 2 * (o * d).sum(0), (o * o).sum(0) - np.float32(4)
    expected = (-b + np.sqrt(b * b - 4 * (a * c))) / (2 * a)
    assert expected.dtype == np.float32
    found, count = solvers.roots(Sphere((0, 0, 0), 2), "textbook", np.concatenate([o, d]))
    assert (count == 2).all() and (found[:, 1] == expected).all()


@pytest.mark.parametrize(("name", "least", "most"), [("textbook", 5.7e7, 5.9e7), ("stable", 5.7e7, 5.9e7), ("geometric", 0, 4)])
def test_the_far_sphere(name, least, most):
    """o = (0, 1/2, -1e8): the discriminant cancels, whichever way the roots are taken."""
    true = 1e8 - mp.sqrt(mp.mpf("0.75"))
    error = abs(one(Sphere((0, 0, 0), 1), name, (0, 0.5, -1e8), (0, 0, 1))[0] - true) / np.spacing(float(true))
    assert least <= error <= most


def test_the_far_sphere_in_float32():
    true = 4100 - np.sqrt(0.75)
    error = abs(one(Sphere((0, 0, 0), 1), "stable", (0, 0.5, -4100), (0, 0, 1), np.float32)[0] - true) / np.spacing(np.float32(true))
    assert 1700 < error < 1800


def test_quadric_without_a_square():
    for name in ("textbook", "stable"):
        assert not np.isfinite(one(PARABOLOID, name, (0.5, 0, 5), (0, 0, -1))).all()
    assert one(PARABOLOID, "kahan", (0.5, 0, 5), (0, 0, -1)) == [4.75]


def test_quadric_whose_discriminant_vanishes():
    near = Quadric((94906265.625, 0, 0, 0, 0, 0, -189812534, 0, 0, 94906268.375))
    assert one(near, "kahan", (0, 0, 0), (1, 0, 0)) == pytest.approx([1, 1.00000002897595835], abs=1e-15)
    assert max(abs(t - 1) for t in one(near, "textbook", (0, 0, 0), (1, 0, 0))) < 2e-8     # one root twice, halfway between


def test_torus_from_far_away():
    """The raw coefficients lose the root; those about the closest approach don't."""
    ring, origin, true = Torus(1, 0.25), (-1e4, 0.1, 0.05), 9998.7590737538
    raw = one(ring, "ferrari", origin, (1, 0, 0))
    assert not raw or abs(raw[0] - true) > 1e-4
    for name in ("companion", "sturm", "orellana"):
        assert one(ring, name, origin, (1, 0, 0))[0] == pytest.approx(true, abs=1e-9)


@kernel
def real_roots(coefficients, roots, count):
    """Ferrari's, Sturm's and Algorithm 1010's real roots of x⁴ + a x³ + b x² + c x + d."""
    a, b, c, d = coefficients
    put_ferrari(a, b, c, d, roots, count, 0)
    put_sturm(a, b, c, d, roots, count, 1)
    put_orellana(a, b, c, d, roots, count, 2)


@pytest.mark.parametrize(("coefficients", "true"), [
    ((-240, 25449, -1325880, 26471900.25), [50.6451126969, 69.3548873031]), ((2, 0, 0, -16), [-2.7605551382, 1.6383450268]),
    ((0, -5, 0, 4), [-2, -1, 1, 2]), ((-10, 35, -50, 24), [1, 2, 3, 4]), ((0, 0, 0, 1), []), ((0, 0, 0, -1), [-1, 1])])
def test_quartics(coefficients, true):
    for dtype, off in ((np.float64, 1e-5), (np.float32, 2e-2)):
        roots, count = np.full((3, 4), np.nan, dtype), np.zeros(3, np.int32)
        real_roots(np.array(coefficients, dtype), roots, count)
        for i, name in enumerate(("ferrari", "sturm", "orellana")):
            if dtype == np.float64 or abs(coefficients[-1]) < 100:      # in float32 all three lose the first one's roots
                assert sorted(roots[i, :count[i]]) == pytest.approx(true, abs=off), (name, dtype)
            if dtype == np.float64 and name != "ferrari":
                assert sorted(roots[i, :count[i]]) == pytest.approx(true, abs=1e-9), name


def test_the_renderer_imports_no_solver():
    root = Path(rtcore.__file__).parent
    for path in root.rglob("*.py"):
        if path.parent.name not in ("solvers", "reports"):
            tree = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            assert not [node for node in tree if isinstance(node, (ast.Import, ast.ImportFrom)) and "solvers" in ast.unparse(node)], path
