"""The window: mouse, switches, drops, closing, full screen, themes, accessibility."""
from pathlib import Path

import msgspec
import pytest
from PySide6.QtCore import QEvent, QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent, QMouseEvent, QWheelEvent
from PySide6.QtWidgets import (QApplication, QCheckBox, QComboBox, QDockWidget, QFileDialog, QLineEdit, QMessageBox, QPushButton,
                               QSlider, QTabBar, QToolButton)

import rtcore
from app import dialogs
from app.engine import Job
from app.gallery import GALLERY
from app.options import Options
from app.places import Place
from rtcore.fields import FieldError


def test_the_mouse_in_the_picture_orbits_pans_and_dollies(window, session, qtbot, settled):
    view, start = window.viewport, session.camera
    middle = view.rect().center()
    left, middle_, none, shift = Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton, Qt.KeyboardModifier.NoModifier, \
        Qt.KeyboardModifier.ShiftModifier
    for button, keys in ((left, none), (left, shift), (middle_, none)):
        before = session.camera
        qtbot.mousePress(view, button, keys, middle)
        for step in range(1, 6):
            send_move(view, middle + QPoint(12 * step, 5 * step), button, keys)
        qtbot.mouseRelease(view, button, keys, middle + QPoint(60, 25))
        assert session.camera != before
        assert (session.camera.lookat != before.lookat) == (button == middle_ or keys == shift)     # panned, not orbited
    for _ in range(3):
        session.back()      # three gestures, three steps
    assert session.camera == start
    settled(session)
    position = QPointF(middle)
    QApplication.sendEvent(view, QWheelEvent(position, view.mapToGlobal(position), QPoint(), QPoint(0, 120), Qt.MouseButton.NoButton,
                                             Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False))
    assert session.camera.distance() < start.distance()
    assert session.selection is None        # no drag was taken for a click


def send_move(view, position: QPoint, button, keys):
    there = QPointF(position)
    event = QMouseEvent(QEvent.Type.MouseMove, there, view.mapToGlobal(there), Qt.MouseButton.NoButton, button, keys)
    QApplication.sendEvent(view, event)


def test_switches_by_their_keys(window, session, qtbot):
    for key, name in (("1", "shadows"), ("2", "fog"), ("3", "reflections")):
        action = window.actions_by_id[name]
        assert action.shortcut().toString() == key and key in action.toolTip()
        action.trigger()
        assert getattr(session.options, name) is False
        action.trigger()
        assert getattr(session.options, name) is True


def drop(window, path: Path):
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path))])
    window.dropEvent(QDropEvent(QPointF(5, 5), Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier))


def test_a_dropped_file_is_opened_and_remembered(window, session, scene, tmp_path, qtbot):
    path = tmp_path / "dropped.yaml"
    rtcore.save(msgspec.structs.replace(scene, name="Dropped"), path)
    with qtbot.waitSignal(window.filing.opened, timeout=5000):
        drop(window, path)
    assert session.scene.name == "Dropped" and window.windowTitle() == "dropped.yaml[*] - Rayscope"
    assert window.preferences.recent == [path]


def test_a_bad_file_dropped_shows_a_message_and_keeps_the_scene(window, session, tmp_path, qtbot):
    path, scene = tmp_path / "bad.yaml", session.scene
    path.write_text("rayscope: 1\nscene: 7\n")
    drop(window, path)
    qtbot.waitUntil(window.notice.isVisible, timeout=5000)
    assert "bad.yaml" in window.notice.label.text() and session.scene is scene


@pytest.mark.parametrize("answer, closed", [("Cancel", False), ("Discard", True), ("Save", True)])
def test_closing_with_unsaved_changes_asks(window, session, tmp_path, qtbot, monkeypatch, answer, closed):
    path, asked = tmp_path / "scene.yaml", []
    session.document.path = path

    def answered(parent, name, doing):
        asked.append(name)
        return QMessageBox.StandardButton[answer]
    monkeypatch.setattr(dialogs, "ask_unsaved", answered)
    session.edit(msgspec.structs.replace(session.scene, note="new"), "note")
    assert window.isWindowModified()
    window.close()
    if closed:
        qtbot.waitUntil(lambda: not window.isVisible(), timeout=5000)
    assert asked == ["scene.yaml"] and window.isVisible() != closed and path.exists() == (answer == "Save")


def test_closing_without_changes_does_not_ask(window, monkeypatch):
    monkeypatch.setattr(dialogs, "ask_unsaved", lambda *_: pytest.fail("asked"))
    window.close()
    assert not window.isVisible() and window.preferences.layout is not None


def test_undo_and_redo_are_named_and_enabled_when_there_is_something(window, session):
    undo, redo = window.actions_by_id["undo"], window.actions_by_id["redo"]
    assert not undo.isEnabled() and not redo.isEnabled()
    session.edit(msgspec.structs.replace(session.scene, note="new"), "note")
    assert undo.isEnabled() and undo.text() == "&Undo note"
    undo.trigger()
    assert redo.isEnabled() and not window.isWindowModified()


