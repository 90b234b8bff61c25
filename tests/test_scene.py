"""The scene document: fields, transforms against independent formulas, and the DAG of nodes with its limits."""
import math
import time

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rtcore.fields import (Choice, Color, FieldError, Flag, Maybe, Number, Text, Vector, Vectors, fields_of, linear_from_srgb, shown,
                           srgb_from_linear)
from rtcore.lights import LIGHTS, Point
from rtcore.scene import (DEFAULT_MATERIAL, MOST_NESTED, TRANSFORMS, Background, Fog, Material, Matrix, Node, Rotate, Scale, Scene, Shear,
                          Translate, invertible)
from rtcore.shapes import SHAPES, Box, Cone, Cylinder, Mesh, Plane, Polygon, Sphere, Triangle

numbers = st.floats(-100, 100)
points = st.tuples(numbers, numbers, numbers)
BALL = Sphere(center=(0, 0, 0), radius=1)


def refusal(make, *args, **words) -> FieldError:
    """The FieldError that `make` raises; its message is one line."""
    with pytest.raises(FieldError) as caught:
        make(*args, **words)
    assert "\n" not in str(caught.value)
    return caught.value


# ---- fields

@pytest.mark.parametrize("value", [True, "1", b"1", None, [1], math.nan, math.inf, -math.inf, 10 ** 400, 1j, object()])
def test_what_is_no_finite_number_is_refused(value):
    assert refusal(Number().take, value).expected == "a finite number"


@pytest.mark.parametrize(("field", "good", "bad", "expected"), [
    (Number(above=0), 1e-300, 0, "a number greater than 0"),
    (Number(least=0), 0, -1e-300, "a number of at least 0"),
    (Number(above=0, below=180), 179.9, 180, "a number greater than 0 and less than 180"),
    (Number(least=0, most=1), 1, 1.0000001, "a number of at least 0 and of at most 1"),
    (Vector(), np.arange(3), (1, 2), "three finite numbers"),
    (Vector(), [1, 2, 3], "123", "three finite numbers"),
    (Vector(), (1, 2, 3), {1: 1, 2: 2, 3: 3}, "three finite numbers"),
    (Vector(), (1, 2, 3), (1, 2, math.nan), "three finite numbers"),
    (Vector(nonzero=True), (0, 0, 1e-300), (0, 0, 0), "a vector that is not zero"),
    (Color(), (0, 5, 0), (0, -0.1, 0), "a colour whose parts are at least 0"),
    (Color(most=1), "#ffffff", (0, 1.5, 0), "a colour whose parts are at least 0 and at most 1"),
    (Color(), "#aBcDeF", "#12345", 'a colour: three numbers or "#rrggbb"'),
    (Color(), "#000000", "000000f", 'a colour: three numbers or "#rrggbb"'),
    (Color(), "#000000", "#+12345", 'a colour: three numbers or "#rrggbb"'),
    (Color(), (0, 0, 0), "red", 'a colour: three numbers or "#rrggbb"'),
    (Choice(words=("a", "b")), "b", "c", "one of a, b"),
    (Flag(), False, 0, "true or false"),
    (Text(), "", 5, "a text"),
    (Vectors(least=3), np.eye(3), np.eye(3)[:2], "a list of at least 3 points"),
    (Maybe(inner=Number(above=0)), None, 0, "a number greater than 0"),
])
def test_a_field_takes_what_it_may_hold_and_names_what_it_expected(field, good, bad, expected):
    field.take(good)
    assert refusal(field.take, bad).expected == expected


def test_fields_are_stored_as_plain_floats():
    ball = Sphere(center=np.arange(3), radius=np.float32(2))
    assert ball.center == (0.0, 1.0, 2.0) and {type(part) for part in (*ball.center, ball.radius)} == {float}


def test_an_error_knows_its_path_and_stays_short():
    error = refusal(Sphere, center=(0, 0, 0), radius=-2).inside("sphere").inside("[3]").inside("scene")
    assert str(error) == "scene[3].sphere.radius: expected a number greater than 0, got -2"
    assert str(refusal(Polygon, vertices=[(0, 0, 0), (1, 0)])) == "vertices[1]: expected three finite numbers, got (1, 0)"
    assert len(shown("x" * 1000)) == 60 and "\n" not in shown({"a\n": "b"})


@given(st.floats(0, 1))
def test_the_srgb_curve_and_its_inverse_meet(value):
    assert math.isclose(linear_from_srgb(srgb_from_linear(value)), value, abs_tol=1e-7)


