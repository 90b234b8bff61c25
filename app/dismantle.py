"""Widgets that come and go while the window is open.

Their Python halves know one another in cycles, and what `garbage` has set aside is never looked through for those again: each form of the
property editor would stay for good, 10 KiB a widget. So they are taken apart by hand.
"""
import shiboken6
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget


def dismantle(widget: QWidget) -> None:
    """Delete a widget and all in it, now; not from one of its own events. What their Python halves hold is let go."""
    if not shiboken6.isValid(widget):
        return
    held = [vars(part) for part in (widget, *widget.findChildren(QObject))]
    shiboken6.delete(widget)
    for names in held:
        names.clear()
