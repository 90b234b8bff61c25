"""The search along one ray for a blob's surface: quartics per stretch.

With the origin at the closest approach to the blob's middle, an element's field is strength · w², w = (h² - (s - m)²)/r² between the ends
m ± h of its span, 0 elsewhere. The ends of all spans cut the ray into stretches; in each the field is one quartic, summed afresh from
the elements active there: w as a quadratic in Bernstein form, whose square is one in Bernstein form, so nothing is converted and
nothing cancels. Signs of the coefficients exclude and isolate; where they can't, those of their differences isolate the only turning
point, else the piece is cut in two. Roots are found on the sum of the elements' fields, not on the polynomial.
"""
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline
from rtcore.shapes.kind import BACK, FRONT

MOST_ELEMENTS = 256
DEEPEST = 48                    # pieces that wait; a stretch cut so often has nothing left to find but rounding
SPLIT = 0.46875                 # where a piece is cut: not in the middle, in which symmetric things have their double roots
NOISE = 2.0 ** -51              # rounding of the summed field, as a share of threshold + sum of |strength| w
X, Y, Z, RADIUS, STRENGTH, PARTS = 0, 1, 2, 3, 4, 5     # of an element; in a table, what float32 leaves of each part follows
MIDDLE, HALF2, RADIUS2, WEIGHT = 0, 1, 2, 3     # of a span
LO, HI, RISES = 5, 6, 7         # of a piece, after its five coefficients; RISES 0: not known to hold just one root


class Scratch(NamedTuple):
    """What the search along one ray works on; made once per kernel call."""

    element: np.ndarray     # float64 (n, 5): the blob at hand
    span: np.ndarray        # float64 (n, 4): of the elements that the ray meets, see MIDDLE ..
    end: np.ndarray         # float64 (2 n): where spans begin and end, ascending
    whose: np.ndarray       # int64 (2 n): number k of the span that begins there, ~k of the one that ends
    active: np.ndarray      # int64 (n): spans that cover the stretch at hand
    piece: np.ndarray       # float64 (m, 8): stack of pieces of the stretch
    found: np.ndarray       # P (1, 8): t of eight rays


@inline
def new_scratch(rays):
    return Scratch(np.empty((MOST_ELEMENTS, 5)), np.empty((MOST_ELEMENTS, 4)), np.empty(2 * MOST_ELEMENTS + 1),
                   np.empty(2 * MOST_ELEMENTS, np.int64), np.empty(MOST_ELEMENTS, np.int64), np.empty((DEEPEST + 4, 8)),
                   np.empty((1, 8), rays.ray.dtype))


@inline
def meet(scratch, count, nx, ny, nz, ex, ey, ez, low):
    """Spans of the elements that the line n + s e (n at right angles to e, |e| = 1) meets past s = low; returns how many."""
    element, span, end, whose = scratch.element, scratch.span, scratch.end, scratch.whose
    m = 0
    for k in range(count):
        x, y, z, r = nx - element[k, X], ny - element[k, Y], nz - element[k, Z], element[k, RADIUS]
        b = x * ex + y * ey + z * ez
        x, y, z = x - b * ex, y - b * ey, z - b * ez
        square = r * r - (x * x + y * y + z * z)
        if square > 0:
            h = np.sqrt(square)
            if h - b > low:
                span[m, MIDDLE], span[m, HALF2], span[m, RADIUS2], span[m, WEIGHT] = -b, square, r * r, element[k, STRENGTH]
                for side in range(2):
                    at = -b - h if side == 0 else -b + h
                    j = 2 * m + side
                    while j > 0 and end[j - 1] > at:
                        end[j], whose[j] = end[j - 1], whose[j - 1]
                        j -= 1
                    end[j], whose[j] = at, m if side == 0 else ~m
                m += 1
    return m


@inline
def field(scratch, n, threshold, s):
    """Field minus threshold at s, from the n active spans, and its two derivatives."""
    f, f1, f2 = -threshold, 0.0, 0.0
    for i in range(n):
        k = scratch.active[i]
        u, square = s - scratch.span[k, MIDDLE], scratch.span[k, RADIUS2]
        w, weight, inverse = (scratch.span[k, HALF2] - u * u) / square, scratch.span[k, WEIGHT], 1 / square
        slope = -2 * u * inverse
        f += weight * w * w
        f1 += weight * 2 * w * slope
        f2 += weight * 2 * (slope * slope - 2 * w * inverse)
    return f, f1, f2


@inline
def solve(scratch, n, threshold, lo, hi, rises, order):
    """Where the field (order 0) or its derivative (order 1) goes through 0 between lo and hi, once: bracketed Newton, to the last digit."""
    s, step = 0.5 * (lo + hi), hi - lo
    for _ in range(100):
        f, f1, f2 = field(scratch, n, threshold, s)
        y, slope = (f, f1) if order == 0 else (f1, f2)
        if y == 0:
            break
        if (y < 0) == rises:
            lo = s
        else:
            hi = s
        after = s - y / slope
        if lo <= after <= hi and abs(after - s) <= 0.5 * abs(step):
            step, done = after - s, 2.0 ** -38      # Newton's next step would be of the order of this one's square
        else:
            after = 0.5 * (lo + hi)
            step, done = after - s, 2.0 ** -54
        s = after
        if abs(step) <= done:
            break
    return s


@inline
def count_turns(a, b, c, d):
    """How often the sign changes in a sequence of four numbers; zeros don't count."""
    sign, turns = 0.0, 0
    for x in (a, b, c, d):
        if x != 0:
            turns += sign * x < 0
            sign = 1.0 if x > 0 else -1.0
    return turns


