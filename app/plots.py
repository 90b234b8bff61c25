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
from PySide6.QtCore import QMarginsF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QPainter
from PySide6.QtWidgets import QApplication
from pyqtgraph.exporters import ImageExporter

from app.report import Report, ReportError, Row, binned, read
from app.theme import Theme

SIZE = 1600, 1000           # of a file, in pixels
FLOOR = -1.0                # log10 of the least error drawn, 0.1 ulp; a rounded true value is off by up to 0.5
CEILING = {"f32": 24 * math.log10(2), "f64": 53 * math.log10(2)}       # and of the largest: not one digit is right
DECADES = 12                # distances and scales are drawn up to ten to the power of that
PRECISIONS = {"f32": "float32", "f64": "float64"}
MARKS = {"f32": "s", "f64": "o"}
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

#: Okabe and Ito's colours, which the colour-blind can tell apart, without those that are pale on white; then again, lighter, on dark.
ON_LIGHT = ("#0072b2", "#d55e00", "#009e73", "#aa4499", "#8a6d00", "#333333", "#4477cc", "#882255")
ON_DARK = ("#56b4e9", "#e8833a", "#2cc79a", "#e08fc0", "#e6c229", "#d0d0d0", "#8fa8f0", "#c77094")


class Style(NamedTuple):
    """How a figure looks: its paper and inks, the size of its letters in pixels; a line of them as a share of a plot's height, and a letter
    as a share of a figure's width; whether it has a title."""

    paper: str
    ink: str
    faint: str
    colors: tuple[str, ...]
    letters: int
    line: float
    letter: float
    titled: bool

    def color(self, number: int) -> str:
        """The colour of the curve of that number."""
        return self.colors[number % len(self.colors)]

    def margin(self, names: list[str], plots: int) -> float:
        """Room for names at the right, as a share of the width of what is drawn, where so many plots stand side by side."""
        share = 0.06 + plots * self.letter * max(map(len, names), default=0)
        return share / (1 - share)


PRINTED = Style("#ffffff", "#222222", "#666666", ON_LIGHT, 21, 0.05, 0.009, True)


def on_screen(theme: Theme) -> Style:
    """The style of a figure within the window, where tab and panel say what it is."""
    return Style(theme.panel, theme.text, theme.muted, ON_DARK if theme.name == "dark" else ON_LIGHT, 12, 0.09, 0.0065, False)


class Decades(pg.AxisItem):
    """An axis of logarithms to the base 10: labels at powers of ten, as many as fit, with small ticks between them; where less than two
    powers are in sight, at 1, 2 and 5 of each. Nothing above `most` has a tick."""

    most = math.inf
    paper = "#ffffff"
    _drawn: tuple | None = None     # the axis, its ticks and its labels, as `generateDrawSpecs` gives them

    def paint(self, painter: QPainter, option, widget):
        """Lines as rectangles, faint ones in the colour that they have on paper: that takes Qt 2 us, a line that shines through 170, and
        there are dozens."""
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        painter.setFont(self.style["tickFont"])
        if self.picture is None:        # so pyqtgraph tells that something has changed
            self._drawn, self.picture = self.generateDrawSpecs(painter), True
        if self._drawn is not None:
            axis, ticks, labels = self._drawn
            for pen, start, end in (axis, *ticks):
                painter.fillRect(QRectF(start, end).normalized() + QMarginsF(0, 0, 1, 1), on_paper(pen.color(), self.paper))
            painter.setPen(self.textPen())
            for place, flags, text in labels:
                painter.drawText(place, int(flags), text)
        painter.restore()

    def tickValues(self, low: float, high: float, size: float):
        decades = range(math.floor(low), math.ceil(high) + 1)
        ticks = [n + math.log10(k) for n in decades for k in range(1, 10)]
        step = max(1, math.ceil((high - low) * 55 / max(size, 1)))
        if high - low < 2:
            labelled = [n + math.log10(k) for n in decades for k in (1, 2, 5)]
        else:
            labelled = [float(n) for n in decades if n % step == 0]
        between = ticks if step == 1 else [float(n) for n in decades]
        labelled, between = ([x for x in values if low <= x <= min(high, self.most)] for values in (labelled, between))
        return [(step, labelled), (0.1, [x for x in between if x not in labelled])]

    def tickStrings(self, values, scale, spacing):
        if spacing < 1:
            return [""] * len(values)
        if all(value == round(value) for value in values):
            return ["10" + str(round(value)).translate(RAISED) for value in values]
        return [f"{10 ** value:,.6g}" for value in values]


