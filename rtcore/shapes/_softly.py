"""One ray against a blob in double-double: the certain way out of `_blob.py`.

The ray is brought to the unit space in some hundred digits; about its closest approach to the middle each element's w is a quadratic in
pairs, and each stretch between the ends of their spans has a quartic in a variable that runs from -1 to 1. Where pairs can't tell the sign
of the field at a turning point it is summed in some hundred digits; less than TOUCH of the size of its terms is a touch.
"""
import math

import numpy as np

from rtcore.expansions import LONG, expand, put_products
from rtcore.jit import inline, inline_new, kernel, out_of_line
from rtcore.pairs import add, divide, multiply, scale, square, square_root, two_product, two_sum
from rtcore.shapes._blob import RADIUS, REST, ROUGH, STRENGTH
from rtcore.shapes._separate import between, stationary_of, value_at
from rtcore.shapes._unit import line_expanded
from rtcore.shapes.kind import BACK, FRONT
from rtcore.wave import SLOW, START, record_one

TOUCH = 2.0 ** -128     # turning points of turning points are good to 2^-33, their values to the fourth power of that
DIM = 2.0 ** -94        # more than a sum of pairs may be off, as a share of the size of its terms
LOW, LOW1, HIGH, HIGH1 = 6, 7, 8, 9     # of a span, after three coefficients: where it begins and ends


@inline_new
def closest(f, v, n):
    """The point of the line f + s v nearest to the origin, as expansions in n, and its s as a pair."""
    terms = np.empty(3 * LONG * LONG)
    speed2 = v[0, 0] * v[0, 0] + v[1, 0] * v[1, 0] + v[2, 0] * v[2, 0]
    s, s1 = 0.0, 0.0
    n[:, :] = f
    for _ in range(2):      # the closest approach once more: what the first step's rounding left
        step = -(n[0, 0] * v[0, 0] + n[1, 0] * v[1, 0] + n[2, 0] * v[2, 0]) / speed2
        s, s1 = add(s, s1, step, 0.0)
        for k in range(3):
            terms[:LONG] = f[k]
            expand(terms, put_products(terms, LONG, 1.0, v[k], (s, s1)), n[k])
    return s, s1


@inline
def dot_pairs(a, b):
    """The scalar product of two vectors of pairs (3, ..)."""
    x, x1 = multiply(a[0, 0], a[0, 1], b[0, 0], b[0, 1])
    for k in range(1, 3):
        y, y1 = multiply(a[k, 0], a[k, 1], b[k, 0], b[k, 1])
        x, x1 = add(x, x1, y, y1)
    return x, x1


@kernel
def spans_of(n, v, element, count, span, weight):
    """Of the elements that the line n + s v meets: w as c + 2 b s + a s², and where it is 0; returns how many."""
    out_of_line()
    g, m = np.empty((3, 2)), 0
    a, a1 = dot_pairs(v, v)
    for k in range(count):
        for j in range(3):
            g[j, 0], g[j, 1] = add(n[j, 0], n[j, 1], -element[k, j], -element[k, REST + j])
        b, b1 = dot_pairs(g, v)
        r, r1 = two_product(element[k, RADIUS], element[k, RADIUS])
        c, c1 = dot_pairs(g, g)
        c, c1 = add(r, r1, -c, -c1)
        x, x1 = square(b, b1)
        y, y1 = multiply(a, a1, c, c1)
        x, x1 = add(x, x1, y, y1)
        if x > 0:
            x, x1 = square_root(x, x1)
            for j, sign in ((LOW, -1.0), (HIGH, 1.0)):
                y, y1 = add(-b, -b1, sign * x, sign * x1)
                span[m, j], span[m, j + 1] = divide(y, y1, a, a1)
            span[m, 0], span[m, 1] = divide(c, c1, r, r1)
            span[m, 2], span[m, 3] = divide(-b, -b1, r, r1)
            span[m, 4], span[m, 5] = divide(-a, -a1, r, r1)
            weight[m] = element[k, STRENGTH]
            m += 1
    return m


