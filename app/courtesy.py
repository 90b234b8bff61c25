"""Python's lock is left to the window's thread while that has something to do.

A thread that waits for the lock gets it after SWITCH, and so does the one that it was taken from: where the render thread packs shapes,
which is Python's work, the window's thread has half of the time at most. 8 ms of an edit then took 20 to 30.
"""
import contextlib
import os
import platform
import threading
import time

WAIT, WORK = 0.008, 0.004       # s: at most so long at a time, and then at least so long of work, or a busy window would have no picture
LOOK = 0.0005

#: Numbers of the system calls poll, ppoll, epoll_wait, epoll_pwait and epoll_pwait2, in which an events' loop sleeps.
SLEEPS = {"x86_64": (7, 271, 232, 281, 441), "aarch64": (73, 22, 441)}.get(platform.machine(), ())


class Courtesy:
    """Knows whether the thread on which it is made, the window's, is at something: anything but waiting for events. Qt could tell so only
    by calling Python with each event, which waits for that very lock; Linux tells in 4 us which system call a thread is in. Elsewhere the
    window's thread is taken to be idle."""

    def __init__(self):
        self._worked = 0.0
        self._file = -1
        with contextlib.suppress(OSError):
            if SLEEPS:
                self._file = os.open(f"/proc/self/task/{threading.get_native_id()}/syscall", os.O_RDONLY | os.O_CLOEXEC)

    def busy(self) -> bool:
        """Whether it is; any thread may ask."""
        if self._file < 0:
            return False
        try:
            call = os.pread(self._file, 64, 0).split()[0]
        except OSError:
            return False
        return call == b"running" or call.isdigit() and int(call) not in SLEEPS

    def give_way(self):
        """Wait until it is not, if need be and not for long: for another thread, in the midst of what is Python's work."""
        now = time.monotonic()
        if now - self._worked < WORK or not self.busy():
            return
        while self.busy() and time.monotonic() - now < WAIT:
            time.sleep(LOOK)
        self._worked = time.monotonic()

    def close(self):
        """Ask no more."""
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)
