"""The gallery: a grid of thumbnails, each with its title and what it shows; a click or Enter opens the scene."""
from PySide6.QtCore import QAbstractListModel, QModelIndex, QPersistentModelIndex, QPointF, QRect, QRectF, QSize, Qt, Signal, Slot
from PySide6.QtGui import QColor, QFont, QFontMetrics, QIcon, QImage, QPainter, QPainterPath, QPen, QTextLayout, QTextOption
from PySide6.QtWidgets import (QAbstractItemView, QDialog, QDialogButtonBox, QFrame, QHBoxLayout, QLabel, QListView, QStyle,
                               QStyledItemDelegate, QVBoxLayout, QWidget)

from app.gallery import Entry, gallery
from app.session import Session
from app.theme import DARK, Theme

PICTURE = QSize(240, 150)
MARGIN = 8          # around a picture, to the edge of its card
LINES = 2           # of text below the title
NOTE_LINES = 4      # of the selected scene's note below the grid


def pictured() -> list[tuple[Entry, QImage]]:
    """Every scene of the gallery with its thumbnail. Reads files: not for the window's thread."""
    return [(entry, QImage(str(entry.thumbnail))) for entry in gallery()]


class Scenes(QAbstractListModel):
    """The gallery's scenes as Qt sees them. A row's `UserRole` is its (Entry, QImage)."""

    def __init__(self, parent: QWidget):
        super().__init__(parent)
        self._rows: list[tuple[Entry, QImage]] = []

    def fill(self, rows: list[tuple[Entry, QImage]]):
        """Show these."""
        self.beginResetModel()
        self._rows = rows
        self.endResetModel()

    def rowCount(self, parent: QModelIndex | QPersistentModelIndex = QModelIndex()) -> int:     # noqa: B008, Qt's signature
        return 0 if parent.isValid() else len(self._rows)

    def data(self, index: QModelIndex, role: int = Qt.ItemDataRole.DisplayRole):
        entry, image = self._rows[index.row()]
        roles = Qt.ItemDataRole
        return {roles.DisplayRole: entry.title, roles.AccessibleTextRole: entry.title, roles.AccessibleDescriptionRole: entry.note,
                roles.ToolTipRole: f"Open {entry.path.name}", roles.UserRole: (entry, image)}.get(role)


class Card(QStyledItemDelegate):
    """Draws a scene: its picture, its title, the first sentence of its note."""

    theme: Theme = DARK

    def sizeHint(self, option, index) -> QSize:
        line = QFontMetrics(option.font).lineSpacing()
        return QSize(PICTURE.width() + 2 * MARGIN, PICTURE.height() + 2 * MARGIN + 8 + (1 + LINES) * line + 4)

    def paint(self, painter: QPainter, option, index):
        entry, image = index.data(Qt.ItemDataRole.UserRole)
        theme, rect = self.theme, option.rect
        current = bool(option.state & QStyle.StateFlag.State_Selected)
        painter.save()
        painter.setRenderHints(QPainter.RenderHint.Antialiasing | QPainter.RenderHint.SmoothPixmapTransform)
        if current or option.state & QStyle.StateFlag.State_MouseOver:
            painter.setPen(QPen(QColor(theme.accent if current else theme.line), 1.5))
            painter.setBrush(QColor(theme.soft if current else theme.hover))
            painter.drawRoundedRect(QRectF(rect).adjusted(1, 1, -1, -1), 8, 8)
        frame = QRect(rect.topLeft().x() + MARGIN, rect.topLeft().y() + MARGIN, PICTURE.width(), PICTURE.height())
        rounded = QPainterPath()
        rounded.addRoundedRect(QRectF(frame), 5, 5)
        painter.setClipPath(rounded)
        if image.isNull():
            painter.fillRect(frame, QColor(theme.stage))
        else:
            painter.drawImage(frame, image)
        painter.setClipping(False)
        bold = QFont(option.font)
        bold.setWeight(QFont.Weight.DemiBold)
        metrics = QFontMetrics(bold)
        text = QRect(frame.left(), frame.bottom() + 8, frame.width(), metrics.lineSpacing())
        painter.setFont(bold)
        painter.setPen(QColor(theme.text))
        painter.drawText(text, Qt.AlignmentFlag.AlignLeft, metrics.elidedText(entry.title, Qt.TextElideMode.ElideRight, text.width()))
        painter.setFont(option.font)
        painter.setPen(QColor(theme.muted))
        draw_lines(painter, option.font, QPointF(text.left(), text.bottom() + 3), text.width(), entry.line)
        painter.restore()


