"""Lights with an extent against closed forms: the light of a ball and of a polygon, penumbrae, and what is left of them far away."""
import math

import msgspec
import numpy as np
import pytest

import rtcore
from rtcore import Camera, FieldError, Material, Node, Plane, Point, Polygon, RectangleLight, Scene, Sphere, SphereLight
from rtcore.plan import plan
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings
from rtcore.warm import ALL

#: At the origin of the plane z = 0, from the side of negative z.
AHEAD = Camera(lookfrom=(0, 0, -2), lookat=(0, 0, 0), fov=0.01)
PLAIN = Material(color=(1, 1, 1), ambient=0)
FLOOR = Node(shape=Plane((0, 0, 0), (0, 0, -1)), material=PLAIN)
BALL = SphereLight(position=(0, 0, -4), radius=1, intensity=5)
PANEL = RectangleLight(position=(0.5, -0.25, -3), across=(2, 0, 0.5), along=(0, 3, -1), intensity=5)


def at_origin(light, *objects, samples=1024, **settings) -> float:
    """The light that the origin of the floor returns."""
    scene = Scene(objects=[FLOOR, *objects], camera=AHEAD, lights=[light])
    pixels = rtcore.render(scene, (3, 3), samples, **settings).pixels.astype(float)
    return float(pixels.mean())


def polygon_irradiance(corners: np.ndarray, normal) -> float:
    """Lambert's formula (Photometria, 1760) at the origin, for radiance 1 and a polygon wholly above the horizon."""
    v = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    total = np.zeros(3)
    for a, b in zip(v, np.roll(v, -1, axis=0)):
        across = np.cross(a, b)
        total += math.acos(a @ b) * across / np.linalg.norm(across)
    return abs(float(total @ normal)) / 2


@pytest.fixture(params=["f64", "f32"])
def precision(request):
    return {"precision": request.param}


@pytest.mark.parametrize("position", [(0, 0, -4), (0, 0, -1.01), (3, 1, -2), (-20, 0, -5)])
def test_a_ball_above_the_horizon_lights_like_a_point(position, precision):
    """The irradiance of a ball is π L (radius/d)² cos, whatever its size, as long as all of it is above the horizon."""
    d = math.hypot(*position)
    expected = 5 / d ** 2 * -position[2] / d
    light = msgspec.structs.replace(BALL, position=position)
    assert at_origin(light, **precision) == pytest.approx(expected, rel=2e-3)
    assert at_origin(Point(position=position, intensity=5), samples=1) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("d", [1.1, 2.0, 5.0])
def test_a_ball_half_below_the_horizon(d):
    """π L/π (asin(1/h) - sqrt(h² - 1)/h²) for a ball on the horizon h radii away."""
    light = msgspec.structs.replace(BALL, position=(d, 0, 0))
    expected = 5 / math.pi * (math.asin(1 / d) - math.sqrt(d * d - 1) / d ** 2)
    assert at_origin(light, shadows=False) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("panel", [
    PANEL, RectangleLight(position=(0, 0, -1), across=(4, 0, 0), along=(0, 4, 0)),
    RectangleLight(position=(5, 0, -2), across=(0, 1, 0), along=(0, 0, -1), intensity=3),
    RectangleLight(position=(0, 0, -3), across=(1, 0, 0), along=(1, 2, 0))])
def test_a_panel_lights_as_lamberts_formula_says(panel, precision):
    middle, a, b = np.array(panel.position), np.array(panel.across) / 2, np.array(panel.along) / 2
    corners = np.array([middle - a - b, middle + a - b, middle + a + b, middle - a + b])
    radiance = panel.intensity / np.linalg.norm(np.cross(2 * a, 2 * b))
    expected = radiance * polygon_irradiance(corners, (0, 0, -1))
    assert at_origin(panel, **precision) == pytest.approx(expected, rel=5e-3)
    turned = msgspec.structs.replace(panel, across=panel.along, along=panel.across)     # shines the other way
    assert at_origin(turned, samples=4) == 0


def test_far_away_they_are_points():
    position = (300, 100, -800)
    point = at_origin(Point(position=position, intensity=1e6), samples=1)
    across = np.cross(position, (0, 1, 0))
    along = np.cross(across, position)
    across, along = across / np.linalg.norm(across), along / np.linalg.norm(along)
    facing = RectangleLight(position=position, across=tuple(across), along=tuple(along), intensity=1e6)
    if np.cross(across, along) @ position > 0:
        facing = msgspec.structs.replace(facing, across=facing.along, along=facing.across)
    for light in (SphereLight(position=position, intensity=1e6), facing):
        assert at_origin(light, samples=16) == pytest.approx(point, rel=1e-4)


