"""Waves of which all is known from the picture before, looked up within `stages.advance`: no Python is needed where nothing is new.

Mostly a wave is the kept one. It may also be a part of that: fog, or a material, lets rays end that went on before. Then each ray is found
among the kept ones by the ray it comes from, which is in the same order in both.
"""
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from rtcore.indirect import SIZE, rows_for, value_at, words_of
from rtcore.jit import inline
from rtcore.levels import Level, Met, Rows
from rtcore.lights import UNTOLD
from rtcore.wave import T, padded

UNREACHED = words_of(UNTOLD)
OTHER, SAME, PART = range(3)        # what a wave is to the kept one


class Kept(NamedTuple):
    """The first waves of a tile, of which all is known: at most d of them; l lights, k kinds of shapes."""

    met: np.ndarray         # int64 (d, words): levels.Met
    shades: np.ndarray      # int64 (d l, words): how far each light reaches the hits, as `State.reaches`
    found: np.ndarray       # bool (d, k): which kinds have surface rows to be worked out
    rows: np.ndarray        # int64 (d, words): levels.Rows of the others
    was: np.ndarray         # int32 (2, n): of a wave that is a part of the kept one the columns there; of odd depths and of even ones
    place: np.ndarray       # int32 (n): room
    depths: np.ndarray      # int32 (l, n): of such a wave how far each light reaches the hits
    reaches: np.ndarray     # int64 (l, words): the same in words
    like: Met               # of their types
    like_rows: Rows


def no_kept(waves: int, lights: int, kinds: int, dtype) -> Kept:
    """Nothing is known; room for parts of waves is made by `with_room`."""
    like = Met(*(np.zeros(0, kind) for kind in (np.int32, np.int32, dtype, np.uint8)))
    rows, reach, none = Rows(np.zeros(0, np.int32), np.zeros((0, 0), dtype)), UNTOLD, np.zeros(0, np.int32)
    return Kept(rows_for(waves, like), rows_for(waves * lights, reach), np.zeros((waves, kinds), bool), rows_for(waves, rows),
                none.reshape(2, 0), none, none.reshape(0, 0), rows_for(lights, reach), like, rows)


def with_room(kept: Kept, n: int) -> Kept:
    """The same with room for waves of n rays that are parts of the kept ones."""
    depths = np.zeros((len(kept.reaches), padded(n)), np.int32)
    for row, words in zip(depths, kept.reaches):
        words[:] = words_of(row)
    return kept._replace(was=np.zeros((2, n), np.int32), place=np.zeros(n, np.int32), depths=depths)


def write_down(kept: Kept, levels: Iterable[Level], keys: list[tuple], lasting: list[bool], rows: int) -> int:
    """Write down waves of which all is known, as far as that goes; returns how many they are. keys: what makes the lights' shadows, empty
    if they cast none; lasting: of which kinds of shapes the surface rows are kept; rows: how many a wave has."""
    depth = 0
    for depth, level in enumerate(levels):
        if depth == len(kept.met):
            return depth
        if any(lasting):
            if level.rows is None or len(level.rows.rows) != rows:
                return depth
            kept.rows[depth] = words_of(level.rows)
        kept.met[depth] = level.words
        kept.found[depth] = [there and not kept_too for there, kept_too in zip(level.found, lasting)]
        for j, key in enumerate(keys):
            kept.shades[depth * len(keys) + j] = reach_in_words(level, key)
        depth += 1
    return depth


def reach_in_words(level: Level, key: tuple) -> list[int]:
    """How far a light is known to reach a wave's hits; nothing if something has come into the scene since."""
    shade = level.shades.get(key)
    return UNREACHED if shade is None or len(shade.boxes) else words_of(shade.depth)


@inline
def compare(kept, depth, source, n, moved):
    """What the wave of a depth, of n rays from these sources, is to the kept one; `Kept.was` is written for a part of it. moved: whether
    the wave that it comes from was such a part."""
    met, j = value_at(kept.met, depth - 1, kept.like), 0
    size = met.prim.shape[0]
    if not moved and size == n:
        differs = 0
        if depth > 1:
            for i in range(n):
                differs |= met.source[i] ^ source[i]
        if differs == 0:
            return SAME
    if depth == 1:
        return OTHER
    was, before = kept.was[depth % 2], kept.was[(depth + 1) % 2]
    for i in range(n):
        wanted = source[i]
        if moved:
            wanted = 2 * before[wanted >> 1] + (wanted & 1)
        while j < size and met.source[j] < wanted:
            j += 1
        if j == size or met.source[j] != wanted:
            return OTHER
        was[i] = j
    return PART


@inline
def give_hits(kept, depth, rays, n, part):
    """Give the rays of a wave their hits; returns how many there are. part: whether it is only a part of the kept one."""
    met, hits = value_at(kept.met, depth - 1, kept.like), 0
    if part:
        was = kept.was[depth % 2]
        for i in range(n):
            rays.ray[T, i] = met.t[was[i]]
        for i in range(n):
            rays.prim[i] = met.prim[was[i]]
            rays.doubt[i] = met.doubt[was[i]]
    else:
        for i in range(n):
            rays.ray[T, i] = met.t[i]
        for i in range(n):
            rays.prim[i] = met.prim[i]
            rays.doubt[i] = met.doubt[i]
    for i in range(n):
        hits += rays.prim[i] >= 0
    return hits


@inline
def give_rows(kept, depth, surface, n, part):
    """Give a wave the surface rows that are kept."""
    known = value_at(kept.rows, depth - 1, kept.like_rows)
    count, at, rows = known.at.shape[0], known.at, known.rows
    if not part:
        for r in range(rows.shape[0]):
            for j in range(count):
                surface[r, at[j]] = rows[r, j]
        return
    was, place = kept.was[depth % 2], kept.place
    for i in range(value_at(kept.met, depth - 1, kept.like).prim.shape[0]):
        place[i] = -1
    for j in range(count):
        place[at[j]] = j
    for i in range(n):
        j = place[was[i]]
        if j >= 0:
            for r in range(rows.shape[0]):
                surface[r, i] = rows[r, j]


@inline
def give_reaches(kept, depth, reaches, n, part, like):
    """Say how far each light reaches the wave's hits; returns whether (not 0) that is known of any. like: int32 (n)."""
    lights, reached = reaches.shape[0], 0
    for j in range(lights):
        row = (depth - 1) * lights + j
        reached |= kept.shades[row, SIZE]
        if not part or kept.shades[row, SIZE] == 0:
            for word in range(reaches.shape[1]):
                reaches[j, word] = kept.shades[row, word]
            continue
        depths, was, out = value_at(kept.shades, row, like), kept.was[depth % 2], kept.depths[j]
        for i in range(n):
            out[i] = depths[was[i]]
        for i in range(n, (n + 7) // 8 * 8):
            out[i] = -1
        for word in range(reaches.shape[1]):
            reaches[j, word] = kept.reaches[j, word]
    return reached
