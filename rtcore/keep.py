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
from collections.abc import Iterable, Iterator

import numpy as np

from rtcore.levels import (NO_BOXES, UNMOVED, UNSEEN, Known, Level, Rows, Shade, in_whole_vectors, match_sources, note_shadows,
                           put_moved, put_rows, recall_all, recall_shadows, recall_some, renumber, renumber_shade, take_rows)
from rtcore.wave import T, Beam, Wave, padded

BOXES = 64              # that may have been added before what is kept is given up
MOST = 1 << 30          # bytes; further tiles are not kept


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
                    level.whole &= not renumber(level.prim, level.doubt, number)
                if len(boxes):
                    level.boxes = np.concatenate([level.boxes, boxes])
                for key, (depth, since) in level.shades.items():
                    if moved or through:
                        renumber_shade(depth, number, through)
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
            recall_all(wave.rays, old.prim, old.t, old.doubt)
            self._unknown = 0
            return old.told
        wave.rays.doubt[:n] = 0     # only kinds that can doubt write it
        known = np.zeros(4, np.int64)
        if old is not None:
            self._was = np.arange(n, dtype=np.int32) if self._was is None else self._was
            recall_some(wave.rays, self._was, old.prim, old.t, old.doubt, old.source, old.boxes, known)
        self._unknown = n - int(known[0])
        return Known(*map(int, known))

    def _matched(self, old: Level, source: np.ndarray) -> np.ndarray | None:
        """The kept columns of rays that come from those of the wave before."""
        if self._was is None and np.array_equal(source, old.source):
            return None
        was = np.empty(len(source), np.int32)
        match_sources(source, UNMOVED if self._was is None else self._was, old.source, was)
        return was

    def whole(self) -> Iterator[Level]:
        """The waves of which all is known, from the first; what their rays meet needs no asking as long as they come from the same ones."""
        for level in self._kept:
            if not level.whole or len(level.boxes) or level.found is None:
                return
            yield level

    def passed(self, depth: int) -> None:
        """So many waves have been looked up by somebody else."""
        self.levels += self._kept[len(self.levels):depth]

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
                level.shades[key] = Shade(in_whole_vectors(np.where(self._was < 0, UNSEEN, kept[self._was])), boxes)
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
            put_rows(wave.surface, *old.rows)
        elif self._unknown:
            return False
        else:
            put_moved(wave.surface, self._was, *old.rows, np.empty(len(old.prim), np.int32))
        return True

    def note_rows(self, wave: Wave, n: int, spans: Iterable[tuple[int, int]]) -> None:
        """The wave has them now; spans: first and one past the last of the primitives of each such kind."""
        prim = wave.rays.prim[:n]
        at = np.concatenate([np.flatnonzero((first <= prim) & (prim < last)) for first, last in spans]).astype(np.int32)
        self.levels[-1].rows = rows = Rows(at, np.empty((len(wave.surface), len(at)), wave.surface.dtype))
        take_rows(wave.surface, *rows)

    def kept(self) -> list[Level]:
        """All that is known of the tile now; of waves that were not wanted this time, what was known before."""
        return self.levels + (self._kept[len(self.levels):] if self._was is None else [])

    @property
    def noted(self) -> bool:
        """Whether the film has noted the first wave's hits."""
        return bool(self._kept) and self._kept[0].noted

    def note_film(self) -> None:
        """Now it has."""
        self.levels[0].noted = True

    def shadows(self, beam: Beam, key: tuple, first: int, last: int) -> int:
        """Give one light's rays, columns first .. last - 1, what is known of their way; returns how many have to be traced."""
        shade = self.levels[-1].shades.get(key)
        if shade is None:
            return last - first
        return recall_shadows(beam, first, last, shade.depth, shade.boxes)

    def note_shadows(self, beam: Beam, key: tuple, first: int, last: int) -> None:
        """They have met what they meet."""
        self.grown, level = True, self.levels[-1]
        shade = level.shades.get(key)
        if shade is None or len(shade.boxes):       # of other columns it is not known what the new boxes do
            shade = level.shades[key] = Shade(np.full(padded(len(level.prim)), UNSEEN, np.int32), NO_BOXES)
        note_shadows(beam, first, last, shade.depth)
