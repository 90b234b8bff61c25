"""The viewport: paints the newest frame, and turns the mouse and the fly keys into camera moves."""
import itertools
import math

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QColor, QGuiApplication, QImage, QPainter, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.outline import RING
from app.session import Session
from app.theme import DARK, Theme

CLICK = 4               # pixels of the desktop that the mouse may move in a click
WHEEL = 0.85            # distance left after one notch of the wheel
FLIGHT = 0.6            # camera distances a second; three times that with Shift
KEYS = {Qt.Key.Key_W: (0, 0, 1), Qt.Key.Key_S: (0, 0, -1), Qt.Key.Key_A: (-1, 0, 0), Qt.Key.Key_D: (1, 0, 0),
        Qt.Key.Key_Q: (0, -1, 0), Qt.Key.Key_E: (0, 1, 0)}
_gestures = itertools.count()


class Viewport(QWidget):
    """One QImage over the worker's newest buffer, drawn pixel for pixel: 0.5 ms at 1920 x 1080."""

    asking_changed = Signal()
    resized = Signal()

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(parent)
        self._session = session
        self._theme: Theme = DARK
        self._image: QImage | None = None
        self._outline: tuple[QImage, QPointF] | None = None
        self._ratio = 0.0
        self._bytes: list = []              # what the images borrow their pixels from
        self._press: tuple[QPointF, Qt.MouseButton] | None = None
        self._last = QPointF()
        self._gesture: object = None
        self.asking = False                 # the next drag draws the region of interest
        self._marquee: QRectF | None = None     # the region that is being drawn, in 0 .. 1 of the picture
        self._held: set[int] = set()
        self._flying = QTimer(self, interval=16)
        self._flying.timeout.connect(self._fly)
        self._wheeling = QTimer(self, interval=500, singleShot=True)
        self._wheel_gesture: object = None
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(160, 120)
        self.setAccessibleName("Picture of the scene")
        self.setAccessibleDescription("Drag to orbit, Shift and drag to pan, wheel to move nearer, click to select, "
                                      "Control and click to focus, W A S D Q E to fly")
        session.frame_changed.connect(self._show_frame)
        session.options_changed.connect(self.update)
        session.aiming_changed.connect(self._point)

    def sizeHint(self) -> QSize:
        return QSize(900, 650)

    def dress(self, theme: Theme):
        self._theme = theme
        self.update()

    # painting

    @Slot()
    def _show_frame(self):
        shown = self._session.shown
        pixels = shown.bytes
        height, width = pixels.shape[:2]
        image = QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_RGB32)
        outline, borrowed = None, [pixels]
        if shown.outline is not None:
            x, y, argb = shown.outline
            high, wide = argb.shape
            outline = QImage(argb.data, wide, high, 4 * wide, QImage.Format.Format_ARGB32_Premultiplied), QPointF(x, y)
            borrowed.append(argb)
        self._image, self._outline, self._bytes = image, outline, borrowed
        self.update()

    def picture_rect(self) -> QRectF:
        """Where the frame is drawn, in this widget's coordinates. After a resize the old frame keeps its proportions."""
        if self._image is None:
            return QRectF(self.rect())
        width = self._image.width() * self.height() / self._image.height()
        if abs(width - self.width()) < 2:
            return QRectF(self.rect())
        return QRectF((self.width() - width) / 2, 0, width, self.height())

    def paintEvent(self, event):
        if self.devicePixelRatioF() != self._ratio:     # on another screen now. The event that tells so comes among all others: to look
            self._tell_size()                           # at each of them took twice as many waits for Python's lock as painting does
        with QPainter(self) as painter:
            self._paint(painter)

    def _paint(self, painter: QPainter):
        if self._image is None:
            painter.fillRect(self.rect(), QColor(self._theme.stage))
            return
        rect, ratio = self.picture_rect(), self.devicePixelRatioF()
        if rect.width() < self.width():
            painter.fillRect(self.rect(), QColor(self._theme.stage))
        scale = rect.width() / self._image.width(), rect.height() / self._image.height()
        if abs(self._image.width() - rect.width() * ratio) < 2 and abs(self._image.height() - rect.height() * ratio) < 2:
            scale = 1 / ratio, 1 / ratio        # pixel for pixel, whatever fraction of a pixel the widget has on top
        else:
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.translate(rect.topLeft())
        painter.scale(*scale)
        painter.drawImage(0, 0, self._image)
        if self._outline is not None:
            painter.drawImage(self._outline[1], self._outline[0])
        painter.resetTransform()
        region = self._session.options.region
        marquee = self._marquee or (region and QRectF(QPointF(*region[:2]), QPointF(*region[2:])))
        if marquee:
            frame = QRectF(rect.x() + marquee.x() * rect.width(), rect.y() + marquee.y() * rect.height(),
                           marquee.width() * rect.width(), marquee.height() * rect.height())
            paint_marquee(painter, frame.adjusted(0.5, 0.5, -0.5, -0.5))

    def resizeEvent(self, event):
        super().resizeEvent(event)
        self._tell_size()
        self.resized.emit()

    def _tell_size(self):
        self._ratio = ratio = self.devicePixelRatioF()
        self._session.resize((round(self.width() * ratio), round(self.height() * ratio)), ratio)

    # the region of interest

    def ask_region(self, on: bool):
        """Let the next drag draw a region that is refined first; or ask no more, and drop the one there is."""
        if not on and self._session.options.region is not None:
            self._session.choose_region(None)
        self._ask(on)

    def _ask(self, on: bool):
        self.asking = on
        self._point()
        self.asking_changed.emit()

    @Slot()
    def _point(self):
        """The cursor tells whether something is to be pointed at."""
        self.setCursor(Qt.CursorShape.CrossCursor) if self.asking or self._session.aiming else self.unsetCursor()

    def _stretch(self, start: QPointF, end: QPointF):
        """The marquee is drawn from one point of the widget to another."""
        marquee = QRectF(QPointF(*self._at(start)), QPointF(*self._at(end))).normalized()
        self._marquee = marquee.intersected(QRectF(0, 0, 1, 1))
        self.update()

    def _drawn(self):
        marquee, self._marquee = self._marquee, None
        self._session.choose_region(None if marquee.isEmpty() else tuple(min(x, 1.0) for x in marquee.getCoords()))
        self._ask(False)

    # the mouse

    def _at(self, position: QPointF) -> tuple[float, float]:
        """A position in 0 .. 1 of the picture."""
        rect = self.picture_rect()
        return (position.x() - rect.x()) / rect.width(), (position.y() - rect.y()) / rect.height()

    def mousePressEvent(self, event):
        if self._press is None and event.button() in (Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton, Qt.MouseButton.RightButton):
            self._press, self._last, self._gesture = (event.position(), event.button()), event.position(), None

    def mouseMoveEvent(self, event):
        if self._press is None:
            self._session.hover(self._at(event.position()))
            return
        start, button = self._press
        if self._gesture is None:
            if (event.position() - start).manhattanLength() < CLICK:
                return
            drawing = button == Qt.MouseButton.LeftButton and (self.asking or event.modifiers() & Qt.KeyboardModifier.ControlModifier)
            self._gesture = ("region" if drawing else "drag", next(_gestures))
            self._session.hover(None)
        if self._gesture[0] == "region":
            return self._stretch(start, event.position())
        step, height = event.position() - self._last, max(self.height(), 1)
        self._last = event.position()
        right, down = step.x() / height, step.y() / height
        if button == Qt.MouseButton.RightButton:
            self._session.dolly(math.exp(2 * down), gesture=self._gesture)
        elif button == Qt.MouseButton.MiddleButton or event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            self._session.pan(right, -down, self._gesture)
        else:
            self._session.orbit(math.pi * right, math.pi * -down, self._gesture)

    def mouseReleaseEvent(self, event):
        if self._press is None or event.button() != self._press[1]:
            return
        if self._marquee is not None:
            self._drawn()
        elif self._gesture is None and event.button() == Qt.MouseButton.LeftButton:
            if self.asking:
                self.ask_region(False)
            elif self._session.aiming or event.modifiers() & Qt.KeyboardModifier.ControlModifier:
                self._session.focus(*self._at(event.position()))
            else:
                self._session.pick(*self._at(event.position()))
        self._press = self._gesture = None
        self._session.hover(self._at(event.position()))

    def leaveEvent(self, event):
        self._session.hover(None)

    def wheelEvent(self, event):
        notches = event.angleDelta().y() / 120
        if notches == 0:
            return
        if not self._wheeling.isActive():
            self._wheel_gesture = ("wheel", next(_gestures))
        self._wheeling.start()
        self._session.dolly(WHEEL ** notches, self._session.point_under(*self._at(event.position())), self._wheel_gesture)
        event.accept()

    # flying

    def keyPressEvent(self, event):
        if event.key() in KEYS and not event.modifiers() & ~Qt.KeyboardModifier.ShiftModifier:
            if not event.isAutoRepeat():
                if not self._held:
                    self._gesture = ("flight", next(_gestures))
                self._held.add(event.key())
                self._flying.start()
        elif event.key() == Qt.Key.Key_Escape and self._session.aiming:
            self._session.aim(False)
        elif event.key() == Qt.Key.Key_Escape and (self.asking or self._session.options.region is not None):
            self.ask_region(False)
        elif event.key() == Qt.Key.Key_Escape and self._session.selection is not None:
            self._session.select(None)
        else:
            super().keyPressEvent(event)

    def keyReleaseEvent(self, event):
        if event.key() in self._held and not event.isAutoRepeat():
            self._held.discard(event.key())
            if not self._held:
                self._land()
        else:
            super().keyReleaseEvent(event)

    def focusOutEvent(self, event):
        self._held.clear()
        self._land()
        super().focusOutEvent(event)

    def _land(self):
        self._flying.stop()
        if self._press is None:
            self._gesture = None

    @Slot()
    def _fly(self):
        camera = self._session.camera
        if camera is None:
            return
        fast = QGuiApplication.keyboardModifiers() & Qt.KeyboardModifier.ShiftModifier
        step = camera.distance() * FLIGHT * (3 if fast else 1) * self._flying.interval() / 1000
        move = [step * sum(KEYS[Qt.Key(key)][axis] for key in self._held) for axis in range(3)]
        if any(move):
            self._session.fly(*move, self._gesture)


def paint_marquee(painter: QPainter, frame: QRectF):
    """A thin light line with a dark halo, which is seen on any picture, and corners in the colour of the selection."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for color, width in ((QColor(0, 0, 0, 110), 3), (QColor(255, 255, 255, 200), 1)):
        painter.setPen(QPen(color, width))
        painter.drawRect(frame)
    painter.setPen(QPen(QColor.fromRgba(RING), 2.5, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap, Qt.PenJoinStyle.MiterJoin))
    arm = min(14.0, frame.width() / 3, frame.height() / 3)
    for corner, x, y in ((frame.topLeft(), arm, arm), (frame.topRight(), -arm, arm), (frame.bottomRight(), -arm, -arm),
                         (frame.bottomLeft(), arm, -arm)):
        painter.drawPolyline([corner + QPointF(x, 0), corner, corner + QPointF(0, y)])
