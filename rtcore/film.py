"""The film: sums of samples, so that films of different samples merge in any order, and what the first rays hit.

Errors are root mean squares over pixels and channels, in linear light. They are estimated from the difference of the two replicates that a
pixel's samples belong to (`rtcore.sampling`): those are independent, so the mean square of the difference of their means is the sum of
their variances, however well each is stratified. It can't tell what no sample has met, nor anything that all samples have in common: what
lies beyond the depth of reflections, or the rounding of float32.
"""
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rtcore.across import count
from rtcore.indices import among
from rtcore.jit import inline, kernel
from rtcore.lanes import LANES, bits, exceeds, fill, load, load3, narrow, select, store, wide
from rtcore.memory import carved
from rtcore.neighbours import add_one, add_triples, consecutive, copy, load1, load_flat, store1, store_flat, store_triples, turns
from rtcore.sampling import REPLICATES
from rtcore.wave import DEPTH_UNIT, T, shading_normal


class Film(NamedTuple):
    """One picture of h·w pixels, rows from the top. What tells of the error has length 0 in a film of one sample per pixel."""

    total: np.ndarray       # float64 (h·w, 3): sum of the samples
    # told from the second sample on:
    split: np.ndarray       # float32 (h·w, 3): sum of the first replicate's samples less that of the second's
    square: np.ndarray      # float64 (h·w): sum of the samples' squares, the mean over the channels
    count: np.ndarray       # int32 (h·w): how many
    # of length 0 where nobody asks what is seen, only for the picture:
    prim: np.ndarray        # int32 (h·w): the primitive that sample 0 hit first, -1 none
    distance: np.ndarray    # float32 (h·w): how far away, inf none
    normal: np.ndarray      # float32 (h·w, 3): shading normal there, 0 none
    doubt: np.ndarray       # uint8 (h·w): not 0 where that hit, or that there is none nearer, has no proof
    lit: np.ndarray         # float32 (h·w): which share of the lights reaches it; length 0 if not wanted
    # float64 (h·w, 5), where samples have signs, which `total` and `split` contain then (`rtcore.filters`); else length 0: the sums of the
    # samples without signs, of the signs, and of the first replicate's signs less those of the second's
    plain: np.ndarray


def new_film(width: int, height: int, samples: int = 2, hits: bool = True, lit: bool = False, signed: bool = False) -> Film:
    """An empty film for so many samples per pixel. hits: whether it is to note what is hit first, lit: which lights reach that; signed:
    whether samples have signs."""
    n = width * height
    m, p = n if samples > 1 else 0, n if hits else 0
    film = Film(*carved(((n, 3), np.float64), ((m, 3), np.float32), ((m,), np.float64), ((n,), np.int32), ((p,), np.int32),
                        ((p,), np.float32), ((p, 3), np.float32), ((p,), np.uint8), ((n if lit else 0,), np.float32),
                        ((n if signed else 0, 5), np.float64)))
    # the system hands the memory out now, not in the midst of tracing, a tenth of whose time that took
    for array, value in zip(film, (0, 0, 0, 0, -1, np.inf, 0, 0, 0, 0)):
        array.fill(value)
    return film


def suits(film: Film, samples: int, hits: bool, lit: bool, signed: bool) -> bool:
    """Whether a film of the right size has the arrays for so many samples per pixel, for signs or none, and those for first hits and for
    lights if wanted."""
    return ((len(film.square) > 0) == (samples > 1) and (len(film.plain) > 0) == signed and (len(film.prim) > 0 or not hits)
            and (len(film.lit) > 0 or not lit))


def clear(film: Film) -> None:
    """Let it be a new film. What is left of the old one is not looked at where there is no sample, and the first one replaces it."""
    film.count.fill(0)
    film.lit.fill(0)


@kernel
def note_first_hits(film, wave, n, target):
    """Which primitive each primary ray hit, how far away, and the normal there, without a doubt."""
    for i in range(0, n, LANES):
        if i + LANES <= n and consecutive(target, i):
            _note_eight(film, target[i], wave.rays, wave.surface, i)
            continue
        for j in range(i, min(i + LANES, n)):
            _note_one(film, target[j], wave.rays, wave.surface, j)


@inline
def _note_eight(film, p, rays, surface, i):
    """What rays i .. i+7, of pixels p .. p+7, hit."""
    hit, normal = exceeds(rays.prim, i, -1), load3(surface, shading_normal(surface), i)
    copy(film.prim, p, rays.prim, i)
    for k in range(LANES):
        film.doubt[p + k] = 0
    store1(film.distance, p, narrow(load(rays.ray, T, i)))
    store_triples(film.normal, p, narrow(select(hit, normal.x, 0)), narrow(select(hit, normal.y, 0)), narrow(select(hit, normal.z, 0)))


