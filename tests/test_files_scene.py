"""Scene files: what is written comes back, what is wrong is said in one line with its place, and nothing takes for ever."""
import os
import time
import typing

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

from rtcore import files
from rtcore.camera import Camera
from rtcore.fields import Choice, Color, FieldError, Flag, Maybe, Number, Numbers, Record, Text, Vector, Vectors, fields_of
from rtcore.files import FileError
from rtcore.files import _yaml as yaml
from rtcore.files._yamlout import dump
from rtcore.lights import LIGHTS
from rtcore.scene import MOST_NESTED, TRANSFORMS, Background, Fog, Material, Node, Rows, Scene
from rtcore.shapes import SHAPES, Box, Mesh, Sphere
from rtcore.shapes.blob import Elements
from rtcore.shapes.implicit import Expression
from rtcore.shapes.polyhedron import Planes
from rtcore.shapes.triangle import Array

HEAD = "rayscope: 1\n"
BALL = "  - sphere: {center: [0, 0, 0], radius: 1}\n"


def written(folder, text: str | bytes, name: str = "s.yaml"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def refusal(path) -> str:
    """The one line that loading is refused with; it begins with the file's name."""
    with pytest.raises(FileError) as caught:
        files.load(path)
    message = str(caught.value)
    assert "\n" not in message and message.startswith(str(path)) and len(message) < len(str(path)) + 400
    return message[len(str(path)) + 2:]


# --- any scene, from the records' own fields ---

finite = st.floats(-1e9, 1e9) | st.floats(allow_nan=False, allow_infinity=False)
texts = st.text(max_size=12) | st.sampled_from([
    "yes", "1e-3", "null", " x", "a: b", "a #b", "- a", "line\nline\n", "  two\n lines", "\u2028", "😀", "\\ud83d\\ude00", "*a", "1_0"])


def values(field):
    """What a field may hold; a field of a new kind needs a line here."""
    if isinstance(field, Number):
        low, high = (a if a is not None else b for a, b in ((field.above, field.least), (field.below, field.most)))
        return st.floats(low, high, exclude_min=field.above is not None, exclude_max=field.below is not None,
                         allow_nan=False, allow_infinity=False)
    return {
        Vector: lambda: st.tuples(finite, finite, finite), Color: lambda: st.tuples(*[st.floats(0, min(field.most, 1e9))] * 3),
        Choice: lambda: st.sampled_from(field.words), Flag: st.booleans, Text: lambda: texts,
        Vectors: lambda: st.lists(st.tuples(finite, finite, finite), min_size=field.least, max_size=field.least + 3),
        Maybe: lambda: st.none() if type(field.inner) not in KNOWN else st.none() | values(field.inner),
        Rows: lambda: st.tuples(*[st.tuples(*[finite] * 4)] * 3).map(lambda rows: (*rows, (0, 0, 0, 1))),
        Array: lambda: st.none(), Numbers: lambda: st.tuples(*[finite] * field.count),
        Elements: lambda: st.lists(st.tuples(st.tuples(finite, finite, finite), st.floats(1e-9, 1e9), finite), min_size=1, max_size=3),
        Expression: lambda: st.sampled_from(["x", "x^2 + y^2 - 1e-3", " sin(x)*pi\n- smin(y, z, .5)"]),
        Planes: lambda: st.lists(st.tuples(st.tuples(finite, finite, finite), st.tuples(finite, finite, finite)), min_size=1, max_size=3),
    }[type(field)]()


KNOWN = {Number, Vector, Color, Choice, Flag, Text, Vectors}


def records(cls):
    """Any record of a class; those that its fields can't be together are drawn again."""
    hints = typing.get_type_hints(cls)
    inner = {name: [t for t in typing.get_args(hints[name]) if isinstance(t, type) and issubclass(t, Record)] for name in fields_of(cls)}
    drawn = {name: st.none() | records(inner[name][0]) if inner[name] else values(field) for name, field in fields_of(cls).items()}

    def make(given_fields):
        try:
            with np.errstate(all="ignore"):
                return cls(**given_fields)
        except FieldError:
            reject()
    return st.fixed_dictionaries(drawn).map(make)


@st.composite
def meshes(draw):
    count = draw(st.integers(1, 5))
    points = st.lists(st.tuples(finite, finite, finite), min_size=count, max_size=count)
    corner = st.integers(0, count - 1)
    return Mesh(vertices=draw(points), faces=draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=3)),
                normals=draw(st.none() | points), file=draw(texts), sides=draw(values(fields_of(Mesh)["sides"])))


