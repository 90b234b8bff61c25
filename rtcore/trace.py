"""The way of a wave: from the eye through hits, light, fog and bounces to the film. Stages that the plan left out do not occur."""
import time
from collections import defaultdict
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rtcore import film as films, filters, fog as fogs, gloss, shading
from rtcore.eye import cast, cast_list
from rtcore.edits import shadow_key
from rtcore.flatten import Geometry, nbytes
from rtcore.jit import typed
from rtcore.keep import Memory, Recall
from rtcore.lanes import LANES
from rtcore.lens import bend
from rtcore.lights import SAMPLED, SHINE, UNNOTED, UNTOLD, Draw, Reach
from rtcore.plan import GLOW, VIEW, Plan
from rtcore.scene import Background, Fog, Light
from rtcore.sampling import LIGHTS
from rtcore.settings import Settings
from rtcore.wave import COUNTED, NO_ANSWER, Beam, Wave, find_kinds, new_beam, new_tally, new_wave, padded

CLOSEST = np.zeros(0, np.int32)     # no opacities: record() keeps the nearest hit
LEVEL = 1 << 12         # pairs of dimensions for the lights of one depth: so a light more changes nothing about the others
SHADOW_RAYS = 8192      # of a wave toward several lights at once: more would leave the cache, and few cost less than their calls

#: What laps of the Clock are for.
CAST, SPREAD, BEND = ("primary rays", "core"), ("pixel filter", "filter"), ("depth of field", "lens")
FILM, DEPOSIT = ("film", "core"), ("film", "glow")
DIM, ONWARD, ROUGHEN, GLOWING = ("fog", "fog"), ("reflected and refracted rays", "bounce"), ("glossy reflection", "gloss"), (GLOW, "glow")
CASTING = ("shadow rays", "lit")

#: Columns of Scratch.counts.
COUNTS = ("reflection", "refraction", "primary", "primary_hits", "shadow", "shadow_hits", "nonfinite")
REFLECTION, REFRACTION, PRIMARY, PRIMARY_HITS, SHADOW, SHADOW_HITS, NONFINITE = range(len(COUNTS))


class Lamp(NamedTuple):
    """A light, ready for its kernel."""

    shine: Callable
    numbers: np.ndarray
    color: np.ndarray
    sampled: bool           # it has an extent
    key: tuple              # what its shadows depend on
    shining: tuple[str, str]        # laps of the Clock
    gathering: tuple[str, str]


class Laps(NamedTuple):
    """What laps of the Clock are for, of one kind of shapes."""

    hits: tuple[str, str]
    surface: tuple[str, str]
    shadows: tuple[str, str]


class Clock:
    """Where one thread's time goes. Two readings of the clock a step and wave, 0.1 us each, against milliseconds: it always runs."""

    def __init__(self):
        self.seconds: dict[tuple[str, str], float] = defaultdict(float)     # by (stage of the plan, kernel group)
        self._since = 0.0

    def start(self) -> None:
        """What comes now counts, up to the next `lap`."""
        self._since = time.perf_counter()

    def lap(self, what: tuple[str, str]) -> None:
        """Since the last lap these kernels ran for this stage: (stage, kernel group)."""
        now = time.perf_counter()
        self.seconds[what] += now - self._since
        self._since = now


