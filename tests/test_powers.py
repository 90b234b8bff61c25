"""Powers in lanes against numpy's."""
import numpy as np
import pytest

from rtcore.jit import kernel
from rtcore.lanes import load, store
from rtcore.powers import decay, power


@kernel
def powers(x, y, out):
    for i in range(0, x.shape[1], 8):
        store(out, 0, i, power(load(x, 0, i), load(y, 0, i)))


@pytest.mark.parametrize("top", [1.0, 2.0])
def test_powers(top):
    rng = np.random.default_rng(1)
    x, y = top * rng.random((1, 8000)), 10 ** rng.uniform(-3, 3, (1, 8000))
    x[0, :800] = 1 - 10 ** rng.uniform(-16, -1, 800)      # where glossy highlights are
    out = np.empty((1, 8000))
    powers(x, y, out)
    expected = x ** y
    normal = (expected > 2.0 ** -900) & (expected < 2.0 ** 900)
    assert normal.sum() > 4000
    np.testing.assert_allclose(out[normal], expected[normal], rtol=1e-11)
    assert (out[expected <= 2.0 ** -900] <= 2.0 ** -890).all()


def test_powers_of_nought_and_one():
    x, y = np.array([[0.0, 0, 0, 1, 1, 0.5, 0.25, 2]]), np.array([[0.0, 1, 1e-3, 0, 1e4, 1, 0.5, 10]])
    out = np.empty((1, 8))
    powers(x, y, out)
    np.testing.assert_allclose(out, x ** y, rtol=1e-14)


@kernel
def decays(x, out):
    for i in range(0, x.shape[1], 8):
        store(out, 0, i, decay(load(x, 0, i)))


def test_decay():
    x = np.concatenate([[0, 1e-300, 700, 1e300, np.inf], 10 ** np.random.default_rng(2).uniform(-18, 2.8, 8003)])[None]
    out = np.empty_like(x)
    decays(x, out)
    np.testing.assert_allclose(out, np.exp(-x), rtol=1e-13, atol=2.0 ** -1000)
    assert out[0, 0] == 1 and out[0, 3] == out[0, 4] == 2.0 ** -1000
