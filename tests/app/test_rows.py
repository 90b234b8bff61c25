"""The scene tree's rows, which are painted by us, against what the style makes of them."""
import sys
from collections import Counter

import msgspec
import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QTreeView, QWidget

from app.panels.rows import SceneView
from app.places import Place, node_at

TOP = Place("node", (0,))


def pixels(widget: QWidget) -> np.ndarray:
    """What is seen of a widget, as rows of red, green and blue."""
    image = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    return np.array(image.constBits()).reshape(image.height(), image.width(), 4)[:, :, 2::-1].astype(int)


@pytest.fixture
def view(window) -> SceneView:
    view = window.panels["Scene"].view
    view.expandAll()
    QApplication.processEvents()
    return view


def line(view: SceneView, place: Place):
    """Where a place's row is, in the picture of the view."""
    rect = view.visualRect(view.model().find(place))
    return slice(rect.top() + view.viewport().y(), rect.bottom() + view.viewport().y() + 1)


@pytest.mark.parametrize("name", ["dark", "light"])
def test_rows_are_painted_as_the_style_would(window, view, name):
    window.choose_theme(name)
    view.setCurrentIndex(view.model().index(0, 0).siblingAtRow(1))      # a row that has no box
    other = QTreeView(view.parentWidget())
    other.setModel(view.model())
    for what in ("HeaderHidden", "UniformRowHeights"):
        getattr(other, f"set{what}")(True)
    other.setIconSize(view.iconSize())
    other.setIndentation(view.indentation())
    other.setGeometry(view.geometry())
    other.show()
    other.expandAll()
    QApplication.processEvents()
    ours, styles = pixels(view), pixels(other)
    assert ours.shape == styles.shape and np.ptp(styles) > 100
    chosen = view.visualRect(view.currentIndex()).translated(view.viewport().pos())
    for picture in (ours, styles):
        picture[chosen.top():chosen.bottom() + 1] = 0       # the style leaves a gap in its band, and tints the icon
    assert (abs(ours - styles).max(axis=2) > 2).mean() < 0.001
    other.deleteLater()


def test_what_is_hidden_is_faint_and_what_is_selected_has_a_band(window, session, view):
    before = pixels(view)
    session.edit_record(TOP, msgspec.structs.replace(node_at(session.scene, TOP.key), visible=False), "hide")
    hidden, row = pixels(view), line(view, TOP)
    assert hidden[row, 80:].max() < before[row, 80:].max() - 50         # the text of a dark theme
    session.select(TOP)
    chosen = pixels(view)
    assert (chosen[row, 4:20] != hidden[row, 4:20]).any(axis=2).mean() > 0.9
    session.select(None)
    assert (pixels(view) == hidden).all()


def test_a_click_on_the_box_that_is_painted_hides(window, session, view, qtbot):
    rect = view.visualRect(view.model().find(TOP))
    box = view._plan(True, rect.height()).box.translated(rect.topLeft())
    qtbot.mouseClick(view.viewport(), Qt.MouseButton.LeftButton, pos=box.center())
    assert not node_at(session.scene, TOP.key).visible
    qtbot.mouseClick(view.viewport(), Qt.MouseButton.LeftButton, pos=box.center() + QPoint(box.width() + 20, 0))
    assert not node_at(session.scene, TOP.key).visible and session.selection == TOP


def test_a_row_asks_python_once(window, view):
    called = Counter()
    sys.setprofile(lambda frame, what, _: called.update([frame.f_code.co_qualname] if what == "call" else []))
    view.viewport().repaint()
    sys.setprofile(None)
    assert called["SceneView.drawRow"] == called["SceneModel.look"] > 8
    assert not called["SceneModel.data"] and not called["SceneModel.flags"]
