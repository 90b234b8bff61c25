"""A thread's share of a pass without Python in between: tile after tile, and each stage after stage, from the eye's rays through hits,
light, fog and bounces to the film.

`advance` is compiled once for each precision and calls the stages' kernels by their addresses (`rtcore.indirect`), which the tracer gives
it; a stage that the plan left out has none. It runs until no tile is left or something is wanted that only Python can do: room for more
rays, to look up what is known of first samples or to keep it. Then it says what, and goes on from there when it is called again.
"""
from typing import NamedTuple

import numpy as np

from rtcore import shading
from rtcore.bvh import Tree
from rtcore.clock import ticks
from rtcore.indirect import call, caller, count_of, value_at
from rtcore.jit import inline
from rtcore.lanes import LANES
from rtcore.lights import Draw, Reach
from rtcore.lookup import OTHER, PART, Kept, compare, give_hits, give_reaches, give_rows
from rtcore.sampling import LIGHTS
from rtcore.shapes.kind import Table
from rtcore.todo import FINISHED, TAKEN, count_one
from rtcore.wave import UNWANTED, Beam, Wave

LEVEL = 1 << 12         # pairs of dimensions for the lights of one depth: so a light more changes nothing about the others
SHADOW_RAYS = 8192      # of a wave toward several lights at once: more would leave the cache, and few cost less than their calls

#: What is counted.
COUNTS = ("reflection", "refraction", "primary", "primary_hits", "shadow", "shadow_hits", "nonfinite")
REFLECTION, REFRACTION, PRIMARY, PRIMARY_HITS, SHADOW, SHADOW_HITS, NONFINITE = range(len(COUNTS))

#: Steps: what comes next.
TAKE, SEND, RECALL, MEET, SURFACES, NOTE, GLOW, SHINE, CAST, GATHER, FADE, BOUNCE, NEXT, COMMIT, COUNT, AGAIN = range(16)

#: What `advance` returns: no tile is left, or none is wanted any more, or what Python is to do before it goes on.
(DONE, STALE, ROOM, SPREAD, RECALL_TILE, RECALL_HITS, KEEP_HITS, KEEP_ROWS, NOTE_DOUBT, RECALL_SHADOWS, KEEP_SHADOWS, ROUGHEN,
 COMMIT_SIGNED, KEEP_TILE, BEGIN_AGAIN) = range(15)

#: Places in State.numbers. Of a pass: what comes next, the first sample of each pixel and the one after the last, whether something is
#: known of them or to be kept (a `keep.Recall`), the seed, the greatest depth, the width of the picture.
STEP, FIRST_SAMPLE, LAST_SAMPLE, RECALLING, SEED, MOST_DEPTH, WIDTH = range(7)
#: Of a tile: its number, which sample it is at, whether that is the first, how many rays the eye sends, of how many waves all is known,
#: whether something new is to be kept, whether it is traced once more because what was known did not do.
TILE, SAMPLE, FIRST, EYES, WHOLE, KEEPING, CAREFUL = range(7, 14)
#: Of the wave at hand: its depth, from 1, its rays, of how many of them the hit is known, whether the film is to note them, whether their
#: surface rows are to be kept, whether a light's reach is known, whether it is a part of the kept wave.
DEPTH, RAYS, KNOWN, NOTING, KEEPING_ROWS, REACHED, PARTLY = range(14, 21)
#: Of the lights at hand: the first of them and one past the last, how many rays go toward them, and of how many what they meet is known.
LAMP, LAST_LAMP, CASTING, KNOWN_SHADOWS = range(21, 25)
NUMBERS = 25

#: Columns of Program.kinds.
MEETS, SURFACE, FIRST_PRIM = range(3)
#: Columns of Program.lamps.
SHINES, SAMPLED = range(2)
#: Places in Program.stages: 0 where there is no such stage.
(SENDS, SENDS_LIST, FINDS, NOTES, GLOWS, NOTES_LIT, GATHERS, DIMS, DEPOSITS, BOUNCES, SORTS, TELLS, COMMITS, SHADOWED, DOUBTS, ROUGH,
 LASTS, NUMBERED, SPREADS) = range(19)
