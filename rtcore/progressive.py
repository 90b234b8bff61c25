"""Progressive rendering: a request becomes passes, each pass a Frame; a newer request makes the passes of the old one end.

Pass 0 is a lattice of every 16th pixel, each later one fills the lattice between; then come whole-picture samples 2, 3-4, 5-8 ... No
sample is traced twice, and each is added to its pixel in order, so the finished picture has the same bits for any number of threads and
with or without the coarse passes.
"""
import itertools
import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from typing import NamedTuple

import msgspec
import numpy as np

try:
    import resource
except ImportError:     # Windows
    resource = None

from rtcore import adaptive, film as films
from rtcore.camera import Camera
from rtcore.flatten import DTYPES, Geometry, flatten, nbytes
from rtcore.plan import VIEW, Plan, plan
from rtcore.recast import Recast
from rtcore.scene import Scene
from rtcore.schedule import COARSEST, Pass, passes, tile_order, tiles, weight
from rtcore.settings import Settings
from rtcore.trace import COUNTS, NONFINITE, Scratch, Tracer
from rtcore.views.view import Seen

PARTIAL = 0.25      # seconds after which a long pass shows what it has


class RenderRequest(NamedTuple):
    """What to render."""

    scene: Scene
    camera: Camera
    settings: Settings


class Frame(NamedTuple):
    """The picture after a pass, or within a long one."""

    number: int             # of the pass, from 0
    passes: int             # planned in all
    spacing: int            # of the lattice: 16, 8, 4, 2; 1 from then on
    samples: int            # of every pixel, complete; 0 while the lattice is coarse
    pixels: np.ndarray      # float32 (h, w, 3), linear; the frame's own
    node: np.ndarray        # int32 (h, w): leaf first hit, -1 none
    distance: np.ndarray    # float32 (h, w): from the eye, inf none
    rays: dict[str, int]
    elapsed: float          # seconds of tracing
    done: bool
    plan: Plan
    seconds: dict[tuple[str, str], float]   # where they went, all threads together: by (stage of the plan, kernel group)
    mean: float             # samples per pixel over the whole picture
    error: float | None     # estimated root mean square error, in linear light; None below two samples
    converged: bool         # it ended because no error is left that could be seen
    held: dict[str, int]    # bytes, by what for


