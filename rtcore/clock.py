"""Where the time goes, told apart by what for: in Python, and in kernels that run one stage after the other."""
import ctypes
import sys
import time
from collections import Counter

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

WORD = ir.IntType(64)

if sys.platform == "win32":
    SYMBOL, _read, _each = "QueryPerformanceCounter", ctypes.windll.kernel32.QueryPerformanceCounter, ctypes.c_int64()
    ctypes.windll.kernel32.QueryPerformanceFrequency(ctypes.byref(_each))
    TICK = 1 / _each.value      # seconds
else:
    SYMBOL, _read, TICK = "clock_gettime", ctypes.CDLL(None).clock_gettime, 1e-9
llvmlite.binding.add_symbol(SYMBOL, ctypes.cast(_read, ctypes.c_void_p).value)


@intrinsic
def ticks(tc):
    """A clock that only goes forward, int64, in units of TICK; 30 ns."""
    def gen(ctx, b, sig, a):
        out = cgutils.alloca_once(b, ir.ArrayType(WORD, 2))
        first = b.bitcast(out, WORD.as_pointer())
        if sys.platform == "win32":
            b.call(_declared(b, [WORD.as_pointer()]), [first])
            return b.load(first)
        b.call(_declared(b, [ir.IntType(32), WORD.as_pointer()]), [ir.IntType(32)(time.CLOCK_MONOTONIC), first])
        seconds, rest = b.load(first), b.load(b.gep(first, [WORD(1)]))
        return b.add(b.mul(seconds, WORD(10 ** 9)), rest)
    return types.int64(), gen


def _declared(b, arguments):
    return cgutils.get_or_insert_function(b.module, ir.FunctionType(ir.IntType(32), arguments), SYMBOL)


class Clock:
    """Where one thread's time goes, in seconds by (stage of the plan, kernel group). A reading takes 0.1 us, against milliseconds of a step
    of a wave: it always runs."""

    def __init__(self):
        self._seconds: Counter[tuple[str, str]] = Counter()
        self._since = 0.0
        self._names: tuple = ()
        self.ticks = np.zeros(0, np.int64)      # what kernels have measured themselves

    def start(self) -> None:
        """What comes now counts, up to the next `lap`."""
        self._since = time.perf_counter()

    def lap(self, what: tuple[str, str]) -> None:
        """Since the last lap these kernels ran for this stage: (stage, kernel group)."""
        now = time.perf_counter()
        self._seconds[what] += now - self._since
        self._since = now

    def measure(self, names: tuple[tuple[str, str], ...]) -> np.ndarray:
        """Where kernels add their ticks, int64, one for each of the names, several of which may be the same."""
        if names is not self._names:
            self._seconds, self._names, self.ticks = self.seconds(), names, np.zeros(len(names), np.int64)
        return self.ticks

    def seconds(self) -> Counter:
        """All of it so far. Another thread may be adding to it."""
        total = Counter(dict(self._seconds))
        for name, spent in zip(self._names, self.ticks.tolist()):
            if spent:
                total[name] += spent * TICK
        return total
