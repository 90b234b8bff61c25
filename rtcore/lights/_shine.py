"""What lights share: the rays from a wave's hits toward one, and what each would bring if nothing were in the way; or, where it is known
how far the light reaches them, the light itself."""
from typing import NamedTuple

import numpy as np

from rtcore.across import lowest_bit
from rtcore.directions import normalized
from rtcore.indices import among
from rtcore.jit import inline
from rtcore.lanes import (LANES, any_lane, bits, dot, exceeds, fill, greatest, load, load3, narrow, rounded, select, store,
                          wide, zero)
from rtcore.neighbours import consecutive, load1, store1
from rtcore.powers import power
from rtcore.wave import DEPTH_UNIT, DX, ERR, GLOSS, GX, OPAQUE, OX, POLISH, PX, RAY_ROWS, START, T, shading_normal


class Reach(NamedTuple):
    """How far a light is known to reach the hits of a wave, and where to note that it does."""

    depth: np.ndarray       # int32 (n, whole vectors): optical depth on the way, from OPAQUE on blocked, -1 unknown; length 0: all unknown
    lit: np.ndarray         # float32: as `Film.lit`; length 0: not to be noted
    target: np.ndarray      # int32 (n): the pixel of each hit; means something where `lit` is to be noted
    share: np.float32       # of all lights, which this one is


UNTOLD = np.zeros(0, np.int32)          # where nothing is known
UNNOTED = np.zeros(0, np.float32)       # where nothing is to be noted


@inline
def hit_points(wave, i):
    """Where rays i .. i+7 hit, as float64 lanes; anything for those that don't."""
    return wide(load3(wave.surface, PX, i))


@inline
def shine_on(wave, i, beam, j, color, way, toward, end, strength, reach):
    """The shadow rays of hits i .. i+7 into the columns of the beam from j on, which has room for eight; returns their number. way, toward,
    end, strength (lanes): direction to the light, the same at length 1, t of the light, how strong it is there. No ray starts from a
    surface that faces away, or that answers no light; nor where `reach` knows what it would meet: such hits get their light at once."""
    known = reach.depth.shape[0] > 0
    if known and bits(exceeds(reach.depth, i, OPAQUE - 1)) == 255:
        return 0
    surface, answer, ray, bring = wave.surface, beam.answer, beam.rays.ray, beam.bring
    d, g, normal = wide(load3(wave.rays.ray, DX, i)), wide(load3(surface, GX, i)), wide(load3(surface, shading_normal(surface), i))
    side = select(dot(d, g) < 0, 1, zero(d.x) - 1)      # the side that the ray comes from
    g, normal = g * side, normal * side
    cosine, gloss = dot(normal, toward), wide(load(answer, GLOSS, i))
    red, green, blue = wide(load(answer, 0, i)), wide(load(answer, 1, i)), wide(load(answer, 2, i))
    ok = exceeds(wave.rays.prim, i, -1) & (cosine > 0) & (dot(g, toward) > 0) & (strength > 0)
    ok = ok & ((red > 0) | (green > 0) | (blue > 0) | (gloss > 0))
    lit = bits(ok)
    if lit == 0:
        return 0
    highlight = zero(cosine)
    if any_lane(ok & (gloss > 0)):
        h = normalized(toward - d)
        highlight = gloss * power(greatest(dot(normal, h), 0), wide(load(answer, POLISH, i)))
    red = narrow(strength * color[0] * (red * cosine + highlight))
    green = narrow(strength * color[1] * (green * cosine + highlight))
    blue = narrow(strength * color[2] * (blue * cosine + highlight))
    if known:
        clear, dimmed = ok & among(reach.depth, i, 0, 1), ok & among(reach.depth, i, 1, OPAQUE)
        _bring(wave.light, i, clear, red, green, blue)
        if reach.lit.shape[0] > 0:
            _note_clear(reach, i, clear)
        if any_lane(dimmed):
            store(bring, 0, j, red)
            store(bring, 1, j, green)
            store(bring, 2, j, blue)
            _bring_dimmed(wave.light, i, bits(dimmed), bring, j, reach)
        lit = bits(ok & ~exceeds(reach.depth, i, -1))
        if lit == 0:
            return 0
    store(bring, 0, j, red)
    store(bring, 1, j, green)
    store(bring, 2, j, blue)
    p, away, like = hit_points(wave, i), wide(load(surface, ERR, i)), load(ray, OX, j)
    store(ray, OX, j, rounded(p.x + away * g.x, like))
    store(ray, OX + 1, j, rounded(p.y + away * g.y, like))
    store(ray, OX + 2, j, rounded(p.z + away * g.z, like))
    store(ray, DX, j, rounded(way.x, like))
    store(ray, DX + 1, j, rounded(way.y, like))
    store(ray, DX + 2, j, rounded(way.z, like))
    store(ray, START, j, zero(like))
    store(ray, T, j, rounded(end, like))
    fill(beam.rays.prim, j, -1)
    fill(beam.rays.depth, j, 0)
    # those that there are of the eight move together
    n = 0
    while lit:
        lane = lowest_bit(lit)
        lit &= lit - 1
        beam.owner[j + n] = i + lane
        if lane > n:
            for row in range(RAY_ROWS):
                ray[row, j + n] = ray[row, j + lane]
            for k in range(3):
                bring[k, j + n] = bring[k, j + lane]
        n += 1
    return n


@inline
def _bring(light, i, clear, red, green, blue):
    """Add to hits i .. i+7 what they get, where clear: in float32, as `shading.gather` does."""
    store(light, 0, i, load(light, 0, i) + select(clear, red, 0))
    store(light, 1, i, load(light, 1, i) + select(clear, green, 0))
    store(light, 2, i, load(light, 2, i) + select(clear, blue, 0))


@inline
def _note_clear(reach, i, clear):
    """Note that the light reaches hits i .. i+7 where clear."""
    lit, target = reach.lit, reach.target
    if i + LANES <= target.shape[0] and consecutive(target, i):     # further pixels may be another thread's
        before = load1(lit, target[i])
        store1(lit, target[i], before + select(clear, reach.share, zero(before)))
        return
    which = bits(clear)
    while which:
        lit[target[i + lowest_bit(which)]] += reach.share
        which &= which - 1


@inline
def _bring_dimmed(light, i, which, bring, j, reach):
    """What comes through to those of hits i .. i+7 that are seen through something."""
    while which:
        lane = lowest_bit(which)
        which &= which - 1
        through = np.exp(-reach.depth[i + lane] * DEPTH_UNIT)
        for k in range(3):
            light[k, i + lane] += through * bring[k, j + lane]
        if reach.lit.shape[0] > 0:
            reach.lit[reach.target[i + lane]] += reach.share * np.float32(through)
