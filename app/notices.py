"""What lies over the picture now and then: a line that says what went wrong, and how far the compiler or a load is."""
from PySide6.QtCore import QSize, Qt, QTimer, Slot
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QProgressBar, QSizePolicy, QToolButton, QVBoxLayout

from app.filing import Filing
from app.icons import icon
from app.session import Session
from app.theme import DARK, Theme
from app.viewport import Viewport

SHOWN_FOR = 6000        # ms that a mere remark stays; an error stays until it is dismissed or the next message


class Notice(QFrame):
    """A bar at the top of the picture: one line, dismissible, in nobody's way."""

    def __init__(self, session: Session, parent: Viewport):
        super().__init__(parent)
        self.setObjectName("notice")
        self._theme: Theme = DARK
        self._level = "info"
        self._sign, self.label, self._close = QLabel(), QLabel(), QToolButton()
        self.label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.label.setWordWrap(True)
        self._close.setAccessibleName("Dismiss the message")
        self._close.setToolTip("Dismiss this message")
        self._close.clicked.connect(self.hide)
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 6, 6, 6)
        row.setSpacing(10)
        row.addWidget(self._sign)
        row.addWidget(self.label, 1)
        row.addWidget(self._close, 0, Qt.AlignmentFlag.AlignTop)
        self._timer = QTimer(self, singleShot=True, interval=SHOWN_FOR)
        self._timer.timeout.connect(self.hide)
        self.hide()
        parent.resized.connect(self._place)
        session.said.connect(self.say)
        session.document.replaced.connect(self.hide)    # what was said of another file is over

    def dress(self, theme: Theme):
        self._theme = theme
        self._close.setIcon(icon("close", theme))
        self._close.setIconSize(QSize(16, 16))
        name = "warning" if self._level == "error" else "about"
        self._sign.setPixmap(icon(name, theme).pixmap(QSize(20, 20)))

    @Slot(str, str)
    def say(self, level: str, text: str):
        """Show a message: an "error" stays, an "info" goes by itself."""
        self._level = level
        self.setProperty("level", level)
        for widget in (self, self.label):
            widget.style().unpolish(widget)
            widget.style().polish(widget)
        self.dress(self._theme)
        self.label.setText(text)
        self.label.setToolTip(text)
        self.setAccessibleName(text)
        self.show()
        self.raise_()
        self._place()
        self._timer.stop() if level == "error" else self._timer.start()

    @Slot()
    def _place(self):
        if self.isHidden():
            return
        room = self.parentWidget().width() - 24
        wanted = self.label.fontMetrics().horizontalAdvance(self.label.text()) + 110
        width = min(max(wanted, 280), room)
        self.setGeometry((room + 24 - width) // 2, 12, width, self.heightForWidth(width))


class Busy(QFrame):
    """A small card at the foot of the picture while kernels compile or a file is read."""

    def __init__(self, session: Session, filing: Filing, parent: Viewport):
        super().__init__(parent)
        self.setObjectName("busy")
        self._session, self._filing = session, filing
        self.label, self._bar = QLabel(), QProgressBar()
        self._bar.setTextVisible(False)
        self._bar.setAccessibleName("Progress")
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 10, 16, 12)
        column.setSpacing(8)
        column.addWidget(self.label)
        column.addWidget(self._bar)
        self._patience = QTimer(self, singleShot=True, interval=250)     # what is quick is not announced
        self._patience.timeout.connect(self._show_loading)
        self.hide()
        parent.resized.connect(self._place)
        session.compiling_changed.connect(self.refresh)
        filing.loading_changed.connect(self.refresh)

    @Slot()
    def refresh(self):
        """Show what is going on, or hide."""
        compiling = self._session.compiling
        if self._filing.loading is not None:
            self._patience.start()
        elif compiling is not None:
            self._show(str(compiling), compiling.done, compiling.total)
        else:
            self._patience.stop()
            self.hide()

    @Slot()
    def _show_loading(self):
        if self._filing.loading is not None:
            self._show(f"Reading {self._filing.loading.name}", 0, 0)

    def _show(self, text: str, done: int, total: int):
        self.label.setText(text)
        self.setAccessibleName(text)
        self._bar.setRange(0, total)
        self._bar.setValue(done)
        self.show()
        self.raise_()
        self._place()

    def _place(self):
        room, height = self.parentWidget().width(), self.sizeHint().height()
        width = min(max(self.label.sizeHint().width() + 40, 380), room - 24)
        below = self.parentWidget().height() - height
        self.setGeometry((room - width) // 2, below - 24 if self._session.shown else below // 2, width, height)
