"""The ray and the torus, with a certain answer.

With R the radius of the circle, r that of the tube, the surface is where

    F(p) = (|p|² + K)² - 4 R² (x² + y²),  K = R² - r²,

is 0: a quartic along a ray. Eight rays at once, about the point of closest approach to the centre, where the quartic σ⁴ + pσ² + qσ + c
has no cubic term and coefficients of order 1. Its second derivative's roots isolate those of the first, these isolate the quartic's own
(Yuksel, *High-Performance Polynomial Root Finding for Graphics*, 2022); all with a bound on what plain float64 arithmetic may be off.
Float64 rays then take one Newton step on F in double-double, with a bound on what it leaves. Rays that a bound can't vouch for go one
at a time to a quartic whose coefficients have some hundred digits.
"""
import math

import numpy as np

from rtcore.expansions import LONG, expand, put_product, put_products
from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import along, any_lane, dot, fma, greatest, least, narrow, root, select, size, wide
from rtcore.pairs import add, multiply, square, two_product
from rtcore.shapes._ball import U64, advance
from rtcore.shapes._separate import between, stationary_of, value_at
from rtcore.shapes._unit import BEYOND, line_expanded
from rtcore.shapes.kind import BACK, FRONT
from rtcore.wave import SLOW, START, record_one

RADII, CONSTANTS = BEYOND, BEYOND + 2       # columns of Table.exact after those of `_unit`: R, r; K and 4 R² as pairs
STEPS = 24              # of bracketed Newton at most; most lanes need 5
MARGIN = 2.0 ** -10     # in σ: more than any root that counts is off
TOUCH = 2.0 ** -128     # a critical value of F below it is a tangent; numbers that are off by a rounding give 2^-106 or more
DIM = 2.0 ** -96        # far more than F in pairs may be off


# --- eight rays ---

@inline
def quartic(x, p, q, c):
    """σ⁴ + pσ² + qσ + c at x, and its derivative."""
    xx = x * x
    return fma(fma(xx + p, x, q), x, c), fma(fma(4.0, xx, 2 * p), x, q)


@inline
def newton(want, lo, hi, rising, p, q, c, order, fuzz):
    """The root of the quartic (order 0) or of its derivative (order 1) between lo and hi, where it goes through 0 once, upward where
    `rising`: until what is left is below `fuzz` in all lanes wanted, and a step more. Steps that leave the bracket are halvings."""
    x = 0.5 * (lo + hi)
    for _ in range(STEPS):
        y, slope = quartic(x, p, q, c)
        if order == 1:
            y, slope = slope, fma(12 * x, x, 2 * p)
        below = (y < 0) ^ ~rising
        lo, hi = select(below, x, lo), select(below, hi, x)
        after = x - y / slope
        x = select((after >= lo) & (after <= hi), after, 0.5 * (lo + hi))
        if not any_lane(want & (size(y) > fuzz)):
            break
    return x


@inline
def stationary(todo, lo, hi, p, q, fuzz):
    """Where the quartic's derivative changes sign between lo and hi, else hi; there the quartic without c; and a bound on how far its
    value is from that at the true place."""
    y_lo, y_hi = fma(fma(4 * lo, lo, 2 * p), lo, q), fma(fma(4 * hi, hi, 2 * p), hi, q)
    cross = (y_lo > 0) ^ (y_hi > 0)
    x = hi
    if any_lane(cross & todo):
        x = select(cross, newton(cross & todo, lo, hi, ~(y_lo > 0), p, q, q, 1, fuzz), hi)
    value, slope = quartic(x, p, q, 0 * q)
    return x, value, select(cross, 4 * size(slope), 0)


@inline
def isolate(todo, f, d, near, far, major, minor):
    """The quartic of eight lines f + t d about t = near[1], in lengths of the torus, and what separates its roots. f and d may be off by
    6 U64 far where the line is close. Returns a bound on the quartic's error, (p, q, c), reach, and for each separating place its σ, the
    value there and how small it must be to be in doubt."""
    e, n = d * (1 / root(dot(d, d))), along(f, near[1], d)
    # the gradient of F is 8 at most, the places are off by 15 roundings of `far`; the coefficients' own roundings come to 128
    fuzz = 512 * U64 * (far + 1)
    k, four = dot(n, n) + (major - minor) * (major + minor), 4 * major * major
    p = 2 * k - four * (e.x * e.x + e.y * e.y)
    q = -2 * four * (n.x * e.x + n.y * e.y)
    c = k * k - four * (n.x * n.x + n.y * n.y)
    reach = root(greatest(near[2], 0) + near[3]) + MARGIN
    bend = least(root(greatest(p * (-1 / 6), 0)), reach)
    x0, y0, z0 = stationary(todo, -reach, -bend, p, q, fuzz)
    x1, y1, z1 = stationary(todo, -bend, bend, p, q, fuzz)
    x2, y2, z2 = stationary(todo, bend, reach, p, q, fuzz)
    return fuzz, (p, q, c), reach, (x0, y0 + c, z0 + fuzz), (x1, y1 + c, z1 + fuzz), (x2, y2 + c, z2 + fuzz)


