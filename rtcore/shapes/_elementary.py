"""Elementary functions of double-doubles, for single numbers: Taylor series after a reduction of the argument, with room to spare.

Errors are bounded by CLOSE: of the exponential relative to its value, of the logarithm to 1 + its size, of sine, cosine and angle to 1.
Where an argument is outside the range named, the result is NaN.
"""
import math
from fractions import Fraction

import numpy as np

from rtcore.exact import parts
from rtcore.jit import kernel, out_of_line
from rtcore.pairs import add, divide, multiply, ordered_sum, scale, two_product

CLOSE = 2.0 ** -88
FARTHEST = 2.0 ** 20        # of a sine's argument
HALVINGS = 8                # of an exponential's


def _digits(text: str) -> tuple[float, ...]:
    """A decimal number in three parts."""
    return tuple(parts([Fraction(text)], 3))


LN2 = _digits("0.693147180559945309417232121458176568075500134360255254120680009493393621969694715605863")
QUARTER = _digits("1.570796326794896619231321691639751442098584699687552910487472296153908203143104499314017")
#: 1/k! from k = 0 on, as pairs.
TAYLOR = np.array(parts([Fraction(1, math.factorial(k)) for k in range(30)])).reshape(2, -1).T.copy()


@kernel
def exponential(x, x1):
    """e to the power of a pair; |x| < 700."""
    out_of_line()
    if not abs(x) < 700:
        return np.nan, 0.0
    n = np.rint(x / LN2[0])
    for part in LN2:
        p, p1 = two_product(n, -part)
        x, x1 = add(x, x1, p, p1)
    unit = 2.0 ** -HALVINGS
    x, x1 = x * unit, x1 * unit
    s, s1 = TAYLOR[10, 0], TAYLOR[10, 1]
    for k in range(9, 0, -1):
        s, s1 = multiply(s, s1, x, x1)
        s, s1 = add(s, s1, TAYLOR[k, 0], TAYLOR[k, 1])
    s, s1 = multiply(s, s1, x, x1)          # e^x - 1, and so on: no digits are lost in the doublings
    for _ in range(HALVINGS):
        p, p1 = add(s, s1, 2.0, 0.0)
        s, s1 = multiply(s, s1, p, p1)
    s, s1 = add(s, s1, 1.0, 0.0)
    return math.ldexp(s, int(n)), math.ldexp(s1, int(n))


@kernel
def logarithm(x, x1):
    """Natural logarithm of a pair within 1e-300 .. 1e300: one step of Newton's on the exponential."""
    out_of_line()
    if not 1e-300 < x < 1e300:
        return np.nan, 0.0
    y = np.log(x)
    e, e1 = exponential(-y, 0.0)
    e, e1 = multiply(e, e1, x, x1)
    e, e1 = add(e, e1, -1.0, 0.0)
    return add(y, 0.0, e, e1 - 0.5 * e * e)


@kernel
def sine_cosine(x, x1):
    """Sine and cosine of a pair, |x| <= FARTHEST, as four numbers."""
    out_of_line()
    if not abs(x) <= FARTHEST:
        return np.nan, 0.0, np.nan, 0.0
    n = np.rint(x / QUARTER[0])
    for part in QUARTER:
        p, p1 = two_product(n, -part)
        x, x1 = add(x, x1, p, p1)
    q, q1 = multiply(x, x1, x, x1)
    s, s1, c, c1 = TAYLOR[29, 0], TAYLOR[29, 1], TAYLOR[28, 0], TAYLOR[28, 1]
    for k in range(26, -1, -2):
        s, s1 = multiply(-s, -s1, q, q1)
        s, s1 = add(s, s1, TAYLOR[k + 1, 0], TAYLOR[k + 1, 1])
        c, c1 = multiply(-c, -c1, q, q1)
        c, c1 = add(c, c1, TAYLOR[k, 0], TAYLOR[k, 1])
    s, s1 = multiply(s, s1, x, x1)
    quadrant = int(n) % 4
    if quadrant % 2 == 1:
        s, s1, c, c1 = c, c1, -s, -s1
    if quadrant >= 2:
        s, s1, c, c1 = -s, -s1, -c, -c1
    return s, s1, c, c1


@kernel
def angle(y, y1, x, x1):
    """atan2 of two pairs: one step of Newton's on sine and cosine."""
    out_of_line()
    most = max(abs(x), abs(y))
    if not 1e-300 < most < 1e300:
        return np.nan, 0.0
    unit = math.ldexp(1.0, -math.frexp(most)[1])
    a = np.arctan2(y, x)
    s, s1, c, c1 = sine_cosine(a, 0.0)
    p, p1 = multiply(y * unit, y1 * unit, c, c1)
    q, q1 = multiply(x * unit, x1 * unit, s, s1)
    p, p1 = add(p, p1, -q, -q1)
    q, q1 = scale(y * unit, y1 * unit, s)
    e, e1 = scale(x * unit, x1 * unit, c)
    q, q1 = add(q, q1, e, e1)
    e, e1 = divide(p, p1, q, q1)
    e, e1 = ordered_sum(e, e1)
    return add(a, 0.0, e, e1)
