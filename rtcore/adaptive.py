"""Adaptive sampling: how large each pixel's error is, and which pixels get the next samples.

How a pixel's samples scatter says where the error is, but not how large it is: they are stratified, so their mean is better than scatter
over number. The replicates say how large, but two of them say little about a single pixel. So the scatter gives the picture of the error,
and for all pixels with about as many samples together the replicates give its scale. A pixel is given some of its neighbours' scatter, as
much as a few samples count, so that one whose first samples happen to agree beside an edge is not forgotten.

Everything is decided from the film between whole passes, so it does not depend on threads.
"""
from collections.abc import Callable

import numpy as np

from rtcore.film import Film
from rtcore.jit import kernel
from rtcore.sampling import REPLICATES
from rtcore.schedule import Pass

FIRST = 8               # samples of every pixel before any gets more
GROWTH = 0.5            # a pass costs at most this share of all samples so far
PRIOR = 4.0             # samples that the neighbours' scatter is worth: with 1 the estimate was 20 % too low at first, with 8 10 % too high
STEPS = 2               # a pass at most quadruples a pixel's samples
HIGHEST = 16            # a pixel gets at most 2 to the power of that
LEVELS = 32             # logarithms of a number of samples
POWER = 1.5             # the squared error of an edge falls with the number of samples to this power
CONVERGED = 2.0 ** -14  # an error that no screen shows: a fifth of the first step above black in an 8-bit picture
FEW = 16                # pixels' worth of trust in POWER where few pixels tell the scale
BANDS = 16              # of the picture, for threads to share
BINS = 8                # of an octave, in which the share of a pass is found


@kernel
def _scatter(film, first, last, out):
    """The variance of the samples of pixels first .. last - 1, the mean over its channels; 0 where there is one sample only."""
    for p in range(first, last):
        n = np.float64(film.count[p])
        square = film.total[p, 0] ** 2 + film.total[p, 1] ** 2 + film.total[p, 2] ** 2
        out[p] = max((film.square[p] - square / (3 * n)) / (n - 1), 0.0) if n > 1 else 0.0


@kernel
def _compare(film, scatter, width, height, top, bottom, prior, out, level, sums):
    """For rows top .. bottom - 1 squared errors as scatter alone tells them, a pixel's own and its neighbours', and the logarithm of the
    number of samples as level; by level sums[0] over the pixels of what the replicates tell, sums[1] of what their scatter alone would,
    sums[2] how many scatter."""
    for y in range(top, bottom):
        for x in range(width):
            p = y * width + x
            n = film.count[p]
            if n < REPLICATES:
                level[p], out[p] = 0, 0
                continue
            near = 0.0
            for j in range(max(y - 1, 0), min(y + 2, height)):
                for i in range(max(x - 1, 0), min(x + 2, width)):
                    near += scatter[j * width + i]
            near /= (min(y + 2, height) - max(y - 1, 0)) * (min(x + 2, width) - max(x - 1, 0))
            out[p] = (scatter[p] * (n - 1) + near * prior) / (n * (n - 1 + prior))
            at = 0
            while n >> at > 1:
                at += 1
            level[p] = at
            first, second = (n + 1) // 2, n // 2
            for k in range(3):
                t, s = film.total[p, k], np.float64(film.split[p, k])
                apart = (t + s) / (2 * first) - (t - s) / (2 * second)
                sums[0, at] += apart * apart * first * second / (3.0 * n * n)
            sums[1, at] += scatter[p] / n
            sums[2, at] += scatter[p] > 0


