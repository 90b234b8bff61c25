"""One picture under way: from a request to its frames."""
import functools
import itertools
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from typing import NamedTuple

import msgspec
import numpy as np

from rtcore import adaptive, film as films, filters
from rtcore.camera import Camera
from rtcore.flatten import Geometry, nbytes
from rtcore.keep import Memory
from rtcore.latest import Latest
from rtcore.leaves import Leaf
from rtcore.pace import Pace
from rtcore.plan import VIEW, Plan
from rtcore.recast import Recast
from rtcore.scene import Scene
from rtcore.schedule import COARSEST, FURTHER, TILE, Pass, further, passes, tile_order, tiles, weight
from rtcore.settings import Settings
from rtcore.scratch import Scratch
from rtcore.stages import COUNTS, PRIMARY, REFLECTION, REFRACTION, SHADOW
from rtcore.todo import FINISHED, new_todo
from rtcore.trace import Tracer
from rtcore.views.view import Seen
from rtcore.wave import UNWANTED

PARTIAL = 0.25      # seconds after which a long pass shows what it has
LOOK = 0.002        # seconds between two looks whether a pass is still wanted
SHOWN = 2.0         # how much longer it takes until a frame is on the screen than until it is made


@Latest
def _materials(leaves: tuple[Leaf, ...]) -> np.ndarray:
    """A number for each leaf, the same for those of one material."""
    numbers: dict[int, int] = {}
    return np.array([numbers.setdefault(id(leaf.material), len(numbers)) for leaf in leaves], np.int32)


class RenderRequest(NamedTuple):
    """What to render."""

    scene: Scene
    camera: Camera
    settings: Settings
    hits: bool = True       # whether frames tell what each pixel shows; a picture alone is there a little sooner


class Frame(NamedTuple):
    """The picture after a pass, or within a long one."""

    number: int             # of the pass, from 0
    passes: int             # planned in all
    spacing: int            # of the lattice: 16, 8, 4, 2; 1 from then on
    samples: int            # of every pixel, complete; 0 while the lattice is coarse
    pixels: np.ndarray      # float32 (h, w, 3), linear; the frame's own
    node: np.ndarray | None         # int32 (h, w): leaf first hit, -1 none; None if that was not asked for
    distance: np.ndarray | None     # float32 (h, w): from the eye, inf none
    rays: dict[str, int]
    elapsed: float          # seconds of tracing
    done: bool
    plan: Plan
    seconds: dict[tuple[str, str], float]   # where they went, all threads together: by (stage of the plan, kernel group)
    mean: float             # samples per pixel over the whole picture
    error: float | None     # estimated root mean square error, in linear light; None below two samples
    converged: bool         # it ended because no error is left that could be seen
    held: dict[str, int]    # bytes, by what for


class Start(NamedTuple):
    """What a picture begins with."""

    before: "Render | None"     # the last one, whose arrays are used again: it can't go on then
    edits: frozenset[str]       # how it differs from that, names of `edits.EDITS`; empty if nothing of it holds
    memory: Memory | None       # what is known of its first samples
    coarse: bool                # lattice by lattice
    first: int                  # spacing of the finest one in the first pass
    edges: dict[int, int]       # of the tiles, as far as they are chosen: see `schedule.tiles`
    soon: float                 # seconds after which the first pass shows what it has
    goes_on: bool               # the samples of the one before are its own
    threads: int


