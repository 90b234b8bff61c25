"""Pixel filters: placed by the filter, flat where the picture is flat, right to a picture filtered by hand, honest about their error."""
import math

import numpy as np
import pytest

import rtcore
from rtcore import Background, Camera, FieldError, Material, Node, Plane, Polygon, Scene, Sphere, filters, warm
from rtcore.plan import plan
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings

GLOW = Material(ambient=0, diffuse=0, emission=(1, 0.5, 0.25))
EDGE = Scene(objects=[Node(shape=Polygon([(-9, -9, 0), (0.13, -9, 0), (0.4, 9, 0), (-9, 9, 0)]), material=GLOW)], lights=[],
             camera=Camera(lookfrom=(0, 0, -4), fov=30))
ROOM = Scene(objects=[Plane((0, -1, 0), (0, 1, 0)), Sphere((0, 0, 0), 1), Sphere((1.6, -0.4, -1), 0.6)],
             camera=Camera(lookfrom=(0, 1, -6)), background=Background(top=(0.4, 0.6, 1)))
NAMES = ("gaussian", "mitchell")


def weights(name: str, x: np.ndarray) -> np.ndarray:
    """The filter along one axis, 0 beyond its reach."""
    shape, radius = filters.SHAPES[name]
    return np.where(np.abs(x) < radius, shape(x), 0)


