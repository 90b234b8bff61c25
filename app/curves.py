"""Error against run time as curves: the figure of the convergence report and of its panel."""
import csv
import itertools
import math
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication

from app.plots import PRINTED, Figure, Style, apart, save, write

STEP = 0.1          # of a decade: the frame grows by that, not with every point
SLOPES = ((-0.5, "slope −½"), (-0.75, "slope −¾"))        # of independent samples, and of stratified ones at edges


class Curve(NamedTuple):
    """The passes of one render: seconds, estimated error and, where there is a reference, the true one; each (n,), NaN where unknown."""

    name: str
    seconds: np.ndarray
    estimate: np.ndarray
    error: np.ndarray


def curve(name: str, points) -> Curve:
    """A curve of points (seconds, estimate, error)."""
    table = np.array([[math.nan if value is None else value for value in point] for point in points], float).reshape(-1, 3)
    return Curve(name, *table.T)


class ErrorFigure(Figure):
    """Error against seconds, both logarithmic: solid the true error, dashed the estimate, and two faint lines to compare slopes with."""

    def __init__(self, style: Style, title: str = "Error against time",
                 reading: str = "Solid: the error against a reference; dashed: the render's own estimate. Dotted: slopes to compare with."):
        super().__init__(title, reading, style)
        self._frame: tuple | None = None
        self.plot = self.panel(0, "", "seconds", "root mean square error")
        self._guides = [Drawn(self.plot, style.faint, style, guide=True) for _ in SLOPES]
        self._drawn: list[Drawn] = []

    def show_curves(self, curves: list[Curve]):
        """Draw these, in their order's colours, in place of those before. What is as it was is left as it is: only then is it quick enough
        to be done while the curve of the render under way grows."""
        style, visible = self.style_, [one for one in curves if (shown(one)[1] > 0).any()]
        while len(self._drawn) < len(curves):
            self._drawn.append(Drawn(self.plot, style.color(len(self._drawn)), style))
        for one, drawn in itertools.zip_longest(curves, self._drawn):
            drawn.show(one is not None and one in visible)
        for guide in self._guides:
            guide.show(bool(visible))
        if not visible:
            return
        x = np.concatenate([np.log10(one.seconds[one.seconds > 0]) for one in visible])
        heights = np.concatenate([kind[kind > 0] for one in visible for kind in (one.estimate, one.error)])
        y = np.log10(heights)
        left, low = (math.floor(side.min() / STEP) * STEP for side in (x, y))
        right, high = (max(math.ceil(side.max() / STEP) * STEP, least + 3 * STEP) for side, least in ((x, left), (y, low)))
        width, height = right - left, high - low
        for guide, (slope, text) in zip(self._guides, SLOPES):
            at = min(width, height / -slope) * 0.92
            guide.draw(guide.estimate, [left, right], [high, high + slope * width])
            guide.write(text, left + at, high + slope * at)
        ends = {id(one): last(one) for one in visible}
        labels = dict(zip(ends, apart([end[1] for end in ends.values()], 1.15 * height * style.line)))
        for one, drawn in zip(curves, self._drawn):
            if id(one) not in ends:
                continue
            for item, values in ((drawn.estimate, one.estimate), (drawn.error, one.error), (drawn.points, one.error)):
                good = (values > 0) & (one.seconds > 0)
                drawn.draw(item, np.log10(one.seconds[good]), np.log10(values[good]))
            drawn.write(one.name, ends[id(one)][0] + 0.015 * width, labels[id(one)])
        frame = (left - 0.03 * width, right + style.margin([one.name for one in visible], 1) * width,
                 low - 0.08 * height, max([high, *labels.values()]) + 0.08 * height)
        if frame != self._frame:
            self._frame = frame
            self.plot.setXRange(*frame[:2])
            self.plot.setYRange(*frame[2:])


class Drawn:
    """What a curve is drawn with: a dashed line of its estimate, a solid one with points of its error, and its name; a guide is dotted."""

    def __init__(self, plot: pg.PlotItem, color: str, style: Style, guide: bool = False):
        kind = Qt.PenStyle.DotLine if guide else Qt.PenStyle.DashLine
        self.estimate = pg.PlotCurveItem(pen=pg.mkPen(color, width=1 if guide else style.letters / 10, style=kind), antialias=True)
        self.error = pg.PlotCurveItem(pen=pg.mkPen(color, width=style.letters / 6), antialias=True)
        self.points = pg.ScatterPlotItem(size=style.letters * 0.4, brush=color, pen=None, antialias=True)
        self.name = write(plot, "", 0, 0, color, style, small=guide)
        self._items, self._now = (self.estimate, self.error, self.points, self.name), {}
        self._empty = set(self._items[:3])      # not to be painted: pyqtgraph takes 0.3 ms for no points at all
        for item in self._empty:
            plot.addItem(item, ignoreBounds=True)

    def show(self, on: bool):
        for item in self._items:
            item.setVisible(on and item not in self._empty)

    def draw(self, item: pg.PlotCurveItem | pg.ScatterPlotItem, x, y):
        """Let an item go through points."""
        points = tuple(x), tuple(y)
        if self._now.get(item) != points:
            self._now[item] = points
            item.setData(np.array(x, float), np.array(y, float))
            (self._empty.discard if points[0] else self._empty.add)(item)
            item.setVisible(bool(points[0]))

    def write(self, text: str, x: float, y: float):
        """Put the name at a place."""
        if self._now.get("text") != text:
            self._now["text"] = text
            self.name.setText(text)
        self.name.setPos(x, y)


def shown(one: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Seconds, and the error where it is known, else the estimate."""
    return one.seconds, np.where(np.isfinite(one.error), one.error, one.estimate)


def last(one: Curve) -> tuple[float, float]:
    """Where a curve ends, as logarithms."""
    seconds, values = shown(one)
    good = np.flatnonzero((values > 0) & (seconds > 0))[-1]
    return math.log10(seconds[good]), math.log10(values[good])


def read(path: Path) -> list[Curve]:
    """The curves of a `convergence.csv`, a method's runs each of its own."""
    runs: dict[tuple[str, str], list] = {}
    with open(path, encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            runs.setdefault((line["method"], line["run"]), []).append([float(line[key]) for key in ("seconds", "estimate", "rmse")])
    return [curve(method, points) for (method, run), points in runs.items() if run == "0"]


def draw(folder: str | os.PathLike) -> Path:
    """Draw `convergence.png` beside the tables in a folder. Needs no display: without an application one is made on Qt's offscreen
    platform."""
    if QApplication.instance() is None:
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
        draw.application = QApplication(["rayscope"])
    folder = Path(folder)
    figure = ErrorFigure(PRINTED)
    figure.show_curves(read(folder / "convergence.csv"))
    path = folder / "convergence.png"
    save(figure, path)
    figure.deleteLater()
    return path