def test_srgb_at_known_points():
    assert Color().take("#ffffff") == (1, 1, 1) and Color().take("#000000") == (0, 0, 0)
    assert Color().take("#808080")[0] == pytest.approx(0.2158605, abs=1e-7)      # mid grey, a figure found in every table
    assert (srgb_from_linear(-1), srgb_from_linear(7)) == pytest.approx((0, 1), abs=1e-15)


@pytest.mark.parametrize("record", [*SHAPES, *LIGHTS, *TRANSFORMS, Material, Fog, Background])
def test_every_field_of_a_record_has_a_line_of_help(record):
    for name, field in fields_of(record).items():
        assert (field.help or getattr(field, "inner", field).help) and "\n" not in field.help, f"{record.__name__}.{name}"


@pytest.mark.parametrize(("make", "words", "path"), [
    (Sphere, {"center": (0, 0, 0), "radius": 0}, "radius"),
    (Plane, {"point": (0, 0, 0), "normal": (0, 0, 0)}, "normal"),
    (Box, {"low": (0, 0, 0), "high": (1, 0, 1)}, "high"),
    (Cylinder, {"base": (0, 0, 0), "apex": (0, 0, 0), "radius": 1}, "apex"),
    (Cone, {"base": (0, 0, 0), "base_radius": 0, "apex": (0, 1, 0)}, "base_radius"),
    (Cone, {"base": (0, 0, 0), "base_radius": 1, "apex": (0, 1, 0), "apex_radius": -1}, "apex_radius"),
    (Triangle, {"a": (0, 0, 0), "b": (1, 0, 0), "c": (0, 1, 0), "normals": [(0, 0, 1)] * 4}, "normals"),
    (Polygon, {"vertices": [(0, 0, 0), (1, 0, 0)]}, "vertices"),
    (Mesh, {"vertices": np.eye(3), "faces": [[0, 1, 3]]}, "faces[0]"),
    (Mesh, {"vertices": np.eye(3), "faces": [[0, 1, -1]]}, "faces"),
    (Mesh, {"vertices": np.eye(3), "faces": []}, "faces"),
    (Mesh, {"vertices": np.eye(3), "faces": [[0.0, 1.0, 2.0]]}, "faces"),
    (Mesh, {"vertices": [[0, 0, 0], [1, math.nan, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}, "vertices[1]"),
    (Mesh, {"vertices": np.eye(3), "faces": [[0, 1, 2]], "normals": np.eye(3)[:2]}, "normals"),
    (Point, {"position": (0, 0, 0), "falloff": "cubic"}, "falloff"),
    (Sphere, {"center": (0, 0, 0), "radius": 1, "sides": "inside"}, "sides"),
    (Fog, {"start": 5, "end": 5}, "end"),
    (Fog, {"density": -1}, "density"),
    (Material, {"color": (1, 1, 2)}, "color"),
    (Material, {"transmission": 1.5}, "transmission"),
    (Material, {"ior": 0}, "ior"),
])
def test_bad_records_are_refused_at_the_field(make, words, path):
    assert refusal(make, **words).path == path


def test_a_meshs_arrays_cannot_be_changed_behind_its_back():
    vertices = np.eye(3)
    mesh = Mesh(vertices=vertices, faces=[[0, 1, 2]])
    vertices[0] = 7
    assert np.array_equal(mesh.vertices, np.eye(3))
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 7


# ---- transforms

@given(points, st.floats(-1000, 1000), points)
def test_rotation_fixes_its_axis_and_turns_the_rest_counter_clockwise(axis, angle, point):
    assume(np.linalg.norm(axis) > 1e-3)
    m = Rotate(axis=axis, angle=angle).matrix()
    axis = np.array(axis) / np.linalg.norm(axis)
    point = point - (axis @ point) * axis
    turned = m[:3, :3] @ point
    size = point @ point
    assert np.allclose(m[:3, :3] @ axis, axis, atol=1e-9)
    assert math.isclose(point @ turned, size * math.cos(math.radians(angle)), abs_tol=1e-9 * (1 + size))
    assert math.isclose(np.cross(point, turned) @ axis, size * math.sin(math.radians(angle)), abs_tol=1e-9 * (1 + size))
    assert np.array_equal(m[3], [0, 0, 0, 1]) and not m[:3, 3].any()


@pytest.mark.parametrize("turns", [-5, -1, 0, 1, 2, 3, 4, 1_000_001])
@pytest.mark.parametrize("axis", range(3))
def test_quarter_turns_are_exact(axis, turns):
    one, two = (axis + 1) % 3, (axis + 2) % 3
    m = Rotate(axis=np.eye(3)[axis] * 3, angle=90.0 * turns).matrix()[:3, :3]
    c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][turns % 4]
    expected = np.zeros((3, 3))
    expected[axis, axis] = 1
    expected[[one, two], [one, two]] = c
    expected[two, one], expected[one, two] = s, -s
    assert np.array_equal(m, expected)


@given(points, points, st.tuples(*[numbers] * 6))
def test_translate_scale_and_shear_by_their_formulas(point, offset, by):
    x, y, z = point
    moved = Translate(offset=offset).matrix() @ [x, y, z, 1]
    assert np.allclose(moved, [x + offset[0], y + offset[1], z + offset[2], 1])
    if all(offset):
        assert np.allclose(Scale(factors=offset).matrix() @ [x, y, z, 1], [x * offset[0], y * offset[1], z * offset[2], 1])
    names = ("xy", "xz", "yx", "yz", "zx", "zy")
    try:
        shear = Shear(**dict(zip(names, by)))
    except FieldError:
        return      # a shear that flattens space is refused; its own test follows
    xy, xz, yx, yz, zx, zy = by
    assert np.allclose(shear.matrix() @ [x, y, z, 1], [x + xy * y + xz * z, yx * x + y + yz * z, zx * x + zy * y + z, 1])


def test_transforms_apply_in_the_order_of_the_list():
    node = Node(shape=BALL, transform=[Translate(offset=(1, 0, 0)), Rotate(axis=(0, 0, 1), angle=90), Scale(factors=(2, 3, 4))])
    assert np.array_equal(node.matrix() @ [0, 0, 0, 1], [0, 3, 0, 1])       # to (1, 0, 0), turned to (0, 1, 0), stretched to (0, 3, 0)


@given(st.lists(st.one_of(st.builds(Translate, offset=points), st.builds(Rotate, axis=st.just((1, 2, 3)), angle=st.floats(-360, 360)),
                          st.builds(Scale, factors=st.tuples(*[st.floats(0.1, 10)] * 3))), max_size=5))
def test_the_inverse_undoes_any_list_of_transforms(transform):
    m = Node(shape=BALL, transform=transform).matrix()
    size = np.abs(m).max()
    assert np.allclose(invertible(m) @ m, np.eye(4), atol=1e-6 * size)


@pytest.mark.parametrize("scale", [1e-200, 1e-9, 1.0, 1e200])
def test_a_tiny_or_huge_scale_is_not_singular(scale):
    m = Node(shape=BALL, transform=[Rotate(axis=(1, 1, 0), angle=30), Scale(factors=(scale, -scale, scale))]).matrix()
    inverse = invertible(m)
    assert np.allclose((inverse * scale)[:3, :3] @ (m / scale)[:3, :3], np.eye(3))


def test_thin_slabs_are_not_singular():
    assert invertible(np.diag([1, 1e-12, 1, 1]))[1, 1] == pytest.approx(1e12)


@pytest.mark.parametrize(("make", "words"), [
    (Scale, {"factors": (1, 0, 1)}),
    (Shear, {"xy": 1, "yx": 1}),
    (Matrix, {"rows": [[1, 2, 3, 0], [2, 4, 6, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}),
    (Matrix, {"rows": [[0] * 4] * 3 + [[0, 0, 0, 1]]}),
    (Matrix, {"rows": np.eye(3)}),
    (Matrix, {"rows": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, math.nan, 0], [0, 0, 0, 1]]}),
    (Matrix, {"rows": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]]}),
    (Matrix, {"rows": "identity"}),
    (Rotate, {"axis": (0, 0, 0), "angle": 3}),
    (Translate, {"offset": (0, 0, math.inf)}),
])
def test_transforms_that_cannot_be_undone_are_refused(make, words):
    refusal(make, **words)


