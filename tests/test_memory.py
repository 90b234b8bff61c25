"""Large arrays from one piece of memory."""
import gc
import mmap
import weakref

import numpy as np
import pytest

from rtcore import memory
from rtcore.memory import ALIGNED, LEAST, PAGE, carved, room


@pytest.mark.parametrize("scale", [0, 1, 7, 5000, 300_001])
def test_arrays_have_the_shape_and_room_of_their_own(scale):
    wanted = (((3, scale), np.float64), ((scale,), np.uint8), ((scale, 2), np.int32), ((2 * scale,), np.float32))
    arrays = carved(*wanted)
    for number, ((shape, dtype), array) in enumerate(zip(wanted, arrays)):
        assert array.shape == shape and array.dtype == dtype and array.flags.c_contiguous and array.flags.writeable
        assert array.size == 0 or array.ctypes.data % ALIGNED == 0
        array.fill(number + 1)
    assert all((array == number + 1).all() for number, array in enumerate(arrays))


@pytest.mark.parametrize("size", [0, 1, LEAST - 1, LEAST, PAGE, PAGE + 1, 3 * PAGE])
def test_room_is_as_large_as_asked_for(size):
    piece = room(size)
    piece.fill(7)
    assert piece.shape == (size,) and piece.dtype == np.uint8 and (size == 0 or piece.ctypes.data % ALIGNED == 0)


@pytest.mark.parametrize("lacking", ["pages", "flag"])
def test_it_does_without_large_pages(lacking, monkeypatch):
    if lacking == "flag":
        monkeypatch.delattr(mmap, "MADV_HUGEPAGE", raising=False)
    else:
        monkeypatch.setattr(memory.mmap, "MADV_HUGEPAGE", -1, raising=False)        # which no system knows
    piece = room(PAGE)
    piece.fill(1)
    assert piece.shape == (PAGE,)


def test_memory_goes_with_the_last_array():
    first, second = carved(((LEAST,), np.uint8), ((4,), np.int32))
    base = first
    while isinstance(base.base, np.ndarray):
        base = base.base
    gone = weakref.ref(base)
    del first, base
    gc.collect()
    second[:] = 3       # still there
    assert gone() is not None and second.tolist() == [3] * 4
    del second
    gc.collect()
    assert gone() is None