@kernel
def sign_at(f, v, s, s1, x, x1, element, count, threshold):
    """The sign of the field minus threshold at f + (s + s1 + x + x1) v, f and v expansions; 0 for a touch."""
    out_of_line()
    terms, total = np.empty(3 * LONG * LONG * 4), np.zeros(LONG)
    at, g, w, inverse, size = np.empty((3, LONG)), np.empty((3, LONG)), np.empty(LONG), np.empty(LONG), threshold
    total[0] = -threshold
    for k in range(3):
        terms[:LONG] = f[k]
        expand(terms, put_products(terms, LONG, 1.0, v[k], (s, s1, x, x1)), at[k])
    for i in range(count):
        r, r1 = two_product(element[i, RADIUS], element[i, RADIUS])
        terms[0], terms[1], n = r, r1, 2
        for k in range(3):
            more = terms[n:]
            more[:LONG], more[LONG], more[LONG + 1] = at[k], -element[i, k], -element[i, REST + k]
            expand(more, LONG + 2, g[k])
            n = put_products(terms, n, -1.0, g[k], g[k])
        expand(terms, n, w)
        if w[0] <= 0:
            continue
        # 1/r² by a Newton step from a pair: y + y (1 - r² y)
        y, y1 = divide(1.0, 0.0, r, r1)
        terms[0] = 1.0
        expand(terms, put_products(terms, 1, -1.0, (r, r1), (y, y1)), inverse)
        rest = inverse[0], inverse[1]
        terms[0], terms[1] = y, y1
        expand(terms, put_products(terms, 2, 1.0, (y, y1), rest), inverse)
        expand(terms, put_products(terms, 0, 1.0, w, inverse), g[0])
        expand(terms, put_products(terms, 0, 1.0, g[0], g[0]), g[1])
        terms[:LONG] = total
        expand(terms, put_products(terms, LONG, 1.0, g[1], (element[i, STRENGTH], 0.0)), total)
        size += element[i, ROUGH] * g[0, 0]
    return np.sign(total[0]) if abs(total[0]) > TOUCH * size else 0.0


@inline
def earlier(a, a1, b, b1):
    """Whether one pair is less than another."""
    return a < b or a == b and a1 < b1


@kernel
def stretch_form(span, weight, m, lo, lo1, hi, hi1, threshold, form):
    """The field minus threshold between lo and hi as a quartic in -1 .. 1; returns the size of its terms."""
    out_of_line()
    form[:, :] = 0.0
    form[0, 0], total = -threshold, threshold
    x, x1 = add(0.5 * lo, 0.5 * lo1, 0.5 * hi, 0.5 * hi1)
    h, h1 = add(0.5 * hi, 0.5 * hi1, -0.5 * lo, -0.5 * lo1)
    for k in range(m):
        if span[k, LOW] <= x < span[k, HIGH]:
            c, c1, b, b1, a, a1 = span[k, 0], span[k, 1], span[k, 2], span[k, 3], span[k, 4], span[k, 5]
            ax, ax1 = multiply(a, a1, x, x1)
            q, q1 = add(2 * b, 2 * b1, ax, ax1)
            q, q1 = multiply(q, q1, x, x1)
            p, p1 = add(c, c1, q, q1)                   # w = p + 2 q y + s y², y in -1 .. 1
            rough = abs(c) + abs(2 * b * x) + abs(ax * x)
            q, q1 = add(b, b1, ax, ax1)
            q, q1 = multiply(q, q1, h, h1)
            s, s1 = multiply(a, a1, h, h1)
            s, s1 = multiply(s, s1, h, h1)
            total += abs(weight[k]) * (abs(p) + abs(q) + abs(s)) * (1 + rough)
            for j in range(5):
                if j == 0:
                    y, y1 = square(p, p1)
                elif j == 1:
                    y, y1 = multiply(4 * p, 4 * p1, q, q1)
                elif j == 2:
                    y, y1 = square(2 * q, 2 * q1)
                    z, z1 = multiply(2 * p, 2 * p1, s, s1)
                    y, y1 = add(y, y1, z, z1)
                elif j == 3:
                    y, y1 = multiply(4 * q, 4 * q1, s, s1)
                else:
                    y, y1 = square(s, s1)
                y, y1 = scale(y, y1, weight[k])
                form[j, 0], form[j, 1] = add(form[j, 0], form[j, 1], y, y1)
    return total


