"""Mesh files: shapes, materials and places as the file has them; nothing fetched or printed; what is broken said in one line."""
import json
import os
import struct
import subprocess
import sys

import numpy as np
import pytest

from rtcore import files
from rtcore.fields import linear_from_srgb
from rtcore.files import FileError
from rtcore.files import _meshes as meshes
from rtcore.scene import Node, Scene
from rtcore.shapes import Mesh

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def written(folder, text: str | bytes, name: str):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def only(scene) -> Mesh:
    leaf, = scene.leaves()
    return leaf.shape


def triangles(mesh: Mesh) -> list:
    return mesh.vertices[mesh.faces].tolist()


def ply(vertices="0 0 0\n1 0 0\n0 1 0\n", faces="3 0 1 2\n", counts=(3, 1)) -> str:
    return (f"ply\nformat ascii 1.0\nelement vertex {counts[0]}\nproperty float x\nproperty float y\nproperty float z\n"
            f"element face {counts[1]}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}")


def gltf(indices=(0, 1, 2), nodes=({"mesh": 0},), material=None, buffer=None) -> dict:
    """A glTF object with one triangle; the buffer is inline unless it is named."""
    import base64
    data = CORNERS.tobytes() + np.array(indices, np.uint32).tobytes()
    uri = buffer or "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    primitive = {"attributes": {"POSITION": 0}, "indices": 1} | ({"material": 0} if material else {})
    return {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [i for i, n in enumerate(nodes) if not n.get("below")]}],
            "nodes": [{k: v for k, v in n.items() if k != "below"} for n in nodes], "meshes": [{"name": "tri", "primitives": [primitive]}],
            "buffers": [{"uri": uri, "byteLength": len(data)}],
            "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36},
                            {"buffer": 0, "byteOffset": 36, "byteLength": 4 * len(indices)}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                          {"bufferView": 1, "componentType": 5125, "count": len(indices), "type": "SCALAR"}]
            } | ({"materials": [material]} if material else {})


def glb(content: dict) -> bytes:
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON") + text


STL = b"\0" * 80 + struct.pack("<I", 1) + struct.pack("<12fH", 0, 0, 1, *CORNERS.ravel(), 0)
TEXT_STL = "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid x\n"
OFF = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"

SOUND = {"a.obj": TRIANGLE + "f 1 2 3\n", "a.ply": ply(), "a.stl": STL, "b.stl": TEXT_STL, "a.off": OFF,
         "a.gltf": json.dumps(gltf()), "a.glb": glb(gltf())}


@pytest.mark.parametrize("name", SOUND)
def test_every_format_is_read_and_survives_being_saved(tmp_path, name):
    scene = files.load(written(tmp_path, SOUND[name], name))
    assert triangles(only(scene)) == [CORNERS.tolist()] and only(scene).normals is None
    assert scene.name == name[0] and scene.objects[0].name == name[0] and scene.note == ""
    assert scene.camera is not None and len(scene.lights) == 3 and scene.background.top is not None
    u, v = (scene.camera.project(corner, 100, 100) for corner in CORNERS[1:])
    assert all(0 < x < 100 for x in (*u, *v))
    files.save(scene, tmp_path / "s.yaml")
    assert files.load(tmp_path / "s.yaml") == scene and f"mesh: {{file: {name}}}" in (tmp_path / "s.yaml").read_text()


def test_loading_prints_nothing_and_wants_only_trimesh(tmp_path):
    for name, content in SOUND.items():
        written(tmp_path, content, name)
    code = "import sys, rtcore.files as f; assert 'trimesh' not in sys.modules; [f.load(p) for p in sys.argv[1:]]"
    done = subprocess.run([sys.executable, "-c", code, *SOUND], cwd=tmp_path, capture_output=True, text=True,
                          env={**os.environ, "PYTHONPATH": os.path.dirname(os.path.dirname(__file__))})
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# --- OBJ ---