def on_paper(color: QColor, paper: str) -> QColor:
    """The colour that another one has where paper shines through it."""
    share = color.alphaF()
    inks, papers = color.getRgbF()[:3], QColor(paper).getRgbF()[:3]
    return QColor.fromRgbF(*(share * ink + (1 - share) * under for ink, under in zip(inks, papers)))


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
        if style.titled:
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
            axis.paper = style.paper
            axis.setZValue(-1)      # its grid lies under the curves
            axis.setStyle(tickFont=font, tickTextOffset=round(style.letters * 0.4))
            axis.enableAutoSIPrefix(False)
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
    figure = Figure(f"{shape.capitalize()}: error against {what}", "Line: the median of the rays in a decade; dots: the largest error "
                    "among them. 10⁷ ulp in float32 and 10¹⁶ in float64 mean that no digit is right.", style)
    bottom = "distance of the eye / radii of the shape" if what == "distance" else "size of the shape / scene units"
    for column, (precision, name) in enumerate(PRECISIONS.items()):
        plot = figure.panel(column, name, bottom, "error of t / ulp" if column == 0 else "")
        curves = []
        for number, solver in enumerate(report.solvers(shape)):
            points = report.points.get((shape, solver, precision), np.empty((0, 3)))
            with np.errstate(divide="ignore", invalid="ignore"):
                x, y = np.log10(points[:, [0 if what == "distance" else 1, 2]]).T
            near = np.abs(x) <= DECADES
            middles, medians, maxima = binned(x[near], np.clip(y[near], FLOOR, CEILING[precision]))
            if np.isfinite(medians).any():
                curves.append((number, solver, middles, medians, maxima))
        left = min((c[2][0] for c in curves), default=0.0)
        right = max((c[2][-1] for c in curves), default=1.0)
        top = max([*(c[4].max() for c in curves), 1.0]) + 0.5
        width = max(right - left, 1.0)
        plot.setXRange(left - 0.04 * width, right + style.margin([c[1] for c in curves], 2) * width)
        plot.setYRange(FLOOR - 0.3, top)
        ends = [np.flatnonzero(np.isfinite(c[3]))[-1] for c in curves]
        heights = apart([c[3][end] for c, end in zip(curves, ends)], (top + 0.3 - FLOOR) * style.line)
        for (number, solver, middles, medians, maxima), end, height in zip(curves, ends, heights):
            color, several, any_ = style.color(number), np.isfinite(medians), np.isfinite(maxima)
            plot.plot(middles[several], medians[several], pen=pg.mkPen(color, width=style.letters / 6), antialias=True)
            plot.plot(middles[any_], maxima[any_], pen=None, symbol="o", symbolSize=style.letters * 0.38, symbolBrush=color, symbolPen=None)
            write(plot, solver, middles[end] + 0.03 * width, height, color, style)
    return figure


class Mark(NamedTuple):
    """A solver in one precision: its place in the diagram."""

    number: int                     # of its colour
    solver: str
    precision: str
    time: float                     # log10 of the median family's nanoseconds
    families: list[tuple[float, float]]     # logarithms of each one's nanoseconds and error
    rays: float
    failures: float


def marks_of(report: Report, shape: str) -> list[Mark]:
    """What is to be drawn in a shape's work-precision diagram."""
    marks = []
    for number, solver in enumerate(report.solvers(shape)):
        for precision in PRECISIONS:
            wanted = shape, solver, precision
            rows = [row for row in report.rows if (row.shape, row.solver, row.precision) == wanted and row.ns_per_ray > 0]
            if rows:
                families = [(math.log10(row.ns_per_ray), height) for row in rows if (height := height_of(row)) is not None]
                marks.append(Mark(number, solver, precision, math.log10(float(np.median([row.ns_per_ray for row in rows]))), families,
                                  sum(row.rays for row in rows), sum(row.failures for row in rows)))
    return marks


def height_of(row: Row) -> float | None:
    """Logarithm of a row's error, within what is drawn; None where there is none."""
    if math.isnan(row.p99):
        return None
    return min(max(math.log10(row.p99), FLOOR), CEILING[row.precision]) if row.p99 > 0 else FLOOR


