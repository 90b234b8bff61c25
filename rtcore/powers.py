"""Powers of float64 lanes: numpy's, one by one, took a third of the time of lighting a glossy surface."""
from llvmlite import ir
from numba.extending import intrinsic

from rtcore.jit import inline
from rtcore.lanes import F64, LANES, fma, greatest, llvm_math, select, zero

LOG2_E, LN_2 = 1.4426950408889634, 0.6931471805599453
TINIEST = 2.0 ** -1022

I64 = ir.VectorType(ir.IntType(64), LANES)


def _whole(n):
    return ir.Constant(I64, [n] * LANES)


@intrinsic
def floor(tc, x):
    """The largest whole number that is not above x."""
    return x(x), lambda ctx, b, sig, a: llvm_math(b, "floor", a[0])


@intrinsic
def exponent(tc, x):
    """The whole number e with |x| = m 2^e, 1 <= m < 2, for normal float64 lanes."""
    def gen(ctx, b, sig, a):
        e = b.and_(b.lshr(b.bitcast(a[0], I64), _whole(52)), _whole(2047))
        return b.sitofp(b.sub(e, _whole(1023)), a[0].type)
    return F64(x), gen


@intrinsic
def mantissa(tc, x):
    """The m of `exponent`."""
    def gen(ctx, b, sig, a):
        m = b.and_(b.bitcast(a[0], I64), _whole((1 << 52) - 1))
        return b.bitcast(b.or_(m, _whole(1023 << 52)), a[0].type)
    return F64(x), gen


@intrinsic
def power_of_two(tc, n):
    """2^n for whole numbers n from -1022 to 1023."""
    def gen(ctx, b, sig, a):
        return b.bitcast(b.shl(b.add(b.fptosi(a[0], I64), _whole(1023)), _whole(52)), a[0].type)
    return F64(n), gen


@inline
def power(x, y):
    """x^y for lanes 0 <= x <= 2 and y >= 0, to within 1e-13, and 1e-10 of itself where it is above 2^-1000; 0^0 is 1.

    As 2^(y log2 x), the logarithm by the series of artanh."""
    seen = greatest(x, TINIEST)
    e, m = exponent(seen), mantissa(seen)
    large = m > 1.4142135623730951
    e, m = select(large, e + 1, e), select(large, 0.5 * m, m)
    s = (m - 1) / (m + 1)       # at most 0.172
    q = s * s
    series = fma(q, fma(q, fma(q, fma(q, fma(q, fma(q, fma(q, 1 / 15, 1 / 13), 1 / 11), 1 / 9), 1 / 7), 1 / 5), 1 / 3), 1)
    z = greatest(y * fma(2 * LOG2_E * s, series, e), -1000)
    return select(x > 0, two_to(z), select(y > 0, 0, 1 + zero(y)))


@inline
def two_to(z):
    """2^z for lanes -1000 <= z <= 1000, to within 1e-15 of itself, Taylor's series of the rest past a whole number."""
    n = floor(z + 0.5)
    f = (z - n) * LN_2          # at most 0.347
    rest = fma(f, fma(f, fma(f, fma(f, fma(f, fma(f, fma(f, fma(f, fma(f, fma(f, fma(f, 1 / 39916800, 1 / 3628800), 1 / 362880), 1 / 40320),
               1 / 5040), 1 / 720), 1 / 120), 1 / 24), 1 / 6), 0.5), 1), 1)
    return rest * power_of_two(n)


@inline
def decay(x):
    """exp(-x) for lanes x >= 0, to within 1e-13 of itself; 2^-1000 from 693 on."""
    return two_to(greatest(x * -LOG2_E, -1000))
