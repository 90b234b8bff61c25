"""What is kept of one wave of a tile, and the kernels that look it up and write it down."""
import functools
from typing import NamedTuple

import numpy as np

from rtcore.indirect import words_of
from rtcore.jit import inline, kernel
from rtcore.wave import DEAD, DX, OPAQUE, OX, START, T, padded

UNKNOWN = -2            # in place of a primitive: to be traced again
UNSEEN = -1             # in place of an optical depth: no shadow ray is known
NO_BOXES = np.zeros((0, 6))
UNMOVED = np.zeros(0, np.int32)


class Shade(NamedTuple):
    """How far one light reaches the hits of a wave."""

    depth: np.ndarray       # int32 (n, whole vectors): optical depth on the way, OPAQUE + the primitive in the way, or UNSEEN
    boxes: np.ndarray       # (m, 6): low and high corners of what came into the scene since


def in_whole_vectors(depth: np.ndarray) -> np.ndarray:
    """The same for whole vectors."""
    return np.concatenate([depth, np.full(padded(len(depth)) - len(depth), UNSEEN, np.int32)])


class Rows(NamedTuple):
    """Surface rows of some columns of a wave."""

    at: np.ndarray          # int32 (k): the columns
    rows: np.ndarray        # P (7 or 10, k): as `Wave.surface`


class Known(NamedTuple):
    """How many rays of a wave needed no tracing: all, those that hit something, those reflected and those refracted."""

    rays: int
    hits: int
    reflected: int
    refracted: int


class Met(NamedTuple):
    """What the n rays of a wave met."""

    source: np.ndarray      # int32 (n) as `Wave` has it, 0 for the eye's
    prim: np.ndarray        # int32 (n), as `Rays` has it
    t: np.ndarray           # P (n)
    doubt: np.ndarray       # uint8 (n), as `Rays` has it


class Level:
    """One wave of a tile, and all that is known of it."""

    def __init__(self, source: np.ndarray, prim: np.ndarray, t: np.ndarray, doubt: np.ndarray):
        self.source, self.prim, self.t, self.doubt = self.met = Met(source, prim, t, doubt)
        self.boxes = NO_BOXES
        self.whole = True                           # no hit is UNKNOWN
        self._told: Known | None = None
        self.noted = False                          # the film has noted them
        self.shades: dict[tuple, Shade] = {}        # by what makes a light's shadows
        self.rows: Rows | None = None               # of hits on kinds whose rows take long
        self.found: list[bool] | None = None        # which kinds are hit

    @property
    def told(self) -> Known:
        """What a wave is told of which all is known."""
        if self._told is None:
            n, refracted = len(self.prim), int(np.count_nonzero(self.source & 1))
            self._told = Known(n, int(np.count_nonzero(self.prim >= 0)), n - refracted, refracted)
        return self._told

    @functools.cached_property
    def words(self) -> list[int]:
        """What it met, as `indirect.value_at` reads it."""
        return words_of(self.met)

    @property
    def nbytes(self) -> int:
        return sum(a.nbytes for a in (self.source, self.prim, self.t, self.doubt, *(s.depth for s in self.shades.values()),
                                      *(self.rows or ())))


@inline
def _near(ray, i, far, boxes):
    """Whether ray i comes into one of the boxes before `far`, or passes as closely as float32 rays are off so far away."""
    slack = 2.0 ** -20 * max(abs(ray[OX, i]), abs(ray[OX + 1, i]), abs(ray[OX + 2, i])) if ray.itemsize == 4 else 0.0
    for b in range(boxes.shape[0]):
        enter, leave = 0.0, np.float64(far) * (1 + 2.0 ** -20)
        for k in range(3):
            o, d = np.float64(ray[OX + k, i]), np.float64(ray[DX + k, i])
            if d == 0:
                if o < boxes[b, k] - slack or o > boxes[b, k + 3] + slack:
                    leave = -1.0
                continue
            p, q = (boxes[b, k] - slack - o) / d, (boxes[b, k + 3] + slack - o) / d
            enter, leave = max(enter, min(p, q)), min(leave, max(p, q))
        if enter <= leave:
            return True
    return False


