"""The status bar's texts, and how long a picture will take yet."""
import math

import pytest
from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QLabel

from app.forecast import Forecast, left_text
from app.options import Options
from app.status import PARTS, error_text, pass_text


def test_the_bar_tells_samples_error_and_time_left(window, session, double, settled, qtbot):
    parts = window.statusBar().parts
    assert set(parts) == {name for name, *_ in PARTS} and all(part.toolTip() and part.accessibleName() for part in parts.values())
    settled(session)
    frame = session.shown.frame
    for changes, word, error, left in (
            ({"mean": 0.0, "elapsed": 0.0, "error": None, "done": False}, "samples 0/16", "", ""),
            ({"mean": 4.0, "elapsed": 1.0, "error": None, "done": False}, "samples 4/16", "", "3 s left"),
            ({"mean": 8.0, "elapsed": 2.0, "error": 0.0123, "done": False}, "samples 8/16", "error 0.012", "2.0 s left"),
            ({"mean": 10.0, "elapsed": 3.0, "error": 2.5e-5, "done": False}, "samples 10/16", "error 2.5e-05", "2 to 3 s left"),
            ({"mean": 16.0, "elapsed": 5.0, "error": 1e-3, "done": True}, "done, samples 16/16", "error 0.001", ""),
            ({"mean": 9.5, "elapsed": 6.0, "error": 0.0, "done": True, "converged": True}, "converged, samples 9.5", "error 0", "")):
        session.shown = session.shown._replace(frame=frame._replace(spacing=1, **changes))
        session.frame_changed.emit()
        assert (parts["pass"].text(), parts["error"].text(), parts["left"].text()) == (word, error, left)
        for name in ("pass", "error", "left"):
            assert parts[name].fontMetrics().horizontalAdvance(parts[name].text()) <= parts[name].width()


class Layouts(QObject):
    """Counts how often a widget is asked to lay out what is on it."""

    count = 0

    def eventFilter(self, widget, event):
        self.count += event.type() == QEvent.Type.LayoutRequest
        return False


def test_a_text_moves_nothing_in_the_window(window, session, settled, qtbot):
    settled(session)
    qtbot.wait(50)      # what is still on its way
    bar, layouts = window.statusBar(), Layouts()
    places = {name: part.geometry() for name, part in bar.parts.items()}
    window.installEventFilter(layouts)
    for text in ("", "1", "what is far longer than any text for which there is room"):
        for part in (bar.under, *bar.parts.values()):
            part.setText(text)
            assert part.text() == part.accessibleDescription() == text
        qtbot.wait(20)
    assert layouts.count == 0 and {name: part.geometry() for name, part in bar.parts.items()} == places


def test_what_has_no_room_is_shortened_and_comes_back(window, session, qtbot):
    window.resize(1300, 700)
    qtbot.wait(20)
    figure = window.statusBar().under
    name = "a sphere with quite a long name, " * 20
    figure.setText(name)
    shown = QLabel.text(figure)
    assert figure.text() == name and shown.endswith("\u2026") and len(shown) < len(name)
    assert figure.fontMetrics().horizontalAdvance(shown) <= figure.contentsRect().width()
    window.resize(window.width() + 200, window.height())
    qtbot.waitUntil(lambda: len(QLabel.text(figure)) > len(shown))
    figure.setText("<b>a & b</b>")
    assert QLabel.text(figure) == "<b>a & b</b>" and figure.textFormat() == Qt.TextFormat.PlainText


def test_texts():
    assert error_text(None) == "" and error_text(0.5) == "error 0.5" and error_text(1.234e-6) == "error 1.2e-06"
    assert left_text(None) == "" and left_text((8.2, 12.4)) == "8 to 12 s left" and left_text((61.0, 400.0)) == "1 to 7 min left"
    assert left_text((0.52, 0.54)) == "0.5 s left" and left_text((7000.0, 7100.0)) == "1.9 to 2.0 h left"


def test_only_a_converged_picture_is_called_so(session, settled):
    settled(session)
    frame = session.shown.frame._replace(spacing=1, mean=8.0)
    assert pass_text(frame._replace(done=True, converged=True), Options()) == "converged, samples 8"
    assert pass_text(frame._replace(done=True), Options(samples=8)) == "done, samples 8/8"
    assert pass_text(frame._replace(spacing=4), Options()) == "1/4 lattice"


def test_it_tells_what_ended_a_picture(session, settled):
    settled(session)
    frame = session.shown.frame._replace(spacing=1, mean=8.0, elapsed=3.0, error=0.004)
    for options, done, paused, text in (
            (Options(error=0.004), True, False, "error reached, samples 8/16"),
            (Options(seconds=3.0), True, False, "time is up, samples 8/16"),
            (Options(samples=None, seconds=2.0, error=0.003), True, False, "time is up, samples 8"),
            (Options(samples=8, seconds=9.0, error=0.003), True, True, "done, samples 8/8"),
            (Options(samples=None), False, False, "samples 8"), (Options(samples=None), False, True, "paused, samples 8")):
        assert pass_text(frame._replace(done=done), options, paused) == text
    assert pass_text(frame._replace(mean=123456.0, done=False), Options(samples=1 << 20)) == "samples 123456/1048576"


def test_the_exposure_is_told_where_it_is_not_as_it_is(window, session, settled, qtbot):
    label = window.statusBar().parts["exposure"]
    assert label.text() == ""
    for stops, text in ((1.0, "+1 stop"), (-0.5, "-0.5 stops"), (-9.87, "-9.87 stops"), (10.0, "+10 stops"), (0.0, "")):
        session.set_options(Options(exposure=stops))
        settled(session)
        assert label.text() == text and label.fontMetrics().horizontalAdvance(text) <= label.width()


def test_the_forecast_is_an_interval_of_paces():
    forecast = Forecast()
    assert forecast.left(16) is None
    for seconds, samples in ((1.0, 4.0), (2.0, 8.0), (4.0, 10.0)):      # 4 a second, then 1
        forecast.note(seconds, samples)
    assert forecast.left(16) == pytest.approx((1.5, 6.0)) and forecast.left(5) == (0, 0)
    assert forecast.left(16, seconds=7.0) == pytest.approx((1.5, 3.0)) and forecast.left(16, seconds=1.0) == (0, 0)
    assert forecast.left(math.inf) is None and forecast.left(math.inf, seconds=7.0) == pytest.approx((3.0, 3.0))
    assert forecast.left(16, error=0.1) == pytest.approx((1.5, 6.0))       # nothing is known of the error yet
    forecast.note(5.0, 11.0, 0.2)
    assert forecast.left(1000, error=0.1) == pytest.approx((5.0, 15.0)) and forecast.left(1000, error=0.3) == (0, 0)
    forecast.note(0.1, 1.0)     # another picture
    assert forecast.left(16) is None
    forecast.note(0.11, 2.0)    # too soon to tell
    assert forecast.left(16) is None


def test_what_the_window_asks_for():
    settings = Options(view="error", samples=32).settings()
    assert settings["adaptive"] and settings["view"] == "error" and settings["samples"] == 32
