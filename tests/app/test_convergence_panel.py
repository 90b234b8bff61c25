"""The convergence panel: follows the picture, judges it by a reference, keeps runs to compare, and saves them."""
import csv
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog

from app.panels.convergence import SAMPLES, ConvergencePanel
from app.referring import Referring
from app.runs import Point, Run, as_csv, names
from app.theme import LIGHT
from rtcore.camera import orbit
from rtcore.reports.convergence import Reference


class Renders:
    """Stands in for the rendering of a reference: a picture of zeros, its own error as given."""

    def __init__(self, error: float = 1e-6, pause: float = 0.0):
        self.error, self.pause, self.asked = error, pause, []

    def __call__(self, job, samples, cancelled, progress, compiler):
        self.asked.append((job, samples))
        end = time.monotonic() + self.pause
        while time.monotonic() < end:
            progress(0.5)
            if cancelled():
                return None
            time.sleep(0.005)
        if self.error is None:
            raise ValueError("no such\nlight")
        width, height = job.size
        return Reference(np.zeros((height, width, 3)), samples, self.error)


@pytest.fixture
def renders():
    return Renders()


@pytest.fixture
def panel(session, renders, settled):
    """The panel alone, with a picture on the screen."""
    settled(session)
    panel = ConvergencePanel(session, referring=Referring(renders))
    panel.resize(1000, 360)
    panel.show()
    yield panel
    panel.close_down()
    panel.close()
    panel.deleteLater()


def play(session, frames, value: float = 0.02, **options):
    """Let the session show frames (seconds, samples, estimate) as of a render of its own; the last one is done."""
    job = session.shown.job._replace(options=msgspec.structs.replace(session.options, **options))
    for i, (seconds, samples, estimate) in enumerate(frames):
        frame = session.shown.frame._replace(spacing=1, elapsed=seconds, mean=samples, error=estimate, done=i + 1 == len(frames),
                                             pixels=np.full_like(session.shown.frame.pixels, value))
        session.shown = session.shown._replace(frame=frame, job=job)
        session.frame_changed.emit()


FALLING = [(0.1, 2, 0.04), (0.2, 4, 0.025), (0.5, 8, 0.014), (1.0, 16, 0.008)]


def test_it_is_hidden_until_asked_for(window):
    dock = window.docks["Convergence"]
    assert dock.isHidden() and window.dockWidgetArea(dock) == Qt.DockWidgetArea.BottomDockWidgetArea
    dock.toggleViewAction().trigger()
    assert dock.isVisible()


def lines(panel) -> list:
    """What is seen in the plot, short lines first: x and y of each."""
    data = [item.getData() for item in panel._figure.plot.listDataItems() if item.isVisible()]
    return sorted((one for one in data if one[0] is not None and len(one[0])), key=lambda one: len(one[0]))


def test_the_run_follows_the_frames(panel, session, qtbot):
    play(session, FALLING)
    assert [(p.seconds, p.samples, p.estimate) for p in panel.run.points] == FALLING and panel.run.done
    assert panel.told.text() == "16 samples, estimate 0.008"
    qtbot.waitUntil(lambda: panel._figure is not None, timeout=3000)
    assert [len(x) for x, _ in lines(panel)] == [2, 2, 4]       # two slopes and the run
    assert np.allclose(lines(panel)[-1][1], np.log10([f[2] for f in FALLING]))
    play(session, FALLING[:2])      # from the start again
    assert len(panel.run.points) == 2
    play(session, [(0.3, 6, 0.02)], view="normal")      # another view of the same run
    assert len(panel.run.points) == 3
    play(session, FALLING[:1], adaptive=False)
    assert len(panel.run.points) == 1 and panel.pinned == []


def test_coarse_frames_and_those_without_an_estimate_are_no_points(panel, session):
    frame = session.shown.frame
    for changes in ({"spacing": 4, "error": 0.1}, {"spacing": 1, "error": None}):
        session.shown = session.shown._replace(frame=frame._replace(elapsed=9.0, **changes))
        session.frame_changed.emit()
    assert panel.run.points == [] and not panel.pin.isEnabled() and not panel.table.isEnabled()


def test_pinned_runs_are_overlaid_and_named_by_what_differs(panel, session, qtbot):
    play(session, FALLING)
    qtbot.mouseClick(panel.pin, Qt.MouseButton.LeftButton)
    assert not panel.pin.isEnabled() and panel.pins.isVisible() and panel.pins.item(0).text() == "adaptive"
    play(session, FALLING[:3], adaptive=False, precision="f32")
    panel.pin.click()
    play(session, FALLING[:2], adaptive=False)
    assert [panel.pins.item(i).text() for i in range(2)] == ["adaptive, f64", "uniform, f32"]
    assert names(panel.runs()) == ["adaptive, f64", "uniform, f32", "uniform, f64"]
    qtbot.waitUntil(lambda: panel._figure is not None, timeout=3000)
    panel._draw()
    assert [len(x) for x, _ in lines(panel)] == [2, 2, 2, 3, 4]     # two slopes and three runs
    panel.pins.setCurrentRow(0)
    panel.unpin.click()
    assert [run.job.options.precision for run in panel.pinned] == ["f32"]
    panel._draw()
    assert [len(x) for x, _ in lines(panel)] == [2, 2, 2, 3]
    panel.unpin.click()
    assert panel.pinned == [] and not panel.pins.isVisible() and not panel.unpin.isEnabled()


