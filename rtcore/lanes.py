"""Eight float lanes as a numba type, and three-vectors of them: kernels read like the scalar formula and become vector code.

`Lanes` (<8 x float> or <8 x double>) has + - * / with another or with a number, comparisons that give a `Mask`, and the functions
below. `Vec3` has three parts, each Lanes or a float64, with + - , * by a part or a number, `dot` and `cross`. Everything is one LLVM
instruction or a few; nothing depends on the auto-vectoriser, and nothing is reassociated.
"""
import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, make_attribute_wrapper, models, register_model

LANES = 8
I8, I32 = ir.IntType(8), ir.IntType(32)
REAL = {types.float32: ir.FloatType(), types.float64: ir.DoubleType()}


class Lanes(types.Type):
    """Eight floats of one type."""

    def __init__(self, elem):
        self.elem = elem
        super().__init__(f"lanes[{elem}]")


class Mask(types.Type):
    """Eight truth values."""

    def __init__(self):
        super().__init__("mask")


class Vec3(types.Type):
    """Three parts x, y, z of one type: Lanes or float64."""

    def __init__(self, part):
        self.part = part
        super().__init__(f"vec3[{part}]")


F32, F64, MASK = Lanes(types.float32), Lanes(types.float64), Mask()
LANES_OF = {types.float32: F32, types.float64: F64}
NUMBERS = (types.float64, types.int64)      # what a constant in a kernel's source has; it is brought to the lanes' own type


@register_model(Lanes)
class LanesModel(models.PrimitiveModel):
    def __init__(self, dmm, fe):
        super().__init__(dmm, fe, ir.VectorType(REAL[fe.elem], LANES))


@register_model(Mask)
class MaskModel(models.PrimitiveModel):
    def __init__(self, dmm, fe):
        super().__init__(dmm, fe, ir.VectorType(ir.IntType(1), LANES))


@register_model(Vec3)
class Vec3Model(models.StructModel):
    def __init__(self, dmm, fe):
        super().__init__(dmm, fe, [(k, fe.part) for k in "xyz"])


for _k in "xyz":
    make_attribute_wrapper(Vec3, _k, _k)


# --- building blocks in LLVM ---

def splatted(b, x):
    """LLVM: eight lanes of one value."""
    t = ir.VectorType(x.type, LANES)
    one = b.insert_element(ir.Constant(t, ir.Undefined), x, I32(0))
    return b.shuffle_vector(one, ir.Constant(t, ir.Undefined), ir.Constant(ir.VectorType(I32, LANES), [0] * LANES))


def _as(ctx, b, value, have, want):
    """A value of numba type `have` (a number or already right) as `want` (Lanes or float64)."""
    if have == want:
        return value
    elem = want.elem if isinstance(want, Lanes) else want
    value = ctx.cast(b, value, have, elem)
    return splatted(b, value) if isinstance(want, Lanes) else value


def llvm_math(b, name, *args):
    """An LLVM math intrinsic on scalars or vectors."""
    t = args[0].type
    scalar = t.element if isinstance(t, ir.VectorType) else t
    suffix = (f"v{t.count}" if isinstance(t, ir.VectorType) else "") + ("f32" if isinstance(scalar, ir.FloatType) else "f64")
    function = cgutils.get_or_insert_function(b.module, ir.FunctionType(t, [t] * len(args)), f"llvm.{name}.{suffix}")
    return b.call(function, args)


def _parts(ctx, b, t, value):
    v = cgutils.create_struct_proxy(t)(ctx, b, value=value)
    return v.x, v.y, v.z


def vec3_of(ctx, b, t, parts):
    v = cgutils.create_struct_proxy(t)(ctx, b)
    v.x, v.y, v.z = parts
    return v._getvalue()


def _dot(b, p, q):
    return llvm_math(b, "fma", p[0], q[0], llvm_math(b, "fma", p[1], q[1], b.fmul(p[2], q[2])))


# --- operators ---

def _operator(op, cases, lower):
    infer_global(op)(type(f"Lanes_{op.__name__}", (ConcreteTemplate,), {"key": op, "cases": cases}))
    for case in cases:
        lower_builtin(op, *case.args)(lower)


