"""References for the convergence panel: rendered on a thread of their own, kept by what they are of."""
import threading
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

from app.compiling import Compiler
from app.engine import Job
from app.runs import Subject

if TYPE_CHECKING:
    from rtcore.reports.convergence import Reference

KEPT = 4


def render(job: Job, samples: int, cancelled: Callable[[], bool], progress: Callable[[float], None],
           compiler: Compiler) -> "Reference | None":
    """Render the reference of a job's picture; None if cancelled. Kernels that the cache lacks are compiled by helper processes."""
    from rtcore.progressive import Renderer
    from rtcore.reports.convergence import refer
    from rtcore.settings import Settings
    from rtcore.warm import missing
    best = {"view": "beauty", "precision": "f64", "solver": "certain", "samples": samples}
    settings = Settings(size=job.size, **{**job.options.settings(), **best})
    if names := missing(job.scene, settings, camera=job.camera):
        compiler.compile(names, lambda state: None)
    renderer, found = Renderer(), None
    try:
        for step in refer(renderer, job.scene, job.camera, settings, samples, cancelled):
            progress(step.share)
            found = step.reference
    finally:
        renderer.close()
    return found


class Referring(QObject):
    """Renders one reference at a time. `reference(job)` is the one for a job's picture, if it is there."""

    progressed = Signal(float)
    ended = Signal(str)         # a complaint of one line; empty: there is a new reference, or it was stopped

    def __init__(self, renders=render, parent: QObject | None = None):
        super().__init__(parent)
        self._renders, self._compiler = renders, Compiler()
        self._kept: list[tuple[Subject, Reference]] = []
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()

    @property
    def running(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def reference(self, job: Job) -> "Reference | None":
        """The reference of a job's picture; None if there is none."""
        subject = Subject.of(job)
        return next((reference for kept, reference in self._kept if kept.matches(subject)), None)

    def start(self, job: Job, samples: int):
        """Render the reference of a job's picture."""
        if not self.running:
            self._stop.clear()
            self._thread = threading.Thread(target=self._work, args=(job, samples), name="reference", daemon=True)
            self._thread.start()

    def stop(self):
        """End the work; at most a second."""
        self._stop.set()
        self._compiler.kill()
        if self._thread is not None:
            self._thread.join(1.0)
            self._thread = None

    def _work(self, job: Job, samples: int):
        complaint = ""
        try:
            reference = self._renders(job, samples, self._stop.is_set, self.progressed.emit, self._compiler)
            if reference is not None:
                self._kept = [*self._kept[1 - KEPT:], (Subject.of(job), reference)]
        except Exception as error:
            traceback.print_exception(error)
            complaint = " ".join(f"{type(error).__name__}: {error}".split())
        if not self._stop.is_set():
            self.ended.emit(complaint)