# ---- the DAG

def pawn_scene(**words):
    pawn = Node(children=[BALL, Node(shape=Box(low=(-1, -3, -1), high=(1, -1, 1)), transform=[Translate(offset=(0, 1, 0))])])
    return Scene(definitions={"pawn": pawn, "row": Node(children=[
        Node(use="pawn", transform=[Translate(offset=(10.0 * i, 0, 0))]) for i in range(3)])}, **words)


def test_uses_are_written_out_with_their_transforms_composed():
    scene = pawn_scene(objects=[Node(use="row"), Node(use="row", transform=[Scale(factors=(1, 1, 2)), Translate(offset=(0, 0, 5))])])
    leaves = list(scene.leaves())
    assert len(leaves) == 12 and len({leaf.path for leaf in leaves}) == 12
    assert len({id(leaf.shape) for leaf in leaves}) == 2        # shared, not copied
    m = leaves[11].matrix       # the box of the third pawn of the second row
    assert np.array_equal(m @ [1, 2, 3, 1], [21, 3, 11, 1])
    by_path = leaves[11].path
    assert by_path == (1, 0, 2, 0, 1)


def test_bare_shapes_become_nodes():
    assert [leaf.shape for leaf in Scene(objects=[BALL, Node(shape=BALL)]).leaves()] == [BALL, BALL]