boxes = st.builds(lambda low, size: Box(low=low, high=[a + s for a, s in zip(low, size)]),
                  st.tuples(*[st.floats(-1e6, 1e6)] * 3), st.tuples(*[st.floats(0.1, 1e6)] * 3))
shapes = st.one_of([meshes() if cls is Mesh else boxes if cls is Box else records(cls) for cls in SHAPES])
transforms = st.lists(st.one_of([records(cls) for cls in TRANSFORMS]), max_size=3)


materials, cameras, fogs, backgrounds = records(Material), st.none() | records(Camera), st.none() | records(Fog), records(Background)
lights = st.none() | st.lists(st.one_of([records(cls) for cls in LIGHTS]), max_size=3)
NAMES = ("stone", "1", "a b.c[0]", "", "on")     # every scene below has materials and definitions of these names
common = {"name": texts, "note": texts, "visible": st.booleans(), "transform": transforms,
          "material": st.none() | st.sampled_from(NAMES) | materials}
leaves = st.builds(Node, shape=shapes, **common)
nodes = st.recursive(leaves | st.builds(Node, use=st.sampled_from(NAMES), **common),
                     lambda below: st.builds(Node, children=st.lists(below, max_size=3), **common), max_leaves=4)
parts = {"objects": st.lists(nodes, max_size=3), "materials": st.fixed_dictionaries(dict.fromkeys(NAMES, materials)),
         "definitions": st.fixed_dictionaries(dict.fromkeys(NAMES, leaves)), "camera": cameras, "fog": fogs, "background": backgrounds,
         "lights": lights, "name": texts, "note": texts}


@st.composite
def scenes_of_any_kind(draw):
    return Scene(**{name: draw(strategy) for name, strategy in parts.items()})


@settings(max_examples=50, suppress_health_check=list(HealthCheck))
@given(scene=scenes_of_any_kind(), suffix=st.sampled_from(files.FORMATS["scene"]))
def test_a_saved_scene_comes_back_equal(tmp_path_factory, scene, suffix):
    path = tmp_path_factory.mktemp("saved") / f"s{suffix}"
    files.save(scene, path)
    back = files.load(path)
    assert back == scene
    assert repr(back) == repr(scene)      # -0.0 equals 0.0, but is not what was saved


@given(data=st.recursive(st.none() | st.booleans() | st.integers(-10**17, 10**17) | finite | texts,
                         lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4), max_leaves=20))
def test_any_plain_data_comes_back_from_its_text(data):
    back = yaml.parse(dump({"data": data}))["data"]
    assert back == data


def test_long_words_and_letters_of_every_kind_come_back():
    data = {"k" * 2000: "v" * 3000, "note": "".join(map(chr, [*range(0xD800), *range(0xE000, 0x10400)]))}
    assert yaml.parse(dump(data)) == data


def test_what_people_read_is_short():
    text = dump({"sphere": {"center": (0.0, -0.0, 1e-30), "radius": 2.0, "on": True}, "note": "two\nlines"})
    assert text == 'sphere: {center: [0, -0.0, 1e-30], radius: 2, "on": true}\nnote: |-\n  two\n  lines\n'