STAGES = 19

#: Where time goes (`clock.Clock.measure`): these, then two for each lamp, for each kind of shapes three.
PRIMARY_RAYS, FILM, GLOWING, DIMMING, DEPOSITING, ONWARD, SORTING = range(7)
LAPS = 7


class Primitives(NamedTuple):
    """What a kind's kernels are given."""

    tree: Tree
    table: Table


class Lamp(NamedTuple):
    """What a light's kernel is given."""

    numbers: np.ndarray     # float64, see each light
    color: np.ndarray       # float64 (3)


class Program(NamedTuple):
    """What is done to a wave. Nothing in it changes; threads share it."""

    stages: np.ndarray      # int64: addresses; of the last six whether (not 0) there are shadows, hits in doubt, rough surfaces, surface
                            # rows to be kept, whether something asks for a sample's number, whether samples leave the middles of pixels
    eye: np.ndarray         # float64 (4, 3), the view of `eye.cast`
    kinds: np.ndarray       # int64 (k, 3): addresses of the two kernels, number of the first primitive
    primitives: np.ndarray  # int64 (k, words): Primitives
    ends: np.ndarray        # int64 (k): one past each kind's last primitive
    lamps: np.ndarray       # int64 (l, 2): address of the kernel, whether (not 0) it has an extent
    numbers: np.ndarray     # int64 (l, words): Lamp
    fog: np.ndarray         # float64, see `fog.numbers`
    look: shading.Look
    like: Primitives        # of their types
    lamp: Lamp


class State(NamedTuple):
    """How far a thread is with its tile, and its arrays."""

    numbers: np.ndarray     # int64, as named above
    counts: np.ndarray      # int64, see COUNTS: of the rays at hand and all that come of them
    total: np.ndarray       # of all that have come to their end
    ticks: np.ndarray       # int64, see `clock.Clock.measure`
    odd: Wave               # of odd depths, as the eye's is
    even: Wave
    beam: Beam
    target: np.ndarray      # int32: the pixel of each of the eye's rays
    number: np.ndarray      # int32: which of its samples it is
    sample: np.ndarray      # float32 (3, rays): what they bring
    there: np.ndarray       # bool (k): which kinds have surface rows to be worked out
    ends: np.ndarray        # int64 (l + 1): columns of the beam, where each light's begin and end
    reaches: np.ndarray     # int64 (l, words): int32 arrays, `Reach.depth` of each light
    kept: Kept              # what is known of the tile


@inline
def _lap(spent, what, since):
    """Note that what comes now begins, and what the time since then was for."""
    now = ticks()
    spent[what] += now - since
    return now


@inline
def _recall(state, depth, wave, n, stages):
    """Give a wave of which all is known its hits and what comes of them; False if it is another one, which has changed nothing."""
    s, kept, counts = state.numbers, state.kept, state.counts
    what = compare(kept, depth, wave.source, n, s[PARTLY] != 0)
    if what == OTHER:
        return False
    part = what == PART
    s[PARTLY], hits = part, give_hits(kept, depth, wave.rays, n, part)
    if depth == 1:
        counts[PRIMARY] -= n
        counts[PRIMARY_HITS] -= hits
    else:
        refracted = 0
        for i in range(n):
            refracted += wave.source[i] & 1
        counts[REFRACTION] -= refracted
        counts[REFLECTION] -= n - refracted
    for k in range(state.there.shape[0]):
        state.there[k] = kept.found[depth - 1, k]
    if stages[LASTS] != 0:
        give_rows(kept, depth, wave.surface, n, part)
    if stages[SHADOWED] != 0:
        s[REACHED] = give_reaches(kept, depth, state.reaches, n, part, state.target)
    return True


