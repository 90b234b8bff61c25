"""Formulas: what is read and what is refused, and that intervals hold what they should."""
import ast
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcore import FieldError, Implicit
from rtcore.reports.formulas import precise, tree, value
from rtcore.reports.oracle import mp
from rtcore.shapes._formula import CONSTANT_FUNCTIONS, MOST_CHARACTERS, compiled
from rtcore.shapes._tape import AT_ROWS, DIRECTION, GONE, INPUT, ROUGH, SLOPE, VALUE, new_registers, run

def real(function):
    """A function that takes no value from outside a domain: `abs` would bring back a power's complex one, `min` lose a NaN."""
    def checked(*numbers):
        if any(isinstance(number, mp.mpc) or mp.isnan(number) for number in numbers):
            raise ValueError
        return function(*numbers)
    return checked


NAMES = {name: real(meaning) if callable(meaning) else meaning for name, meaning in precise(mp).items()}
REGISTERS = new_registers.py_func()


class Constants(ast.NodeTransformer):
    """Works out in float64 what no variable is in, as the formula's reader does: that is the number which the formula has."""

    def visit(self, node: ast.AST) -> ast.AST:
        if isinstance(node, ast.expr) and not any(isinstance(one, ast.Name) and one.id in "xyz" for one in ast.walk(node)):
            return ast.Constant(value(node, CONSTANT_FUNCTIONS | {"pi": math.pi}))
        if isinstance(node, ast.Call):
            return ast.Call(node.func, [self.visit(argument) for argument in node.args], [])
        return self.generic_visit(node)


def exact(text: str, point) -> object:
    """The value in 50 digits, read by Python's own parser; NaN outside the domain."""
    try:
        return value(Constants().visit(tree.__wrapped__(text)), NAMES | dict(zip("xyz", (mp.mpf(float(p)) for p in point))), mp.mpf)
    except (ZeroDivisionError, OverflowError, ValueError):
        return mp.nan


def enclosed(text: str, low, high, direction=(0, 0, 0)):
    """Value, slope (low and high each), whether it is nowhere defined, whether it may be rough: over a box, by the interpreter."""
    at = np.zeros((AT_ROWS, 8))
    for k in range(3):
        at[INPUT + 2 * k], at[INPUT + 2 * k + 1], at[DIRECTION + k] = low[k], high[k], direction[k]
    run(compiled(text), REGISTERS, at, True)
    assert (at == at[:, :1]).all()      # all lanes alike
    return at[VALUE:VALUE + 2, 0], at[SLOPE:SLOPE + 2, 0], bool(at[GONE, 0]), bool(at[ROUGH, 0])


numbers = st.sampled_from(["2", "0.5", "3", ".25", "1e-3", "7", "pi"])
terms = st.recursive(st.sampled_from("xyz") | numbers, lambda inner: st.one_of(
    st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
    st.tuples(st.sampled_from(["sin", "cos", "tan", "exp", "sqrt", "abs", "floor", "log"]), inner).map(lambda t: f"{t[0]}({t[1]})"),
    st.tuples(st.sampled_from(["min", "max", "atan2"]), inner, inner).map(lambda t: f"{t[0]}({t[1]}, {t[2]})"),
    st.tuples(inner, inner).map(lambda t: f"smin({t[0]}, {t[1]}, 0.4)"), inner.map(lambda t: f"mod({t}, 1.5)"),
    st.tuples(inner, st.sampled_from(["2", "3", "4", "-1", "1.5"])).map(lambda t: f"({t[0]})^{t[1]}"), inner.map(lambda t: f"-{t}")),
    max_leaves=6)


def formula(text: str):
    """Whether the text is one: constants may be folded to nothing, or to no number."""
    try:
        return len(compiled(text)) > 0
    except FieldError:
        return False


@settings(max_examples=300, deadline=None)
@given(text=terms.filter(formula), seed=st.integers(0, 2 ** 32 - 1), width=st.sampled_from([0, 1e-9, 0.1, 1.0]))
def test_intervals_hold_the_values_and_slopes(text, seed, width):
    rng = np.random.default_rng(seed)
    low = rng.uniform(-2, 2, 3)
    high, way = low + width * rng.random(3), rng.normal(size=3)
    (least, most), (flat, steep), gone, rough = enclosed(text, low, high, way)
    assert least <= most and (rough or flat <= steep)
    for share in rng.random((4, 3)):
        point = np.clip(low + share * (high - low), low, high)
        true = exact(text, point)
        if not mp.isfinite(true) or isinstance(true, mp.mpc):
            assert rough or gone or abs(true) == mp.inf
            continue
        assert not gone
        assert least <= true <= most, (text, point.tolist(), float(true), least, most)


