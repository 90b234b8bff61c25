"""The search along one ray for a blob's surface: quartics per stretch.

With the origin at the closest approach to the blob's middle, an element's field is strength · w², w = (h² - (s - m)²)/r² between the ends
m ± h of its span, 0 elsewhere. The ends of all spans cut the ray into stretches; in each the field is one quartic, summed afresh from
the elements active there: w as a quadratic in Bernstein form, whose square is one in Bernstein form, so nothing is converted and
nothing cancels. Signs of the coefficients exclude and isolate; where they can't, those of their differences isolate the only turning
point, else the piece is cut in two. Roots are found on the sum of the elements' fields, not on the polynomial. All signs that matter
are beyond a bound on their rounding; a ray for which they aren't is left to `_softly.py`.
"""
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline, inline_new
from rtcore.pairs import add, divide, scale, square, two_product
from rtcore.shapes._ball import advance
from rtcore.shapes.kind import BACK, FRONT

MOST_ELEMENTS = 256
DEEPEST = 48                    # pieces that wait; a stretch cut so often has nothing left to find but rounding
SPLIT = 0.46875                 # where a piece is cut: not in the middle, in which symmetric things have their double roots
NOISE = 2.0 ** -51              # rounding of the summed field, as a share of threshold + sum of |strength| w (1 + 4 / radius)
TINY = 2.0 ** -45               # pieces are not cut to less, in lengths of the blob
X, Y, Z, RADIUS, STRENGTH, PARTS = 0, 1, 2, 3, 4, 5     # of an element; in a table, what float32 leaves of each part follows, and REST
ROUGH = 5                       # of an element in Scratch: |strength| (1 + 4 / radius), which makes w's rounding the field's
REST, ELEMENT_COLUMNS = 6, 9    # of an element in Scratch: what float64 leaves of X, Y, Z
MIDDLE, HALF2, RADIUS2, WEIGHT, FUZZ, ELEMENT = 0, 1, 2, 3, 4, 5       # of a span; FUZZ is its element's ROUGH, ELEMENT which one that is
#: Of a ray: closest approach to the middle, unit direction, speed, t of the closest approach and what that lacks; origin and direction
#: as pairs, high parts first.
POINT, ALONG, SPEED, SHIFT, MORE, FROM, WAY, LINE_ROWS = 0, 3, 6, 7, 8, 9, 15, 21
MISS, HIT, UNSURE = 0, 1, 2         # what a search comes to
LO, HI, RISES = 5, 6, 7         # of a piece, after its five coefficients; RISES 0: not known to hold just one root


class Scratch(NamedTuple):
    """What the search along one ray works on; made once per kernel call."""

    element: np.ndarray     # float64 (n, 9): the blob at hand
    span: np.ndarray        # float64 (n, 6): of the elements that the ray meets, see MIDDLE ..
    end: np.ndarray         # float64 (2 n): where spans begin and end, ascending
    whose: np.ndarray       # int64 (2 n): number k of the span that begins there, ~k of the one that ends
    active: np.ndarray      # int64 (n): spans that cover the stretch at hand
    piece: np.ndarray       # float64 (m, 8): stack of pieces of the stretch
    found: np.ndarray       # P (1, 8): t of eight rays
    line: np.ndarray        # float64 (rows, 8): eight rays in unit space, see POINT ..


@inline_new
def new_scratch(rays):
    return Scratch(np.empty((MOST_ELEMENTS, ELEMENT_COLUMNS)), np.empty((MOST_ELEMENTS, 6)), np.empty(2 * MOST_ELEMENTS + 1),
                   np.empty(2 * MOST_ELEMENTS, np.int64), np.empty(MOST_ELEMENTS, np.int64), np.empty((DEEPEST + 4, 8)),
                   np.empty((1, 8), rays.ray.dtype), np.empty((LINE_ROWS, 8)))


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
                span[m, FUZZ], span[m, ELEMENT] = element[k, ROUGH], k
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
def here(line, lane, t):
    """The point of ray `lane` at t, as three pairs."""
    x, x1 = advance(line[FROM, lane], line[FROM + 3, lane], t, line[WAY, lane], line[WAY + 3, lane])
    y, y1 = advance(line[FROM + 1, lane], line[FROM + 4, lane], t, line[WAY + 1, lane], line[WAY + 4, lane])
    z, z1 = advance(line[FROM + 2, lane], line[FROM + 5, lane], t, line[WAY + 2, lane], line[WAY + 5, lane])
    return x, x1, y, y1, z, z1


