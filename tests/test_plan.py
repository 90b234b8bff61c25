"""The plan: what is left out has its reason, costs nothing, and changes no bit of the picture."""
import msgspec
import numpy as np
import pytest

import rtcore
from rtcore import Ambient, Camera, Checker, Directional, Fog, Material, Mesh, Node, Plane, Point, Scale, Scene, Sphere, Translate
from rtcore.plan import plan
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings
from rtcore.shapes import KINDS
from rtcore.views import VIEWS
from rtcore.warm import ALL

CAMERA = Camera(lookfrom=(0, 1, -6))
LAMP = Point(position=(-3, 5, -4), intensity=30)
MIRROR = Material(reflection=0.5)
BEHIND = Translate((0, 0, -1e6))    # where no ray of these pictures goes


def scene(*objects, **fields) -> Scene:
    objects = objects or (Plane((0, -1, 0), (0, 1, 0)), Sphere((0, 0, 0), 1), Sphere((1.5, 0, 1), 0.8))
    return Scene(objects=objects, **{"camera": CAMERA, "lights": [LAMP, Ambient(intensity=0.2)], **fields})


def full() -> Scene:
    mesh = Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)] * 9, normals=[(0, 0, 1)] * 3)
    shown = Material(reflection=0.2, checker=Checker())
    kinds = [Node(shape=k.example[0], transform=k.example[1], material=shown) for k in KINDS]
    return scene(*kinds, mesh, *(Sphere((i, 0, 0), 0.1) for i in range(9)), lights=[LAMP, Directional(direction=(0, -1, 1))], fog=Fog())



VARIANTS = {
    "empty": (Scene(camera=CAMERA), {}), "plain": (scene(), {}), "full": (full(), {"samples": 4}), "one sample": (full(), {"samples": 1}),
    "dark": (scene(lights=[]), {}), "unlit light": (scene(lights=[msgspec.structs.replace(LAMP, on=False)]), {}),
    "no answer": (scene(Node(shape=Sphere((0, 0, 0), 1), material=Material(diffuse=0))), {}), "fog off": (scene(fog=Fog(on=False)), {}),
    "switched off": (full(), {"shadows": False, "fog": False, "reflections": False}), "shallow": (full(), {"max_depth": 1}),
    "hidden": (scene(Node(shape=Sphere((0, 0, 0), 1), material=MIRROR, visible=False)), {}),
    "by the textbook": (full(), {"solver": "textbook"}),
    **{f"view {view.name}": (full(), {"view": view.name}) for view in VIEWS},
}


@pytest.mark.parametrize("name", VARIANTS)
def test_every_stage_is_kept_or_left_out_with_a_reason(name):
    made, settings = VARIANTS[name]
    result = plan(made, Settings(**settings))
    left = [stage for stage, _ in result.left_out]
    assert len(set(result.stages)) == len(result.stages) and len(set(left)) == len(left)
    assert not set(result.stages) & set(left)
    assert all(why and why[0].islower() or why[0].isdigit() for _, why in result.left_out)
    assert set(result.kernels) <= set(ALL)
    assert {stage for stage in (*result.stages, *left) if stage.startswith("hits: ")} == {f"hits: {kind.name}" for kind in KINDS}
    for stage in ("textbook formulas", "pixel filter", "depth of field", "shadow rays", "smooth normals", "patterns", "fog",
                  "reflected and refracted rays", "ray sorting", "glossy reflection", "further samples"):
        assert (stage in result.stages) != (stage in left)
    stats = rtcore.render(made, (8, 6), **{"spp" if k == "samples" else k: v for k, v in settings.items()}).stats
    assert stats["stages"] == list(plan(made, Settings(**{"samples": 1, **settings})).stages)


def test_reasons_are_the_right_ones():
    assert dict(plan(VARIANTS["full"][0], Settings(samples=4)).left_out) == {
        f"tree: {kind.name}": "they are unbounded" if kind.bounds is None else "only 1: each is tested"
        for kind in KINDS if kind.name not in ("sphere", "triangle")} | {
            "depth of field": "the camera is a pinhole", "pixel filter": "with a box, samples lie evenly in their pixel",
            "ray sorting": "there are fewer than 400 of each shape, or so many that rays that scatter are walked singly",
            "glossy reflection": "no visible material is rough and reflects or transmits", "textbook formulas": "hits are to be certain"}
    off = dict(plan(*(VARIANTS["switched off"][0], Settings(shadows=False, fog=False, reflections=False))).left_out)
    assert off["shadow rays"] == off["fog"] == off["reflected and refracted rays"] == "switched off"
    bare = dict(plan(scene(), Settings(max_depth=1)).left_out)
    assert bare["fog"] == "the scene has none" and bare["patterns"] == "no visible material has one"
    assert dict(plan(scene(lights=[]), Settings()).left_out)["shadow rays"] == "no light to cast them"


def test_a_scene_of_spheres_needs_the_kernels_of_spheres():
    made = scene(*(Sphere((i, 0, 0), 0.4) for i in range(9)))
    assert plan(made, Settings(samples=1)).kernels == (
        "core.f64", "glow.f64", "leaf.f64", "tree.f64", "sphere.f64", "light-point.f64", "lit.f64")
    assert plan(made, Settings(view="depth", precision="f32")).kernels == ("core.f32", "leaf.f32", "tree.f32", "sphere.f32")
    assert plan(made, Settings(view="normal", precision="f32")).kernels == ("core.f32", "leaf.f32", "tree.f32", "sphere.f32", "recast.f32")
    assert plan(scene(Sphere((0, 0, 0), 1), lights=[]), Settings()).kernels == (
        "core.f64", "glow.f64", "samples.f64", "leaf.f64", "sphere.f64")
    squashed = Node(shape=Sphere((0, 0, 0), 1), transform=[Scale((1, 2, 1))])
    assert "ellipsoid.f64" in plan(scene(squashed), Settings()).kernels and "sphere.f64" not in plan(scene(squashed), Settings()).kernels


