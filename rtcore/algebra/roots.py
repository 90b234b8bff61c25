"""Real roots of polynomials with whole coefficients, exact: how many, of which multiplicity, in which order, and the nearest float.

A root is a `Rational`, a `Surd` (irrational, of a quadratic) or an `Isolated` one (of anything else: the only one in an interval between
neighbouring dyadic numbers, which narrows as far as it is asked to). All three answer
    cell(shift)     the whole number n with n <= root · 2^shift < n + 1, and whether it is equal
    sign_of(q)      the sign of a polynomial q at the root, 0 only where q is 0 there
"""
import functools
import math
from fractions import Fraction

from rtcore.algebra.polynomials import (Poly, changes_at, derivative, gcd, primitive, real_root_count, scaled, sign, square_free, sturm,
                                        value)


class Rational(Fraction):
    """A rational root."""

    __slots__ = ()

    def cell(self, shift: int) -> tuple[int, bool]:
        above, below = (self.numerator << shift, self.denominator) if shift >= 0 else (self.numerator, self.denominator << -shift)
        n, rest = divmod(above, below)
        return n, not rest

    def sign_of(self, q: Poly) -> int:
        result, power = 0, 1
        for c in reversed(q):
            result = result * self.numerator + c * power
            power *= self.denominator
        return sign(result)


class Irrational:
    """What `Surd` and `Isolated` share: `poly` has no multiple root, and this one."""

    __slots__ = ()

    def sign_of(self, q: Poly) -> int:
        shift = 16
        while True:
            n, exact = self.cell(shift)
            middle = value(q, n, shift)
            # the slope's greatest size over the cell, whose width is 1 on the scale of n
            most = abs(n) + 1
            slope = value([abs(c) for c in derivative(q)], most, shift) if not exact else 0
            if abs(middle) > slope or exact:
                return sign(middle)
            if shift == 128 and self.solves(gcd(self.poly, q)):
                return 0
            shift *= 2


class Surd(Irrational):
    """The lower (branch -1) or upper (1) root of the primitive quadratic c + b t + a t², a > 0, whose discriminant is no square."""

    __slots__ = ("poly", "branch", "square")

    def __init__(self, poly: Poly, branch: int, square: int):
        self.poly, self.branch, self.square = poly, branch, square

    def cell(self, shift: int) -> tuple[int, bool]:
        _, b, a = self.poly
        up = max(shift, 0)
        root = math.isqrt(self.square << 2 * up)
        n = ((-b << up) + (root if self.branch > 0 else -root - 1)) // (2 * a)
        return n >> up - shift, False

    def solves(self, divisor: Poly) -> bool:
        """Whether it is a root of this divisor of `poly`."""
        return len(divisor) == 3


class Isolated(Irrational):
    """The only root of `poly`, strictly between n / 2^shift and (n + 1) / 2^shift. It narrows by quadratic interval refinement (Abbott,
    *Quadratic Interval Refinement for Real Roots*, 2006): a secant picks one of 2^k parts; the more often it was right, the finer."""

    __slots__ = ("poly", "n", "shift", "exact", "low", "high", "bits")

    def __init__(self, poly: Poly, n: int, shift: int):
        self.poly, self.n, self.shift, self.exact, self.bits = poly, n, shift, False, 1
        self.low, self.high = value(poly, n, shift), value(poly, n + 1, shift)

    def cell(self, shift: int) -> tuple[int, bool]:
        while self.shift < shift and not self.exact:
            self._narrow(min(self.bits, shift - self.shift))
        if self.shift <= shift:
            return self.n << shift - self.shift, self.exact
        n = self.n >> self.shift - shift
        return n, self.exact and n << self.shift - shift == self.n

    def _narrow(self, k: int) -> None:
        """Try for a cell 2^k times as narrow."""
        shift = self.shift + k
        part = (abs(self.low) << k) // (abs(self.low) + abs(self.high))
        at = (self.n << k) + max(1, min((1 << k) - 1, part))
        here = value(self.poly, at, shift)
        above = (here > 0) == (self.low > 0)
        other = at + 1 if above else at - 1
        there = value(self.poly, other, shift)
        if not here or not there:
            self.n, self.shift, self.exact = other if here else at, shift, True
        elif (here > 0) == (there > 0):
            self.bits = k // 2
        else:
            self.n, self.shift, self.bits = min(at, other), shift, 2 * k
            self.low, self.high = (here, there) if above else (there, here)

    def solves(self, divisor: Poly) -> bool:
        """Whether it is a root of this divisor of `poly`."""
        if self.exact:
            return not value(divisor, self.n, self.shift)
        return len(divisor) > 1 and (value(divisor, self.n, self.shift) > 0) != (value(divisor, self.n + 1, self.shift) > 0)


