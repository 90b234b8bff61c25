"""The scenes that come along: sound, explained, and lit so that they can be shown."""
import re
from itertools import combinations

import msgspec
import numpy as np
import pytest

import resources
import rtcore
from rtcore.scene import Shape

GALLERY = sorted((resources.ROOT / "scenes").glob("*.yaml"))
NIGHT = {"candle", "koppelaarster", "rembrandt"}    # a light in the dark: most of the picture is meant to be nearly black
LOOSE_BALLS = {"coloured-fog", "spheres", "whitted"}    # spheres that are balls, not parts of a figure


@pytest.fixture(scope="module", params=GALLERY, ids=lambda path: path.stem)
def scene(request) -> rtcore.Scene:
    return rtcore.load(request.param)


@pytest.fixture
def stem(request) -> str:
    return request.node.callspec.params["scene"].stem


def test_the_gallery_has_the_scenes_that_were_promised():
    promised = {"barth-sextic", "blobs", "candle", "chess", "coloured-fog", "fog-depth", "gyroid", "heart", "koppelaarster", "quadrics",
                "rembrandt", "snail", "solids", "spheres", "studio", "tori", "transformed-spheres", "whitted"}
    assert promised <= {path.stem for path in GALLERY}


def test_every_scene_says_what_it_shows(scene):
    assert scene.name and scene.camera and scene.lights
    assert 2 <= len(re.findall(r"[.!?](?=\s|$)", scene.note)) <= 5
    assert all(node.name for node in scene.objects)
    assert all(light.name for light in scene.lights)


def test_every_definition_and_material_is_used(scene):
    used, named = set(), set()

    def walk(node):
        used.add(node.use)
        named.add(node.material)
        for child in node.children or ():
            walk(child)

    for node in (*scene.objects, *scene.definitions.values()):
        walk(node)
    assert set(scene.definitions) <= used and set(scene.materials) <= named


@pytest.mark.parametrize("name", sorted(LOOSE_BALLS))
def test_spheres_do_not_cut_into_one_another(name):
    leaves = rtcore.load(resources.ROOT / "scenes" / f"{name}.yaml").leaves()
    balls = [(leaf.matrix @ [*leaf.shape.center, 1], leaf.shape.radius) for leaf in leaves if isinstance(leaf.shape, rtcore.Sphere)]
    assert len(balls) >= 2
    for (a, r), (b, s) in combinations(balls, 2):
        assert np.linalg.norm(a - b) > r + s


def test_every_scene_fills_its_picture_with_light_that_fits(scene, stem):
    image = rtcore.render(scene, size=(160, 100), spp=2)
    assert image.stats["nonfinite_pixels"] == 0
    assert (image.pixels > 1).any(axis=2).mean() < 0.02        # hardly anything is clipped
    low, high = (0.015, 0.1) if stem in NIGHT else (0.1, 0.7)
    assert low < image.pixels.mean() < high and image.pixels.std() > 0.05


def shapes(name: str) -> list[Shape]:
    return [leaf.shape for leaf in rtcore.load(resources.ROOT / "scenes" / f"{name}.yaml").leaves()]


def test_the_tori_are_of_every_sort():
    ratios = {shape.minor_radius / shape.major_radius for shape in shapes("tori") if isinstance(shape, rtcore.Torus)}
    assert min(ratios) <= 0.1 and 1.0 in ratios and max(ratios) > 1


def test_the_quadrics_are_of_every_sort():
    """Told apart by the signs of the quadratic form's eigenvalues and of the constant, or by a linear term along the axis."""
    sorts = set()
    for shape in shapes("quadrics"):
        if isinstance(shape, rtcore.Quadric):
            squares, axis, constant = np.sign(shape.coefficients[:3]), shape.coefficients[7] != 0, np.sign(shape.coefficients[9])
            assert not any(shape.coefficients[3:6])
            sorts.add((int((squares > 0).sum()), int((squares < 0).sum()), axis, 0 if axis else int(constant)))
    ellipsoid, cylinder, cone, paraboloid, saddle = (3, 0, False, -1), (2, 0, False, -1), (2, 1, False, 0), (2, 0, True, 0), (1, 1, True, 0)
    one_sheet, two_sheets = (2, 1, False, -1), (2, 1, False, 1)
    assert sorts == {ellipsoid, cylinder, cone, paraboloid, saddle, one_sheet, two_sheets}


def test_the_transformed_spheres_are_one_unit_sphere():
    everything = shapes("transformed-spheres")
    assert len(everything) > 50 and set(everything) == {rtcore.Sphere(center=(0, 0, 0), radius=1)}


def test_the_chessboard_has_all_its_men_and_describes_each_once():
    scene = rtcore.load(resources.ROOT / "scenes" / "chess.yaml")

    def men(node) -> dict[str, int]:
        if node.use in ("pawn", "rook", "knight", "bishop", "queen", "king"):
            return {node.use: 1}
        total = {}
        for child in (scene.definitions[node.use],) if node.use else node.children or ():
            for man, count in men(child).items():
                total[man] = total.get(man, 0) + count
        return total

    armies = [men(node) for node in scene.objects if node.use == "army"]
    assert armies == [{"pawn": 8, "rook": 2, "knight": 2, "bishop": 2, "queen": 1, "king": 1}] * 2


@pytest.mark.parametrize("name", ["candle", "koppelaarster"])
def test_a_flame_is_hidden_from_the_eye_but_not_from_the_faces(name):
    """The light that is said to be a candle cannot be seen from the camera, and without it the picture is all but black."""
    scene = rtcore.load(resources.ROOT / "scenes" / f"{name}.yaml")
    candle = next(light for light in scene.lights if isinstance(light, rtcore.Point))
    eye = scene.camera.lookfrom
    hits = rtcore.intersect(scene, [eye], [np.subtract(candle.position, eye)])
    screen = list(scene.leaves())[hits.node[0]]
    assert hits.t[0] < 1 and screen.material.transmission == 0       # and so not the flame itself
    rest = tuple(light for light in scene.lights if light is not candle)
    lit, unlit = (rtcore.render(s, size=(96, 54), spp=1).pixels.mean() for s in (scene, msgspec.structs.replace(scene, lights=rest)))
    assert unlit < lit / 3


def test_a_saved_scene_is_the_same_scene(scene, tmp_path):
    rtcore.save(scene, tmp_path / "again.yaml")
    assert rtcore.load(tmp_path / "again.yaml") == scene
