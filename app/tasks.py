"""Work off the window's thread that is not rendering: files read and written, outlines, bounds."""
import queue
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import NamedTuple

from PySide6.QtCore import QObject, Qt, Signal, Slot


class Outcome(NamedTuple):
    """What a task came to, and who is to be told."""

    then: Callable
    value: object


class Tasks(QObject):
    """A thread for each task that runs, of which one stays for the next: Python waits until a new one runs, 0.6 to 5 ms where the render
    thread has its lock, and the window stands still meanwhile. `done` or `failed` is called on the window's thread; an exception is never
    lost."""

    _ended = Signal(object)
    crashed = Signal(str)       # a task that nobody handles the failure of: one line

    def __init__(self, parent: QObject | None = None):
        super().__init__(parent)
        self._threads: set[threading.Thread] = set()
        self._jobs: queue.SimpleQueue[tuple[Callable[[], None], str] | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._idle = False          # a thread waits for a job
        self._closed = False
        self._ended.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    def run(self, work: Callable[[], object], done: Callable[[object], None], failed: Callable[[Exception], None] | None = None,
            name: str = "task"):
        """Call `work()` on a thread, then `done(result)`, or `failed(error)`, here."""
        def body():
            try:
                outcome = Outcome(done, work())
            except Exception as error:
                if failed is None:
                    traceback.print_exception(error, file=sys.stderr)
                    outcome = Outcome(self.crashed.emit, " ".join(f"{type(error).__name__}: {error}".split()))
                else:
                    outcome = Outcome(failed, error)
            if not self._closed:
                self._ended.emit(outcome)

        with self._lock:
            idle, self._idle = self._idle, False
        self._jobs.put((body, name))
        if not idle:
            self._threads = {thread for thread in self._threads if thread.is_alive()}
            thread = threading.Thread(target=self._serve, daemon=True)
            self._threads.add(thread)
            thread.start()

    def _serve(self):
        """What a thread does: a task, and the next one, unless another thread waits for that already."""
        me = threading.current_thread()
        while (job := self._jobs.get()) is not None:
            body, me.name = job
            body()
            body = job = None       # what it holds may be large
            with self._lock:
                if self._idle or self._closed:
                    return
                self._idle, me.name = True, "task"

    @Slot(object)
    def _deliver(self, outcome: Outcome):
        if not self._closed:
            outcome.then(outcome.value)

    def close(self):
        """Wait for the threads, together at most a second; what is not done by then ends with the process."""
        with self._lock:
            self._closed = True
            idle, self._idle = self._idle, False
        if idle:
            self._jobs.put(None)
        deadline = time.monotonic() + 1.0
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
