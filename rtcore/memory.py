"""Memory for large arrays. The system hands it out page by page when it is first touched, 2 to 8 us each, which was a tenth and more of a
process's only picture; asked for in pages of 2 MiB, it is there five hundred times sooner.
"""
import contextlib
import math
import mmap

import numpy as np

PAGE = 1 << 21      # bytes
LEAST = 1 << 18     # for less a whole page would be more to clear than to touch
ALIGNED = 64        # bytes at which arrays cut from one piece begin: a line of the cache


def room(size: int) -> np.ndarray:
    """So many bytes with nothing set, uint8, that begin with a line of the cache."""
    if size < LEAST or not hasattr(mmap, "MADV_HUGEPAGE"):      # not on Linux
        piece = np.empty(size + ALIGNED, np.uint8)
        skip = -piece.ctypes.data % ALIGNED
        return piece[skip:skip + size]
    piece = mmap.mmap(-1, -(-size // PAGE) * PAGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    with contextlib.suppress(OSError):      # a system that has none: then it is memory as any
        piece.madvise(mmap.MADV_HUGEPAGE)
    return np.frombuffer(piece, np.uint8, size)


def carved(*wanted: tuple) -> list[np.ndarray]:
    """C-contiguous arrays of these (shape, dtype) with nothing set, from one piece of memory."""
    sizes = [-(-math.prod(shape) * np.dtype(dtype).itemsize // ALIGNED) * ALIGNED for shape, dtype in wanted]
    piece, ends = room(sum(sizes)), np.cumsum(sizes)
    return [piece[end - size:end].view(dtype)[:math.prod(shape)].reshape(shape) for (shape, dtype), size, end in zip(wanted, sizes, ends)]