def _pairs(v):
    elem = () if v.elem in NUMBERS else (v.elem,)
    return [(v, v), *((v, n) for n in (*NUMBERS, *elem)), *((n, v) for n in (*NUMBERS, *elem))]


def _lane_operator(op, build, result):
    def lower(ctx, b, sig, args):
        v = next(t for t in sig.args if isinstance(t, Lanes))
        return build(b, *(_as(ctx, b, a, t, v) for a, t in zip(args, sig.args)))
    _operator(op, [signature(result(v), *pair) for v in (F32, F64) for pair in _pairs(v)], lower)


ARITHMETIC = ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv"))
for _op, _name in ARITHMETIC:
    _lane_operator(_op, lambda b, x, y, _name=_name: getattr(b, _name)(x, y), lambda v: v)
for _op, _sign in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="), (operator.eq, "==")):
    _lane_operator(_op, lambda b, x, y, _sign=_sign: b.fcmp_ordered(_sign, x, y), lambda v: MASK)
for _op, _name in ((operator.and_, "and_"), (operator.or_, "or_"), (operator.xor, "xor")):
    _operator(_op, [signature(MASK, MASK, MASK)], lambda ctx, b, sig, args, _name=_name: getattr(b, _name)(*args))
_operator(operator.invert, [signature(MASK, MASK)], lambda ctx, b, sig, args: b.not_(args[0]))
_operator(operator.neg, [signature(v, v) for v in (F32, F64)], lambda ctx, b, sig, args: b.fneg(args[0]))

VECTORS = tuple(Vec3(part) for part in (F32, F64, types.float64))
for _op, _name in ARITHMETIC[:2]:
    def _lower(ctx, b, sig, args, _name=_name):
        t = sig.return_type
        return vec3_of(ctx, b, t, [getattr(b, _name)(p, q) for p, q in zip(_parts(ctx, b, t, args[0]), _parts(ctx, b, t, args[1]))])
    _operator(_op, [signature(v, v, v) for v in VECTORS], _lower)


def _scale(ctx, b, sig, args):
    t = sig.return_type
    at = 0 if sig.args[0] == t else 1
    factor = _as(ctx, b, args[1 - at], sig.args[1 - at], t.part)
    return vec3_of(ctx, b, t, [b.fmul(p, factor) for p in _parts(ctx, b, t, args[at])])


_operator(operator.mul, [signature(v, *pair) for v in VECTORS for n in {v.part, *NUMBERS} for pair in ((v, n), (n, v))], _scale)
_operator(operator.neg, [signature(v, v) for v in VECTORS],
          lambda ctx, b, sig, args: vec3_of(ctx, b, sig.args[0], [b.fneg(p) for p in _parts(ctx, b, sig.args[0], args[0])]))


# --- functions on lanes ---

@intrinsic
def fma(tc, x, y, z):
    """x·y + z rounded once. x, y, z: Lanes or numbers, at least one Lanes; or float64."""
    want = next((t for t in (x, y, z) if isinstance(t, Lanes)), types.float64)
    return want(x, y, z), lambda ctx, b, sig, a: llvm_math(b, "fma", *(_as(ctx, b, v, t, want) for v, t in zip(a, sig.args)))


@intrinsic
def root(tc, x):
    """Square root, correctly rounded; NaN below 0."""
    return x(x), lambda ctx, b, sig, a: llvm_math(b, "sqrt", a[0])


@intrinsic
def size(tc, x):
    """|x|."""
    return x(x), lambda ctx, b, sig, a: llvm_math(b, "fabs", a[0])


@intrinsic
def with_sign(tc, x, y):
    """|x| with the sign of y."""
    return x(x, x), lambda ctx, b, sig, a: llvm_math(b, "copysign", *a)


@intrinsic
def select(tc, mask, x, y):
    """x where the mask is set, else y; x and y: Lanes, Vec3, or one of them a number."""
    want = x if isinstance(x, (Lanes, Vec3)) else y

    def gen(ctx, b, sig, a):
        if isinstance(want, Vec3):
            return vec3_of(ctx, b, want, [b.select(a[0], p, q) for p, q in zip(_parts(ctx, b, want, a[1]), _parts(ctx, b, want, a[2]))])
        return b.select(a[0], _as(ctx, b, a[1], x, want), _as(ctx, b, a[2], y, want))
    return want(mask, x, y), gen


