"""The lane types against numpy and exact fractions, in both precisions; and that the hot kernels really are vector code."""
import os
import platform
import re
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from rtcore.jit import kernel
from rtcore.lanes import (LANES, add_where, along, any_lane, bits, cross, dot, exceeds, fma, greatest, least, load, load3, narrow, root,
                          select, size, splat3, store, store_where, vec3, with_sign)

DTYPES = [np.float32, np.float64]


@kernel
def operators(x, y, number, out, masks):
    for i in range(0, x.shape[1], 8):
        a, b = load(x, 0, i), load(y, 0, i)
        store(out, 0, i, a + b)
        store(out, 1, i, a - b)
        store(out, 2, i, a * b)
        store(out, 3, i, a / b)
        store(out, 4, i, -a)
        store(out, 5, i, root(a))
        store(out, 6, i, size(a))
        store(out, 7, i, with_sign(a, b))
        store(out, 8, i, least(a, b))
        store(out, 9, i, greatest(a, b))
        store(out, 10, i, select(a < b, a, b))
        store(out, 11, i, a + number)
        store(out, 12, i, number - a)
        store(out, 13, i, a * 2)
        store(out, 14, i, 1 / a)
        store(out, 15, i, least(a, 0.5))
        store(out, 16, i, greatest(0.5, a))
        store(out, 17, i, select(a >= 0, a, -1))
        comparisons = (a < b, a <= b, a > b, a >= b, a == b, (a < b) & (a > 0), (a < b) | (a > 0), (a < b) ^ (a > 0), ~(a < b), a < 0.5)
        for k, m in enumerate(comparisons):
            masks[k, i // 8] = bits(m)
            masks[k + 10, i // 8] = any_lane(m)


@kernel
def fused(x, y, z, out):
    for i in range(0, x.shape[1], 8):
        store(out, 0, i, fma(load(x, 0, i), load(y, 0, i), load(z, 0, i)))


@kernel
def fused_number(x, y, z):
    return fma(x, y, z)


@kernel
def vectors(p, q, t, out):
    for i in range(0, p.shape[1], 8):
        a, b, s = load3(p, 0, i), load3(q, 0, i), load(t, 0, i)
        store(out, 0, i, dot(a, b))
        c, d, e, f, g = cross(a, b), along(a, s, b), a - b, s * (a + b), -(a * 2.0)
        for k in range(5):
            v = c if k == 0 else d if k == 1 else e if k == 2 else f if k == 3 else g
            store(out, 1 + 3 * k, i, v.x)
            store(out, 2 + 3 * k, i, v.y)
            store(out, 3 + 3 * k, i, v.z)
        h = select(s > 0, a, b)
        store(out, 16, i, h.x)
        store(out, 17, i, vec3(h.x, h.y, h.z).z)
        store(out, 18, i, splat3(p, 1, 2).z)


@kernel
def memory(a, ids, into, i, rounded):
    store(into, 1, i, load(a, 1, i))
    store(rounded, 0, i, narrow(load(a, 1, i)))
    m = load(a, 0, i) > 0
    before = bits(exceeds(ids, i, 3))
    store_where(ids, i, m, 7)
    add_where(ids, i, ~m, 10)
    return before


def numbers(dtype, n=64, seed=0):
    """Ordinary ones, and pairs of all special ones."""
    rng = np.random.default_rng(seed)
    special = np.array([0.0, -0.0, 1, -1, np.inf, -np.inf, np.nan, np.finfo(dtype).tiny, np.finfo(dtype).max, 0.5], dtype)
    x, y = (g.ravel() for g in np.meshgrid(special, special))
    pad = -len(x) % LANES + n
    return (np.concatenate([x, rng.normal(size=pad).astype(dtype)])[None].copy(),
            np.concatenate([y, rng.normal(size=pad).astype(dtype)])[None].copy())


@pytest.mark.parametrize("dtype", DTYPES)
def test_operators(dtype):
    x, y = numbers(dtype)
    n = x.shape[1]
    out, masks = np.empty((18, n), dtype), np.empty((20, n // 8), np.int64)
    operators(x, y, 0.25, out, masks)
    a, b = x[0], y[0]
    with np.errstate(all="ignore"):
        expected = [a + b, a - b, a * b, a / b, -a, np.sqrt(a), np.abs(a), np.copysign(a, b), np.where(a < b, a, b), np.where(a > b, a, b),
                    np.where(a < b, a, b), a + dtype(0.25), dtype(0.25) - a, a * 2, 1 / a, np.where(a < 0.5, a, 0.5),
                    np.where(a < 0.5, 0.5, a), np.where(a >= 0, a, -1)]
    for k, want in enumerate(expected):
        np.testing.assert_array_equal(out[k], want.astype(dtype), err_msg=str(k))
        known = ~np.isnan(want)
        assert (np.signbit(out[k]) == np.signbit(want))[known].all(), k      # 0 and -0 as well
    tests = [a < b, a <= b, a > b, a >= b, a == b, (a < b) & (a > 0), (a < b) | (a > 0), (a < b) ^ (a > 0), ~(a < b), a < 0.5]
    for k, want in enumerate(tests):
        lanes = want.reshape(-1, 8)
        assert (masks[k] == (lanes << np.arange(8)).sum(1)).all(), k
        assert (masks[k + 10] == lanes.any(1)).all(), k


@pytest.mark.parametrize("dtype", DTYPES)
def test_least_and_greatest_take_the_second_where_one_is_nan(dtype):
    x = np.array([[np.nan, 1, np.nan, 1, 2, 1, np.inf, -np.inf]], dtype)
    y = np.array([[1, np.nan, np.nan, 2, 1, 1, np.nan, np.nan]], dtype)
    out, masks = np.empty((18, 8), dtype), np.empty((20, 1), np.int64)
    operators(x, y, 0.0, out, masks)
    np.testing.assert_array_equal(out[8], np.array([1, np.nan, np.nan, 1, 1, 1, np.nan, np.nan], dtype))
    np.testing.assert_array_equal(out[9], np.array([1, np.nan, np.nan, 2, 2, 1, np.nan, np.nan], dtype))
    assert (masks[:5, 0] == [8, 8 + 32, 16, 16 + 32, 32]).all()     # no comparison holds with a NaN


def nearest_float(value: Fraction, dtype):
    """A fraction rounded once, to even; by comparing it with the neighbours of a guess."""
    guess = dtype(float(value))     # float() of a fraction is correctly rounded
    options = {guess, np.nextafter(guess, dtype(-np.inf)), np.nextafter(guess, dtype(np.inf))}
    return min(options, key=lambda v: (abs(Fraction(float(v)) - value), int(v.view(f"i{v.itemsize}")) & 1))


@pytest.mark.parametrize("dtype", DTYPES)
def test_fma_rounds_once(dtype):
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=(2, 1, 512)).astype(dtype)
    z = -(x * y) * rng.choice([1, 1 + np.finfo(dtype).eps, 0.5, 1e-8], x.shape).astype(dtype)    # so that much cancels
    out = np.empty((1, 512), dtype)
    fused(x, y, z, out)
    exact = [nearest_float(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c)), dtype) for a, b, c in zip(x[0], y[0], z[0])]
    assert (out[0] == exact).all()
    assert (out[0] != x[0] * y[0] + z[0]).mean() > 0.2      # that it matters
    if dtype is np.float64:
        assert fused_number(x[0, 0], y[0, 0], z[0, 0]) == out[0, 0]


@pytest.mark.parametrize("dtype", DTYPES)
def test_vectors(dtype):
    rng = np.random.default_rng(2)
    p, q, t = (rng.normal(size=(r, 16)).astype(dtype) for r in (3, 3, 1))
    out = np.empty((19, 16), dtype)
    vectors(p, q, t, out)
    a, b, s = p.astype(np.longdouble), q.astype(np.longdouble), t[0].astype(np.longdouble)
    expected = np.concatenate([[(a * b).sum(0)], np.cross(a.T, b.T).T, a + s * b, a - b, s * (a + b), -2 * a,
                               np.where(s > 0, a, b)[[0, 2]], [np.full(16, p[1, 4])]])
    np.testing.assert_allclose(out, expected.astype(dtype), rtol=0, atol=8 * np.finfo(dtype).eps * np.abs(expected).max())
    assert (out[7:10] == p - q).all() and (out[13:16] == -2 * p).all()


@pytest.mark.parametrize("dtype", DTYPES)
def test_memory_touches_its_eight_columns_only(dtype):
    a = np.arange(48, dtype=dtype).reshape(2, 24) / 3
    a[0] = np.where(np.arange(24) % 3 == 0, 1, -1)
    into, rounded, ids = np.full((3, 24), -5, dtype), np.full((1, 24), -5, np.float32), np.arange(24, dtype=np.int32)
    before = memory(a, ids, into, 5, rounded)
    inside = (np.arange(24) >= 5) & (np.arange(24) < 13)
    assert (into[[0, 2]] == -5).all() and (into[1] == np.where(inside, a[1], -5)).all()
    assert (rounded[0] == np.where(inside, a[1].astype(np.float32), -5)).all()
    assert before == 255
    assert (ids == np.where(inside, np.where(a[0] > 0, 7, np.arange(24) + 10), np.arange(24))).all()


ASM = """
import sys
import numpy as np
import rtcore
from rtcore.flatten import flatten
from rtcore.wave import CLOSEST, new_rays
shapes = {"sphere": rtcore.Sphere((0, 0, 0), 1), "triangle": rtcore.Triangle((0, 0, 0), (1, 0, 0), (0, 1, 0))}
for name in sys.argv[1:]:
    name, precision = name.split(".")
    (group,) = flatten(rtcore.Scene(objects=[shapes[name]]), precision).groups
    rays = new_rays(8, group.table.data.dtype)
    rays.ray[:] = 1
    group.kind.intersect(rays, 8, group.tree, group.table, 0, CLOSEST)
    print("KERNEL", name, precision)
    print("\\n".join(group.kind.intersect.inspect_asm().values()))
"""


@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="reads x86 assembly")
def test_hot_kernels_are_vector_code(tmp_path):
    """Compiled afresh: code that comes from the cache has no assembly to look at. The walk through the tree is part of each."""
    env = {**os.environ, "RAYSCOPE_CACHE": str(tmp_path), "PYTHONPATH": str(Path(__file__).parent.parent)}
    run = subprocess.run([sys.executable, "-c", ASM, "sphere.f64", "triangle.f32"], env=env, capture_output=True, text=True, timeout=250)
    assert run.returncode == 0, run.stderr
    operation = r"\bv?(?:mul|add|sub|div|sqrt|fn?m(?:add|sub)\d+)"
    kernels = run.stdout.split("KERNEL ")[1:]
    assert len(kernels) == 2
    for code in kernels:
        name, precision = code.split("\n")[0].split()
        # the kernel's own body: slow ways out, which are single rays' business, stand beside it
        code = re.search(r"^_ZN\w+9intersect\w*:\n(.*?)^\t\.size", code, re.M | re.S)[1]
        suffix = {"f64": "d", "f32": "s"}[precision]
        assert len(re.findall(rf"{operation}p{suffix}\b", code)) > 60, name
        assert len(re.findall(rf"{operation}s[sd]\b", code)) < 40, name      # outside the lanes only what all of them share
        # the walk's box test, in float32 whatever the shapes' precision
        assert len(re.findall(r"\bv?(?:min|max|cmp\w*)ps\b", code)) > 30, name
