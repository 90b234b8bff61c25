"""Glossy reflection and frosted glass: the lobe is GGX's of visible normals, no light is lost, no ray is on the wrong side, a pixel's first
sample is the mirror's, and without roughness nothing is there."""
import math

import msgspec
import numpy as np
import pytest

import rtcore
from rtcore import Background, Camera, FieldError, Material, Node, Plane, Polygon, Scene, Sphere, warm
from rtcore.gloss import facet
from rtcore.jit import kernel
from rtcore.plan import plan
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings

GLOW = Material(ambient=0, diffuse=0, emission=(1, 1, 1))


def rough(roughness: float, **fields) -> Material:
    return Material(**{"color": (0, 0, 0), "ambient": 0, "diffuse": 0, "reflection": 1, "roughness": roughness, **fields})


@kernel
def facets(out, numbers, cosine, alpha):
    for i in range(len(numbers)):
        out[i, 0], out[i, 1], out[i, 2] = facet(numbers[i, 0], numbers[i, 1], cosine, alpha)


def drawn(numbers: np.ndarray, cosine: float, alpha: float) -> np.ndarray:
    out = np.empty((len(numbers), 3))
    facets(out, np.ascontiguousarray(numbers, float), cosine, alpha)
    return out


def grid(n: int) -> np.ndarray:
    """Middles of n x n cells of the unit square."""
    return np.stack(np.meshgrid(np.arange(n), np.arange(n)), -1).reshape(-1, 2) / n + 0.5 / n


def visible_normals(n: int, cosine: float, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """Directions (m, 3) all over the hemisphere and the probability of each: D (v·h) over its integral, with GGX's D in closed form."""
    z, turn = (np.arange(n) + 0.5) / n, (np.arange(2 * n) + 0.5) * math.pi / n
    z = 1 - (1 - z) ** 3      # most facets lie about the normal
    jacobian = 3 * (1 - (np.arange(n) + 0.5) / n) ** 2
    z, turn = np.meshgrid(z, turn, indexing="ij")
    h = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], -1).reshape(-1, 3)
    density = alpha ** 2 / (math.pi * (h[:, 2] ** 2 * (alpha ** 2 - 1) + 1) ** 2)
    weight = density * np.maximum(h @ (math.sqrt(1 - cosine ** 2), 0, cosine), 0) * np.repeat(jacobian, 2 * n)
    return h, weight / weight.sum()


@pytest.mark.parametrize("cosine", [1.0, 0.8, 0.3, 0.05])
@pytest.mark.parametrize("alpha", [0.09, 0.36, 1.0])
def test_facets_are_those_that_the_eye_sees(cosine, alpha):
    mine = drawn(grid(300), cosine, alpha)
    assert np.allclose(np.linalg.norm(mine, axis=1), 1) and (mine[:, 2] >= 0).all()
    assert (mine @ (math.sqrt(1 - cosine ** 2), 0, cosine)).min() > -1e-9
    h, weight = visible_normals(1500, cosine, alpha)
    assert np.allclose(mine.mean(0), weight @ h, atol=2e-3)
    assert np.allclose(mine.T @ mine / len(mine), (h * weight[:, None]).T @ h, atol=2e-3)


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.01])
def test_the_middle_of_the_square_is_the_surface_itself(cosine):
    assert np.allclose(drawn([(0.5, 0.5)], cosine, 0.25), (0, 0, 1), atol=1e-12)