@kernel
def settle(rays, i, p, exact, q, element, count, threshold, side, opacity):
    """Record where ray i alone first crosses blob q, whose elements these are."""
    out_of_line()
    rays.tally[SLOW] += 1
    f, v, n = np.empty((3, LONG)), np.empty((3, LONG)), np.empty((3, LONG))
    line_expanded(rays.ray, i, exact, q, f, v)
    most = max(abs(v[0, 0]), max(abs(v[1, 0]), abs(v[2, 0])))
    if not 0 < most < np.inf:
        return
    power = math.ldexp(1.0, -math.frexp(most)[1])
    for k in range(3):
        for j in range(LONG):
            v[k, j] *= power
    s, s1 = closest(f, v, n)
    span, weight = np.empty((count, 10)), np.empty(count)
    m = spans_of(n, v, element, count, span, weight)
    if m == 0:
        return
    end = np.empty((2 * m, 2))      # of all spans, ascending
    for k in range(2 * m):
        x, x1 = span[k // 2, LOW + 2 * (k % 2)], span[k // 2, LOW1 + 2 * (k % 2)]
        j = k
        while j > 0 and earlier(x, x1, end[j - 1, 0], end[j - 1, 1]):
            end[j, 0], end[j, 1] = end[j - 1, 0], end[j - 1, 1]
            j -= 1
        end[j, 0], end[j, 1] = x, x1
    form, poly, stop = np.empty((5, 2)), np.empty((5, 2)), np.empty((5, 2))
    lo, lo1 = two_sum(rays.ray[START, i] / power, -s)
    lo, lo1 = add(lo, lo1, -s1, 0.0)
    now = 0.0 if earlier(end[0, 0], end[0, 1], lo, lo1) else -1.0       # the sign of the field so far; 0: not known yet
    touching, touch, touch1 = False, 0.0, 0.0
    for e in range(2 * m):
        hi, hi1 = end[e, 0], end[e, 1]
        if e == 0 and now != 0:
            lo, lo1 = hi, hi1
        if not earlier(lo, lo1, hi, hi1):
            continue
        size = stretch_form(span, weight, m, lo, lo1, hi, hi1, threshold, form)
        middle, middle1 = add(0.5 * lo, 0.5 * lo1, 0.5 * hi, 0.5 * hi1)
        half, half1 = add(0.5 * hi, 0.5 * hi1, -0.5 * lo, -0.5 * lo1)
        if now == 0:
            y = value_at(form, 4, -1.0, 0.0)[0]
            now = np.sign(y) if abs(y) > DIM * size else sign_at(f, v, s, s1, lo, lo1, element, count, threshold)
        turns = stationary_of(form, -1.0, 1.0, poly, stop)
        stop[turns, 0], stop[turns, 1] = 1.0, 0.0
        at, at1 = -1.0, 0.0
        for j in range(turns + 1):
            y = value_at(form, 4, stop[j, 0], stop[j, 1])[0]
            x, x1 = multiply(stop[j, 0], stop[j, 1], half, half1)
            x, x1 = add(x, x1, middle, middle1)
            sign = np.sign(y) if abs(y) > DIM * size else sign_at(f, v, s, s1, x, x1, element, count, threshold)
            if sign == 0:
                if not touching and now != 0:
                    touching, touch, touch1 = True, x, x1
            else:
                crosses = now != 0 and sign != now
                if touching:
                    x, x1 = touch, touch1
                elif crosses:
                    x, x1 = between(form, 4, at, at1, stop[j, 0], stop[j, 1], sign > 0)
                    x, x1 = multiply(x, x1, half, half1)
                    x, x1 = add(x, x1, middle, middle1)
                if (crosses or touching) and (side & (FRONT | BACK) == 0 or crosses and (sign > 0) == (side & FRONT != 0)):
                    t = add(s, s1, x, x1)[0] * power
                    if rays.ray.itemsize == 4:
                        t = np.float64(np.float32(t))
                    if t > rays.ray[START, i]:
                        record_one(rays, i, p, t, opacity)
                        return
                now, touching = sign, False
            at, at1 = stop[j, 0], stop[j, 1]
        lo, lo1 = hi, hi1