def work_precision(report: Report, shape: str, style: Style = PRINTED) -> Figure:
    """Error against time: a large mark per solver and precision, a small one for each family of rays."""
    figure = Figure(f"{shape.capitalize()}: work and precision", "Squares: float32; circles: float64. Small: each family of rays; large: "
                    "the median family, with a line up to the worst. Open: hits that were missed or made up.", style)
    plot = figure.panel(0, "", "time / ns per ray", "error of t, 99th percentile / ulp")
    marks = marks_of(report, shape)
    times = [time for mark in marks for time, _ in mark.families] or [1.0]
    low, high, top = min(times), max(times), max([height for mark in marks for _, height in mark.families] + [1.0])
    width, line = max(high - low, 0.5), (top - FLOOR) * 1.3 * style.line
    small, large = style.letters * 0.35, style.letters * 0.75
    ends: dict[tuple[int, str], list[tuple[float, float, str]]] = {}
    for mark in marks:
        color, heights = style.color(mark.number), [height for _, height in mark.families]
        faded = QColor(color)
        faded.setAlpha(110)
        plot.plot([time for time, _ in mark.families], heights, pen=None, symbol=MARKS[mark.precision], symbolSize=small, symbolBrush=faded,
                  symbolPen=None)
        if heights:
            middle = float(np.median(heights))
            plot.plot([mark.time] * 2, [middle, max(heights)], pen=pg.mkPen(faded, width=style.letters / 10))
            ends.setdefault((mark.number, mark.solver), []).append((mark.time, middle, MARKS[mark.precision]))
    labels = apart([points[-1][1] for points in ends.values()], 0.8 * line)
    for ((number, solver), points), height in zip(ends.items(), labels):
        color = style.color(number)
        plot.plot([p[0] for p in points], [p[1] for p in points], pen=pg.mkPen(color, width=style.letters / 8), antialias=True,
                  symbol=[p[2] for p in points], symbolSize=large, symbolBrush=color, symbolPen=pg.mkPen(style.paper, width=1))
        write(plot, solver, max(p[0] for p in points) + 0.02 * width, height, color, style)
    edge = max([top, *labels]) + 0.3        # above it a line for each solver that fails
    failing = [number for number in dict.fromkeys(mark.number for mark in marks) if any(m.failures for m in marks if m.number == number)]
    for place, number in enumerate(failing):
        wrong = [mark for mark in marks if mark.number == number and mark.failures]
        height = edge + line * (place + 0.6)
        plot.plot([mark.time for mark in wrong], [height] * len(wrong), pen=None, symbol=[MARKS[mark.precision] for mark in wrong],
                  symbolSize=large, symbolBrush=None, symbolPen=pg.mkPen(style.color(number), width=style.letters / 8))
        counts = ", ".join(f"{mark.failures:,.0f} of {mark.rays:,.0f} in {PRECISIONS[mark.precision]}" for mark in wrong)
        first, last = min(mark.time for mark in wrong), max(mark.time for mark in wrong)
        at = first - 0.02 * width if first - low > high - last else last + 0.02 * width
        write(plot, f"{wrong[0].solver}: {counts}", at, height, style.color(number), style, small=True, left=at < first)
    plot.getAxis("left").most = top
    plot.setXRange(low - 0.08 * width, high + style.margin([mark.solver for mark in marks], 1) * width)
    plot.setYRange(FLOOR - 0.3, edge + line * (len(failing) + 0.3))
    return figure


def apart(heights: list[float], least: float) -> list[float]:
    """The heights of labels, moved up until there is `least` between any two."""
    result, last = list(heights), -math.inf
    for i in sorted(range(len(heights)), key=lambda i: heights[i]):
        result[i] = last = max(heights[i], last + least)
    return result


def write(plot: pg.PlotItem, text: str, x: float, y: float, color: str, style: Style, small: bool = False,
          left: bool = False) -> pg.TextItem:
    """Write to the right of a point, or to the left."""
    label = pg.TextItem(text, color=color, anchor=(1 if left else 0, 0.5))
    font = QFont()
    font.setPixelSize(round(style.letters * (0.75 if small else 0.95)))
    font.setWeight(QFont.Weight.DemiBold)
    label.setFont(font)
    label.setPos(x, y)
    plot.addItem(label, ignoreBounds=True)
    return label


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
