"""A tree view that paints its rows itself, with the pictures that the style makes of a row's parts."""
from typing import NamedTuple

from PySide6.QtCore import QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QCursor, QIcon, QPainter, QPixmap
from PySide6.QtWidgets import QStyle, QStyleOptionViewItem, QTreeView, QWidget

from app.icons import render
from app.theme import DARK, Theme
from app.tree_model import SceneModel

ICON = 16       # pixels of the desktop a side
RADIUS = 4      # of the corners of what is selected or under the cursor


class Plan(NamedTuple):
    """Where the parts of a row are, from the left end of its item."""

    box: QRect
    icon: QRect
    text: int       # where it begins


class SceneView(QTreeView):
    """Qt asks a model in Python a dozen times for each row that it paints, and each time waits for Python's lock: while the render thread
    prepared a scene, eight rows took 8 to 14 ms. This view is called once for a row and paints all of it, in 0.03 ms."""

    def __init__(self, model: SceneModel, parent: QWidget | None = None):
        super().__init__(parent)
        self._scene, self._theme = model, DARK
        self._plans: dict[bool, Plan] = {}              # by whether there is a box
        self._pictures: dict[tuple, QPixmap] = {}
        self._ratio = 1.0
        self._chosen: object = None                     # the row that is selected
        self.setModel(model)
        self.setHeaderHidden(True)
        self.setUniformRowHeights(True)
        self.setIconSize(QSize(ICON, ICON))
        self.setIndentation(16)

    def dress(self, theme: Theme):
        """Rows in the colours of a theme."""
        self._theme = theme
        self._forget()
        self.viewport().update()

    def _forget(self):
        self._plans.clear()
        self._pictures.clear()
        self._ratio = self.devicePixelRatioF()

    def timerEvent(self, event):
        super().timerEvent(event)       # rows are laid out. The model is asked from here, which has the lock, and so waits for it but once

    def selectionChanged(self, selected, deselected):
        super().selectionChanged(selected, deselected)
        indexes = selected.indexes()
        self._chosen = indexes[0].internalPointer() if indexes else None

    def drawRow(self, painter: QPainter, option: QStyleOptionViewItem, index):
        if self.devicePixelRatioF() != self._ratio:
            self._forget()
        look, state, line = self._scene.look(index), option.state, option.rect
        chosen = index.internalPointer() is self._chosen
        left, high = self.header().sectionViewportPosition(0) + look.depth * self.indentation(), line.height()
        item = QRect(left, line.y(), line.right() - left + 1, high)
        under = self.viewport().underMouse() and line.contains(self.viewport().mapFromGlobal(QCursor.pos()))
        if under or chosen:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(self._theme.soft if chosen else self._theme.hover))
            painter.drawRoundedRect(QRectF(line), RADIUS, RADIUS)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        if state & QStyle.StateFlag.State_Children:
            opened = bool(state & QStyle.StateFlag.State_Open)
            painter.drawPixmap(left - self.indentation(), item.y(), self._arrow(opened, high))
        plan = self._plan(look.checked is not None, high)
        if look.checked is not None:
            painter.drawPixmap(item.topLeft() + plan.box.topLeft(), self._box(look.checked, under, plan.box.size()))
        painter.drawPixmap(item.topLeft() + plan.icon.topLeft(), self._icon(look.icon))
        metrics = painter.fontMetrics()
        room = item.width() - plan.text - 3
        text = look.text if metrics.horizontalAdvance(look.text) <= room else \
            metrics.elidedText(look.text, Qt.TextElideMode.ElideRight, room)
        painter.setPen(QColor(self._theme.faint if look.faint else self._theme.text))
        painter.drawText(left + plan.text, item.y() + high // 2 - (metrics.height() + 1) // 2 + metrics.ascent(), text)

    # what the style makes of the parts, which is asked once

    def _option(self, rect: QRect) -> QStyleOptionViewItem:
        option = QStyleOptionViewItem()
        self.initViewItemOption(option)
        option.rect = rect
        option.state |= QStyle.StateFlag.State_Enabled
        return option

    def _plan(self, box: bool, high: int) -> Plan:
        if box not in self._plans:
            option, features, style = self._option(QRect(0, 0, 200, high)), QStyleOptionViewItem.ViewItemFeature, self.style()
            option.features = features.HasDisplay | features.HasDecoration | (features.HasCheckIndicator if box else features.None_)
            option.text, option.icon = "text", QIcon(self._icon("scene"))
            check, image, words = (style.subElementRect(part, option, self) for part in (
                QStyle.SubElement.SE_ItemViewItemCheckIndicator, QStyle.SubElement.SE_ItemViewItemDecoration,
                QStyle.SubElement.SE_ItemViewItemText))
            margin = style.pixelMetric(QStyle.PixelMetric.PM_FocusFrameHMargin, option, self) + 1
            self._plans[box] = Plan(check, image, words.x() + margin)
        return self._plans[box]

    def _picture(self, key: tuple, size: QSize, paint) -> QPixmap:
        if key not in self._pictures:
            pixmap = QPixmap(size * self._ratio)
            pixmap.setDevicePixelRatio(self._ratio)
            pixmap.fill(Qt.GlobalColor.transparent)
            with QPainter(pixmap) as painter:
                paint(painter)
            self._pictures[key] = pixmap
        return self._pictures[key]

    def _arrow(self, opened: bool, high: int) -> QPixmap:
        size = QSize(self.indentation(), high)

        def paint(painter: QPainter):
            option = self._option(QRect(0, 0, size.width(), size.height()))
            option.state = QStyle.StateFlag.State_Enabled | QStyle.StateFlag.State_Children
            if opened:
                option.state |= QStyle.StateFlag.State_Open
            self.style().drawPrimitive(QStyle.PrimitiveElement.PE_IndicatorBranch, option, painter, self)
        return self._picture(("arrow", opened), size, paint)

    def _box(self, checked: bool, under: bool, size: QSize) -> QPixmap:
        def paint(painter: QPainter):
            option = self._option(QRect(0, 0, size.width(), size.height()))
            option.state |= QStyle.StateFlag.State_On if checked else QStyle.StateFlag.State_Off
            if under:
                option.state |= QStyle.StateFlag.State_MouseOver
            self.style().drawPrimitive(QStyle.PrimitiveElement.PE_IndicatorItemViewItemCheck, option, painter, self)
        return self._picture(("box", checked, under), size, paint)

    def _icon(self, name: str) -> QPixmap:
        key = "icon", name
        if key not in self._pictures:
            self._pictures[key] = pixmap = render(name, self._theme.icon, round(ICON * self._ratio))
            pixmap.setDevicePixelRatio(self._ratio)
        return self._pictures[key]