@inline
def _meet(program, state, rays, n, opacity, lap, since):
    """Rays against all kinds of shapes, one after the other. lap: of the first kind; returns the time, or 0 if they are not wanted any
    more."""
    kinds = program.kinds
    for k in range(kinds.shape[0]):
        these = value_at(program.primitives, k, program.like)
        call(kinds[k, MEETS], (rays, n, these.tree, these.table, kinds[k, FIRST_PRIM], opacity))
        since = _lap(state.ticks, lap + 3 * k, since)
        if rays.tally[UNWANTED] != 0:
            return 0
    return since


@inline
def _find_surfaces(program, state, wave, n, lap, since):
    """The surface rows of the kinds that are hit; returns the time."""
    kinds, there = program.kinds, state.there
    if state.numbers[RECALLING] == 0:       # else they are known
        for k in range(kinds.shape[0]):
            there[k] = kinds.shape[0] == 1
        if kinds.shape[0] > 1:
            call(program.stages[FINDS], (wave.rays.prim, n, program.ends, there))
    for k in range(kinds.shape[0]):
        if there[k]:
            these = value_at(program.primitives, k, program.like)
            call(kinds[k, SURFACE], (wave.rays, n, wave.surface, these.table, kinds[k, FIRST_PRIM]))
            since = _lap(state.ticks, lap + 3 * k, since)
    return since


@inline
def _shine(program, state, film, wave, n, since):
    """The rays from a wave's hits toward the lights at hand, into the beam; returns the time."""
    s, beam, lamps = state.numbers, state.beam, program.lamps
    first, m, depth = s[LAMP], 0, s[DEPTH]
    lit = film.lit if s[FIRST] != 0 and depth == 1 and program.stages[NOTES_LIT] != 0 else film.lit[:0]
    share = np.float32(1 / lamps.shape[0])
    for j in range(first, s[LAST_LAMP]):
        lamp = value_at(program.numbers, j, program.lamp)
        reach = Reach(value_at(state.reaches, j, state.target), lit, state.target[:n], share)
        if lamps[j, SAMPLED] != 0:
            draw = Draw(state.target, state.number, LIGHTS + depth * LEVEL + j, s[SEED])
            m = count_of(lamps[j, SHINES], (wave, n, lamp.numbers, lamp.color, beam, m, reach, draw))
        else:
            m = count_of(lamps[j, SHINES], (wave, n, lamp.numbers, lamp.color, beam, m, reach))
        state.ends[j + 1 - first] = m
        since = _lap(state.ticks, LAPS + 2 * j, since)
    s[CASTING], s[KNOWN_SHADOWS] = m, 0
    return since


@inline
def _send(program, state, film, todo):
    """The eye's rays for the tile and sample at hand, as the first wave; returns how many, 0 if the film has them already."""
    s, stages, tile, target = state.numbers, program.stages, todo.tiles[state.numbers[TILE]], state.target
    if todo.pixels.shape[0] > 0:
        pixels = todo.pixels[tile[0]:tile[1]]
        if film.count[pixels[0, 0]] > pixels[0, 1]:
            return 0
        return count_of(stages[SENDS_LIST], (state.odd, target, state.number, program.eye, s[WIDTH], pixels, s[SEED]))
    n = count_of(stages[SENDS], (state.odd, target, program.eye, tile, s[SAMPLE], s[SEED]))
    if n > 0 and film.count[target[0]] > s[SAMPLE]:
        return 0
    if stages[NUMBERED] != 0:
        for i in range(n):
            state.number[i] = s[SAMPLE]
    return n


@inline
def _begin(s, n, counts, shadowed):
    """Nothing has come of the eye's n rays yet."""
    for k in range(counts.shape[0]):
        counts[k] = 0
    counts[PRIMARY], s[EYES], s[RAYS], s[DEPTH] = n, n, n, 1
    s[WHOLE], s[KEEPING], s[KEEPING_ROWS], s[PARTLY], s[REACHED] = 0, 0, 0, 0, not shadowed


