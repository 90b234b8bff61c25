"""Interval arithmetic on lanes: (low, high) pairs of F64, every result rounded outward by at least what its computation may be off.

No rounding modes are switched: a result is widened by an ulp or a few. An end may be infinite; what can't be told (inf - inf, 0·inf) is
the whole line. An interval encloses the values of a function wherever it is defined; that it may not be, or may jump, is told by masks
beside it (see `_tape`). A quotient or exponential that is not 0 keeps its sign even where it underflows.
"""
import math

import numpy as np

from rtcore.jit import inline
from rtcore.lanes import fma, greatest, least, load, select, size, store

ULP, FEW, TINY, BIGGEST = 2.0 ** -52, 2.0 ** -50, 5e-324, np.finfo(np.float64).max
WHOLE = 2.0 ** 52 * 1.5             # x + WHOLE - WHOLE is x rounded to an integer, |x| < 2^51
FARTHEST = 2.0 ** 20                # beyond it the sine of an interval is not told from -1 .. 1

#: π/2 in three parts, and the Taylor coefficients of sine and cosine, enough for |x| <= π/4.
QUARTER, QUARTER_1, QUARTER_2 = 1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33
S = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(9))
K = tuple((-1) ** k / math.factorial(2 * k) for k in range(10))


@inline
def down(x):
    """Below x by an ulp at least; NaN becomes -inf."""
    x = least(BIGGEST, x)
    return greatest(x - fma(size(x), ULP, TINY), -np.inf)


@inline
def up(x):
    """Above x by an ulp at least; NaN becomes inf."""
    x = greatest(-BIGGEST, x)
    return least(x + fma(size(x), ULP, TINY), np.inf)


@inline
def further_down(x):
    """Below x by four ulps at least: what the mathematical library may be off."""
    x = least(BIGGEST, x)
    return greatest(x - fma(size(x), FEW, TINY), -np.inf)


@inline
def further_up(x):
    """Above x by four ulps at least."""
    x = greatest(-BIGGEST, x)
    return least(x + fma(size(x), FEW, TINY), np.inf)


@inline
def add(a, a1, b, b1):
    return down(a + b), up(a1 + b1)


@inline
def subtract(a, a1, b, b1):
    return down(a - b1), up(a1 - b)


@inline
def _hull4(p, q, r, s):
    known = (p + q) + (r + s)       # NaN if any is, or where there are both infinities
    known = known == known
    return (select(known, least(least(p, q), least(r, s)), -np.inf), select(known, greatest(greatest(p, q), greatest(r, s)), np.inf))


@inline
def multiply(a, a1, b, b1):
    low, high = _hull4(a * b, a * b1, a1 * b, a1 * b1)
    return down(low), up(high)


@inline
def times(a, a1, c):
    """An interval times a number other than 0."""
    p, q = a * c, a1 * c
    return down(least(p, q)), up(greatest(p, q))


@inline
def square(a, a1):
    low, high = magnitude(a, a1)
    return greatest(down(low * low), 0), up(high * high)


@inline
def magnitude(a, a1):
    """|a|, exactly."""
    low = select(a > 0, a, select(a1 < 0, -a1, 0))
    return greatest(low, 0), greatest(size(a), size(a1))


@inline
def divide(a, a1, b, b1):
    """Quotient, the whole line where the divisor may be 0; and the mask of where."""
    pole = (b <= 0) & (b1 >= 0)
    flip = b1 < 0
    a, a1 = select(flip, -a1, a), select(flip, -a, a1)
    b, b1 = select(flip, -b1, b), select(flip, -b, b1)
    low, high = down(a / select(a < 0, b, b1)), up(a1 / select(a1 < 0, b1, b))
    low, high = select(a > 0, greatest(low, TINY), low), select(a1 < 0, least(high, -TINY), high)
    return select(pole, -np.inf, low), select(pole, np.inf, high), pole


@inline
def times_between(a, a1, w, w1, b, b1):
    """Hull of w a + (1 - w) b over weights w .. w1 within 0 .. 1."""
    low = least(w * a + (1 - w) * b, w1 * a + (1 - w1) * b)
    high = greatest(w * a1 + (1 - w) * b1, w1 * a1 + (1 - w1) * b1)
    return further_down(low), further_up(high)


@inline
def whole(x):
    """The greatest integer that is not above x."""
    r = (x + WHOLE) - WHOLE
    return select(size(x) < 2.0 ** 51, select(r > x, r - 1, r), x)


@inline
def power(x, n):
    """x to the power n, a positive integer: off by 2 n ulps at most."""
    result, bit = 0 * x + 1, int(n)
    while bit > 0:
        if bit & 1:
            result = result * x
        x = x * x
        bit >>= 1
    return result


@inline
def raised(a, a1, n):
    """An interval to the power n, a positive integer."""
    slack = n * 2.0 ** -51
    even = int(n) % 2 == 0
    low, high = magnitude(a, a1) if even else (a, a1)
    low, high = power(low, n), power(high, n)
    low, high = low - size(low) * slack, high + size(high) * slack
    return (greatest(down(low), 0) if even else down(low)), up(high)


