"""The stability report's plots: error against distance and against scale, and the work-precision diagram, a curve per solver.

`python -m app.plots FOLDER` draws them beside the report. As in SciML's work-precision diagrams, failures are drawn as failures: a
solver with wrong hits has an open mark at the upper edge.
"""
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

if __name__ == "__main__":
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")       # before Qt is imported: no display is needed

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QFont
from PySide6.QtWidgets import QApplication
from pyqtgraph.exporters import ImageExporter

from app.report import Report, ReportError, Row, binned, read
from app.theme import Theme

SIZE = 1600, 1000           # of a file, in pixels
FLOOR = -1.0                # log10 of the least error drawn, 0.1 ulp; a rounded true value is off by up to 0.5
PRECISIONS = {"f32": "float32", "f64": "float64"}
MARKS = {"f32": "s", "f64": "o"}
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

#: Okabe and Ito's colours, which the colour-blind can tell apart, without those that are pale on white; then again, lighter, on dark.
ON_LIGHT = ("#0072b2", "#d55e00", "#009e73", "#aa4499", "#8a6d00", "#333333", "#4477cc", "#882255")
ON_DARK = ("#56b4e9", "#e8833a", "#2cc79a", "#e08fc0", "#e6c229", "#d0d0d0", "#8fa8f0", "#c77094")


class Style(NamedTuple):
    """How a figure looks: its paper and inks, the size of its letters in pixels, and a line of them as a share of a plot's height."""

    paper: str
    ink: str
    faint: str
    colors: tuple[str, ...]
    letters: int
    line: float

    def color(self, number: int) -> str:
        """The colour of the curve of that number."""
        return self.colors[number % len(self.colors)]


PRINTED = Style("#ffffff", "#222222", "#666666", ON_LIGHT, 21, 0.05)


def on_screen(theme: Theme) -> Style:
    """The style of a figure within the window."""
    return Style(theme.panel, theme.text, theme.muted, ON_DARK if theme.name == "dark" else ON_LIGHT, 12, 0.11)


class Decades(pg.AxisItem):
    """An axis of logarithms to the base 10: labels at powers of ten, as many as fit, with small ticks between them; where less than two
    powers are in sight, at 1, 2 and 5 of each."""

    def tickValues(self, low: float, high: float, size: float):
        decades = range(math.floor(low), math.ceil(high) + 1)
        ticks = [n + math.log10(k) for n in decades for k in range(1, 10)]
        step = max(1, math.ceil((high - low) * 55 / max(size, 1)))
        if high - low < 2:
            labelled = [n + math.log10(k) for n in decades for k in (1, 2, 5)]
        else:
            labelled = [float(n) for n in decades if n % step == 0]
        between = ticks if step == 1 else [float(n) for n in decades]
        labelled, between = ([x for x in values if low <= x <= high] for values in (labelled, between))
        return [(step, labelled), (0.1, [x for x in between if x not in labelled])]

    def tickStrings(self, values, scale, spacing):
        if spacing < 1:
            return [""] * len(values)
        if all(value == round(value) for value in values) and len(values) > 2:
            return ["10" + str(round(value)).translate(RAISED) for value in values]
        return [f"{10 ** value:,.6g}" for value in values]


class Figure(pg.GraphicsLayoutWidget):
    """A title, a line that says how to read it, and one or more plots side by side."""

    def __init__(self, title: str, reading: str, style: Style):
        super().__init__()
        self.style_ = style
        self.setBackground(style.paper)
        self.setAccessibleName(title)
        self.setAccessibleDescription(reading)
        letters = style.letters
        self.ci.layout.setContentsMargins(letters, letters * 0.7, letters, letters * 0.7)
        self.ci.layout.setSpacing(letters * 0.4)
        self.addLabel(title, row=0, col=0, colspan=2, size=f"{round(letters * 1.35)}px", color=style.ink, bold=True, justify="left")
        self.addLabel(reading, row=1, col=0, colspan=2, size=f"{round(letters * 0.9)}px", color=style.faint, justify="left")

    def panel(self, column: int, title: str, bottom: str, left: str) -> pg.PlotItem:
        """A plot with logarithmic axes that nobody can drag away."""
        style = self.style_
        plot = self.addPlot(row=2, col=column, axisItems={side: Decades(side) for side in ("bottom", "left")})
        if title:
            plot.setTitle(title, size=f"{style.letters}px", color=style.ink)
        font = QFont()
        font.setPixelSize(round(style.letters * 0.85))
        for side, text in (("bottom", bottom), ("left", left)):
            axis = plot.getAxis(side)
            axis.setStyle(tickFont=font, tickTextOffset=round(style.letters * 0.4))
            axis.setPen(style.faint)
            axis.setTextPen(style.ink)
            axis.setLabel(text, **{"color": style.ink, "font-size": f"{round(style.letters * 0.95)}px"})
        plot.showGrid(x=True, y=True, alpha=0.18)
        plot.setMouseEnabled(False, False)
        plot.setMenuEnabled(False)
        plot.hideButtons()
        plot.getViewBox().setDefaultPadding(0)
        return plot


