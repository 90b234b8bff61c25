"""The stability panel: measures how far every solver is from the truth, and shows it as plots and as a table of the worst."""
import math
import shutil
from pathlib import Path

from PySide6.QtCore import QSize, Qt, Slot
from PySide6.QtWidgets import (QAbstractItemView, QComboBox, QFileDialog, QHBoxLayout, QHeaderView, QLabel, QProgressBar, QStackedWidget,
                               QTabBar, QTableWidget, QTableWidgetItem, QWidget)

from app.commands._progress import time_in_words
from app.measuring import Measuring
from app.panels.base import Panel, button
from app.report import Report, ReportError, Row, read
from app.session import Session
from app.theme import DARK, Theme
from rtcore.shapes import SHAPE_MODULES

ALL = "all shapes"
TABS = ("Work and precision", "Distance", "Scale", "Worst rows")
FIGURES = ("work-precision", "distance", "scale")       # of app.plots, in the order of the tabs
COLUMNS = ("Shape", "Solver", "Precision", "Family", "Rays", "Wrong", "Not finite", "p99 / ulp", "Max / ulp", "ns per ray", "Target", "Met")


def cells(row: Row) -> tuple[str, ...]:
    """A row of the table as it is shown."""
    met = {True: "yes", False: "no", None: ""}[row.met]
    counts = (f"{count:,.0f}" for count in (row.rays, row.wrong, row.nonfinite))
    errors = ("" if math.isnan(value) else f"{value:,.3g}" for value in (row.p99, row.max_ulp, row.ns_per_ray))
    return row.shape, row.solver, row.precision, row.family, *counts, *errors, row.target, met


