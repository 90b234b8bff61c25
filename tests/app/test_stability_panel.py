"""The stability panel: out of the way at first; runs a helper, shows what it found, stops, saves."""
import sys
from pathlib import Path

import pytest
import stand_in
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog

from app.measuring import Measuring
from app.panels.stability import COLUMNS, StabilityPanel
from app.theme import LIGHT

HELPER = sys.executable, "-u", str(Path(stand_in.__file__))


@pytest.fixture
def panel(session, tmp_path, qtbot):
    """The panel alone, with the stand-in for a helper."""
    panel = StabilityPanel(session, measuring=Measuring(tmp_path / "data" / "stability", HELPER))
    panel.resize(1000, 420)
    panel.show()
    yield panel
    panel.close_down()
    panel.close()
    panel.deleteLater()


@pytest.fixture
def finished(panel, qtbot):
    """The panel after a quick run on spheres."""
    panel.measured.setCurrentText("sphere")
    with qtbot.waitSignal(panel.measuring.ended, timeout=60_000) as ended:
        qtbot.mouseClick(panel.run, Qt.MouseButton.LeftButton)
    assert ended.args == [""]
    qtbot.waitUntil(lambda: panel.pages.count() == 3, timeout=5000)
    return panel


def test_it_is_hidden_until_asked_for(window, qtbot):
    dock = window.docks["Stability"]
    assert dock.isHidden() and window.dockWidgetArea(dock) == Qt.DockWidgetArea.BottomDockWidgetArea
    window.show_panels(False)
    window.show_panels(True)
    assert dock.isHidden()
    window.panels["Stability"].measuring.folder = Path("nowhere")
    dock.toggleViewAction().trigger()
    assert dock.isVisible()


def test_a_run_ends_in_plots_and_a_table(finished, qtbot):
    panel = finished
    assert panel.shown.currentText() == "sphere" and panel.run.text() == "Run" and panel.bar.isHidden() and panel.doing.text() == ""
    names = set()
    for tab in range(3):
        panel.tabs.setCurrentIndex(tab)
        assert panel.pages.count() == 3 and panel.pages.currentIndex() == 2
        names.add(panel.pages.currentWidget().accessibleName())
    assert names == {"Sphere: work and precision", "Sphere: error against distance", "Sphere: error against scale"}
    panel.tabs.setCurrentIndex(3)
    assert panel.pages.currentWidget() is panel.table and panel.table.rowCount() == 36
    first = {COLUMNS[j]: panel.table.item(0, j).text() for j in range(len(COLUMNS))}
    assert (first["Shape"], first["Solver"], first["Wrong"]) == ("sphere", "renderer", "0") and first["Met"] in ("yes", "no")
    panel.dress(LIGHT)
    assert panel.pages.currentWidget() is panel.table


def test_progress_is_told(panel, qtbot):
    told = []
    panel.measuring.progressed.connect(lambda share, what, left: told.append((share, what, left)))
    with qtbot.waitSignal(panel.measuring.ended, timeout=60_000):
        panel.run.click()
        assert panel.run.text() == "Stop" and panel.bar.isVisible() and panel.doing.text().startswith("starting")
    shares = [share for share, *_ in told]
    assert shares == sorted(shares) and shares[-1] == 1 and len(shares) > 6
    assert any(what == "sphere, far, f64" and left is not None for _, what, left in told) and told[-1][1] == "drawing the plots"


def test_stopping_leaves_the_report_before(finished, qtbot):
    panel, before = finished, sorted(path.name for path in finished.measuring.folder.iterdir())
    panel.measuring._helper = (*HELPER, "--pause", "5")
    panel.run.click()
    qtbot.waitUntil(lambda: panel.doing.text() == "sphere, far, f64", timeout=10_000)
    panel.run.click()
    assert not panel.measuring.running and panel.run.text() == "Run" and panel.doing.text() == "stopped"
    assert sorted(path.name for path in panel.measuring.folder.iterdir()) == before
    assert [path.name for path in panel.measuring.folder.parent.iterdir()] == ["stability"]     # nothing half done is left


@pytest.mark.parametrize(("helper", "said"), [
    ((sys.executable, "-c", "raise SystemExit('mpmath is missing')"), "The report was not made: mpmath is missing"),
    ((sys.executable, "-c", "import os; os.abort()"), "The report was not made: the helper ended with exit code"),
    (("no-such-program",), "The report was not made: ")])
def test_a_helper_that_fails_is_told_of(panel, session, qtbot, helper, said):
    panel.measuring._helper = helper
    with qtbot.waitSignal(session.said, timeout=20_000) as heard:
        panel.run.click()
    assert heard.args[0] == "error" and heard.args[1].startswith(said)
    assert not panel.measuring.running and panel.run.text() == "Run"


def test_a_report_from_before_is_shown(session, tmp_path, qtbot):
    (tmp_path / "kept").mkdir()
    stand_in.write(tmp_path / "kept", ["torus", "sphere"])
    panel = StabilityPanel(session, measuring=Measuring(tmp_path / "kept", HELPER))
    assert panel.shown.count() == 0         # nothing is read before it is seen
    panel.show()
    qtbot.waitUntil(lambda: panel.shown.count() == 2, timeout=5000)
    panel.shown.setCurrentText("sphere")
    assert panel.pages.currentWidget().accessibleName() == "Sphere: work and precision"
    panel.close()
    panel.deleteLater()


def test_saving_copies_tables_and_plots(finished, session, tmp_path, qtbot, monkeypatch):
    target = tmp_path / "saved"
    target.mkdir()
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(target))
    with qtbot.waitSignal(session.said, timeout=5000) as heard:
        finished.save.click()
    assert heard.args == ["info", "Saved 6 files in saved"]
    assert {path.name for path in target.iterdir()} == {
        "stability.csv", "stability.points.csv", "stability.md", "stability-sphere-work-precision.png", "stability-sphere-distance.png",
        "stability-sphere-scale.png"}


def test_closing_the_window_ends_the_helper(window, tmp_path, qtbot):
    measuring = window.panels["Stability"].measuring
    measuring.folder, measuring._helper = tmp_path / "data" / "stability", (*HELPER, "--pause", "5")
    measuring.start(True)
    qtbot.waitUntil(lambda: measuring.running, timeout=5000)
    window.close()
    assert not measuring.running
