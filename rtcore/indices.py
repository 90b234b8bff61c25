"""Eight whole numbers at a time: which rows of a table the lanes mean, and what stands there."""
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from rtcore.jit import inline
from rtcore.lanes import F64, I8, I32, LANES, MASK, REAL, place_of, splatted, vec3

WHOLE = ir.VectorType(I32, LANES)


class Index(types.Type):
    """Eight int32."""

    def __init__(self):
        super().__init__("index")


INDEX = Index()


@register_model(Index)
class IndexModel(models.PrimitiveModel):
    def __init__(self, dmm, fe):
        super().__init__(dmm, fe, WHOLE)


def _same(b, number):
    """An integer in all lanes, as int32."""
    return splatted(b, b.trunc(number, I32))


def _each(b, elem, load):
    """The vector of what `load` gives for each lane."""
    made = ir.Constant(ir.VectorType(elem, LANES), ir.Undefined)
    for lane in range(LANES):
        made = b.insert_element(made, load(I32(lane)), I32(lane))
    return made


def _place(ctx, b, table, array, index, lane, column=None):
    """Pointer to the element of a C-contiguous array that lane `lane` of the index means; of a 2-D one in this column."""
    made = ctx.make_array(table)(ctx, b, array)
    at = b.sext(b.extract_element(index, lane), ir.IntType(64))
    if column is not None:
        at = b.add(b.mul(at, cgutils.unpack_tuple(b, made.shape)[1]), column)
    return b.gep(made.data, [at])


@intrinsic
def among(tc, array, i, first, last):
    """Mask of the lanes where first <= array[i + lane] < last; int32 array."""
    def gen(ctx, b, sig, a):
        numbers = b.load(place_of(ctx, b, sig, a, I32, LANES), align=4)
        return b.and_(b.icmp_signed(">=", numbers, _same(b, a[2])), b.icmp_signed("<", numbers, _same(b, a[3])))
    return MASK(array, types.intp, types.intp, types.intp), gen


@intrinsic
def rows_of(tc, array, i, first, mask):
    """array[i + lane] - first in the lanes of the mask, 0 in the others, so that there is such a row; int32 array."""
    def gen(ctx, b, sig, a):
        numbers = b.sub(b.load(place_of(ctx, b, sig, a, I32, LANES), align=4), _same(b, a[2]))
        return b.select(a[3], numbers, ir.Constant(WHOLE, [0] * LANES))
    return INDEX(array, types.intp, types.intp, mask), gen


@intrinsic
def store_whole(tc, array, i, x):
    """array[i .. i+7] = the lanes x, which are whole numbers; int32 array."""
    def gen(ctx, b, sig, a):
        b.store(b.fptosi(a[2], WHOLE), place_of(ctx, b, sig, a, I32, LANES), align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, x), gen


@intrinsic
def chosen(tc, array, index):
    """array[index] in every lane; 1-D int32 array."""
    def gen(ctx, b, sig, a):
        return _each(b, I32, lambda lane: b.load(_place(ctx, b, array, a[0], a[1], lane)))
    return INDEX(array, index), gen


@intrinsic
def _lowest(tc, index):
    """What lane 0 means."""
    return types.intp(index), lambda ctx, b, sig, a: b.sext(b.extract_element(a[0], I32(0)), ir.IntType(64))


@intrinsic
def _alike(tc, index):
    """Whether all lanes mean the same row."""
    def gen(ctx, b, sig, a):
        first = b.shuffle_vector(a[0], a[0], ir.Constant(WHOLE, [0] * LANES))
        return b.icmp_signed("==", b.bitcast(b.icmp_signed("==", a[0], first), I8), I8(255))
    return types.boolean(index), gen


@inline
def common(index):
    """The row that all lanes mean, -1 if they mean several. `pick` and `flagged` take such a number in place of an index: one load and not
    eight. Neighbouring rays mostly meet the same thing."""
    return _lowest(index) if _alike(index) else -1


@inline
def common_chosen(array, index):
    """`common(chosen(array, index))`."""
    return np.intp(array[_lowest(index)]) if _alike(index) else common(chosen(array, index))


@intrinsic
def pick(tc, array, index, column):
    """array[index, column] as float64 lanes; array: float32 or float64, 2-D, C-contiguous; index: an Index, or a row for all lanes."""
    elem = REAL[array.dtype]

    def gen(ctx, b, sig, a):
        if index == INDEX:
            x = _each(b, elem, lambda lane: b.load(_place(ctx, b, array, a[0], a[1], lane, a[2])))
        else:
            x = splatted(b, b.load(place_of(ctx, b, sig, a, elem, 1)))
        return x if array.dtype == types.float64 else b.fpext(x, ir.VectorType(ir.DoubleType(), LANES))
    return F64(array, INDEX if index == INDEX else types.intp, types.intp), gen


@inline
def pick3(array, index, column):
    """Vec3 of `pick` from three columns on."""
    return vec3(pick(array, index, column), pick(array, index, column + 1), pick(array, index, column + 2))


@intrinsic
def flagged(tc, array, index, flag):
    """Mask of the lanes where array[index] has a bit of `flag` set; 1-D int8 array; index as for `pick`."""
    def gen(ctx, b, sig, a):
        if index == INDEX:
            sides = _each(b, I8, lambda lane: b.load(_place(ctx, b, array, a[0], a[1], lane)))
        else:
            sides = splatted(b, b.load(place_of(ctx, b, sig, a, I8, 1)))
        return b.icmp_signed("!=", b.and_(sides, splatted(b, b.trunc(a[2], I8))), ir.Constant(sides.type, [0] * LANES))
    return MASK(array, INDEX if index == INDEX else types.intp, types.intp), gen


@intrinsic
def put(tc, array, row, i, mask, x):
    """array[row, i + lane] = x in the lanes of the mask, rounded to the array's type; x: float64 lanes."""
    elem = REAL[array.dtype]

    def gen(ctx, b, sig, a):
        p = place_of(ctx, b, sig, a, elem, LANES)
        value = a[4] if array.dtype == types.float64 else b.fptrunc(a[4], ir.VectorType(elem, LANES))
        b.store(b.select(a[3], value, b.load(p, align=4)), p, align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, types.intp, mask, F64), gen


@inline
def put3(array, row, i, mask, v):
    """`put` of a Vec3 of float64 lanes into three rows."""
    put(array, row, i, mask, v.x)
    put(array, row + 1, i, mask, v.y)
    put(array, row + 2, i, mask, v.z)