def test_all_words_of_the_format_are_read(tmp_path):
    scene = files.load(written(tmp_path, """\
rayscope: 1
name: all of it
note: |
  with a
  note
camera: {lookfrom: [0, 1e0, -5.], lookat: [0, 0, 0], up: [0, 1, 0], fov: 4e1}
background: {color: "#000000", top: [.5, 0.5, 1]}
fog: {kind: linear, color: [1, 1, 1], start: 1e-3, end: 20, on: false}
lights: [{point: {position: [0, 5, 0], on: true}}, {directional: {direction: [0, -1, 0]}}, {ambient: {intensity: 0.1}}]
materials: {gold: {color: "#ff0000", checker: {size: 2}}}
definitions: {pawn: {group: [{sphere: {center: [0, 0, 0], radius: 010}}]}}
scene:
  - name: floor
    plane: {point: [0, 0, 0], normal: [0, 1, 0]}
    material: gold
    transform: [{translate: [1, 2, 3]}, {rotate: {axis: [0, 1, 0], angle: 30}}, {scale: [1, 2, 1]}, {scale: 2}, {shear: {xy: 1}},
                {matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]
    visible: false
  - group: [{use: pawn}, {box: {low: [0, 0, 0], high: [1, 1, 1]}, material: {color: [0, 0, 1]}}]
  - mesh: {vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces: [[0, 1, 2]]}
"""))
    assert scene.note == "with a\nnote\n" and scene.camera.fov == 40 and scene.background.top == (0.5, 0.5, 1)
    assert scene.fog.start == 0.001 and scene.fog.on is False and scene.lights[0].on is True
    assert scene.materials["gold"].color == (1, 0, 0) and scene.materials["gold"].checker.size == 2
    assert scene.definitions["pawn"].children[0].shape.radius == 10     # no octal numbers
    assert [type(t).__name__ for t in scene.objects[0].transform] == ["Translate", "Rotate", "Scale", "Scale", "Shear", "Matrix"]
    assert scene.objects[0].transform[3].factors == (2, 2, 2) and not scene.objects[0].visible
    assert len(list(scene.leaves())) == 4


def test_lights_that_are_absent_and_lights_that_are_none_differ(tmp_path):
    assert files.load(written(tmp_path, HEAD + "scene: []\n")).lights is None
    assert files.load(written(tmp_path, HEAD + "lights: []\nscene: []\n")).lights == ()


def test_json_is_read_by_the_same_code(tmp_path):
    text = '{"rayscope":1,"name":"\\ud83d\\ude00 \\/ \\"q\\"",\n\t"scene":[{"sphere":{"center":[0,-0.0,1E-3],"radius":1e+2}}]}'
    scene = files.load(written(tmp_path, text, "s.json"))
    assert scene.name == '😀 / "q"' and scene.objects[0].shape == Sphere(center=(0, 0, 0.001), radius=100)


def test_an_alias_is_a_short_way_to_say_a_thing_again(tmp_path):
    scene = files.load(written(tmp_path, HEAD + "scene:\n  - &a\n    sphere: {center: [0, 0, 0], radius: 1}\n  - *a\n"))
    assert scene.objects[0] == scene.objects[1]


# --- what is wrong, and where ---

