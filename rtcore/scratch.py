"""One thread's arrays for tracing, reused from tile to tile and from picture to picture."""
import numpy as np

from rtcore.clock import Clock
from rtcore.flatten import nbytes
from rtcore.indirect import rows_for, words_of
from rtcore.lanes import LANES
from rtcore.lights import UNTOLD
from rtcore.lookup import no_kept, with_room
from rtcore.stages import COUNTS, NUMBERS, Program, State
from rtcore.wave import COUNTED, Beam, Wave, new_beam, new_tally, new_wave, padded


class Scratch:
    """The arrays, what is counted, where the time goes."""

    def __init__(self, dtype, smooth: bool):
        self.dtype, self.smooth = dtype, smooth
        self.counts = np.zeros(len(COUNTS), np.int64)
        self.clock = Clock()
        self.tally = new_tally()                    # of all waves
        self.waves = [new_wave(0, dtype, self.tally, smooth), new_wave(0, dtype, self.tally, smooth)]
        self.paths: list[np.ndarray] = []           # by level, see `gloss.roughen`
        self.beam = self._no_beam = new_beam(0, 0, dtype, self.tally)
        self.target = self.number = self.zeros = np.zeros(0, np.int32)
        self.sample, self.signs = np.zeros((3, 0), np.float32), np.zeros(0, np.float32)
        self._program: Program | None = None        # that `_state` is for
        self._state: State | None = None
        self._replaced = True                       # arrays that it holds

    def renew(self) -> None:
        """Count from nothing, for another picture."""
        self.counts, self.clock = np.zeros(len(COUNTS), np.int64), Clock()
        self.tally[COUNTED] = 0
        self._state = None

    def state(self, program: Program, laps: tuple, shadows: bool, depth: int, keep: bool) -> State:
        """The arrays as `stages.advance` takes them. laps: what its ticks are for; shadows: whether lights cast any; depth: that of the
        last bounce; keep: with room for what is known of waves."""
        lamps, kinds = len(program.lamps), len(program.kinds)
        if self._state is None or self._program is not program:
            reaches = rows_for(lamps, UNTOLD)
            reaches[:] = words_of(UNTOLD)
            self._program, self._replaced = program, True
            self._state = State(
                np.zeros(NUMBERS, np.int64), np.zeros(len(COUNTS), np.int64), self.counts, self.clock.measure(laps), *self.waves,
                self.beam, self.target, self.number, self.sample, np.zeros(kinds, bool), np.zeros(lamps + 1, np.int64), reaches,
                no_kept(depth, lamps, kinds, self.dtype))
        if self._replaced:
            odd, even = self.waves
            self._state = self._state._replace(odd=odd, even=even, beam=self.beam if lamps else self._no_beam, target=self.target,
                                               number=self.number, sample=self.sample)
            self._replaced = False
            if not shadows:
                self._state.reaches[:] = words_of(self._nothing())
        n = self._most()
        if keep and len(self._state.kept.place) < n:
            self._state = self._state._replace(kept=with_room(self._state.kept, n))
        return self._state

    def wave(self, level: int, n: int) -> Wave:
        """The wave of a bounce, with room for n rays. It takes the place of that before the one it comes from: what has not been touched
        yet costs 2 us a page, which for a first picture was half its time."""
        which = level % len(self.waves)
        if self.waves[which].owner.shape[0] < n:
            self.waves[which] = new_wave(n * 5 // 4, self.dtype, self.tally, self.smooth)
            self._replaced = True
        return self.waves[which]

    def path(self, level: int, n: int) -> np.ndarray:
        """The ways that n rays of a bounce have come; those of the eye, level 0, are 1."""
        while len(self.paths) <= level:
            self.paths.append(np.ones(0, np.int32))
        if len(self.paths[level]) < n:
            self.paths[level] = np.ones(n * 5 // 4, np.int32)
        return self.paths[level]

    def _most(self) -> int:
        """Rays that a wave may have."""
        return max(wave.owner.shape[0] for wave in self.waves)

    def _nothing(self) -> np.ndarray:
        """For each hit that a wave may have that nothing is in its light's way."""
        n = self._most()
        if len(self.zeros) < n:
            self.zeros = np.zeros(n, np.int32)
        return self.zeros

    def primary(self, n: int) -> Wave:
        """The first wave, its pixels, the numbers of its samples, what they bring and how they count, with room for n rays."""
        if len(self.target) < n:
            self.target, self.number, self.sample = np.empty(n, np.int32), np.empty(n, np.int32), np.empty((3, padded(n)), np.float32)
            self.signs = np.empty(n, np.float32)
            self._replaced = True
        return self.wave(0, n)

    def beams(self, n: int, lights: int) -> Beam:
        """A beam with room for shadow rays from n hits toward so many lights."""
        if self.beam.answer.shape[1] < n or self.beam.owner.shape[0] < padded(n) * lights + LANES:
            self.beam, self._replaced = new_beam(n * 5 // 4, lights, self.dtype, self.tally), True
        return self.beam

    @property
    def nbytes(self) -> int:
        """Bytes of all waves and of what belongs to them."""
        return nbytes((self.waves, self.paths, self.beam, self.target, self.number, self.zeros, self.sample, self.signs))
