"""Roots of polynomials of pairs, for one ray at a time: a derivative's roots separate those of the polynomial, and bracketed Newton finds
them to some thirty digits. A polynomial is an array (degree + 1, 2), lowest coefficient first.
"""
from rtcore.jit import inline, kernel, out_of_line
from rtcore.pairs import add, multiply, scale


@inline
def value_at(poly, degree, x, x1):
    """A polynomial at a pair."""
    y, y1 = poly[degree, 0], poly[degree, 1]
    for k in range(degree - 1, -1, -1):
        y, y1 = multiply(y, y1, x, x1)
        y, y1 = add(y, y1, poly[k, 0], poly[k, 1])
    return y, y1


@kernel
def stationary_of(form, start, end, poly, stop):
    """Where the derivative of a quartic changes its sign between start and end, ascending, into stop[:3]; returns how many. `poly`, as
    large as `form`, is worked on. What pairs can't tell from a touch of a derivative may be left out or doubled."""
    out_of_line()
    count = 0
    for order in (3, 2, 1):
        for k in range(5 - order):
            factor = 1.0
            for j in range(order):
                factor *= k + order - j
            poly[k, 0], poly[k, 1] = scale(form[k + order, 0], form[k + order, 1], factor)
        lo, lo1, found = start, 0.0, 0
        before = value_at(poly, 4 - order, lo, lo1)[0] > 0
        for j in range(count + 1):
            hi, hi1 = (stop[j, 0], stop[j, 1]) if j < count else (end, 0.0)
            after = value_at(poly, 4 - order, hi, hi1)[0] > 0
            if before != after:
                stop[found, 0], stop[found, 1] = between(poly, 4 - order, lo, lo1, hi, hi1, after)
                found += 1
            lo, lo1, before = hi, hi1, after
        count = found
    return count


@kernel
def between(poly, degree, lo, lo1, hi, hi1, rising):
    """The root of a polynomial between two places, where it changes its sign once: bracketed Newton, as a pair."""
    out_of_line()
    x, x1 = add(0.5 * lo, 0.5 * lo1, 0.5 * hi, 0.5 * hi1)
    last = hi - lo
    for _ in range(300):
        y = value_at(poly, degree, x, x1)[0]
        if y == 0 or not last > 2.0 ** -108:
            break
        if (y < 0) == rising:
            lo, lo1 = x, x1
        else:
            hi, hi1 = x, x1
        slope = 0.0
        for k in range(degree, 0, -1):
            slope = slope * x + k * poly[k, 0]
        x, x1 = add(x, x1, -y / slope, 0.0)
        if abs(y) <= 0.5 * last * abs(slope) and add(x, x1, -lo, -lo1)[0] >= 0 and add(hi, hi1, -x, -x1)[0] >= 0:
            last = abs(y / slope)
        else:
            x, x1 = add(0.5 * lo, 0.5 * lo1, 0.5 * hi, 0.5 * hi1)
            last = 0.5 * add(hi, hi1, -lo, -lo1)[0]
    return x, x1
