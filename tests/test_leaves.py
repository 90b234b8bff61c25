"""Leaves of a scene after an edit: as a walk from the start finds them, and the very same objects where nothing has changed."""
import msgspec
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rtcore.latest import leaves_of
from rtcore.leaves import same_place
from rtcore.scene import Material, Node, Scene, Translate
from rtcore.shapes import Sphere

SHAPES = [Sphere(center=(0, 0, 0), radius=1.0 + i) for i in range(3)]
MATERIALS = [Material(color=(0.1 * i, 0.2, 0.3)) for i in range(3)]
DEFINED, NAMED = ("d0", "d1"), ("m0", "m1")
looks = st.sampled_from([None, *NAMED, *MATERIALS])
moves = st.sampled_from([(), (Translate(offset=(1, 0, 0)),), (Translate(offset=(0, 2, 0)), Translate(offset=(1, 0, 0)))])


def nodes_of(leaf):
    """Nodes over these, with what a node can have."""
    return st.builds(lambda what, material, transform, visible: Node(material=material, transform=transform, visible=visible, **what),
                     leaf, looks, moves, st.booleans())


balls = nodes_of(st.sampled_from([{"shape": shape} for shape in SHAPES]))
trees = st.recursive(balls, lambda below: nodes_of(st.lists(below, max_size=4).map(lambda nodes: {"children": tuple(nodes)})), max_leaves=8)
uses = nodes_of(st.sampled_from([{"use": name} for name in DEFINED]))
scenes = st.builds(lambda objects, defined, named: Scene(objects=tuple(objects), definitions=dict(zip(DEFINED, defined)),
                                                         materials=dict(zip(NAMED, named))),
                   st.lists(trees | uses, max_size=5), st.tuples(trees, trees), st.tuples(*[st.sampled_from(MATERIALS)] * 2))


def changed(nodes, draw):
    """The nodes with some of them otherwise, fewer or more; the rest shared."""
    result = []
    for node in nodes:
        what = draw(st.sampled_from(["keep"] * 4 + ["drop", "double", "look", "move", "hide", "below", "below"]))
        if what == "look":
            node = msgspec.structs.replace(node, material=draw(looks))
        elif what == "move":
            node = msgspec.structs.replace(node, transform=draw(moves))
        elif what == "hide":
            node = msgspec.structs.replace(node, visible=not node.visible)
        elif what == "below" and node.children:
            node = msgspec.structs.replace(node, children=changed(node.children, draw))
        result += [node] * {"drop": 0, "double": 2}.get(what, 1)
    return tuple(result)


def told(leaf):
    """A leaf as values that can be compared."""
    return leaf.path, id(leaf.shape), leaf.matrix.tobytes(), id(leaf.material), leaf.visible


@settings(max_examples=300)
@given(scenes, st.data())
def test_after_edits_the_leaves_are_those_of_a_walk_from_the_start(scene, data):
    before = leaves_of(scene)
    for _ in range(3):
        what = data.draw(st.sampled_from(["objects", "definitions", "materials"]))
        if what == "objects":
            value = changed(scene.objects, data.draw)
        elif what == "definitions":
            value = dict(zip(DEFINED, changed(tuple(scene.definitions.values()), data.draw)))
            value = {**scene.definitions, **value}
        else:
            value = {**scene.materials, "m0": data.draw(st.sampled_from(MATERIALS))}
        scene = msgspec.structs.replace(scene, **{what: value})
        after = leaves_of(scene)
        assert list(map(told, after)) == list(map(told, scene.leaves()))
        for a, b in zip(before, after):     # what is as it was is the very same leaf
            assert (a is b) or told(a) != told(b)
        before = after


def test_a_picture_of_thousands_of_shapes_learns_at_once_which_has_changed():
    """Only the edited shape is walked to: no matrix is multiplied, no other leaf made."""
    many = tuple(Node(shape=SHAPES[0], transform=[Translate(offset=(i, 0, 0))]) for i in range(2000))
    scene = Scene(objects=[Node(children=many, transform=[Translate(offset=(0, 1, 0))]), SHAPES[1]])
    before = leaves_of(scene)
    edited = (*many[:700], msgspec.structs.replace(many[700], material=MATERIALS[1]), *many[701:])
    group = msgspec.structs.replace(scene.objects[0], children=edited)
    after = leaves_of(msgspec.structs.replace(scene, objects=(group, scene.objects[1])))
    assert [i for i, (a, b) in enumerate(zip(before, after)) if a is not b] == [700]
    assert after[700].material is MATERIALS[1] and same_place(before[700], after[700])


def test_a_named_material_changes_its_leaves_alone_and_moves_none():
    scene = Scene(materials={"m0": MATERIALS[0], "m1": MATERIALS[1]}, objects=[
        Node(material=name, transform=[Translate(offset=(1, 2, 3))], children=[SHAPES[0], Node(shape=SHAPES[1], transform=moved)])
        for name in NAMED for moved in ((), (Translate(offset=(4, 5, 6)),))])
    before = leaves_of(scene)
    after = leaves_of(msgspec.structs.replace(scene, materials={**scene.materials, "m1": MATERIALS[2]}))
    assert [a is b for a, b in zip(before, after)] == [True] * 4 + [False] * 4
    assert all(a.matrix is b.matrix for a, b in zip(before, after))


@pytest.mark.parametrize("edit", [{"name": "other"}, {"lights": ()}])
def test_what_does_not_concern_shapes_leaves_the_very_same_tuple(edit):
    scene = Scene(objects=SHAPES)
    assert leaves_of(scene) is leaves_of(msgspec.structs.replace(scene, **edit))
    assert np.array_equal(leaves_of(scene)[0].matrix, np.eye(4))
