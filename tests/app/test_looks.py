"""What the style sheet and the palette make of the window: sizes, colours, and how little of it is painted by Python."""
import sys
from collections import Counter

import pytest
from PySide6.QtGui import QColor, QImage
from PySide6.QtWidgets import QApplication, QLabel, QScrollArea, QToolButton, QWidget

from app import theme
from app.dialogs import shortcuts_dialog

HELD = ("QWidget", "*")     # selectors that put every widget there is under the style sheet


def color_at(widget: QWidget, x: int, y: int) -> str:
    return widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB32).pixelColor(x, y).name()


@pytest.mark.parametrize("chosen", [theme.DARK, theme.LIGHT], ids=lambda chosen: chosen.name)
def test_panels_stand_out_from_the_window(window, chosen, qtbot):
    window.choose_theme(chosen.name)
    for name in ("Camera", "Fog", "Render", "Properties", "Plan", "Convergence", "Stability"):
        window.docks[name].setVisible(True)
        window.docks[name].raise_()
        QApplication.processEvents()
        panel = window.panels[name]
        assert color_at(panel, 2, panel.height() - 2) == color_at(panel, panel.width() - 2, panel.height() - 2) == chosen.panel, name
    assert color_at(window.panels["Scene"], 100, window.panels["Scene"].height() - 2) == chosen.panel
    assert color_at(window.menuBar(), window.menuBar().width() - 2, 2) == chosen.window
    part = window.statusBar().parts["pass"]
    assert part.palette().color(part.foregroundRole()) == QColor(chosen.muted)
    area = shortcuts_dialog(window).findChild(QScrollArea)
    assert color_at(area, 2, 2) == color_at(area, area.width() - 2, area.height() - 2) == chosen.panel


def test_texts_have_one_size(window):
    window.panels["Properties"].complete()
    sizes = {kind: {widget.font().pointSizeF() for widget in window.findChildren(kind)} for kind in (QToolButton, QWidget, QLabel)}
    assert sizes[QToolButton] == {theme.POINTS} and theme.POINTS in sizes[QLabel]
    assert sizes[QWidget] - {theme.POINTS} <= {8.5, 9.0, 12.0}       # of the matrix chain, of titles' buttons, and of what the plan says


def test_no_rule_is_for_all_widgets():
    for rule in theme.SHEET.split("}")[:-1]:
        for selector in rule.partition("{")[0].split(","):
            assert selector.split()[-1].partition(":")[0] not in HELD, selector


def test_a_paint_of_the_window_hardly_calls_python(window):
    """Each call waits for Python's lock while the render thread has it."""
    calls = []
    deep = 0

    def look(frame, what, _):
        nonlocal deep
        deep += (what == "call") - (what == "return")
        if what == "call" and deep == 1:
            calls.append(frame.f_code.co_qualname)
    window.panels["Scene"].view.collapseAll()
    QApplication.processEvents()
    sys.setprofile(look)
    window.repaint()
    sys.setprofile(None)
    assert "SceneView.drawRow" in calls and len(calls) <= 20, Counter(calls)