class Render:
    """One request under way: its film, its scratch arrays, how far it is."""

    def __init__(self, request: RenderRequest, composed: Plan, geometry: Geometry, pace: Pace, pool: ThreadPoolExecutor, start: Start):
        scene, camera, self.settings, hits = self.request = request
        before, self.edits, self.memory, self.coarse, first, self.edges, self.soon, goes_on, threads = start
        self.plan, self.pace, self.pool = composed, pace, pool
        self.with_light = VIEW[self.settings.view].needs_light
        self.finished = False   # the pass
        self.tracing = False    # the pool is at it
        self._squared: np.ndarray | None = None
        self.done = False
        self.dropped = geometry.dropped
        width, height = size = self.settings.size
        view = camera.rays(width, height)
        lens = camera.lens() if self.plan.lens else None
        # which lights reach what is seen costs little to note and is not to be had later: the window may ask at any time
        lit = self.coarse or VIEW[self.settings.view].needs_lit or (before is not None and len(before.film.lit) > 0)
        hits = hits or VIEW[self.settings.view].needs_hits or (before is not None and len(before.film.prim) > 0)
        self.tracer = Tracer(geometry, self.plan, self.settings, view, lens, camera.up, scene.background, scene.fog, hits, lit)
        self.gain = self.tracer.filter.gain if self.tracer.filter else 1.0
        signed = self.gain < 1
        reused = before is not None and before.settings.size == size and films.suits(before.film, self.plan.samples, hits, lit, signed)
        self.film = before.film if reused else films.new_film(width, height, self.plan.samples, hits, lit, signed)
        if not reused and self.memory is not None:
            self.memory.forget_film()
        self.fresh = not goes_on        # the film was empty
        if reused and not goes_on:
            films.clear(self.film)
        fitting = [s for s in before.scratches if (s.dtype, s.smooth) == (geometry.dtype, self.plan.smooth)] if before is not None else []
        if len(fitting) == threads:
            self.scratches = fitting
            for scratch in self.scratches if not goes_on else ():
                scratch.renew()
        else:
            self.scratches = [Scratch(geometry.dtype, self.plan.smooth) for _ in range(threads)]
            if goes_on:
                self.scratches[0].counts += before.counts()
        self.recast = Recast(geometry, view, width, height)
        self.adaptive = self.settings.adaptive and self.plan.samples > adaptive.FIRST
        self.regions = [self.settings.region, None] if self.settings.region else [None]     # to be refined, one after the other
        self.schedule = [*passes(self.coarse, first), *self._further()]
        self.materials = _materials(geometry.leaves)
        self.order: np.ndarray | None = None
        self.spent = float(self.film.count.mean()) if goes_on else 0.0     # samples per pixel, before the pass under way
        self.converged = False  # nothing is left that could be seen
        self.prepared = time.perf_counter() - (before.elapsed if goes_on else 0.0)
        self.number = 0         # of the pass
        self.samples = 0        # per pixel, complete
        self.elapsed = 0.0
        self._todo, self._weight = new_todo(np.zeros((0, 8), np.int64)), 0.0    # of the pass; how much it is, in samples of every pixel

    def answers(self, request: RenderRequest, keep: bool) -> bool:
        """Whether what is under way is what another request wants too, at most seen differently. The very same request is answered by
        going on with it, and once it is done, by doing it again, unless it is kept."""
        scene, camera, settings, hits = request
        mine = self.request.settings
        if scene is not self.request.scene or camera != self.request.camera:
            return False
        if msgspec.structs.replace(settings, view=mine.view, seconds=mine.seconds) != mine:
            return False
        if VIEW[settings.view].needs_light and not self.with_light:
            return False
        if VIEW[settings.view].needs_lit and not len(self.film.lit):
            return False
        if (hits or VIEW[settings.view].needs_hits) and not len(self.film.prim):
            return False
        return keep or not self.done or settings.view != self.settings.view

    def look(self, request: RenderRequest, now: float) -> None:
        """Go on for a request that this one answers, as if it had never stopped."""
        self.edits = frozenset(name for name, field in (("view", "view"), ("samples", "seconds"))
                               if getattr(self.settings, field) != getattr(request.settings, field))
        self.done = self.done and self.finished and "samples" not in self.edits
        self.request, self.settings, self.prepared = request, request.settings, now - self.elapsed

    def can_go_on(self, request: RenderRequest, composed: Plan, coarse: bool) -> bool:
        """Whether another request, with the same light, can take over the samples so far and come to the very picture that it would come to
        alone."""
        if VIEW[request.settings.view].needs_light and not self.with_light or coarse != self.coarse:
            return False
        most = min(adaptive.FIRST, composed.samples) if self.adaptive or request.settings.adaptive else composed.samples
        lit, signed = len(self.film.lit) > 0, len(self.film.plain) > 0
        hits = request.hits or VIEW[request.settings.view].needs_hits
        return films.suits(self.film, composed.samples, hits, lit, signed) and int(self.film.count.max()) <= most

    def trace(self, cancelled: Callable[[], bool]) -> Iterator[None]:
        """Trace what is missing of the current pass on the pool; yields now and then while it runs. Closing the iterator, or an error in
        a thread, ends the threads' work first."""
        one, size = self.schedule[self.number], self.settings.size
        if one.samples == range(1):
            for spacing in (*one.coarser, one.spacing):
                # where nothing is kept a tile takes no Python, and small ones stay in the processor's cache
                self.edges.setdefault(spacing, TILE if self.memory is None else self.pace.edge(spacing, size, len(self.scratches)))
        else:       # a tile's sample is there if its first pixel's is: so tiles may become smaller, parts of those before, never larger
            self.edges[FURTHER] = min(self.edges.get(FURTHER, self.edges[1]), TILE)
        self._todo, self._weight = new_todo(tiles(one, *size, self.edges), one.pixels), weight(one, *size)
        halt, ended = threading.Event(), threading.Semaphore(0)
        # time runs out only once every pixel has a sample
        deadline = self.prepared + (self.settings.seconds or np.inf) if self.samples else np.inf
        began, before = time.perf_counter(), self.counts()
        shown, patience = began, PARTIAL if self.number else self.soon

        def stale() -> bool:
            return halt.is_set() or cancelled() or time.perf_counter() > deadline

        def end() -> None:      # kernels see it within a packet of rays, the threads between kernels
            halt.set()
            self._want(False)

        self.tracing, self._squared = True, None
        self._want(not stale())     # the first look comes too late for what is soon over
        shares = [self.pool.submit(self.tracer.trace, scratch, self.film, self._todo, one.samples, stale, self.memory)
                  for scratch in self.scratches]
        for share in shares:
            share.add_done_callback(lambda _: ended.release())
        running = len(shares)
        try:
            while running and not any(share.done() and share.exception() for share in shares):
                if ended.acquire(timeout=LOOK):
                    running -= 1
                elif stale():
                    end()
                elif (now := time.perf_counter()) - shown >= patience:
                    self.elapsed, shown, patience = now - self.prepared, now, PARTIAL
                    yield
        finally:
            if not all(share.done() for share in shares):
                end()
            wait(shares)
            self.tracing = False
            self.elapsed = time.perf_counter() - self.prepared
        results = [share.result() for share in shares]      # an exception of a thread comes out here
        self.finished = all(results)
        if one.samples == range(1):
            pixels = self._traced() * size[0] * size[1]
            if self.fresh or self.film.count.max() <= 1:    # else the samples were there, and tiles were skipped
                self._note_pace(one.spacing, pixels, (time.perf_counter() - began) * len(shares), self.counts() - before)
        self.spent = float(self.film.count.mean())
        if self.finished and one.spacing == 1 and one.pixels is None and one.region is None:
            self.samples = one.samples.stop

    def _want(self, on: bool) -> None:
        """Tell the kernels whether what they trace is wanted."""
        for scratch in self.scratches:
            scratch.tally[UNWANTED] = not on

    def _note_pace(self, spacing: int, pixels: float, seconds: float, counts: np.ndarray) -> None:
        """So many pixels of lattices took so long, and so many rays."""
        if counts[PRIMARY] >= 0.9 * pixels:
            self.pace.note(spacing, pixels, seconds)
        elif not counts[[PRIMARY, SHADOW, REFLECTION, REFRACTION]].any():
            self.pace.note_known(pixels, seconds)

    def _traced(self) -> float:
        """How much of the pass under way is done, in samples of every pixel."""
        return self._weight * int(self._todo.counters[FINISHED]) / max(len(self._todo.tiles), 1)

    @property
    def progress(self) -> float:
        """How far the picture is, 0 .. 1; any thread may ask."""
        return 1.0 if self.done else min((self.spent + self._traced() * self.tracing) / self.plan.samples, 1.0)

    def error(self) -> float | None:
        """The estimated root mean square error, over pixels and channels; None below two samples."""
        if min(self.plan.samples, self.samples) < 2:
            return None
        uneven = self.adaptive and self.samples >= adaptive.FIRST
        return adaptive.rmse_estimate(self.squared_errors()) if uneven else films.rmse_estimate(self.settled())

    def squared_errors(self) -> np.ndarray:
        """`adaptive.squared_errors`, worked out once between two passes."""
        if self.tracing:        # the pool has its hands full, and the film grows
            return adaptive.squared_errors(self.settled(), *self.settings.size)
        if self._squared is None:
            self._squared = adaptive.squared_errors(self.settled(), *self.settings.size, self.pool.map)
        return self._squared

    def settled(self) -> films.Film:
        """The film as it is to be read."""
        return filters.settled(self.film, self.gain)

    def goes_on(self, cancelled: Callable[[], bool]) -> bool | None:
        """Whether another pass is wanted; an adaptive one is added to the schedule. Asked between passes. None: given up, for that takes
        some 30 ms and was not wanted any more."""
        target, growth = self.settings.error, adaptive.GROWTH
        if target is not None:
            estimate = self.error()
            if estimate is not None and estimate <= target:
                return False
            if estimate is not None:        # no more than is likely to be needed
                growth = min(max((estimate / target) ** (2 / adaptive.POWER) - 1, growth / 8), growth)
        while self.number + 1 == len(self.schedule):
            if self.adaptive:
                self.squared_errors()
                if cancelled():
                    return None
            one = self._refinement(growth, target or adaptive.CONVERGED) if self.adaptive else None
            self.converged = one is not None and len(one.pixels) == 0
            if one is not None and len(one.pixels):
                self.schedule.append(one)
            elif len(self.regions) > 1:
                del self.regions[0]
                self.converged = False
                self.schedule += self._further()
            else:
                return False
        return True

    def _further(self) -> list[Pass]:
        """The passes that bring the region at hand to its number of samples, or to what adaptive ones begin with."""
        return further(adaptive.FIRST if self.adaptive else self.plan.samples, self.regions[0])

    def _refinement(self, growth: float, target: float) -> Pass | None:
        """The next adaptive pass, over what is to be refined now."""
        size, inside = self.settings.size, None
        if self.order is None:
            self.order = tile_order(*size)
        if self.regions[0]:
            x0, y0, x1, y1 = self.regions[0]
            inside = np.zeros(size[::-1], bool)
            inside[y0:y1, x0:x1] = True
        return adaptive.refinement(self.settled(), self.squared_errors(), self.order, self.plan.samples, growth,
                                   min(adaptive.CONVERGED, target), None if inside is None else inside.ravel())

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
            total.update(scratch.clock.seconds())
        return dict(total)

    def held(self) -> dict[str, int]:
        """Bytes of the arrays of this render, by what they are for."""
        groups = self.tracer.geometry.groups
        return {"shapes": nbytes(group.table for group in groups), "trees": nbytes(group.tree for group in groups if group.has_tree),
                "waves": sum(scratch.nbytes for scratch in self.scratches), "film": nbytes(self.film),
                "kept hits": 0 if self.memory is None else self.memory.nbytes}

    def frame(self, done: bool) -> Frame:
        """The picture as it is now."""
        began, film, (width, height) = time.perf_counter(), self.film, self.settings.size
        # not from `memory.carved`: frames come and go, and what the last ones left is there without being cleared
        pixels = np.empty((height, width, 3), np.float32)
        told = (height, width) if len(film.prim) else (0, 0)
        node, distance = np.empty(told, np.int32), np.empty(told, np.float32)
        bands = [0, height]
        if not self.tracing:    # else the pool's threads have their hands full
            bands = np.linspace(0, height, len(self.scratches) + 1).astype(int).tolist()
        develop = functools.partial(films.develop, self.settled(), self.tracer.geometry.leaf, width)
        mine, *others = [(first, last, COARSEST, pixels, node, distance) for first, last in itertools.pairwise(bands)]
        shares = [self.pool.submit(develop, *band) for band in others]
        develop(*mine)
        for share in shares:
            share.result()

        def spread(values: np.ndarray) -> np.ndarray:
            return self.recast.spread(film, values, COARSEST)
        share = map if self.tracing else self.pool.map
        shown = VIEW[self.settings.view].draw(Seen(
            pixels, node, self.materials, distance, film.count.reshape(height, width),
            normal=lambda: spread(film.normal), doubt=lambda: spread(film.doubt), lit=lambda: spread(film.lit),
            error=lambda: np.sqrt(self.squared_errors()).reshape(height, width),
            coordinates=lambda: spread(self.recast.coordinates(film, share)), tests=lambda: spread(self.recast.tests(film, share))))
        self.pace.frame = 0.7 * self.pace.frame + 0.3 * SHOWN * (time.perf_counter() - began)
        mean = float(film.count.mean()) if self.tracing else self.spent
        seen = (node, distance) if len(film.prim) else (None, None)
        return Frame(self.number, len(self.schedule), self.schedule[self.number].spacing, self.samples, shown, *seen, self.rays(),
                     self.elapsed, done, self.plan, self.seconds(), mean, self.error(), self.converged, self.held())
