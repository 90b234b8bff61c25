"""Steps of rays that are walked in turns, without a branch: which children a ray meets, which of them first, and whether the next is a
leaf, no processor guesses, and each wrong guess costs as much as the step itself.
"""
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from rtcore.lanes import F32, I8, MASK

I32, I64 = ir.IntType(32), ir.IntType(64)
#: Batcher's odd-even merge sort of eight: the pairs that each step compares.
NETWORK = (((0, 1), (2, 3), (4, 5), (6, 7)), ((0, 2), (1, 3), (4, 6), (5, 7)), ((1, 2), (5, 6)),
           ((0, 4), (1, 5), (2, 6), (3, 7)), ((2, 4), (3, 5)), ((1, 2), (3, 4), (5, 6)))


def _vector(elem, numbers):
    return ir.Constant(ir.VectorType(elem, 8), list(numbers))


def _ordered(b, keys):
    """Eight int64, the largest first."""
    for step in NETWORK:
        partner = list(range(8))
        for low, high in step:
            partner[low], partner[high] = high, low
        other = b.shuffle_vector(keys, keys, _vector(I32, partner))
        first = _vector(ir.IntType(1), [any(k == low for low, _ in step) for k in range(8)])
        keys = b.select(b.xor(b.icmp_signed("<", keys, other), first), keys, other)
    return keys


@intrinsic
def push(tc, stack, slot, top, at, link, row, met):
    """Put what the lanes where `met` is set meet onto a stack, the nearest on top; returns how many they are.

    stack[slot, top ..]: int64, the high half the bits of `at`, a float32 of at least 0, whose order is that of the numbers; the low half
    the int32 link[row, lane]. Always eight are written: the row needs that room.
    """
    def gen(ctx, b, sig, a):
        def place(array, kind, row, column):
            columns = cgutils.unpack_tuple(b, array.shape)[1]
            return b.bitcast(b.gep(array.data, [b.add(b.mul(row, columns), column)]), ir.VectorType(kind, 8).as_pointer())
        waiting, links = (ctx.make_array(sig.args[k])(ctx, b, a[k]) for k in (0, 4))
        wide = ir.VectorType(I64, 8)
        near = b.zext(b.bitcast(a[3], ir.VectorType(I32, 8)), wide)
        child = b.zext(b.load(place(links, I32, a[5], I64(0)), align=4), wide)
        keys = b.or_(b.shl(near, _vector(I64, [32] * 8)), child)
        keys = _ordered(b, b.select(a[6], keys, _vector(I64, [-1] * 8)))
        b.store(keys, place(waiting, I64, a[1], a[2]), align=8)
        byte = ir.IntType(8)
        count = cgutils.get_or_insert_function(b.module, ir.FunctionType(byte, [byte]), "llvm.ctpop.i8")
        return b.zext(b.call(count, [b.bitcast(a[6], byte)]), I64)
    return types.int64(stack, types.intp, types.intp, F32, link, types.intp, MASK), gen


@intrinsic
def prefetch_either(tc, which, x, i, y, j):
    """Have the processor fetch the first four cache lines of row i of x if `which`, else of row j of y, which will be read soon. x and y:
    2-D, C-contiguous."""
    def gen(ctx, b, sig, args):
        def place(k):
            array = ctx.make_array(sig.args[k])(ctx, b, args[k])
            columns = cgutils.unpack_tuple(b, array.shape)[1]
            return b.bitcast(b.gep(array.data, [b.mul(args[k + 1], columns)]), ir.IntType(8).as_pointer())
        p = b.select(args[0], place(1), place(3))
        t = ir.FunctionType(ir.VoidType(), [p.type, I32, I32, I32])
        function = cgutils.get_or_insert_function(b.module, t, "llvm.prefetch.p0i8")
        for line in range(4):
            b.call(function, [b.gep(p, [I32(64 * line)]), I32(0), I32(3), I32(1)])
        return ctx.get_dummy_value()
    return types.void(types.boolean, x, types.intp, y, types.intp), gen


def _bytes(ctx, b, t, array):
    """Pointer to 64 bytes."""
    return b.bitcast(ctx.make_array(t)(ctx, b, array).data, ir.VectorType(I8, 64).as_pointer())


def _set(b, vector):
    """The bits of a vector's numbers other than 0, as an int64."""
    count = vector.type.count
    found = b.bitcast(b.icmp_signed("!=", vector, ir.Constant(vector.type, [0] * count)), ir.IntType(count))
    return found if count == 64 else b.zext(found, I64)


@intrinsic
def forget(tc, met):
    """Set an array of 64 bytes to 0."""
    def gen(ctx, b, sig, a):
        b.store(ir.Constant(ir.VectorType(I8, 64), [0] * 64), _bytes(ctx, b, met, a[0]), align=1)
        return ctx.get_dummy_value()
    return types.void(met), gen


@intrinsic
def which(tc, met, k):
    """An int64 with the bits set of those of 64 bytes that have bit k."""
    def gen(ctx, b, sig, a):
        bit = b.shl(I8(1), b.trunc(a[1], I8))
        t = ir.VectorType(I8, 64)
        bit = b.insert_element(ir.Constant(t, ir.Undefined), bit, I32(0))
        bit = b.shuffle_vector(bit, bit, ir.Constant(ir.VectorType(I32, 64), [0] * 64))
        return _set(b, b.and_(b.load(_bytes(ctx, b, met, a[0]), align=1), bit))
    return types.int64(met, types.intp), gen


@intrinsic
def octets(tc, mask):
    """Which of the eight bytes of an int64 are not 0, the lowest as bit 0."""
    return types.int64(types.int64), lambda ctx, b, sig, a: _set(b, b.bitcast(a[0], ir.VectorType(I8, 8)))
