"""What every panel is: a scrolling column of forms that talks to the session."""
from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QFrame, QPushButton, QScrollArea, QToolButton, QVBoxLayout, QWidget

from app.session import Session


class Panel(QScrollArea):
    """A panel's content. `title` heads its dock, `icon` names its icon, `area` is "left" or "right", `tip` says what it is for."""

    title, icon, area, tip = "", "", "right", ""

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(parent)
        self.session = session
        self.setAccessibleName(self.title)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setAutoFillBackground(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        body = QWidget()
        self.column = QVBoxLayout(body)
        self.column.setContentsMargins(10, 10, 10, 10)
        self.column.setSpacing(8)
        self.setWidget(body)

    def sizeHint(self) -> QSize:
        return QSize(300, 320)

    def minimumSizeHint(self) -> QSize:
        return QSize(self.widget().minimumSizeHint().width() + self.verticalScrollBar().sizeHint().width(), 90)     # never cut at the side


def button(text: str, tip: str, pressed, parent: QWidget | None = None) -> QPushButton:
    """A push button with its tooltip and accessible name."""
    result = QPushButton(text, parent)
    result.setToolTip(tip)
    result.setAccessibleName(text)
    result.clicked.connect(lambda: pressed())
    return result


def small_button(icon, text: str, tip: str, pressed, parent: QWidget | None = None) -> QToolButton:
    """A button that is only an icon."""
    result = QToolButton(parent)
    result.setIcon(icon)
    result.setToolTip(tip)
    result.setAccessibleName(text)
    result.clicked.connect(lambda: pressed())
    return result
