"""The interpreter of formulas at a single point in double-double, with a bound on the error: where the intervals of `_tape` can't tell the
value's sign. It has no derivatives, and knows nothing where an operation may be undefined or jump.
"""
import numpy as np

from rtcore.jit import inline, inline_new, kernel, out_of_line
from rtcore.pairs import add, divide, multiply, square_root, two_product
from rtcore.shapes._elementary import CLOSE, angle, exponential, logarithm, sine_cosine
from rtcore.shapes._formula import (ABS, ADD, ADD_C, ATAN2, C_DIVIDE, C_SUB, CONSTANT, COSINE, DIVIDE, DIVIDE_C, EXP, FLOOR, LOG, MAX, MIN,
                                    MOST_STEPS, MULTIPLY, MULTIPLY_C, NEGATE, POWER, REAL_POWER, ROOT, SINE, SMOOTH_MIN, SQUARE, SUB,
                                    TANGENT, A, B, C, OP, X, Z)

ROUNDING = 2.0 ** -100      # of an operation on pairs, relative to its result: ten times what it may be off
LEAST = 1e-300              # of products: beside what underflows
HIGH, REST, OFF = range(3)  # columns of a row: the pair, and what it may be off


@inline_new
def new_rows():
    """What `value_of` works on."""
    return np.empty((MOST_STEPS, 3))


@inline
def plus(a, b):
    """Sum of two bounded pairs, (high, rest, off) each; and so on."""
    s, s1 = add(a[0], a[1], b[0], b[1])
    return s, s1, a[2] + b[2] + ROUNDING * abs(s)


@inline
def minus(a):
    return -a[0], -a[1], a[2]


@inline
def product(a, b):
    p, p1 = multiply(a[0], a[1], b[0], b[1])
    return p, p1, abs(a[0]) * b[2] + abs(b[0]) * a[2] + a[2] * b[2] + ROUNDING * (abs(p) + LEAST)


@inline
def quotient(a, b):
    p, p1 = divide(a[0], a[1], b[0], b[1])
    room = abs(b[0]) * (1 - 2.0 ** -50) - b[2]
    return p, p1, (a[2] + abs(p) * b[2]) / room + ROUNDING * (abs(p) + LEAST) if room > 0 else np.inf


@inline
def number(c):
    return c, 0.0, 0.0


@inline
def raised(a, n):
    """A bounded pair to the power n, a positive integer."""
    result, bit = number(1.0), int(n)
    while bit > 0:
        if bit & 1:
            result = product(result, a)
        a = product(a, a)
        bit >>= 1
    return result


@inline
def rooted(a):
    """Square root; of what may be below 0, nothing is known."""
    if not a[0] >= a[2]:
        return 0.0, 0.0, np.inf
    r, r1 = square_root(a[0], a[1])
    return r, r1, a[2] / r + ROUNDING * r if r > 0 else np.sqrt(a[2])


@inline
def grown(a):
    """The exponential."""
    r, r1 = exponential(a[0], a[1])
    return r, r1, r * (CLOSE + 2 * a[2]) if a[2] < 0.5 else np.inf


@inline
def logged(a):
    r, r1 = logarithm(a[0], a[1])
    return r, r1, a[2] / (a[0] - a[2]) * (1 + 2.0 ** -50) + CLOSE * (1 + abs(r)) if a[0] > a[2] else np.inf


@inline
def floored(a):
    """The greatest integer not above; unknown where it may be another one."""
    whole = np.floor(a[0])
    if whole == a[0] and a[1] < 0:
        whole -= 1
    room = min((a[0] - whole) + a[1], (whole + 1 - a[0]) - a[1])
    return whole, 0.0, 0.0 if room > a[2] or (room == 0 and a[2] == 0) else np.inf


@inline
def lesser(a, b):
    """The smaller one."""
    gap = (a[0] - b[0]) + (a[1] - b[1])
    off = max(a[2], b[2]) + ROUNDING * abs(a[0])
    return (a[0], a[1], off) if gap < 0 else (b[0], b[1], off)