def test_obj_indices_count_from_the_end_as_of_their_line(tmp_path):
    text = TRIANGLE + "f -3 -2 -1\nv 5 5 5\nf -4 2 -1 # remark\n\t f  1\t2 3\n"
    assert triangles(only(files.load(written(tmp_path, text, "a.obj")))) == [
        CORNERS.tolist(), [[0, 0, 0], [1, 0, 0], [5, 5, 5]], CORNERS.tolist()]


def test_obj_faces_of_many_corners_are_cut_up(tmp_path):
    mesh = only(files.load(written(tmp_path, TRIANGLE + "v -1 1 0\nv -1 0 0\nf 1 2 3\nf 1 2 3 4\nf 1 2 3 4 5\n", "a.obj")))
    assert len(mesh.faces) == 6


def test_vertex_normals_are_used_if_the_file_has_them(tmp_path):
    mesh = only(files.load(written(tmp_path, TRIANGLE + "vn 0 0 1\nvn 0 1 1\nf 1//1 2//2 3//1\n", "a.obj")))
    assert mesh.normals[mesh.faces].tolist() == [[[0, 0, 1], [0, 1, 1], [0, 0, 1]]]


def test_degenerate_triangles_are_left_out_and_counted(tmp_path):
    scene = files.load(written(tmp_path, TRIANGLE + "v 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 3\n", "a.obj"))
    assert len(only(scene).faces) == 1 and scene.objects[0].note == "2 degenerate triangles left out"


def test_mtl_materials(tmp_path):
    from PIL import Image
    Image.new("RGB", (4, 4), (255, 0, 51)).save(tmp_path / "t.png")
    written(tmp_path, "newmtl red\nKd 1 0 0.5\nKs 0.5 0.5 0.5\nNs 30\nKe 2 0 0\nnewmtl mirror\nKd 0 0 0\nKs .9 .9 .9\nillum 3\nPr 0.3\n"
            "newmtl glass\nKd 0 0 0\nd 0.25\nNi 1.4\nillum 7\nnewmtl wood\nKd 1 1 1\nmap_Kd t.png\n"
            "newmtl odd\nKd nan x\nNs\nNi -\n", "m.mtl")
    faces = "".join(f"usemtl {name}\nf 1 2 3\n" for name in ("red", "mirror", "glass", "wood", "odd", "absent"))
    scene = files.load(written(tmp_path, "mtllib m.mtl\n" + TRIANGLE + faces, "a.obj"))
    group, = scene.objects
    looks = {node.name: scene.materials[node.material] for node in group.children}
    assert list(looks) == ["red", "mirror", "glass", "wood", "odd", "absent"]
    assert looks["red"].color == (1, 0, linear_from_srgb(0.5)) and looks["red"].emission == (2, 0, 0)
    assert (looks["red"].specular, looks["red"].shininess, looks["red"].reflection) == (0.5, 30, 0)
    assert looks["mirror"].reflection == pytest.approx(0.9) and looks["mirror"].roughness == 0.3 and looks["red"].roughness == 0
    assert (looks["glass"].transmission, looks["glass"].ior, looks["glass"].diffuse) == (0.75, 1.4, 0.25)
    assert looks["wood"].color == pytest.approx((1, 0, linear_from_srgb(0.2)))
    assert scene.materials["plaster"] is looks["absent"]
    files.save(scene, tmp_path / "s.yaml")
    assert files.load(tmp_path / "s.yaml") == scene


def test_a_material_file_that_is_missing_is_noted(tmp_path):
    written(tmp_path.parent, "newmtl a\n", "outside.mtl")
    for name in ("none.mtl", "../outside.mtl", "http://127.0.0.1/m.mtl"):
        assert files.load(written(tmp_path, f"mtllib {name}\n{TRIANGLE}f 1 2 3\n", "a.obj")).note == f"not found: {name}"


# --- glTF and colours ---