@inline
def accept(found, lane, t, start):
    """Whether t, rounded to the ray's precision, is past its start; if so it is kept."""
    found[0, lane] = t
    if found[0, lane] > start:
        return True
    found[0, lane] = np.inf
    return False


@inline
def search(scratch, m, threshold, low, shift, speed, start, far, side, lane):
    """The first crossing past `start` among m spans, as scratch.found[0, lane]: t = (s + shift) / speed; inf if there is none."""
    end, piece, found = scratch.end, scratch.piece, scratch.found
    rising, falling = side == 0 or side & FRONT != 0, side == 0 or side & BACK != 0
    end[2 * m] = end[2 * m - 1] + 1
    inside, touching, n = False, False, 0
    for j in range(2 * m):
        k = scratch.whose[j]
        if k >= 0:
            scratch.active[n] = k
            n += 1
        else:
            n -= 1
            i = 0
            while scratch.active[i] != ~k:
                i += 1
            scratch.active[i] = scratch.active[n]
        a, b = max(end[j], low), end[j + 1]
        if not b > a:
            continue
        found[0, lane] = (a + shift) / speed
        if found[0, lane] > far:
            break
        c0, c1, c2, c3, c4, noise = -threshold, -threshold, -threshold, -threshold, -threshold, threshold
        for i in range(n):
            k = scratch.active[i]
            u, v = a - scratch.span[k, MIDDLE], b - scratch.span[k, MIDDLE]
            half2, square, weight = scratch.span[k, HALF2], scratch.span[k, RADIUS2], scratch.span[k, WEIGHT]
            w0, w1, w2 = max(half2 - u * u, 0.0) / square, (half2 - u * v) / square, max(half2 - v * v, 0.0) / square
            c0 += weight * w0 * w0
            c1 += weight * w0 * w1
            c2 += weight * (w0 * w2 + 2 * w1 * w1) / 3
            c3 += weight * w1 * w2
            c4 += weight * w2 * w2
            noise += abs(weight) * max(w0, max(w1, w2))
        noise *= NOISE
        if end[j] <= low:
            inside = c0 > 0
        elif (touching and abs(c0) <= noise and abs(c2) > noise and (c2 > 0) == inside      # just where two stretches meet
                and accept(found, lane, (a + shift) / speed, start)):
            return
        touching = abs(c4) <= noise
        if not inside and max(max(c0, c1), max(max(c2, c3), c4)) <= 0:
            continue
        piece[0, 0], piece[0, 1], piece[0, 2], piece[0, 3], piece[0, 4] = c0, c1, c2, c3, c4
        piece[0, LO], piece[0, HI], piece[0, RISES] = a, b, 0.0
        top = 1
        while top > 0:
            top -= 1
            c0, c1, c2, c3, c4 = piece[top, 0], piece[top, 1], piece[top, 2], piece[top, 3], piece[top, 4]
            lo, hi, rises = piece[top, LO], piece[top, HI], piece[top, RISES]
            if rises == 0:
                before, after = c0 > 0, c4 > 0
                if before != inside:        # the roundings of two stretches differ where they meet: there it crosses
                    inside = before
                    if (rising if before else falling) and accept(found, lane, (lo + shift) / speed, start):
                        return
                changes = (before != (c1 > 0)) + ((c1 > 0) != (c2 > 0)) + ((c2 > 0) != (c3 > 0)) + ((c3 > 0) != after)
                if changes == 0:
                    continue
                if changes == 1:
                    rises = 1.0 if after else -1.0
                else:
                    turns = count_turns(c1 - c0, c2 - c1, c3 - c2, c4 - c3)
                    middle = lo + SPLIT * (hi - lo)
                    flat = max(max(abs(c0), abs(c1)), max(max(abs(c2), abs(c3)), abs(c4))) <= noise
                    d0, d1, d2, d3 = c0 + SPLIT * (c1 - c0), c1 + SPLIT * (c2 - c1), c2 + SPLIT * (c3 - c2), c3 + SPLIT * (c4 - c3)
                    e0, e1, e2 = d0 + SPLIT * (d1 - d0), d1 + SPLIT * (d2 - d1), d2 + SPLIT * (d3 - d2)
                    g0, g1 = e0 + SPLIT * (e1 - e0), e1 + SPLIT * (e2 - e1)
                    h = g0 + SPLIT * (g1 - g0)
                    # a crossing in view, or more than one turning point
                    if not flat and ((h > 0) != before or turns > 1) and top < DEEPEST and lo < middle < hi:
                        piece[top, 0], piece[top, 1], piece[top, 2], piece[top, 3], piece[top, 4] = h, g1, e2, d3, c4
                        piece[top, LO], piece[top, HI], piece[top, RISES] = middle, hi, 0.0
                        top += 1
                        piece[top, 0], piece[top, 1], piece[top, 2], piece[top, 3], piece[top, 4] = c0, d0, e0, g0, h
                        piece[top, LO], piece[top, HI], piece[top, RISES] = lo, middle, 0.0
                        top += 1
                        continue
                    f = 0.0
                    if not flat and turns == 1:
                        middle = solve(scratch, n, threshold, lo, hi, before, 1)
                        f = field(scratch, n, threshold, middle)[0]
                    if abs(f) <= noise:     # it touches: a double root, in and out
                        inside = after
                        if accept(found, lane, (middle + shift) / speed, start):
                            return
                        continue
                    if (f > 0) == before:
                        continue
                    rises = -1.0 if before else 1.0
                    piece[top, LO], piece[top, HI], piece[top, RISES] = middle, hi, -rises
                    top += 1
                    hi = middle
            inside = rises > 0
            if rising if inside else falling:
                s = solve(scratch, n, threshold, lo, hi, inside, 0)
                if accept(found, lane, (s + shift) / speed, start):
                    return
    found[0, lane] = np.inf
