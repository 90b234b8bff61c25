"""The interpreter of formulas: a tape (see `_formula`) over eight intervals at a time, with the derivative along eight directions.

Each operation is looked up once for eight lanes, so a formula that has just been typed runs at nearly the speed of a compiled one. Row r
of the tape owns rows 4r .. 4r+3 of the registers: low and high of the value, low and high of the derivative. A point is an interval
without width; what comes out is then its value with a bound on all rounding.
"""
import numpy as np

from rtcore.jit import inline_new, kernel
from rtcore.lanes import greatest, least, load, root, select, size, store
from rtcore.shapes._formula import (ABS, ADD, ADD_C, C_DIVIDE, C_SUB, CONSTANT, COSINE, DIVIDE, DIVIDE_C, EXP, FLOOR, LOG, MAX, MIN,
                                    MOST_STEPS, MULTIPLY, MULTIPLY_C, NEGATE, POWER, REAL_POWER, ROOT, SINE, SMOOTH_MIN, SQUARE, SUB,
                                    TANGENT, A, B, C, OP, X, Z)
from rtcore.shapes._intervals import (FEW, ULP, add, angle, divide, down, exponential, further_down, further_up, logarithm, magnitude,
                                      multiply, raised, real_power, sine_cosine_range, square, subtract, tangent, times, times_between,
                                      up, whole)

LOW, HIGH, D_LOW, D_HIGH = range(4)
#: Rows of `at`: what goes in (x, y, z each low and high, the directions' parts) and what comes out.
INPUT, DIRECTION, VALUE, SLOPE, GONE, ROUGH, AT_ROWS = 0, 6, 9, 11, 13, 14, 15


@inline_new
def new_registers():
    """What `run` works on; the last two rows are spare."""
    return np.empty((4 * MOST_STEPS + 2, 8))