@inline
def may_cross(todo, course):
    """Lanes whose quartic is, or may be, below 0 somewhere."""
    return todo & ((course[3][1] <= course[3][2]) | (course[4][1] <= course[4][2]) | (course[5][1] <= course[5][2]))


@inline
def polish(f, f1, v, v1, t, k, k1, four, four1, far, speed):
    """One Newton step from t on F along (f + f1) + t (v + v1); the size of the slope; a bound on what the step leaves, times that slope;
    lanes in which the step is short enough for that. f may be off by 8 U64² far, v by as much where the line is close; |v| is `speed`."""
    x, x1 = advance(f.x, f1.x, t, v.x, v1.x)
    y, y1 = advance(f.y, f1.y, t, v.y, v1.y)
    z, z1 = advance(f.z, f1.z, t, v.z, v1.z)
    xx, xx1 = square(x, x1)
    yy, yy1 = square(y, y1)
    zz, zz1 = square(z, z1)
    flat, flat1 = add(xx, xx1, yy, yy1)
    w, w1 = add(flat, flat1, zz, zz1)
    w, w1 = add(w, w1, k + 0 * t, k1 + 0 * t)
    ww, ww1 = square(w, w1)
    g, g1 = multiply(flat, flat1, four + 0 * t, four1 + 0 * t)
    excess = (ww - g) + (ww1 - g1)
    across = x * v.x + y * v.y
    slope = 4 * w * (across + z * v.z) - 2 * four * across
    step = excess / slope
    # Newton's own error, half the second derivative being 10 at most; that of the slope times the step; that of the excess
    moved = speed * size(step)
    left = moved * (24 * moved + 128 * U64 * far) + 1024 * U64 * U64 * (far + 1)
    return t - step, size(slope), left, 64 * moved * speed <= size(slope)


@inline
def first_root(todo, course, middle, speed, f, f1, v, v1, k, k1, four, four1, far, start, end, side, sharp):
    """Where the lanes `todo` first cross the torus between start and end; `course` is what `isolate` gave. Returns t, the lanes that
    found it, and those for which this arithmetic isn't certain. Not `sharp`: t is good for float32, and the pairs f .. four1 don't matter.
    """
    fuzz, (p, q, c), reach, first, second, third = course
    t, lo, inverse = 0 * middle, -reach, 1 / speed
    found = todo & ~todo
    unsure, before = found, ~found
    for piece in range(4):
        hi, value, doubt = first if piece == 0 else second if piece == 1 else third
        after = value > 0
        if piece == 3:      # beyond the ball about the torus
            hi, after = reach, after | ~after
        ahead = todo & (fma(hi + MARGIN, inverse, middle) > start) & (fma(lo - MARGIN, inverse, middle) < end)
        if piece < 3:
            unsure = unsure | (ahead & (size(value) <= doubt) & (fma(hi - MARGIN, inverse, middle) < end))
        want = ahead & ~unsure & (before ^ after)
        if side != 0:
            want = want & before if side & FRONT else want & ~before
        if any_lane(want):
            x = newton(want, lo, hi, ~before, p, q, c, 0, fuzz)
            y, slope = quartic(x, p, q, c)
            left, steep = size(y) + fuzz, size(slope) * speed
            # so steep that the quartic has but one root where it is below `fuzz`, its second derivative being 24 at most
            ok = slope * slope > 128 * left
            s = fma(x, inverse, middle)
            if sharp:
                s, steep, left, close = polish(f, f1, v, v1, s, k, k1, four, four1, far, speed)
                ok = ok & close
            slack = 2.0 ** -56 if sharp else 2.0 ** -28
            ok = ok & ((left <= steep * (slack * size(s))) | (left < steep * (start - s)) | (left < steep * (s - end)))
            unsure = unsure | (want & ~ok)
            s = s if sharp else wide(narrow(s))
            hit = want & ok & (s > start)
            t, found = select(hit, s, t), found | hit
        todo = todo & ~unsure & ~found
        lo, before = hi, after
    return t, found, unsure


# --- one ray, certain ---

