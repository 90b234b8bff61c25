"""Eight neighbours in arrays that have no rows of lanes: lists of numbers, and lists of pixels with three channels each."""
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from rtcore.lanes import F32, I32, LANES, LANES_OF, REAL, Vec3, place_of, splatted, vec3_of

WHOLE = ir.VectorType(I32, LANES)
COUNTING = ir.Constant(WHOLE, list(range(LANES)))
TWICE = ir.Constant(ir.VectorType(I32, 2 * LANES), list(range(2 * LANES)))     # one vector after the other, as one


@intrinsic
def consecutive(tc, array, i):
    """Whether array[i + k] = array[i] + k for k up to 7; int32 array."""
    def gen(ctx, b, sig, a):
        numbers = b.load(place_of(ctx, b, sig, a, I32, LANES), align=4)
        first = b.shuffle_vector(numbers, numbers, ir.Constant(WHOLE, [0] * LANES))
        same = b.icmp_signed("==", numbers, b.add(first, COUNTING))
        return b.icmp_signed("==", b.bitcast(same, ir.IntType(8)), ir.Constant(ir.IntType(8), 255))
    return types.boolean(array, types.intp), gen


@intrinsic
def count_up(tc, array, i, first, step):
    """array[i + k] = first + k step for k up to 7; int32 array."""
    def gen(ctx, b, sig, a):
        start, apart = (splatted(b, b.trunc(number, I32)) for number in a[2:])
        b.store(b.add(start, b.mul(apart, COUNTING)), place_of(ctx, b, sig, a, I32, LANES), align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, types.intp, types.intp), gen


@intrinsic
def copy(tc, to, i, array, j):
    """to[i .. i+7] = array[j .. j+7]; int32 arrays."""
    def gen(ctx, b, sig, a):
        def place(k):
            return b.bitcast(b.gep(ctx.make_array(sig.args[k])(ctx, b, a[k]).data, [a[k + 1]]), WHOLE.as_pointer())
        b.store(b.load(place(2), align=4), place(0), align=4)
        return ctx.get_dummy_value()
    return types.void(to, types.intp, array, types.intp), gen