WRONG = {
    "": "expected a scene, got an empty file",
    "\n  \n": "expected a scene, got an empty file",
    "# only a remark\n": "expected a mapping that begins with rayscope: 1, got nothing",
    "just words\n": "expected a mapping that begins with rayscope: 1, got 'just words'",
    b"\x00\x01\x02": "expected a text file, got a binary one (a zero byte at offset 0)",
    b"rayscope: 1\nname: caf\xe9\n": "line 2: expected text in UTF-8, got the byte 0xe9",
    "rayscope: 1\nname: ä\x07\n": "line 2: expected printable text, got the character U+0007",
    "scene: []\n": "rayscope: expected version 1 of the format, got nothing",
    "rayscope: 2\nscen: []\n": "line 1: rayscope: expected version 1 of the format, got 2",
    HEAD: "scene: expected a list of nodes, got nothing",
    HEAD + "scene:\n  - sphere: {center: [0, 0,":
        "line 4: expected YAML or JSON, but while parsing a flow node, did not find expected node content",
    HEAD + 'scene:\n  - name: "abc': "line 3: expected YAML or JSON, but while scanning a quoted scalar, found unexpected end of stream",
    HEAD + "scen: []\n": "line 2: scen: expected one of rayscope, camera, lights,",
    HEAD + "scene:\n  - shpere: {}\n": "line 3: scene[0].shpere: expected one of sphere, plane,",
    HEAD + "scene:\n  - sphere:\n      center: [0, 0, 0]\n      raduis: 1\n":
        "line 5: scene[0].sphere.raduis: expected one of center, radius, sides, got 'raduis' (did you mean 'radius'?)",
    HEAD + "scene:\n" + BALL + "  - sphere:\n      center: [0, 0, 0]\n":
        "line 5: scene[1].sphere.radius: expected a number greater than 0, got nothing",
    HEAD + "scene:\n" + BALL * 3 + "  - sphere:\n      center: [0, 0, 0]\n      radius: -2\n":
        "line 8: scene[3].sphere.radius: expected a number greater than 0, got -2",
    HEAD + "scene:\n  - sphere: {center: [0, 0, 0], radius: 0}\n":
        "line 3: scene[0].sphere.radius: expected a number greater than 0, got 0",
    HEAD + "scene:\n  - sphere: {center: [0, .nan, 0], radius: 1}\n":
        "line 3: scene[0].sphere.center: expected three finite numbers, got [0, nan, 0]",
    HEAD + "scene:\n  - sphere: {center: [0, 0, 0], radius: 1e999}\n":
        "line 3: scene[0].sphere.radius: expected a number greater than 0, got inf",
    HEAD + "scene:\n  - sphere: {center: middle, radius: 1}\n":
        "line 3: scene[0].sphere.center: expected three finite numbers, got 'middle'",
    HEAD + "scene: {a: 1}\n": "line 2: scene: expected a list of nodes, got {'a': 1}",
    HEAD + "scene:\n  - name: x\n": "line 3: scene[0]: expected exactly one of sphere,",
    HEAD + "scene:\n" + BALL + "    group: []\n": "line 3: scene[0]: expected exactly one of sphere,",
    HEAD + "scene:\n" + BALL + "    visible: yes\n": "line 4: scene[0].visible: expected true or false, got 'yes'",
    HEAD + "scene:\n" + BALL + "    material: gold\n":
        "line 4: scene[0].material: expected the name of a material: there are none, got 'gold'",
    HEAD + "scene:\n" + BALL + "    transform: [{matrix: [[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]\n":
        "line 4: scene[0].transform[0].matrix: expected an invertible matrix, got [[1.0,",
    HEAD + "scene:\n" + BALL + "    transform: [{scale: 0}]\n":
        "line 4: scene[0].transform[0].scale: expected three factors other than 0,",
    HEAD + "scene:\n" + BALL + "    transform: [{spin: 3}]\n":
        "line 4: scene[0].transform[0].spin: expected one of translate, rotate, scale, shear, matrix, got 'spin'",
    HEAD + "definitions:\n  a: {group: [{use: b}]}\n  b:\n    group:\n      - use: a\nscene: [{use: a}]\n":
        "line 6: definitions.b.group[0].use: expected definitions that do not use themselves, got 'a -> b -> a'",
    HEAD + "scene: " + "[{group: " * 1000 + "[]" + "}]" * 1000:
        "line 2: expected at most 500 mappings and lists inside one another, got more",
    HEAD + "scene: " + "[{group: " * 220 + "[]" + "}]" * 220:
        "line 2: scene[0].group[0].group[0].group[0].group[0].group[0].group[ ... ].group[0].group[0].group[0].group[0]",
    HEAD + "scene: " + "[" * 100_000: "line 2: expected at most 500 mappings and lists inside one another, got more",
    HEAD + "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(f"{b}: &{b} [{','.join(['*' + a] * 9)}]\n" for a, b in zip("abcdef", "bcdefg")):
        "line 8: expected aliases that stand for at most 1,000,000 values in all, got more",
    HEAD + "scene: &a [*a]\n": "line 2: expected an alias of something that is complete by then, got *a",
    HEAD + "name: a\nname: b\nscene: []\n": "line 3: expected each word once, got 'name' a second time",
    HEAD + "scene: !!python/object/apply:os.system [true]\n":
        "line 2: expected no tags, got tag:yaml.org,2002:python/object/apply:os.system",
    HEAD + "scene: []\n---\n" + HEAD: "line 3: expected one document, got a second one",
    HEAD + "? [a]\n: b\n": "line 2: expected a word before the colon, got a list or a mapping",
    HEAD + "camera: {lookfrom: [0, 0, 0], lookat: [0, 0, 0]}\nscene: []\n":
        "line 2: camera.lookat: expected a point other than lookfrom, got (0.0, 0.0, 0.0)",
    HEAD + "camera: {up: [0, 0, 1]}\nscene: []\n":
        "line 2: camera.up: expected a direction that is not parallel to the view, got (0.0, 0.0, 1.0)",
    HEAD + "camera:\n  fov: 180\nscene: []\n":
        "line 3: camera.fov: expected a number greater than 0 and less than 180, got 180",
    HEAD + "lights:\n  - pont: {position: [0, 0, 0]}\nscene: []\n":
        "line 3: lights[0].pont: expected one of point, directional, ambient, spherelight, "
        "rectanglelight, got 'pont' (did you mean 'point'?)",
    HEAD + "materials:\n  a.b[0]:\n    color: [2, 0, 0]\nscene: []\n":
        "line 4: materials.a.b[0].color: expected a colour whose parts are at least 0 and at most 1, got [2, 0, 0]",
    HEAD + "materials: {a: {checker: {size: 0}}}\nscene: []\n":
        "line 2: materials.a.checker.size: expected a number greater than 0, got 0",
    HEAD + "fog: {kind: thick}\nscene: []\n":
        "line 2: fog.kind: expected one of linear, exponential, exponential-squared, got 'thick'",
    HEAD + "scene:\n  - mesh: {vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces: [[0, 1, 2], [0, 1, 3]]}\n":
        "line 3: scene[0].mesh.faces[1]: expected indices less than the number of vertices, 3, got [0, 1, 3]",
    HEAD + "scene:\n  - mesh: {vertices: [[0, 0, 0]], faces: []}\n":
        "line 3: scene[0].mesh.faces: expected at least one face, got 0",
    HEAD + "scene:\n  - mesh: {vertices: [[0, 0, .inf]], faces: [[0, 0, 0]]}\n":
        "line 3: scene[0].mesh.vertices[0]: expected three finite numbers, got [0.0, 0.0, inf]",
    HEAD + "scene:\n  - mesh: {file: none.obj}\n": "line 3: scene[0].mesh.file: expected a mesh file, got ",
    HEAD + "scene:\n  - mesh: {file: s.yaml}\n": "line 3: scene[0].mesh.file: expected a mesh file, got ",
}