@inline
def softness(element, k, x, x1, y, y1, z, z1):
    """Element k's w at a point, as a pair, and the way there from its middle."""
    x, x1 = add(x, x1, -element[k, X], -element[k, REST])
    y, y1 = add(y, y1, -element[k, Y], -element[k, REST + 1])
    z, z1 = add(z, z1, -element[k, Z], -element[k, REST + 2])
    a, a1 = square(x, x1)
    b, b1 = square(y, y1)
    a, a1 = add(a, a1, b, b1)
    b, b1 = square(z, z1)
    a, a1 = add(a, a1, b, b1)
    b, b1 = two_product(element[k, RADIUS], element[k, RADIUS])
    a, a1 = add(b, b1, -a, -a1)
    a, a1 = divide(a, a1, b, b1)
    return a, a1, x, y, z


@inline
def begins_inside(scratch, count, threshold, lane, start):
    """The sign of the field where ray `lane` starts, in double-double; 0 if even that can't tell."""
    element, total, total1, size = scratch.element, -threshold, 0.0, threshold
    x, x1, y, y1, z, z1 = here(scratch.line, lane, start)
    for k in range(count):
        w, w1, _, _, _ = softness(element, k, x, x1, y, y1, z, z1)
        if w > 0:
            size += element[k, ROUGH] * w
            w, w1 = scale(*square(w, w1), element[k, STRENGTH])
            total, total1 = add(total, total1, w, w1)
    return np.sign(total) if abs(total) > 2.0 ** -96 * size else 0.0


@inline
def polish(scratch, n, threshold, lane, t):
    """The root next to t, of the field of the n active spans, by Newton's method in double-double; NaN if it doesn't get there."""
    line, element = scratch.line, scratch.element
    vx, vy, vz, unit = line[WAY, lane], line[WAY + 1, lane], line[WAY + 2, lane], 1 / line[SPEED, lane]
    for _ in range(3):
        total, total1, f1, f2 = -threshold, 0.0, 0.0, 0.0
        x, x1, y, y1, z, z1 = here(line, lane, t)
        for i in range(n):
            k = scratch.active[i]
            weight, scaled = scratch.span[k, WEIGHT], -2 / scratch.span[k, RADIUS2]
            w, w1, ux, uy, uz = softness(element, int(scratch.span[k, ELEMENT]), x, x1, y, y1, z, z1)
            slope = (ux * vx + uy * vy + uz * vz) * scaled
            f1 += 2 * weight * w * slope
            f2 += 2 * weight * (slope * slope + w * (vx * vx + vy * vy + vz * vz) * scaled)
            w, w1 = scale(*square(w, w1), weight)
            total, total1 = add(total, total1, w, w1)
        step = -total / f1
        t += step
        if abs(f2 * step) * abs(step) <= 2.0 ** -58 * abs(f1) * max(abs(t), 2.0 ** -40 * unit):      # the rest is less than a rounding
            return t
    return np.nan


@inline
def keep(scratch, n, threshold, lane, s, t, noise, start):
    """Keeps the root near s and t, to the last digit of the ray's precision: HIT if it is past the ray's start, else UNSURE."""
    found, unit = scratch.found, 1 / scratch.line[SPEED, lane]
    f, f1, f2 = field(scratch, n, threshold, s)
    blur = 2 * (abs(f) + noise) / abs(f1) * unit + 2.0 ** -50 * abs(t)
    found[0, lane] = t - blur
    least = found[0, lane]
    found[0, lane] = t + blur
    if found[0, lane] != least or not 16 * abs(f2) * noise <= f1 * f1:
        t = polish(scratch, n, threshold, lane, t)
        found[0, lane] = t - 2.0 ** -51 * abs(t) - 2.0 ** -90 * unit
        least = found[0, lane]
        found[0, lane] = t
    return HIT if least > start else UNSURE


