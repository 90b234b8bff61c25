"""What is kept from one picture to the next: the same bits as a picture made anew, and no ray traced that was known."""
import msgspec
import numpy as np
import pytest

import rtcore
from rtcore import (Ambient, Background, Box, Camera, Checker, Cylinder, Directional, Fog, Material, Mesh, Node, Plane, Point, Scale, Scene,
                    Sphere, Translate, edits)
from rtcore.flatten import flatten, renumbering
from rtcore.keep import BOXES
from rtcore.levels import UNKNOWN
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings

replace = msgspec.structs.replace
SIZE = (83, 61)
GLASS = Material(diffuse=0.1, transmission=0.9, reflection=1.0, fresnel=True, specular=0.5)
MIRROR = Material(diffuse=0.3, reflection=0.6, specular=0.4)
NODES = (
    Node(name="floor", shape=Plane((0, -1, 0), (0, 1, 0)), material=Material(checker=Checker(size=0.7), reflection=0.2)),
    Node(name="glass", shape=Sphere((-1.5, 0, 0), 0.8), material=GLASS),
    Node(name="mirror", shape=Sphere((0.3, 0, 1), 0.7), material=MIRROR),
    Node(name="egg", shape=Sphere((0, 0, 0), 0.5), transform=[Scale((1, 0.4, 2)), Translate((1.6, -0.4, -0.5))]),
    Node(name="box", shape=Box((-0.4, -1, -1.6), (0.3, -0.4, -1)), material=GLASS),
    Node(name="post", shape=Cylinder((1.5, -1, 1.5), (1.5, 0.5, 1.5), 0.4)),
    *(Node(name=f"ball {i}", shape=Sphere((-2 + 0.37 * i, -0.8 + 0.1 * (i % 3), -0.9 + 0.2 * (i % 2)), 0.12)) for i in range(12)),
    Node(name="mesh", shape=Mesh([(2, 0, 0), (2.5, 0, 0), (2.2, 0.6, 0), (2.2, 0.2, 0.5)], [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])))
LIGHTS = (Point(position=(-3, 4, -3), intensity=20), Directional(direction=(1, -2, 1), intensity=0.5), Ambient(intensity=0.2))
SCENE = Scene(objects=NODES, lights=LIGHTS, fog=Fog(density=0.05), background=Background(color=(0.2, 0.2, 0.3), top=(0.5, 0.6, 0.9)),
              camera=Camera(lookfrom=(0.5, 1.2, -6), lookat=(0, 0, 0)))


def node(scene: Scene, name: str, **fields) -> Scene:
    """The scene with one of its nodes changed."""
    return replace(scene, objects=tuple(replace(n, **fields) if n.name == name else n for n in scene.objects))


def light(scene: Scene, index: int, **fields) -> Scene:
    return replace(scene, lights=tuple(replace(lamp, **fields) if i == index else lamp for i, lamp in enumerate(scene.lights)))


#: Kind of edit -> what it makes of (scene, camera, settings), and how many rays of each sort may have to be traced: none, some or all.
EDITS = {
    "view": (lambda s, c, t: (s, c, replace(t, view="normal")), "none", "none"),
    "samples": (lambda s, c, t: (s, c, replace(t, samples=2)), "none", "none"),
    "fog": (lambda s, c, t: (s, c, replace(t, fog=False)), "none", "some"),
    "background": (lambda s, c, t: (replace(s, background=Background(color=(1, 0, 0))), c, t), "none", "none"),
    "shadows": (lambda s, c, t: (s, c, replace(t, shadows=False)), "none", "none"),
    "reflections": (lambda s, c, t: (s, c, replace(t, reflections=False)), "none", "none"),
    "light": (lambda s, c, t: (light(s, 0, color=(1, 0.3, 0.2), intensity=9), c, t), "none", "none"),
    "material": (lambda s, c, t: (node(s, "mirror", material=replace(MIRROR, color=(0, 1, 0), diffuse=0.7)), c, t), "none", "none"),
    "lens": (lambda s, c, t: (s, replace(c, aperture=0.3, focus=5.0), t), "none", "none"),
    "move_light": (lambda s, c, t: (light(s, 0, position=(3, 4, -3)), c, t), "none", "some"),
    "opacity": (lambda s, c, t: (node(s, "glass", material=replace(GLASS, transmission=0.3)), c, t), "none", "all"),
    "refraction": (lambda s, c, t: (node(s, "glass", material=replace(GLASS, ior=1.2)), c, t), "none", "some"),
    "hide": (lambda s, c, t: (node(s, "ball 3", visible=False), c, t), "some", "some"),
    "shape": (lambda s, c, t: (node(s, "mirror", shape=Sphere((0.35, 0.05, 1), 0.6)), c, t), "some", "some"),
    "nodes": (lambda s, c, t: (replace(s, objects=(*s.objects, Node(shape=Sphere((0, 2, 0), 0.3)))), c, t), "all", "all"),
    "camera": (lambda s, c, t: (s, replace(c, fov=35.0), t), "all", "all")}