def two_tone(material: Material, shape=None, **camera) -> Scene:
    """A floor that mirrors the sky, whose radiance is 0 straight below and 1 straight above."""
    return Scene(objects=[Node(shape=shape or Plane((0, 0, 0), (0, 1, 0)), material=material)], lights=[],
                 background=Background(color=(0, 0, 0), top=(1, 1, 1)), camera=Camera(**camera))


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("roughness", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("slant", [20.0, 80.0])
def test_the_mean_over_a_background_of_two_tones(roughness, slant, precision):
    """The floor mirrors a half of the world that shines, x > 0, and one that does not: brute force over all facets."""
    angle = math.radians(slant)
    wall = Polygon([(1e-3, -9e4, -9e4), (1e-3, 9e4, -9e4), (1e-3, 9e4, 9e4), (1e-3, -9e4, 9e4)])
    camera = Camera(lookfrom=(-5 * math.sin(angle), 5 * math.cos(angle), 0), lookat=(0, 0, 0), up=(0, 0, 1), fov=0.001)
    scene = Scene(objects=[Node(shape=Plane((0, 0, 0), (0, 1, 0)), material=rough(roughness)), Node(shape=wall, material=GLOW)], lights=[],
                  camera=camera)
    shown = rtcore.render(scene, (3, 3), 4096, precision=precision).pixels.mean()
    h, weight = visible_normals(1000, math.cos(angle), roughness ** 2)
    eye = np.array([math.sin(angle), 0, math.cos(angle)])      # x toward the eye here, z up
    ray = 2 * (h @ eye)[:, None] * h - eye
    assert shown == pytest.approx(weight[ray[:, 0] < 0].sum(), abs=5e-3)


@pytest.mark.parametrize("roughness", [0.05, 0.5, 1.0])
def test_no_light_is_lost_and_an_even_background_has_no_noise(roughness):
    """Balls, seen at every angle, that reflect all and let all through: nothing tells them from the background."""
    balls = [Node(shape=Sphere((x, 0, 0), 1), material=rough(roughness, **fields))
             for x, fields in ((-1.1, {}), (1.1, {"transmission": 1, "fresnel": True}))]
    scene = Scene(objects=balls, background=Background(color=(0.5, 0.25, 1)), lights=[],
                  camera=Camera(lookfrom=(0, 0, -5)))
    image = rtcore.render(scene, (48, 32), 16, max_depth=64)
    lost = (0.5, 0.25, 1) - image.pixels        # what still goes around in the ball of glass
    assert lost.min() > -1e-6 and lost.mean() < 2e-4 and image.stats["nonfinite_pixels"] == 0
    assert image.stats["rays"]["reflection"] > 1000 and image.stats["rays"]["refraction"] > 1000
    mirror = msgspec.structs.replace(scene, objects=balls[:1])
    assert np.allclose(rtcore.render(mirror, (48, 32), 16).pixels, (0.5, 0.25, 1), atol=1e-6)


def test_no_ray_goes_below_the_surface():
    """A mirror floor with light below it, seen at a grazing angle."""
    below = Node(shape=Plane((0, -1, 0), (0, 1, 0)), material=GLOW)
    scene = two_tone(rough(1.0), lookfrom=(0, 0.2, -5), lookat=(0, 0, 0), fov=1)
    scene = msgspec.structs.replace(scene, objects=(*scene.objects, below), background=Background())
    assert not rtcore.render(scene, (16, 12), 64).pixels.any()


def test_frosted_glass_lets_through_and_scatters():
    """A pane before a lamp: the lamp's light is spread, and what goes straight through clear glass is gone on into the same half space."""
    pane = [Node(shape=Plane((0, 0, z), (0, 0, -side)), material=Material(diffuse=0, ambient=0, transmission=1, ior=1.5, roughness=0.5))
            for z, side in ((0.0, 1), (0.05, -1))]
    lamp = Node(shape=Sphere((0, 0, 3), 0.5), material=GLOW)
    camera = Camera(lookfrom=(0, 0, -4), lookat=(0, 0, 0), fov=60)
    frosted = rtcore.render(Scene(objects=[*pane, lamp], lights=[], camera=camera), (48, 48), 64).pixels[..., 0]
    clear = rtcore.render(Scene(objects=[Node(shape=n.shape, material=msgspec.structs.replace(n.material, roughness=0.0)) for n in pane] +
                                [lamp], lights=[], camera=camera), (48, 48), 64).pixels[..., 0]
    assert clear.max() == 1 and frosted.max() < 0.7 and (frosted > 0).sum() > 3 * (clear > 0).sum()
    middle = frosted[16:32, 16:32].mean()
    assert middle > 2 * np.mean([frosted[:8].mean(), frosted[-8:].mean()])


ROOM = Scene(objects=[Node(shape=Plane((0, -1, 0), (0, 1, 0)), material=Material(reflection=0.4, roughness=0.4)),
                      Node(shape=Sphere((0, 0, 0), 1), material=Material(reflection=0.5, transmission=0.4, roughness=0.2)),
                      Node(shape=Sphere((1.6, -0.4, -1), 0.6), material=Material(color=(0.9, 0.2, 0.1), reflection=0.2))],
             camera=Camera(lookfrom=(0, 1, -6)), background=Background(top=(0.4, 0.6, 1)))


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_the_same_bits_for_any_threads_and_passes(precision):
    for adaptive in (False, True):
        first = rtcore.render(ROOM, (100, 70), 12, threads=1, adaptive=adaptive, precision=precision)
        assert first.stats["nonfinite_pixels"] == 0 and first.stats["rays"]["refraction"] > 0
        assert np.array_equal(first.pixels, rtcore.render(ROOM, (100, 70), 12, threads=3, adaptive=adaptive, precision=precision).pixels)
        renderer = Renderer()
        settings = Settings(size=(100, 70), samples=12, adaptive=adaptive, precision=precision)
        *_, last = renderer.frames(RenderRequest(ROOM, ROOM.camera, settings))
        assert np.array_equal(first.pixels, last.pixels)
        renderer.close()


def smooth(scene: Scene) -> Scene:
    return msgspec.structs.replace(scene, objects=tuple(
        msgspec.structs.replace(node, material=msgspec.structs.replace(node.material, roughness=0.0)) for node in scene.objects))


def test_a_first_sample_is_the_mirrors():
    assert np.array_equal(rtcore.render(ROOM, (100, 70), 1).pixels, rtcore.render(smooth(ROOM), (100, 70), 1).pixels)
    assert not np.array_equal(rtcore.render(ROOM, (100, 70), 2).pixels, rtcore.render(smooth(ROOM), (100, 70), 2).pixels)


def test_roughness_that_no_ray_meets_changes_no_bit():
    plain = smooth(ROOM)
    far = Node(shape=Sphere((0, 0, -1e6), 0.1), material=Material(reflection=1, roughness=1))
    there = msgspec.structs.replace(plain, objects=(*plain.objects, far))
    assert "glossy reflection" in plan(there, Settings()).stages and "glossy reflection" not in plan(plain, Settings()).stages
    assert np.array_equal(rtcore.render(plain, (60, 40), 4).pixels, rtcore.render(there, (60, 40), 4).pixels)


def test_two_bounces_at_facets_of_one_pixel_are_independent():
    """Two rough mirrors that face one another: were their facets the same, the light would come back the way it went."""
    walls = [Node(shape=Plane((0, 0, z), (0, 0, -side)), material=rough(0.6)) for z, side in ((1.0, 1), (-1.0, -1))]
    scene = Scene(objects=walls, lights=[], background=Background(top=(1, 1, 1)),
                  camera=Camera(lookfrom=(0, 0, 0), lookat=(0, 0.3, 1), fov=1))
    first, *others = (rtcore.render(scene, (6, 6), 256, seed=seed, max_depth=3).pixels for seed in range(6))
    true = np.mean([rtcore.render(scene, (6, 6), 256, seed=seed, max_depth=3).pixels.mean() for seed in range(9, 30)])
    assert np.mean([first.mean(), *(other.mean() for other in others)]) == pytest.approx(true, rel=0.03)


def test_the_error_is_told():
    reference = rtcore.render(ROOM, (80, 60), 1024, seed=9).pixels
    for adaptive in (False, True):
        image = rtcore.render(ROOM, (80, 60), 16, adaptive=adaptive)
        true = math.sqrt(((image.pixels - reference).astype(float) ** 2).mean())
        assert 0.75 < image.stats["error"]["rmse_estimate"] / true < 1.33


def test_the_plan_tells_why_it_is_left_out():
    made = plan(ROOM, Settings())
    assert "glossy reflection" in made.stages and "gloss.f64" in made.kernels and set(made.kernels) <= set(warm.ALL)
    for scene, settings, why in ((smooth(ROOM), {}, "no visible material is rough and reflects or transmits"),
                                 (ROOM, {"samples": 1}, "a pixel's first sample takes the smooth way"),
                                 (ROOM, {"reflections": False}, "no reflected or refracted rays are followed"),
                                 (ROOM, {"view": "depth"}, "the view shows first hits only")):
        out = plan(scene, Settings(**settings))
        assert dict(out.left_out)["glossy reflection"] == why and "gloss.f64" not in out.kernels


def test_bad_numbers_are_refused():
    for bad in (-0.1, 1.1, math.nan, "matt"):
        with pytest.raises(FieldError, match="roughness"):
            Material(roughness=bad)