POINTS = [(0.3, -0.7, 1.1), (1.7, 0.2, -0.4)]
SMOOTH = ["x^2*y - z", "sin(x)*cos(y) + tan(z/3)", "exp(-x^2) + y*z", "sqrt(x^2 + y^2 + 1)", "atan2(y, x) + z^3", "log(2 + x*y)/(3 + z)",
          "x^-2 - y", "(2 + x)^1.5", "smin(x, y, 0.7) - z", "mod(x, 5) + abs(y)", "min(x, y)*max(y, z)", "2^x - y^7", "x^y + z"]


@pytest.mark.parametrize("text", SMOOTH)
@pytest.mark.parametrize("point", POINTS)
def test_slopes_are_the_derivatives(text, point):
    way = np.array([0.6, -0.3, 0.8])
    _, (low, high), _, rough = enclosed(text, point, point, way)
    if rough:
        pytest.skip("not smooth here")

    def along(t):
        return value(tree(text), NAMES | {name: mp.mpf(p) + t * mp.mpf(float(w)) for name, p, w in zip("xyz", point, way)}, mp.mpf)

    true = mp.diff(along, 0)
    assert low - 1e-14 * abs(low) <= true <= high + 1e-14 * abs(high) and high - low < 1e-11 * (1 + abs(high))


@pytest.mark.parametrize("text,like", [
    ("-x^2", "-(x^2)"), ("x^2^0.5", "x^(2^0.5)"), ("2^-x", "2^(-x)"), ("x-y-z", "(x-y)-z"), ("x/y/z", "(x/y)/z"), ("+x", "x"), ("--x", "x"),
    ("2*x+3*y^2", "(2*x)+(3*(y^2))"), (" x\n+ y ", "x+y"), ("x*x", "x^2"), ("1e2*x", "100*x"), ("x*0 + y", "y")])
def test_precedence(text, like):
    assert compiled(text).tolist() == compiled(like).tolist()


def test_common_parts_are_shared():
    assert len(compiled("sin(x + y)*cos(x + y) + (y + x)^2")) == 8     # x, y, x + y, its sine and cosine, the product, the square, the sum


@pytest.mark.parametrize("text,message", [
    ("x + ", "expected a number, a name, ( or - at character 5, got nothing"),
    ("x + * y", "expected a number, a name, ( or - at character 5, got '*'"),
    ("(x + y", "expected ) at character 7, got nothing"),
    ("x y", "expected an operator (+ - * / ^) or the end at character 3, got 'y'"),
    ("2x", "expected an operator (+ - * / ^) or the end at character 2, got 'x'"),
    ("x & y", "expected a number, a name, or one of + - * / ^ ( ) , at character 3, got '&'"),
    ("sin x", "expected ( at character 5, got 'x'"),
    ("min(x)", "expected , at character 6, got ')'"),
    ("abs(x, y)", "expected ) at character 6, got ','"),
    ("smin(x, y, z)", "expected a constant greater than 0 as the width of smin at character 12, got 'z'"),
    ("x + 1/0", "expected a finite value of / at character 6, got '1, 0'"),
    ("x / (1 - 1)", "expected a divisor other than 0 at character 3, got 0.0"),
    ("x + 1e999", "expected a number that float64 can hold at character 5, got '1e999'"),
    ("2*pi", "expected a formula whose value depends on x, y or z, got '2*pi'"),
    ("x*0", "expected a formula whose value depends on x, y or z, got 'x*0'"),
    ("", "expected a number, a name, ( or - at character 1, got nothing"),
    ("__import__('os')", "expected a number, a name, or one of + - * / ^ ( ) , at character 12, got \"'\""),
])
def test_what_is_refused(text, message):
    with pytest.raises(FieldError) as caught:
        Implicit(text, (-1, -1, -1), (1, 1, 1))
    assert str(caught.value) == "expression: " + message


@pytest.mark.parametrize("text", ["x.real", "eval(x)", "x" * 70, "sin", "lambda", "é", "x²", "x;y", "x**2", "[x]", "x=1", "1_0*x"])
def test_nothing_else_is_a_formula(text):
    with pytest.raises(FieldError) as caught:
        Implicit(text, (-1, -1, -1), (1, 1, 1))
    assert "at character" in str(caught.value) and "\n" not in str(caught.value)


def test_length_size_and_depth_are_limited():
    for text, message in (("x" + " " * MOST_CHARACTERS, "characters"), ("(" * 70 + "x" + ")" * 70, "nested"), ("-" * 100 + "x", "nested"),
                          ("+".join(f"sin({i}*x)" for i in range(100)), "operations")):
        with pytest.raises(FieldError, match=message):
            Implicit(text, (-1, -1, -1), (1, 1, 1))


def test_the_box_must_have_a_volume():
    with pytest.raises(FieldError, match="high: expected three numbers each greater than those of low"):
        Implicit("x", (0, 0, 0), (1, 0, 1))
