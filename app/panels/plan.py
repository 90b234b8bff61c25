"""The plan panel: what the picture on the screen spends its time on, what it was spared and why, and what is held in memory."""
from html import escape

from PySide6.QtCore import QRectF, QSize, Qt, QTimer, Slot
from PySide6.QtGui import QColor, QPainter
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QVBoxLayout, QWidget

from app.panels.base import Panel
from app.session import Session
from app.theme import DARK, Theme
from rtcore.account import Account, account, loaded_kernels, plural, sentences

OFTEN = 250     # ms between two updates while a picture refines itself
SOON = 20       # ms from the panel's being shown to its update: the window lays itself out and paints first, some 9 ms
TOLD = 2        # sentences at the top; the rest are the lists below them


class Bars(QWidget):
    """Rows of a name, a bar as long as its share, and the share in words."""

    ROW, GAP = 22, 12

    def __init__(self, name: str):
        super().__init__()
        self.rows: list[tuple[str, float, str]] = []
        self._theme = DARK
        self.setAccessibleName(name)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def show_rows(self, rows: list[tuple[str, float, str]]):
        """Rows of name, share (0 to 1), words."""
        if rows != self.rows:
            self.rows = rows
            self.setAccessibleDescription("; ".join(f"{name}: {words}" for name, _, words in rows))
            self.updateGeometry()
            self.update()

    def dress(self, theme: Theme):
        self._theme = theme
        self.update()

    def sizeHint(self) -> QSize:
        return QSize(self._names() + 180, max(len(self.rows), 1) * self.ROW)

    def minimumSizeHint(self) -> QSize:
        return QSize(self._names() + 130, self.sizeHint().height())

    def _names(self) -> int:
        """Pixels that the longest name takes."""
        return max((self.fontMetrics().horizontalAdvance(name) for name, *_ in self.rows), default=0)

    def paintEvent(self, _):
        with QPainter(self) as painter:
            self._paint(painter)

    def _paint(self, painter: QPainter):
        theme = self._theme
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        numbers = self.fontMetrics().horizontalAdvance("100 %")
        left = self._names() + self.GAP
        room = max(self.width() - left - numbers - self.GAP, 10)
        longest = max((share for _, share, _ in self.rows), default=0) or 1.0
        middle = Qt.AlignmentFlag.AlignVCenter
        for i, (name, share, words) in enumerate(self.rows):
            row = QRectF(0, i * self.ROW, self.width(), self.ROW)
            painter.setPen(QColor(theme.text))
            painter.drawText(row, middle, name)
            if words.endswith("%"):
                painter.setPen(Qt.PenStyle.NoPen)
                painter.setBrush(QColor(theme.line))
                painter.drawRoundedRect(QRectF(left, row.top() + 7, room, 8), 4, 4)
                painter.setBrush(QColor(theme.accent))
                painter.drawRoundedRect(QRectF(left, row.top() + 7, room * share / longest, 8), 4, 4)
                painter.setPen(QColor(theme.text))
                painter.drawText(row, middle | Qt.AlignmentFlag.AlignRight, words)
            else:
                painter.setPen(QColor(theme.muted))
                painter.drawText(row.adjusted(left, 0, 0, 0), middle, words)