def _chosen(sign):
    def make(tc, x, y):
        want = x if isinstance(x, Lanes) else y

        def gen(ctx, b, sig, a):
            p, q = _as(ctx, b, a[0], x, want), _as(ctx, b, a[1], y, want)
            return b.select(b.fcmp_ordered(sign, p, q), p, q)
        return want(x, y), gen
    return make


@intrinsic
def least(tc, x, y):
    """The smaller one; y where either is NaN. One is Lanes, the other Lanes or a number."""
    return _chosen("<")(tc, x, y)


@intrinsic
def greatest(tc, x, y):
    """The larger one; y where either is NaN. One is Lanes, the other Lanes or a number."""
    return _chosen(">")(tc, x, y)


@intrinsic
def bits(tc, mask):
    """The mask as an integer, lane 0 lowest."""
    return types.int64(mask), lambda ctx, b, sig, a: b.zext(b.bitcast(a[0], I8), ir.IntType(64))


@intrinsic
def any_lane(tc, mask):
    """Whether any lane of the mask is set."""
    return types.boolean(mask), lambda ctx, b, sig, a: b.icmp_unsigned("!=", b.bitcast(a[0], I8), I8(0))


@intrinsic
def zero(tc, x):
    """Zeros of the type of the lanes x."""
    return x(x), lambda ctx, b, sig, a: ir.Constant(a[0].type, [0.0] * LANES)


@intrinsic
def splat(tc, number):
    """Eight lanes of one number, float32 or float64."""
    v = LANES_OF[number]
    return v(number), lambda ctx, b, sig, a: splatted(b, a[0])


@intrinsic
def narrow(tc, x):
    """Lanes rounded to float32."""
    return F32(x), lambda ctx, b, sig, a: a[0] if x == F32 else b.fptrunc(a[0], ir.VectorType(ir.FloatType(), LANES))


@intrinsic
def wide(tc, x):
    """Lanes, or the Lanes of a Vec3, as float64."""
    def gen(ctx, b, sig, a):
        to = ir.VectorType(ir.DoubleType(), LANES)
        if isinstance(x, Vec3):
            return vec3_of(ctx, b, Vec3(F64), [p if x.part == F64 else b.fpext(p, to) for p in _parts(ctx, b, x, a[0])])
        return a[0] if x == F64 else b.fpext(a[0], to)
    return (Vec3(F64) if isinstance(x, Vec3) else F64)(x), gen


@intrinsic
def rounded(tc, x, like):
    """Float64 lanes rounded to the type of the lanes `like`."""
    return like(x, like), lambda ctx, b, sig, a: a[0] if like == F64 else b.fptrunc(a[0], ir.VectorType(ir.FloatType(), LANES))


# --- three-vectors ---

@intrinsic
def vec3(tc, x, y, z):
    """A Vec3 of three Lanes, or of three numbers as float64."""
    t = Vec3(x if isinstance(x, Lanes) else types.float64)
    return t(x, y, z), lambda ctx, b, sig, a: vec3_of(ctx, b, t, [_as(ctx, b, v, have, t.part) for v, have in zip(a, sig.args)])


@intrinsic
def dot(tc, p, q):
    """p·q with two fused steps."""
    return p.part(p, q), lambda ctx, b, sig, a: _dot(b, _parts(ctx, b, p, a[0]), _parts(ctx, b, q, a[1]))


@intrinsic
def cross(tc, p, q):
    """p x q."""
    def gen(ctx, b, sig, a):
        u, v = _parts(ctx, b, p, a[0]), _parts(ctx, b, q, a[1])
        turns = ((1, 2), (2, 0), (0, 1))
        return vec3_of(ctx, b, p, [llvm_math(b, "fma", u[j], v[k], b.fneg(b.fmul(u[k], v[j]))) for j, k in turns])
    return p(p, q), gen


@intrinsic
def along(tc, p, t, d):
    """p + t·d, each part fused. t: the vectors' part type."""
    def gen(ctx, b, sig, a):
        return vec3_of(ctx, b, p, [llvm_math(b, "fma", a[1], v, u) for u, v in zip(_parts(ctx, b, p, a[0]), _parts(ctx, b, d, a[2]))])
    return p(p, t, d), gen


