"""One family of rays against the oracle: every solver of a shape, in one precision."""
import math
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rtcore.api import intersect
from rtcore.fields import FieldError
from rtcore.flatten import DTYPES, flatten
from rtcore.reports.condition import condition
from rtcore.reports.families import Batch, batches
from rtcore.reports.oracle import crossings, mp
from rtcore.reports.rows import Point, Row, Worst, example
from rtcore.reports.targets import TARGETS, UNIT
from rtcore.scene import Shape, invertible
from rtcore.solvers import METHODS, RENDERER, names, roots
from rtcore.wave import CLOSEST, DX, OX, START, T, new_rays

#: Crossings nearer to the origin than that, in units of its own distance from 0, are at the origin: the oracle has 50 digits.
AT_ORIGIN = mp.mpf(10) ** -40
LOST = 8            # an error of more ulps, and of more times the condition, may mean another crossing
MOST_POINTS, MOST_WORST = 60, 3
TIMED_BATCHES, REPEATS = 2, 4


class Answer(NamedTuple):
    """What a solver says of n rays: the first root past 0, inf for none; which rays it hits; which have something that is not finite."""

    t: np.ndarray
    hit: np.ndarray
    wild: np.ndarray


class Truth(NamedTuple):
    """The t of a ray's first crossing past 0, an mpf, None for a miss; and those of all its crossings."""

    t: object
    all: tuple


def truths(batch: Batch) -> list[Truth]:
    """What is true of each ray."""
    found = []
    for o, d in zip(batch.origins, batch.directions):
        least = AT_ORIGIN * float(np.abs(o).max()) / float(np.abs(d).max())
        every = tuple(c.t for c in crossings(batch.shape, batch.matrix, o, d))
        found.append(Truth(next((t for t in every if t > least), None), every))
    return found


def by_renderer(batch: Batch, precision: str) -> Answer:
    """What the renderer says; a shape that it refuses has no finite answer."""
    if refused(batch, precision):
        n = len(batch.origins)
        return Answer(np.full(n, np.nan), np.zeros(n, bool), np.ones(n, bool))
    hits = intersect(batch.scene, batch.origins, batch.directions, precision=precision, threads=1)
    hit = hits.node >= 0
    return Answer(hits.t, hit, hit & ~(np.isfinite(hits.t) & np.isfinite(hits.normal).all(axis=1)) | np.isnan(hits.t))


def refused(batch: Batch, precision: str) -> bool:
    """Whether the renderer takes a shape's numbers to be beyond the precision."""
    try:
        flatten(batch.scene, precision)
    except FieldError:
        return True
    return False


def own_space(batch: Batch) -> np.ndarray:
    """The rays (6, n) in the shape's own space, taken there as the lecture does, in the precision itself."""
    o, d = batch.origins, batch.directions
    if batch.transform:
        inverse = invertible(batch.matrix)[:3, :3].T.astype(o.dtype)
        with np.errstate(over="ignore", invalid="ignore"):
            o, d = (o - batch.matrix[:3, 3].astype(o.dtype)) @ inverse, d @ inverse
    return np.ascontiguousarray(np.concatenate([o.T, d.T]))


def by_solver(batch: Batch, name: str) -> Answer:
    with np.errstate(all="ignore"):
        found, count = roots(batch.shape, name, own_space(batch))
    there = np.arange(found.shape[1]) < count[:, None]
    good = there & np.isfinite(found)
    t = np.where(good & (found > 0), found, np.inf).min(axis=1)
    return Answer(t, np.isfinite(t), (there & ~good).any(axis=1))


def ulps(t, truth, dtype) -> float:
    """The error of t in units of the last place of the true value."""
    return abs(float((mp.mpf(float(t)) - truth) / mp.mpf(float(np.spacing(dtype(abs(float(truth))))))))


def measure(shape: type[Shape], family: str, precision: str, n: int, seed: int, timed: int) -> Iterator[Row]:
    """A row for each solver of the shape, over about n rays of the family; `timed` is how many rays the clock is held to at a time."""
    dtype = DTYPES[precision]
    sets = [batch for batch in batches(family, shape, dtype, n, seed) if len(batch.origins)]
    true = [truths(batch) for batch in sets]
    for name in names(shape):
        tally = _Tally(shape, name, precision, family)
        for batch, truth in zip(sets, true):
            tally.add(batch, truth, by_renderer(batch, precision) if name == RENDERER else by_solver(batch, name))
        taken = [batch for batch in sets[:TIMED_BATCHES] if name != RENDERER or not refused(batch, precision)]
        yield tally.row(min((_nanoseconds(batch, name, precision, timed) for batch in taken), default=math.nan))


