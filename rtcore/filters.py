"""Pixel filters: how much what lies about a pixel's centre counts. Samples are placed where the filter has weight, as often as it has it
(Ernst, Stamminger and Greiner, "Filter Importance Sampling", RT 2006), so a pixel's samples stay its own and all count alike.

A filter with negative lobes is sampled by its size, and samples there count negatively. For samples s with signs w, E of which is the
`gain`, the mean is taken as Σ w s / (n E) - (Σ w / (n E) - 1) Σ s / n: where all samples are the same, that is what the picture shows,
however many of them were negative, and nothing is divided by a sum that might be 0. A film keeps what that takes in `Film.plain`;
`settled` makes of it one that is read like any other.
"""
import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rtcore.film import Film
from rtcore.jit import inline, kernel
from rtcore.sampling import REPLICATES, jitter
from rtcore.shapes.kind import normalized
from rtcore.wave import DX, DY, DZ

CELLS = 1 << 12     # steps in which a filter is sampled along each axis
FINE = 1 << 18      # and those in which it is integrated
SIGMA = 0.5         # of the Gaussian, in pixels


class Filter(NamedTuple):
    """A filter along one axis; in the plane it is the product of two."""

    place: np.ndarray   # float64 (CELLS + 1): distance from the centre, in pixels, below which are so many shares of its size
    sign: np.ndarray    # float32 (CELLS): 1 or -1, where it is negative
    gain: float         # the integral of the filter over that of its size, in the plane


def gaussian(x: np.ndarray) -> np.ndarray:
    """A bell that comes down to 0 at 1.5 pixels."""
    return np.exp(-0.5 * (x / SIGMA) ** 2) - np.exp(-0.5 * (1.5 / SIGMA) ** 2)


def mitchell(x: np.ndarray) -> np.ndarray:
    """The cubic with B = C = 1/3, up to 2 pixels (Mitchell and Netravali, "Reconstruction Filters in Computer Graphics", SIGGRAPH 1988)."""
    x = np.abs(x)
    return np.where(x < 1, 7 * x ** 3 - 12 * x ** 2 + 16 / 3, -7 / 3 * x ** 3 + 12 * x ** 2 - 20 * x + 32 / 3) / 6


#: Name, the filter along one axis, how far it reaches in pixels. A box takes what `sampling.jitter` gives.
SHAPES: dict[str, tuple[Callable, float]] = {"gaussian": (gaussian, 1.5), "mitchell": (mitchell, 2.0)}


@functools.cache
def made(name: str) -> Filter:
    """The filter of that name, but for the box."""
    shape, radius = SHAPES[name]
    x = (np.arange(FINE) + 0.5) * (radius / FINE)
    value = shape(x)
    share = np.concatenate([[0], np.cumsum(np.abs(value))])
    half = np.interp(np.arange(CELLS // 2 + 1) / (CELLS // 2) * share[-1], share, np.arange(FINE + 1) * (radius / FINE))
    place = np.concatenate([-half[:0:-1], half])
    sign = np.sign(shape(0.5 * place[1:] + 0.5 * place[:-1]))
    return Filter(place, sign.astype(np.float32), float(sign.mean() ** 2))


@inline
def _offset(place, share):
    """Where a share, 0 .. 1, of the filter's size lies, and in which of its cells."""
    at = share * CELLS
    cell = int(at)
    return place[cell] + (at - cell) * (place[cell + 1] - place[cell]), cell


@kernel
def spread(wave, n, target, number, view, width, place, sign, seed, signs):
    """Aim the wave's n primary rays, of pixels `target` and sample numbers `number`, at places that a filter gives them; signs, float32
    (n), become those of the samples. view as for `eye.cast`, width of the picture; place and sign as in `Filter`."""
    ray = wave.rays.ray
    for i in range(n):
        u, v = jitter(target[i], number[i], seed)
        x, across = _offset(place, u)
        y, down = _offset(place, v)
        signs[i] = sign[across] * sign[down]
        x, y = x + target[i] % width + 0.5, y + target[i] // width + 0.5
        ray[DX, i], ray[DY, i], ray[DZ, i] = normalized(
            view[1, 0] + x * view[2, 0] + y * view[3, 0], view[1, 1] + x * view[2, 1] + y * view[3, 1],
            view[1, 2] + x * view[2, 2] + y * view[3, 2])


@kernel
def commit(film, sample, n, target, signs):
    """As `film.commit`, for a filter that has negative lobes."""
    bad = 0
    for i in range(n):
        p, w = target[i], np.float64(signs[i])
        side = 1 - 2 * (film.count[p] % REPLICATES)
        if film.count[p] == 0:
            film.square[p] = 0
            for k in range(3):
                film.total[p, k] = film.split[p, k] = 0
            for k in range(5):
                film.plain[p, k] = 0
        ok = np.isfinite(sample[0, i] + sample[1, i] + sample[2, i])
        bad += not ok
        for k in range(3):
            s = np.float64(sample[k, i]) if ok else 0.0
            film.total[p, k] += w * s
            film.split[p, k] += np.float32(side * w * s)
            film.square[p] += s * s / 3
            film.plain[p, k] += s
        film.plain[p, 3] += w
        film.plain[p, 4] += side * w
        film.count[p] += 1
    return bad


@kernel
def _settle(film, gain, total, split, square):
    for p in range(film.count.shape[0]):
        n = film.count[p]
        if n == 0:
            continue
        first, second = (n + 1) // 2, n // 2
        weight, apart = film.plain[p, 3], film.plain[p, 4]
        scatter = film.square[p]
        light = 0.0
        for k in range(3):
            plain, t, s = film.plain[p, k] / n, film.total[p, k], np.float64(film.split[p, k])
            mean = (t - weight * plain) / (n * gain) + plain
            # how far the mean is off for the samples of each half, to the first order
            left = ((t + s) - plain * (weight + apart)) / (2 * first * gain)
            right = ((t - s) - plain * (weight - apart)) / (2 * second * gain) if second > 0 else left
            total[p, k] = n * mean
            split[p, k] = (2 * (left - right) - n * mean * (1 / first - 1 / second)) / (1 / first + 1 / second) if second > 0 else mean
            scatter -= n * plain * plain / 3
            light += n * mean * mean / 3
        square[p] = max(scatter, 0.0) / (gain * gain) + light


def settled(film: Film, gain: float) -> Film:
    """The film as a filter of this gain makes it: one whose `total`, `split` and `square` say what they say without signs. The film itself
    if it has none."""
    if not len(film.plain):
        return film
    total, split, square = np.zeros_like(film.total), np.zeros_like(film.split), np.zeros_like(film.square)
    _settle(film, gain, total, split, square)
    return film._replace(total=total, split=split, square=square)