@pytest.mark.parametrize("light", [BALL, RectangleLight(position=(0, 0, -4), across=(1, 0, 0), along=(0, 1, 0), intensity=5)])
def test_penumbra(light, precision):
    """Behind the edge of a screen half way up, straight below the middle of the light, half of it is seen."""
    def below(edge):
        screen = Polygon([(edge, -9, -2.5), (9, -9, -2.5), (9, 9, -2.5), (edge, 9, -2.5)])
        return at_origin(light, screen, **precision)
    full = at_origin(light, **precision)
    assert below(0) == pytest.approx(full / 2, rel=0.02)
    assert below(-1) == 0 and below(1) == pytest.approx(full)
    shares = [below(edge) / full for edge in (-0.25, -0.1, 0.1, 0.25)]
    assert 0 < shares[0] < shares[1] < 0.5 < shares[2] < shares[3] < 1
    assert shares[0] + shares[3] == pytest.approx(1, abs=0.02)


def test_a_shape_of_the_same_size_shows_the_light_and_does_not_hide_it(precision):
    glow = Material(ambient=0, diffuse=0, emission=(1, 1, 1))
    shown = Node(shape=Sphere(BALL.position, BALL.radius), material=glow)
    assert at_origin(BALL, shown, **precision) == at_origin(BALL, **precision)
    panel = RectangleLight(position=(0, 0, -4), across=(1, 0, 0), along=(0, 1, 0))
    shown = Node(shape=Polygon([(-0.5, -0.5, -4), (0.5, -0.5, -4), (0.5, 0.5, -4), (-0.5, 0.5, -4)]), material=glow)
    assert at_origin(panel, shown, **precision) == at_origin(panel, **precision) > 0


def test_nothing_is_lit_from_within():
    assert at_origin(SphereLight(position=(0, 0, -0.5), radius=1), samples=16) == 0
    assert at_origin(SphereLight(position=(0, 0, 0), radius=1), samples=16) == 0
    assert at_origin(RectangleLight(position=(0, 0, 0), across=(1, 0, 0), along=(0, 1, 0)), samples=16) == 0


def room(**fields) -> Scene:
    mirror = Material(reflection=0.6, specular=0.4)
    return Scene(objects=[Plane((0, -1, 0), (0, 1, 0)), Node(shape=Sphere((0, 0, 0), 1), material=mirror), Sphere((1.5, -0.4, -1), 0.6)],
                 **{"camera": Camera(lookfrom=(0, 1, -6), aperture=0.1),
                    "lights": [SphereLight(position=(-3, 4, -2), intensity=15, radius=0.7), Point(position=(2, 6, -3), intensity=9),
                               RectangleLight(position=(3, 3, 0), along=(0, 0, 2), across=(2, 0, 0), intensity=9)], **fields})


def test_the_same_bits_for_any_threads_and_passes():
    scene = room()
    for adaptive in (False, True):
        first = rtcore.render(scene, (100, 70), 12, threads=1, adaptive=adaptive)
        assert first.stats["nonfinite_pixels"] == 0 and first.stats["rays"]["reflection"] > 0
        assert np.array_equal(first.pixels, rtcore.render(scene, (100, 70), 12, threads=3, adaptive=adaptive).pixels)
        renderer = Renderer()
        settings = Settings(size=(100, 70), samples=12, adaptive=adaptive)
        *_, last = renderer.frames(RenderRequest(scene, scene.camera, settings))
        assert np.array_equal(first.pixels, last.pixels)
        renderer.close()


def test_the_error_is_told():
    scene = room()
    reference = rtcore.render(scene, (80, 60), 1024, seed=9).pixels
    for adaptive in (False, True):
        image = rtcore.render(scene, (80, 60), 16, adaptive=adaptive)
        true = math.sqrt(((image.pixels - reference).astype(float) ** 2).mean())
        assert 0.75 < image.stats["error"]["rmse_estimate"] / true < 1.33


def test_the_plan_names_them_and_leaves_them_out():
    made = plan(room(), Settings())
    assert {"light: spherelight", "light: rectanglelight", "light: point"} <= set(made.stages)
    assert {"light-spherelight.f64", "light-rectanglelight.f64"} <= set(made.kernels) <= set(ALL)
    bare = plan(room(lights=[Point(position=(0, 5, -5))]), Settings())
    assert not [name for name in bare.kernels if "spherelight" in name or "rectanglelight" in name]


def test_bad_lights_are_refused():
    for field, fields in (("radius", {"radius": 0}), ("radius", {"radius": -1.0}), ("position", {"position": (0, 0)})):
        with pytest.raises(FieldError, match=field):
            SphereLight(**{"position": (0, 0, 0), **fields})
    for fields in ({"along": (2, 0, 0)}, {"along": (0, 0, 0)}, {"across": (0, 0, 1e300)}):
        with pytest.raises(FieldError):
            RectangleLight(position=(0, 0, 0), **fields)
