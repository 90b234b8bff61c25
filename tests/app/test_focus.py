"""Focus by click: what was clicked is sharp, by the panel's button or Ctrl and click, and Back undoes it."""
import msgspec
import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt

from rtcore import camera as moves

LEFT, CTRL = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier


def at(window, x: float, y: float) -> QPoint:
    """A point of the viewport, given in 0 .. 1 of the picture."""
    rect = window.viewport.picture_rect()
    return QPoint(round(rect.x() + x * rect.width()), round(rect.y() + y * rect.height()))


def seen(session, sharp: bool = True) -> tuple[float, float]:
    """Where in the picture something, or nothing, is hit, off the middle: there the distance is not the depth."""
    frame = session.shown.frame
    height, width = frame.node.shape
    rows, columns = np.nonzero((frame.node >= 0) == sharp)
    far = np.hypot(rows / height - 0.5, columns / width - 0.5).argmax()
    return (columns[far] + 0.5) / width, (rows[far] + 0.5) / height


@pytest.fixture
def blurred(window, session, settled):
    """The session with a lens."""
    session.move(session.camera.at(aperture=0.5))
    settled(session)
    return session


def test_a_click_focuses_after_the_button(window, blurred, qtbot):
    panel = window.panels["Camera"]
    before, selection = blurred.camera, blurred.selection
    qtbot.mouseClick(panel.focus, LEFT)
    assert blurred.aiming and panel.focus.isChecked() and window.viewport.cursor().shape() == Qt.CursorShape.CrossCursor
    x, y = seen(blurred)
    under = blurred.place_under(x, y)
    qtbot.mouseClick(window.viewport, LEFT, pos=at(window, x, y))
    focus = blurred.camera.focus
    assert 0 < focus < 0.999 * under.distance      # along the view, not along the ray
    assert blurred.camera == before.at(focus=focus) and blurred.selection == selection
    assert not blurred.aiming and not panel.focus.isChecked() and window.viewport.cursor().shape() == Qt.CursorShape.ArrowCursor
    assert blurred.worker is not None and blurred.views.can_back
    blurred.back()
    assert blurred.camera == before
    blurred.forward()
    assert blurred.camera.focus == focus


def test_what_was_clicked_lies_in_the_sharp_plane(window, blurred, qtbot):
    x, y = seen(blurred)
    point = np.array(blurred.point_under(x, y))
    blurred.focus(x, y)
    assert blurred.camera.lens()[2] @ (point - blurred.camera.lookfrom) == pytest.approx(1)


def test_control_and_click_focuses_and_a_plain_click_selects(window, blurred, qtbot):
    x, y = seen(blurred)
    qtbot.mouseClick(window.viewport, LEFT, CTRL, at(window, x, y))
    assert blurred.camera.focus > 0 and blurred.selection is None
    camera = blurred.camera
    qtbot.mouseClick(window.viewport, LEFT, pos=at(window, x, y))
    assert blurred.camera == camera and blurred.selection is not None


def test_escape_leaves_it_as_it_is(window, blurred, qtbot):
    camera = blurred.camera
    blurred.aim(True)
    qtbot.keyClick(window.viewport, Qt.Key.Key_Escape)
    assert not blurred.aiming and blurred.camera == camera


def test_nothing_to_focus_on_and_no_lens_are_told(window, session, settled, qtbot):
    settled(session)
    said, camera = [], session.camera
    session.said.connect(lambda level, text: said.append((level, text)))
    x, y = seen(session, False)
    session.focus(x, y)
    assert session.camera == camera and "nothing to focus on" in said[-1][1]
    assert session.camera.aperture == 0
    session.focus(*seen(session))
    assert session.camera.focus > 0
    assert said[-1] == ("info", f"In focus at {session.camera.focus:.4g}. All is sharp until the camera has an aperture.")


def test_a_point_behind_the_eye_is_refused(scene):
    camera = msgspec.structs.replace(scene.camera, aperture=0.5)
    with pytest.raises(moves.FieldError, match="focus"):
        moves.focus_on(camera, (0, 0, -20))
    assert moves.focus_on(camera, (3, 4, 2)).focus == pytest.approx(12)
