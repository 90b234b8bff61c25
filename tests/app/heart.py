"""A heartbeat on the thread of the window: how long it did not answer, how much of that the machine gave it no time, and what ran."""
import os
import subprocess
import sys
import threading
import time
import traceback
from typing import NamedTuple

from PySide6.QtCore import QObject, Qt, QTimer, Slot

BEAT = 2            # ms between two beats
PATIENCE = 0.016    # s after which the stacks of all threads are noted


#: What an idle process does on one processor: it tells of every sleep that took too long, from when to when on the system's clock.
IDLE = """import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
last = time.perf_counter()
while os.getppid() != 1:
    time.sleep(0.002)
    now = time.perf_counter()
    if now - last > 0.004:
        print(last + 0.002, now, flush=True)
    last = now
"""


class Stall(NamedTuple):
    """A time without a beat: when, seconds it took, those of them in which the thread was ready to run and had no processor, those in which
    it ran, what was being done, the stacks of all threads after `PATIENCE` (none if nobody else could run Python then either), and the
    longest oversleep of an idle process meanwhile."""

    at: float
    took: float
    waited: float
    ran: float
    doing: str
    stacks: str
    asleep: float = 0.0

    @property
    def ours(self) -> float:
        """Seconds that are not the machine's fault: the thread ran, or waited for a lock."""
        return self.took - max(self.waited, self.asleep)


class Heart(QObject):
    """Beats on the thread that made it, from `start` to `stop`. `doing` is said by whoever drives the window."""

    def __init__(self, parent: QObject | None = None):
        super().__init__(parent)
        self.doing = ""
        self.beats: list[float] = []        # seconds between them, less `BEAT`
        self.stalls: list[Stall] = []       # those longer than `PATIENCE`
        self._idle = [subprocess.Popen([sys.executable, "-c", IDLE, str(cpu)], stdout=subprocess.PIPE, text=True)
                      for cpu in os.sched_getaffinity(0)]
        self._stacks = ""
        self._stopped = threading.Event()
        self._watch = threading.Thread(target=self._look, name="heart", daemon=True)
        self._clock = os.open(f"/proc/self/task/{threading.get_native_id()}/schedstat", os.O_RDONLY)
        self._timer = QTimer(self, interval=BEAT, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._beat)
        self._began = self._last = 0.0
        self._then = 0, 0

    def start(self):
        self._began = self._last = time.perf_counter()
        self._then = self._scheduled()
        self._timer.start()
        self._watch.start()

    def stop(self):
        self._timer.stop()
        self._stopped.set()
        self._watch.join()
        os.close(self._clock)
        late = []
        for process in self._idle:
            process.kill()
            late += [tuple(map(float, line.split())) for line in process.communicate()[0].splitlines()[:-1]]
        self.stalls = [stall._replace(at=stall.at - self._began, asleep=max(
            (min(end, stall.at) - max(start, stall.at - stall.took) for start, end in late
             if start < stall.at and end > stall.at - stall.took), default=0.0)) for stall in self.stalls]

    def _scheduled(self) -> tuple[int, int]:
        """Nanoseconds that this thread ran, and that it was ready to and had no processor."""
        ran, waited, _ = os.pread(self._clock, 64, 0).split()
        return int(ran), int(waited)

    def _look(self):
        """On a thread of its own: note the stacks of a stall while it lasts."""
        noted = 0.0
        while not self._stopped.wait(PATIENCE / 4):
            if time.perf_counter() - self._last > PATIENCE and noted != self._last:
                noted, names = self._last, {thread.ident: thread.name for thread in threading.enumerate()}
                frames = sys._current_frames()
                self._stacks = "\n".join(f"{names.get(ident, ident)}:\n" + "".join(traceback.format_stack(frames[ident], 12))
                                         for ident in frames if ident != threading.get_ident())
                frames.clear()

    @Slot()
    def _beat(self):
        now, then = time.perf_counter(), self._scheduled()
        took = now - self._last - BEAT / 1000
        self.beats.append(took)
        if took > PATIENCE:
            ran, waited = ((a - b) / 1e9 for a, b in zip(then, self._then))
            self.stalls.append(Stall(now, took, waited, ran, self.doing, self._stacks))
        self._last, self._then, self._stacks = now, then, ""