class Render:
    """One request under way: its film, its scratch arrays, how far it is."""

    def __init__(self, request: RenderRequest, composed: Plan, geometry: Geometry, threads: int, coarse: bool):
        scene, camera, self.settings = self.request = request
        self.plan = composed
        self.finished = False   # the pass
        self.done = False
        self.dropped = geometry.dropped
        width, height = self.settings.size
        view = camera.rays(width, height)
        lens = camera.lens() if self.plan.lens else None
        self.tracer = Tracer(geometry, self.plan, self.settings, view, lens, camera.up, scene.background, scene.fog)
        # which lights reach what is seen costs little to note and is not to be had later: the window may ask at any time
        self.film = films.new_film(width, height, self.plan.samples, lit=coarse or VIEW[self.settings.view].needs_lit)
        self.recast = Recast(geometry, view, width, height)
        self.scratches = [Scratch(geometry.dtype) for _ in range(threads)]
        self.adaptive = self.settings.adaptive and self.plan.samples > adaptive.FIRST
        self.schedule = passes(adaptive.FIRST if self.adaptive else self.plan.samples, coarse)
        numbers: dict[int, int] = {}
        self.materials = np.array([numbers.setdefault(id(leaf.material), len(numbers)) for leaf in geometry.leaves], np.int32)
        self.order: np.ndarray | None = None
        self.spent = 0.0        # samples per pixel of whole passes
        self.converged = False  # nothing is left that could be seen
        self.prepared = time.perf_counter()
        self.number = 0         # of the pass
        self.samples = 0        # per pixel, complete
        self.elapsed = 0.0
        self.done_tiles = itertools.count(1)
        self.progress = 0.0

    def answers(self, request: RenderRequest) -> bool:
        """Whether what is under way is what another request wants too, at most seen differently. The very same request is answered by
        going on with it, and once it is done, by doing it again."""
        scene, camera, settings = request
        mine = self.request.settings
        if scene is not self.request.scene or camera != self.request.camera or msgspec.structs.replace(settings, view=mine.view) != mine:
            return False
        if VIEW[settings.view].needs_light and not VIEW[mine.view].needs_light:
            return False        # no light was traced
        if VIEW[settings.view].needs_lit and not len(self.film.lit):
            return False
        return not self.done or settings.view != self.settings.view

    def trace(self, pool: ThreadPoolExecutor, cancelled: Callable[[], bool]) -> Iterator[None]:
        """Trace what is missing of the current pass on the pool; yields now and then while it runs. Closing the iterator, or an error in
        a thread, ends the threads' work first."""
        one = self.schedule[self.number]
        queue = tiles(one, *self.settings.size)
        each = weight(one, *self.settings.size) / max(len(queue), 1)
        todo, halt = iter(queue), threading.Event()
        # time runs out only once every pixel has a sample
        deadline = self.prepared + (self.settings.seconds or np.inf) if self.samples else np.inf
        self.done_tiles = itertools.count(1)

        def stale() -> bool:
            return halt.is_set() or cancelled() or time.perf_counter() > deadline

        shares = [pool.submit(self._work, scratch, one, todo, each, stale) for scratch in self.scratches]
        try:
            while wait(shares, PARTIAL, FIRST_EXCEPTION).not_done and not any(share.done() and share.exception() for share in shares):
                self.elapsed = time.perf_counter() - self.prepared
                yield
        finally:
            if not all(share.done() for share in shares):
                halt.set()
            wait(shares)
            self.elapsed = time.perf_counter() - self.prepared
        results = [share.result() for share in shares]      # an exception of a thread comes out here
        self.finished = all(results)
        if self.finished:
            self.spent = sum(weight(done, *self.settings.size) for done in self.schedule[:self.number + 1])
            if one.spacing == 1 and one.pixels is None:
                self.samples = one.samples.stop

    def _work(self, scratch: Scratch, one: Pass, todo: Iterator, each: float, stale: Callable[[], bool]) -> bool:
        """One thread's share of a pass: the next tile as long as there is one; False if it became stale."""
        for tile in todo:
            if one.pixels is not None and (stale() or not self.tracer.listed(scratch, self.film, tile, stale)):
                return False
            for sample in one.samples:
                if stale() or not self.tracer.tile(scratch, self.film, tile, sample, stale):
                    return False
            self.progress = min((self.spent + next(self.done_tiles) * each) / self.plan.samples, 1.0)
        return True

    def error(self) -> float | None:
        """The estimated root mean square error, over pixels and channels; None below two samples."""
        if min(self.plan.samples, self.samples) < 2:
            return None
        uneven = self.adaptive and self.samples >= adaptive.FIRST
        return adaptive.rmse_estimate(self.film, *self.settings.size) if uneven else films.rmse_estimate(self.film)

    def goes_on(self) -> bool:
        """Whether another pass is wanted; an adaptive one is added to the schedule. Asked between passes."""
        target, growth = self.settings.error, adaptive.GROWTH
        if target is not None:
            estimate = self.error()
            if estimate is not None and estimate <= target:
                return False
            if estimate is not None:        # no more than is likely to be needed
                growth = min(max((estimate / target) ** (2 / adaptive.POWER) - 1, growth / 8), growth)
        if self.number + 1 < len(self.schedule):
            return True
        if not self.adaptive:
            return False
        size = self.settings.size
        if self.order is None:
            self.order = tile_order(*size)
        one = adaptive.refinement(self.film, *size, self.order, self.plan.samples, growth,
                                  min(adaptive.CONVERGED, target or adaptive.CONVERGED))
        self.converged = one is not None and len(one.pixels) == 0
        if one is None or self.converged:
            return False
        self.schedule.append(one)
        return True

    def counts(self) -> np.ndarray:
        """What all threads have counted so far."""
        return sum(scratch.counts for scratch in self.scratches)

    def rays(self) -> dict[str, int]:
        """Counts of rays under the names of the command line's --stats."""
        counts = dict(zip(COUNTS, (int(c) for c in self.counts())))
        return {key: counts[key] for key in ("primary", "primary_hits", "shadow", "shadow_hits", "reflection", "refraction")}

    def seconds(self) -> dict[tuple[str, str], float]:
        """Where the threads' time went so far, by (stage of the plan, kernel group)."""
        total = Counter()
        for scratch in self.scratches:
            total.update(dict(scratch.clock.seconds))       # a copy, for its thread may be adding to it
        return dict(total)

    def held(self) -> dict[str, int]:
        """Bytes of the arrays of this render, by what they are for."""
        groups = self.tracer.geometry.groups
        return {"shapes": nbytes(group.table for group in groups), "trees": nbytes(group.tree for group in groups if group.has_tree),
                "waves": sum(scratch.nbytes for scratch in self.scratches), "film": nbytes(self.film)}

    def frame(self, done: bool) -> Frame:
        """The picture as it is now."""
        width, height = self.settings.size
        pixels, normal = np.empty((height, width, 3), np.float32), np.empty((height, width, 3), np.float32)
        node, distance, doubt = (np.empty((height, width), dtype) for dtype in (np.int32, np.float32, np.uint8))
        films.develop(self.film, width, height, COARSEST, pixels)
        films.fill(self.film, self.tracer.geometry.leaf, width, height, COARSEST, node, distance, normal, doubt)
        shown = VIEW[self.settings.view].draw(Seen(
            pixels, node, self.materials, distance, normal, doubt, self.film.count.reshape(height, width),
            error=lambda: np.sqrt(adaptive.squared_errors(self.film, width, height)).reshape(height, width),
            lit=lambda: self.recast.spread(self.film, self.film.lit, COARSEST),
            coordinates=lambda: self.recast.spread(self.film, self.recast.coordinates(self.film), COARSEST),
            tests=lambda: self.recast.spread(self.film, self.recast.tests(self.film), COARSEST)))
        return Frame(self.number, len(self.schedule), self.schedule[self.number].spacing, self.samples, shown, node, distance,
                     self.rays(), self.elapsed, done, self.plan, self.seconds(), float(self.film.count.mean()), self.error(),
                     self.converged, self.held())


