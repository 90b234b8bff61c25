"""Error against run time as curves: the figure of the convergence report and of its panel."""
import csv
import math
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication

from app.plots import PRINTED, Figure, Style, apart, save, write

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
        self.plot = self.panel(0, "", "seconds", "root mean square error")

    def show_curves(self, curves: list[Curve]):
        """Draw these, in their order's colours, in place of those before."""
        plot, style = self.plot, self.style_
        plot.clear()
        for item in [item for item in plot.vb.addedItems if isinstance(item, pg.TextItem)]:
            plot.removeItem(item)
        drawn = [(number, one) for number, one in enumerate(curves) if (shown(one)[1] > 0).any()]
        if not drawn:
            return
        x = np.concatenate([np.log10(one.seconds[one.seconds > 0]) for _, one in drawn])
        heights = np.concatenate([kind[kind > 0] for _, one in drawn for kind in (one.estimate, one.error)])
        y = np.log10(heights)
        left, right, low, high = x.min(), max(x.max(), x.min() + 0.3), y.min(), max(y.max(), y.min() + 0.3)
        width, height = right - left, high - low
        for slope, text in SLOPES:
            plot.plot([left, right], [high, high + slope * width], pen=pg.mkPen(style.faint, width=1, style=Qt.PenStyle.DotLine))
            at = min(width, height / -slope) * 0.92
            write(plot, text, left + at, high + slope * at, style.faint, style, small=True)
        for number, one in drawn:
            color = style.color(number)
            for values, dashed in ((one.estimate, True), (one.error, False)):
                good = (values > 0) & (one.seconds > 0)
                if good.any():
                    pen = pg.mkPen(color, width=style.letters / (10 if dashed else 6),
                                   style=Qt.PenStyle.DashLine if dashed else Qt.PenStyle.SolidLine)
                    plot.plot(np.log10(one.seconds[good]), np.log10(values[good]), pen=pen, antialias=True, symbol=None if dashed else "o",
                              symbolSize=style.letters * 0.4, symbolBrush=color, symbolPen=None)
        ends = [last(one) for _, one in drawn]
        labels = apart([end[1] for end in ends], 1.15 * height * style.line)
        for (number, one), end, label in zip(drawn, ends, labels):
            write(plot, one.name, end[0] + 0.015 * width, label, style.color(number), style)
        plot.setXRange(left - 0.03 * width, right + style.margin([one.name for _, one in drawn], 1) * width)
        plot.setYRange(low - 0.08 * height, max([high, *labels]) + 0.08 * height)


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
