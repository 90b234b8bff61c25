"""What the first samples of a picture met, kept for the next one: hits of the eye's rays and of those that come of them, and how far light
reaches each hit.

A tile's waves are kept level by level, a column a ray. A ray of the first level is known by its column, for a tile's rays are always cast
in the same order; one of a later level by the ray it comes from and the way it went (`Wave.source`). So when materials, lights or fog have
changed, the tile goes through the same stages as ever, and where a ray is known, what it meets is looked up and not traced. What an edit
leaves valid is said in `rtcore.edits`.

Seventeen bytes a ray (thirteen with float32), four for each light that shone on it, and for hits on formulas and blobs their surface rows,
60 bytes (32) or, beside smooth meshes, 84 (44), which take longer to work out.
"""
import threading
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline, kernel
from rtcore.wave import DEAD, DX, OPAQUE, OX, START, T, Beam, Wave, padded

UNKNOWN = -2            # in place of a primitive: to be traced again
UNSEEN = -1             # in place of an optical depth: no shadow ray is known
BOXES = 64              # that may have been added before what is kept is given up
NO_BOXES = np.zeros((0, 6))
UNMOVED = np.zeros(0, np.int32)
MOST = 1 << 30          # bytes; further tiles are not kept


class Shade(NamedTuple):
    """How far one light reaches the hits of a wave."""

    depth: np.ndarray       # int32 (n, whole vectors): optical depth on the way, OPAQUE + the primitive in the way, or UNSEEN
    boxes: np.ndarray       # (m, 6): low and high corners of what came into the scene since


def _whole(depth: np.ndarray) -> np.ndarray:
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


class Level:
    """One wave of a tile, n rays: int32 `source` (n) as `Wave` has it, 0 for the eye's; what they met, int32 `prim` (n), `t` (n) in the
    render's precision, uint8 `doubt` (n), as `Rays` has them."""

    def __init__(self, source: np.ndarray, prim: np.ndarray, t: np.ndarray, doubt: np.ndarray):
        self.source, self.prim, self.t, self.doubt = source, prim, t, doubt
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
def _recall_all(rays, prim, t, doubt):
    """Give all rays their known hits."""
    for i in range(len(prim)):
        rays.ray[T, i] = t[i]
    for i in range(len(prim)):
        rays.prim[i] = prim[i]
        rays.doubt[i] = doubt[i]


@kernel
def _match(source, parents, old, was):
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
def _recall(rays, was, prim, t, doubt, source, boxes, known):
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
def _recall_shadows(beam, first, last, depth, boxes):
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
def _note_shadows(beam, first, last, depth):
    """Keep what columns first .. last - 1 of the beam met."""
    for j in range(first, last):
        p = beam.rays.prim[j]
        depth[beam.owner[j]] = beam.rays.depth[j] if p < 0 else OPAQUE + p


@kernel
def _take_rows(surface, at, rows):
    """rows (7 or 10, k) = those of a wave's columns `at`."""
    for r in range(rows.shape[0]):
        for j in range(len(at)):
            rows[r, j] = surface[r, at[j]]


@kernel
def _put_rows(surface, at, rows):
    """The other way."""
    for r in range(rows.shape[0]):
        for j in range(len(at)):
            surface[r, at[j]] = rows[r, j]


@kernel
def _put_moved(surface, was, at, rows, place):
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
def _renumber(prim, doubt, number):
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
def _renumber_shade(depth, number, through):
    """The same for what is in the light's way; with `through` also what only dims it may be gone."""
    for i in range(len(depth)):
        if depth[i] >= OPAQUE:
            p = number[depth[i] - OPAQUE]
            depth[i] = UNSEEN if p == UNKNOWN else OPAQUE + p
        elif through and depth[i] > 0:
            depth[i] = UNSEEN