def picture(renderer: Renderer, scene: Scene, camera: Camera, settings: Settings):
    *_, last = renderer.frames(RenderRequest(scene, camera, settings), deadline=0.1)
    return last


def anew(scene: Scene, camera: Camera, settings: Settings):
    renderer = Renderer()
    *_, last = renderer.frames(RenderRequest(scene, camera, settings), coarse=False)
    renderer.close()
    return last


def same(a, b) -> bool:
    return a.pixels.tobytes() == b.pixels.tobytes() and (a.node == b.node).all() and (a.distance == b.distance).all()


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", EDITS)
def test_an_edit_gives_the_picture_made_anew_and_traces_no_more_than_it_must(name, precision):
    settings, (edit, eyes, shadows) = Settings(size=SIZE, samples=1, precision=precision, threads=2), EDITS[name]
    renderer, request = Renderer(keep=True), (SCENE, SCENE.camera, settings)
    first = picture(renderer, *request)
    changed = edit(*request)
    seen, whole = picture(renderer, *changed), anew(*changed)
    assert name in renderer.edits and same(seen, whole)
    goes_on = name in ("view", "samples")       # then rays are counted on
    allowed = {"none": (0, 0), "some": (0, whole.rays["primary"] - 1), "all": (whole.rays["primary"],) * 2}[eyes]
    if name != "samples":
        for kind, (least, most) in (("primary", allowed), ("shadow", (0, SHADOWS[shadows](whole.rays["shadow"])))):
            assert least <= seen.rays[kind] - (first.rays[kind] if goes_on else 0) <= most, kind
    back = picture(renderer, *request)      # and back again, from what is kept of the edited one
    assert same(back, first) and back.rays["primary"] - (first.rays["primary"] if name == "view" else 0) <= allowed[1]
    renderer.close()


SHADOWS = {"none": lambda rays: 0, "some": lambda rays: rays - 1, "all": lambda rays: rays}


def test_every_kind_of_edit_is_tried():
    assert EDITS.keys() | {"exposure"} == edits.EDIT.keys()     # which the renderer does not see


def test_a_hidden_shape_costs_its_own_pixels():
    renderer, settings = Renderer(keep=True), Settings(size=SIZE, samples=1, shadows=False, max_depth=1)
    first = picture(renderer, SCENE, SCENE.camera, settings)
    number = [n.name for n in NODES].index("post")
    hidden = node(SCENE, "post", visible=False)
    seen = picture(renderer, hidden, SCENE.camera, settings)
    assert seen.rays["primary"] == np.count_nonzero(first.node == number) > 0
    shown = picture(renderer, SCENE, SCENE.camera, settings)
    assert seen.rays["primary"] <= shown.rays["primary"] < 8 * seen.rays["primary"]     # those that meet its box
    renderer.close()


def test_toggling_to_and_fro_traces_nothing_any_more():
    renderer, settings = Renderer(keep=True), Settings(size=SIZE, samples=1)
    first = picture(renderer, SCENE, SCENE.camera, settings)
    for field in ("shadows", "reflections"):
        picture(renderer, SCENE, SCENE.camera, replace(settings, **{field: False}))
        again = picture(renderer, SCENE, SCENE.camera, settings)
        assert same(again, first) and not any(again.rays.values()), field
    renderer.close()


