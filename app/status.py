"""The status bar: how far the picture is, how fast, and what is under the cursor. Every part has its place, so nothing jumps."""
import math

from PySide6.QtCore import QSize, Qt, Slot
from PySide6.QtWidgets import QLabel, QSizePolicy, QStatusBar, QWidget

from app.forecast import Forecast, left_text
from app.options import Options
from app.session import Session

TRACED = ("primary", "shadow", "reflection", "refraction")
MARGIN = 6          # pixels right of a part
PARTS = (("exposure", "+9.99 stops", "How much brighter or darker than it is the picture is shown; one stop doubles the light"),
         ("pass", "error reached, samples 99999/99999", "How far it is: the lattice that is traced, then samples per pixel, their "
          "mean; and what it ended by"),
         ("speed", "9,999.9 Mrays/s", "Rays traced in a second, in millions: primary, shadow, reflected and refracted ones"),
         ("elapsed", "99:59:59.9", "How long this picture has been traced"),
         ("error", "error 0.000012", "Estimated root mean square error, in linear light where white is 1; blind to what no sample met"),
         ("left", "100 to 100 min left", "Time until it stops, from the fastest and the slowest of the latest paces"),
         ("pixel", "99999, 99999", "The pixel under the cursor, counted from the top left"),
         ("distance", "at 1.23456e+10", "How far from the eye that is which the cursor points at, in scene units"))


def pass_text(frame, options: Options, paused: bool = False) -> str:
    """How far a frame is on the way to where it is to stop, and what it stopped by."""
    if frame.spacing > 1:
        return f"1/{frame.spacing} lattice"
    wanted = f"/{options.samples:.0f}" if options.samples is not None and not frame.converged else ""
    state = ended_by(frame, options) if frame.done else "paused" if paused else ""
    return f"{state}{state and ', '}samples {frame.mean:.{4 if frame.mean < 1e4 else 7}g}{wanted}"


def ended_by(frame, options: Options) -> str:
    """What ended a picture."""
    if frame.converged:
        return "converged"
    if options.error is not None and frame.error is not None and frame.error <= options.error:
        return "error reached"
    if options.seconds is not None and frame.elapsed >= options.seconds:
        return "time is up"
    return "done"


def exposure_text(stops: float) -> str:
    """Nothing for a picture that is shown as bright as it is."""
    return f"{stops:+.3g} stop{'' if abs(stops) == 1 else 's'}" if stops else ""


def error_text(error: float | None) -> str:
    """The estimated error, to two digits."""
    if error is None:
        return ""
    return f"error {error:.2g}" if error == 0 or error >= 1e-4 else f"error {error:.1e}"


def speed_text(frame) -> str:
    """Million rays a second of a frame so far; or that there were none, for all that they would meet was known."""
    rays = sum(frame.rays.get(kind, 0) for kind in TRACED)
    if rays == 0 and frame.samples:
        return "no ray traced"
    return f"{rays / frame.elapsed / 1e6:,.1f} Mrays/s" if frame.elapsed > 0 else ""


def elapsed_text(seconds: float) -> str:
    """Seconds as 4.2 s, 3:07.5 or 1:02:03.4."""
    minutes, rest = divmod(seconds, 60)
    if not minutes:
        return f"{rest:.1f} s"
    hours, minutes = divmod(int(minutes), 60)
    return f"{hours}:{minutes:02d}:{rest:04.1f}" if hours else f"{minutes}:{rest:04.1f}"


class Figure(QLabel):
    """A line of text in a place of its own, shortened where it does not fit. A QLabel of a fixed size asks for no other one when its text
    changes: others had all docks, tabs and bars of the window laid out and painted again with every frame. One painted in Python took
    0.1 ms, six of them a frame, and waited each time for the render thread to let go of Python's lock."""

    def __init__(self, name: str, tip: str, align: Qt.AlignmentFlag, parent: QWidget | None = None):
        super().__init__(parent)
        self._text = ""
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setAlignment(align | Qt.AlignmentFlag.AlignVCenter)
        self.setAccessibleName(name)
        self.setToolTip(tip)

    def text(self) -> str:
        """What stands there, not shortened."""
        return self._text

    def setText(self, text: str):
        """Show another text."""
        if text != self._text:
            self._text = text
            self.setAccessibleDescription(text)
            self._show()

    def fit(self, size: QSize):
        """Be of that size."""
        if size != self.size():
            self.setFixedSize(size)
            self._show()

    def _show(self):
        super().setText(self.fontMetrics().elidedText(self._text, Qt.TextElideMode.ElideRight, self.contentsRect().width()))


class Room(QWidget):
    """What is left of a line, for a figure."""

    def __init__(self, name: str, tip: str):
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.figure = Figure(name, tip, Qt.AlignmentFlag.AlignLeft, self)

    def resizeEvent(self, _):
        self.figure.fit(self.size())


class Status(QStatusBar):
    """Left what is under the cursor, right the numbers, each of a fixed width."""

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(parent)
        self._session = session
        self.setSizeGripEnabled(False)
        self.setAccessibleName("Status")
        room = Room("Under the cursor", "What is under the cursor")
        self.addWidget(room, 1)
        self.under = room.figure
        self.under.setContentsMargins(8, 0, 0, 0)
        self.parts: dict[str, Figure] = {}
        self._forecast = Forecast()
        for name, widest, tip in (*PARTS[-2:], *PARTS[:-2]):
            part = Figure(name.capitalize(), tip, Qt.AlignmentFlag.AlignRight)
            part.setContentsMargins(0, 0, MARGIN, 0)
            metrics = part.fontMetrics()
            part.fit(QSize(metrics.horizontalAdvance(widest) + MARGIN, metrics.height() + 2))
            self.addPermanentWidget(part)
            self.parts[name] = part
        session.frame_changed.connect(self._frame)
        session.paused_changed.connect(self._frame)
        session.hover_changed.connect(self._hover)
        session.compiling_changed.connect(self._compiling)

    @Slot()
    def _frame(self):
        shown = self._session.shown
        if shown is None:
            return
        frame, options, paused = shown.frame, shown.job.options, self._session.paused
        self._forecast.note(frame.elapsed, frame.mean, frame.error)
        self.parts["exposure"].setText(exposure_text(options.exposure))
        self.parts["pass"].setText(pass_text(frame, options, paused))
        self.parts["speed"].setText(speed_text(frame))
        self.parts["elapsed"].setText(elapsed_text(frame.elapsed))
        self.parts["error"].setText(error_text(frame.error))
        left = None if frame.done or paused else self._forecast.left(options.samples or math.inf, options.seconds, options.error)
        self.parts["left"].setText(left_text(left))

    @Slot()
    def _hover(self):
        under = self._session.under
        if under is None:
            texts = "", "", ""
        else:
            name = self._session.name_of(under.place) if under.place else "Background"
            texts = name, f"{under.x}, {under.y}", f"at {under.distance:.5g}" if math.isfinite(under.distance) else ""
        for part, text in zip((self.under, self.parts["pixel"], self.parts["distance"]), texts):
            part.setText(text)

    @Slot()
    def _compiling(self):
        compiling = self._session.compiling
        if compiling is not None:
            self.under.setText(str(compiling))
        else:
            self._hover()
