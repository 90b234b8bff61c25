"""Sums of many floats as if in some hundred digits, and quadratics solved with them: the slow way out where pairs can't be certain.

Products are split into two exact terms each and summed by repeated error-free passes (Ogita, Rump, Oishi, *Accurate Sum and Dot Product*,
SIAM J. Sci. Comput. 26:6, 2005); an expansion is the LONG leading parts of such a sum, about 200 bits. All for single rays.
"""
import numpy as np

from rtcore.jit import inline, kernel, out_of_line
from rtcore.pairs import divide, square_root, two_product, two_sum

LONG = 4        # parts of an expansion


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


@kernel
def solve_quadratic(a, b, c, roots):
    """Real roots of a s² + 2 b s + c as pairs, roots[0] and roots[1]; a, b, c are expansions. NaN where there are none or the form is 0
    throughout, inf for one that a = 0 sends away. Returns the sign of the slope at roots[0], that at roots[1] is the opposite."""
    out_of_line()
    terms, square = np.empty(4 * LONG * LONG + LONG), np.empty(LONG)
    n = put_products(terms, 0, 1.0, b, b)
    n = put_products(terms, n, -1.0, a, c)
    expand(terms, n, square)
    roots[:, :] = np.nan
    if square[0] < 0:
        return 0.0
    w, w1 = square_root(square[0], square[1])
    sign = 1.0 if b[0] >= 0 else -1.0
    w, e = two_sum(-b[0], -sign * w)
    w1 = e - b[1] - sign * w1
    if w == 0:      # b and the discriminant are 0
        if a[0] != 0:
            roots[:, :] = 0.0
        return 0.0
    if a[0] != 0:
        roots[0, 0], roots[0, 1] = divide(w, w1, a[0], a[1])
    else:
        roots[0, 0], roots[0, 1] = np.inf, 0.0
    roots[1, 0], roots[1, 1] = divide(c[0], c[1], w, w1)
    return -sign if square[0] > 0 else 0.0
