"""NFF: every entity by the format's page, what is wrong with its line, and the databases whose counts are published."""
import math

import numpy as np
import pytest

from rtcore import files
from rtcore.fields import linear_from_srgb
from rtcore.files import FileError
from rtcore.files._outlines import triangles_of
from rtcore.lights import Ambient, Point
from rtcore.shapes import Cone, Cylinder, Mesh, Polygon, Sphere

VIEW = "v\nfrom 0 0 5\nat 0 0 0\nup 0 1 0\nangle 45\nhither 1\nresolution 10 20\n"
FILL = "f 1 0.5 0 0.8 0.25 10 0 0\n"
GLASS = "f 1 1 1 0 0.1 0 0.9 1.5\n"


def load(folder, text: str):
    path = folder / "s.nff"
    path.write_text(text)
    return files.load(path)


def shapes(scene) -> list:
    return [leaf.shape for leaf in scene.leaves()]


def test_the_view_spans_the_centres_of_the_outer_rows(tmp_path):
    camera = load(tmp_path, VIEW).camera
    assert (camera.lookfrom, camera.lookat, camera.up, camera.fov, camera.span) == ((0, 0, 5), (0, 0, 0), (0, 1, 0), 45, "centers")


def test_numbers_break_across_lines_and_remarks_end_them(tmp_path):
    view = "v from 0 0 5 at 0 0\n0 up 0 1 0 angle\n45 hither 1 resolution 1 1 "
    scene = load(tmp_path, "# a remark\nb 1\n 0 # red\n0 " + view + FILL + "s 1 2\n3\n.5e1")
    assert scene.background.color == (1, 0, 0) and shapes(scene) == [Sphere(center=(1, 2, 3), radius=5, sides="front")]


def test_colours_are_display_values(tmp_path):
    scene = load(tmp_path, "b 0.5 0.5 1\n" + VIEW + "l 1 2 3 0.5 1 2\n" + FILL + "s 0 0 0 1\n")
    half = linear_from_srgb(0.5)
    assert scene.background.color == (half, half, 1)
    assert scene.lights[0].color == (half, 1, 2)
    assert scene.materials["m1"].color == (1, half, 0)


@pytest.mark.parametrize("count", [1, 3, 7])
def test_lights_without_a_colour_share_one_over_the_root_of_their_number(tmp_path, count):
    *points, ambient = load(tmp_path, VIEW + "l 1 2 3\n" * count).lights
    assert all(isinstance(p, Point) and p.falloff == "constant" and p.intensity == pytest.approx(1 / math.sqrt(count)) for p in points)
    assert len(points) == count and isinstance(ambient, Ambient) and ambient.intensity == pytest.approx(linear_from_srgb(0.1))


def test_a_fill_is_a_material_that_never_divides_by_its_index(tmp_path):
    scene = load(tmp_path, VIEW + FILL + "s 0 0 0 1\n" + GLASS + "s 0 0 0 1\n" + FILL + "s 0 0 0 2\n")
    opaque, glass = scene.materials["m1"], scene.materials["m2"]
    assert list(scene.materials) == ["m1", "m2"] and [node.material for node in scene.objects] == ["m1", "m2", "m1"]
    assert (opaque.diffuse, opaque.specular) == (linear_from_srgb(0.8), linear_from_srgb(0.25))
    assert (opaque.reflection, opaque.transmission, opaque.ior) == (0.25, 0, 1)
    assert opaque.shininess == 40       # Phong's 10
    assert (glass.diffuse, glass.reflection, glass.transmission, glass.ior, glass.fresnel) == (0, 0.1, 0.9, 1.5, False)
    assert glass.shininess > 0