@pytest.mark.parametrize(("text", "said"), WRONG.items(), ids=range(len(WRONG)))
def test_what_is_wrong_is_said_in_one_line_with_its_place(tmp_path, text, said):
    start = time.perf_counter()
    assert refusal(written(tmp_path, text)).startswith(said)
    assert time.perf_counter() - start < 5


def test_every_scene_cut_short_anywhere_is_read_or_refused_in_one_line(tmp_path):
    text = (HEAD + "materials: {m: {color: [1, 1, 1]}}\nscene:\n" + BALL
            + "    material: m\n  - group:\n      - use: a\ndefinitions: {a: {group: []}}\n")
    assert len(files.load(written(tmp_path, text)).objects) == 2
    for end in range(len(text)):
        path = written(tmp_path, text[:end])
        try:
            files.load(path)
        except FileError as error:
            assert "\n" not in str(error)


def test_files_that_are_none_are_refused(tmp_path):
    assert refusal(tmp_path / "none.yaml") == "cannot be read: No such file or directory"
    (tmp_path / "folder.yaml").mkdir()
    assert refusal(tmp_path / "folder.yaml") == "expected a file, got a folder"
    assert refusal(written(tmp_path, "x", "s.txt")).startswith("expected a name that ends in one of .yaml, .yml, .json, .nff, .obj,")
    assert refusal(written(tmp_path, "x", "s.ymal")).endswith("got '.ymal' (did you mean '.yml'?)")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.yaml")
        assert refusal(tmp_path / "pipe.yaml") == "expected a file, got a device or a pipe"


def test_a_huge_file_is_refused_without_being_read(tmp_path):
    path = tmp_path / "s.yaml"
    with open(path, "wb") as file:
        file.truncate(100 * 10**6)
    start = time.perf_counter()
    assert refusal(path) == "expected a file of at most 64 MiB, got 95.4 MiB"
    assert time.perf_counter() - start < 1


def test_as_many_groups_as_a_scene_may_hold_are_saved_and_loaded(tmp_path):
    node = Node(shape=Sphere(center=(0, 0, 0), radius=1))
    for _ in range(MOST_NESTED - 1):
        node = Node(children=(node,))
    files.save(Scene(objects=(node,)), tmp_path / "s.yaml")
    assert files.load(tmp_path / "s.yaml").objects == (node,)


def test_thousands_of_nodes_load_in_no_time(tmp_path):
    rng = np.random.default_rng(1)
    scene = Scene(objects=tuple(Node(shape=Sphere(center=center, radius=0.1)) for center in rng.random((7381, 3)).tolist()))
    files.save(scene, tmp_path / "s.yaml")
    start = time.process_time()     # not disturbed by what else the machine does
    back = files.load(tmp_path / "s.yaml")
    assert time.process_time() - start < 1.5
    assert back == scene
