"""Samples: stratified in every box they should be, evenly spread, independent between pixels, replicates and dimensions; their error
estimate is that of edges and of slopes."""
import numpy as np
import pytest

import rtcore  # noqa: F401 -- before numba, whose cache folder it sets
from rtcore.jit import kernel
from rtcore.sampling import REPLICATES, jitter, square


@kernel
def fill(out, pixel, dimension, seed):
    """Samples 0 .. n - 1 of a pixel; dimension 0 is the place in the pixel."""
    for sample in range(out.shape[0]):
        x, y = jitter(pixel, sample, seed) if dimension == 0 else square(pixel, sample, dimension, seed)
        out[sample, 0], out[sample, 1] = x, y


def points(pixel: int, n: int, dimension: int = 0, seed: int = 0) -> np.ndarray:
    out = np.empty((n, 2))
    fill(out, pixel, dimension, seed)
    return out


def sobol(n: int) -> np.ndarray:
    """The first n points of the Sobol (0, 2)-sequence from its direction numbers, bit by bit."""
    down = [1 << 31]
    while len(down) < 32:
        down.append(down[-1] ^ down[-1] >> 1)
    out = np.zeros((n, 2), np.uint64)
    for i in range(n):
        for bit in range(32):
            if i >> bit & 1:
                out[i] ^= np.array([1 << 31 - bit, down[bit]], np.uint64)
    return out


@pytest.mark.parametrize("dimension", [0, 1, 5])
def test_every_box_of_every_form_has_one_point(dimension):
    for pixel in range(40):
        for replicate in range(REPLICATES):
            run = points(pixel, 256 * REPLICATES, dimension, 7)[replicate::REPLICATES]
            for k in range(9):
                for a in range(k + 1):
                    boxes = np.floor(run[:2 ** k] * [2 ** a, 2 ** (k - a)]) @ [2 ** (k - a), 1]
                    assert len(np.unique(boxes)) == 2 ** k


def test_scrambling_is_nested():
    """Two points share as many leading digits after it as before: that is what nested means."""
    def shared(a, b):
        return 32 - int(a ^ b).bit_length()
    plain = sobol(64)
    for replicate in range(REPLICATES):
        mine = np.round(points(11, 64 * REPLICATES, seed=3)[replicate::REPLICATES] * 2.0 ** 32).astype(np.uint64)
        for axis in range(2):
            assert all(shared(plain[i, axis], plain[j, axis]) == shared(mine[i, axis], mine[j, axis]) for i in range(64) for j in range(i))


def test_sample_0_is_the_centre_and_all_lie_in_the_pixel():
    for pixel in (0, 1, 2**28):
        run = points(pixel, 1024, seed=2**31 - 1)
        assert run[0].tolist() == [0.5, 0.5] and run.min() >= 0 and run.max() < 1
        assert len(np.unique(run, axis=0)) == 1024


def test_samples_are_uniform_over_pixels():
    many = np.array([points(pixel, 16, dimension) for pixel in range(4000) for dimension in (1,)])
    for sample in range(16):
        for axis in range(2):
            counts = np.histogram(many[:, sample, axis], 32, (0, 1))[0]
            assert ((counts - 125) ** 2 / 125).sum() < 80       # chi squared with 31 degrees of freedom: one in a million is larger
    second = np.array([points(pixel, 16)[1::REPLICATES] for pixel in range(4000)])      # the replicate without the centre
    assert np.abs(second.mean(axis=0) - 0.5).max() < 5 / np.sqrt(12 * 4000)


def test_replicates_pixels_seeds_and_dimensions_are_independent():
    n = 4000
    place = np.array([points(pixel, 9) for pixel in range(n)])
    light = np.array([points(pixel, 9, 1) for pixel in range(n)])
    lens = np.array([points(pixel, 9, 2) for pixel in range(n)])
    other = np.array([points(pixel, 9, seed=1) for pixel in range(n)])
    for a, b in ((place[:, 2::2], place[:, 1::2]), (place, light), (light, lens), (place, other), (light[:-1], light[1:]),
                 (light[:, 2::2], light[:, 1::2])):
        a, b = (x.reshape(len(x), -1)[:, x.std(axis=0).reshape(-1) > 0] for x in (a, b))
        across = np.corrcoef(a.T, b.T)[:a.shape[1], a.shape[1]:]
        assert np.abs(across).max() < 5.5 / np.sqrt(n)


@pytest.mark.parametrize(("shape", "power"), [("edge", -0.75), ("slope", -1.5)])
def test_the_replicates_tell_the_error(shape, power):
    """On random edges and slopes, whose means are known: the estimate is the error, and the error falls as it should."""
    random, errors = np.random.default_rng(1), []
    for n in (16, 64):
        true, told, scatter = [], [], []
        for pixel in range(3000):
            if shape == "edge":
                at, left = random.random(), random.random() < 0.5
                y = (points(pixel, n)[:, int(left)] + 0.3 * points(pixel, n)[:, int(not left)] < at + 0.15).astype(float)
                grid = (np.arange(256) + 0.5) / 256
                mean = np.clip(at + 0.15 - 0.3 * grid, 0, 1).mean()
            else:
                gradient = random.normal(size=2)
                y, mean = points(pixel, n) @ gradient, gradient.sum() / 2
            true.append((y.mean() - mean) ** 2)
            told.append((y[::2].mean() - y[1::2].mean()) ** 2 / 4)
            scatter.append(y.var(ddof=1) / n)
        error, estimate, naive = (np.sqrt(np.mean(x)) for x in (true, told, scatter))
        assert 0.9 < estimate / error < 1.1
        assert naive > 1.7 * error      # what the scatter of stratified samples would have told
        errors.append(error)
    assert np.log(errors[1] / errors[0]) / np.log(4) == pytest.approx(power, abs=0.15)
