"""Paths to nodes, edits through definitions, and leaf indices against the scene's own list."""
import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.places import Leaves, Place, definition_around, label_of, node_at, record_at, with_node, with_record
from rtcore.scene import Node, Scene
from rtcore.shapes import Sphere

BALL = Node(shape=Sphere((0, 0, 0), 1))


def test_leaf_indices_and_paths_are_those_of_the_scene(scene):
    leaves = Leaves(scene)
    for index, leaf in enumerate(scene.leaves()):
        assert leaves.path(index) == leaf.path
        assert leaves.span(leaf.path) == (index, index + 1)
        assert node_at(scene, leaf.path).shape is leaf.shape
    assert leaves.path(-1) is None and leaves.path(len(list(scene.leaves()))) is None


nodes = st.recursive(st.just(BALL) | st.just(Node(use="d")),
                     lambda inner: st.lists(inner, max_size=4).map(lambda c: Node(children=tuple(c))))


@given(st.lists(nodes, max_size=5), st.lists(st.just(BALL), max_size=3))
def test_leaf_indices_hold_for_any_tree(objects, definition):
    scene = Scene(objects=tuple(objects), definitions={"d": Node(children=tuple(definition))})
    leaves, paths = Leaves(scene), [leaf.path for leaf in scene.leaves()]
    assert [leaves.path(i) for i in range(len(paths))] == paths
    for i in range(len(objects)):
        first, last = leaves.span((i,))
        assert [p for p in paths if p[0] == i] == paths[first:last]


def test_replacing_a_node_shares_the_others(scene):
    new = with_node(scene, (2, 1), msgspec.structs.replace(node_at(scene, (2, 1)), name="other"))
    assert node_at(new, (2, 1)).name == "other" and node_at(scene, (2, 1)).name == "right"
    assert new.objects[1] is scene.objects[1] and node_at(new, (2, 0)) is node_at(scene, (2, 0))


def test_an_edit_behind_a_use_changes_the_definition(scene):
    assert definition_around(scene, (3,)) is None and definition_around(scene, (3, 0, 1)) == "pawn"
    hidden = msgspec.structs.replace(node_at(scene, (3, 0, 1)), visible=False)
    new = with_node(scene, (3, 0, 1), hidden)
    assert not node_at(new, (4, 0, 1)).visible
    assert all(a is b for a, b in zip(new.objects, scene.objects))
    moved = with_node(scene, (3, 0), msgspec.structs.replace(node_at(scene, (3, 0)), name="all of it"))
    assert moved.definitions["pawn"].name == "all of it"


@pytest.mark.parametrize("place", [Place("light", 0), Place("material", "floor"), Place("background"), Place("node", (1,))])
def test_records_are_replaced_where_they_stand(scene, place):
    record = record_at(scene, place)
    change = {"color": (0.25, 0.5, 0.75)} if hasattr(record, "color") else {"note": "x"}
    new = msgspec.structs.replace(record, **change)
    assert record_at(with_record(scene, place, new), place) == new
    assert record_at(scene, place) == record


def test_places_that_are_not_there(scene):
    assert record_at(scene, Place("node", (9,))) is None and record_at(scene, Place("node", (2, 7))) is None
    assert record_at(scene, Place("light", 5)) is None and record_at(scene, Place("material", "none")) is None


def test_an_edited_studio_light_becomes_the_scenes_own(scene):
    bare = msgspec.structs.replace(scene, lights=None)
    place = Place("light", 0)
    new = with_record(bare, place, msgspec.structs.replace(record_at(bare, place), on=False))
    assert len(new.lights) == 2 and not new.lights[0].on


def test_labels(scene):
    assert label_of(scene, Place("node", (1,))) == "red ball"
    assert label_of(Scene(objects=(BALL, Node(use="d")), definitions={"d": BALL}), Place("node", (0,))) == "Sphere 1"
    assert label_of(scene, Place("light", 0)) == "Point 1"
