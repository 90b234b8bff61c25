"""The widgets that edit one value each: a number, a grid of numbers, a colour, a flag, a choice, a text.

They show what they are told and emit only what a person does: `tried` while it is typed, `edited` when it is meant
(True: a step of a drag, of which `released` is the end).
"""
import math

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtGui import QColor, QPainter
from PySide6.QtWidgets import QCheckBox, QColorDialog, QComboBox, QGridLayout, QHBoxLayout, QSizePolicy, QSlider, QToolButton, QWidget

from app.entry import Entry, number_text, parsed, step_of
from rtcore.fields import linear_from_srgb, srgb_from_linear


class Editor(QWidget):
    """What all editors have."""

    tried = Signal(object)
    edited = Signal(object, bool)
    released = Signal()

    def __init__(self, parent: QWidget | None = None):
        super().__init__(parent)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(4)

    def show_value(self, value: object):
        """Show a value; emits nothing."""
        raise NotImplementedError

    def refuse(self, reason: str | None):
        """Show that what was entered can't be taken, and why; None: all is well."""

    def describe(self, name: str, tip: str):
        """Accessible name and tooltip."""
        self.setAccessibleName(name)
        self.setToolTip(tip)
        if proxy := self.focusProxy():
            proxy.setAccessibleName(name)
            proxy.setToolTip(tip)