def draw_lines(painter: QPainter, font: QFont, corner: QPointF, width: int, text: str):
    """Draw a text over at most `LINES` lines, the last one with an ellipsis if there is more."""
    metrics, layout = QFontMetrics(font), QTextLayout(text, font)
    layout.setTextOption(QTextOption(Qt.AlignmentFlag.AlignLeft))
    layout.beginLayout()
    for number in range(LINES):
        line = layout.createLine()
        if not line.isValid():
            break
        line.setLineWidth(width)
        start, end = line.textStart(), line.textStart() + line.textLength()
        shown = text[start:] if number == LINES - 1 else text[start:end]
        baseline = corner + QPointF(0, metrics.ascent() + number * metrics.lineSpacing())
        painter.drawText(baseline, metrics.elidedText(shown.strip(), Qt.TextElideMode.ElideRight, width))
    layout.endLayout()


class Gallery(QDialog):
    """Made once, filled when it is first shown."""

    chosen = Signal(object)     # the path of a scene file

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(parent)
        self._session = session
        self.setWindowTitle("Gallery")
        self.model, self.card = Scenes(self), Card(self)
        self.view = view = QListView()
        view.setAccessibleName("Scenes of the gallery")
        view.setToolTip("Click or press Enter to open a scene; type the beginning of a title to find it")
        view.setViewMode(QListView.ViewMode.IconMode)
        view.setResizeMode(QListView.ResizeMode.Adjust)
        view.setMovement(QListView.Movement.Static)
        view.setUniformItemSizes(True)
        view.setSpacing(4)
        view.setFrameShape(QFrame.Shape.NoFrame)
        view.viewport().setAutoFillBackground(False)
        view.setMouseTracking(True)
        view.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        view.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        view.verticalScrollBar().setSingleStep(40)
        view.setItemDelegate(self.card)
        view.setModel(self.model)
        self.note = QLabel()
        self.note.setAccessibleName("What the scene shows")
        self.note.setProperty("role", "hint")
        self.note.setWordWrap(True)
        self.note.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.note.setMinimumHeight(NOTE_LINES * QFontMetrics(self.note.font()).lineSpacing() + 4)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close = buttons.button(QDialogButtonBox.StandardButton.Close)
        close.setIcon(QIcon())
        close.setToolTip("Back to the picture")
        close.setAutoDefault(False)     # Enter opens the scene
        row = QHBoxLayout()
        row.setContentsMargins(12, 0, 4, 0)
        row.setSpacing(24)
        row.addWidget(self.note, 1)
        row.addWidget(buttons, 0, Qt.AlignmentFlag.AlignBottom)
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 12, 12, 12)
        column.setSpacing(12)
        column.addWidget(view, 1)
        column.addLayout(row)
        buttons.rejected.connect(self.reject)
        view.clicked.connect(self._choose)
        view.activated.connect(self._choose)
        view.entered.connect(self._tell)
        view.selectionModel().currentChanged.connect(self._tell)
        room = self.screen().availableGeometry().size()
        four = 4 * (PICTURE.width() + 2 * MARGIN + 2 * view.spacing()) + 60
        self.resize(min(four, round(room.width() * 0.85)), min(760, round(room.height() * 0.85)))

    def dress(self, theme: Theme):
        """Put on a theme."""
        self.card.theme = theme
        self.view.viewport().update()

    def showEvent(self, event):
        super().showEvent(event)
        self.view.setFocus()
        if self.model.rowCount():
            self._find_open()
        else:
            self._session.tasks.run(pictured, self._fill, name="gallery")

    def _fill(self, rows: list[tuple[Entry, QImage]]):
        self.model.fill(rows)
        self._find_open()

    def _find_open(self):
        """Make the scene that is open the current one, or the first."""
        path = self._session.document.path
        rows = [self.model.index(row) for row in range(self.model.rowCount())]
        here = [index for index in rows if index.data(Qt.ItemDataRole.UserRole)[0].path == path]
        for index in (here or rows)[:1]:
            self.view.setCurrentIndex(index)

    @Slot(QModelIndex)
    def _tell(self, index: QModelIndex):
        if index.isValid():
            self.note.setText(index.data(Qt.ItemDataRole.UserRole)[0].note)

    @Slot(QModelIndex)
    def _choose(self, index: QModelIndex):
        if self.isVisible():        # a click may activate as well, depending on the desktop
            self.accept()
            self.chosen.emit(index.data(Qt.ItemDataRole.UserRole)[0].path)