@inline
def _note_one(film, p, rays, surface, i):
    """What ray i, of pixel p, hits."""
    film.prim[p], film.doubt[p] = rays.prim[i], 0
    film.distance[p] = rays.ray[T, i]
    for k in range(3):
        film.normal[p, k] = surface[shading_normal(surface) + k, i] if rays.prim[i] >= 0 else 0


@kernel
def note_doubt(film, wave, n, target, first, last):
    """Which primary rays hit one of the primitives first .. last - 1, of a kind that can be in doubt, without a proof, or were given up
    by one, bit 1 of their doubt, whatever they hit."""
    for i in range(n):
        hit = first <= wave.rays.prim[i] < last
        film.doubt[target[i]] = wave.rays.doubt[i] if hit else wave.rays.doubt[i] & 2


@kernel
def note_lit(film, beam, n, target, share):
    """Add to the pixels `target` of a first wave its share for each of the beam's n rays that reached its light, or what came through."""
    for j in range(n):
        if beam.rays.prim[j] < 0:
            depth = beam.rays.depth[j]
            through = np.float32(1) if depth == 0 else np.float32(np.exp(-depth * DEPTH_UNIT))
            film.lit[target[beam.owner[j]]] += share * through


@kernel
def deposit(wave, n, sample, primary):
    """Add the wave's light to the primary rays it descends from; sample (3, primary rays). Of those themselves it is the first."""
    owner, weight, light = wave.owner, wave.weight, wave.light
    if primary:
        for i in range(0, n, LANES):
            for k in range(3):
                store(sample, k, i, load(weight, k, i) * load(light, k, i))
        return
    for i in range(0, n, LANES):
        if i + LANES <= n and consecutive(owner, i):
            for k in range(3):
                store(sample, k, owner[i], load(sample, k, owner[i]) + load(weight, k, i) * load(light, k, i))
            continue
        for j in range(i, min(i + LANES, n)):
            for k in range(3):
                sample[k, owner[j]] += weight[k, j] * light[k, j]


@kernel
def commit(film, sample, n, target):
    """Add one finished sample per target pixel; returns how many were not finite (they count as black)."""
    bad = 0
    for i in range(0, n, LANES):
        if i + LANES <= n and consecutive(target, i):
            bad += _commit_eight(film, target[i], wide(load(sample, 0, i)), wide(load(sample, 1, i)), wide(load(sample, 2, i)))
            continue
        for j in range(i, min(i + LANES, n)):
            bad += _commit_one(film, target[j], np.float64(sample[0, j]), np.float64(sample[1, j]), np.float64(sample[2, j]))
    return bad


@inline
def _commit_eight(film, p, r, g, b):
    """A finished sample of each of pixels p .. p+7, traced together, so as many as each other has; returns how many were not finite."""
    total = r + g + b
    finite = total - total == 0
    r, g, b = select(finite, r, 0), select(finite, g, 0), select(finite, b, 0)
    if film.count[p] == 0:
        store_triples(film.total, p, r, g, b)
        fill(film.count, p, 1)
        return LANES - count(finite)
    if film.square.shape[0] > 0:
        if film.count[p] == 1:
            for q in range(p, p + LANES):
                take_first(film, q)
        side = turns(film.count, p)
        add_triples(film.split, p, side * narrow(r), side * narrow(g), side * narrow(b))
        store1(film.square, p, load1(film.square, p) + (r * r + g * g + b * b) / 3)
    add_triples(film.total, p, r, g, b)
    add_one(film.count, p)
    return LANES - count(finite)


@inline
def take_first(film, p):
    """Pixel p gets its second sample: now the first one's error begins to matter. A first picture is there sooner for not telling it."""
    r, g, b = film.total[p, 0], film.total[p, 1], film.total[p, 2]
    film.split[p, 0], film.split[p, 1], film.split[p, 2] = r, g, b
    film.square[p] = (r * r + g * g + b * b) / 3


@inline
def _commit_one(film, p, r, g, b):
    """A finished sample of pixel p; says whether it was not finite."""
    bad = not np.isfinite(r + g + b)
    if bad:
        r = g = b = 0.0
    number = film.count[p]      # samples come in order, so the count is the sample's number
    film.count[p] = number + 1
    if number == 0:
        film.total[p, 0], film.total[p, 1], film.total[p, 2] = r, g, b
        return bad
    if film.square.shape[0] > 0:
        if number == 1:
            take_first(film, p)
        side = np.float32(1 - 2 * (number % REPLICATES))
        film.split[p, 0] += side * np.float32(r)
        film.split[p, 1] += side * np.float32(g)
        film.split[p, 2] += side * np.float32(b)
        film.square[p] += (r * r + g * g + b * b) / 3
    film.total[p, 0] += r
    film.total[p, 1] += g
    film.total[p, 2] += b
    return bad


