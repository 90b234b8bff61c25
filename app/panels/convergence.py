"""The convergence panel: the error of the picture against time, as it falls, beside runs that were pinned."""
import importlib
from pathlib import Path

from PySide6.QtCore import QSize, QTimer, Slot
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QComboBox, QFileDialog, QHBoxLayout, QLabel, QListWidget, QProgressBar, QVBoxLayout, QWidget

from app.panels.base import Panel, button
from app.referring import Referring
from app.runs import Point, Run, as_csv, names
from app.session import Session
from app.theme import DARK, Theme
from app.worker import Shown
from rtcore.files import FileError, write_file

EVERY = 150         # ms at least between two drawings
SOON = 20           # ms from the panel's being shown to its drawing
SAMPLES = (256, 1024, 4096)


class ConvergencePanel(Panel):
    """Follows the picture from its first to its last frame. Nothing is drawn while nobody looks."""

    title, icon, area, tip = "Convergence", "convergence", "bottom", "See how the error falls with time, and compare ways to render"

    def __init__(self, session: Session, parent: QWidget | None = None, referring: Referring | None = None):
        super().__init__(session, parent)
        self._theme: Theme = DARK
        self._figure = None
        self._plotting: str | None = None       # "loading", then "loaded"
        self.run: Run | None = None
        self.pinned: list[Run] = []
        self.referring = referring or Referring()
        self.referring.setParent(self)
        self.referring.progressed.connect(self._progress)
        self.referring.ended.connect(self._referred)
        self.again = button("Run again", "Render the picture from its start, with nothing known of it", self._again)
        self.refer = button("Reference", "Render a reference in the background, so that the true error is known", self._refer)
        self.samples = QComboBox()
        self.samples.addItems([f"{n} samples" for n in SAMPLES])
        self.samples.setAccessibleName("Samples of the reference")
        self.samples.setToolTip("Samples per pixel of the reference: its own error must be well below that of what it judges")
        self.pin = button("Pin", "Keep this run, to compare the next ones with it", self._pin)
        self.unpin = button("Unpin", "Forget the pinned run that is selected, or the last one", self._unpin)
        self.table = button("CSV…", "Save the runs as a table", self._save_table)
        self.drawing = button("PNG…", "Save the plot as a picture", self._save_drawing)
        self.bar = QProgressBar()
        self.bar.setRange(0, 1000)
        self.bar.setTextVisible(False)
        self.bar.setMaximumWidth(160)
        self.bar.setAccessibleName("Progress of the reference")
        self.bar.hide()
        self.told = QLabel()
        self.told.setProperty("role", "hint")
        self.told.setAccessibleName("The error now")
        row = QHBoxLayout()
        for widget in (self.again, self.pin, self.unpin, self.refer, self.samples, self.bar, self.told):
            row.addWidget(widget)
        row.addStretch(1)
        row.addWidget(self.table)
        row.addWidget(self.drawing)
        self.pins = QListWidget()
        self.pins.setAccessibleName("Pinned runs")
        self.pins.setToolTip("Pinned runs, by what differs between them")
        self.pins.setMaximumWidth(210)
        self.pins.hide()
        self.place = QVBoxLayout()
        under = QHBoxLayout()
        under.addLayout(self.place, 1)
        under.addWidget(self.pins)
        self.column.addLayout(row)
        self.column.addLayout(under, 1)
        self._timer = QTimer(self, singleShot=True)
        self._timer.timeout.connect(self._draw)
        session.frame_changed.connect(self._frame)
        self._changed()

    def sizeHint(self) -> QSize:
        return QSize(900, 340)

    def dress(self, theme: Theme):
        self._theme = theme
        self._drop_figure()
        self._draw_soon()

    def showEvent(self, event):
        super().showEvent(event)
        self._draw_soon(SOON)

    def hideEvent(self, event):
        super().hideEvent(event)
        if self._figure is not None:        # its place stays; the window lays itself out and paints without it first
            self._figure.hide()

    def close_down(self):
        """End the reference's thread with the window."""
        self.referring.stop()

    def runs(self) -> list[Run]:
        """The pinned runs, and the one under way."""
        return [*self.pinned, *([self.run] if self.run is not None and self.run not in self.pinned else [])]

    # frames

    @Slot()
    def _frame(self):
        shown = self.session.shown
        frame, job = shown.frame, shown.job
        last = self.run.points[-1] if self.run is not None and self.run.points else None
        again = last is not None and frame.elapsed < last.seconds
        if self.run is None or again or not self.run.goes_on(job):
            self.run = Run(job)
        self.run.done = frame.done
        if frame.spacing == 1 and frame.error is not None and (last is None or again or frame.elapsed > last.seconds):
            self._judge(shown, self.run)
        self._changed()

    def _judge(self, shown: Shown, run: Run):
        """Note a frame; where there is a reference, on a thread its true error."""
        frame = shown.frame
        point = Point(frame.elapsed, frame.mean, frame.error, None)
        reference = self.referring.reference(shown.job)
        run.add(point)
        if reference is None or shown.job.options.view != "beauty" or reference.pixels.shape != frame.pixels.shape:
            return

        def known(error: float):
            if reference.judges(error):
                run.add(point._replace(error=error))
                self._changed()
        self.session.tasks.run(lambda: reference.rmse(frame.pixels), known, name="true error")

    def _changed(self):
        """Tell how it stands."""
        points = self.run.points if self.run is not None else []
        self.pin.setEnabled(bool(points) and self.run not in self.pinned)
        self.unpin.setEnabled(bool(self.pinned))
        self.again.setEnabled(self.run is not None and self.run.done)
        self.refer.setEnabled(self.session.shown is not None)
        for widget in (self.table, self.drawing):
            widget.setEnabled(any(run.points for run in self.runs()))
        self.told.setText(told(points[-1]) if points else "")
        self._draw_soon()

    # the drawing

    def _draw_soon(self, after: int = EVERY):
        if self.isVisible() and not self._timer.isActive():
            self._timer.start(after)

    @Slot()
    def _draw(self):
        if not self.isVisible():
            return
        if self._plotting != "loaded":
            if self._plotting is None:
                self._plotting = "loading"      # pyqtgraph: 0.4 s, so on a thread
                self.session.tasks.run(lambda: importlib.import_module("app.curves"), self._plots_loaded, name="plots")
            return
        from app import curves, plots
        if self._figure is None:
            self._figure = curves.ErrorFigure(plots.on_screen(self._theme))
            self._figure.setMinimumHeight(220)
            self._figure.setToolTip(self._figure.accessibleDescription())
            policy = self._figure.sizePolicy()
            policy.setRetainSizeWhenHidden(True)
            self._figure.setSizePolicy(policy)
            self.place.addWidget(self._figure)
        self._figure.show_curves(self._curves())
        self._figure.show()
        for row, name in enumerate(names(self.runs())[:len(self.pinned)]):      # as the plot has them
            self.pins.item(row).setText(name)
            self.pins.item(row).setForeground(QColor(self._figure.style_.color(row)))

    def _plots_loaded(self, _):
        self._plotting = "loaded"
        self._draw_soon()

    def _curves(self) -> list:
        from app import curves
        runs = self.runs()
        return [curves.curve(name, [(p.seconds, p.estimate, p.error) for p in run.points]) for run, name in zip(runs, names(runs))]

    def _drop_figure(self):
        if self._figure is not None:
            self.place.removeWidget(self._figure)
            self._figure.deleteLater()
            self._figure = None

    # what can be done

    def _again(self):
        if self.run is not None and self.run.done:
            self.run = None
            self.session.submit(anew=True)

    def _pin(self):
        if self.run is not None:
            self.pinned.append(self.run)
            self._list_pins()

    def _unpin(self):
        row = self.pins.currentRow()
        if self.pinned:
            self.pinned.pop(row if 0 <= row < len(self.pinned) else -1)
            self._list_pins()

    def _list_pins(self):
        self.pins.clear()
        self.pins.addItems(names(self.pinned))
        self.pins.setVisible(bool(self.pinned))
        self._changed()

    def _refer(self):
        if self.referring.running:
            self.referring.stop()
            self._end_reference()
        elif self.session.shown is not None:
            self.referring.start(self.session.shown.job, SAMPLES[self.samples.currentIndex()])
            self._progress(0.0)
            self._name_reference("Stop", "End the rendering of the reference")

    @Slot(float)
    def _progress(self, share: float):
        if self.referring.running:
            self.bar.show()
            self.bar.setValue(round(1000 * share))

    @Slot(str)
    def _referred(self, complaint: str):
        self._end_reference()
        if complaint:
            self.session.said.emit("error", f"The reference was not made: {complaint}")
        else:
            self._again()       # so that all of the run can be judged

    def _end_reference(self):
        self.bar.hide()
        self._name_reference("Reference", "Render a reference in the background, so that the true error is known")

    def _name_reference(self, text: str, tip: str):
        self.refer.setText(text)
        self.refer.setAccessibleName(text)
        self.refer.setToolTip(tip)

    def _save_table(self):
        content = as_csv(self.runs())
        self._save("Save the runs", "convergence.csv", "Tables (*.csv)", lambda path: write_file(path, content))

    def _save_drawing(self):
        from app import curves, plots

        def draw(path: Path):
            figure = curves.ErrorFigure(plots.PRINTED)
            figure.show_curves(self._curves())
            try:
                plots.save(figure, path)
            finally:
                figure.deleteLater()
        self._save("Save the plot", "convergence.png", "Pictures (*.png)", draw)

    def _save(self, title: str, name: str, kinds: str, write):
        chosen, _ = QFileDialog.getSaveFileName(self, title, str(Path.cwd() / name), kinds)
        if not chosen:
            return
        try:
            write(Path(chosen))
        except OSError as error:
            self.session.said.emit("error", f"{Path(chosen).name}: {(error.strerror or str(error)).lower()}")
        except FileError as error:
            self.session.said.emit("error", str(error))
        else:
            self.session.said.emit("info", f"Saved {Path(chosen).name}")


def told(point: Point) -> str:
    """A point in words."""
    true = f", true error {point.error:.2g}" if point.error is not None else ""
    return f"{point.samples:.4g} samples, estimate {point.estimate:.2g}{true}"