class Memory:
    """What is kept of one picture, by tile. Threads may use it at once, each for tiles of its own."""

    def __init__(self):
        self.tiles: dict[bytes, list[Level]] = {}
        self.nbytes = 0
        self._sizes: dict[bytes, int] = {}
        self._lock = threading.Lock()

    def recall(self, tile: np.ndarray) -> "Recall":
        """For tracing a tile again."""
        return Recall(self.tiles.get(tile.tobytes(), []))

    def keep(self, tile: np.ndarray, recall: "Recall") -> None:
        """What was met on a tile now."""
        key, levels = tile.tobytes(), recall.kept()
        size = sum(level.nbytes for level in levels)
        with self._lock:
            grown = size - self._sizes.get(key, 0)
            if self.nbytes + grown <= MOST or key in self.tiles:
                self.tiles[key], self._sizes[key] = levels, size
                self.nbytes += grown

    def covers(self, tiles: Iterable[np.ndarray]) -> bool:
        """Whether something is kept of all these tiles."""
        return all(tile.tobytes() in self.tiles for tile in tiles)

    def forget_film(self) -> None:
        """There is another film, which has noted nothing."""
        for levels in self.tiles.values():
            levels[0].noted = False

    def forget_onward(self) -> None:
        """Drop what reflected and refracted rays met."""
        for levels in self.tiles.values():
            del levels[1:]

    def forget_shadows(self, but: frozenset = frozenset()) -> None:
        """Drop what lights shine on, but for those named."""
        for levels in self.tiles.values():
            for level in levels:
                level.shades = {key: shade for key, shade in level.shades.items() if key in but}

    def renumber(self, number: np.ndarray, through: bool, boxes: np.ndarray) -> None:
        """Shapes went and came. number: int32, the new number of each primitive, or UNKNOWN; `through`: something that went let light
        through; boxes (m, 6): around what came."""
        moved = bool((number != np.arange(len(number))).any())
        for levels in self.tiles.values():
            for level in levels:
                if moved or level.doubt.any():
                    level.noted, level.found = False, None
                    level.whole &= not _renumber(level.prim, level.doubt, number)
                if len(boxes):
                    level.boxes = np.concatenate([level.boxes, boxes])
                for key, (depth, since) in level.shades.items():
                    if moved or through:
                        _renumber_shade(depth, number, through)
                    if len(boxes):
                        level.shades[key] = Shade(depth, np.concatenate([since, boxes]))
                level.shades = {key: shade for key, shade in level.shades.items() if len(shade.boxes) <= BOXES}
        if any(len(level.boxes) > BOXES for levels in self.tiles.values() for level in levels):
            self.tiles.clear()
            self._sizes.clear()
            self.nbytes = 0


