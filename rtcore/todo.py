"""What is to be traced in a pass: threads take from it, one tile after the other, until nothing is left."""
from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

NO_PIXELS = np.zeros((0, 3), np.int32)

#: Places in Todo.counters: tiles that have been taken, those of them that are done.
TAKEN, FINISHED = range(2)


class Todo(NamedTuple):
    """All of a pass; its threads share it."""

    tiles: np.ndarray       # int64 (m, 8), see `schedule.tiles`
    pixels: np.ndarray      # int32 (k, 3) as `eye.cast_list` takes them: the tiles are parts of this list; length 0: there is none
    counters: np.ndarray    # int64 (2), as named above


def new_todo(tiles: np.ndarray, pixels: np.ndarray | None = None) -> Todo:
    """Nothing of it is taken yet."""
    return Todo(tiles, NO_PIXELS if pixels is None else pixels, np.zeros(2, np.int64))


@intrinsic
def count_one(tc, counters, which):
    """Count one more, and return how many there were before; int64. Of threads that do so at once each gets another number."""
    def gen(ctx, b, sig, a):
        place = b.gep(ctx.make_array(counters)(ctx, b, a[0]).data, [a[1]])
        return b.atomic_rmw("add", place, ir.Constant(ir.IntType(64), 1), "seq_cst")
    return types.int64(counters, types.intp), gen