@kernel
def develop(film, leaf, width, first, last, spacing, pixels, node, distance):
    """Rows first .. last - 1 of the mean picture, pixels (h, w, 3) float32, and, unless they have length 0, which leaf each pixel shows and
    how far away; leaf: that of each primitive. A pixel without a sample shows that of the lattice before it."""
    told = node.shape[0] > 0
    for y in range(first, last):
        x = 0
        while x < width:
            p, step = y * width + x, 1
            c = film.count[p]
            if c > 0 and x + LANES <= width and bits(among(film.count, p, c, c + 1)) == 255:
                for k in range(0, 3 * LANES, LANES):
                    store_flat(pixels, 3 * p + k, narrow(load_flat(film.total, 3 * p + k) / np.float64(c)))
                if told:
                    store_flat(distance, p, load1(film.distance, p))
                    for k in range(LANES):
                        node[y, x + k] = leaf[film.prim[p + k]] if film.prim[p + k] >= 0 else -1
                x += LANES
                continue
            while film.count[p] == 0 and step < spacing:
                step *= 2
                p = y // step * step * width + x // step * step
            c = film.count[p]
            for k in range(3):
                pixels[y, x, k] = film.total[p, k] / c if c > 0 else 0.0
            if told:
                node[y, x] = leaf[film.prim[p]] if c > 0 and film.prim[p] >= 0 else -1
                distance[y, x] = film.distance[p] if c > 0 else np.inf
            x += 1


@kernel
def sources(film, width, height, spacing, out):
    """The pixel that each one shows, itself or that of the lattice before it: as `develop` fills the picture. out: int32 (h·w)."""
    for y in range(height):
        for x in range(width):
            p, step = y * width + x, 1
            while film.count[p] == 0 and step < spacing:
                step *= 2
                p = y // step * step * width + x // step * step
            out[y * width + x] = p


@kernel
def _squared_errors(film):
    """Sum of the estimated squared errors over pixels and channels, and how many pixels have an estimate."""
    total, counted = 0.0, 0
    for p in range(film.square.shape[0]):
        n = film.count[p]
        if n < REPLICATES:
            continue
        first, second = (n + 1) // 2, n // 2
        for k in range(3):
            t, s = film.total[p, k], np.float64(film.split[p, k])
            apart = (t + s) / (2 * first) - (t - s) / (2 * second)
            total += apart * apart * first * second / (np.float64(n) * n)
        counted += 1
    return total, counted


def rmse_estimate(film: Film) -> float | None:
    """Root mean square error of the mean picture, over pixels and channels, as its replicates tell it; None below two samples."""
    total, counted = _squared_errors(film)
    return math.sqrt(total / (3 * counted)) if counted else None


def _curve() -> np.ndarray:
    """sRGB's curve as a table over 0 .. 1 in 4096 steps, fine enough that no 8-bit value is off by more than rounding at a step's edge."""
    x = (np.arange(4097)) / 4096
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055) * 255 + 0.5


BANDS = 4       # of rows, for threads to share
CURVE = _curve().astype(np.float32)


@kernel
def _encode(pixels, out, exposure, curve):
    height, width = pixels.shape[0], pixels.shape[1]
    for y in range(height):
        for x in range(width):
            for k in range(3):
                v = pixels[y, x, k] * exposure
                v = v if v > 0 else np.float32(0)       # a NaN shows black
                v = np.float32(4096) * (v if v < 1 else np.float32(1))
                i = min(int(v), 4095)
                out[y, x, 2 - k] = int(curve[i] + (curve[i + 1] - curve[i]) * (v - np.float32(i)))
            out[y, x, 3] = 255


def encode(pixels: np.ndarray, out: np.ndarray | None = None, exposure: float = 1.0, share: Callable = map) -> np.ndarray:
    """Linear (h, w, 3) float32 as sRGB bytes (h, w, 4): blue, green, red, 255, the order of Qt's Format_RGB32. share: a `map` that may work
    on several threads."""
    out = np.empty((*pixels.shape[:2], 4), np.uint8) if out is None else out
    rows = [len(pixels) * k // BANDS for k in range(BANDS + 1)]
    list(share(lambda a, b: _encode(pixels[a:b], out[a:b], np.float32(exposure), CURVE), rows[:-1], rows[1:]))
    return out
