"""What goes across lanes, and sixteen rays at a time, against numpy."""
import numpy as np
import pytest

from rtcore.across import largest, smallest
from rtcore.jit import kernel
from rtcore.lanes import load, store
from rtcore.neighbours import load_triples, store_triples
from rtcore.pyramid import HIGHS, INVERSE, LOWS, REACH
from rtcore.turns import meeting, octets

DTYPES = [np.float32, np.float64]


@kernel
def ends(x, out):
    for i in range(0, x.shape[1], 8):
        out[0, i // 8], out[1, i // 8] = smallest(load(x, 0, i)), largest(load(x, 0, i))


@kernel
def turned(points, out, again):
    for i in range(0, len(points), 8):
        v = load_triples(points, i)
        store(out, 0, i, v.x)
        store(out, 1, i, v.y)
        store(out, 2, i, v.z)
        store_triples(again, i, v.x, v.y, v.z)


@kernel
def met(coarse, box, row, column):
    rays = meeting(coarse, box, row, column)
    return rays, octets(rays)


@pytest.mark.parametrize("dtype", DTYPES)
def test_the_smallest_and_the_largest_wherever_they_are(dtype):
    rng = np.random.default_rng(1)
    x = np.concatenate([np.array([rng.permutation(8) for _ in range(64)]), [[np.inf, -np.inf, 0, -0.0, 1, 1, 2, -5]]]).astype(dtype)
    out = np.empty((2, len(x)), dtype)
    ends(x.reshape(1, -1), out)
    np.testing.assert_array_equal(out, [x.min(1), x.max(1)])


@pytest.mark.parametrize("dtype", DTYPES)
def test_triples_are_turned_and_back(dtype):
    points = np.random.default_rng(2).normal(size=(24, 3)).astype(dtype)
    out, again = np.empty((3, 24), dtype), np.empty((24, 3), dtype)
    turned(points, out, again)
    np.testing.assert_array_equal(out, points.T)
    np.testing.assert_array_equal(again, points)


def test_which_of_64_rays_meet_a_box():
    rng = np.random.default_rng(3)
    o, d, reach = rng.uniform(-1, 1, (3, 64)), rng.normal(size=(3, 64)), rng.uniform(0, 2, 64)
    reach[rng.random(64) < 0.1] = -1        # not alive
    coarse = np.zeros((16, 64), np.float32)
    coarse[INVERSE:INVERSE + 3] = 1 / d
    coarse[LOWS:LOWS + 3] = coarse[HIGHS:HIGHS + 3] = -o / d
    coarse[REACH] = reach
    seen = 0
    for _ in range(50):
        low = rng.uniform(-1, 0.5, 3)
        high = low + rng.uniform(0.05, 0.8, 3)
        box = np.full((24, 8), np.nan, np.float32)
        box[8:11, 5], box[11:14, 5] = low, high
        planes = (np.stack([low, high])[:, :, None] - o) / d
        enter, leave = np.maximum(planes.min(0).max(0), 0), np.minimum(planes.max(0).min(0), reach)
        rays, eights = met(coarse, box, 8, 5)
        found = np.array([(rays >> k) & 1 for k in range(64)], bool)
        sure = np.abs(enter - leave) > 1e-5         # the others graze it: float32 may see that either way
        np.testing.assert_array_equal(found[sure], (enter <= leave)[sure])
        assert [(eights >> k) & 1 for k in range(8)] == found.reshape(8, 8).any(1).astype(int).tolist()
        seen += found.sum()
    assert 0.02 < seen / (50 * 64) < 0.9, seen