@pytest.mark.parametrize(("fill", "sign", "sides"), [(FILL, "", "front"), (FILL, "-", "back"), (GLASS, "", "both"), (GLASS, "-", "both")])
def test_visible_sides(tmp_path, fill, sign, sides):
    tube, cone, ball = shapes(load(tmp_path, VIEW + fill + f"c 0 0 0 {sign}1 0 0 1 {sign}1 c 0 0 0 {sign}2 0 0 1 {sign}1 s 0 0 0 {sign}1"))
    assert ball == Sphere(center=(0, 0, 0), radius=1, sides=sides)
    assert tube == Cylinder(base=(0, 0, 0), apex=(0, 0, 1), radius=1, capped=False, sides=sides)
    assert cone == Cone(base=(0, 0, 0), base_radius=2, apex=(0, 0, 1), apex_radius=1, capped=False, sides=sides)


def test_polygons_patches_and_triangles_of_a_fill_are_gathered(tmp_path):
    corner = "0 0 0 0 0 1  1 0 0 0 0 1  1 1 0 0 0 2\n"
    objects = "p 3 0 0 0 1 0 0 0 1 0\n" * 3 + "p 4 0 0 0 1 0 0 1 1 0 0 1 0\n" + "pp 3 " + corner + "pp 4 " + corner + "0 1 0 0 0 0\n"
    scene = load(tmp_path, VIEW + FILL + objects)
    flat, patches, polygon = shapes(scene)
    assert isinstance(flat, Mesh) and len(flat.faces) == 3 and flat.normals is None and flat.sides == "both"
    assert isinstance(patches, Mesh) and len(patches.faces) == 3 and patches.sides == "both"
    assert patches.normals[2].tolist() == [0, 0, 2] and patches.normals[-1].tolist() == [0, 0, 1]       # none given: the face's
    assert polygon == Polygon(vertices=[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    assert scene.objects[0].name == "3 triangles, 3 patches, polygon"


def test_polygons_without_an_area_are_left_out_and_counted(tmp_path):
    flat = "p 3 0 0 0 1 1 1 2 2 2\np 4 1 1 1 1 1 1 1 1 1 1 1 1\npp 3 0 0 0 0 0 1 0 0 0 0 0 1 1 1 1 0 0 1\n"
    scene = load(tmp_path, VIEW + FILL + flat + "s 0 0 0 1")
    assert len(shapes(scene)) == 1 and scene.note == "3 degenerate polygons left out"


def test_a_concave_patch_is_cut_into_triangles_of_its_area():
    star = np.array([(math.cos(a) * r, math.sin(a) * r, 0.5 * math.cos(a) * r)
                     for a, r in zip(np.linspace(0, 2 * math.pi, 16, endpoint=False), [2, 0.5] * 8)])
    for outline in (star, star[::-1], star[:, [2, 0, 1]], star[:, [1, 2, 0]]):
        pieces = triangles_of(outline)
        normals = np.array([np.cross(outline[b] - outline[a], outline[c] - outline[a]) for a, b, c in pieces])
        whole = np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0)
        assert len(pieces) == 14 and normals.sum(axis=0) == pytest.approx(whole)
        assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(np.linalg.norm(whole))     # no overlap, none turned over


WRONG = {
    "": "expected a scene, got an empty file",
    "# remark\n": "line 1: expected a view (v), got the end of the file",
    VIEW + FILL + "la 1 2 3\n": "line 9: expected one of v, b, l, f, s, c, p, pp, got 'la' (did you mean 'l'?)",
    VIEW + FILL + "s 0 0 0 1\nnumber 5\n": "line 10: expected one of v, b, l, f, s, c, p, pp, got 'number'",
    FILL + "s 0 0 0 1\n": "line 2: expected a view (v) before the first object, got 's'",
    VIEW + "s 0 0 0 1\n": "line 8: expected a fill (f) before the first sphere, got none",
    VIEW + FILL + "s 0 0 0\n0\n": "line 9: expected a radius other than 0, got 0.0",
    VIEW + FILL + "s 0 0\n0\n": "line 10: expected 4 numbers (centre and radius of a sphere), got the end of the file after 3",
    VIEW + FILL + "s 0\nnan 0 1\n": "line 10: expected 4 numbers (centre and radius of a sphere), got 'nan'",
    VIEW + FILL + "s 0 1_0 0 1\n": "line 9: expected 4 numbers (centre and radius of a sphere), got '1_0'",
    VIEW + FILL + "s 0 1e999 0 1\n": "line 9: expected 4 numbers (centre and radius of a sphere), got '1e999'",
    VIEW + FILL + "c 0 0 0 1 0 0 1 -1\n": "line 9: expected two radii of the same sign, got 1 and -1",
    VIEW + FILL + "c 0 0 0 1 0 0 0 1\n": "line 9: c apex centre: expected a point other than base, got (0.0, 0.0, 0.0)",
    VIEW + FILL + "p 2\n0 0 0 1 1 1\n": "line 9: expected a polygon of at least 3 vertices, got 2",
    VIEW + FILL + "p 1000000000\n0 0 0\n": "line 10: expected 3,000,000,000 numbers (",
    VIEW + "f 1 1 1 -1 0 1 0 0\n": "line 8: f Kd: expected a number of at least 0, got -1.0",
    VIEW + "l 1 2 3 4\n": "line 8: expected 3 numbers (colour of a light), got the end of the file after 1",
    "b 1 1\n" + VIEW: "line 2: expected 3 numbers (colour of the background), got 'v'",
    "b 1 1 -1\n" + VIEW: "line 1: expected a colour whose parts are at least 0, got [1.0, 1.0, -1.0]",
    VIEW + VIEW: "line 8: expected one view (v), got a second one",
    VIEW.replace("hither", "yon"): "line 6: expected hither or resolution of the view, got 'yon'",
    "v\nfrom 0 0 5\n": "line 2: expected at or up or angle or hither or resolution of the view, got the end of the file",
    VIEW.replace("45", "0"): "line 1: v angle: expected a number greater than 0 and less than 180, got 0.0",
    VIEW.replace("at 0 0 0", "at 0 0 5"): "line 1: v at: expected a point other than lookfrom, got (0.0, 0.0, 5.0)",
    VIEW.replace("up 0 1 0", "up 0 0 1"): "line 1: v up: expected a direction that is not parallel to the view, got (0.0, 0.0, 1.0)",
    "\0\1\2": "expected a text file, got a binary one (a zero byte at offset 0)",
}


@pytest.mark.parametrize(("text", "said"), WRONG.items(), ids=range(len(WRONG)))
def test_what_is_wrong_is_said_in_one_line_with_its_place(tmp_path, text, said):
    with pytest.raises(FileError) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert "\n" not in message and message.removeprefix(f"{tmp_path / 's.nff'}: ").startswith(said)


@pytest.mark.parametrize(("name", "counts"), [
    ("spd/balls", {Sphere: 7381, Polygon: 1}), ("spd/mount", {Sphere: 4, "triangles": 8192}), ("spd/tetra", {"triangles": 4096}),
    ("spd/tree", {Cone: 4095, Sphere: 4095, Polygon: 1}), ("spd-small/gears1", {Polygon: 147}),
    ("spd-small/rings2", {Cylinder: 150, Sphere: 150, Polygon: 1}), ("spd-small/shells2", {Sphere: 721}),
    ("spd-small/teapot2", {Polygon: 4, "triangles": 240})])
def test_the_databases_are_complete_and_survive_being_saved(scenes, tmp_path, name, counts):
    scene = files.load(scenes / f"{name}.nff")
    found = {}
    for shape in shapes(scene):
        key, many = ("triangles", len(shape.faces)) if isinstance(shape, Mesh) else (type(shape), 1)
        found[key] = found.get(key, 0) + many
    assert found == counts and len(scene.objects) < 40 and not scene.note
    files.save(scene, tmp_path / "s.yaml")
    assert files.load(tmp_path / "s.yaml") == scene
