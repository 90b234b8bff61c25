"""Our own icons: SVG files drawn in `currentColor`, rendered in the colours of the theme, sharp at the scale of the screen."""
from functools import lru_cache

from PySide6.QtCore import QByteArray, QRectF, Qt
from PySide6.QtGui import QGuiApplication, QIcon, QPainter, QPixmap
from PySide6.QtSvg import QSvgRenderer

import resources
from app.theme import Theme

ICONS = resources.ROOT / "icons"
SIDES = (16, 20)        # what the trees and tabs use, and the toolbar


def render(name: str, color: str, side: int) -> QPixmap:
    """An icon in one colour, `side` device pixels wide. Shapes that have no icon of their own get the general one."""
    path = ICONS / f"{name}.svg"
    text = (path if path.exists() else ICONS / "shape.svg").read_text(encoding="utf-8")
    pixmap = QPixmap(side, side)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    QSvgRenderer(QByteArray(text.replace("currentColor", color).encode())).render(painter, QRectF(0, 0, side, side))
    painter.end()
    return pixmap


@lru_cache(maxsize=256)
def icon(name: str, theme: Theme, switch: bool = True) -> QIcon:
    """The icon in all states: plain, faint while disabled, and for a ``switch`` in the accent while it is on."""
    result = QIcon()
    ratio = QGuiApplication.instance().devicePixelRatio()
    for side in sorted({round(side * scale) for side in SIDES for scale in (1, ratio)}):
        result.addPixmap(render(name, theme.icon, side))
        result.addPixmap(render(name, theme.faint, side), QIcon.Mode.Disabled)
        if switch:
            result.addPixmap(render(name, theme.accent, side), QIcon.Mode.Normal, QIcon.State.On)
    return result


def app_icon() -> QIcon:
    """The program's own icon, at the sizes that desktops ask for."""
    result = QIcon()
    for side in (16, 24, 32, 48, 64, 128, 256):
        result.addPixmap(render("rayscope", "", side))
    return result
