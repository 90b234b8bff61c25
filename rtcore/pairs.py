"""Double-double arithmetic: a number as the unevaluated sum high + low of two float64, good for about 106 bits.

For float64 numbers and F64 lanes alike. Error bounds, in units of 2⁻¹⁰⁶ relative to the result, are those of Joldes, Muller, Popescu,
*Tight and Rigorous Error Bounds for Basic Building Blocks of Double-Word Arithmetic*, ACM TOMS 44:2 (2017).
"""
from rtcore.jit import inline
from rtcore.lanes import fma, root


@inline
def two_sum(a, b):
    """a + b exactly."""
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@inline
def ordered_sum(a, b):
    """a + b exactly where |a| >= |b| or a is 0."""
    s = a + b
    return s, b - (s - a)


@inline
def two_product(a, b):
    """a·b exactly, but for underflow."""
    p = a * b
    return p, fma(a, b, -p)


@inline
def add(a, a1, b, b1):
    """Sum of two pairs; error 3, relative to the sum even where it cancels."""
    s, e = two_sum(a, b)
    t, f = two_sum(a1, b1)
    s, e = ordered_sum(s, e + t)
    return ordered_sum(s, e + f)


@inline
def subtract(a, a1, b, b1):
    """Difference of two pairs; error 3, relative to the difference even where it cancels."""
    return add(a, a1, -b, -b1)


@inline
def multiply(a, a1, b, b1):
    """Product of two pairs; error 5."""
    p, e = two_product(a, b)
    return ordered_sum(p, fma(a, b1, fma(a1, b, e)))


@inline
def scale(a, a1, b):
    """Product of a pair and a number; error 3."""
    p, e = two_product(a, b)
    return ordered_sum(p, fma(a1, b, e))


@inline
def square(a, a1):
    """Square of a pair; error 5."""
    p, e = two_product(a, a)
    return ordered_sum(p, fma(2 * a, a1, e))


@inline
def divide(a, a1, b, b1):
    """Quotient of two pairs; error 10."""
    q = a / b
    p, e = scale(b, b1, q)
    r = (a - p) + (a1 - e)
    return ordered_sum(q, r / b)


@inline
def square_root(a, a1):
    """Square root of a pair, numbers only; error 4. 0 for 0, NaN below 0."""
    s = root(a)
    p, e = two_product(s, s)
    r = ((a - p) - e) + a1
    return ordered_sum(s, r / (2 * s)) if s > 0 else (s, 0.0)