def test_gltf_nodes_stand_where_their_parents_put_them(tmp_path):
    nodes = ({"children": [1, 2], "translation": [10, 0, 0]}, {"mesh": 0, "name": "low", "scale": [2, 2, 2], "below": True},
             {"mesh": 0, "name": "high", "translation": [0, 5, 0], "below": True}, {"mesh": 0, "name": "hidden", "scale": [0, 0, 0]})
    scene = files.load(written(tmp_path, json.dumps(gltf(nodes=nodes)), "a.gltf"))
    first, second = {node.name: node for node in scene.objects[0].children}.values()
    assert first.shape is second.shape and scene.note == "1 part without extent left out"
    places = {leaf.matrix[:3, 3].tolist()[1]: leaf.matrix for leaf in scene.leaves()}
    assert places[0] == pytest.approx(np.array([[2, 0, 0, 10], [0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]))
    assert places[5][:3, 3].tolist() == [10, 5, 0]
    files.save(scene, tmp_path / "s.yaml")
    assert files.load(tmp_path / "s.yaml") == scene


def test_gltf_materials(tmp_path):
    metal = {"name": "gold", "pbrMetallicRoughness": {"baseColorFactor": [1, 0.2, 0, 1], "metallicFactor": 1, "roughnessFactor": 0}}
    gold = files.load(written(tmp_path, glb(gltf(material=metal)), "a.glb")).materials["gold"]
    assert gold.color == pytest.approx((1, 0.2, 0)) and gold.tint == gold.color and gold.reflection == 1 and gold.diffuse == 0
    assert gold.roughness == 0
    metal["pbrMetallicRoughness"]["roughnessFactor"] = 0.25
    satin = files.load(written(tmp_path, glb(gltf(material=metal)), "b.glb")).materials["gold"]
    assert satin.roughness == 0.25 and satin.reflection == pytest.approx(0.75 ** 2)
    thin = {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.2], "metallicFactor": 0}}
    film, = files.load(written(tmp_path, glb(gltf(material=thin)), "a.glb")).materials.values()
    assert film.transmission == pytest.approx(0.8) and film.ior == 1 and film.reflection == 0


def test_vertex_colours_give_their_mean(tmp_path):
    text = ply("0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 255\n").replace(
        "property float z\n", "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n")
    colour, = files.load(written(tmp_path, text, "a.ply")).materials.values()
    assert colour.color == pytest.approx((1, 0, 1 / 3))


# --- meshes named by a scene ---

def test_a_scene_names_a_mesh_relative_to_itself(tmp_path):
    (tmp_path / "models").mkdir()
    written(tmp_path / "models", SOUND["a.obj"], "a.obj")
    nodes = "  - mesh: {file: models/a.obj}\n  - mesh: {file: models/../models/a.obj, sides: front}\n"
    path = written(tmp_path, "rayscope: 1\nscene:\n" + nodes, "s.yaml")
    scene = files.load(path)
    first, second = (leaf.shape for leaf in scene.leaves())
    assert first.vertices is second.vertices and second.sides == "front" and first.file == str(tmp_path / "models" / "a.obj")
    (tmp_path / "elsewhere").mkdir()
    files.save(scene, tmp_path / "elsewhere" / "s.yaml")
    assert 'file: "../models/a.obj"' in (tmp_path / "elsewhere" / "s.yaml").read_text()
    assert files.load(tmp_path / "elsewhere" / "s.yaml") == scene


@pytest.mark.parametrize("change", ["edited", "file gone", "file changed", "made by hand", "relative name"])
def test_a_mesh_that_is_not_what_its_file_holds_is_written_out(tmp_path, change):
    path = written(tmp_path, SOUND["a.obj"], "a.obj")
    mesh = only(files.load(path))
    if change == "edited":
        mesh = Mesh(vertices=mesh.vertices + 1, faces=mesh.faces, file=mesh.file)
    elif change == "file gone":
        path.unlink()
    elif change == "file changed":
        path.write_text(SOUND["a.obj"].replace("v 1", "v 3"))
    elif change == "made by hand":
        mesh = Mesh(vertices=CORNERS, faces=[[0, 1, 2]])
    else:
        mesh = Mesh(vertices=mesh.vertices, faces=mesh.faces, file="a.obj")
    scene = Scene(objects=(Node(shape=mesh),))
    files.save(scene, tmp_path / "s.yaml")
    assert "vertices" in (tmp_path / "s.yaml").read_text()
    assert files.load(tmp_path / "s.yaml") == scene


