"""Progressive rendering: a request becomes passes, each pass a Frame; a newer request makes the passes of the old one end.

Pass 0 is a lattice of pixels, each later one fills the lattice between; then come whole-picture samples 2, 3-4, 5-8 ... No sample is traced
twice, and each is added to its pixel in order, so the finished picture has the same bits for any number of threads and with or without the
coarse passes. How fine the first lattice is depends on how soon it has to be seen.
"""
import os
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

try:
    import resource
except ImportError:     # Windows
    resource = None

from rtcore.bounds import packed_bounds
from rtcore.edits import ANEW, KEPT, TOUCHED, Change, casting, change
from rtcore.flatten import DTYPES, Geometry, flatten, packed_in, renumbering
from rtcore.keep import Memory
from rtcore.levels import NO_BOXES, UNKNOWN
from rtcore.pace import Pace
from rtcore.picture import PARTIAL, Frame as Frame, Render, RenderRequest, Start
from rtcore.plan import Plan, plan
from rtcore.scene import Scene
from rtcore.schedule import COARSEST, LATTICES, passes, tiles
from rtcore.settings import Settings
from rtcore.stages import NONFINITE
from rtcore.wave import COUNTED

KNOWN = 0.08        # seconds that a picture of known hits may take and still come whole, not lattice by lattice
MARGIN = 1e-5       # by which boxes are made larger, of their corners' coordinates: shapes are rounded to float32


