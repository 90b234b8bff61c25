"""Formulas along a line, worked out independently of the kernels: read by Python's own parser, and in 50 digits.

Where a formula is a polynomial, it is multiplied out along the line and all its roots are found. Any other is sampled densely; sign
changes are closed in on, and where the samples come near 0 without one, a root of the derivative is looked for.
"""
import ast
import functools
import math
import operator
import warnings

import numpy as np

SAMPLES = 2048
OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv, ast.Pow: operator.pow,
             ast.USub: operator.neg, ast.UAdd: operator.pos}


class Polynomial:
    """In t, lowest power first; arithmetic with another or with a number, TypeError where the result is none."""

    def __init__(self, coefficients):
        self.coefficients = list(coefficients)

    def __add__(self, other):
        if not isinstance(other, Polynomial):
            other = Polynomial([other])
        a, b = sorted((self.coefficients, other.coefficients), key=len)
        return Polynomial([x + y for x, y in zip(a, b)] + b[len(a):])

    def __mul__(self, other):
        if not isinstance(other, Polynomial):
            return Polynomial([x * other for x in self.coefficients])
        result = [0 * self.coefficients[0]] * (len(self.coefficients) + len(other.coefficients) - 1)
        for i, x in enumerate(self.coefficients):
            for j, y in enumerate(other.coefficients):
                result[i + j] += x * y
        return Polynomial(result)

    def __neg__(self):
        return self * -1

    def __pos__(self):
        return self

    def __sub__(self, other):
        return self + (-other)

    def __rsub__(self, other):
        return -self + other

    def __truediv__(self, other):
        if isinstance(other, Polynomial):
            raise TypeError
        return Polynomial([x / other for x in self.coefficients])

    def __pow__(self, power):
        if isinstance(power, Polynomial) or int(power) != power or power < 1:
            raise TypeError
        return functools.reduce(operator.mul, [self] * int(power))

    __radd__, __rmul__ = __add__, __mul__


@functools.lru_cache(maxsize=64)
def tree(text: str) -> ast.expr:
    """The formula as Python reads it."""
    return ast.parse(text.strip().replace("^", "**").replace("\n", " "), mode="eval").body


def value(node: ast.expr, names: dict, number=float):
    """An expression's value, with the meaning of its names given and its constants made by `number`."""
    if isinstance(node, ast.Constant):
        return number(float(node.value))
    if isinstance(node, ast.Name):
        return names[node.id]
    if isinstance(node, ast.Call):
        return names[node.func.id](*(value(argument, names, number) for argument in node.args))
    if isinstance(node, ast.UnaryOp):
        return OPERATORS[type(node.op)](value(node.operand, names, number))
    return OPERATORS[type(node.op)](value(node.left, names, number), value(node.right, names, number))


def smooth(least, most, magnitude):
    """smin in some arithmetic."""
    return lambda a, b, k: least(a, b) - most(k - magnitude(a - b), 0) ** 2 / (4 * k)


FAST = {"pi": math.pi, "sin": np.sin, "cos": np.cos, "tan": np.tan, "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "abs": np.abs,
        "min": np.minimum, "max": np.maximum, "atan2": np.arctan2, "floor": np.floor, "mod": np.mod,
        "smin": smooth(np.minimum, np.maximum, np.abs)}


def precise(mp) -> dict:
    """Meanings of the names in an mpmath context; outside their domain functions are NaN."""
    def real(function):
        return lambda x: function(x) if x >= 0 else mp.nan
    return {"pi": mp.mpf(math.pi), "sin": mp.sin, "cos": mp.cos, "tan": mp.tan, "exp": mp.exp, "abs": abs, "min": min, "max": max,
            "log": lambda x: mp.log(x) if x > 0 else mp.nan, "sqrt": real(mp.sqrt), "atan2": mp.atan2, "floor": mp.floor,
            "mod": lambda a, b: a - b * mp.floor(a / b), "smin": smooth(min, max, abs)}


def within(shape, o, d):
    """The stretch of the line o + t d inside the shape's box, or None."""
    low, high = None, None
    for k in range(3):
        if d[k] == 0:
            if not shape.low[k] <= o[k] <= shape.high[k]:
                return None
            continue
        a, b = sorted(((shape.low[k] - o[k]) / d[k], (shape.high[k] - o[k]) / d[k]))
        low, high = a if low is None else max(low, a), b if high is None else min(high, b)
    return (low, high) if low <= high else None