def squared_errors(film: Film, width: int, height: int, spread: Callable = map) -> np.ndarray:
    """The estimated squared error of every pixel, the mean over its channels: float32 (h·w), inf where there are too few samples. spread: a
    `map` that may work on several threads."""
    if len(film.square) == 0:
        return np.full(height * width, np.inf, np.float32)
    scatter, result = np.empty(height * width, np.float32), np.empty(height * width, np.float32)
    level, sums = np.empty(height * width, np.uint8), np.zeros((BANDS, 3, LEVELS))
    rows = [height * k // BANDS for k in range(BANDS + 1)]      # always as many, for sums depend on what is summed first
    list(spread(lambda k: _scatter(film, rows[k] * width, rows[k + 1] * width, scatter), range(BANDS)))
    list(spread(lambda k: _compare(film, scatter, width, height, rows[k], rows[k + 1], PRIOR, result, level, sums[k]), range(BANDS)))
    told, naive, pixels = sums.sum(axis=0)
    number = 2.0 ** np.arange(LEVELS)
    # as if some more pixels, typical of the picture, told what is usual: those left at a level may all agree, and tell nothing
    trust = FEW * (naive * number).sum() / max(pixels.sum(), 1) / number
    scale = (told + trust * number ** (1 - POWER)) / np.maximum(naive + trust, np.finfo(float).tiny)
    result *= scale.astype(np.float32)[level]
    result[film.count < REPLICATES] = np.inf
    return result


def rmse_estimate(squared: np.ndarray) -> float | None:
    """Root mean square error of the mean picture, over pixels and channels, from its `squared_errors`. They count what a pixel's neighbours
    let expect of it, so it is fair where pixels got no more samples because their first ones agreed. None below two samples."""
    squared = squared[np.isfinite(squared)]
    return float(np.sqrt(squared.mean(dtype=np.float64))) if len(squared) else None


def refinement(film: Film, squared: np.ndarray, order: np.ndarray, budget: float, growth: float = GROWTH,
               enough: float = CONVERGED, inside: np.ndarray | None = None) -> Pass | None:
    """The next pass for a film and its `squared_errors`: the pixels, in `order`, that get more samples, each in all a power of two, so that
    the expected error of the picture is the least for the pass's cost. budget: samples the whole picture may have, per pixel. None if it
    is spent; a pass without pixels if no pixel's error is larger than `enough`. inside: bool (h·w), pixels that are a picture of their own;
    the others get none."""
    if inside is not None:
        squared = np.where(inside, squared, np.float32(0))
    open_ = np.flatnonzero(squared > enough ** 2)
    spent = int(film.count.sum(dtype=np.int64, where=True if inside is None else inside))
    pixels = len(film.count) if inside is None else np.count_nonzero(inside)
    left = min(budget * pixels - spent, growth * spent)
    if len(open_) == 0:
        return Pass(1, False, range(0), np.empty((0, 3), np.int32))
    n = film.count[open_]
    level = np.log2(n).astype(np.int64)
    # error² = c n^-POWER at the cost n: the least total for a cost has n in proportion to c^(1 / (1 + POWER))
    wish = (np.log2(squared[open_]) + POWER * level) / (1 + POWER)
    wanted = _share(np.floor(wish * BINS).astype(np.int64), level, left)
    last = np.zeros(len(film.count), np.int32)
    last[open_] = np.where(wanted > level, 1 << wanted, 0)
    chosen = order[(last > film.count)[order]]
    if len(chosen) == 0:
        return None
    return Pass(1, False, range(0), np.stack([chosen, film.count[chosen], last[chosen]], axis=1).astype(np.int32))


def _share(wish: np.ndarray, level: np.ndarray, left: float) -> np.ndarray:
    """New levels for pixels at `level` that wish for wish / BINS less a number that is the same for all, and as small as `left` allows."""
    lowest, count = int(wish.min()), int(wish.max()) - int(wish.min()) + 1
    kinds = np.bincount(level * count + wish - lowest)      # pixels by level and wish
    kind = np.flatnonzero(kinds)
    at, wishes, number = kind // count, kind % count + lowest, kinds[kind]

    def levels(wish, at, cut):
        return np.clip((wish - cut + BINS // 2) // BINS, at, np.minimum(at + STEPS, HIGHEST))

    def cost(cut):
        return (number * ((1 << np.maximum(levels(wishes, at, cut), at)) - (1 << at))).sum()

    low, high = lowest - BINS * 24, int(wish.max()) + 2 * BINS      # at `high` nothing is wanted
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if cost(middle) <= left else (middle, high)
    result = np.maximum(levels(wish, level, high), level)
    # of the pixels just below the cut so many as there is room for, spread over the picture by multiples of the golden section
    more = np.maximum(levels(wish, level, low), level)
    edge = np.flatnonzero(more > result)
    extra = (1 << more[edge]) - (1 << result[edge])
    share = min((left - cost(high)) / max(extra.sum(), 1), 1.0)
    turn = np.arange(len(edge)) * 0.6180339887498949 % 1 < share
    edge, extra = edge[turn], extra[turn]
    edge = edge[np.cumsum(extra) <= left - cost(high)]
    result[edge] = more[edge]
    return result