def _by_turns(b, x, y):
    """x0 y0 x1 y1 ... as two vectors."""
    orders = [[LANES * (k % 2) + (part + k) // 2 for k in range(LANES)] for part in (0, LANES)]
    return [b.shuffle_vector(x, y, ir.Constant(WHOLE, order)) for order in orders]


@intrinsic
def copy_twice(tc, to, i, array, j):
    """to[i], to[i+1] = array[j], to[i+2], to[i+3] = array[j+1] and so on for eight of array; int32 arrays."""
    def gen(ctx, b, sig, a):
        p = b.bitcast(b.gep(ctx.make_array(array)(ctx, b, a[2]).data, [a[3]]), WHOLE.as_pointer())
        numbers = b.load(p, align=4)
        for part, value in enumerate(_by_turns(b, numbers, numbers)):
            at = b.add(a[1], ir.IntType(64)(LANES * part))
            b.store(value, place_of(ctx, b, sig, (a[0], at), I32, LANES), align=4)
        return ctx.get_dummy_value()
    return types.void(to, types.intp, array, types.intp), gen


@intrinsic
def store_by_turns(tc, array, row, i, x, y):
    """array[row, i + 2k], array[row, i + 2k + 1] = x, y of lane k; array of the lanes' type."""
    def gen(ctx, b, sig, a):
        for part, value in enumerate(_by_turns(b, a[3], a[4])):
            at = b.add(a[2], ir.IntType(64)(LANES * part))
            b.store(value, place_of(ctx, b, sig, (a[0], a[1], at), REAL[x.elem], LANES), align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, types.intp, x, x), gen


@intrinsic
def load1(tc, array, i):
    """Eight floats array[i .. i+7]."""
    v = LANES_OF[array.dtype]
    return v(array, types.intp), lambda ctx, b, sig, a: b.load(place_of(ctx, b, sig, a, REAL[v.elem], LANES), align=4)


@intrinsic
def store1(tc, array, i, x):
    """array[i .. i+7] = x."""
    def gen(ctx, b, sig, a):
        b.store(a[2], place_of(ctx, b, sig, a, REAL[x.elem], LANES), align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, x), gen


@intrinsic
def load_flat(tc, array, i):
    """Eight floats of a C-contiguous array, from the i-th in memory."""
    v = LANES_OF[array.dtype]

    def gen(ctx, b, sig, a):
        start = b.gep(ctx.make_array(array)(ctx, b, a[0]).data, [a[1]])
        return b.load(b.bitcast(start, ir.VectorType(REAL[v.elem], LANES).as_pointer()), align=4)
    return v(array, types.intp), gen


@intrinsic
def store_flat(tc, array, i, x):
    """The same, to be written."""
    def gen(ctx, b, sig, a):
        start = b.gep(ctx.make_array(array)(ctx, b, a[0]).data, [a[1]])
        b.store(a[2], b.bitcast(start, a[2].type.as_pointer()), align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, x), gen


@intrinsic
def turns(tc, array, i):
    """1 where the int32 array[i + k] is even, -1 where it is odd, as float32 lanes."""
    def gen(ctx, b, sig, a):
        odd = b.and_(b.load(place_of(ctx, b, sig, a, I32, LANES), align=4), ir.Constant(WHOLE, [1] * LANES))
        return b.sitofp(b.sub(ir.Constant(WHOLE, [1] * LANES), b.add(odd, odd)), ir.VectorType(ir.FloatType(), LANES))
    return F32(array, types.intp), gen


@intrinsic
def add_one(tc, array, i):
    """array[i + k] += 1 for k up to 7; int32 array."""
    def gen(ctx, b, sig, a):
        p = place_of(ctx, b, sig, a, I32, LANES)
        b.store(b.add(b.load(p, align=4), ir.Constant(WHOLE, [1] * LANES)), p, align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp), gen


@intrinsic
def load_triples(tc, array, i):
    """Vec3 of x, y, z = array[i + k] in lane k; array (n, 3), C-contiguous."""
    v = LANES_OF[array.dtype]

    def gen(ctx, b, sig, a):
        start = b.gep(ctx.make_array(array)(ctx, b, a[0]).data, [b.mul(a[1], ir.IntType(64)(3))])
        places = [b.bitcast(b.gep(start, [I32(LANES * k)]), ir.VectorType(REAL[v.elem], LANES).as_pointer()) for k in range(3)]
        eight = [b.load(place, align=4) for place in places]
        # of 24 at once, LLVM makes 24 single ones
        both, last = (b.shuffle_vector(x, y, TWICE) for x, y in (eight[:2], eight[2:] * 2))
        parts = [b.shuffle_vector(both, last, ir.Constant(WHOLE, list(range(part, 3 * LANES, 3)))) for part in range(3)]
        return vec3_of(ctx, b, Vec3(v), parts)
    return Vec3(v)(array, types.intp), gen


def _triples(add):
    def make(tc, array, i, x, y, z):
        def gen(ctx, b, sig, a):
            # the numbers in the order of memory: x0 y0 z0 x1 ...
            both, last = b.shuffle_vector(a[2], a[3], TWICE), b.shuffle_vector(a[4], a[4], TWICE)
            for part in range(3):
                order = [(LANES * channel if channel < 2 else 2 * LANES) + k
                         for k, channel in (divmod(LANES * part + j, 3) for j in range(LANES))]
                value = b.shuffle_vector(both, last, ir.Constant(WHOLE, order))
                at = b.add(b.mul(a[1], ir.IntType(64)(3)), ir.IntType(64)(8 * part))
                start = b.gep(ctx.make_array(sig.args[0])(ctx, b, a[0]).data, [at])
                p = b.bitcast(start, value.type.as_pointer())
                b.store(b.fadd(b.load(p, align=4), value) if add else value, p, align=4)
            return ctx.get_dummy_value()
        return types.void(array, types.intp, x, y, z), gen
    return make


@intrinsic
def store_triples(tc, array, i, x, y, z):
    """array[i + k] = x, y, z of lane k; array (n, 3), C-contiguous, of the lanes' type."""
    return _triples(False)(tc, array, i, x, y, z)


@intrinsic
def add_triples(tc, array, i, x, y, z):
    """array[i + k] += x, y, z of lane k, as for `store_triples`."""
    return _triples(True)(tc, array, i, x, y, z)