class StabilityPanel(Panel):
    """Nothing is measured or read until the panel is seen."""

    title, icon, area, tip = "Stability", "stability", "bottom", "Measure how far every solver is from the truth"

    def __init__(self, session: Session, parent: QWidget | None = None, measuring: Measuring | None = None):
        super().__init__(session, parent)
        self._theme: Theme = DARK
        self._report: Report | None = None
        self.measuring = measuring or Measuring()
        self.measuring.setParent(self)
        self.measuring.progressed.connect(self._progress)
        self.measuring.ended.connect(self._ended)
        self.measured, self.amount, self.shown = QComboBox(), QComboBox(), QComboBox()
        self.measured.addItems([ALL, *(name.lower() for name in SHAPE_MODULES)])
        self.amount.addItems(["quick, within a minute", "full, takes long"])
        for combo, name, tip in ((self.measured, "Shape to measure", "Which shape to measure"),
                                 (self.amount, "Size of the report", "How many rays are measured"),
                                 (self.shown, "Shape shown", "The shape whose plots are shown")):
            combo.setAccessibleName(name)
            combo.setToolTip(tip)
        self.run = button("Run", "Measure now, in the background", self._run)
        self.save = button("Save report…", "Copy tables and plots to a folder", self._save)
        self.bar, self.doing = QProgressBar(), QLabel()
        self.bar.setRange(0, 1000)
        self.bar.setTextVisible(False)
        self.bar.setAccessibleName("Progress of the report")
        self.bar.setMaximumWidth(220)
        self.bar.hide()
        self.doing.setProperty("role", "hint")
        self.doing.setAccessibleName("What is being measured")
        row = QHBoxLayout()
        for widget in (self.run, self.amount, self.measured, self.bar, self.doing):
            row.addWidget(widget)
        row.addStretch(1)
        row.addWidget(self.save)
        self.tabs, self.pages, self.table = QTabBar(), QStackedWidget(), worst_table()
        for name in TABS:
            self.tabs.addTab(name)
        self.tabs.setDrawBase(False)
        self.tabs.setStyleSheet("QTabBar { background: transparent; }")
        self.tabs.setAccessibleName("What the report shows")
        under = QHBoxLayout()
        under.addWidget(self.tabs)
        under.addStretch(1)
        under.addWidget(self.shown)
        self.empty = QLabel("Run the report to see how each solver fares far away, grazing, at tiny and huge scales, against 50 digits.")
        self.empty.setProperty("role", "hint")
        self.empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self.table)
        self.column.addLayout(row)
        self.column.addLayout(under)
        self.column.addWidget(self.pages, 1)
        self.tabs.currentChanged.connect(self._show)
        self.shown.currentIndexChanged.connect(self._show)
        self._set_report(None)

    def sizeHint(self) -> QSize:
        return QSize(900, 400)

    def dress(self, theme: Theme):
        self._theme = theme
        self._show()

    def showEvent(self, event):
        super().showEvent(event)
        if self._report is None:
            self._load()

    def close_down(self):
        """End the helper with the window."""
        self.measuring.stop()

    # the report

    def _load(self):
        def failed(error: Exception):
            if not isinstance(error, ReportError):
                self.session.said.emit("error", f"The report can't be read: {error}")
        folder = self.measuring.folder
        self.session.tasks.run(lambda: read(folder), self._set_report, failed, name="report")

    def _set_report(self, report: Report | None):
        self._report, before = report, self.shown.currentText()
        self.shown.blockSignals(True)
        self.shown.clear()
        self.shown.addItems(report.shapes if report else [])
        self.shown.setCurrentText(before)
        self.shown.blockSignals(False)
        self.save.setEnabled(report is not None)
        rows = report.worst() if report else []
        self.table.setRowCount(len(rows))
        for i, row in enumerate(rows):
            for j, text in enumerate(cells(row)):
                item = QTableWidgetItem(text)
                item.setTextAlignment(Qt.AlignmentFlag.AlignVCenter
                                      | (Qt.AlignmentFlag.AlignRight if 4 <= j < 10 else Qt.AlignmentFlag.AlignLeft))
                self.table.setItem(i, j, item)
        self._show()

    @Slot()
    def _show(self):
        """The page that belongs to the tab and the shape; a figure is drawn when it is first looked at."""
        index = self.tabs.currentIndex()
        while self.pages.count() > 2:       # the figure before
            old = self.pages.widget(2)
            self.pages.removeWidget(old)
            old.deleteLater()
        self.shown.setVisible(self._report is not None and index < len(FIGURES))
        if self._report is None or not self._report.rows:
            self.pages.setCurrentWidget(self.empty)
        elif index < len(FIGURES):
            from app import plots       # pyqtgraph is not needed before
            figure = plots.FIGURES[FIGURES[index]](self._report, self.shown.currentText(), plots.on_screen(self._theme))
            figure.setMinimumHeight(260)
            figure.setToolTip(figure.accessibleDescription())
            self.pages.setCurrentIndex(self.pages.addWidget(figure))
        else:
            self.pages.setCurrentWidget(self.table)

    # running

    def _run(self):
        if self.measuring.running:
            self.measuring.stop()
            return
        shape = self.measured.currentText()
        self.measuring.start(self.amount.currentIndex() == 0, None if shape == ALL else shape)
        if self.measuring.running:
            self._progress(0.0, "starting", None)
            self._name_button("Stop", "End the measuring; the report before stays")

    @Slot(float, str, object)
    def _progress(self, share: float, what: str, left: float | None):
        self.bar.show()
        self.bar.setValue(round(1000 * share))
        self.doing.setText(what + (f", {time_in_words(left)} left" if left is not None else ""))

    @Slot(str)
    def _ended(self, complaint: str):
        self.bar.hide()
        self._name_button("Run", "Measure now, in the background")
        self.doing.setText(complaint if complaint == "stopped" else "")
        if not complaint:
            self._load()
        elif complaint != "stopped":
            self.session.said.emit("error", f"The report was not made: {complaint}")

    def _name_button(self, text: str, tip: str):
        self.run.setText(text)
        self.run.setAccessibleName(text)
        self.run.setToolTip(tip)

    def _save(self):
        name = QFileDialog.getExistingDirectory(self, "Save the report in a folder", str(Path.cwd()))
        if not name:
            return
        source, target = self.measuring.folder, Path(name)

        def work() -> int:
            files = sorted(path for path in source.iterdir() if path.is_file())
            for path in files:
                shutil.copyfile(path, target / path.name)
            return len(files)

        def failed(error: Exception):
            self.session.said.emit("error", f"{target.name}: {(getattr(error, 'strerror', '') or str(error)).lower()}")

        def done(count: int):
            self.session.said.emit("info", f"Saved {count} files in {target.name}")

        self.session.tasks.run(work, done, failed, name="save report")


def worst_table() -> QTableWidget:
    """An empty table for the rows to worry about."""
    table = QTableWidget(0, len(COLUMNS))
    table.setAccessibleName("Worst rows of the report")
    table.setToolTip("Missed targets first, then wrong hits and large errors")
    table.setHorizontalHeaderLabels(COLUMNS)
    table.verticalHeader().hide()
    table.setShowGrid(False)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
    table.horizontalHeader().setHighlightSections(False)
    table.horizontalHeader().setStretchLastSection(True)
    table.horizontalHeader().setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    return table