def test_a_mesh_equal_to_what_its_file_holds_is_written_as_the_name(tmp_path):
    mesh = only(files.load(written(tmp_path, SOUND["a.obj"], "a.obj")))
    files.save(Scene(objects=(Mesh(vertices=mesh.vertices.copy(), faces=mesh.faces, file=mesh.file),)), tmp_path / "s.yaml")
    assert "vertices" not in (tmp_path / "s.yaml").read_text()


def test_a_scene_names_a_part_of_a_file_or_all_of_it(tmp_path):
    nodes = ({"mesh": 0, "translation": [3, 0, 0]}, {"mesh": 0, "scale": [-1, 1, 1]})
    written(tmp_path, glb(gltf(nodes=nodes)), "a.glb")
    scene = files.load(written(tmp_path, "rayscope: 1\nscene: [{mesh: {file: a.glb}}, {mesh: {file: 'a.glb#1'}}]\n", "s.yaml"))
    whole, part = (leaf.shape for leaf in scene.leaves())
    assert triangles(part) == [CORNERS.tolist()]
    found = sorted(triangles(whole))
    assert found == [[[0, 1, 0], [-1, 0, 0], [0, 0, 0]], (CORNERS + [3, 0, 0]).tolist()]     # mirrored, and so turned around
    with pytest.raises(FileError, match=r"expected a part from #0 to #1, got #2$"):
        files.load(written(tmp_path, "rayscope: 1\nscene: [{mesh: {file: 'a.glb#2'}}]\n", "s.yaml"))


# --- what is wrong ---

WRONG = {
    ("e.obj", ""): "expected a scene, got an empty file",
    ("a.obj", b"\0\1\2"): "expected a text file, got a binary one (a zero byte at offset 0)",
    ("a.obj", "hello\n"): "line 2: expected at least one face (a line that begins with f), got none",
    ("a.obj", TRIANGLE): "line 4: expected at least one face (a line that begins with f), got none",
    ("a.obj", TRIANGLE + "f 1 2 4\n"): "line 4: expected an index from 1 to the number of vertices, 3, got '4'",
    ("a.obj", TRIANGLE + "f 0 1 2\n"): "line 4: expected an index from 1 to the number of vertices, 3, got '0'",
    ("a.obj", TRIANGLE + "f -1 -2 -4\n"): "line 4: expected an index from 1 to the number of vertices, 3, got '-4'",
    ("a.obj", TRIANGLE + "vn 0 0 1\nf 1//1 2//1 3//2\n"): "line 5: expected an index from 1 to the number of normals, 1, got '3//2'",
    ("a.obj", TRIANGLE + "f 1 2\n"): "line 4: expected a face of at least three vertices, got 'f 1 2'",
    ("a.obj", TRIANGLE + "f one 2 3\n"): "line 4: expected a vertex index, got 'one'",
    ("a.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n"): "line 2: expected three finite numbers, got 'nan 0 0'",
    ("a.obj", "v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n"): "line 2: expected three finite numbers, got '1 0'",
    ("a.obj", TRIANGLE + "f 1 1 1\n"): "expected at least one face, got only faces without an area",
    ("a.ply", "ply\n"): "expected a PLY header from ply to end_header, got none",
    ("a.ply", ply(faces="3 0 1 3\n")): "faces[0]: expected indices from 0 to less than the number of vertices, 3, got [0, 1, 3]",
    ("a.ply", ply(faces="3 0 1 -1\n")): "faces[0]: expected indices from 0 to less than the number of vertices, 3, got [0, 1, -1]",
    ("a.ply", ply(vertices="0 0 0\n0 nan 0\n0 1 0\n")): "vertices[1]: expected three finite numbers, got [0.0, nan, 0.0]",
    ("a.ply", ply(faces="", counts=(3, 0))): "expected at least one face, got none",
    ("a.ply", ply(counts=(3, 2))): "expected 5 lines after the header, which says so, got 4 of them",
    ("a.ply", ply(counts=(3, 10**12)).replace("ascii", "binary_little_endian")): "expected at most 10,000,000 faces, got 1,000,000,000,000",
    ("a.stl", STL[:-5]): "expected a text STL, or a binary one of 84 + 50 x 1 bytes as its header says, got 129 bytes",
    ("a.stl", b"\0" * 84): "expected at least one face, got none",
    ("a.stl", TEXT_STL[:-20]): "line 8: expected endsolid, got the end of the file",
    ("a.stl", TEXT_STL.replace("vertex 1", "vertex nan")): "vertices[1]: expected three finite numbers, got [nan, 0.0, 0.0]",
    ("a.off", OFF.replace("0 1 2\n", "0 1 3\n")): "expected a sound .off file, got one that can't be read: ",
    ("a.off", OFF[:20]): "expected 3 lines of vertices and 1 of faces, as its header says, got 2 of them",
    ("a.off", "hello\n"): "expected OFF at the beginning, got something else",
    ("a.glb", glb(gltf())[:-4]): "expected a GLB of ",
    ("a.glb", b"hello"): "expected a GLB header, got something else",
    ("a.glb", glb(gltf(indices=(0, 1, 3)))): "faces[0]: expected indices from 0 to less than the number of vertices, 3, got [0, 1, 3]",
    ("a.gltf", "{"): "line 1: expected JSON, got something else (",
    ("a.gltf", "[]"): "expected a glTF object with an asset, got []",
    ("a.gltf", '{"asset": {"version": "2.0"}}'): "expected at least one face, got none",
    ("a.gltf", json.dumps(gltf(buffer="http://127.0.0.1/a.bin"))):
        "expected a sound .gltf file, got one that can't be read: there is no file 'http://127.0.0.1/a.bin' beside it",
}