@inline
def search(scratch, count, m, threshold, low, shift, more, speed, start, far, side, lane):
    """The first crossing past `start` among m spans, as scratch.found[0, lane]: t = shift + (more + s / speed). HIT, MISS or UNSURE."""
    end, piece, found = scratch.end, scratch.piece, scratch.found
    rising, falling = side & (FRONT | BACK) == 0 or side & FRONT != 0, side & (FRONT | BACK) == 0 or side & BACK != 0
    end[2 * m] = end[2 * m - 1] + 1
    inside, edge, n = False, 0.0, 0     # edge: +-1 where the field rises or falls through a value too small for its sign to be certain
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
        found[0, lane] = shift + (more + a / speed)
        if found[0, lane] > far:
            return MISS
        c0, c1, c2, c3, c4, noise = -threshold, -threshold, -threshold, -threshold, -threshold, threshold
        for i in range(n):
            k = scratch.active[i]
            u, v = a - scratch.span[k, MIDDLE], b - scratch.span[k, MIDDLE]
            half2, square2, weight = scratch.span[k, HALF2], scratch.span[k, RADIUS2], scratch.span[k, WEIGHT]
            w0, w1, w2 = max(half2 - u * u, 0.0) / square2, (half2 - u * v) / square2, max(half2 - v * v, 0.0) / square2
            c0 += weight * w0 * w0
            c1 += weight * w0 * w1
            c2 += weight * (w0 * w2 + 2 * w1 * w1) / 3
            c3 += weight * w1 * w2
            c4 += weight * w2 * w2
            noise += scratch.span[k, FUZZ] * max(w0, max(w1, w2))
        noise *= 2 * NOISE
        if end[j] <= low:
            edge, inside = 0.0, c0 > 0
            if abs(c0) <= 2 * noise:
                c0 = begins_inside(scratch, count, threshold, lane, start) * noise
                if c0 == 0:
                    return UNSURE
                inside = c0 > 0
        if not inside and edge == 0 and max(max(c0, c1), max(max(c2, c3), c4)) < -noise:
            continue
        piece[0, 0], piece[0, 1], piece[0, 2], piece[0, 3], piece[0, 4] = c0, c1, c2, c3, c4
        piece[0, LO], piece[0, HI], piece[0, RISES] = a, b, 0.0
        top = 1
        while top > 0:
            top -= 1
            c0, c1, c2, c3, c4 = piece[top, 0], piece[top, 1], piece[top, 2], piece[top, 3], piece[top, 4]
            lo, hi, rises = piece[top, LO], piece[top, HI], piece[top, RISES]
            if rises == 0:
                lowest = min(min(c0, c1), min(min(c2, c3), c4))
                highest = max(max(c0, c1), max(max(c2, c3), c4))
                after = c4 > 0
                if lowest > noise or highest < -noise:
                    if after != inside:         # it has crossed where the sign was not certain
                        if edge == 0 or (edge > 0) != after:
                            return UNSURE
                        inside = after
                        if rising if after else falling:
                            return keep(scratch, n, threshold, lane, lo, shift + (more + lo / speed), noise, start)
                    edge = 0.0
                    continue
                d0, d1, d2, d3 = c1 - c0, c2 - c1, c3 - c2, c4 - c3
                least, most = min(min(d0, d1), min(d2, d3)), max(max(d0, d1), max(d2, d3))
                slope = 1.0 if least > 4 * noise else -1.0 if most < -4 * noise else 0.0
                sharp = min(min(abs(c0), abs(c1)), min(min(abs(c2), abs(c3)), abs(c4))) > noise
                if slope != 0:
                    if edge * slope < 0 or edge == 0 and (c0 > 0) != inside:
                        return UNSURE
                    edge = slope if abs(c4) <= noise else 0.0
                    if after == inside:
                        continue
                    if after != (slope > 0):
                        return UNSURE
                    rises = slope
                elif sharp and edge == 0 and (c0 > 0) == inside and after != inside and (
                        (inside != (c1 > 0)) + ((c1 > 0) != (c2 > 0)) + ((c2 > 0) != (c3 > 0)) + ((c3 > 0) != after) == 1):
                    rises = 1.0 if after else -1.0
                else:
                    middle = lo + SPLIT * (hi - lo)
                    e0, e1, e2, e3 = c0 + SPLIT * d0, c1 + SPLIT * d1, c2 + SPLIT * d2, c3 + SPLIT * d3
                    g0, g1, g2 = e0 + SPLIT * (e1 - e0), e1 + SPLIT * (e2 - e1), e2 + SPLIT * (e3 - e2)
                    h0, h1 = g0 + SPLIT * (g1 - g0), g1 + SPLIT * (g2 - g1)
                    h = h0 + SPLIT * (h1 - h0)
                    only = (edge == 0 and min(abs(c0), abs(c4)) > noise and (h > 0) == inside and after == inside
                            and min(min(abs(d0), abs(d1)), min(abs(d2), abs(d3))) > 2 * noise and count_turns(d0, d1, d2, d3) == 1)
                    if not only:
                        if top >= DEEPEST or not hi - lo > TINY:
                            return UNSURE
                        piece[top, 0], piece[top, 1], piece[top, 2], piece[top, 3], piece[top, 4] = h, h1, g2, e3, c4
                        piece[top, LO], piece[top, HI], piece[top, RISES] = middle, hi, 0.0
                        top += 1
                        piece[top, 0], piece[top, 1], piece[top, 2], piece[top, 3], piece[top, 4] = c0, e0, g0, h0, h
                        piece[top, LO], piece[top, HI], piece[top, RISES] = lo, middle, 0.0
                        top += 1
                        continue
                    # one turning point; no crossing in view
                    middle = solve(scratch, n, threshold, lo, hi, inside, 1)
                    f = field(scratch, n, threshold, middle)[0]
                    if abs(f) <= 4 * noise:
                        return UNSURE
                    if (f > 0) == inside:
                        continue
                    rises = -1.0 if inside else 1.0
                    piece[top, LO], piece[top, HI], piece[top, RISES] = middle, hi, -rises
                    top += 1
                    hi = middle
            inside = rises > 0
            if rising if inside else falling:
                s = solve(scratch, n, threshold, lo, hi, inside, 0)
                return keep(scratch, n, threshold, lane, s, shift + (more + s / speed), noise, start)
    return MISS