class _Tally:
    """Counts one solver's errors."""

    def __init__(self, shape: type[Shape], name: str, precision: str, family: str):
        self.shape, self.name, self.precision, self.family = shape, name, precision, family
        self.dtype = DTYPES[precision]
        self.target = TARGETS[shape] if name == RENDERER else None
        self.rays = self.wrong = self.nonfinite = self.missed = 0
        self.errors: list[float] = []
        self.points: list[Point] = []
        self.worst: list[Worst] = []

    def add(self, batch: Batch, truth: list[Truth], answer: Answer) -> None:
        """One batch's rays."""
        scale = abs(np.linalg.det(batch.matrix[:3, :3])) ** (1 / 3) * batch.size
        distance = np.abs((batch.origins - batch.matrix[:3, 3]) @ (invertible(batch.matrix)[:3, :3].T / batch.size)).max(axis=1)
        for i, (true, every) in enumerate(truth):
            if true is not None and not np.finfo(self.dtype).tiny <= float(true) <= np.finfo(self.dtype).max:
                continue        # no number of the type is right
            self.rays += 1
            if answer.wild[i]:
                self.nonfinite += 1
                self._show(True, math.inf, f"not finite (t = {answer.t[i]})", batch, i, true)
            if answer.hit[i] != (true is not None):
                self._mistaken("a miss, reported as a hit" if true is None else "a hit, reported as a miss", batch, i, true)
            elif true is not None and not answer.wild[i]:
                error = ulps(answer.t[i], true, self.dtype)
                if error > LOST and self._another(error, float(answer.t[i]), batch, i, true, every):
                    self._mistaken(f"another crossing than the first (t = {answer.t[i]})", batch, i, true)
                    continue
                self.errors.append(error)
                self.points.append(Point(float(distance[i]), float(scale), error))
                self._show(self._over(error, batch, i, true), error, f"{error:.3g} ulp", batch, i, true)

    def _mistaken(self, what: str, batch: Batch, i: int, true) -> None:
        """Count a wrong hit or miss."""
        self.wrong += 1
        self._show(self.target is not None and self.target.counts_hits(self.family), math.inf, what, batch, i, true)

    def _another(self, error: float, t: float, batch: Batch, i: int, true, every: tuple) -> bool:
        """Whether a hit is of another crossing: one that is nearer, and the first further off than its condition explains."""
        nearer = any(abs(t - other) < abs(t - true) for other in every)
        return nearer and error > self._explained(LOST, batch, i, true)

    def _over(self, error: float, batch: Batch, i: int, true) -> bool:
        """Whether the error of a hit is beyond the target."""
        if self.target is None or error <= self.target.ulp[self.precision]:
            return False
        return not self.target.factor or error > self._explained(self.target.factor, batch, i, true)

    def _explained(self, factor: float, batch: Batch, i: int, true) -> float:
        """factor · condition · u in ulps of the true t."""
        sensitive = condition(batch.shape, batch.matrix, batch.origins[i], batch.directions[i], true)
        return factor * UNIT[self.precision] * sensitive * float(true) / float(np.spacing(self.dtype(float(true))))

    def _show(self, missed: bool, ulp: float, what: str, batch: Batch, i: int, true) -> None:
        """Keep the ray if it is among the worst; count it if it misses the target."""
        self.missed += missed
        if len(self.worst) < MOST_WORST or (missed, ulp) > self.worst[-1][:2]:
            words = f"{what}; true t {'none' if true is None else mp.nstr(true, 20)}"
            self.worst.append(Worst(missed, ulp, words, code(batch, i, self)))
            self.worst = sorted(self.worst, reverse=True)[:MOST_WORST]

    def row(self, nanoseconds: float) -> Row:
        """The row of all that was added."""
        p50, p99, most = (float(np.percentile(self.errors, q)) for q in (50, 99, 100)) if self.errors else (math.nan,) * 3
        met = None if self.target is None else self.missed == 0
        points = sorted(self.points, key=lambda p: -p.ulp)
        points = points[:8] + points[8::max(len(points) // (MOST_POINTS - 8), 1)]
        words = self.target.words(self.precision, self.family) if self.target else ""
        return Row(self.shape.__name__.lower(), self.name, self.precision, self.family, self.rays, self.wrong, p50, p99, most,
                   self.nonfinite, nanoseconds, words, met, tuple(self.worst), tuple(points))


def code(batch: Batch, i: int, tally: _Tally) -> str:
    """Python code that does one ray of a batch again."""
    if tally.name == RENDERER:
        return example(batch.shape, batch.transform, batch.origins[i], batch.directions[i], tally.precision)
    x = ", ".join(f"[{value!r}]" for value in own_space(batch)[:, i].tolist())
    return f"solvers.roots({batch.shape!r}, {tally.name!r}, np.array([{x}], np.{np.dtype(tally.dtype).name}))"


# --- time ---

def _nanoseconds(batch: Batch, name: str, precision: str, n: int) -> float:
    """Nanoseconds a ray, the least of some runs over the batch's rays, repeated until they are n."""
    reps = np.resize(np.arange(len(batch.origins)), n)
    run = _kernels(batch, precision, reps) if name == RENDERER else _solver(batch, name, reps)
    run()
    return min(run() for _ in range(REPEATS)) / n * 1e9


def _solver(batch: Batch, name: str, reps: np.ndarray):
    method, rays = METHODS[type(batch.shape)][name], np.ascontiguousarray(own_space(batch)[:, reps])
    numbers = method.numbers(batch.shape).astype(rays.dtype)
    found, count = np.empty((len(reps), method.most), rays.dtype), np.zeros(len(reps), np.int32)

    def run() -> float:
        start = time.perf_counter()
        with np.errstate(all="ignore"):
            method.solve(rays, numbers, found, count)
        return time.perf_counter() - start
    return run


def _kernels(batch: Batch, precision: str, reps: np.ndarray):
    geometry = flatten(batch.scene, precision)
    n = len(reps)
    rays = new_rays(n, geometry.dtype)
    rays.ray[:], rays.ray[DX] = 0, 1
    rays.ray[OX:OX + 3, :n], rays.ray[DX:DX + 3, :n] = batch.origins[reps].T, batch.directions[reps].T

    def run() -> float:
        rays.ray[START], rays.ray[T], rays.prim[:], rays.depth[:] = 0, np.inf, -1, 0
        start = time.perf_counter()
        for group in geometry.groups:
            group.kind.intersect(rays, n, group.tree, group.table, group.first, CLOSEST)
        return time.perf_counter() - start
    return run