# --- memory ---

def place_of(ctx, b, sig, args, elem, width):
    """Pointer to `width` elements at [row, column] of a C-contiguous 2-D array, or at [i] of a 1-D one."""
    array = ctx.make_array(sig.args[0])(ctx, b, args[0])
    index = args[1]
    if sig.args[0].ndim == 2:
        columns = cgutils.unpack_tuple(b, array.shape)[1]
        index = b.add(b.mul(args[1], columns), args[2])
    p = b.gep(array.data, [index])
    return b.bitcast(p, ir.VectorType(elem, width).as_pointer()) if width > 1 else p


@intrinsic
def load(tc, array, row, i):
    """Eight floats array[row, i .. i+7] of a C-contiguous array (rows, n)."""
    v = LANES_OF[array.dtype]
    return v(array, types.intp, types.intp), lambda ctx, b, sig, a: b.load(place_of(ctx, b, sig, a, REAL[v.elem], LANES), align=4)


@intrinsic
def load3(tc, array, row, i):
    """Vec3 of the eight floats in each of the rows row, row+1, row+2 from column i."""
    v = LANES_OF[array.dtype]

    def gen(ctx, b, sig, a):
        rows = [b.add(a[1], ir.Constant(a[1].type, k)) for k in range(3)]
        return vec3_of(ctx, b, Vec3(v), [b.load(place_of(ctx, b, sig, (a[0], r, a[2]), REAL[v.elem], LANES), align=4) for r in rows])
    return Vec3(v)(array, types.intp, types.intp), gen


@intrinsic
def splat3(tc, array, p, k):
    """Vec3 of lanes that all hold array[p, k], array[p, k+1], array[p, k+2]."""
    v = LANES_OF[array.dtype]

    def gen(ctx, b, sig, a):
        start = place_of(ctx, b, sig, a, REAL[v.elem], 1)
        return vec3_of(ctx, b, Vec3(v), [splatted(b, b.load(b.gep(start, [I32(j)]))) for j in range(3)])
    return Vec3(v)(array, types.intp, types.intp), gen


@intrinsic
def store(tc, array, row, i, x):
    """array[row, i .. i+7] = x."""
    def gen(ctx, b, sig, a):
        b.store(a[3], place_of(ctx, b, sig, a, REAL[x.elem], LANES), align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, types.intp, x), gen


@intrinsic
def fill(tc, array, i, number):
    """array[i .. i+7] = number; int32 array."""
    def gen(ctx, b, sig, a):
        b.store(splatted(b, b.trunc(a[2], I32)), place_of(ctx, b, sig, a, I32, LANES), align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, types.intp), gen


@intrinsic
def exceeds(tc, array, i, number):
    """Mask of the lanes where the int32 array[i + lane] > number."""
    def gen(ctx, b, sig, a):
        ids = b.load(place_of(ctx, b, sig, a, I32, LANES), align=4)
        return b.icmp_signed(">", ids, splatted(b, b.trunc(a[2], I32)))
    return MASK(array, types.intp, types.intp), gen


@intrinsic
def store_where(tc, array, i, mask, number):
    """array[i + lane] = number in the lanes of the mask; int32 array."""
    def gen(ctx, b, sig, a):
        p = place_of(ctx, b, sig, a, I32, LANES)
        b.store(b.select(a[2], splatted(b, b.trunc(a[3], I32)), b.load(p, align=4)), p, align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, mask, types.intp), gen


@intrinsic
def add_where(tc, array, i, mask, number):
    """array[i + lane] += number in the lanes of the mask; int32 array."""
    def gen(ctx, b, sig, a):
        p = place_of(ctx, b, sig, a, I32, LANES)
        zero = ir.Constant(ir.VectorType(I32, LANES), [0] * LANES)
        b.store(b.add(b.load(p, align=4), b.select(a[2], splatted(b, b.trunc(a[3], I32)), zero)), p, align=4)
        return ctx.get_dummy_value()
    return types.void(array, types.intp, mask, types.intp), gen