@kernel
def recall_all(rays, prim, t, doubt):
    """Give all rays their known hits."""
    for i in range(len(prim)):
        rays.ray[T, i] = t[i]
    for i in range(len(prim)):
        rays.prim[i] = prim[i]
        rays.doubt[i] = doubt[i]


@kernel
def match_sources(source, parents, old, was):
    """was, int32 (n): the kept columns, of which `old` are the sources, of rays with these sources; -1 where there is none. parents: those
    of the rays that they come from; length 0: they are their own. Sources grow from column to column, here and there."""
    j = 0
    for i in range(len(source)):
        wanted = source[i]
        if len(parents) > 0:
            parent = parents[wanted >> 1]
            wanted = 2 * parent + (wanted & 1) if parent >= 0 else -1
        while j < len(old) and old[j] < wanted:
            j += 1
        was[i] = j if j < len(old) and old[j] == wanted else -1


@kernel
def recall_some(rays, was, prim, t, doubt, source, boxes, known):
    """Give rays their known hits and let them be dead to the intersection kernels. was: int32 (n), a ray's column in the kept level's
    arrays, becomes -1 where nothing is known; boxes (m, 6); known: int64 (4), as `Known`."""
    for i in range(len(was)):
        old = was[i]
        if old < 0 or prim[old] == UNKNOWN or _near(rays.ray, i, t[old], boxes):
            was[i] = -1
            continue
        rays.prim[i], rays.ray[T, i], rays.ray[START, i] = prim[old], t[old], t[old]
        rays.doubt[i] = doubt[old]
        known[0] += 1
        known[1] += prim[old] >= 0
        known[2 + source[old] % 2] += 1


@kernel
def recall_shadows(beam, first, last, depth, boxes):
    """Columns first .. last - 1 of the beam get their known depths and are dead to the intersection kernels; returns how many are not
    known."""
    missing = 0
    for j in range(first, last):
        seen = depth[beam.owner[j]]
        if seen == UNSEEN or seen < OPAQUE and _near(beam.rays.ray, j, beam.rays.ray[T, j], boxes):
            missing += 1
            continue
        beam.rays.prim[j], beam.rays.depth[j] = (seen - OPAQUE, 0) if seen >= OPAQUE else (-1, seen)
        beam.rays.ray[T, j] = DEAD
    return missing


@kernel
def note_shadows(beam, first, last, depth):
    """Keep what columns first .. last - 1 of the beam met."""
    for j in range(first, last):
        p = beam.rays.prim[j]
        depth[beam.owner[j]] = beam.rays.depth[j] if p < 0 else OPAQUE + p


@kernel
def take_rows(surface, at, rows):
    """rows (7 or 10, k) = those of a wave's columns `at`."""
    for r in range(rows.shape[0]):
        for j in range(len(at)):
            rows[r, j] = surface[r, at[j]]


@kernel
def put_rows(surface, at, rows):
    """The other way."""
    for r in range(rows.shape[0]):
        for j in range(len(at)):
            surface[r, at[j]] = rows[r, j]


@kernel
def put_moved(surface, was, at, rows, place):
    """The same for columns that were those in `was`, int32. place: room for as many int32 as there were columns."""
    for i in range(len(place)):
        place[i] = -1
    for j in range(len(at)):
        place[at[j]] = j
    for i in range(len(was)):
        j = place[was[i]]
        if j >= 0:
            for r in range(rows.shape[0]):
                surface[r, i] = rows[r, j]


@kernel
def renumber(prim, doubt, number):
    """Primitives by their new numbers, UNKNOWN for those that are gone, and for hits without a proof, which hang on what else the search
    had met; returns whether there are such."""
    gone = False
    for i in range(len(prim)):
        if doubt[i] != 0:
            prim[i] = UNKNOWN
        elif prim[i] >= 0:
            prim[i] = number[prim[i]]
        gone |= prim[i] == UNKNOWN
    return gone


@kernel
def renumber_shade(depth, number, through):
    """The same for what is in the light's way; with `through` also what only dims it may be gone."""
    for i in range(len(depth)):
        if depth[i] >= OPAQUE:
            p = number[depth[i] - OPAQUE]
            depth[i] = UNSEEN if p == UNKNOWN else OPAQUE + p
        elif through and depth[i] > 0:
            depth[i] = UNSEEN
