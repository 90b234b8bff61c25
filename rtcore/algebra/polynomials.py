"""Polynomials with whole coefficients, exact.

A polynomial is a list of Python integers, the constant first, the last one not 0; the empty list is 0. A value at n / 2^shift is given
times 2^(shift · degree), so that it is whole as well.
"""
import math

Poly = list[int]


def sign(n: int) -> int:
    return (n > 0) - (n < 0)


def trimmed(p: Poly) -> Poly:
    """Without leading zeros."""
    n = len(p)
    while n and not p[n - 1]:
        n -= 1
    return p[:n]


def primitive(p: Poly) -> Poly:
    """Trimmed, the coefficients divided by what they have in common; signs stay."""
    p = trimmed(p)
    common = math.gcd(*p)
    return [c // common for c in p] if common > 1 else p


def plus(p: Poly, q: Poly) -> Poly:
    if len(p) < len(q):
        p, q = q, p
    return trimmed([a + b for a, b in zip(p, q)] + p[len(q):])


def scaled(p: Poly, factor: int) -> Poly:
    return [factor * c for c in p] if factor else []


def times(p: Poly, q: Poly) -> Poly:
    if not p or not q:
        return []
    result = [0] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            result[i + j] += a * b
    return result


def derivative(p: Poly) -> Poly:
    return [i * c for i, c in enumerate(p)][1:]


def value(p: Poly, n: int, shift: int) -> int:
    """p(n / 2^shift) · 2^(shift · degree); for a shift below 0, p(n · 2^-shift)."""
    if shift < 0:
        n, shift = n << -shift, 0
    result, up = 0, 0
    for c in reversed(p):
        result = result * n + (c << up)
        up += shift
    return result


def rootless(p: Poly, low: int, high: int, shift: int) -> bool:
    """Whether p has no root from low / 2^shift to high / 2^shift, if it is easily seen: its value in the middle outweighs all the rest of
    its Taylor series there. For a shift of at least 0."""
    middle, half = low + high, high - low       # over 2^(shift + 1)
    series = [c << (shift + 1) * (len(p) - 1 - i) for i, c in enumerate(p)]
    for i in range(len(p) - 1):
        for k in range(len(p) - 2, i - 1, -1):
            series[k] += middle * series[k + 1]
    rest = 0
    for c in reversed(series[1:]):
        rest = (rest + abs(c)) * half
    return abs(series[0]) > rest


def remainder(a: Poly, b: Poly) -> Poly:
    """What is left of a after division by b, times some positive number that keeps it whole."""
    lead, a = b[-1], list(a)
    while len(a) >= len(b):
        factor, first = a[-1] if lead > 0 else -a[-1], len(a) - len(b)
        a = [abs(lead) * c for c in a[:-1]]
        for i, c in enumerate(b[:-1]):
            a[first + i] -= factor * c
        a = trimmed(a)
    return a


def quotient(a: Poly, b: Poly) -> Poly:
    """a / b where b is primitive and divides a."""
    a, result = list(a), [0] * (len(a) - len(b) + 1)
    for k in range(len(result) - 1, -1, -1):
        result[k] = factor = a[k + len(b) - 1] // b[-1]
        for i, c in enumerate(b):
            a[k + i] -= factor * c
    return result


def gcd(a: Poly, b: Poly) -> Poly:
    """The greatest common divisor, primitive."""
    a, b = primitive(a), primitive(b)
    while b:
        a, b = b, primitive(remainder(a, b))
    return a


def square_free(p: Poly) -> list[tuple[Poly, int]]:
    """The factors of p that have simple roots only, without common ones, and their multiplicities (Yun, *On Square-free Decomposition
    Algorithms*, 1976); p is not 0."""
    slope = derivative(p)
    common = gcd(p, slope)
    b, c, result, multiplicity = quotient(p, common), quotient(slope, common), [], 1
    while len(b) > 1:
        d = plus(c, scaled(derivative(b), -1))
        factor = gcd(b, d)
        if len(factor) > 1:
            result.append((factor, multiplicity))
        b, c, multiplicity = quotient(b, factor), quotient(d, factor) if d else [], multiplicity + 1
    return result


def sturm(p: Poly) -> list[Poly]:
    """Sturm's sequence: p, p', then each the negated remainder of the two before; the last is the gcd of p and p'."""
    chain = [p, primitive(derivative(p))]
    while len(chain[-1]) > 1:
        rest = primitive(remainder(chain[-2], chain[-1]))
        if not rest:
            break
        chain.append([-c for c in rest])
    return chain


def changes(values) -> int:
    """How often the sign changes in a sequence; zeros don't count."""
    before, count = 0, 0
    for x in values:
        if x:
            count += before != 0 and (x > 0) != (before > 0)
            before = x
    return count


def changes_at(chain: list[Poly], n: int, shift: int) -> int:
    """The sign changes of a Sturm sequence at n / 2^shift. From a to b it loses one for every root of p in (a, b]."""
    return changes(value(p, n, shift) for p in chain)


def real_root_count(chain: list[Poly]) -> int:
    """How many different real roots the first of a Sturm sequence has."""
    at_least = changes(p[-1] if len(p) % 2 else -p[-1] for p in chain)
    return at_least - changes(p[-1] for p in chain)