class Recall:
    """One tile, traced again: hands out what is known of each wave, and collects what is to be kept."""

    def __init__(self, kept: list[Level]):
        self._kept = kept
        self.levels: list[Level] = []
        self.grown = False                      # something is known that was not
        self._was: np.ndarray | None = None     # the kept column of each ray of the wave at hand, -1 unknown; None: its own
        self._unknown = 0                       # how many there are

    def hits(self, wave: Wave, n: int) -> Known:
        """Give the rays of the next wave the hits that are known."""
        depth = len(self.levels)
        old, source = self._kept[depth] if depth < len(self._kept) else None, wave.source[:n]
        if old is None:
            self._was = np.full(n, -1, np.int32)
        elif depth > 0:
            self._was = self._matched(old, source)
        if self._was is None and old.whole and not len(old.boxes):
            _recall_all(wave.rays, old.prim, old.t, old.doubt)
            self._unknown = 0
            return old.told
        wave.rays.doubt[:n] = 0     # only kinds that can doubt write it
        known = np.zeros(4, np.int64)
        if old is not None:
            self._was = np.arange(n, dtype=np.int32) if self._was is None else self._was
            _recall(wave.rays, self._was, old.prim, old.t, old.doubt, old.source, old.boxes, known)
        self._unknown = n - int(known[0])
        return Known(*map(int, known))

    def _matched(self, old: Level, source: np.ndarray) -> np.ndarray | None:
        """The kept columns of rays that come from those of the wave before."""
        if self._was is None and np.array_equal(source, old.source):
            return None
        was = np.empty(len(source), np.int32)
        _match(source, UNMOVED if self._was is None else self._was, old.source, was)
        return was

    def note_hits(self, wave: Wave, n: int) -> None:
        """The wave has met what it meets."""
        rays, depth = wave.rays, len(self.levels)
        if self._was is None:       # all of it was known
            self.levels.append(self._kept[depth])
            return
        old = self._kept[depth] if depth < len(self._kept) else None
        if old is not None:     # kernels that can doubt have begun anew, for known rays too
            rays.doubt[:n] = np.where(self._was < 0, rays.doubt[:n], old.doubt[self._was])
        # a wave that is a part of the kept one: what is kept tells more, and the next edit may ask for it
        self.grown |= old is None or not old.whole or len(old.boxes) > 0 or self._unknown > 0
        level = Level(np.zeros(n, np.int32) if depth == 0 else wave.source[:n].copy(), rays.prim[:n].copy(), rays.ray[T, :n].copy(),
                      rays.doubt[:n].copy())
        if old is not None:
            for key, (kept, boxes) in old.shades.items():
                level.shades[key] = Shade(_whole(np.where(self._was < 0, UNSEEN, kept[self._was])), boxes)
        self.levels.append(level)

    def rows(self, wave: Wave) -> bool:
        """Give the wave the surface rows that are known of kinds whose rows take long; False if they are not, all of them."""
        depth = len(self.levels) - 1
        old = self._kept[depth] if depth < len(self._kept) else None
        if old is None or old.rows is None:
            return False
        if len(old.rows.rows) != len(wave.surface):     # a mesh that brings normals has come or gone
            old.rows = None
            return False
        if self._was is None:
            _put_rows(wave.surface, *old.rows)
        elif self._unknown:
            return False
        else:
            _put_moved(wave.surface, self._was, *old.rows, np.empty(len(old.prim), np.int32))
        return True

    def note_rows(self, wave: Wave, n: int, spans: Iterable[tuple[int, int]]) -> None:
        """The wave has them now; spans: first and one past the last of the primitives of each such kind."""
        prim = wave.rays.prim[:n]
        at = np.concatenate([np.flatnonzero((first <= prim) & (prim < last)) for first, last in spans]).astype(np.int32)
        self.levels[-1].rows = rows = Rows(at, np.empty((len(wave.surface), len(at)), wave.surface.dtype))
        _take_rows(wave.surface, *rows)

    def kept(self) -> list[Level]:
        """All that is known of the tile now; of waves that were not wanted this time, what was known before."""
        return self.levels + (self._kept[len(self.levels):] if self._was is None else [])

    @property
    def noted(self) -> bool:
        """Whether the film has noted the first wave's hits."""
        return self.levels[0].noted

    def note_film(self) -> None:
        """Now it has."""
        self.levels[0].noted = True

    def reach(self, key: tuple) -> np.ndarray | None:
        """How far a light is known to reach the hits of the wave at hand, as in `Shade`; None if nothing is known for sure."""
        shade = self.levels[-1].shades.get(key)
        return None if shade is None or len(shade.boxes) else shade.depth

    def shadows(self, beam: Beam, key: tuple, first: int, last: int) -> int:
        """Give one light's rays, columns first .. last - 1, what is known of their way; returns how many have to be traced."""
        shade = self.levels[-1].shades.get(key)
        if shade is None:
            return last - first
        return _recall_shadows(beam, first, last, shade.depth, shade.boxes)

    def note_shadows(self, beam: Beam, key: tuple, first: int, last: int) -> None:
        """They have met what they meet."""
        self.grown, level = True, self.levels[-1]
        shade = level.shades.get(key)
        if shade is None or len(shade.boxes):       # of other columns it is not known what the new boxes do
            shade = level.shades[key] = Shade(np.full(padded(len(level.prim)), UNSEEN, np.int32), NO_BOXES)
        _note_shadows(beam, first, last, shade.depth)
