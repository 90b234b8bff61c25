"""Forms made from records: the fields say what they hold, the form picks the editors. No panel lists a field twice."""
from collections import deque
from collections.abc import Callable, Iterator

import msgspec
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from app.bindings import Binding
from app.editors import ChoiceEdit, ColorEdit, Editor, FlagEdit, GridEdit, MaybeEdit, SliderEdit, Summary, TextEdit
from app.formula import FormulaEdit
from rtcore.fields import Choice, Color, Field, FieldError, Flag, Formula, Maybe, Number, Numbers, Record, Text, Vector, Vectors, fields_of

MOST_ROWS = 12      # of a list of points that is edited in place


def title_of(name: str) -> str:
    """A field's name as people read it: ``base_radius`` is "Base radius"."""
    return name.replace("_", " ").capitalize()


def tip_of(field: Field) -> str:
    """What a field is, its unit and its range, for a tooltip."""
    text = field.help[:1].upper() + field.help[1:]
    if field.unit:
        text += f" ({field.unit})"
    if isinstance(field, Number) and field.expected() != "a number":
        text += f". {field.expected().capitalize()}"
    return text + "." if text and not text.endswith(".") else text


def editor_for(field: Field, value: object) -> Editor:
    """The editor that suits a field and the value that it holds now."""
    if isinstance(field, Number):
        if field.least is not None and field.most is not None and field.most <= 2:
            return SliderEdit(field.least, field.most)
        return GridEdit()
    if isinstance(field, Vector):
        return GridEdit(columns=3)
    if isinstance(field, Numbers):
        return GridEdit(rows=field.count // 2, columns=2) if field.count % 2 == 0 else GridEdit(columns=field.count)
    if isinstance(field, Color):
        return ColorEdit()
    if isinstance(field, Flag):
        return FlagEdit()
    if isinstance(field, Choice):
        return ChoiceEdit(field.words)
    if isinstance(field, Formula):
        return FormulaEdit()
    if isinstance(field, Text):
        return TextEdit()
    if isinstance(field, Vectors) and 0 < len(value) <= MOST_ROWS:
        return GridEdit(rows=len(value), columns=3, flat=False)
    if isinstance(field, Maybe) and isinstance(field.inner, Color):
        return MaybeEdit(ColorEdit(), (1.0, 1.0, 1.0))
    if isinstance(value, tuple) and value and all(isinstance(row, tuple) and len(row) == 4 for row in value):
        return GridEdit(rows=len(value), columns=4, flat=False)
    return Summary()


class Form(QWidget):
    """Labels and editors in two columns."""

    def __init__(self, parent: QWidget | None = None):
        super().__init__(parent)
        self.bindings: dict[str, Binding] = {}
        self.editors: dict[str, Editor] = {}
        self._labels: dict[str, QLabel] = {}
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(8)
        self._grid.setVerticalSpacing(6)
        self._grid.setColumnMinimumWidth(0, 74)
        self._grid.setColumnStretch(1, 1)

    def add(self, name: str, editor: Editor, tip: str, read: Callable[[], object], make: Callable[[object], object],
            commit: Callable[[object, object], None], seal: Callable[[], None], title: str = "") -> Editor:
        """A row that edits one value; the callables are those of `Binding`."""
        title = title or title_of(name)
        label = QLabel(title)
        label.setProperty("role", "label")
        label.setToolTip(tip)
        label.setBuddy(editor.focusProxy() or editor)
        editor.describe(title, tip)
        row = self._grid.rowCount()
        high = isinstance(editor, GridEdit) and len(editor.entries) > 4
        self._grid.addWidget(label, row, 0, Qt.AlignmentFlag.AlignTop if high else Qt.AlignmentFlag.AlignVCenter)
        self._grid.addWidget(editor, row, 1)
        self.editors[name], self._labels[name] = editor, label
        self.bindings[name] = Binding(editor, read, make, commit, seal)
        return editor

    def add_wide(self, widget: QWidget):
        """A row without a label."""
        self._grid.addWidget(widget, self._grid.rowCount(), 0, 1, 2)

    def refresh(self):
        """Show the model's values in all editors."""
        for binding in self.bindings.values():
            binding.refresh()

    def enable(self, name: str, on: bool):
        """Grey a row out, or back in."""
        self.editors[name].setEnabled(on)
        self._labels[name].setEnabled(on)


class RecordForm(Form):
    """The fields of one record, or `only` some in that order. `read` gives the record as it is now, `commit(record, label, merge)`
    takes the changed one. With `slowly` the form starts empty and each step of the iterator `rows` adds a row, some 1 ms of work."""

    def __init__(self, read: Callable[[], Record], commit: Callable[[Record, str, object], None], seal: Callable[[], None],
                 only: tuple[str, ...] | None = None, skip: tuple[str, ...] = (), editors: dict[str, Editor] | None = None,
                 slowly: bool = False):
        super().__init__()
        self._read, self._commit, self._seal = read, commit, seal
        self.rows = self._add_rows(only, skip, editors or {})
        if not slowly:
            deque(self.rows, maxlen=0)

    def _add_rows(self, only: tuple[str, ...] | None, skip: tuple[str, ...], editors: dict[str, Editor]) -> Iterator[None]:
        record = self._read()
        fields = fields_of(type(record))
        for name in only or fields:
            field = fields[name]
            if name in skip or (isinstance(field, Maybe) and not isinstance(field.inner, Color) and name not in editors):
                continue
            value = getattr(record, name)
            editor = editors.get(name) or editor_for(field, value)
            self.add(name, editor, tip_of(field), lambda name=name: getattr(self._read(), name),
                     lambda value, name=name: changed(self._read(), name, value),
                     lambda made, merge, name=name: self._commit(made, title_of(name).lower(), merge), self._seal)
            yield


def changed(record: Record, name: str, value: object) -> Record:
    """The record with one field replaced. A complaint about that very field does not repeat its name."""
    try:
        return msgspec.structs.replace(record, **{name: value})
    except FieldError as error:
        if error.path == name:
            raise FieldError(error.expected, error.got) from None
        raise


class Section(QWidget):
    """A heading that opens and closes what is below it."""

    toggled = Signal(bool)

    def __init__(self, title: str, content: QWidget, opened: bool = True, tip: str = "", parent: QWidget | None = None):
        super().__init__(parent)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 2, 0, 2)
        column.setSpacing(4)
        rule = QFrame()
        rule.setProperty("role", "rule")
        rule.setFixedHeight(1)
        self.button = QToolButton()
        self.button.setProperty("role", "section")
        self.button.setText(title)
        self.button.setToolTip(tip or f"Show or hide {title.lower()}")
        self.button.setAccessibleName(title)
        self.button.setCheckable(True)
        self.button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.content = content
        for widget in (rule, self.button, content):
            column.addWidget(widget)
        self.button.toggled.connect(self._open)
        self.button.setChecked(opened)
        self._open(opened)

    def _open(self, on: bool):
        self.button.setArrowType(Qt.ArrowType.DownArrow if on else Qt.ArrowType.RightArrow)
        self.content.setVisible(on)
        self.toggled.emit(on)