def test_full_screen_shows_the_picture_alone_and_back(window, qtbot):
    shown = [dock for dock in window.docks.values() if not dock.isHidden()]
    window.actions_by_id["fullscreen"].trigger()
    assert window.isFullScreen() and all(dock.isHidden() for dock in window.docks.values()) and not window.toolbar.isVisible()
    window.actions_by_id["fullscreen"].trigger()
    assert not window.isFullScreen() and [dock for dock in window.docks.values() if not dock.isHidden()] == shown


@pytest.mark.parametrize("choice", ["light", "dark", "system"])
def test_themes(window, choice):
    window.choose_theme(choice)
    assert window.preferences.theme == choice
    window.choose_theme("dark")


def test_everything_has_a_tooltip_and_an_accessible_name(window, session):
    for place in (Place("node", (1,)), Place("node", (3,)), Place("light", 0), Place("material", "floor")):
        session.select(place)
        window.panels["Properties"].complete()
        for kind in (QLineEdit, QSlider, QComboBox, QCheckBox, QPushButton, QToolButton):
            for widget in window.findChildren(kind):
                qts_own = widget.objectName().startswith("qt_") or isinstance(widget.parent(), (QDockWidget, QTabBar))
                if widget.window() is window and not qts_own:
                    assert widget.accessibleName() or getattr(widget, "text", str)(), widget
                    assert widget.toolTip(), (widget, widget.accessibleName())


@pytest.mark.parametrize(("opened", "as_scene", "as_picture"), [
    ("elsewhere/balls.nff", "elsewhere/balls.yaml", "elsewhere/balls.png"),     # beside what it came from
    (GALLERY / "tori.yaml", "here/tori.yaml", "here/tori.png"),                 # nothing is written into the gallery
    (None, "here/scene.yaml", "here/rayscope.png")])
def test_dialogs_suggest_a_new_file_where_it_belongs(window, session, tmp_path, monkeypatch, opened, as_scene, as_picture):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    session.document.path = opened and tmp_path / opened
    suggested = []
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda parent, title, start, kinds: (suggested.append(start), ("", ""))[1])
    window.save_as()
    window.save_picture()
    assert suggested == [str(tmp_path / as_scene), str(tmp_path / as_picture)]


def test_a_region_is_drawn_and_dropped(window, session, double, qtbot, settled):
    qtbot.waitUntil(lambda: session.shown.job.size == (window.viewport.width(), window.viewport.height()) and session.shown.frame.done)
    view, action, camera = window.viewport, window.actions_by_id["region"], session.camera
    width, height = view.width(), view.height()

    def drag(keys=Qt.KeyboardModifier.NoModifier):
        start, end = QPoint(width * 3 // 4, height // 4), QPoint(width // 4, height * 2)      # from the right, and out of the picture
        qtbot.mousePress(view, Qt.MouseButton.LeftButton, keys, start)
        send_move(view, start - QPoint(20, 0), Qt.MouseButton.LeftButton, keys)
        send_move(view, end, Qt.MouseButton.LeftButton, keys)
        qtbot.mouseRelease(view, Qt.MouseButton.LeftButton, keys, end)

    def row() -> list[int]:
        return [view.grab().toImage().pixel(x, height // 2) for x in range(width // 4 - 9, width // 4 + 9)]

    asked, bare = len(double.jobs), row()
    action.trigger()
    assert view.asking and action.isChecked() and view.cursor().shape() == Qt.CursorShape.CrossCursor
    drag()
    assert session.options.region == pytest.approx((0.25, 0.25, 0.75, 1.0), abs=0.01) and session.camera == camera
    assert not view.asking and action.isChecked() and view.cursor().shape() == Qt.CursorShape.ArrowCursor
    settled(session)
    assert len(double.jobs) == asked        # the finished picture is none the finer for it
    assert 2 <= sum(a != b for a, b in zip(bare, row())) <= 5       # a thin line
    action.trigger()
    assert session.options.region is None and not action.isChecked() and row() == bare
    drag(Qt.KeyboardModifier.ControlModifier)
    assert session.options.region is not None and session.camera == camera
    qtbot.keyClick(view, Qt.Key.Key_Escape)
    assert session.options.region is None
    action.trigger()
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, view.rect().center())
    assert not view.asking and session.selection is None
    drag()
    assert session.camera != camera


@pytest.mark.parametrize(("region", "pixels"), [((0, 0, 1, 1), (0, 0, 160, 120)), ((0.501, 0.25, 0.502, 0.3), (80, 30, 81, 36)),
                                                (None, None)])
def test_a_region_in_pixels_is_all_that_it_touches(session, region, pixels):
    job = Job(1, session.scene, session.camera, Options(region=region), (160, 120))
    assert job.region() == pixels


@pytest.mark.parametrize("region", [(0, 0, 1, 1.01), (0.5, 0, 0.5, 1), (0, 0.6, 1, 0.4), (0, 0, 1)])
def test_a_region_is_a_rectangle_within_the_picture(region):
    with pytest.raises(FieldError):
        Options(region=region)