def error_against(report: Report, shape: str, what: str, style: Style = PRINTED) -> Figure:
    """Error against `what`, "distance" or "scale": a panel per precision, a curve per solver."""
    figure = Figure(f"{shape.capitalize()}: error against {what}", "Line: median of the rays in half a decade. Dots: the largest error "
                    "among them. The scale is logarithmic; 0.1 ulp and less is drawn at 0.1.", style)
    bottom = "distance of the eye / radii of the shape" if what == "distance" else "size of the shape / scene units"
    panels = []
    for column, (precision, name) in enumerate(PRECISIONS.items()):
        plot = figure.panel(column, name, bottom, "error of t / ulp" if column == 0 else "")
        curves = []
        for number, solver in enumerate(report.solvers(shape)):
            points = report.points.get((shape, solver, precision))
            if points is not None:
                with np.errstate(divide="ignore", invalid="ignore"):
                    logs = np.log10(points[:, [0 if what == "distance" else 1, 2]])
                middles, medians, maxima = binned(logs[:, 0], np.maximum(logs[:, 1], FLOOR))
                if len(middles):
                    curves.append((number, solver, middles, medians, maxima))
        panels.append((plot, curves))
    top = max((c[4].max() for _, curves in panels for c in curves), default=1.0)
    for plot, curves in panels:
        left = min((c[2][0] for c in curves), default=0.0)
        right = max((c[2][-1] for c in curves), default=1.0)
        width = max(right - left, 1.0)
        plot.setXRange(left - 0.04 * width, right + 0.36 * width)
        plot.setYRange(FLOOR - 0.3, max(top, 1.0) + 0.5)
        heights = apart([c[3][-1] for c in curves], (max(top, 1.0) + 0.8 - FLOOR) * style.line)
        for (number, solver, middles, medians, maxima), height in zip(curves, heights):
            color = style.color(number)
            plot.plot(middles, medians, pen=pg.mkPen(color, width=style.letters / 6), antialias=True)
            plot.plot(middles, maxima, pen=None, symbol="o", symbolSize=style.letters * 0.38, symbolBrush=color, symbolPen=None)
            write(plot, solver, middles[-1] + 0.03 * width, height, color, style)
    return figure


def work_precision(report: Report, shape: str, style: Style = PRINTED) -> Figure:
    """Error against time: a mark per solver and precision, small ones for each family of rays."""
    figure = Figure(f"{shape.capitalize()}: work and precision", "Large marks: the worst family of rays; small: each family. Squares: "
                    "float32; circles: float64. Open, at the upper edge: hits that were missed or made up.", style)
    plot = figure.panel(0, "", "time / ns per ray", "error of t, 99th percentile / ulp")
    marks, failed = [], []
    for number, solver in enumerate(report.solvers(shape)):
        for precision in PRECISIONS:
            wanted = shape, solver, precision
            rows = [row for row in report.rows if (row.shape, row.solver, row.precision) == wanted and row.ns_per_ray > 0]
            if rows:
                time = math.log10(float(np.median([row.ns_per_ray for row in rows])))
                marks.append((number, solver, precision, time, [(math.log10(row.ns_per_ray), height_of(row)) for row in rows]))
                if failures := sum(row.failures for row in rows):
                    failed.append((number, precision, time, f"{failures:,.0f} of {sum(row.rays for row in rows):,.0f}"))
    times = [time for *_, families in marks for time, _ in families] or [1.0]
    heights = [height for *_, families in marks for _, height in families if height is not None]
    low, high, top = min(times), max(times), max([*heights, 1.0])
    width = max(high - low, 0.5)
    plot.setXRange(low - 0.08 * width, high + 0.25 * width)
    line = (top - FLOOR) * 1.3 * style.line     # the height of one at the upper edge, a line for each solver that fails
    failing = list(dict.fromkeys(number for number, *_ in failed))
    plot.setYRange(FLOOR - 0.3, top + 0.3 + line * (len(failing) + 0.5))
    small, large = style.letters * 0.35, style.letters * 0.8
    ends = {}
    for number, solver, precision, time, families in marks:
        color, drawn = style.color(number), [(t, h) for t, h in families if h is not None]
        faded = QColor(color)
        faded.setAlpha(110)
        plot.plot([t for t, _ in drawn], [h for _, h in drawn], pen=None, symbol=MARKS[precision], symbolSize=small, symbolBrush=faded,
                  symbolPen=None)
        if drawn:
            ends.setdefault((number, solver), []).append((time, max(h for _, h in drawn), MARKS[precision]))
    labels = apart([points[-1][1] for points in ends.values()], 0.8 * line)
    for ((number, solver), points), height in zip(ends.items(), labels):
        color = style.color(number)
        plot.plot([p[0] for p in points], [p[1] for p in points], pen=pg.mkPen(color, width=style.letters / 8),
                  symbol=[p[2] for p in points], symbolSize=large, symbolBrush=color, symbolPen=pg.mkPen(style.paper, width=1),
                  antialias=True)
        write(plot, solver, points[-1][0] + 0.02 * width, height, color, style)
    for number, precision, time, words in failed:
        edge = top + 0.3 + line * (failing.index(number) + 0.6)
        plot.plot([time], [edge], pen=None, symbol=MARKS[precision], symbolSize=large, symbolBrush=None,
                  symbolPen=pg.mkPen(style.color(number), width=style.letters / 8))
        write(plot, words, time + 0.012 * width, edge, style.color(number), style, small=True)
    return figure


