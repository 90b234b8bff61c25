"""The render worker: owns the one render thread, runs the latest job, and keeps the newest frame for whoever paints."""
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from PySide6.QtCore import QObject, Qt, Signal, Slot

from app.compiling import Compiler, Compiling
from app.courtesy import Courtesy
from app.engine import Engine, Job
from app.outline import Outline, trace_outline

if TYPE_CHECKING:
    from rtcore.progressive import Frame

NICE = 10           # by how much the window's thread goes before those that trace, where all processors are busy
PATIENCE = 1.0      # s that a step of a drag may take to its first pass though a newer step waits; else a fast drag would show nothing


class Shown(NamedTuple):
    """A frame ready to paint: (h, w, 4) uint8 B, G, R, 255, the frame itself, what was asked for and the selection's outline."""

    bytes: np.ndarray
    frame: "Frame"
    job: Job
    outline: Outline | None


class Worker(QObject):
    """Latest job wins. Frames are tone-mapped here, into the spare one of three buffers: one is painted, one is newest, one is written."""

    newest = Signal()           # there is a frame to take; sent once until it is taken
    progressed = Signal()       # `compiling` changed
    failed = Signal(str)        # one line; the whole story is on stderr
    _submitted = Signal()       # comes round when its thread is done with what it is at

    def __init__(self, renderer_factory: Callable[[], Engine] | None = None, compiler: Compiler | None = None,
                 parent: QObject | None = None):
        super().__init__(parent)
        self.compiling: Compiling | None = None
        self._courtesy = Courtesy()
        self._factory = renderer_factory or (lambda: Engine(self._courtesy.give_way))
        self._compiler = compiler or Compiler()
        self._wake = threading.Condition()
        self._next: Job | None = None
        self._running: Job | None = None
        self._halted: Job | None = None         # stopped by a pause, to be gone on with
        self._dropped = False                   # what runs is not to be gone on with
        self._paused = self._closing = False
        self._free = True                       # the window's thread is not in the midst of something
        self._submitted.connect(self._begin, Qt.ConnectionType.QueuedConnection)
        self._latest: Shown | None = None       # the last frame, whether taken or not; the render thread's own
        self._newest: Shown | None = None
        self._announced = False
        self._spares: list[np.ndarray] = [np.empty((0, 0, 4), np.uint8)] * 3
        self._painted: Shown | None = None
        self._span: tuple[int, int] | None = None
        self._width = 2
        self._thread = threading.Thread(target=self._run, name="render", daemon=True)
        self._thread.start()

    def submit(self, job: Job):
        """Render this next, once the window's thread comes back to its events: panels that tell of the change would take twice as long to
        do so if the render thread ran Python meanwhile. What runs now ends, what waits is forgotten."""
        with self._wake:
            self._next = job
            running = self._running
            if self._free:
                self._free = False
                self._submitted.emit()
        if self.compiling is not None and running is not None and running.document != job.document:
            self._compiler.kill()

    def drop(self):
        """End what runs and forget what waits: another job is to come."""
        with self._wake:
            self._next = self._halted = None
            self._dropped = True

    @Slot()
    def _begin(self):
        with self._wake:
            self._free = True
            self._wake.notify()

    def pause(self, on: bool):
        """Stop refining as soon as every pixel has a sample, and stay so with later jobs; or go on where it was stopped."""
        with self._wake:
            self._paused = on
            self._wake.notify()

    def take(self) -> Shown | None:
        """The newest frame, if one came since the last call. It is the caller's until the next call that returns one."""
        with self._wake:
            self._announced = False
            shown, self._newest = self._newest, None
            if shown is not None:
                if self._painted is not None:
                    self._spares.append(self._painted.bytes)
                self._painted = shown
            return shown

    def outline(self, span: tuple[int, int] | None, width: int = 2):
        """Which leaves (first, one past the last) coming frames outline, and how wide in pixels."""
        with self._wake:
            self._span, self._width = span, width

    def close(self):
        """End the thread; at most a second."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._compiler.kill()
        self._thread.join(1.0)
        self._courtesy.close()

    # the render thread

    def _run(self):
        engine = None
        if sys.platform == "linux":
            os.nice(NICE)       # there, of this thread and those that it starts: the picture's
        try:
            engine = self._factory()
            while (job := self._await_job()) is not None:
                try:
                    self._render(engine, job)
                except Exception as error:
                    self._report(error)
        except Exception as error:
            self._report(error)
        finally:
            if engine is not None:
                engine.close()

    def _await_job(self) -> Job | None:
        with self._wake:
            self._running = None
            self._wake.wait_for(lambda: self._closing or self._free and (
                self._next is not None or (self._halted is not None and not self._paused)))
            self._running, self._next, self._halted = self._next or self._halted, None, None
            self._dropped = False
            return None if self._closing else self._running

    def _render(self, engine: Engine, job: Job):
        latest = self._latest
        if latest is not None and latest.frame.done and job.looks_like(latest.job) and job.options != latest.job.options:
            return self._show(engine, latest.frame, job)     # the light is the same
        request = engine.request(job)
        if names := engine.missing(job):
            self._compile(names)
            with self._wake:
                if self._next is not None or self._closing:
                    return      # somebody moved on while the helper worked
        if job.anew:
            engine.forget()
        started, shown, whole = time.monotonic(), 0, False

        def cancelled() -> bool:
            if self._closing or self._dropped:
                return True
            newer = self._next
            if newer is None:
                return self._paused and whole
            return shown > 0 or not newer.continues or time.monotonic() - started > PATIENCE

        for frame in engine.frames(request, cancelled, job.continues):
            self._show(engine, frame, job)
            shown, whole = shown + 1, frame.samples > 0
            if cancelled():
                break
        if whole and not frame.done:
            with self._wake:
                self._halted = None if self._dropped else job._replace(anew=False)

    def _compile(self, names: list[str]):
        def progress(state: Compiling | None):
            self.compiling = state
            self.progressed.emit()

        try:
            complaint = self._compiler.compile(names, progress)
        finally:
            progress(None)
        if complaint and not self._closing:
            print(f"rayscope: compiling ahead failed: {complaint}", file=sys.stderr)
            self.failed.emit(f"Compiling ahead failed ({complaint}); the first picture will take longer.")

    def _show(self, engine: Engine, frame: "Frame", job: Job):
        with self._wake:
            spare = self._spares.pop() if self._spares else np.empty((0, 0, 4), np.uint8)
            span, width = self._span, self._width
        if spare.shape[:2] != frame.pixels.shape[:2]:
            spare = np.empty((*frame.pixels.shape[:2], 4), np.uint8)
        engine.encode(frame.pixels, spare, job.options.gain())
        self._latest = shown = Shown(spare, frame, job, trace_outline(frame.node, span, width) if span else None)
        with self._wake:
            if self._newest is not None:
                self._spares.append(self._newest.bytes)
            self._newest = shown
            announce, self._announced = not self._announced, True
        if announce:
            self.newest.emit()

    def _report(self, error: Exception):
        traceback.print_exception(error, file=sys.stderr)
        self.failed.emit(" ".join(f"Rendering failed: {error or type(error).__name__}".split()))
