"""Progressive rendering: a request becomes passes, each pass a Frame; a newer request makes the passes of the old one end.

Pass 0 is a lattice of every 16th pixel, each later one fills the lattice between; then come whole-picture samples 2, 3-4, 5-8 ... No
sample is traced twice, and each is added to its pixel in order, so the finished picture has the same bits for any number of threads and
with or without the coarse passes.
"""
import itertools
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from typing import NamedTuple

import numpy as np

from rtcore import film as films
from rtcore.camera import Camera
from rtcore.flatten import DTYPES, Geometry, flatten
from rtcore.plan import VIEW, Plan, plan
from rtcore.scene import Scene
from rtcore.settings import Settings
from rtcore.trace import COUNTS, NONFINITE, Scratch, Tracer

COARSEST = 16       # spacing of the first lattice
TILE = 64           # lattice points along a tile's edge: 4,096 rays, some milliseconds
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
    samples: int            # per pixel, complete; 0 while the lattice is coarse
    pixels: np.ndarray      # float32 (h, w, 3), linear; the frame's own
    node: np.ndarray        # int32 (h, w): leaf first hit, -1 none
    distance: np.ndarray    # float32 (h, w): from the eye, inf none
    rays: dict[str, int]
    elapsed: float          # seconds of tracing
    done: bool


class Pass(NamedTuple):
    """What one pass traces."""

    spacing: int
    skip: bool              # what the lattice twice as coarse has already
    samples: range


def passes(samples: int, coarse: bool) -> list[Pass]:
    """The schedule for a number of samples per pixel."""
    spacing, result = COARSEST if coarse else 1, []
    while spacing >= 1:
        result.append(Pass(spacing, coarse and spacing < COARSEST, range(1)))
        spacing //= 2
    done = 1
    while done < samples:
        result.append(Pass(1, False, range(done, min(2 * done, samples))))
        done = result[-1].samples.stop
    return result


