"""Depth of field: what lies in the plane in focus is sharp, a point beside it becomes a disk of the size that a thin lens gives it, and
without an aperture nothing is there."""
import math

import msgspec
import numpy as np
import pytest

import rtcore
from rtcore import Camera, FieldError, Material, Node, Plane, Scene, Sphere, warm
from rtcore.jit import kernel
from rtcore.plan import plan
from rtcore.progressive import Renderer, RenderRequest
from rtcore.sampling import LENS, REPLICATES, centered, disk
from rtcore.settings import Settings

GLOW = Material(ambient=0, diffuse=0, emission=(1, 1, 1))
PINHOLE = Camera(lookfrom=(0, 0, -4), lookat=(0, 0, 0), fov=40)
LENS_CAMERA = msgspec.structs.replace(PINHOLE, aperture=0.5)


def rendered(camera: Camera, *objects, samples: int = 1024, size=(65, 65), **settings):
    scene = Scene(objects=[Node(shape=shape, material=GLOW) for shape in objects], camera=camera, lights=[])
    return rtcore.render(scene, size, samples, **settings)


@kernel
def lens_points(out, pixel, seed):
    """Places on the unit lens of a pixel's samples, and the numbers they are made of."""
    for sample in range(out.shape[0]):
        u, v = centered(pixel, sample, LENS, seed)
        out[sample, 0], out[sample, 1] = u, v
        out[sample, 2], out[sample, 3] = disk(u, v)


def test_places_on_the_lens_are_stratified_and_begin_in_the_middle():
    for pixel in range(30):
        out = np.empty((256 * REPLICATES, 4))
        lens_points(out, pixel, 5)
        assert out[0].tolist() == [0.5, 0.5, 0, 0] and (out[:, :2] >= 0).all() and (out[:, :2] < 1).all()
        assert not (out[1:, :2] == 0.5).all(1).any()
        for replicate in range(REPLICATES):
            run = out[replicate::REPLICATES, :2]
            for k in range(9):
                for a in range(k + 1):
                    boxes = np.floor(run[:2 ** k] * [2 ** a, 2 ** (k - a)]) @ [2 ** (k - a), 1]
                    assert len(np.unique(boxes)) == 2 ** k
        radius = np.hypot(out[:, 2], out[:, 3])
        assert radius.max() <= 1 and abs((radius ** 2).mean() - 0.5) < 0.01 and np.abs(out[:, 2:].mean(0)).max() < 0.01


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("depth", [-2.0, 6.0])
def test_a_far_point_becomes_the_disk_of_a_thin_lens(depth, precision):
    """A small ball at distance z spreads over aperture·|1/z - 1/focus| of the picture plane at distance 1, its light shared out evenly."""
    camera = msgspec.structs.replace(PINHOLE, aperture=1.0)
    z, ball = 4 + depth, Sphere((0, 0, depth), 0.04 * (4 + depth) / 4)
    blurred = rendered(camera, ball, precision=precision, threads=2).pixels[..., 0].astype(float)
    sharp = rendered(PINHOLE, ball, precision=precision).pixels[..., 0].astype(float)
    assert blurred.sum() == pytest.approx(sharp.sum(), rel=0.06)
    pitch = camera.pitch(65)
    radius = camera.aperture / 2 * abs(1 / z - 1 / 4) / pitch
    y, x = np.mgrid[-32:33, -32:33]
    away = np.hypot(x, y)
    small = 0.04 / 4 / pitch + 1        # the ball itself, and a pixel
    assert (blurred[away > radius + small] == 0).all()
    within = blurred[away < radius - small]
    assert len(within) > 40 and within.mean() == pytest.approx(sharp.sum() / (math.pi * radius ** 2), rel=0.1)
    assert sharp[away > small + 1].max() == 0


def test_the_plane_in_focus_is_sharp():
    """Across the view, off the axis as well; `focus` puts it elsewhere than through lookat."""
    balls = [Sphere((1.0, 0.8, 1.0), 0.15), Sphere((-1, 0, 1.0), 0.2)]
    sharp = rendered(PINHOLE, *balls, samples=256).pixels
    focused = rendered(msgspec.structs.replace(LENS_CAMERA, focus=5.0), *balls, samples=256).pixels
    missed = rendered(LENS_CAMERA, *balls, samples=256).pixels
    assert np.abs(focused - sharp).mean() < 0.1 * np.abs(missed - sharp).mean()


def test_lookat_is_in_focus_unless_told_otherwise():
    turned = msgspec.structs.replace(LENS_CAMERA, focus=4.0)
    floor = Sphere((0.3, 0, 1), 0.5)
    assert np.array_equal(rendered(turned, floor, samples=8).pixels, rendered(LENS_CAMERA, floor, samples=8).pixels)
    left, up, ahead = turned.lens()
    assert np.allclose(ahead * 4, turned.basis()[2]) and np.linalg.norm(left) == np.linalg.norm(up) == 0.25


def test_without_an_aperture_there_is_no_lens():
    scene = Scene(objects=[Sphere((0, 0, 0), 1)], camera=PINHOLE)
    with_lens = msgspec.structs.replace(scene, camera=LENS_CAMERA)
    bare, made = plan(scene, Settings()), plan(with_lens, Settings())
    assert dict(bare.left_out)["depth of field"] == "the camera is a pinhole" and "lens.f64" not in bare.kernels
    assert "depth of field" in made.stages and "lens.f64" in made.kernels and set(made.kernels) <= set(warm.ALL)
    assert plan(scene, Settings(), camera=LENS_CAMERA).lens and not plan(with_lens, Settings(), camera=PINHOLE).lens
    assert not plan(with_lens, Settings(samples=1)).lens and not plan(with_lens, Settings(view="depth")).lens
    # the first sample goes through the middle of the lens: the very picture of a pinhole
    assert np.array_equal(rtcore.render(scene, (40, 30), 1).pixels, rtcore.render(with_lens, (40, 30), 1).pixels)


def test_the_same_bits_for_any_threads_and_passes():
    scene = Scene(objects=[Sphere((0, 0, 0), 1), Sphere((1, 1, 3), 0.5), Plane((0, -1, 0), (0, 1, 0))], camera=LENS_CAMERA)
    first = rtcore.render(scene, (150, 100), 4, threads=1)
    assert first.stats["nonfinite_pixels"] == 0
    assert np.array_equal(first.pixels, rtcore.render(scene, (150, 100), 4, threads=3).pixels)
    renderer = Renderer()
    *_, last = renderer.frames(RenderRequest(scene, LENS_CAMERA, Settings(size=(150, 100), samples=4)))
    assert np.array_equal(first.pixels, last.pixels)
    renderer.close()


def test_the_error_is_told_and_adaptive_sampling_agrees():
    scene = Scene(objects=[Sphere((0, 0, 0), 1), Sphere((1, 1, 3), 0.5), Plane((0, -1, 0), (0, 1, 0))], camera=LENS_CAMERA)
    reference = rtcore.render(scene, (80, 60), 1024, seed=9).pixels
    for adaptive in (False, True):
        image = rtcore.render(scene, (80, 60), 32, adaptive=adaptive)
        true = math.sqrt(((image.pixels - reference).astype(float) ** 2).mean())
        assert 0.75 < image.stats["error"]["rmse_estimate"] / true < 1.33


@pytest.mark.parametrize("field", ["aperture", "focus"])
def test_bad_numbers_are_refused(field):
    for bad in (-1.0, math.inf, math.nan, "wide"):
        with pytest.raises(FieldError, match=field):
            Camera(**{field: bad})