Root = Rational | Surd | Isolated


def real_roots(p: Poly) -> list[tuple[Root, int]]:
    """The real roots of a polynomial, ascending, with their multiplicities; none for a constant, 0 included."""
    p = primitive(p)
    if len(p) <= 3:
        return _up_to_two(p)
    chain = sturm(p)
    if not real_root_count(chain):
        return []
    if len(chain[-1]) == 1:
        return [(root, 1) for root in _isolated(chain)]
    found = []
    for factor, multiplicity in square_free(p):
        found += [(root, multiplicity) for root in (_isolated(sturm(factor)) if len(factor) > 3 else (r for r, _ in _up_to_two(factor)))]
    return sorted(found, key=functools.cmp_to_key(lambda a, b: compare(a[0], b[0])))


def _up_to_two(p: Poly) -> list[tuple[Root, int]]:
    """Roots of a primitive polynomial of degree 2 at most."""
    if len(p) < 2:
        return []
    if len(p) == 2:
        return [(Rational(-p[0], p[1]), 1)]
    c, b, a = p = p if p[2] > 0 else scaled(p, -1)
    square = b * b - 4 * a * c
    if square <= 0:
        return [(Rational(-b, 2 * a), 2)] if square == 0 else []
    root = math.isqrt(square)
    if root * root == square:
        return [(Rational(-b - root, 2 * a), 1), (Rational(-b + root, 2 * a), 1)]
    return [(Surd(p, -1, square), 1), (Surd(p, 1, square), 1)]


def _isolated(chain: list[Poly]) -> list[Root]:
    """The roots of a polynomial without multiple ones, ascending, by halving and Sturm's theorem."""
    p = chain[0]
    last = len(p) - 1
    # all roots are within ± 2^bound (Fujiwara 1916)
    bound = 2 + max((-((p[-1].bit_length() - 1 - c.bit_length()) // (last - i)) for i, c in enumerate(p[:-1]) if c), default=0)
    ends = [changes_at(chain, n, -bound) for n in (-1, 0, 1)]
    stack, found = [(0, -bound, ends[1], ends[2]), (-1, -bound, ends[0], ends[1])], []
    while stack:
        n, shift, low, high = stack.pop()       # the roots in (n, n + 1] / 2^shift: low - high
        if low == high:
            continue
        if low - high == 1:
            if not value(p, n + 1, shift):
                found.append(Rational(n + 1, 1 << shift) if shift > 0 else Rational(n + 1 << -shift))
                continue
            if value(p, n, shift):
                found.append(Isolated(p, n, shift))
                continue
        middle = changes_at(chain, 2 * n + 1, shift + 1)
        stack += [(2 * n + 1, shift + 1, middle, high), (2 * n, shift + 1, low, middle)]
    return found


def compare(a: Root, b: Root) -> int:
    """-1, 0 or 1 as a is less than, equal to or greater than b. Two `Isolated` ones have to be different numbers."""
    if isinstance(b, Rational):
        return a.sign_of([-b.numerator, b.denominator])
    if isinstance(a, Rational):
        return -compare(b, a)
    if isinstance(a, Surd) and isinstance(b, Surd):
        if a.poly == b.poly:
            return sign(a.branch - b.branch)
    elif isinstance(a, Surd):
        return -compare(b, a)
    elif isinstance(b, Surd) and a.sign_of(b.poly) == 0 and a.sign_of(derivative(b.poly)) == b.branch:
        return 0
    shift = 16
    while (i := a.cell(shift)[0]) == (j := b.cell(shift)[0]):
        shift *= 2
    return sign(i - j)


def nearest(root: Root, power: int, digits: int, lowest: int) -> float:
    """root · 2^power rounded to the nearest multiple of a power of two, not below 2^lowest, with this many binary digits, ties to even.
    What no float64 can hold is ± inf."""
    shift = 64
    while True:
        n, exact = root.cell(shift)
        if exact or n.bit_length() > digits + 2:
            break
        shift += digits + 4 - n.bit_length() if n not in (0, -1) else shift
    # a digit more says that there is a rest: n / 2^shift < root < (n + 1) / 2^shift, where no tie can be
    n, power = 2 * n + (not exact), power - shift - 1
    drop = max(abs(n).bit_length() - digits, lowest - power)
    if drop > 0:
        whole, rest = divmod(abs(n), 1 << drop)
        half = 1 << drop - 1
        whole += rest > half or (rest == half and whole & 1)
        n, power = whole if n > 0 else -whole, power + drop
    try:
        return math.ldexp(n, power)
    except OverflowError:
        return math.inf if n > 0 else -math.inf