class Scratch:
    """One thread's arrays, reused from tile to tile, its counts and its clock."""

    def __init__(self, dtype, smooth: bool):
        self.dtype, self.smooth = dtype, smooth
        self.counts = np.zeros(len(COUNTS), np.int64)
        self.clock = Clock()
        self.tally = new_tally()                    # of all waves
        self.waves = [new_wave(0, dtype, self.tally, smooth), new_wave(0, dtype, self.tally, smooth)]
        self.paths: list[np.ndarray] = []           # by level, see `gloss.roughen`
        self.beam = new_beam(0, 0, dtype, self.tally)
        self.target = self.number = self.zeros = np.zeros(0, np.int32)
        self.sample, self.signs = np.zeros((3, 0), np.float32), np.zeros(0, np.float32)

    def renew(self) -> None:
        """Count from nothing, for another picture."""
        self.counts, self.clock = np.zeros(len(COUNTS), np.int64), Clock()
        self.tally[COUNTED] = 0

    def wave(self, level: int, n: int) -> Wave:
        """The wave of a bounce, with room for n rays. It takes the place of that before the one it comes from: what has not been touched
        yet costs 2 us a page, which for a first picture was half its time."""
        which = level % len(self.waves)
        if self.waves[which].owner.shape[0] < n:
            self.waves[which] = new_wave(n * 5 // 4, self.dtype, self.tally, self.smooth)
        return self.waves[which]

    def path(self, level: int, n: int) -> np.ndarray:
        """The ways that n rays of a bounce have come; those of the eye, level 0, are 1."""
        while len(self.paths) <= level:
            self.paths.append(np.ones(0, np.int32))
        if len(self.paths[level]) < n:
            self.paths[level] = np.ones(n * 5 // 4, np.int32)
        return self.paths[level]

    def nothing(self, n: int) -> np.ndarray:
        """For each of n hits that nothing is in its light's way."""
        if len(self.zeros) < n:
            self.zeros = np.zeros(padded(n * 5 // 4), np.int32)
        return self.zeros

    def primary(self, n: int) -> Wave:
        """The first wave, its pixels, the numbers of its samples, what they bring and how they count, with room for n rays."""
        if len(self.target) < n:
            self.target, self.number, self.sample = np.empty(n, np.int32), np.empty(n, np.int32), np.empty((3, padded(n)), np.float32)
            self.signs = np.empty(n, np.float32)
        return self.wave(0, n)

    @property
    def nbytes(self) -> int:
        """Bytes of all waves and of what belongs to them."""
        return nbytes((self.waves, self.paths, self.beam, self.target, self.number, self.zeros, self.sample, self.signs))

    def beams(self, n: int, lights: int):
        """A beam with room for shadow rays from n hits toward so many lights."""
        if self.beam.answer.shape[1] < n or self.beam.owner.shape[0] < padded(n) * lights + LANES:
            self.beam = new_beam(n * 5 // 4, lights, self.dtype, self.tally)
        return self.beam


class Stale(Exception):
    """What is being traced is not wanted any more."""


class First(NamedTuple):
    """What goes along with a wave of first samples."""

    film: films.Film            # notes which lights reach the hits, if it has room for that
    recall: Recall | None       # what is known of this tile from before


CODE: dict[type, dict[Callable, Callable]] = defaultdict(dict)      # of kernels that have run, by the precision of the rays


class Tracer:
    """Traces tiles of one scene from one camera. Holds nothing that changes but the kernels it has met, so threads may share it."""

    def __init__(self, geometry: Geometry, plan: Plan, settings: Settings, view: np.ndarray, lens: np.ndarray | None, up,
                 background: Background, fog: Fog | None):
        self.geometry, self.plan, self.settings, self.view, self.lens = geometry, plan, settings, view, lens
        self.code = CODE[geometry.dtype]
        self.look = shading.make_look(geometry.leaves, geometry.leaf, plan.ambient, background, up)
        self.lamps = [self._lamp(light) for light in plan.lights]
        names = [group.kind.name for group in geometry.groups]
        self.meet = [group.kind.textbook if plan.textbook and group.kind.textbook else group.kind.intersect for group in geometry.groups]
        self.laps = [Laps((f"hits: {name}", name), ("surface at the hits", name), ("shadow rays", name)) for name in names]
        # something asks which sample a ray belongs to
        self.filter = filters.made(settings.filter) if plan.filter else None
        self.numbered = lens is not None or plan.gloss or plan.filter or any(lamp.sampled for lamp in self.lamps)
        self.fog = fogs.numbers(fog) if plan.fog else None
        self.ends = np.array([group.first + len(group.owner) for group in geometry.groups], np.int64)
        # numbers of primitives whose surface rows are kept
        self.lasting = [(group.first, group.first + len(group.owner)) for group in geometry.groups if group.kind.lasting]

    @staticmethod
    def _lamp(light: Light) -> Lamp:
        name, color = type(light).__name__.lower(), np.multiply(light.color, light.intensity, dtype=float)
        return Lamp(SHINE[type(light)], light.numbers(), color, isinstance(light, SAMPLED), shadow_key(light),
                    (f"light: {name}", f"light-{name}"), (f"light: {name}", "lit"))

    def run(self, kernel: Callable, *arguments):
        """Call a kernel. Within one precision its arguments have the same types every time, so they are looked at once: that saves 2 of
        a call's 3 us, and of the first one in a picture some hundred."""
        code = self.code.get(kernel)
        if code is None:
            code = self.code[kernel] = kernel.compile(tuple(map(typed, arguments)))
        return code(*arguments)

    def tile(self, scratch: Scratch, film: films.Film, tile: np.ndarray, sample: int, stale: Callable[[], bool],
             memory: Memory | None = None) -> bool:
        """Trace one sample of a tile (see `eye.cast`) onto the film, unless it is there already; False if it was given up half way, the
        film then as before. With a memory, what first samples have met is taken from there and kept there."""
        wave = scratch.primary(int(tile[2] * tile[3]))
        scratch.clock.start()
        n = self.run(cast, wave, scratch.target, self.view, tile, sample, self.settings.seed)
        if self.numbered:
            scratch.number[:n] = sample
        if n == 0 or film.count[scratch.target[0]] > sample:
            return True
        if sample > 0:
            return self._trace(scratch, film, wave, n, stale)
        recall = None if memory is None else memory.recall(tile)
        if not self._trace(scratch, film, wave, n, stale, First(film, recall)):
            return False
        if recall is not None and recall.grown:
            memory.keep(tile, recall)
        return True

    def listed(self, scratch: Scratch, film: films.Film, pixels: np.ndarray, stale: Callable[[], bool]) -> bool:
        """The same for further samples of a list of pixels (see `eye.cast_list`)."""
        if film.count[pixels[0, 0]] > pixels[0, 1]:
            return True
        each = pixels[:, 2] - pixels[:, 1]
        wave = scratch.primary(int(each.sum()))
        scratch.clock.start()
        n = self.run(cast_list, wave, scratch.target, self.view, self.settings.size[0], pixels, self.settings.seed)
        if self.numbered:
            scratch.number[:n] = np.arange(n) - np.repeat(np.cumsum(each) - pixels[:, 2], each)
        return self._trace(scratch, film, wave, n, stale)

    def _trace(self, scratch: Scratch, film: films.Film, wave: Wave, n: int, stale: Callable[[], bool], first: First | None = None) -> bool:
        """Follow a wave of primary rays and add what it brings to the film; note what it hits if it holds its pixels' first samples."""
        counts, clock = np.zeros(len(COUNTS), np.int64), scratch.clock
        clock.lap(CAST)
        if self.filter is not None and first is None:   # a first sample is the pixel's centre
            filters.spread(wave, n, scratch.target, scratch.number, self.view, self.settings.size[0], self.filter.place, self.filter.sign,
                           self.settings.seed, scratch.signs)
            clock.lap(SPREAD)
        if self.lens is not None and first is None:     # and goes through the middle
            bend(wave, n, scratch.target, scratch.number, self.lens, self.settings.seed)
            clock.lap(BEND)
        counts[PRIMARY] = n
        try:
            self._hit(clock, wave, n, counts, stale, first)
            counts[PRIMARY_HITS] += np.count_nonzero(wave.rays.prim[:n] >= 0)
            if first is not None:
                self._note(scratch, film, wave, n, first.recall)
            if VIEW[self.settings.view].needs_light:
                self._follow(scratch, wave, n, counts, stale, first)
            else:
                scratch.sample[:, :n] = 0
        except Stale:
            if first is not None and len(film.lit):     # what it noted of lights does not count
                film.lit[scratch.target[:n]] = 0
            return False
        if len(film.plain):
            if first is not None:
                scratch.signs[:n] = 1
            counts[NONFINITE] = filters.commit(film, scratch.sample, n, scratch.target, scratch.signs)
        else:
            counts[NONFINITE] = self.run(films.commit, film, scratch.sample, n, scratch.target)
        clock.lap(FILM)
        scratch.counts += counts
        return True

    def _note(self, scratch: Scratch, film: films.Film, wave: Wave, n: int, recall: Recall | None) -> None:
        """Note on the film what first samples hit, unless it is there from before."""
        if recall is None or not recall.noted:
            self.run(films.note_first_hits, film, wave, n, scratch.target)
            for group in self.geometry.groups:
                if group.kind.doubtful:
                    films.note_doubt(film, wave, n, scratch.target, group.first, group.first + len(group.owner))
                if group.kind.textbook is not None and self.plan.textbook:
                    prim, last = wave.rays.prim[:n], group.first + len(group.owner)
                    film.doubt[scratch.target[:n][(group.first <= prim) & (prim < last)]] = 1
        if recall is not None:
            recall.note_film()
        scratch.clock.lap(FILM)

    def _follow(self, scratch: Scratch, wave: Wave, n: int, counts: np.ndarray, stale: Callable[[], bool], first: First | None) -> None:
        """Light a wave that has hit, and all that comes of it, level by level."""
        clock = scratch.clock
        for depth in range(1, self.settings.max_depth + 1):
            if depth > 1:
                self._hit(clock, wave, n, counts, stale, first)
            self._light(scratch, wave, n, depth, counts, stale, first)
            if self.fog is not None:
                self.run(fogs.dim, wave, n, self.fog)
                clock.lap(DIM)
            self.run(films.deposit, wave, n, scratch.sample, depth == 1)
            clock.lap(DEPOSIT)
            if stale():
                raise Stale
            if not self.plan.bounces or depth == self.settings.max_depth:
                return
            child = scratch.wave(depth, 2 * n)
            sent = self.run(shading.bounce, wave, n, self.look, child, counts)
            clock.lap(ONWARD)
            if self.plan.gloss and first is None:       # a first sample goes the smooth way
                gloss.roughen(wave, child, sent, self.look, scratch.path(depth - 1, n), scratch.path(depth, sent), scratch.target,
                              scratch.number, self.settings.seed)
                clock.lap(ROUGHEN)
            n, wave = sent, child
            if n == 0:
                return

    def _hit(self, clock: Clock, wave: Wave, n: int, counts: np.ndarray, stale: Callable[[], bool], first: First | None) -> None:
        """Nearest hits and their surfaces. Rays of which they are known are not traced, nor counted."""
        recall, known, spared = first and first.recall, 0, CAST     # looking up counts to what it spares
        if recall is None:
            wave.rays.doubt[:n] = 0     # only kinds that can doubt write it
        else:
            primary = not recall.levels
            known, hits, reflected, refracted = recall.hits(wave, n)
            if primary:
                counts[PRIMARY] -= known
                counts[PRIMARY_HITS] -= hits
            else:
                counts[REFLECTION] -= reflected
                counts[REFRACTION] -= refracted
                spared = ONWARD
            clock.lap(spared)
        for group, meet, laps in zip(self.geometry.groups, self.meet, self.laps) if known < n else ():
            self.run(meet, wave.rays, n, group.tree, group.table, group.first, CLOSEST)
            clock.lap(laps.hits)
            if stale():
                raise Stale
        if recall is not None:
            recall.note_hits(wave, n)
            clock.lap(spared)
        given = recall is not None and bool(self.lasting) and recall.rows(wave)
        found = [True] if len(self.ends) == 1 else recall and recall.levels[-1].found
        if found is None:
            flags = np.zeros(len(self.ends), bool)
            self.run(find_kinds, wave.rays.prim, n, self.ends, flags)
            found = flags.tolist()
            if recall is not None:
                recall.levels[-1].found = found
        for group, laps, there in zip(self.geometry.groups, self.laps, found):
            if there and not (given and group.kind.lasting):
                self.run(group.kind.surface, wave.rays, n, wave.surface, group.table, group.first)
                clock.lap(laps.surface)
        if recall is not None and self.lasting and recall.levels[-1].rows is None:
            recall.note_rows(wave, n, self.lasting)
            clock.lap(spared)

    def _light(self, scratch: Scratch, wave: Wave, n: int, depth: int, counts: np.ndarray, stale: Callable[[], bool],
               first: First | None) -> None:
        clock = scratch.clock
        if not self.lamps:
            self.run(shading.glow, wave, n, self.look, NO_ANSWER)
            clock.lap(GLOWING)
            return
        recall, share = first and first.recall, np.float32(1 / len(self.lamps))
        reaches = self._reaches(scratch, n, recall, first.film.lit if first is not None and depth == 1 else UNNOTED, share)
        # what a light brings at once must come before what the next one's rays bring
        together = 1 if any(len(reach.depth) for reach in reaches) else min(max(SHADOW_RAYS // n, 1), len(self.lamps))
        beam = scratch.beams(n, together)
        self.run(shading.glow, wave, n, self.look, beam.answer)
        clock.lap(GLOWING)
        pairs = LIGHTS + depth * LEVEL
        for k in range(0, len(self.lamps), together):
            m, lamps, ends = 0, self.lamps[k:k + together], [0]
            for j, lamp in enumerate(lamps, k):
                draw = (Draw(scratch.target, scratch.number, pairs + j, self.settings.seed),) if lamp.sampled else ()
                m = self.run(lamp.shine, wave, n, lamp.numbers, lamp.color, beam, m, reaches[j], *draw)
                ends.append(m)
                clock.lap(lamp.shining)
            if m == 0:
                continue
            if self.plan.shadows:
                known, blocked = self._shadows(clock, beam, [(lamp.key, *ends[j:j + 2]) for j, lamp in enumerate(lamps)], stale, recall)
                counts[SHADOW] += m - known
                counts[SHADOW_HITS] -= blocked
            if first is not None and depth == 1 and len(first.film.lit):
                films.note_lit(first.film, beam, m, scratch.target, share)
            counts[SHADOW_HITS] += self.run(shading.gather, wave, beam, m)
            clock.lap(lamps[0].gathering)

    def _reaches(self, scratch: Scratch, n: int, recall: Recall | None, lit: np.ndarray, share: np.float32) -> list[Reach]:
        """What is known of how far each light reaches the hits of a wave: all of it where there are no shadows."""
        if not self.plan.shadows:
            depths = [scratch.nothing(n)] * len(self.lamps)
        else:
            depths = [recall and recall.reach(lamp.key) for lamp in self.lamps]
        target = scratch.target[:n]
        return [Reach(UNTOLD if depth is None else depth, lit, target, share) for depth in depths]

    def _shadows(self, clock: Clock, beam: Beam, parts: list[tuple], stale, recall: Recall | None) -> tuple[int, int]:
        """What is in the way of a beam's rays, those of each light being a part (key, first column, one past the last). Returns of how many
        it was known, and how many of these reach no light."""
        m, known, blocked = parts[-1][2], 0, 0
        if recall is not None:
            known = m - sum(recall.shadows(beam, *part) for part in parts)
            blocked = int(np.count_nonzero(beam.rays.prim[:m] >= 0))
            clock.lap(CASTING)
        for group, meet, laps in zip(self.geometry.groups, self.meet, self.laps) if known < m else ():
            self.run(meet, beam.rays, m, group.tree, group.table, group.first, self.look.opacity)
            clock.lap(laps.shadows)
            if stale():
                raise Stale
        if recall is not None and known < m:
            for part in parts:
                recall.note_shadows(beam, *part)
            clock.lap(CASTING)
        return known, blocked
