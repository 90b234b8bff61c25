"""Steps of the walk without a branch: which rays meet a box, which of its children first, and whether the next is a leaf, no processor
guesses, and each wrong guess costs as much as the step itself.
"""
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from rtcore.lanes import F32, I8, MASK, llvm_math
from rtcore.pyramid import HIGHS, INVERSE, LOWS, REACH

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
def prefetch_either(tc, which, x, i, y, z, j):
    """Have the processor fetch what will be read soon: the first four cache lines of row i of x if `which`, else the first two of row j of
    y and of row j of z, or four of y where z has no columns. All 2-D, C-contiguous."""
    def gen(ctx, b, sig, args):
        def place(k, row):
            array = ctx.make_array(sig.args[k])(ctx, b, args[k])
            columns = cgutils.unpack_tuple(b, array.shape)[1]
            return b.bitcast(b.gep(array.data, [b.mul(row, columns)]), I8.as_pointer()), columns
        (node, _), (first, _), (second, columns) = place(1, args[2]), place(3, args[5]), place(4, args[5])
        second = b.select(b.icmp_signed("==", columns, I64(0)), b.gep(first, [I32(128)]), second)
        t = ir.FunctionType(ir.VoidType(), [node.type, I32, I32, I32])
        function = cgutils.get_or_insert_function(b.module, t, "llvm.prefetch.p0i8")
        for line in range(4):
            other = b.gep(first if line < 2 else second, [I32(64 * (line % 2))])
            b.call(function, [b.select(args[0], b.gep(node, [I32(64 * line)]), other), I32(0), I32(3), I32(1)])
        return ctx.get_dummy_value()
    return types.void(types.boolean, x, types.intp, y, z, types.intp), gen


class Sets(types.Type):
    """Eight sets of up to 64 rays, one for each child of a node: eight int64, bit k for ray k."""

    def __init__(self):
        super().__init__("sets")


SETS = Sets()
WIDE = ir.VectorType(I64, 8)


@register_model(Sets)
class SetsModel(models.PrimitiveModel):
    def __init__(self, dmm, fe):
        super().__init__(dmm, fe, WIDE)


@intrinsic
def empty_sets(tc):
    """Sets with no ray in them."""
    return SETS(), lambda ctx, b, sig, a: ir.Constant(WIDE, [0] * 8)


@intrinsic
def joined(tc, sets, mask, ray):
    """The sets after a ray, given as an int64 with its bit, has joined those of the mask."""
    def gen(ctx, b, sig, a):
        bit = b.insert_element(ir.Constant(WIDE, ir.Undefined), a[2], I32(0))
        bit = b.shuffle_vector(bit, bit, ir.Constant(ir.VectorType(I32, 8), [0] * 8))
        return b.select(a[1], b.or_(a[0], bit), a[0])
    return SETS(sets, mask, types.int64), gen


@intrinsic
def keep(tc, array, sets):
    """array[0 .. 7] = the sets; int64 array."""
    def gen(ctx, b, sig, a):
        b.store(a[1], b.bitcast(ctx.make_array(array)(ctx, b, a[0]).data, WIDE.as_pointer()), align=8)
        return ctx.get_dummy_value()
    return types.void(array, sets), gen


@intrinsic
def octets(tc, rays):
    """Which of the eight bytes of an int64 are not 0, the lowest as bit 0."""
    def gen(ctx, b, sig, a):
        parts = b.bitcast(a[0], ir.VectorType(I8, 8))
        return b.zext(b.bitcast(b.icmp_signed("!=", parts, ir.Constant(parts.type, [0] * 8)), I8), I64)
    return types.int64(types.int64), gen


@intrinsic
def ones(tc, number):
    """How many bits of an int64 are set."""
    def gen(ctx, b, sig, a):
        return b.call(cgutils.get_or_insert_function(b.module, ir.FunctionType(I64, [I64]), "llvm.ctpop.i64"), [a[0]])
    return types.int64(number), gen


@intrinsic
def meeting(tc, coarse, box, row, column):
    """Which of the 64 rays of a packet, as `Walk.coarse` has them, meet the box in column `column` of the six rows from `row` on: an int64,
    bit k for ray k. Sixteen at a time, which is one instruction where a processor's vectors are that long and two where not."""
    many, packet = 16, 64
    lanes = ir.VectorType(ir.FloatType(), many)

    def gen(ctx, b, sig, a):
        rays, boxes = ctx.make_array(coarse)(ctx, b, a[0]), ctx.make_array(box)(ctx, b, a[1])
        columns = cgutils.unpack_tuple(b, boxes.shape)[1]

        def splat(part):
            number = b.load(b.gep(boxes.data, [b.add(b.mul(b.add(a[2], I64(part)), columns), a[3])]))
            one = b.insert_element(ir.Constant(lanes, ir.Undefined), number, I32(0))
            return b.shuffle_vector(one, one, ir.Constant(ir.VectorType(I32, many), [0] * many))

        def least(x, y):
            return b.select(b.fcmp_ordered("<", x, y), x, y)

        def greatest(x, y):
            return b.select(b.fcmp_ordered(">", x, y), x, y)
        planes, met = [splat(part) for part in range(6)], I64(0)
        for start in range(0, packet, many):
            def load(part, start=start):
                return b.load(b.bitcast(b.gep(rays.data, [I64(part * packet + start)]), lanes.as_pointer()), align=4)
            near, far = ir.Constant(lanes, [0.0] * many), load(REACH)
            for axis in range(3):
                inverse = load(INVERSE + axis)
                u = llvm_math(b, "fma", planes[axis], inverse, load(LOWS + axis))
                v = llvm_math(b, "fma", planes[3 + axis], inverse, load(HIGHS + axis))
                near, far = greatest(least(u, v), near), least(greatest(u, v), far)
            mask = b.bitcast(b.fcmp_ordered("<=", near, far), ir.IntType(many))
            met = b.or_(met, b.shl(b.zext(mask, I64), I64(start)))
        return met
    return types.int64(coarse, box, types.intp, types.intp), gen
