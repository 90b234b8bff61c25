"""Kernels that call kernels by their addresses, so that which ones are called is a matter of numbers and not of what was compiled.

numba's functions as values miss the cache on disk in every process, and a kernel that named all others would have to be compiled and loaded
with all of them. An address is a number like any other: the caller is compiled once for all scenes, and what a scene does not need is not
loaded. The other half of it are arguments of which there are any number, the tables of the kinds of shapes: arrays as rows of words in
memory, laid out as numba lays them out.
"""
from collections.abc import Callable

import numpy as np
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from rtcore.jit import kept, typed

SIZE = 2        # of an array's words the one that tells how many elements it has


def caller(function):
    """As `jit.kernel`, for one that makes no arrays: no references are counted, which for a hundred arrays would take longer than what it
    does itself."""
    return kept(njit(nogil=True, error_model="numpy", forceinline=False, _nrt=False)(function), function)


def address_of(kernel: Callable, arguments: tuple, result: types.Type = types.none) -> int:
    """Where a kernel's machine code for arguments like these begins. TypeError if it does not return what the caller takes it to."""
    signature = tuple(map(typed, arguments))
    kernel.compile(signature)
    compiled = kernel.overloads[signature]
    if compiled.signature.return_type != result:
        raise TypeError(f"{kernel.py_func.__qualname__} returns {compiled.signature.return_type}, not {result}")
    return compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)


def _calling(result):
    def make(tc, address, arguments):
        def gen(ctx, b, sig, a):
            convention, kinds = ctx.call_conv, arguments.types
            with cgutils.if_unlikely(b, cgutils.is_null(b, a[0])):
                convention.return_user_exc(b, RuntimeError, ("a kernel is called that was left out",))
            function = b.inttoptr(a[0], convention.get_function_type(result, kinds).as_pointer())
            values = [b.extract_value(a[1], k) for k in range(len(kinds))]
            status, value = convention.call_function(b, function, result, kinds, values)
            with cgutils.if_unlikely(b, status.is_error):
                convention.return_status_propagate(b, status)
            return value
        return result(address, arguments), gen
    return make


@intrinsic
def call(tc, address, arguments):
    """Call the kernel at an address with a tuple of arguments, of the very types that `address_of` was given; it returns nothing."""
    return _calling(types.none)(tc, address, arguments)


@intrinsic
def count_of(tc, address, arguments):
    """The same for one that returns an int64."""
    return _calling(types.int64)(tc, address, arguments)


def words_of(value) -> list[int]:
    """An array, or a NamedTuple of arrays and such, as `value_at` reads it. Who writes it down must hold on to the arrays."""
    if isinstance(value, np.ndarray):
        return [0, 0, value.size, value.itemsize, value.__array_interface__["data"][0], *value.shape, *value.strides]
    return [word for part in value for word in words_of(part)]


@intrinsic
def value_at(tc, words, row, like):
    """The value of which the words stand in a row of an int64 array (n, k), C-contiguous; of the type of `like`."""
    def gen(ctx, b, sig, a):
        array = ctx.make_array(words)(ctx, b, a[0])
        wide = b.mul(a[1], b.extract_value(array.shape, 1))
        kind = ctx.get_value_type(like)
        return b.load(b.bitcast(b.gep(array.data, [wide]), kind.as_pointer()), align=8)
    return like(words, types.intp, like), gen


def _words_in(kind: types.Type) -> int:
    """How many words `words_of` makes of a value of this type."""
    return 5 + 2 * kind.ndim if isinstance(kind, types.Array) else sum(map(_words_in, kind.types))


def rows_for(count: int, like) -> np.ndarray:
    """Room for the words of so many values like this one."""
    return np.zeros((count, _words_in(typed(like))), np.int64)