class GridEdit(Editor):
    """Rows of numbers. The value is a tuple of tuples, or for ``flat`` grids one tuple, or one number for a grid of one."""

    def __init__(self, rows: int = 1, columns: int = 1, flat: bool = True, whole: bool = False, parent: QWidget | None = None):
        super().__init__(parent)
        self._columns, self._flat, self._whole = columns, flat, whole
        self._values: list[float] = [0.0] * (rows * columns)
        self._entries: list[Entry] = []
        grid = QGridLayout()
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(4)
        self._row.addLayout(grid)
        for i in range(rows * columns):
            entry = Entry(self)
            entry.setMinimumWidth(38)
            entry.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            entry.textEdited.connect(lambda _, i=i: self._typed(i))
            entry.meant.connect(lambda i=i: self._meant(i))
            entry.stepped.connect(lambda n, i=i: self._stepped(i, n))
            entry.left.connect(self.released)
            self._entries.append(entry)
            grid.addWidget(entry, i // columns, i % columns)
        self.setFocusProxy(self._entries[0])
        self._asking = 0

    @property
    def entries(self) -> list[Entry]:
        return self._entries

    def show_value(self, value):
        one = len(self._entries) == 1 and self._flat
        values = [value] if one else list(value) if self._flat else [x for row in value for x in row]
        for i, (entry, number) in enumerate(zip(self._entries, values)):
            self._values[i] = number
            entry.show_text(number_text(number))

    def refuse(self, reason):
        for i, entry in enumerate(self._entries):
            entry.refuse(reason if i == self._asking else None)

    def describe(self, name, tip):
        super().describe(name, tip)
        for i, entry in enumerate(self._entries):
            part = "" if len(self._entries) == 1 else f" {'xyzw'[i % self._columns]}"
            part += "" if self._flat or len(self._entries) <= self._columns else f", row {i // self._columns + 1}"
            entry.setAccessibleName(name + part)
            entry.setToolTip(tip)

    def _with(self, i: int, value: object):
        values = [*self._values[:i], value, *self._values[i + 1:]]
        if self._whole and isinstance(value, float) and value.is_integer():
            values[i] = int(value)
        if len(values) == 1 and self._flat:
            return values[0]
        return tuple(values) if self._flat else tuple(tuple(values[k:k + self._columns]) for k in range(0, len(values), self._columns))

    def _typed(self, i: int):
        self._asking = i
        self.tried.emit(self._with(i, parsed(self._entries[i].text())))

    def _meant(self, i: int):
        self._asking = i
        entry = self._entries[i]
        if entry.text() == number_text(self._values[i]):
            entry.taken()       # typed back as it was: the digits not shown stay
            return
        value = self._with(i, parsed(entry.text()))
        entry.taken()
        self.edited.emit(value, False)
        if entry.property("refused"):
            entry.setModified(True)

    def _stepped(self, i: int, count: int):
        self._asking = i
        value = self._values[i]
        step = 1 if self._whole else step_of(value)
        self._entries[i].taken()
        self.edited.emit(self._with(i, float(f"{value + count * step:.12g}")), True)


class SliderEdit(GridEdit):
    """A number and a slider. `low` and `high` are the slider's ends, on a logarithmic scale if `log`; the entry can go beyond."""

    STEPS = 1000

    def __init__(self, low: float, high: float, log: bool = False, whole: bool = False, parent: QWidget | None = None):
        super().__init__(whole=whole, parent=parent)
        self._low, self._high, self._log = low, high, log
        self._slider = QSlider(Qt.Orientation.Horizontal, self)
        self._slider.setRange(0, self.STEPS)
        self._slider.setPageStep(self.STEPS // 20)
        self._slider.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._slider.setMinimumWidth(50)
        self._row.insertWidget(0, self._slider, 3)
        self._row.setStretch(1, 2)
        self._slider.valueChanged.connect(self._slid)
        self._slider.sliderReleased.connect(self.released)
        self.setFocusProxy(self._entries[0])

    @property
    def slider(self) -> QSlider:
        return self._slider

    def show_value(self, value):
        super().show_value(value)
        if not self._slider.isSliderDown():
            self._slider.blockSignals(True)
            self._slider.setValue(round(self._place(float(value)) * self.STEPS))
            self._slider.blockSignals(False)

    def describe(self, name, tip):
        super().describe(name, tip)
        self._slider.setAccessibleName(f"{name} slider")
        self._slider.setToolTip(tip)

    def _place(self, value: float) -> float:
        if self._log:
            low, high, value = math.log(self._low), math.log(self._high), math.log(max(value, self._low))
        else:
            low, high = self._low, self._high
        return min(max((value - low) / (high - low), 0.0), 1.0)

    @Slot(int)
    def _slid(self, position: int):
        share = position / self.STEPS
        value = self._low * (self._high / self._low) ** share if self._log else self._low + (self._high - self._low) * share
        value = round(value) if self._whole else float(f"{value:.3g}")
        self._asking = 0
        self._entries[0].taken()
        self.edited.emit(value, True)


class Swatch(QToolButton):
    """A button filled with a colour."""

    def __init__(self, parent: QWidget | None = None):
        super().__init__(parent)
        self.color = QColor()
        self.setFixedSize(34, 25)
        self.setCursor(Qt.CursorShape.PointingHandCursor)

    def paintEvent(self, event):
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(self.palette().accent().color() if self.hasFocus() or self.underMouse() else self.palette().mid().color())
            painter.setBrush(self.color if self.isEnabled() else self.palette().window())
            painter.drawRoundedRect(self.rect().adjusted(1, 1, -2, -2), 4, 4)

    def enterEvent(self, event):
        super().enterEvent(event)
        self.update()

    def leaveEvent(self, event):
        super().leaveEvent(event)
        self.update()


def hex_of(color) -> str:
    """Linear light as ``#rrggbb`` in sRGB, clipped to what that can hold."""
    return "#" + "".join(f"{round(255 * srgb_from_linear(part)):02x}" for part in color)


class ColorEdit(Editor):
    """A linear colour, shown in sRGB: a button that opens the colour dialog, and an entry for ``#rrggbb`` or three linear numbers."""

    def __init__(self, parent: QWidget | None = None):
        super().__init__(parent)
        self._value = (0.0, 0.0, 0.0)
        self._swatch, self._entry = Swatch(self), Entry(self)
        self._row.addWidget(self._swatch)
        self._row.addWidget(self._entry)
        self.setFocusProxy(self._entry)
        self._swatch.clicked.connect(self._choose)
        self._entry.textEdited.connect(lambda text: self.tried.emit(self._parsed(text)))
        self._entry.meant.connect(self._meant)

    @property
    def entry(self) -> Entry:
        return self._entry

    def show_value(self, value):
        self._value = value
        self._swatch.color = QColor(hex_of(value))
        self._swatch.update()
        self._entry.show_text(self._text())

    def refuse(self, reason):
        self._entry.refuse(reason)

    def describe(self, name, tip):
        super().describe(name, tip + " Shown in sRGB; three numbers are taken as linear.")
        self._swatch.setAccessibleName(f"choose {name}")
        self._swatch.setToolTip(f"Choose the {name.lower()}")

    def _text(self) -> str:
        return hex_of(self._value) if max(self._value) <= 1 else " ".join(number_text(part) for part in self._value)

    @staticmethod
    def _parsed(text: str) -> object:
        parts = text.replace(",", " ").split()
        return tuple(parsed(part) for part in parts) if len(parts) == 3 else text.strip()

    def _meant(self):
        text = self._entry.text()
        self._entry.taken()
        if text.strip() != self._text():
            self.edited.emit(self._parsed(text), False)
            if self._entry.property("refused"):
                self._entry.setModified(True)

    @Slot()
    def _choose(self):
        before = self._value
        dialog = QColorDialog(self._swatch.color, self)
        dialog.setOption(QColorDialog.ColorDialogOption.DontUseNativeDialog)
        dialog.setWindowTitle(self.accessibleName())
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.currentColorChanged.connect(lambda c: self.edited.emit(tuple(linear_from_srgb(x) for x in c.getRgbF()[:3]), True))
        dialog.rejected.connect(lambda: self.edited.emit(before, True))
        dialog.finished.connect(self.released)
        dialog.show()


class FlagEdit(Editor):
    """A check box."""

    def __init__(self, text: str = "", parent: QWidget | None = None):
        super().__init__(parent)
        self._box = QCheckBox(text, self)
        self._row.addWidget(self._box)
        self.setFocusProxy(self._box)
        self._box.clicked.connect(lambda on: self.edited.emit(on, False))

    @property
    def box(self) -> QCheckBox:
        return self._box

    def show_value(self, value):
        self._box.setChecked(bool(value))


class ChoiceEdit(Editor):
    """One word of a few."""

    def __init__(self, words, parent: QWidget | None = None):
        super().__init__(parent)
        self._combo = QComboBox(self)
        self._combo.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self._combo.setMinimumContentsLength(6)
        self._combo.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        for word in words:
            self._combo.addItem(word.replace("-", " ").capitalize() if word.replace("-", "").isalpha() else word, word)
        self._row.addWidget(self._combo)
        self.setFocusProxy(self._combo)
        self._combo.activated.connect(lambda i: self.edited.emit(self._combo.itemData(i), False))

    @property
    def combo(self) -> QComboBox:
        return self._combo

    def show_value(self, value):
        self._combo.setCurrentIndex(self._combo.findData(value))


class TextEdit(Editor):
    """A line of text."""

    def __init__(self, parent: QWidget | None = None):
        super().__init__(parent)
        self._entry = Entry(self)
        self._row.addWidget(self._entry)
        self.setFocusProxy(self._entry)
        self._entry.textEdited.connect(lambda text: self.tried.emit(text))
        self._entry.meant.connect(self._meant)

    @property
    def entry(self) -> Entry:
        return self._entry

    def show_value(self, value):
        self._entry.show_text(value)

    def refuse(self, reason):
        self._entry.refuse(reason)

    def _meant(self):
        self._entry.taken()
        self.edited.emit(self._entry.text(), False)


class Summary(Editor):
    """What is too long to edit here, in a few words."""

    def __init__(self, parent: QWidget | None = None):
        super().__init__(parent)
        self._entry = Entry(self)
        self._entry.setReadOnly(True)
        self._row.addWidget(self._entry)
        self.setFocusProxy(self._entry)

    def show_value(self, value):
        self._entry.show_text("none" if value is None else f"{len(value):,} rows" if hasattr(value, "__len__") else str(value))


class MaybeEdit(Editor):
    """A check box, and while it is checked another editor."""

    def __init__(self, inner: Editor, default: object, parent: QWidget | None = None):
        super().__init__(parent)
        self._box, self._inner = QCheckBox(self), inner
        self._row.addWidget(self._box)
        self._row.addWidget(inner, 1)
        self.setFocusProxy(self._box)
        self._box.clicked.connect(lambda on: self.edited.emit(default if on else None, False))
        inner.tried.connect(self.tried)
        inner.edited.connect(self.edited)
        inner.released.connect(self.released)

    @property
    def box(self) -> QCheckBox:
        return self._box

    def show_value(self, value):
        self._box.setChecked(value is not None)
        self._inner.setEnabled(value is not None)
        if value is not None:
            self._inner.show_value(value)

    def refuse(self, reason):
        self._inner.refuse(reason)

    def describe(self, name, tip):
        super().describe(name, tip)
        self._inner.describe(name, tip)
