"""Work off the window's thread that is not rendering: files read and written, outlines, bounds."""
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
    """A short-lived thread a task. `done` or `failed` is called on the window's thread; an exception is never lost."""

    _ended = Signal(object)
    crashed = Signal(str)       # a task that nobody handles the failure of: one line

    def __init__(self, parent: QObject | None = None):
        super().__init__(parent)
        self._threads: set[threading.Thread] = set()
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

        self._threads = {thread for thread in self._threads if thread.is_alive()}
        thread = threading.Thread(target=body, name=name, daemon=True)
        self._threads.add(thread)
        thread.start()

    @Slot(object)
    def _deliver(self, outcome: Outcome):
        if not self._closed:
            outcome.then(outcome.value)

    def close(self):
        """Wait for the threads, together at most a second; what is not done by then ends with the process."""
        self._closed = True
        deadline = time.monotonic() + 1.0
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