class PlanPanel(Panel):
    """Follows the picture on the screen. Its figures come with the frames: the tracer's clock runs in any case."""

    title, icon, area, tip = "Plan", "plan", "bottom", "What this picture spends its time on, and what was left out"

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(session, parent)
        self.saying = QLabel("The plan comes with the first picture.")
        self.saying.setWordWrap(True)
        self.saying.setStyleSheet("font-size: 12pt;")
        self.saying.setAccessibleName("The plan in words")
        self.kept, self.kernels = Bars("Stages kept, with their share of the time"), Bars("Kernels, with their share of the time")
        self.left_out, self.held = QLabel(), QLabel()
        for label, name in ((self.left_out, "What was left out, and why"), (self.held, "Kernels in this process, and memory held")):
            label.setWordWrap(True)
            label.setTextFormat(Qt.TextFormat.RichText)
            label.setAlignment(Qt.AlignmentFlag.AlignTop)
            label.setAccessibleName(name)
        self.columns = QWidget()
        row = QHBoxLayout(self.columns)
        row.setContentsMargins(0, 6, 0, 0)
        row.setSpacing(28)
        for stretch, parts in ((4, ("Kept", self.kept)), (4, ("Left out", self.left_out)), (3, ("Kernels", self.kernels, self.held))):
            column = QVBoxLayout()
            column.setSpacing(6)
            heading = QLabel(parts[0])
            heading.setProperty("role", "heading")
            heading.setIndent(0)
            column.addWidget(heading)
            for part in parts[1:]:
                column.addWidget(part)
            column.addStretch(1)
            row.addLayout(column, stretch)
        self.columns.hide()
        self.column.addWidget(self.saying)
        self.column.addWidget(self.columns)
        self.column.addStretch(1)
        self._timer = QTimer(self, singleShot=True)
        self._timer.timeout.connect(self.refresh)
        session.frame_changed.connect(self._moved)

    def sizeHint(self) -> QSize:
        return QSize(900, 350)

    def dress(self, theme: Theme):
        for bars in (self.kept, self.kernels):
            bars.dress(theme)
        self._muted = theme.muted
        self.refresh()

    def showEvent(self, event):
        super().showEvent(event)
        self._timer.start(SOON)

    @Slot()
    def _moved(self):
        if self.isVisible() and not self._timer.isActive():
            self._timer.start(OFTEN)

    @Slot()
    def refresh(self):
        """Show the account of the newest frame, if anybody looks."""
        if not self.isVisible() or self.session.shown is None:
            return
        frame = self.session.shown.frame
        made = account(frame.plan, frame.seconds, frame.held)
        self.saying.setText(" ".join(sentences(made)[:TOLD]))
        self.kept.show_rows([(stage, share, f"within {within}" if within else percent(share)) for stage, share, within in made.kept])
        self.kernels.show_rows([(name, share, percent(share)) for name, share in made.kernels])
        self.left_out.setText("".join(f"<p style='margin: 0 0 5px 0'>{escape(what)}<br><span style='color: {self._muted}'>{escape(why)}"
                                      "</span></p>" for what, why in grouped(made)))
        self.held.setText(f"<p style='margin: 6px 0 5px 0'>{escape(in_process())}</p>"
                          f"<p style='margin: 0; color: {self._muted}'>{escape(memory(made))}</p>")
        self.columns.show()


def percent(share: float) -> str:
    """A share in words."""
    return f"{100 * share:.0f} %" if share == 0 or share >= 0.01 else "< 1 %"


def grouped(made: Account) -> list[tuple[str, str]]:
    """What was left out and why; kinds of shapes that the scene does not have together."""
    absent = [stage.removeprefix("hits: ") for stage, _ in made.left_out if stage.startswith("hits: ")]
    others = [(stage, why) for stage, why in made.left_out if not stage.startswith("hits: ")]
    return [*others, *([(", ".join(plural(kind) for kind in absent), "none is visible in the scene")] if absent else [])]


def in_process() -> str:
    """How many compiled functions this process has, and where they came from."""
    kernels = loaded_kernels()
    compiled = sum(how == "compiled" for how in kernels.values())
    return f"{len(kernels) - compiled} functions loaded from the cache, {compiled} compiled in this process"


def memory(made: Account) -> str:
    """Bytes held, and for what."""
    parts = ", ".join(f"{what} {in_bytes(size)}" for what, size in made.held)
    return f"{in_bytes(made.bytes)} held: {parts}"


def in_bytes(size: int) -> str:
    """``512 B``, ``3.4 KiB``, ``12 MiB``."""
    power = min((max(size, 1).bit_length() - 1) // 10, 3)
    number = size / 1024 ** power
    return f"{number:.{0 if power == 0 or number >= 10 else 1}f} {('B', 'KiB', 'MiB', 'GiB')[power]}"
