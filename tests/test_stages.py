"""Stages that run one after the other without Python: kernels called by address, arrays written down as words, the clock within."""
import time
from typing import NamedTuple

import numpy as np
import pytest
from numba import types

from rtcore import Box, Camera, Cylinder, Directional, Material, Node, Plane, Point, Scene, Sphere, SphereLight, Translate
from rtcore.clock import TICK, Clock, ticks
from rtcore.indirect import address_of, call, caller, count_of, rows_for, value_at, words_of
from rtcore.jit import kernel
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings

GLASS = Material(diffuse=0.1, transmission=0.9, reflection=1.0, fresnel=True)
SCENE = Scene(
    objects=(Node(shape=Plane((0, -1, 0), (0, 1, 0)), material=Material(reflection=0.3)),
             Node(shape=Sphere((-1, 0, 0), 0.9), material=GLASS), Node(shape=Box((0, -1, -1), (1, 0, 1)), material=GLASS),
             Node(shape=Cylinder((2, -1, 0), (2, 1, 0), 0.4)),
             *(Node(shape=Sphere((0, 0, 0), 0.2), transform=[Translate((-2 + 0.5 * k, 1.2, 1))]) for k in range(9))),
    lights=(Point(position=(-3, 5, -4), intensity=30), Directional(direction=(1, -2, 1), intensity=0.4),
            SphereLight(position=(2, 4, -2), radius=0.5, intensity=20)),
    camera=Camera(lookfrom=(0.5, 1.5, -7), lookat=(0, 0, 0)))


class Inner(NamedTuple):
    few: np.ndarray
    many: np.ndarray


class Outer(NamedTuple):
    first: np.ndarray
    inner: Inner
    last: np.ndarray


@kernel
def add_up(numbers, scale):
    total = 0
    for x in numbers:
        total += int(x)
    return total * scale


@kernel
def fill_in(numbers, with_this):
    for i in range(len(numbers)):
        numbers[i] = with_this


@kernel
def refuse(n):
    if n > 2:
        raise ValueError("too many")
    return n


@caller
def total_by_address(address, numbers, scale):
    return count_of(address, (numbers, scale))


@caller
def fill_by_address(address, numbers, with_this):
    call(address, (numbers, with_this))


@caller
def refuse_by_address(address, n):
    return count_of(address, (n,))


@caller
def add_written(words, row, like):
    value = value_at(words, row, like)
    total = 0.0
    for i in range(value.inner.many.shape[0]):
        for j in range(value.inner.many.shape[1]):
            total += value.inner.many[i, j] * value.inner.few[j]
    value.last[0] = value.first.shape[0]
    return total + value.first.sum()


@caller
def two_readings():
    first = ticks()
    return first, ticks()


def test_a_kernel_is_called_by_its_address():
    numbers = np.arange(5, dtype=np.int32)
    assert total_by_address(address_of(add_up, (numbers, 3), types.int64), numbers, 3) == 30
    fill_by_address(address_of(fill_in, (numbers, 3)), numbers, 7)
    assert numbers.tolist() == [7] * 5


def test_another_kernel_takes_no_compiling():
    numbers = np.arange(5, dtype=np.int32)
    fill_by_address(address_of(fill_in, (numbers, 3)), numbers, 7)
    before = len(fill_by_address.signatures)

    @kernel
    def fill_double(numbers, with_this):
        for i in range(len(numbers)):
            numbers[i] = 2 * with_this
    fill_by_address(address_of(fill_double, (numbers, 3)), numbers, 7)
    assert numbers.tolist() == [14] * 5 and len(fill_by_address.signatures) == before


def test_an_address_is_not_given_for_something_that_returns_something_else():
    with pytest.raises(TypeError, match="add_up returns int64, not none"):
        address_of(add_up, (np.arange(5, dtype=np.int32), 3))


def test_an_error_comes_through():
    address = address_of(refuse, (1,), types.int64)
    assert refuse_by_address(address, 2) == 2
    with pytest.raises(ValueError, match="too many"):
        refuse_by_address(address, 3)


def test_what_was_left_out_can_not_be_called():
    with pytest.raises(RuntimeError, match="left out"):
        refuse_by_address(0, 1)
    with pytest.raises(RuntimeError, match="left out"):
        fill_by_address(0, np.arange(5, dtype=np.int32), 7)


def test_arrays_are_read_as_they_were_written_down():
    like = Outer(np.zeros(0), Inner(np.zeros(0, np.float32), np.zeros((0, 0))), np.zeros(0, np.int32))
    rng, rows = np.random.default_rng(1), rows_for(3, like)
    values = [Outer(rng.random(k), Inner(rng.random(4).astype(np.float32), rng.random((k + 2, 4))), np.zeros(1, np.int32))
              for k in range(3)]
    for k, value in enumerate(values):
        rows[k] = words_of(value)
    for k, value in enumerate(values):
        assert add_written(rows, k, like) == pytest.approx(value.first.sum() + (value.inner.many @ value.inner.few).sum(), rel=1e-12)
        assert value.last[0] == k


def test_the_clock_goes_forward_at_the_pace_of_pythons():
    first, then = two_readings()
    assert then >= first
    start, clock = two_readings()[0], time.perf_counter()
    time.sleep(0.05)
    assert (two_readings()[0] - start) * TICK == pytest.approx(time.perf_counter() - clock, rel=0.2)


def test_a_clock_adds_up_what_kernels_and_python_have_measured():
    clock, names = Clock(), (("fog", "a"), ("film", "b"), ("fog", "a"))
    clock.measure(names)[:] = [1 / TICK, 2 / TICK, 3 / TICK]
    assert clock.seconds() == pytest.approx({("fog", "a"): 4, ("film", "b"): 2})
    clock.start()
    clock.lap(("film", "b"))
    other = (("fog", "a"),)
    clock.measure(other)[:] = [10 / TICK]
    assert clock.measure(other) is clock.ticks      # the same names go on
    assert clock.seconds()[("fog", "a")] == pytest.approx(14) and clock.seconds()[("film", "b")] >= 2


def finished(scene: Scene, edge: int | None, monkeypatch, **settings):
    """The last frame, from tiles of an edge."""
    renderer = Renderer()
    if edge:
        monkeypatch.setattr("rtcore.picture.TILE", edge)
    try:
        *_, last = renderer.frames(RenderRequest(scene, scene.camera, Settings(size=(90, 61), samples=3, **settings)), coarse=False)
    finally:
        renderer.close()
    return last


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_small_tiles_and_large_ones_come_to_the_same(precision, monkeypatch):
    """Waves and beams grow within a tile, several lights go together where rays are few; nothing of that is lost or shows."""
    large = finished(SCENE, None, monkeypatch, precision=precision, threads=1)
    for edge in (16, 3):
        small = finished(SCENE, edge, monkeypatch, precision=precision, threads=2)
        assert small.pixels.tobytes() == large.pixels.tobytes() and small.rays == large.rays


def test_time_is_told_by_stage():
    last = finished(SCENE, None, pytest.MonkeyPatch(), threads=2)
    told = {stage for stage, _ in last.seconds}
    assert {"hits: sphere", "surface at the hits", "shadow rays", "light: point", "light: spherelight", "film", "primary rays",
            "reflected and refracted rays"} <= told and "fog" not in told
    assert all(spent > 0 for spent in last.seconds.values()) and sum(last.seconds.values()) < 2.5 * last.elapsed