@inline
def sine_cosine(x):
    """Sine and cosine to an ulp or so, |x| <= FARTHEST: reduction by π/2 in three parts (Cody and Waite), then Taylor."""
    n = (x * (2 / math.pi) + WHOLE) - WHOLE
    r = fma(-n, QUARTER_2, fma(-n, QUARTER_1, fma(-n, QUARTER, x)))
    q = r * r
    s = fma(q, fma(q, fma(q, fma(q, fma(q, fma(q, fma(q, S[8], S[7]), S[6]), S[5]), S[4]), S[3]), S[2]), S[1])
    s = fma(r * q, s, r)
    c = fma(q, fma(q, fma(q, fma(q, fma(q, fma(q, fma(q, fma(q, K[9], K[8]), K[7]), K[6]), K[5]), K[4]), K[3]), K[2]), K[1])
    c = fma(q, c, 1)
    quadrant = n - 4 * whole(0.25 * n)
    odd = (quadrant == 1) | (quadrant == 3)
    sine, cosine = select(odd, c, s), select(odd, s, c)
    return select(quadrant >= 2, -sine, sine), select((quadrant == 1) | (quadrant == 2), -cosine, cosine)


@inline
def _range(at_low, at_high, turns, turns1, top):
    """Range of a wave of period 1 turn between values at two ends, its tops where turns - top is an integer. A top or bottom in doubt, and
    everything where the ends are far out or infinite, counts as within."""
    slack = 2.0 ** -50 * (1 + size(turns) + size(turns1))
    a, b = turns - top - slack, turns1 - top + slack
    tops, bottoms = whole(b) > whole(a), whole(b - 0.5) > whole(a - 0.5)
    near = greatest(size(turns), size(turns1)) < FARTHEST / 8
    low, high = further_down(least(at_low, at_high)), further_up(greatest(at_low, at_high))
    return (select(near, select(bottoms, -1, greatest(low, -1)), -1), select(near, select(tops, 1, least(high, 1)), 1))


@inline
def sine_cosine_range(a, a1):
    """Ranges of the sine and of the cosine."""
    s, c = sine_cosine(a)
    s1, c1 = sine_cosine(a1)
    turns, turns1 = a * (0.5 / math.pi), a1 * (0.5 / math.pi)
    low, high = _range(s, s1, turns, turns1, 0.25)
    low1, high1 = _range(c, c1, turns, turns1, 0.0)
    return low, high, low1, high1


# --- one lane after the other, by the mathematical library ---

@inline
def exponential(a, a1, spare):
    """e to the power of an interval; spare: float64 (2, 8), to work on."""
    store(spare, 0, 0, a)
    store(spare, 1, 0, a1)
    for k in range(8):
        spare[0, k], spare[1, k] = np.exp(spare[0, k]), np.exp(spare[1, k])
    return greatest(further_down(load(spare, 0, 0)), TINY), further_up(load(spare, 1, 0))


@inline
def logarithm(a, a1, spare):
    """Natural logarithm of what of an interval is above 0."""
    store(spare, 0, 0, a)
    store(spare, 1, 0, a1)
    for k in range(8):
        spare[0, k] = np.log(spare[0, k]) if spare[0, k] > 0 else -np.inf
        spare[1, k] = np.log(spare[1, k]) if spare[1, k] > 0 else np.inf
    return further_down(load(spare, 0, 0)), further_up(load(spare, 1, 0))


@inline
def real_power(a, a1, c, spare):
    """x^c over what of an interval is above 0."""
    store(spare, 0, 0, a)
    store(spare, 1, 0, a1)
    for k in range(8):
        x, y = max(spare[0, k], 0.0) ** c, max(spare[1, k], 0.0) ** c
        spare[0, k], spare[1, k] = (x, y) if c > 0 else (y, x)
    return greatest(further_down(load(spare, 0, 0)), 0), further_up(load(spare, 1, 0))


@inline
def tangent(a, a1, spare):
    """Tangent; the whole line where there may be a pole, and the mask of where."""
    turns, turns1 = a * (1 / math.pi), a1 * (1 / math.pi)
    slack = 2.0 ** -50 * (1 + size(turns) + size(turns1))
    smooth = (whole(turns - 0.5 - slack) == whole(turns1 - 0.5 + slack)) & (size(turns) < FARTHEST) & (size(turns1) < FARTHEST)
    store(spare, 0, 0, select(smooth, a, 0))
    store(spare, 1, 0, select(smooth, a1, 0))
    for k in range(8):
        spare[0, k], spare[1, k] = np.tan(spare[0, k]), np.tan(spare[1, k])
    return (select(smooth, further_down(load(spare, 0, 0)), -np.inf), select(smooth, further_up(load(spare, 1, 0)), np.inf),
            ~smooth)


@inline
def angle(y, y1, x, x1, spare):
    """atan2 of two intervals; -π .. π where they meet the cut x <= 0, y = 0, and the mask of where."""
    cut = (y <= 0) & (y1 >= 0) & (x <= 0)
    low, high = 0 * x + np.inf, 0 * x - np.inf
    for corner in range(4):
        store(spare, 0, 0, y if corner < 2 else y1)
        store(spare, 1, 0, x if corner % 2 == 0 else x1)
        for k in range(8):
            spare[0, k] = np.arctan2(spare[0, k], spare[1, k])
        at = load(spare, 0, 0)
        low, high = least(low, at), greatest(high, at)
    return select(cut, -math.pi * (1 + ULP), further_down(low)), select(cut, math.pi * (1 + ULP), further_up(high)), cut