class Renderer:
    """Renders one request after another, keeping from one to the next what has not changed. Not for two threads at once."""

    def __init__(self):
        self._geometry: Geometry | None = None
        self._scene: Scene | None = None
        self._pool: ThreadPoolExecutor | None = None
        self._threads = 0
        self._render: Render | None = None
        self._planned: tuple[Scene, Settings, bool, Plan] | None = None
        self._kernels: set[str] = set()
        self._compile = self._prepare = 0.0

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None

    @property
    def progress(self) -> float:
        """How far the current request is, 0 .. 1; any thread may ask."""
        return self._render.progress if self._render is not None else 0.0

    def geometry(self, scene: Scene, precision: str) -> Geometry:
        """The scene's arrays, rebuilt only as far as it differs from the last one's."""
        old = self._geometry
        if old is None or self._scene is not scene or old.dtype != DTYPES[precision]:
            self._geometry, self._scene = flatten(scene, precision, old), scene
        return self._geometry

    def frames(self, request: RenderRequest, cancelled: Callable[[], bool] = lambda: False, coarse: bool = True) -> Iterator[Frame]:
        """The pictures of a request, coarse ones first if wanted, the last one with `done`. Once `cancelled()` is true the running pass
        ends within some milliseconds and the iterator ends; `stats()` and `picture()` then tell of what was rendered so far. The same
        request again goes on from there, with another view too: then the first picture comes at once and nothing is traced twice."""
        start = time.perf_counter()
        composed = self._composed(request)
        loaded = time.perf_counter()
        threads = request.settings.threads or cores()
        render = self._render
        if render is not None and render.answers(request):
            render.settings, render.prepared = request.settings, loaded - render.elapsed
            if render.samples or render.number:
                yield render.frame(render.done)
        else:
            geometry = self.geometry(request.scene, request.settings.precision)
            self._render = render = Render(request, composed, geometry, threads, coarse)
            self._compile, self._prepare = loaded - start, render.prepared - loaded
        if self._pool is None or self._threads != threads:
            self.close()
            self._pool, self._threads = ThreadPoolExecutor(threads, thread_name_prefix="rayscope-trace"), threads
        while not render.done:
            for _ in render.trace(self._pool, cancelled):
                if not cancelled():
                    yield render.frame(False)
            if cancelled():
                return
            render.done = not (render.finished and render.goes_on())
            if render.done:
                render.progress = 1.0
            yield render.frame(render.done)
            render.number += not render.done

    def _composed(self, request: RenderRequest) -> Plan:
        """The plan, made anew only for another scene, other settings or a lens put on or off, with all its kernels at hand: from the cache,
        or compiled."""
        scene, camera, settings = request
        lens = camera.aperture > 0
        if self._planned is None or self._planned[0] is not scene or self._planned[1:3] != (settings, lens):
            self._planned = scene, settings, lens, plan(scene, settings, camera=camera)
        composed = self._planned[3]
        needed = [name for name in composed.kernels if name not in self._kernels]
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
        slow, uncertified = (int(x) for x in sum(scratch.tally() for scratch in render.scratches))
        traced = sum(count for name, count in render.rays().items() if not name.endswith("hits"))
        left_out = [*render.plan.left_out, *([("degenerate triangles", f"{render.dropped} without area")] if render.dropped else [])]
        return {"size": list(settings.size), "samples_per_pixel": samples["mean" if render.adaptive else "least"], "samples": samples,
                "precision": settings.precision,
                "threads": self._threads, "rays": render.rays(),
                "seconds": {"prepare": self._prepare, "compile": self._compile, "trace": render.elapsed},
                "fallback": {"rays": slow, "share": slow / max(traced, 1)}, "uncertified": uncertified,
                "peak_memory_mib": peak_memory_mib(), "nonfinite_pixels": int(render.counts()[NONFINITE]),
                "stages": list(render.plan.stages), "left_out": [{"stage": stage, "why": why} for stage, why in left_out],
                "error": {"rmse_estimate": render.error()}, "converged": render.converged}


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def peak_memory_mib() -> float | None:
    """The most memory this process ever held, in MiB; None where the system does not tell."""
    if resource is None:
        return None
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20 if sys.platform == "darwin" else 1 << 10)