@kernel
def run(code, reg, at, slopes):
    """Evaluate the tape `code` (n, 4) over the eight intervals in `at`; with `slopes`, the derivative along its directions as well.

    Rows of `at` (AT_ROWS, 8): from INPUT the ends of x, y and z, from DIRECTION the derivatives of x, y and z. Written are the ends of
    VALUE and SLOPE, GONE (1 where the formula has no value anywhere in the interval) and ROUGH (1 where it may be undefined, infinite or
    may jump somewhere in it, so that neither signs at the ends nor the slope tell of roots).
    """
    n, spare = code.shape[0], reg[4 * MOST_STEPS:]
    gone = load(at, INPUT, 0) == np.inf     # nowhere
    rough = gone
    for r in range(n):
        op, i, j, c, o = int(code[r, OP]), 4 * int(code[r, A]), 4 * int(code[r, B]), code[r, C], 4 * r
        if op <= Z:
            if op == CONSTANT:
                low = 0 * load(at, DIRECTION, 0) + c
                high, d, d1 = low, 0 * low, 0 * low
            else:
                low, high = load(at, INPUT + 2 * (op - X), 0), load(at, INPUT + 2 * (op - X) + 1, 0)
                d = load(at, DIRECTION + op - X, 0)
                d1 = d
            store(reg, o, 0, low)
            store(reg, o + 1, 0, high)
            store(reg, o + 2, 0, d)
            store(reg, o + 3, 0, d1)
            continue
        if op == COSINE:
            continue
        a, a1 = load(reg, i, 0), load(reg, i + 1, 0)
        da, da1 = load(reg, i + 2, 0), load(reg, i + 3, 0)
        low, high, d, d1 = a, a1, da, da1
        if j >= 0:
            b, b1 = load(reg, j, 0), load(reg, j + 1, 0)
            db, db1 = load(reg, j + 2, 0), load(reg, j + 3, 0)
            if op == ADD:
                low, high = add(a, a1, b, b1)
                if slopes:
                    d, d1 = add(da, da1, db, db1)
            elif op == SUB:
                low, high = subtract(a, a1, b, b1)
                if slopes:
                    d, d1 = subtract(da, da1, db, db1)
            elif op == MULTIPLY:
                low, high = multiply(a, a1, b, b1)
                if slopes:
                    d, d1 = multiply(da, da1, b, b1)
                    d2, d3 = multiply(a, a1, db, db1)
                    d, d1 = add(d, d1, d2, d3)
            elif op == DIVIDE:
                low, high, pole = divide(a, a1, b, b1)
                rough = rough | pole
                if slopes:
                    d, d1 = multiply(low, high, db, db1)
                    d, d1 = subtract(da, da1, d, d1)
                    d, d1, pole = divide(d, d1, b, b1)
            elif op == MIN:
                low, high = least(a, b), least(a1, b1)
                d, d1 = select(a1 < b, da, select(b1 < a, db, least(da, db))), select(a1 < b, da1, select(b1 < a, db1, greatest(da1, db1)))
            elif op == MAX:
                low, high = greatest(a, b), greatest(a1, b1)
                d, d1 = select(a > b1, da, select(b > a1, db, least(da, db))), select(a > b1, da1, select(b > a1, db1, greatest(da1, db1)))
            elif op == SMOOTH_MIN:
                # grows with a and with b
                gap, gap1 = subtract(b, b1, a, a1)
                p, q = greatest(c - size(a - b), 0), greatest(c - size(a1 - b1), 0)
                low, high = further_down(least(a, b) - p * p / (4 * c)), further_up(least(a1, b1) - q * q / (4 * c))
                low, high = low - 2.0 ** -50 * c, high + 2.0 ** -50 * c
                if slopes:
                    w = least(greatest(0.5 + gap / (2 * c) - FEW, 0), 1)
                    w1 = least(greatest(0.5 + gap1 / (2 * c) + FEW, 0), 1)
                    d, d1 = times_between(da, da1, w, w1, db, db1)
            else:       # ATAN2
                low, high, pole = angle(a, a1, b, b1, spare)
                rough = rough | pole
                if slopes:
                    p, p1 = multiply(b, b1, da, da1)
                    q, q1 = multiply(a, a1, db, db1)
                    d, d1 = subtract(p, p1, q, q1)
                    p, p1 = square(a, a1)
                    q, q1 = square(b, b1)
                    p, p1 = add(p, p1, q, q1)
                    d, d1, pole = divide(d, d1, p, p1)
        elif op == ADD_C:
            low, high = down(a + c), up(a1 + c)
        elif op == C_SUB:
            low, high, d, d1 = down(c - a1), up(c - a), -da1, -da
        elif op == NEGATE:
            low, high, d, d1 = -a1, -a, -da1, -da
        elif op == MULTIPLY_C:
            low, high = times(a, a1, c)
            d, d1 = times(da, da1, c)
        elif op == DIVIDE_C:
            low, high = down(least(a / c, a1 / c)), up(greatest(a / c, a1 / c))
            d, d1 = down(least(da / c, da1 / c)), up(greatest(da / c, da1 / c))
        elif op == C_DIVIDE:
            low, high, pole = divide(0 * a + c, 0 * a + c, a, a1)
            rough = rough | pole
            if slopes:
                d, d1 = multiply(low, high, -da1, -da)
                d, d1, pole = divide(d, d1, a, a1)
        elif op == SQUARE:
            low, high = square(a, a1)
            if slopes:
                d, d1 = multiply(2 * a, 2 * a1, da, da1)
        elif op == POWER:
            low, high = raised(a, a1, c)
            if slopes:
                d, d1 = raised(a, a1, c - 1)
                d, d1 = times(d, d1, c)
                d, d1 = multiply(d, d1, da, da1)
        elif op in (REAL_POWER, ROOT, LOG):
            gone = gone | (a1 < 0)
            rough = rough | (a < 0)
            if op == ROOT:
                low, high = greatest(down(root(greatest(a, 0))), 0), up(root(greatest(a1, 0)))
                if slopes:
                    d, d1, pole = divide(da, da1, 2 * low, 2 * high)
            elif op == LOG:
                rough = rough | (a <= 0)
                gone = gone | (a1 <= 0)
                low, high = logarithm(a, a1, spare)
                if slopes:
                    d, d1, pole = divide(da, da1, greatest(a, 0), a1)
            else:
                low, high = real_power(a, a1, c, spare)
                if c < 0:
                    rough = rough | (a <= 0)
                if slopes:
                    p, p1 = real_power(a, a1, c - 1, spare)
                    p, p1 = times(p, p1, c)
                    d, d1 = multiply(p, p1, da, da1)
        elif op == EXP:
            low, high = exponential(a, a1, spare)
            if slopes:
                d, d1 = multiply(low, high, da, da1)
        elif op == SINE:
            low, high, cosine, cosine1 = sine_cosine_range(a, a1)
            store(reg, o + 4, 0, cosine)
            store(reg, o + 5, 0, cosine1)
            if slopes:
                d, d1 = multiply(cosine, cosine1, da, da1)
                p, p1 = multiply(-high, -low, da, da1)
                store(reg, o + 6, 0, p)
                store(reg, o + 7, 0, p1)
        elif op == TANGENT:
            low, high, pole = tangent(a, a1, spare)
            rough = rough | pole
            if slopes:
                d, d1 = square(low, high)
                d, d1 = multiply(down(1 + d), up(1 + d1), da, da1)
        elif op == ABS:
            low, high = magnitude(a, a1)
            most = greatest(size(da), size(da1))
            d, d1 = select(a > 0, da, select(a1 < 0, -da1, -most)), select(a > 0, da1, select(a1 < 0, -da, most))
        elif op == FLOOR:
            low, high = whole(a), whole(a1)
            rough = rough | (low < high)
            d, d1 = 0 * da, 0 * da1
        else:           # MOD
            turn, turn1 = whole(down(least(a / c, a1 / c))), whole(up(greatest(a / c, a1 / c)))
            jumps = ~(turn == turn1)
            rough = rough | jumps
            low, high = select(jumps, min(c, 0.0), further_down(a - c * turn)), select(jumps, max(c, 0.0), further_up(a1 - c * turn))
            low, high = low - ULP * size(c * turn), high + ULP * size(c * turn)
        store(reg, o, 0, low)
        store(reg, o + 1, 0, high)
        store(reg, o + 2, 0, d)
        store(reg, o + 3, 0, d1)
    o = 4 * (n - 1)
    for k in range(4):
        store(at, VALUE + k, 0, load(reg, o + k, 0))
    zero = 0 * load(at, DIRECTION, 0)
    store(at, GONE, 0, select(gone, 1, zero))
    store(at, ROUGH, 0, select(rough, 1, zero))
