"""Two ways to the real roots of a quartic x⁴ + a x³ + b x² + c x + d."""
import numpy as np

from rtcore.jit import inline


@inline
def greatest_root(g, h, kind):
    """The greatest real root of z³ + g z + h in closed form: three cosines where there are three, else Cardano's."""
    third, half = g / kind(3), h / kind(2)
    inside = half * half + third * third * third
    if inside <= 0:
        size = np.sqrt(-third)
        if size == 0:
            return size
        ratio = min(max(-half / (size * size * size), kind(-1)), kind(1))
        return kind(2) * size * kind(np.cos(np.arccos(ratio) / kind(3)))
    w = np.sqrt(inside)
    u = kind(np.cbrt(-half - w if half > 0 else -half + w))
    return u - third / u


@inline
def put_ferrari(a, b, c, d, roots, count, i):
    """Ferrari: the depressed quartic as a difference of squares, by a root of its resolvent cubic. Nothing is polished."""
    kind = roots.dtype.type
    shift = a / kind(4)
    square = shift * shift
    p = b - kind(6) * square
    q = c - kind(2) * shift * b + kind(8) * square * shift
    r = d - shift * c + square * b - kind(3) * square * square
    k = p * p / kind(4) - r
    third = p / kind(3)
    m = greatest_root(k - p * third, kind(2) * third * third * third - third * k - q * q / kind(8), kind) - third
    n = 0
    if m > 0:
        s = np.sqrt(m + m)
        slope = (q + q) / s
        for sign in (kind(-1), kind(1)):
            inside = -(p + p + m + m + sign * slope)
            if inside >= 0:
                w = np.sqrt(inside)
                roots[i, n], roots[i, n + 1] = (sign * s - w) / kind(2) - shift, (sign * s + w) / kind(2) - shift
                n += 2
    else:       # q is 0: a quadratic in y²
        inside = p * p / kind(4) - r
        if inside >= 0:
            for sign in (kind(-1), kind(1)):
                y = sign * np.sqrt(inside) - p / kind(2)
                if y >= 0:
                    roots[i, n], roots[i, n + 1] = -np.sqrt(y) - shift, np.sqrt(y) - shift
                    n += 2
    count[i] = n


@inline
def changes(x, a, b, c, d, f2, f1, f0, g1, g0, last, kind):
    """Changes of sign in Sturm's sequence at x."""
    quartic = (((x + a) * x + b) * x + c) * x + d
    cubic = ((kind(4) * x + kind(3) * a) * x + kind(2) * b) * x + c
    n, before = 0, quartic
    for value in (cubic, (f2 * x + f1) * x + f0, g1 * x + g0, last):
        if value != 0:
            if (value < 0) != (before < 0):
                n += 1
            before = value
    return n


@inline
def put_sturm(a, b, c, d, roots, count, i):
    """Sturm: each root is bisected for until two neighbouring numbers enclose it."""
    kind = roots.dtype.type
    # minus the remainders of the divisions of each by the next
    f2 = kind(3) * a * a / kind(16) - b / kind(2)
    f1 = a * b / kind(8) - kind(3) * c / kind(4)
    f0 = a * c / kind(16) - d
    e3, e2, e1, e0 = kind(4), kind(3) * a, kind(2) * b, c
    m1 = e3 / f2
    m0 = (e2 - m1 * f1) / f2
    g1, g0 = -(e1 - m1 * f0 - m0 * f1), -(e0 - m0 * f0)
    k1 = f2 / g1
    last = -(f0 - (f1 - k1 * g0) / g1 * g0)
    bound = kind(1) + max(max(abs(a), abs(b)), max(abs(c), abs(d)))
    total = changes(-bound, a, b, c, d, f2, f1, f0, g1, g0, last, kind)
    n = total - changes(bound, a, b, c, d, f2, f1, f0, g1, g0, last, kind)
    n = min(max(n, 0), 4)
    for j in range(n):
        low, high = -bound, bound
        middle = (low + high) / kind(2)
        while low < middle < high:
            if total - changes(middle, a, b, c, d, f2, f1, f0, g1, g0, last, kind) > j:
                high = middle
            else:
                low = middle
            middle = (low + high) / kind(2)
        roots[i, j] = middle
    count[i] = n