@pytest.mark.parametrize("seed", range(6))
def test_random_edits_one_after_the_other_some_of_them_broken_off(seed):
    random = np.random.default_rng(seed)
    renderer, now = Renderer(keep=True), [SCENE, SCENE.camera, Settings(size=SIZE, samples=2, threads=2)]
    kinds = [name for name in EDITS if name not in ("nodes", "camera")]
    for _ in range(14):
        scene, camera, settings = now
        kind = kinds[random.integers(len(kinds))]
        if kind in ("hide", "shape"):
            chosen = scene.objects[random.integers(len(scene.objects))]
            moved = (Translate(tuple(random.uniform(-0.3, 0.3, 3))),)
            scene = node(scene, chosen.name, **({"visible": not chosen.visible} if kind == "hide" else {"transform": moved}))
        elif kind in ("fog", "shadows", "reflections"):
            settings = replace(settings, **{kind: not getattr(settings, kind)})
        elif kind == "move_light":
            scene = light(scene, 0, position=tuple(random.uniform(-4, 4, 3)))
        else:
            scene, camera, settings = EDITS[kind][0](scene, camera, settings)
        now = [scene, camera, settings]
        left = [int(random.integers(1, 60))]

        def broken(left=left):
            left[0] -= 1
            return left[0] < 0
        if random.random() < 0.4:
            list(renderer.frames(RenderRequest(*now), broken, deadline=0.1))
        else:
            assert same(picture(renderer, *now), anew(*now)), kind
    assert same(picture(renderer, *now), anew(*now))
    renderer.close()


def test_more_samples_go_on_from_those_there_are():
    renderer, settings = Renderer(keep=True), Settings(size=SIZE, samples=4)
    first = picture(renderer, SCENE, SCENE.camera, settings)
    more = picture(renderer, SCENE, SCENE.camera, replace(settings, samples=9))
    whole = rtcore.render(SCENE, SIZE, 9)
    assert more.pixels.tobytes() == whole.pixels.tobytes() and more.rays == whole.stats["rays"] and first.done
    fewer = picture(renderer, SCENE, SCENE.camera, settings)
    assert fewer.pixels.tobytes() == first.pixels.tobytes()
    renderer.close()


@pytest.mark.parametrize("before, after", [((16, True), (64, False)), ((8, False), (4, True)), ((8, True), (4, True)),
                                           ((16, True), (16, False))])
def test_samples_are_taken_over_only_where_the_picture_is_the_same(before, after):
    renderer, size = Renderer(keep=True), {"size": SIZE, "threads": 2}
    for samples, adaptive in (before, after):
        settings = Settings(samples=samples, adaptive=adaptive, **size)
        seen = picture(renderer, SCENE, SCENE.camera, settings)
    assert same(seen, anew(SCENE, SCENE.camera, settings))
    renderer.close()


def test_a_film_that_notes_lights_goes_on_doing_so():
    renderer, settings = Renderer(keep=True), Settings(size=SIZE, samples=1)
    first = picture(renderer, SCENE, SCENE.camera, settings)
    other = light(SCENE, 0, position=(3, 4, -3))
    *_, last = renderer.frames(RenderRequest(other, SCENE.camera, settings), coarse=False)      # which would not ask for it
    assert same(last, anew(other, SCENE.camera, settings)) and not same(last, first)
    seen, shown = (picture(each, other, SCENE.camera, replace(settings, view="shadow")) for each in (renderer, Renderer(keep=True)))
    assert same(seen, shown)
    renderer.close()


def test_a_name_is_no_reason_to_begin_anew():
    renderer, settings = Renderer(keep=True), Settings(size=SIZE, samples=8)
    first = picture(renderer, SCENE, SCENE.camera, settings)
    named = replace(node(light(SCENE, 0, name="lamp", note="old"), "mirror", note="shiny"), name="a scene")
    again = picture(renderer, named, SCENE.camera, settings)
    assert same(first, again) and again.rays == first.rays
    renderer.close()


