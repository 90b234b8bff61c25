"""Sums of many floats as if in some hundred digits, and quadratics solved with them: the slow way out where pairs can't be certain.

Products are split into two exact terms each and summed by repeated error-free passes (Ogita, Rump, Oishi, *Accurate Sum and Dot Product*,
SIAM J. Sci. Comput. 26:6, 2005); an expansion is the LONG leading parts of such a sum, about 200 bits. All for single rays.
"""
import numpy as np

from rtcore.jit import inline, kernel, out_of_line
from rtcore.pairs import divide, square_root, two_product, two_sum

LONG = 4        # parts of an expansion
#: What sums may be off, over their terms, if the factors are three floats long, or are exact; below it they are 0.
NOISE, EXACT_NOISE = 2.0 ** -150, 2.0 ** -190


@kernel
def expand(terms, n, out):
    """The expansion of the sum of terms[:n] as out[:LONG], the largest part first. Spoils the terms; there must be room for LONG more."""
    out_of_line()
    for k in range(LONG):
        for _ in range(LONG + 1):
            for i in range(1, n):
                terms[i], terms[i - 1] = two_sum(terms[i], terms[i - 1])
        total = 0.0
        for i in range(n):
            total += terms[i]
        out[k] = total
        terms[n] = -total       # what is left is summed in the next round
        n += 1


@inline
def put_product(terms, n, a, b):
    """Two terms for the number a·b from place n on; returns the next free place."""
    terms[n], terms[n + 1] = two_product(a, b)
    return n + 2


@inline
def put_products(terms, n, factor, a, b):
    """Terms for factor·a·b of two sequences of parts; the factor is a power of two, of either sign."""
    for x in a:
        for y in b:
            n = put_product(terms, n, factor * x, y)
    return n


@inline
def clear(sum_, noise):
    """Make an expansion 0 if it is but noise."""
    if abs(sum_[0]) <= noise:
        sum_[:] = 0.0


@kernel
def noise_of(f, d, far, speed, curved, steep, rest, noise):
    """What is noise in a, b, c and the discriminant of a form of second degree along f + s d, expansions (3, LONG) off by `noise`, NOISE or
    EXACT_NOISE, times `far` and `speed`. curved, steep, rest: the largest numbers of the form's parts of second, first and no degree."""
    out_of_line()
    size = np.sqrt(f[0, 0] ** 2 + f[1, 0] ** 2 + f[2, 0] ** 2)
    pace = np.sqrt(d[0, 0] ** 2 + d[1, 0] ** 2 + d[2, 0] ** 2)
    shift = -(f[0, 0] * d[0, 0] + f[1, 0] * d[1, 0] + f[2, 0] * d[2, 0]) / pace ** 2
    off_a = noise * curved * pace * speed
    off_b = noise * ((curved * size + steep) * speed + curved * pace * far)
    off_c = noise * ((curved * size + steep) * far + rest)
    # the discriminant is the same about the closest approach, where all is smaller
    size = np.sqrt((f[0, 0] + shift * d[0, 0]) ** 2 + (f[1, 0] + shift * d[1, 0]) ** 2 + (f[2, 0] + shift * d[2, 0]) ** 2)
    far += abs(shift) * speed
    slope = curved * size + steep
    off = 2 * slope * pace * noise * (slope * speed + curved * pace * far)
    off += curved * pace ** 2 * noise * (slope * far + rest) + (slope * size + rest) * off_a
    return off_a, off_b, off_c, off


@kernel
def solve_quadratic(a, b, c, noise, roots):
    """Real roots of a s² + 2 b s + c as pairs, roots[0] and roots[1]; a, b, c are expansions, and `noise` says below what they and the
    discriminant are 0. NaN where there are none or the form is 0 throughout, inf for one that a = 0 sends away. Returns the sign of the
    slope at roots[0], that at roots[1] is the opposite; 0 for a double root. Spoils a, b, c."""
    out_of_line()
    terms, square = np.empty(4 * LONG * LONG + LONG), np.empty(LONG)
    clear(a, noise[0])
    clear(b, noise[1])
    clear(c, noise[2])
    n = put_products(terms, 0, 1.0, b, b)
    n = put_products(terms, n, -1.0, a, c)
    expand(terms, n, square)
    clear(square, noise[3])
    roots[:, :] = np.nan
    if square[0] < 0:
        return 0.0
    if square[0] == 0 and a[0] != 0:
        q, q1 = divide(-b[0], -b[1], a[0], a[1])
        roots[:, 0], roots[:, 1] = q, q1
        return 0.0
    w, w1 = square_root(square[0], square[1])
    sign = 1.0 if b[0] >= 0 else -1.0
    w, e = two_sum(-b[0], -sign * w)
    w1 = e - b[1] - sign * w1
    if w == 0:      # a and b are 0
        return 0.0
    if a[0] != 0:
        roots[0, 0], roots[0, 1] = divide(w, w1, a[0], a[1])
    else:
        roots[0, 0], roots[0, 1] = np.inf, 0.0
    roots[1, 0], roots[1, 1] = divide(c[0], c[1], w, w1)
    return -sign
