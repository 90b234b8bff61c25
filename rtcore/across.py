"""Across the lanes: what eight of them come to, which of a mask are set."""
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from rtcore.lanes import F32, I8, REAL


def _reduced(name):
    def make(tc, x):
        suffix = "v8f32" if x == F32 else "v8f64"

        def gen(ctx, b, sig, a):
            t = ir.FunctionType(REAL[x.elem], [a[0].type])
            return b.call(cgutils.get_or_insert_function(b.module, t, f"llvm.vector.reduce.{name}.{suffix}"), a)
        return x.elem(x), gen
    return make


@intrinsic
def smallest(tc, x):
    """The smallest of the eight, a number."""
    return _reduced("fmin")(tc, x)


@intrinsic
def largest(tc, x):
    """The largest of the eight, a number."""
    return _reduced("fmax")(tc, x)


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