def test_an_iterator_that_somebody_still_holds_is_ended_by_the_next_picture():
    renderer, settings = Renderer(keep=True), Settings(size=(400, 300), samples=256, threads=2)
    held = renderer.frames(RenderRequest(SCENE, SCENE.camera, settings), coarse=False)
    assert not next(held).done
    one = replace(settings, samples=1)
    assert same(picture(renderer, SCENE, SCENE.camera, one), anew(SCENE, SCENE.camera, one))
    assert list(held) == []
    renderer.close()


def test_nothing_of_the_picture_before_shows_through():
    renderer, settings, calls = Renderer(keep=True), Settings(size=(400, 300), samples=1), []
    picture(renderer, SCENE, SCENE.camera, settings)
    empty = Scene(objects=[NODES[1]], camera=Camera(lookfrom=(0, 50, -6), lookat=(0, 60, 0)), lights=[])
    list(renderer.frames(RenderRequest(empty, empty.camera, settings), lambda: calls.append(0) or len(calls) > 1, deadline=0.1))
    frame = renderer._render.frame(False)
    assert (frame.node == -1).all() and (frame.distance == np.inf).all()
    renderer.close()


def test_what_came_is_remembered_only_so_long():
    renderer, settings = Renderer(keep=True), Settings(size=(32, 24), samples=1)
    picture(renderer, SCENE, SCENE.camera, settings)
    for k in range(80):
        moved = node(SCENE, "mirror", transform=(Translate((0.001 * k, 0, 0)),))
        picture(renderer, moved, SCENE.camera, replace(settings, shadows=False))
    levels = [level for levels in renderer._render.memory.tiles.values() for level in levels]
    assert levels and max((len(shade.boxes) for level in levels for shade in level.shades.values()), default=0) <= BOXES
    assert same(picture(renderer, moved, SCENE.camera, settings), anew(moved, SCENE.camera, settings))
    renderer.close()


@pytest.mark.parametrize("adaptive", [False, True])
def test_a_region_gets_its_samples_first(adaptive):
    region, settings = (20, 10, 45, 40), Settings(size=(150, 120), samples=32, adaptive=adaptive)
    renderer, x0, y0, x1, y1 = Renderer(keep=True), *region
    running = renderer.frames(RenderRequest(SCENE, SCENE.camera, replace(settings, region=region)))
    frames, seen = zip(*((frame, renderer._render.film.count.reshape(120, 150).copy()) for frame in running))
    ahead = [count for count in seen if count[100:, 100:].max() == 1 and count[y0:y1, x0:x1].min() > 1]
    assert ahead and (ahead[-1][y0:y1, x0:x1].mean() >= 31 if not adaptive else ahead[-1][y0:y1, x0:x1].max() > 8)
    if not adaptive:
        assert frames[-1].pixels.tobytes() == anew(SCENE, SCENE.camera, settings).pixels.tobytes()
    assert frames[-1].done and seen[-1].min() >= 8
    renderer.close()


def test_renumbering_follows_every_primitive_that_stays():
    other = node(node(SCENE, "ball 5", visible=False), "mesh", transform=(Translate((0.1, 0, 0)),))
    old, new = flatten(SCENE), flatten(other)
    changed = [i for i, n in enumerate(NODES) if n.name in ("ball 5", "mesh")]
    number = renumbering(old, new, changed, UNKNOWN)
    gone = np.isin(old.leaf, changed)
    assert (number[gone] == UNKNOWN).all() and len(set(number[~gone])) == np.count_nonzero(~gone)
    assert (new.leaf[number[~gone]] == old.leaf[~gone]).all()
    rows = {id(kind): table for group in new.groups for kind, table in [(group.kind, (group.first, group.table.data))]}
    for group in old.groups:
        if id(group.kind) in rows:
            first, data = rows[id(group.kind)]
            stays = np.flatnonzero(number[group.first:group.first + len(group.owner)] != UNKNOWN)
            assert (group.table.data[stays] == data[number[group.first + stays] - first]).all()


def test_the_table_is_in_the_documentation():
    page = (rtcore.__path__[0] + "/README.md")
    with open(page, encoding="utf-8") as file:
        assert edits.table() in file.read()
