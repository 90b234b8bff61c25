"""Undo and redo, what counts as modified, and the history of views."""
import msgspec
import pytest

from app.document import Document
from app.history import ViewHistory
from rtcore.camera import orbit
from rtcore.scene import Scene


def renamed(scene: Scene, name: str) -> Scene:
    return msgspec.structs.replace(scene, name=name)


@pytest.fixture
def document(qapp, scene):
    document = Document()
    document.open(scene, None)
    return document


def test_undo_and_redo_walk_the_steps(document, scene):
    document.edit(renamed(scene, "a"), "to a")
    document.edit(renamed(scene, "b"), "to b")
    assert (document.undo_label, document.redo_label) == ("to b", None)
    document.undo()
    assert (document.scene.name, document.undo_label, document.redo_label) == ("a", "to a", "to b")
    document.undo()
    assert document.scene is scene
    document.undo()
    assert document.scene is scene
    document.redo()
    document.redo()
    document.redo()
    assert document.scene.name == "b"


def test_an_edit_after_undo_forgets_what_was_undone(document, scene):
    document.edit(renamed(scene, "a"), "to a")
    document.undo()
    document.edit(renamed(scene, "b"), "to b")
    assert document.redo_label is None and document.scene.name == "b"


def test_the_steps_of_a_drag_are_one(document, scene):
    for name in "abc":
        document.edit(renamed(scene, name), "drag", merge="drag")
    document.undo()
    assert document.scene is scene


def test_after_seal_a_drag_is_a_step_of_its_own(document, scene):
    document.edit(renamed(scene, "a"), "drag", merge="drag")
    document.seal()
    document.edit(renamed(scene, "b"), "drag", merge="drag")
    document.undo()
    assert document.scene.name == "a"


def test_a_drag_after_undo_does_not_merge_with_what_came_before(document, scene):
    document.edit(renamed(scene, "a"), "drag", merge="drag")
    document.edit(renamed(scene, "b"), "other")
    document.undo()
    document.edit(renamed(scene, "c"), "drag", merge="drag")
    document.undo()
    assert document.scene.name == "a"


def test_modified_goes_by_the_saved_scene(document, scene, tmp_path):
    assert not document.modified
    document.edit(renamed(scene, "a"), "to a")
    assert document.modified
    document.undo()
    assert not document.modified
    document.redo()
    document.saved(document.scene, tmp_path / "a.yaml")
    assert not document.modified and document.path == tmp_path / "a.yaml"
    document.undo()
    assert document.modified


def test_an_edit_during_a_save_stays_unsaved(document, scene, tmp_path):
    written = document.scene
    document.edit(renamed(scene, "a"), "to a")
    document.saved(written, tmp_path / "a.yaml")
    assert document.modified


def test_views_go_back_and_forward_and_a_gesture_is_one_step(scene):
    views, start = ViewHistory(), scene.camera
    views.start(start)
    camera = start
    for _ in range(5):
        camera = orbit(camera, 0.1, 0)
        views.visit(camera, gesture=1)
    turned = camera
    views.visit(orbit(camera, 0.1, 0), gesture=2)
    assert views.can_back and not views.can_forward
    assert views.back() == turned
    assert views.back() == start
    assert not views.can_back and views.back() == start
    assert views.forward() == turned
    views.visit(orbit(turned, 0, 0.3), gesture=2)
    assert not views.can_forward
    assert views.back() == turned
