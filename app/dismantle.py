"""Widgets that come and go while the window is open.

Their Python halves know one another in cycles, and what `garbage` has set aside is never looked through for those again: each form of the
property editor would stay for good, 10 KiB a widget. So they are taken apart by hand, and piece by piece: a form at once took up to 12 ms.
"""
import time
from collections import deque
from collections.abc import Iterable

import shiboken6
from PySide6.QtCore import QObject, QTimer, Slot
from PySide6.QtWidgets import QWidget

SLICE = 0.001       # s of work at a time
APART = 10          # ms in between


class Dismantler(QObject):
    """Deletes widgets that nobody sees or asks any more, a few at a time."""

    def __init__(self, parent: QObject | None = None):
        super().__init__(parent)
        self._parts: deque[QWidget] = deque()
        self._timer = QTimer(self, interval=APART)
        self._timer.timeout.connect(self._go_on)

    def take(self, parts: Iterable[QWidget]):
        """These, one after the other; those inside come before those around them."""
        self._parts += parts
        self._timer.start()

    @Slot()
    def _go_on(self):
        until = time.perf_counter() + SLICE
        while self._parts and time.perf_counter() < until:
            dismantle(self._parts.popleft())
        if not self._parts:
            self._timer.stop()


def dismantle(widget: QWidget) -> None:
    """Delete a widget and all in it, now; not from one of its own events. What their Python halves hold is let go."""
    if not shiboken6.isValid(widget):
        return
    held = [vars(part) for part in (widget, *widget.findChildren(QObject))]
    shiboken6.delete(widget)
    for names in held:
        names.clear()