@pytest.mark.parametrize("name", NAMES)
def test_places_are_distributed_as_the_filter(name):
    one, (shape, radius) = filters.made(name), filters.SHAPES[name]
    assert one.place[0] == -radius and one.place[-1] == radius and one.place[filters.CELLS // 2] == 0 and (np.diff(one.place) > 0).all()
    x = np.linspace(-radius, radius, 400_001)
    middle, mass = 0.5 * x[1:] + 0.5 * x[:-1], np.abs(shape(0.5 * x[1:] + 0.5 * x[:-1]))
    for power in (2, 4):
        mine = np.mean([one.place[:-1] ** power, one.place[1:] ** power])
        assert mine == pytest.approx((mass * middle ** power).sum() / mass.sum(), rel=4e-3)
    assert one.gain == pytest.approx((shape(middle).sum() / mass.sum()) ** 2, abs=2e-3)
    assert (one.sign == np.sign(shape(0.5 * one.place[1:] + 0.5 * one.place[:-1]))).all() and (one.gain < 1) == (name == "mitchell")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("samples", [1, 2, 3, 7, 16])
def test_a_flat_picture_is_flat(name, samples):
    image = rtcore.render(Scene(background=Background(color=(0.3, 0.6, 0.9))), (40, 30), samples, filter=name)
    assert np.allclose(image.pixels, (0.3, 0.6, 0.9), rtol=1e-6, atol=0)
    assert samples == 1 or image.stats["error"]["rmse_estimate"] < 1e-6


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", NAMES)
def test_a_ramp_is_the_same_ramp(name, precision):
    """A symmetric filter that adds up to 1 keeps what is linear, but for the noise of its samples."""
    sky = Scene(background=Background(color=(0, 0, 0), top=(1, 1, 1)), camera=Camera(lookfrom=(0, 0, 0), lookat=(0, 0, 1), fov=20))
    truth = rtcore.render(sky, (16, 12), 1, precision=precision).pixels        # pixels' centres
    shown = rtcore.render(sky, (16, 12), 512, precision=precision, filter=name).pixels
    step = np.abs(np.diff(truth[:, 0, 0])).mean()
    assert step > 0.01 and np.abs(shown - truth).max() < 0.1 * step and abs((shown - truth).mean()) < 2e-3 * step


@pytest.mark.parametrize("name", NAMES)
def test_an_edge_is_that_of_a_picture_filtered_by_hand(name):
    """Against point samples, 32 x 32 a pixel, multiplied with the filter; beyond the picture's edge as well."""
    fine, (width, height) = 32, (24, 18)
    margin = 2
    camera = EDGE.camera
    eye, corner, right, down = camera.rays(width, height)
    x = (np.arange((width + 2 * margin) * fine) + 0.5) / fine - margin
    y = (np.arange((height + 2 * margin) * fine) + 0.5) / fine - margin
    d = corner + x[None, :, None] * right + y[:, None, None] * down
    hit = rtcore.intersect(EDGE, np.broadcast_to(eye, (d.size // 3, 3)), d.reshape(-1, 3)).node.reshape(len(y), len(x)) >= 0
    across = weights(name, x[:, None] - (np.arange(width) + 0.5))
    along = weights(name, y[:, None] - (np.arange(height) + 0.5))
    expected = (along / along.sum(0)).T @ hit @ (across / across.sum(0))
    shown = rtcore.render(EDGE, (width, height), 4096, filter=name).pixels
    assert np.allclose(shown, expected[:, :, None] * GLOW.emission, atol=4e-3)
    assert (expected.min() < -0.01) == (name == "mitchell") and (shown.min() < -0.01) == (name == "mitchell")


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", NAMES)
def test_the_same_bits_for_any_threads_and_passes(name, precision):
    for adaptive in (False, True):
        settings = {"filter": name, "adaptive": adaptive, "precision": precision}
        first = rtcore.render(ROOM, (100, 70), 12, threads=1, **settings)
        assert first.stats["nonfinite_pixels"] == 0
        assert np.array_equal(first.pixels, rtcore.render(ROOM, (100, 70), 12, threads=3, **settings).pixels)
        renderer = Renderer()
        *_, last = renderer.frames(RenderRequest(ROOM, ROOM.camera, Settings(size=(100, 70), samples=12, **settings)))
        assert np.array_equal(first.pixels, last.pixels)
        renderer.close()


@pytest.mark.parametrize("name", ["box", *NAMES])
def test_the_error_is_told(name):
    for scene in (ROOM, EDGE):
        reference = rtcore.render(scene, (80, 60), 2048, filter=name, seed=9).pixels
        for adaptive in (False, True):
            ratios = []
            for seed in range(3):
                image = rtcore.render(scene, (80, 60), 16, filter=name, adaptive=adaptive, seed=seed)
                true = math.sqrt(((image.pixels - reference).astype(float) ** 2).mean())
                ratios.append(image.stats["error"]["rmse_estimate"] / true)
            assert 0.75 < np.mean(ratios) < 1.33, ratios


def test_another_filter_is_another_picture_and_nothing_of_the_last_one_remains():
    renderer = Renderer()
    for name in ("box", "mitchell", "gaussian", "mitchell", "box"):
        *_, last = renderer.frames(RenderRequest(ROOM, ROOM.camera, Settings(size=(60, 40), samples=4, filter=name)))
        assert np.array_equal(last.pixels, rtcore.render(ROOM, (60, 40), 4, filter=name).pixels)
    renderer.close()
    one = {name: rtcore.render(ROOM, (60, 40), 1, filter=name).pixels.tobytes() for name in ("box", *NAMES)}
    assert len(set(one.values())) == 1      # the pixels' centres


def test_the_plan_tells_why_it_is_left_out():
    made = plan(ROOM, Settings(filter="mitchell"))
    assert "pixel filter" in made.stages and "filter.f64" in made.kernels and set(made.kernels) <= set(warm.ALL)
    for settings, why in (({}, "with a box, samples lie evenly in their pixel"),
                          ({"filter": "gaussian", "samples": 1}, "a pixel's first sample is its centre"),
                          ({"filter": "gaussian", "view": "depth"}, "the view shows first hits only")):
        out = plan(ROOM, Settings(**settings))
        assert dict(out.left_out)["pixel filter"] == why and "filter.f64" not in out.kernels


def test_another_word_is_refused():
    with pytest.raises(FieldError, match="filter: expected one of box, gaussian, mitchell"):
        Settings(filter="lanczos")
