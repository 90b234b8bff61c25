"""The scenes that come along: sound, explained, and lit so that they can be shown."""
import re
from itertools import combinations

import numpy as np
import pytest

import resources
import rtcore

GALLERY = sorted((resources.ROOT / "scenes").glob("*.yaml"))


@pytest.fixture(scope="module", params=GALLERY, ids=lambda path: path.stem)
def scene(request) -> rtcore.Scene:
    return rtcore.load(request.param)


def test_the_gallery_has_the_scenes_that_were_promised():
    assert {"coloured-fog", "spheres", "whitted"} <= {path.stem for path in GALLERY}


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


def test_spheres_do_not_cut_into_one_another(scene):
    balls = [(leaf.matrix @ [*leaf.shape.center, 1], leaf.shape.radius) for leaf in scene.leaves() if isinstance(leaf.shape, rtcore.Sphere)]
    assert len(balls) >= 2
    for (a, r), (b, s) in combinations(balls, 2):
        assert np.linalg.norm(a - b) > r + s


def test_every_scene_fills_its_picture_with_light_that_fits(scene):
    image = rtcore.render(scene, size=(160, 100), spp=2)
    assert image.stats["nonfinite_pixels"] == 0
    assert (image.pixels > 1).any(axis=2).mean() < 0.02        # hardly anything is clipped
    assert 0.1 < image.pixels.mean() < 0.7 and image.pixels.std() > 0.05


def test_a_saved_scene_is_the_same_scene(scene, tmp_path):
    rtcore.save(scene, tmp_path / "again.yaml")
    assert rtcore.load(tmp_path / "again.yaml") == scene