@kernel
def settle(rays, i, p, table, q, opacity):
    """Record where ray i alone meets torus q."""
    out_of_line()
    rays.tally[SLOW] += 1
    side, exact = table.side[q], table.exact
    f, v = np.empty((3, LONG)), np.empty((3, LONG))
    line_expanded(rays.ray, i, exact, q, f, v)
    most = max(abs(v[0, 0]), max(abs(v[1, 0]), abs(v[2, 0])))
    if not 0 < most < np.inf:
        return
    power = math.ldexp(1.0, -math.frexp(most)[1])
    for k in range(3):
        for j in range(LONG):
            v[k, j] *= power
    form, speed2 = np.empty((5, LONG)), v[0, 0] * v[0, 0] + v[1, 0] * v[1, 0] + v[2, 0] * v[2, 0]
    s, s1, reach = 0.0, 0.0, 1.0625 / np.sqrt(speed2)
    for _ in range(2):      # the closest approach once more: what the first step's rounding left
        step = quartic_about(f, v, s, s1, exact[q, RADII], exact[q, RADII + 1], form) / speed2
        s, s1 = add(s, s1, -step, 0.0)
    quartic_about(f, v, s, s1, exact[q, RADII], exact[q, RADII + 1], form)
    poly, stop, local = np.empty((5, 2)), np.empty((5, 2)), np.empty((5, LONG))
    count = stationary_of(form, -reach, reach, poly, stop)
    poly[:, :] = form[:, :2]
    now, lo, lo1, touch, touch1 = 1.0, -reach, 0.0, np.nan, 0.0
    for j in range(count + 1):
        hi, hi1, sign = reach, 0.0, 1.0
        if j < count:
            hi, hi1 = stop[j, 0], stop[j, 1]
            sign = sign_at(form, poly, hi, hi1)
        if sign == 0:
            if np.isnan(touch):
                touch, touch1 = hi, hi1
        else:
            crosses = sign != now
            if not np.isnan(touch):
                x, x1 = touch, touch1
            elif crosses:
                x, x1 = between(poly, 4, lo, lo1, hi, hi1, sign > 0)
            seen = side & (FRONT | BACK) == 0 or crosses and (sign < 0) == (side & FRONT != 0)
            if seen and (crosses or not np.isnan(touch)):
                t, t1 = add(s, s1, x, x1)
                if crosses and np.isnan(touch):     # near the ray's origin t has fewer digits than a step from there gives
                    quartic_about(f, v, t, t1, exact[q, RADII], exact[q, RADII + 1], local)
                    step = local[0, 0] / local[1, 0]
                    if 64 * abs(step) <= abs(local[1, 0]):
                        t, t1 = add(t, t1, -step, 0.0)
                t *= power
                if rays.ray.itemsize == 4:
                    t = np.float64(np.float32(t))
                if t > rays.ray[START, i]:
                    record_one(rays, i, p, t, opacity)
                    return
            now, touch = sign, np.nan
        lo, lo1 = hi, hi1


@kernel
def quartic_about(f, v, s, s1, major, minor, form):
    """The coefficients of F along f + (s + s1 + σ) v, lowest first, as expansions. Returns what the place s + s1 has along v."""
    out_of_line()
    terms, n = np.empty(8 * LONG * LONG), np.empty((3, LONG))
    for k in range(3):
        terms[:LONG] = f[k]
        expand(terms, put_products(terms, LONG, 1.0, v[k], (s, s1)), n[k])
    a, b, c = np.empty(LONG), np.empty(LONG), np.empty(LONG)                    # |p|² + K = a σ² + 2 b σ + c
    flat_a, flat_b, flat_c = np.empty(LONG), np.empty(LONG), np.empty(LONG)     # x² + y² likewise
    four = two_product(2 * major, -2 * major)
    expand(terms, put_dot(terms, 0, v, v, 3), a)
    expand(terms, put_dot(terms, 0, n, v, 3), b)
    m = put_product(terms, put_product(terms, put_dot(terms, 0, n, n, 3), major, major), minor, -minor)
    expand(terms, m, c)
    expand(terms, put_dot(terms, 0, v, v, 2), flat_a)
    expand(terms, put_dot(terms, 0, n, v, 2), flat_b)
    expand(terms, put_dot(terms, 0, n, n, 2), flat_c)
    expand(terms, put_products(terms, 0, 1.0, a, a), form[4])
    expand(terms, put_products(terms, 0, 4.0, a, b), form[3])
    m = put_products(terms, put_products(terms, 0, 4.0, b, b), 2.0, a, c)
    expand(terms, put_products(terms, m, 1.0, four, flat_a), form[2])
    expand(terms, put_products(terms, put_products(terms, 0, 4.0, b, c), 2.0, four, flat_b), form[1])
    expand(terms, put_products(terms, put_products(terms, 0, 1.0, c, c), 1.0, four, flat_c), form[0])
    return b[0]


@inline
def put_dot(terms, n, a, b, count):
    """Terms for the scalar product of the first `count` parts of two vectors of expansions."""
    for k in range(count):
        n = put_products(terms, n, 1.0, a[k], b[k])
    return n


@kernel
def sign_at(form, poly, x, x1):
    """The sign of the quartic at a pair; 0 where it is less than TOUCH. By expansions where pairs can't tell."""
    out_of_line()
    y = value_at(poly, 4, x, x1)[0]
    if abs(y) > DIM:
        return np.sign(y)
    terms, total = np.empty(5 * LONG + LONG), form[4].copy()
    for k in range(3, -1, -1):
        n = put_products(terms, 0, 1.0, total, (x, x1))
        terms[n:n + LONG] = form[k]
        expand(terms, n + LONG, total)
    return np.sign(total[0]) if abs(total[0]) > TOUCH else 0.0