def height_of(row: Row) -> float | None:
    """Logarithm of a row's error, None where there is none."""
    return max(math.log10(row.p99), FLOOR) if 0 < row.p99 < math.inf else FLOOR if row.p99 == 0 else None


def apart(heights: list[float], least: float) -> list[float]:
    """The heights of labels, moved up until there is `least` between any two."""
    result, last = list(heights), -math.inf
    for i in sorted(range(len(heights)), key=lambda i: heights[i]):
        result[i] = last = max(heights[i], last + least)
    return result


def write(plot: pg.PlotItem, text: str, x: float, y: float, color: str, style: Style, small: bool = False):
    """Write to the right of a point."""
    label = pg.TextItem(text, color=color, anchor=(0, 0.5))
    font = QFont()
    font.setPixelSize(round(style.letters * (0.75 if small else 0.95)))
    font.setWeight(QFont.Weight.DemiBold)
    label.setFont(font)
    label.setPos(x, y)
    plot.addItem(label, ignoreBounds=True)


#: The figures of a shape, by name.
FIGURES: dict[str, Callable[[Report, str, Style], Figure]] = {
    "work-precision": work_precision,
    "distance": lambda report, shape, style: error_against(report, shape, "distance", style),
    "scale": lambda report, shape, style: error_against(report, shape, "scale", style),
}


def stability(folder: str | os.PathLike) -> list[Path]:
    """Draw the report in a folder; returns the PNG files written there. ReportError if there is no report, OSError if it can't be written.

    Needs no display: without an application one is made on Qt's offscreen platform.
    """
    if QApplication.instance() is None:
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
        stability.application = QApplication(["rayscope"])
    folder, written = Path(folder), []
    report = read(folder)
    for shape in report.shapes:
        for name, draw in FIGURES.items():
            figure = draw(report, shape, PRINTED)
            path = folder / f"stability-{shape}-{name}.png"
            save(figure, path)
            figure.deleteLater()
            written.append(path)
    return written


def save(figure: Figure, path: Path):
    """Write a figure as PNG of `SIZE`, beside the path first and then in its place."""
    figure.setAttribute(Qt.WidgetAttribute.WA_DontShowOnScreen)
    figure.resize(*SIZE)
    figure.show()       # so that it is laid out, though not seen
    QApplication.processEvents()
    exporter = ImageExporter(figure.scene())
    exporter.parameters()["width"] = SIZE[0]
    image = exporter.export(toBytes=True)
    figure.hide()
    part = path.with_suffix(".part")
    if not image.save(str(part), "PNG"):
        raise OSError(None, "can't be written", str(path))
    os.replace(part, path)


def main(arguments: list[str]) -> int:
    """Draw the report in a folder. Returns the exit code."""
    if len(arguments) != 1:
        print("usage: python -m app.plots FOLDER", file=sys.stderr)
        return 2
    try:
        for path in stability(arguments[0]):
            print(path)
    except ReportError as error:
        print(f"app.plots: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"app.plots: {error.filename}: {(error.strerror or 'failed').lower()}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
