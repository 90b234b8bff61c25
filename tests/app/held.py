"""What the process of a window holds, before and after."""
import ctypes
import gc
import os
import sys
import threading

from numba.core.dispatcher import Dispatcher


class Held:
    """What the process holds: threads by name, MiB of memory, kernels' signatures."""

    def __init__(self):
        gc.collect()
        ctypes.CDLL(None).malloc_trim(0)        # what is free goes back to the system: pictures of other sizes leave holes
        self.threads = sorted(thread.name for thread in threading.enumerate())
        with open("/proc/self/statm", encoding="ascii") as file:
            self.memory = int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / (1 << 20)
        kernels = {id(value): value for module in list(sys.modules.values()) if getattr(module, "__name__", "").startswith("rtcore")
                   for value in vars(module).values() if isinstance(value, Dispatcher)}
        self.signatures = {(one.py_func.__qualname__, str(signature)) for one in kernels.values() for signature in one.signatures}