def test_a_reference_tells_the_true_error(panel, session, double, renders, qtbot, settled):
    play(session, FALLING)
    asked = len(double.jobs)
    panel.samples.setCurrentIndex(1)
    with qtbot.waitSignal(panel.referring.ended, timeout=5000):
        panel.refer.click()
    assert renders.asked[0][1] == SAMPLES[1] and panel.refer.text() == "Reference" and panel.bar.isHidden()
    # it renders again, so that the whole run is judged
    qtbot.waitUntil(lambda: len(double.jobs) == asked + 1 and session.shown.job is double.jobs[-1] and session.shown.frame.done)
    play(session, FALLING, value=0.02)
    qtbot.waitUntil(lambda: all(point.error is not None for point in panel.run.points), timeout=3000)
    assert panel.run.points[-1].error == pytest.approx(0.02, rel=1e-3) and "true error 0.02" in panel.told.text()
    assert panel._curves()[0].error == pytest.approx(0.02, rel=1e-3)
    play(session, [(2.0, 32, 0.004)], view="normal")        # a view is no picture to judge
    qtbot.wait(50)
    assert panel.run.points[-1].error is None
    session.move(orbit(session.camera, 0.3, 0.0))
    settled(session)
    assert panel.referring.reference(session.shown.job) is None
    session.back()
    settled(session)
    assert panel.referring.reference(session.shown.job) is not None


def test_a_reference_does_not_judge_what_is_as_good_as_itself(panel, session, renders, qtbot):
    renders.error = 0.021
    with qtbot.waitSignal(panel.referring.ended, timeout=5000):
        panel.refer.click()
    play(session, FALLING, value=0.02)
    qtbot.wait(100)
    assert all(point.error is None for point in panel.run.points)


def test_a_reference_can_be_stopped(panel, session, renders, qtbot):
    renders.pause = 30
    panel.refer.click()
    qtbot.waitUntil(lambda: panel.bar.value() == 500, timeout=3000)
    assert panel.refer.text() == "Stop" and panel.bar.isVisible()
    panel.refer.click()
    assert not panel.referring.running and panel.refer.text() == "Reference" and panel.bar.isHidden()
    assert panel.referring.reference(session.shown.job) is None


def test_a_reference_that_fails_is_told_in_one_line(panel, session, renders, qtbot):
    said, renders.error = [], None
    session.said.connect(lambda level, text: said.append((level, text)))
    with qtbot.waitSignal(panel.referring.ended, timeout=5000):
        panel.refer.click()
    assert said == [("error", "The reference was not made: ValueError: no such light")] and panel.refer.text() == "Reference"


def test_runs_are_saved_as_table_and_picture(panel, session, qtbot, tmp_path, monkeypatch):
    said = []
    session.said.connect(lambda level, text: said.append((level, text)))
    play(session, FALLING)
    panel.pin.click()
    play(session, FALLING[:2], adaptive=False)
    for name, pressed in (("a.csv", panel.table), ("a.png", panel.drawing)):
        monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_, name=name: (str(tmp_path / name), ""))
        pressed.click()
    with open(tmp_path / "a.csv") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == ["adaptive"] * 4 + ["uniform"] * 2 and rows[3]["estimate"] == "0.008" and rows[0]["rmse"] == ""
    assert (tmp_path / "a.png").stat().st_size > 5000
    assert said == [("info", "Saved a.csv"), ("info", "Saved a.png")]
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(Path("nowhere") / "a.csv"), ""))
    panel.table.click()
    assert said[-1][0] == "error" and "a.csv" in said[-1][1]
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: ("", ""))
    panel.table.click()
    assert len(said) == 3


def test_run_again_starts_over(panel, session, double, qtbot):
    play(session, FALLING)
    asked, forgotten = len(double.jobs), double.forgotten
    panel.again.click()
    qtbot.waitUntil(lambda: len(double.jobs) == asked + 1 and double.forgotten == forgotten + 1, timeout=3000)


def test_light_and_dark(panel, session, qtbot):
    play(session, FALLING)
    qtbot.waitUntil(lambda: panel._figure is not None, timeout=3000)
    panel.dress(LIGHT)
    qtbot.waitUntil(lambda: panel._figure is not None and panel._figure.style_.paper == LIGHT.panel, timeout=3000)


def test_nothing_is_drawn_while_nobody_looks(session, settled, qtbot):
    settled(session)
    panel = ConvergencePanel(session, referring=Referring(Renders()))
    play(session, FALLING)
    qtbot.wait(300)
    assert panel._figure is None and len(panel.run.points) == 4
    panel.deleteLater()


def test_names_and_tables(session, settled):
    settled(session)
    job = session.shown.job
    runs = [Run(job, [Point(1.0, 2.0, 0.5, None)]), Run(job)]
    assert names(runs) == ["adaptive (1)", "adaptive (2)"] and names([]) == []
    runs[1].job = job._replace(camera=orbit(job.camera, 0.1, 0), size=(32, 24))
    assert names(runs) == ["160 × 120, view 1", "32 × 24, view 2"]
    solvers = [Run(job._replace(options=msgspec.structs.replace(job.options, solver=solver))) for solver in ("certain", "textbook")]
    assert names(solvers) == ["certain", "textbook"]
    assert as_csv(runs).decode() == "run,name,seconds,samples,estimate,rmse\n0,\"160 × 120, view 1\",1,2,0.5,\n"