class Renderer:
    """Renders one request after another, keeping from one to the next what has not changed: arrays of the scene, threads and their arrays;
    with `keep` also what first samples have met (`rtcore.keep`), as far as the edit leaves it (`rtcore.edits`), and finished samples.
    Not for two threads at once. give_way: called now and then while a picture is prepared, which is Python's work and takes long where
    there are many shapes; it may wait a little for another thread."""

    def __init__(self, keep: bool = False, give_way: Callable[[], None] | None = None):
        self._keep, self._give_way = keep, give_way or (lambda: None)
        self._geometry: Geometry | None = None
        self._scene: Scene | None = None
        self._pool: ThreadPoolExecutor | None = None
        self._threads = 0
        self._render: Render | None = None
        self._planned: tuple[Scene, Settings, bool, Plan] | None = None
        self._kernels: set[str] = set()
        self._compile = self._prepare = 0.0
        self._pace = Pace()
        self._running: Callable[[], Iterator[Frame] | None] = lambda: None

    def close(self) -> None:
        """End the threads."""
        self._halt()
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None

    def forget(self) -> None:
        """Make the next picture from its start, whatever could be kept of the one before."""
        self._render = None

    @property
    def progress(self) -> float:
        """How far the current request is, 0 .. 1; any thread may ask."""
        return self._render.progress if self._render is not None else 0.0

    @property
    def edits(self) -> frozenset[str]:
        """How the current request differs from the one before it: names of `edits.EDITS`."""
        return self._render.edits if self._render is not None else frozenset()

    def geometry(self, scene: Scene, precision: str) -> Geometry:
        """The scene's arrays, rebuilt only as far as it differs from the last one's."""
        old = self._geometry
        if old is None or self._scene is not scene or old.dtype != DTYPES[precision]:
            self._geometry, self._scene = flatten(scene, precision, old, self._give_way), scene
        return self._geometry

    def frames(self, request: RenderRequest, cancelled: Callable[[], bool] = lambda: False, coarse: bool = True,
               deadline: float | None = None) -> Iterator[Frame]:
        """The pictures of a request, coarse ones first if wanted, the last one with `done`. Once `cancelled()` is true the running pass
        ends within some milliseconds and the iterator ends; `stats()` and `picture()` then tell of what was rendered so far. The same
        request again goes on from there, with another view too: then the first picture comes at once and nothing is traced twice.
        deadline: seconds from now after which the first picture should be seen; the first lattice is as fine as that allows."""
        self._halt()
        made = self._frames(request, cancelled, coarse, deadline)
        self._running = weakref.ref(made)       # no more: who drops the iterator ends it
        return made

    def _halt(self) -> None:
        """End an iterator that somebody still holds: its threads would go on writing to the film."""
        if (running := self._running()) is not None:
            running.close()

    def _frames(self, request: RenderRequest, cancelled: Callable[[], bool], coarse: bool, deadline: float | None) -> Iterator[Frame]:
        start = time.perf_counter()
        composed = self._composed(request)
        loaded = time.perf_counter()
        threads = request.settings.threads or cores()
        if self._pool is None or self._threads != threads:
            if self._pool is not None:
                self._pool.shutdown(cancel_futures=True)
            self._pool, self._threads = _started(threads), threads
        render = self._render
        if render is not None and render.answers(request, self._keep):
            render.look(request, loaded)
            if render.samples or render.number:
                yield render.frame(render.done)
        else:
            geometry = self.geometry(request.scene, request.settings.precision)
            left = None if deadline is None else max(deadline - (time.perf_counter() - start), deadline / 4)
            before, self._render = render, None     # what is kept of it may be changed by then, if this fails
            self._render = render = self._begin(before, request, composed, geometry, coarse, left)
            self._compile, self._prepare = loaded - start, time.perf_counter() - loaded
        while not render.done:
            for _ in render.trace(cancelled):
                if not cancelled():
                    yield render.frame(False)
            if cancelled():
                return
            more = render.finished and render.goes_on(cancelled)
            if more is None:
                return
            render.done = not more
            if cancelled() and not render.done:
                render.number += 1      # when it goes on, it does so with the next pass
                return
            yield render.frame(render.done)
            render.number += not render.done

    def _begin(self, before: Render | None, request: RenderRequest, composed: Plan, geometry: Geometry, coarse: bool,
               deadline: float | None) -> Render:
        """A new picture, from what is left of the one before."""
        pace, memory, goes_on = self._pace, Memory() if self._keep else None, False
        self._give_way()
        what = Change(frozenset(), ())
        if self._keep and before is not None:
            what = change(before.request, request, before.tracer.geometry.leaves, geometry.leaves)
            goes_on = what.extent("light") == KEPT and before.can_go_on(request, composed, coarse)
            if what.extent("hits") != ANEW:
                memory = self._remember(before, what, geometry, request.scene)
            if "nodes" in what.edits:
                pace.forget()
        edges = dict(before.edges) if memory is not None and memory.tiles or goes_on else {}
        first, soon, size = COARSEST, PARTIAL, request.settings.size
        if deadline is not None:
            soon = max(deadline - pace.frame, deadline / 4)
            known = memory is not None and edges.keys() >= set(LATTICES if coarse else LATTICES[-1:]) and all(
                memory.covers(tiles(one, *size, edges)) for one in passes(coarse))
            if known:
                deadline = max(deadline, KNOWN)
                if all(what.extent(step) == KEPT for step in ("hits", "onward", "shadows")):
                    soon = max(soon, KNOWN)     # nothing is to be traced: whole pictures, though they be a little late
            first = pace.finest(size[0] * size[1], self._threads, deadline, known)
        self._give_way()
        return Render(request, composed, geometry, pace, self._pool, Start(
            before, what.edits, memory, coarse, first, edges, soon, goes_on, self._threads))

    def _remember(self, before: Render, what: Change, geometry: Geometry, scene: Scene) -> Memory:
        """What was kept of the picture before, as far as it still holds."""
        memory, old = before.memory, before.tracer.geometry
        if what.extent("hits") == TOUCHED:
            boxes = [packed_bounds(packed_in(geometry, index)) for index in what.leaves if geometry.leaves[index].visible]
            if None in boxes:       # it has no end, or no extent
                return Memory()
            corners = np.array(boxes, np.float64).reshape(-1, 2, 3)
            margin = MARGIN * np.abs(corners).max(axis=(1, 2), initial=0)[:, None]
            grown = np.concatenate([corners[:, 0] - margin, corners[:, 1] + margin], axis=1) if len(corners) else NO_BOXES
            through = any(old.leaves[index].visible and old.leaves[index].material.transmission > 0 for index in what.leaves)
            number = renumbering(old, geometry, what.leaves, UNKNOWN)
            self._give_way()
            memory.renumber(number, through, grown)
        if what.extent("onward") == ANEW:
            memory.forget_onward()
        if what.extent("shadows") == ANEW:
            memory.forget_shadows()
        elif what.extent("shadows") != KEPT:
            memory.forget_shadows(but=casting(scene))
        return memory

    def _composed(self, request: RenderRequest) -> Plan:
        """The plan, made anew only for another scene, other settings or a lens put on or off, with all its kernels at hand: from the cache,
        or compiled."""
        scene, camera, settings, _ = request
        lens = camera.aperture > 0
        if self._planned is None or self._planned[0] is not scene or self._planned[1:3] != (settings, lens):
            self._planned = scene, settings, lens, plan(scene, settings, camera=camera)
        composed = self._planned[3]
        wanted = (*composed.kernels, *([f"keep.{settings.precision}"] if self._keep else []))
        needed = [name for name in wanted if name not in self._kernels]
        if needed:
            from rtcore.warm import compile_kernels     # not at the top: `python -m rtcore.warm` must not find itself imported already
            compile_kernels(needed)
            self._kernels.update(needed)
        return composed

    def picture(self) -> np.ndarray:
        """What the last request has come to so far, linear (h, w, 3) float32."""
        return self._render.frame(True).pixels

    def stats(self) -> dict:
        """The last request in the form of the command line's --stats, without what only the caller knows."""
        render = self._render
        settings = render.settings
        count = render.film.count
        samples = {"least": int(count.min()), "mean": round(float(count.mean()), 3), "most": int(count.max())}
        slow, uncertified = (int(x) for x in sum(scratch.tally[COUNTED] for scratch in render.scratches))
        traced = sum(count for name, count in render.rays().items() if not name.endswith("hits"))
        left_out = [*render.plan.left_out, *([("degenerate triangles", f"{render.dropped} without area")] if render.dropped else []),
                    *([("first hits on the film", "only the picture was asked for")] if not len(render.film.prim) else [])]
        return {"size": list(settings.size), "samples_per_pixel": samples["mean" if render.adaptive else "least"], "samples": samples,
                "precision": settings.precision,
                "threads": self._threads, "rays": render.rays(),
                "seconds": {"prepare": self._prepare, "compile": self._compile, "trace": render.elapsed},
                "fallback": {"rays": slow, "share": slow / max(traced, 1)}, "uncertified": uncertified,
                "peak_memory_mib": peak_memory_mib(), "nonfinite_pixels": int(render.counts()[NONFINITE]),
                "stages": list(render.plan.stages), "left_out": [{"stage": stage, "why": why} for stage, why in left_out],
                "error": {"rmse_estimate": render.error()}, "converged": render.converged}


def _started(threads: int) -> ThreadPoolExecutor:
    """A pool of which all threads run already: the second one would start some milliseconds late, while the first is at work."""
    pool, all_there = ThreadPoolExecutor(threads, thread_name_prefix="rayscope-trace"), threading.Barrier(threads + 1)
    try:
        for _ in range(threads):
            pool.submit(all_there.wait)
        all_there.wait()
    except BaseException:       # no more threads to be had, or interrupted: those that wait are not to do so for ever
        all_there.abort()
        pool.shutdown(wait=False)
        raise
    return pool


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def peak_memory_mib() -> float | None:
    """The most memory this process ever held, in MiB; None where the system does not tell."""
    if resource is None:
        return None
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20 if sys.platform == "darwin" else 1 << 10)