def test_materials_and_visibility_come_down_from_the_parent():
    red, blue = Material(color=(1, 0, 0)), Material(color=(0, 0, 1))
    scene = Scene(materials={"blue": blue}, definitions={"ball": Node(shape=BALL), "own": Node(shape=BALL, material="blue")}, objects=[
        BALL,
        Node(material=red, children=[BALL, Node(shape=BALL, material="blue"), Node(use="ball"), Node(use="own")]),
        Node(visible=False, children=[Node(shape=BALL, visible=True)]),
        Node(use="ball", visible=False, material="blue"),
    ])
    leaves = list(scene.leaves())
    assert [leaf.material for leaf in leaves] == [DEFAULT_MATERIAL, red, blue, red, blue, DEFAULT_MATERIAL, blue]
    assert [leaf.visible for leaf in leaves] == [True] * 5 + [False] * 2


def test_an_edit_shares_what_it_did_not_touch():
    scene = pawn_scene(objects=[Node(use="row"), BALL])
    edited = msgspec.structs.replace(scene, fog=Fog())
    assert edited.objects[0] is scene.objects[0] and edited.definitions["row"] is scene.definitions["row"]
    with pytest.raises(AttributeError):
        scene.fog = None


@pytest.mark.parametrize(("words", "path", "expected"), [
    ({"objects": [Node(use="knight")]}, "scene[0].use", "the name of a definition: pawn, row"),
    ({"objects": [Node(children=[BALL, Node(shape=BALL, material="gold")])]}, "scene[0].group[1].material", "the name of a material"),
    ({"objects": [3]}, "objects[0]", "a node or a shape"),
    ({"camera": 5}, "camera", "a camera"),
    ({"lights": [BALL]}, "lights[0]", "a light"),
    ({"fog": "thick"}, "fog", "a fog"),
])
def test_what_does_not_belong_into_a_scene_is_refused(words, path, expected):
    error = refusal(pawn_scene, **words)
    assert error.path == path and expected in error.expected


@pytest.mark.parametrize("words", [{}, {"shape": BALL, "use": "pawn"}, {"shape": BALL, "children": []}, {"shape": "ball"},
                                   {"shape": BALL, "transform": [5]}, {"shape": BALL, "material": 5}, {"shape": BALL, "name": 5}])
def test_a_node_is_exactly_one_thing(words):
    refusal(Node, **words)


@pytest.mark.parametrize("chain", [["a"], ["a", "b"], ["a", "b", "c"]])
@pytest.mark.parametrize("used", [True, False])
def test_cycles_are_refused_even_where_nothing_uses_them(chain, used):
    ring = {name: Node(children=[BALL, Node(use=after)]) for name, after in zip(chain, [*chain[1:], chain[0]])}
    error = refusal(Scene, definitions=ring, objects=[Node(use="a")] if used else [])
    assert error.expected == "definitions that do not use themselves"
    assert error.got == " -> ".join([*chain, "a"])


def nest(node: Node, levels: int) -> Node:
    for _ in range(levels):
        node = Node(children=[node])
    return node


def test_a_thousand_nested_groups_are_refused_and_a_hundred_are_fine():
    assert len(list(Scene(objects=[nest(Node(shape=BALL), 100)]).leaves())) == 1
    assert f"at most {MOST_NESTED} groups" in refusal(Scene, objects=[nest(Node(shape=BALL), 1000)]).expected


def test_nesting_is_counted_through_uses():
    deep = {"d0": Node(shape=BALL)} | {f"d{i}": nest(Node(use=f"d{i - 1}"), 30) for i in range(1, 30)}
    assert len(list(Scene(definitions=dict(list(deep.items())[:6]), objects=[Node(use="d5")]).leaves())) == 1
    assert f"at most {MOST_NESTED} groups" in refusal(Scene, definitions=deep, objects=[Node(use="d29")]).expected
    assert f"at most {MOST_NESTED} groups" in refusal(Scene, definitions=deep).expected


def doubling(bottom: Node, levels: int) -> dict[str, Node]:
    return {"d0": bottom} | {f"d{i}": Node(children=[Node(use=f"d{i - 1}")] * 10) for i in range(1, levels + 1)}


@pytest.mark.parametrize("bottom", [Node(shape=BALL), Node(children=[])])
def test_an_exponential_dag_is_refused_at_once(bottom):
    started = time.perf_counter()
    error = refusal(Scene, definitions=doubling(bottom, 40), objects=[Node(use="d40")])
    assert "at most 4,000,000" in error.expected
    assert time.perf_counter() - started < 2
