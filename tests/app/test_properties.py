"""The property editor keeps its forms: what is of one structure is shown in the same ones, and no edit goes to the wrong thing."""
import gc
import weakref

import pytest
from PySide6.QtCore import Qt

from app.garbage import settle
from app.panels.properties import KEPT
from app.places import Place, node_at
from app.theme import LIGHT
from rtcore import Box, Material, Node, Plane, Polygon, Scene, Sphere, Translate

SCENE = Scene(objects=[
    Node(name="left", shape=Sphere((-1, 0, 0), 0.5), material=Material(color=(1, 0, 0))),
    Node(name="right", shape=Sphere((1, 0, 0), 0.75), material=Material(color=(0, 0, 1))),
    Node(name="moved", shape=Sphere((0, 0, 0), 1), transform=[Translate((0, 1, 0))]),
    Node(name="floor", shape=Plane((0, -1, 0), (0, 1, 0))),
    Node(name="crate", shape=Box((0, 0, 0), (1, 1, 1)))])


@pytest.fixture
def panel(window, session):
    session.document.open(SCENE, None)
    window.docks["Properties"].raise_()
    return window.panels["Properties"]


def shown(panel, session, number: int) -> dict:
    session.select(Place("node", (number,)))
    panel.complete()
    return panel.forms


def test_things_of_one_structure_share_their_forms(panel, session, qtbot):
    left = shown(panel, session, 0)
    radius = left["shape"].editors["radius"].entries[0]
    assert (radius.text(), left["node"].editors["name"].entry.text()) == ("0.5", "left")
    assert shown(panel, session, 1) is left and (radius.text(), left["node"].editors["name"].entry.text()) == ("0.75", "right")
    assert shown(panel, session, 3) is not left and shown(panel, session, 2) is not left
    assert shown(panel, session, 0) is left and radius.text() == "0.5"
    assert [body.isHidden() for body in panel._bodies.values()] == [True] * (len(panel._bodies) - 1) + [False]
    qtbot.waitUntil(radius.isVisible)


def test_lists_of_another_length_have_forms_of_their_own(panel, session):
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    session.document.open(Scene(objects=[Node(name=str(n), shape=Polygon(corners[:n])) for n in (3, 4)]), None)
    three = shown(panel, session, 0)
    assert len(three["shape"].editors["vertices"].entries) == 9
    assert len(shown(panel, session, 1)["shape"].editors["vertices"].entries) == 12 and shown(panel, session, 0) is three


def test_an_edit_goes_to_what_is_selected(panel, session, qtbot):
    shown(panel, session, 0)
    forms = shown(panel, session, 1)
    entry = forms["shape"].editors["radius"].entries[0]
    entry.selectAll()
    qtbot.keyClicks(entry, "2")
    qtbot.keyClick(entry, Qt.Key.Key_Return)
    assert [node_at(session.scene, (i,)).shape.radius for i in (0, 1)] == [0.5, 2.0] and session.document.undo_label == "right: radius"
    session.document.undo()
    assert entry.text() == "0.75" and shown(panel, session, 0) is forms and entry.text() == "0.5"


def test_what_is_being_typed_belongs_to_what_was_selected(panel, session, window, qtbot):
    window.activateWindow()
    entry = shown(panel, session, 0)["shape"].editors["radius"].entries[0]
    entry.setFocus()
    qtbot.waitUntil(entry.hasFocus)
    entry.selectAll()
    qtbot.keyClicks(entry, "3")
    assert session.scene is SCENE
    shown(panel, session, 1)
    assert [node_at(session.scene, (i,)).shape.radius for i in (0, 1)] == [3.0, 0.75] and entry.text() == "0.75"
    entry.setFocus()
    entry.selectAll()
    qtbot.keyClicks(entry, "-1")     # refused: it is dropped
    shown(panel, session, 0)
    assert entry.text() == "3" and not entry.property("refused") and node_at(session.scene, (1,)).shape.radius == 0.75


def test_few_bodies_are_kept_and_those_taken_down_stop_nothing(panel, session, qtbot):
    for count in range(KEPT + 3):
        objects = [Node(name="a", shape=Sphere((0, 0, 0), 1), transform=[Translate((0, 0, 0))] * count)]
        session.document.open(Scene(objects=objects), None)
        session.select(Place("node", (0,)))
        if count < KEPT + 2:
            panel.complete()
    qtbot.waitUntil(lambda: len(panel.forms) == count + 2 and panel.widget().updatesEnabled())      # built on between events
    assert len(panel._bodies) == KEPT and f"transform {count - 1}" in panel.forms


def test_a_body_left_in_the_midst_of_building_is_gone_on_with(panel, session, qtbot, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("app.panels.properties.SLICE", 0.0)       # no row comes at once
        session.select(Place("node", (0,)))
        first = panel.forms
        session.select(Place("node", (3,)))
    assert not first
    session.select(Place("node", (0,)))
    qtbot.waitUntil(lambda: {"node", "shape", "material"} <= set(panel.forms) and panel.widget().updatesEnabled())
    assert panel.forms is first


def test_a_change_of_theme_makes_them_anew(panel, session, window, qtbot):
    first = shown(panel, session, 0)
    panel.dress(LIGHT)
    panel.complete()
    assert panel.forms is not first and panel.forms["shape"].editors["radius"].entries[0].text() == "0.5"
    assert len(panel._bodies) == 1


def test_a_body_taken_down_leaves_nothing_though_it_was_set_aside(panel, session, qtbot):
    """Whatever the garbage collector has set aside it never looks through again: forms must go without it."""
    held = []
    for number in range(5):
        shown(panel, session, number)
        held += [weakref.ref(one) for form in panel.forms.values() for one in (form, *form.editors.values(), *form.bindings.values())]
    held += [weakref.ref(body) for body in panel._bodies.values()]
    session.select(None)
    try:
        settle()
        gc.disable()
        panel.dress(LIGHT)
        qtbot.waitUntil(lambda: not any(one() for one in held))
    finally:
        gc.unfreeze()
        gc.enable()
