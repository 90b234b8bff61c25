"""The line edit under every editor: it shows refusals, steps by the arrow keys, and is never overwritten while somebody types."""
import math

from PySide6.QtCore import QPoint, Qt, Signal
from PySide6.QtWidgets import QLineEdit, QToolTip, QWidget


class Entry(QLineEdit):
    """A line edit that knows whether a person changed it, shows a refusal in red, and takes Escape as "leave it"."""

    stepped = Signal(int)
    meant = Signal()        # Enter, or the focus left, after a change
    left = Signal()         # the focus left

    def __init__(self, parent: QWidget | None = None):
        super().__init__(parent)
        self._shown = self._tip = ""
        self._reason: str | None = None

    def show_text(self, text: str):
        """Show the model's text, but do not overwrite what is being typed."""
        self._shown = text
        if not (self.hasFocus() and self.isModified()) and text != self.text():
            self.setText(text)
            self.setCursorPosition(0)
        if not self.isModified():
            self.refuse(None)

    def taken(self):
        """What was typed is the model's now."""
        self.setModified(False)

    def refuse(self, reason: str | None):
        if reason != self._reason:
            self._reason = reason
            self.setProperty("refused", reason is not None)
            self.style().unpolish(self)
            self.style().polish(self)
            super().setToolTip(reason or self._tip)
        if reason is not None and self.hasFocus():
            QToolTip.showText(self.mapToGlobal(QPoint(0, self.height())), reason, self)
        elif reason is None and self.hasFocus():
            QToolTip.hideText()

    def setToolTip(self, tip: str):
        self._tip = tip
        super().setToolTip(self._reason or tip)

    def keyPressEvent(self, event):
        step = {Qt.Key.Key_Up: 1, Qt.Key.Key_Down: -1, Qt.Key.Key_PageUp: 10, Qt.Key.Key_PageDown: -10}.get(event.key())
        if step is not None and not self.isReadOnly():
            self.stepped.emit(step)
        elif event.key() == Qt.Key.Key_Escape and self.isModified():
            self._revert()
        elif event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            if self.isModified():
                self.meant.emit()
            self.selectAll()
        else:
            super().keyPressEvent(event)

    def focusOutEvent(self, event):
        super().focusOutEvent(event)
        if event.reason() == Qt.FocusReason.PopupFocusReason:
            return
        if self.isModified():
            self.meant.emit()
            if self._reason is not None:
                self._revert()
        self.left.emit()

    def _revert(self):
        self.setText(self._shown)
        self.setModified(False)
        self.refuse(None)


def number_text(value: float) -> str:
    """A number as an entry shows it: whole numbers in full, others with six digits."""
    return str(int(value)) if abs(value) < 1e12 and value == int(value) else f"{value:.6g}"


def parsed(text: str) -> object:
    """The number a text stands for, or the text itself, for the field to refuse."""
    try:
        return float(text.strip().replace(",", "."))
    except ValueError:
        return text.strip()


def step_of(value: float) -> float:
    """A step that suits a number's size: 0.01 for 0.2, 0.1 for 1.5, 1 for 40."""
    return 10.0 ** (math.floor(math.log10(abs(value))) - 1) if abs(value) > 1e-12 else 0.1