@inline
def smooth_lesser(a, b, c):
    """smin of width c."""
    low = lesser(a, b)
    gap = plus(a, minus(b))
    if gap[0] > 0:
        gap = minus(gap)
    near = plus(number(c), gap)
    if near[0] < 0:
        near = 0.0, 0.0, near[2]
    return plus(low, minus(quotient(product(near, near), number(4 * c))))


@inline
def turned(y, x):
    """atan2; near the cut and the origin it is not known."""
    r, r1 = angle(y[0], y[1], x[0], x[1])
    length = max(abs(x[0]), abs(y[0]))
    off = x[2] + y[2]
    safe = length > 4 * off and (x[0] > x[2] or abs(y[0]) > y[2])
    return r, r1, 2 * off / length + CLOSE if safe else np.inf


@kernel
def value_of(code, rows, point):
    """The value of the tape `code` (n, 4) at a point, and a bound on its error, inf where nothing is known. rows: as `new_rows` makes them;
    point: (3, 3), the axes' bounded pairs, a row each."""
    out_of_line()
    n = code.shape[0]
    for r in range(n):
        op, i, j, c = int(code[r, OP]), int(code[r, A]), int(code[r, B]), code[r, C]
        if op == COSINE:
            continue        # the sine before it has filled the row
        a = b = result = number(c)
        if i >= 0:
            a = rows[i, HIGH], rows[i, REST], rows[i, OFF]
        if j >= 0:
            b = rows[j, HIGH], rows[j, REST], rows[j, OFF]
        if op == CONSTANT:
            result = b
        elif op <= Z:
            result = point[op - X, HIGH], point[op - X, REST], point[op - X, OFF]
        elif op in (ADD, ADD_C):
            result = plus(a, b)
        elif op == SUB:
            result = plus(a, minus(b))
        elif op == C_SUB:
            result = plus(b, minus(a))
        elif op == NEGATE:
            result = minus(a)
        elif op in (MULTIPLY, MULTIPLY_C):
            result = product(a, b)
        elif op in (DIVIDE, DIVIDE_C):
            result = quotient(a, b)
        elif op == C_DIVIDE:
            result = quotient(b, a)
        elif op == SQUARE:
            result = product(a, a)
        elif op == POWER:
            result = raised(a, c)
        elif op == REAL_POWER:
            result = grown(product(logged(a), b))
        elif op == ROOT:
            result = rooted(a)
        elif op == EXP:
            result = grown(a)
        elif op == LOG:
            result = logged(a)
        elif op in (SINE, TANGENT):
            s, s1, d, d1 = sine_cosine(a[0], a[1])
            off = a[2] + CLOSE
            result = s, s1, off
            if op == SINE:
                rows[r + 1, HIGH], rows[r + 1, REST], rows[r + 1, OFF] = d, d1, off
            else:
                result = quotient(result, (d, d1, off))
        elif op == ABS:
            result = minus(a) if a[0] < 0 else a
        elif op == MIN:
            result = lesser(a, b)
        elif op == MAX:
            result = minus(lesser(minus(a), minus(b)))
        elif op == SMOOTH_MIN:
            result = smooth_lesser(a, b, c)
        elif op == ATAN2:
            result = turned(a, b)
        elif op == FLOOR:
            result = floored(a)
        else:           # MOD
            result = plus(a, minus(product(b, floored(quotient(a, b)))))
        rows[r, HIGH], rows[r, REST], rows[r, OFF] = result
    value, off = rows[n - 1, HIGH], rows[n - 1, OFF]
    return (value, off) if abs(value) + off < np.inf else (0.0, np.inf)


@inline
def told(value, off):
    """A value, as near to 0 as it may be; 0 if its sign is not known."""
    return value - off if value > off else value + off if value < -off else 0.0


@inline
def put_along(point, axis, base, base1, way, way1, s, drift):
    """The axis's part of a point at s of the line base + s way, numbers in pairs; `drift` is what that may be off beside its roundings."""
    p, p1 = two_product(s, way)
    x, x1 = add(base, base1, p, p1 + s * way1)
    point[axis, HIGH], point[axis, REST] = x, x1
    point[axis, OFF] = ROUNDING * (abs(base) + abs(p)) + drift