def picture(made: Scene, **settings):
    image = rtcore.render(made, (64, 48), **{"spp": 2, **settings})
    return image.pixels.tobytes(), image.stats


def with_more(made: Scene, *objects, **fields) -> Scene:
    return msgspec.structs.replace(made, objects=(*made.objects, *objects), **fields)


FLOOR = scene(Plane((0, 0, 0), (0, 1, 0)))
ONE_COLOUR = Material(checker=Checker(even=(0.8,) * 3, odd=(0.8,) * 3))
POLISHED = scene(*(Node(shape=Sphere((i - 2, 0, 0), 0.6), material=MIRROR) for i in range(5)))
FACE = [(-2, -1, 1), (2, -1, 1), (0, 2, 1)], [(0, 2, 1)]

#: (scene without, settings), (scene where the stage is there but has no effect, settings), the stage in question
PAIRS = {
    "fog of no density": ((scene(), {}), (scene(fog=Fog(density=0)), {}), "fog"),
    "thin fog squared": ((scene(), {}), (scene(fog=Fog(kind="exponential-squared", density=0)), {}), "fog"),
    "fog switched off": ((scene(fog=Fog()), {"fog": False}), (scene(fog=Fog(density=0)), {}), "fog"),
    "a mirror that no ray meets": (
        (scene(), {}), (with_more(scene(), Node(shape=Sphere((0, 0, 0), 1), material=MIRROR, transform=[BEHIND])), {}),
        "reflected and refracted rays"),
    "nothing in the light's way": ((FLOOR, {"shadows": False}), (FLOOR, {}), "shadow rays"),
    "a checker of one colour": (
        (scene(), {}), (scene(*(Node(shape=n.shape, material=ONE_COLOUR) for n in scene().objects)), {}), "patterns"),
    "boxes that no ray meets": (
        (scene(), {}), (with_more(scene(), Node(shape=rtcore.Box((-1, -1, -1), (1, 1, 1)), transform=[BEHIND])), {}), "hits: box"),
    "a tree": (
        (scene(), {}), (with_more(scene(), *(Node(shape=Sphere((i, 0, 0), 0.3), transform=[BEHIND]) for i in range(9))), {}),
        "tree: sphere"),
    "a crowd that no ray meets": (
        (POLISHED, {}), (with_more(POLISHED, *(Node(shape=Sphere((i, 0, 0), 0.3), transform=[BEHIND]) for i in range(400))), {}),
        "ray sorting"),
    "smooth normals along the flat ones": (
        (scene(Mesh(*FACE)), {}), (scene(Mesh(*FACE, normals=[(0, 0, -1)] * 3)), {}), "smooth normals"),
}


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", PAIRS)
def test_leaving_out_changes_no_bit(name, precision):
    (without, how), (present, how_present), stage = PAIRS[name]
    assert stage not in plan(without, Settings(**how)).stages
    assert stage in plan(present, Settings(**how_present)).stages
    one, stats = picture(without, precision=precision, **how)
    two, _ = picture(present, precision=precision, **how_present)
    assert np.frombuffer(one, np.float32).std() > 0.01      # there is something to see
    assert one == two


BOUNCES, SHADOWS = ["reflection", "refraction"], ["shadow", "shadow_hits"]


@pytest.mark.parametrize("settings,zero", [({"shadows": False}, SHADOWS), ({"reflections": False}, BOUNCES), ({"max_depth": 1}, BOUNCES),
                                           ({"view": "normal"}, SHADOWS + BOUNCES)])
def test_counters_of_what_is_left_out_are_zero(settings, zero):
    glass = Material(reflection=0.3, transmission=0.6)
    made = scene(Plane((0, -1, 0), (0, 1, 0)), Node(shape=Sphere((0, 0, 0), 1), material=glass), Sphere((1.5, 0, 1), 0.8))
    everything = picture(made)[1]["rays"]
    assert all(everything[key] > 0 for key in ("primary", "primary_hits", "shadow", "shadow_hits", "reflection", "refraction"))
    rays = picture(made, **settings)[1]["rays"]
    assert all(rays[key] == 0 for key in zero), rays
    assert rays["primary"] == everything["primary"] // (2 if "view" in settings else 1)


def test_views_without_light_trace_one_sample():
    image = rtcore.render(scene(), (20, 10), 16, view="depth")
    assert image.stats["rays"]["primary"] == 200 and image.stats["samples_per_pixel"] == 1


@pytest.mark.parametrize("name", ["empty", "plain", "full", "dark", "switched off", "shallow", "view normal"])
def test_all_the_time_goes_into_stages_and_kernels_of_the_plan(name):
    made, settings = VARIANTS[name]
    renderer = Renderer()
    try:
        *_, last = renderer.frames(RenderRequest(made, CAMERA, Settings(size=(64, 48), threads=1, **settings)))
    finally:
        renderer.close()
    composed = plan(made, Settings(**settings))
    assert {stage for stage, _ in last.seconds} <= set(composed.stages)
    assert {f"{kernels}.f64" for _, kernels in last.seconds} <= set(composed.kernels)
    assert all(seconds > 0 for seconds in last.seconds.values())
    assert sum(last.seconds.values()) <= last.elapsed