def tiles(one: Pass, width: int, height: int) -> list[np.ndarray]:
    """The pass's tiles as `eye.cast` takes them, from the middle of the picture outward."""
    columns, rows = -(-width // one.spacing), -(-height // one.spacing)
    corners = [(x, y) for y in range(0, rows, TILE) for x in range(0, columns, TILE)]
    corners.sort(key=lambda c: (c[0] + TILE / 2 - columns / 2) ** 2 + (c[1] + TILE / 2 - rows / 2) ** 2)
    return [np.array([x, y, min(TILE, columns - x), min(TILE, rows - y), one.spacing, one.skip, width, height], np.int64) for x, y in corners]


class Renderer:
    """Renders one request after another, keeping from one to the next what has not changed. Not for two threads at once."""

    def __init__(self):
        self._geometry: Geometry | None = None
        self._scene: Scene | None = None
        self._pool: ThreadPoolExecutor | None = None
        self._threads = 0
        self._stats: dict = {}
        self.progress = 0.0     # of the current request, 0 .. 1; any thread may read it

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None

    def geometry(self, scene: Scene, precision: str) -> Geometry:
        """The scene's arrays, rebuilt only as far as it differs from the last one's."""
        old = self._geometry
        if old is None or self._scene is not scene or old.dtype != DTYPES[precision]:
            self._geometry, self._scene = flatten(scene, precision, old), scene
        return self._geometry

    def frames(self, request: RenderRequest, cancelled: Callable[[], bool] = lambda: False, coarse: bool = True) -> Iterator[Frame]:
        """The pictures of a request, coarse ones first if wanted, the last one with `done`. Once `cancelled()` is true the running pass
        ends within some milliseconds and the iterator ends; `stats()` then tells of what was rendered so far."""
        start = time.perf_counter()
        self.progress = 0.0
        scene, camera, settings = request
        geometry = self.geometry(scene, settings.precision)
        composed = plan(scene, settings, geometry.leaves)
        width, height = settings.size
        tracer = Tracer(geometry, composed, settings, camera.rays(width, height), camera.up, scene.background, scene.fog)
        film = films.new_film(width, height)
        threads = settings.threads or len(os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(os.cpu_count() or 1))
        if self._pool is None or self._threads != threads:
            self.close()
            self._pool, self._threads = ThreadPoolExecutor(threads, thread_name_prefix="rayscope-trace"), threads
        scratches = [Scratch(geometry.dtype) for _ in range(threads)]
        schedule = passes(composed.samples, coarse)
        prepared = time.perf_counter()
        self._stats = {"prepare": prepared - start, "plan": composed, "settings": settings, "threads": threads, "film": film, "trace": 0.0,
                       "samples": 0, "counts": np.zeros(len(COUNTS), np.int64)}

        def frame(number: int, samples: int, done: bool) -> Frame:
            return self._frame(film, settings, number, len(schedule), schedule[number].spacing, samples, done)

        budget = settings.seconds or np.inf
        total = sum(len(one.samples) * _share(one) for one in schedule)
        before = 0.0
        for number, one in enumerate(schedule):
            queue = tiles(one, width, height)
            todo, done_tiles = iter(queue), itertools.count(1)
            halt = threading.Event()
            complete = number >= (COARSEST.bit_length() if coarse else 1)       # every pixel has its first sample

            def stale() -> bool:
                return halt.is_set() or cancelled() or (complete and time.perf_counter() - prepared > budget)

            def work(scratch: Scratch) -> bool:
                for tile in todo:
                    for sample in one.samples:
                        if stale() or not tracer.tile(scratch, film, tile, sample, stale):
                            return False
                    self.progress = (before + next(done_tiles) / len(queue) * len(one.samples) * _share(one)) / total
                return True

            shares = [self._pool.submit(work, scratch) for scratch in scratches]
            try:
                while wait(shares, PARTIAL, FIRST_EXCEPTION).not_done and not any(f.done() and f.exception() for f in shares):
                    self._tally(scratches, prepared)
                    if not cancelled():
                        yield frame(number, one.samples.start, False)
            finally:    # an exception here or in a thread, or a consumer that has had enough
                if not all(f.done() for f in shares):
                    halt.set()
                wait(shares)
            self._tally(scratches, prepared)
            finished = all([f.result() for f in shares])
            before += len(one.samples) * _share(one)
            if finished and one.spacing == 1:
                self._stats["samples"] = one.samples.stop
            enough = not finished or (settings.error is not None and one.samples.stop > 1 and (films.rmse_estimate(film) or np.inf) <= settings.error)
            if cancelled():
                return
            last = enough or number == len(schedule) - 1
            if last:
                self.progress = 1.0
            yield frame(number, self._stats["samples"], last)
            if last:
                return

    def _tally(self, scratches: list[Scratch], since: float) -> None:
        self._stats["trace"] = time.perf_counter() - since
        self._stats["counts"] = sum(s.counts for s in scratches)

    def _frame(self, film, settings: Settings, number: int, count: int, spacing: int, samples: int, done: bool) -> Frame:
        width, height = settings.size
        pixels = np.empty((height, width, 3), np.float32)
        node, distance, normal = np.empty((height, width), np.int32), np.empty((height, width), np.float32), np.empty((height, width, 3), np.float32)
        films.develop(film, width, height, COARSEST, pixels)
        films.fill(film, width, height, COARSEST, node, distance, normal)
        shown = VIEW[settings.view].draw(pixels, node, distance, normal)
        return Frame(number, count, spacing, samples, shown, node, distance, self._rays(), self._stats["trace"], done)

    def _rays(self) -> dict[str, int]:
        counts = dict(zip(COUNTS, (int(c) for c in self._stats["counts"])))
        return {key: counts[key] for key in ("primary", "primary_hits", "shadow", "shadow_hits", "reflection", "refraction")}

    def picture(self) -> np.ndarray:
        """What the last request has come to so far, linear (h, w, 3) float32."""
        return self._frame(self._stats["film"], self._stats["settings"], 0, 1, 1, 0, True).pixels

    def stats(self) -> dict:
        """The last request in the form of the command line's --stats, without what only the caller knows."""
        s, composed = self._stats, self._stats["plan"]
        per_pixel = int(s["film"].count.min())
        return {"size": list(s["settings"].size), "samples_per_pixel": per_pixel, "precision": s["settings"].precision, "threads": s["threads"],
                "rays": self._rays(), "seconds": {"prepare": s["prepare"], "trace": s["trace"]}, "peak_memory_mib": peak_memory_mib(),
                "nonfinite_pixels": int(s["counts"][NONFINITE]), "stages": list(composed.stages),
                "left_out": [{"stage": stage, "why": why} for stage, why in composed.left_out],
                "error": {"rmse_estimate": films.rmse_estimate(s["film"])}}


def _share(one: Pass) -> float:
    """The part of the picture's pixels that a pass traces per sample."""
    return (0.75 if one.skip else 1.0) / one.spacing ** 2


def peak_memory_mib() -> float | None:
    """The most memory this process ever held, in MiB; None where the system does not tell."""
    try:
        import resource
    except ImportError:
        return None
    import sys
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20 if sys.platform == "darwin" else 1 << 10)