def crossings(mp, shape, o, d):
    """(t, normal of any length) of every crossing of the line o + t d with a shape `Implicit`; a touching one twice."""
    stretch = within(shape, o, d)
    if stretch is None:
        return
    node, names = tree(shape.expression), precise(mp)

    def at(t):
        try:
            return value(node, names | dict(zip("xyz", (o[k] + t * d[k] for k in range(3)))), mp.mpf)
        except ZeroDivisionError:
            return mp.nan

    for t in roots(mp, node, at, o, d, *stretch):
        point = [o[k] + t * d[k] for k in range(3)]

        def along(s, k, point=point):
            return value(node, names | dict(zip("xyz", (p + s if j == k else p for j, p in enumerate(point)))), mp.mpf)
        yield t, tuple(mp.diff(lambda s, k=k: along(s, k), 0, h=mp.mpf(10) ** -20) for k in range(3))


def roots(mp, node, at, o, d, low, high) -> list:
    """Every root between low and high, ascending, those that only touch twice."""
    middle, half = (low + high) / 2, (high - low) / 2      # on the stretch -1 .. 1, where the roots are of the size of 1
    names = {name: Polynomial([o[k] + middle * d[k], half * d[k]]) for k, name in enumerate("xyz")}
    try:
        whole = value(node, names | {"pi": mp.mpf(math.pi)}, mp.mpf)
    except (KeyError, TypeError):
        return list(sampled(mp, node, at, o, d, low, high))
    most = max(map(abs, whole.coefficients))
    while whole.coefficients and abs(whole.coefficients[-1]) <= most * mp.mpf(10) ** -45:
        whole.coefficients.pop()
    if len(whole.coefficients) < 2:
        return []
    with warnings.catch_warnings():     # newer releases of mpmath want the order of coefficients said, older ones don't know the word
        warnings.simplefilter("ignore", DeprecationWarning)
        found = mp.polyroots([c / most for c in whole.coefficients[::-1]], maxsteps=500, extraprec=400, error=False)
    real = [mp.re(root) for root in found if abs(mp.im(root)) <= mp.mpf(10) ** -18]
    return sorted(middle + half * root for root in real if abs(root) <= 1)


def sampled(mp, node, at, o, d, low, high):
    """The roots of a formula that is no polynomial, as far as samples show them."""
    t = np.linspace(0, 1, SAMPLES + 1)
    start, step = [float(o[k] + low * d[k]) for k in range(3)], [float((high - low) * d[k]) for k in range(3)]
    with np.errstate(all="ignore"):
        f = value(node, FAST | dict(zip("xyz", (start[k] + t * step[k] for k in range(3)))))
    width = (high - low) / SAMPLES
    size = np.nanmax(np.abs(f), initial=0.0, where=np.isfinite(f))
    for i in np.flatnonzero(np.abs(f) < 1e-9 * size).tolist():     # whose sign float64 may not know
        f[i] = at(low + i * width)
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero((f[:-1] * f[1:] <= 0) | (np.abs(f[:-1]) < 1e-3 * size))

    def crossing(a, b):
        t0, t1 = closed_in(mp, at, a, b)
        if t0 is not None and abs(at((t0 + t1) / 2)) <= mp.mpf(10) ** -20 * size:
            yield (t0 + t1) / 2

    for i in near.tolist():
        a, b = low + i * width, low + (i + 1) * width
        if f[i] * f[i + 1] < 0 or f[i] == 0 and i > 0 and f[i - 1] * f[i + 1] < 0:
            yield from crossing(a if f[i] else a - width, b)
        elif i > 0 and abs(f[i]) < 1e-3 * size and abs(f[i - 1]) >= abs(f[i]) <= abs(f[i + 1]):
            t0, t1 = closed_in(mp, lambda t: mp.diff(at, t, h=mp.mpf(10) ** -22), a - width, b)
            if t0 is not None:      # it touches, passes by, or dips in and out between two samples
                turn = (t0 + t1) / 2
                deep = at(turn)
                if abs(deep) <= mp.mpf(10) ** -30 * size:
                    yield from [turn] * 2
                elif deep * f[i] < 0 and f[i - 1] * f[i] > 0:
                    yield from crossing(a - width, turn)
                    yield from crossing(turn, b)


def closed_in(mp, function, low, high):
    """Ends of a stretch, if it can be of no length, in which the function changes its sign: by the secant of the ends (the Illinois
    method), every fourth step by halving. None, None if the sign does not change to begin with."""
    a, b = function(low), function(high)
    if not a * b < 0:
        return None, None
    tiny = max(abs(a), abs(b)) * mp.mpf(10) ** -42
    for i in range(200):
        t = (low + high) / 2 if i % 4 == 3 else (low * b - high * a) / (b - a)
        f = function(t)
        if not mp.isfinite(f):
            return None, None
        if abs(f) <= tiny:
            return t, t
        if (f > 0) == (a > 0):
            low, a, b = t, f, b / 2
        else:
            high, b, a = t, f, a / 2
    return low, high
