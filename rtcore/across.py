"""Across the lanes: what eight of them come to, which of a mask are set."""
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from rtcore.lanes import I8

I32 = ir.IntType(32)


def _halved(b, x, chosen):
    """One of the lanes: of either half's, chosen by comparison, until there is one. LLVM's own reduction goes lane after lane and looks for
    NaN each time: 40 cycles, where this takes 12."""
    many = x.type.count
    while many > 1:
        many //= 2
        low, high = (b.shuffle_vector(x, x, ir.Constant(ir.VectorType(I32, many), list(range(first, first + many)))) for first in (0, many))
        x = b.select(b.fcmp_ordered(chosen, low, high), low, high)
    return b.extract_element(x, I32(0))


@intrinsic
def smallest(tc, x):
    """The smallest of the eight, a number; none may be NaN."""
    return x.elem(x), lambda ctx, b, sig, a: _halved(b, a[0], "<")


@intrinsic
def largest(tc, x):
    """The largest of the eight, a number; none may be NaN."""
    return x.elem(x), lambda ctx, b, sig, a: _halved(b, a[0], ">")


@intrinsic
def lowest_bit(tc, number):
    """Number of the lowest bit that is set in an int64 other than 0."""
    def gen(ctx, b, sig, a):
        t = ir.IntType(64)
        count = cgutils.get_or_insert_function(b.module, ir.FunctionType(t, [t, ir.IntType(1)]), "llvm.cttz.i64")
        return b.call(count, [a[0], ir.Constant(ir.IntType(1), 1)])
    return types.int64(types.int64), gen


@intrinsic
def count(tc, mask):
    """How many lanes of the mask are set."""
    def gen(ctx, b, sig, a):
        t = ir.FunctionType(I8, [I8])
        return b.zext(b.call(cgutils.get_or_insert_function(b.module, t, "llvm.ctpop.i8"), [b.bitcast(a[0], I8)]), ir.IntType(64))
    return types.int64(mask), gen