@caller
def advance(program, state, film, todo):
    """Run one stage after the other, from `State.numbers[STEP]`, until no tile is left or Python is needed; returns for what."""
    s, counts, spent, stages, beam, lamps = state.numbers, state.counts, state.ticks, program.stages, state.beam, program.lamps.shape[0]
    hits = LAPS + 2 * lamps         # laps of the first kind
    surfaces, shadows = hits + 1, hits + 2
    since = ticks()
    while True:
        step, depth, n = s[STEP], s[DEPTH], s[RAYS]
        wave = state.odd if depth % 2 == 1 else state.even
        child = state.even if depth % 2 == 1 else state.odd
        rays = wave.rays
        if step == TAKE:
            s[TILE], s[SAMPLE], s[STEP], s[DEPTH] = count_one(todo.counters, TAKEN), s[FIRST_SAMPLE], SEND, 1
            if s[TILE] >= todo.tiles.shape[0]:
                return DONE
        elif step == SEND:
            most, listed = todo.tiles[s[TILE], 2] * todo.tiles[s[TILE], 3], todo.pixels.shape[0] > 0
            if rays.tally[UNWANTED] != 0:
                return STALE
            if state.target.shape[0] < most or wave.owner.shape[0] < most:
                return ROOM
            n = _send(program, state, film, todo)
            since = _lap(spent, PRIMARY_RAYS, since)
            s[STEP] = RECALL if n > 0 else AGAIN
            if n > 0:
                _begin(s, n, counts, stages[SHADOWED] != 0)
                s[FIRST] = s[NOTING] = s[SAMPLE] == 0 and not listed
                if s[RECALLING] != 0:
                    return RECALL_TILE
                if stages[SPREADS] != 0 and s[FIRST] == 0:      # a first sample is the pixel's middle
                    return SPREAD
        elif step == RECALL:
            s[STEP], s[KNOWN] = MEET, 0
            if depth <= s[WHOLE] and _recall(state, depth, wave, n, stages):
                s[STEP] = SURFACES
                since = _lap(spent, PRIMARY_RAYS if depth == 1 else ONWARD, since)      # looking up counts to what it spares
                continue
            if s[PARTLY] != 0:
                return BEGIN_AGAIN
            s[WHOLE] = 0
            if s[RECALLING] != 0:
                return RECALL_HITS
            for i in range(n):
                rays.doubt[i] = 0       # only kinds that can doubt write it
        elif step == MEET:
            sorts = depth > 1 and s[KNOWN] < n and stages[SORTS] != 0
            if sorts and child.owner.shape[0] < n:
                return ROOM
            s[STEP] = SURFACES
            if s[KNOWN] < n:
                met, m = rays, n
                if sorts:       # what the wave has come from is not needed any more
                    met, m = child.rays, count_of(stages[SORTS], (rays, n, child))
                    since = _lap(spent, SORTING, since)
                since = _meet(program, state, met, m, program.look.opacity[:0], hits, since)
                if since == 0:
                    return STALE
                if sorts:
                    call(stages[TELLS], (rays, child, m))
                    since = _lap(spent, SORTING, since)
                if s[RECALLING] != 0:
                    return KEEP_HITS
        elif step == SURFACES:
            s[STEP] = NOTE
            since = _find_surfaces(program, state, wave, n, surfaces, since)
            if s[KEEPING_ROWS] != 0:
                s[KEEPING_ROWS] = 0
                return KEEP_ROWS
        elif step == NOTE:
            s[STEP] = GLOW
            if depth == 1:
                for i in range(n):
                    counts[PRIMARY_HITS] += rays.prim[i] >= 0
                if s[NOTING] != 0 and stages[NOTES] != 0:
                    call(stages[NOTES], (film, wave, n, state.target))
                since = _lap(spent, FILM, since)
                if s[NOTING] != 0 and stages[DOUBTS] != 0:
                    return NOTE_DOUBT
        elif step == GLOW:
            if stages[GLOWS] == 0:      # a view of first hits
                for k in range(3):
                    state.sample[k, :n] = 0
                s[STEP] = COMMIT
                continue
            if lamps > 0:
                together = 1 if s[REACHED] != 0 else min(max(SHADOW_RAYS // n, 1), lamps)
                s[LAST_LAMP], whole = together, (n + LANES - 1) // LANES * LANES
                if beam.answer.shape[1] < n or beam.owner.shape[0] < whole * together + LANES:
                    return ROOM
            call(stages[GLOWS], (wave, n, program.look, beam.answer))
            since = _lap(spent, GLOWING, since)
            s[STEP], s[LAMP] = SHINE if lamps > 0 else FADE, 0
        elif step == SHINE:
            s[STEP] = CAST
            since = _shine(program, state, film, wave, n, since)
            if s[CASTING] > 0 and stages[SHADOWED] != 0 and s[RECALLING] != 0:
                return RECALL_SHADOWS if s[PARTLY] == 0 else BEGIN_AGAIN
        elif step == CAST:
            s[STEP] = GATHER
            if stages[SHADOWED] != 0 and s[KNOWN_SHADOWS] < s[CASTING]:
                since = _meet(program, state, beam.rays, s[CASTING], program.look.opacity, shadows, since)
                if since == 0:
                    return STALE
                if s[RECALLING] != 0:
                    return KEEP_SHADOWS
        elif step == GATHER:
            m, first, last = s[CASTING], s[LAMP], s[LAST_LAMP]
            if m > 0:
                if stages[SHADOWED] != 0:
                    counts[SHADOW] += m - s[KNOWN_SHADOWS]
                if s[FIRST] != 0 and depth == 1 and stages[NOTES_LIT] != 0:
                    call(stages[NOTES_LIT], (film, beam, m, state.target, np.float32(1 / lamps)))
                counts[SHADOW_HITS] += count_of(stages[GATHERS], (wave, beam, m))
                since = _lap(spent, LAPS + 2 * first + 1, since)
            s[STEP], s[LAMP], s[LAST_LAMP] = SHINE if last < lamps else FADE, last, min(2 * last - first, lamps)
        elif step == FADE:
            if stages[DIMS] != 0:
                call(stages[DIMS], (wave, n, program.fog))
                since = _lap(spent, DIMMING, since)
            call(stages[DEPOSITS], (wave, n, state.sample, depth == 1))
            since = _lap(spent, DEPOSITING, since)
            if rays.tally[UNWANTED] != 0:
                return STALE
            s[STEP] = COMMIT if stages[BOUNCES] == 0 or depth == s[MOST_DEPTH] else BOUNCE
        elif step == BOUNCE:
            if child.owner.shape[0] < 2 * n:
                return ROOM
            s[STEP], s[RAYS] = NEXT, count_of(stages[BOUNCES], (wave, n, program.look, child, counts))
            since = _lap(spent, ONWARD, since)
            if stages[ROUGH] != 0 and s[FIRST] == 0:      # a first sample goes the smooth way
                return ROUGHEN
        elif step == NEXT:
            s[STEP], s[DEPTH] = RECALL if n > 0 else COMMIT, depth + 1
        elif step == COMMIT:
            s[STEP] = COUNT
            if stages[COMMITS] == 0:
                return COMMIT_SIGNED
            counts[NONFINITE] += count_of(stages[COMMITS], (film, state.sample, s[EYES], state.target))
            since = _lap(spent, FILM, since)
        elif step == COUNT:
            for k in range(counts.shape[0]):
                state.total[k] += counts[k]
            s[STEP], s[EYES] = AGAIN, 0
            if s[KEEPING] != 0:
                return KEEP_TILE
        else:
            s[STEP], s[DEPTH], s[SAMPLE] = SEND, 1, s[SAMPLE] + 1
            if s[SAMPLE] >= s[LAST_SAMPLE]:
                count_one(todo.counters, FINISHED)
                s[STEP] = TAKE