@pytest.mark.parametrize(("file", "said"), WRONG.items(), ids=range(len(WRONG)))
def test_what_is_wrong_is_said_in_one_line(tmp_path, file, said):
    path = written(tmp_path, file[1], file[0])
    with pytest.raises(FileError) as caught:
        files.load(path)
    message = str(caught.value)
    assert "\n" not in message and message.removeprefix(f"{path}: ").startswith(said)


@pytest.mark.parametrize("name", SOUND)
def test_files_cut_short_or_with_a_byte_changed_are_read_or_refused_in_one_line(tmp_path, name):
    whole = SOUND[name] if isinstance(SOUND[name], bytes) else SOUND[name].encode()
    rng = np.random.default_rng(1)
    for at in rng.integers(0, len(whole), 40):
        for broken in (whole[:at], whole[:at] + bytes([rng.integers(256)]) + whole[at + 1:]):
            try:
                files.load(written(tmp_path, broken, name))
            except FileError as error:
                assert "\n" not in str(error)


def test_too_many_faces_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(meshes, "MOST_FACES", 2)
    for name, content in {"a.obj": TRIANGLE + "f 1 2 3\n" * 3, "a.glb": glb(gltf(indices=(0, 1, 2) * 3)), "a.stl": TEXT_STL.replace(
            "endsolid", TEXT_STL[8:-11] * 2 + "endsolid")}.items():
        with pytest.raises(FileError, match="expected at most 2 faces, got 3"):
            files.load(written(tmp_path, content, name))


@pytest.mark.parametrize(("name", "faces", "parts"), [
    ("bunny.obj", 3674, 1), ("CornellBox-Sphere.obj", 2188, 8), ("embree_cornell_box.obj", 34, None)])
def test_meshes_from_elsewhere(scenes, tmp_path, name, faces, parts):
    scene = files.load(scenes / "meshes" / name)
    leaves = list(scene.leaves())
    assert sum(len(leaf.shape.faces) for leaf in leaves) == faces and (parts is None or len(leaves) == parts)
    files.save(scene, tmp_path / "s.yaml")
    assert (tmp_path / "s.yaml").stat().st_size < 5000 and files.load(tmp_path / "s.yaml") == scene
