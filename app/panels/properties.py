"""The property editor: forms made from the fields of whatever is selected."""
import time
from collections import deque
from collections.abc import Callable, Iterator

import msgspec
from PySide6.QtCore import Qt, QTimer, Slot
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QMenu, QToolButton, QVBoxLayout, QWidget

from app.editors import FlagEdit
from app.forms import MOST_ROWS, Form, RecordForm, Section
from app.icons import icon
from app.panels.base import Panel, small_button
from app.places import Place, definition_around, label_of, record_at, spliced
from app.session import Session
from app.theme import DARK, Theme
from rtcore.fields import FieldError, Record
from rtcore.scene import DEFAULT_MATERIAL, Checker, Material, Matrix, Node, Rotate, Scale, Shear, Translate

NEW_TRANSFORMS = (Translate((0, 0, 0)), Rotate((0, 1, 0), 0), Scale((1, 1, 1)), Shear(),
                  Matrix(((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))))
INHERITED, OWN = "inherited", "own"
SLICE = 0.002       # s of building at a time: a node's forms take 20 to 40 ms, in which the picture could not be moved


class PropertiesPanel(Panel):
    """Rebuilt when another kind of thing is selected, row by row between other events; while its structure stays, only the values are
    shown anew."""

    title, icon, tip = "Properties", "properties", "Everything about what is selected"

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(session, parent)
        self._theme: Theme = DARK
        self._built: object = None
        self._rest: Iterator[None] = iter(())       # what is still to be built
        self._soon = QTimer(self, interval=0)
        self._soon.timeout.connect(self._build_on)
        self.forms: dict[str, Form] = {}
        self._pickers: list[MaterialPicker] = []
        session.document.changed.connect(self.refresh)
        session.selection_changed.connect(self.refresh)
        self.refresh()

    def dress(self, theme: Theme):
        self._theme, self._built = theme, None
        self.refresh()

    @Slot()
    def refresh(self):
        """Show what is selected as it is now."""
        place = self.session.selection
        record = record_at(self.session.scene, place) if place is not None else None
        structure = (place, self._structure(record))
        if structure != self._built:
            self._built = structure
            self._clear()
            self._rest = self._build(place, record)
            self._build_on()
        for form in self.forms.values():
            form.refresh()
        for picker in self._pickers:
            picker.refresh()

    def _structure(self, record: Record | None) -> tuple:
        """What decides which editors there are."""
        if not isinstance(record, Node):
            return type(record), isinstance(record, Material) and record.checker is not None
        points = [len(value) for value in (getattr(record.shape, name) for name in getattr(type(record.shape), "__struct_fields__", ()))
                  if isinstance(value, tuple) and value and isinstance(value[0], tuple) and len(value) <= MOST_ROWS]
        material = self._material(record)
        return (type(record.shape), points, [type(t) for t in record.transform], material is None, type(record.material),
                material is not None and material.checker is not None, tuple(self.session.scene.materials))

    def _material(self, node: Node) -> Material | None:
        """The material that a node names or has of its own."""
        return self.session.scene.materials[node.material] if isinstance(node.material, str) else node.material

    def complete(self):
        """Build what is still to be built."""
        deque(self._rest, maxlen=0)

    # building: generators, a step of which is some 1 ms of work

    @Slot()
    def _build_on(self):
        until = time.perf_counter() + SLICE
        while time.perf_counter() < until:
            if next(self._rest, self) is self:
                self.widget().setUpdatesEnabled(True)
                return self._soon.stop()
        self.widget().setUpdatesEnabled(False)      # what was there is seen until all of the new is
        self._soon.start()

    def _clear(self):
        while (item := self.column.takeAt(0)) is not None:
            if item.widget() is not None:
                item.widget().hide()
                item.widget().deleteLater()
        self.column.addStretch(1)
        self.forms, self._pickers = {}, []

    def _build(self, place: Place | None, record: Record | None) -> Iterator[None]:
        if record is None:
            self._add_hint("Click an object in the picture or in the scene tree to see and change its properties.")
        elif isinstance(record, Node):
            yield from self._build_node(place, record)
        else:
            title = label_of(self.session.scene, place)
            self._add_hint(title if place.kind == "background" else f"{type(record).__name__} “{title}”")
            form = RecordForm(lambda: record_at(self.session.scene, place), self._commit(place), self.session.seal, slowly=True)
            yield from self._add("record", form)
            if isinstance(record, Material):
                yield from self._build_checker(lambda: record_at(self.session.scene, place), self._commit(place), form)

    def _build_node(self, place: Place, node: Node) -> Iterator[None]:
        def read() -> Node:
            return record_at(self.session.scene, place)
        commit = self._commit(place)
        if (name := definition_around(self.session.scene, place.key)) is not None:
            self._add_hint(f"Part of the definition “{name}”: a change shows in every use of it.")
        yield from self._add("node", RecordForm(read, commit, self.session.seal, only=("name", "visible", "note"), slowly=True))
        if node.shape is not None:
            def commit_shape(shape, label, merge):
                commit(msgspec.structs.replace(read(), shape=shape), label, merge)
            form = RecordForm(lambda: read().shape, commit_shape, self.session.seal, slowly=True)
            yield from self._add("shape", form, type(node.shape).__name__)
        yield from self._build_transforms(read, commit)
        yield from self._build_material(read, commit)

    def _build_transforms(self, read: Callable[[], Node], commit: Callable) -> Iterator[None]:
        body = QWidget()
        column = QVBoxLayout(body)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(6)
        self._place(Section("Transform", body, opened=bool(read().transform)))

        def put(i: int, transform, label: str, merge: object):
            commit(msgspec.structs.replace(read(), transform=spliced(read().transform, i, transform)), label, merge)

        def drop(i: int):
            transform = read().transform
            commit(msgspec.structs.replace(read(), transform=transform[:i] + transform[i + 1:]), "remove transform", None)

        for i, transform in enumerate(read().transform):
            kind = type(transform).__name__
            head = QHBoxLayout()
            label = QLabel(f"{i + 1}. {kind}")
            label.setToolTip(type(transform).__doc__.splitlines()[0])
            head.addWidget(label)
            head.addStretch(1)
            remove = f"Remove this {kind.lower()}"
            head.addWidget(small_button(icon("close", self._theme), remove, remove, lambda i=i: drop(i)))
            column.addLayout(head)
            form = RecordForm(lambda i=i: read().transform[i], lambda t, label, merge, i=i: put(i, t, label, merge), self.session.seal,
                              slowly=True)
            self.forms[f"transform {i}"] = form
            column.addWidget(form)
            yield from form.rows
        add = QToolButton()
        add.setText("Add a transform…")
        add.setToolTip("Add a transform after the others; they apply in the order of the list")
        add.setAccessibleName("Add a transform")
        add.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(add)

        def append(transform):
            commit(msgspec.structs.replace(read(), transform=(*read().transform, transform)), "add transform", None)
        for new in NEW_TRANSFORMS:
            menu.addAction(type(new).__name__, lambda new=new: append(new))
        add.setMenu(menu)
        column.addWidget(add, 0, Qt.AlignmentFlag.AlignLeft)
        yield

    def _build_material(self, read: Callable[[], Node], commit: Callable) -> Iterator[None]:
        body = QWidget()
        column = QVBoxLayout(body)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(6)
        self._place(Section("Material", body))
        picker = MaterialPicker(self.session, read, commit)
        self._pickers.append(picker)
        column.addWidget(picker)
        yield
        if self._material(read()) is not None:
            def commit_material(material, label, merge):
                name = read().material
                if isinstance(name, str):
                    self.session.edit_record(Place("material", name), material, f"{name}: {label}", merge)
                else:
                    commit(msgspec.structs.replace(read(), material=material), label, merge)
            form = RecordForm(lambda: self._material(read()), commit_material, self.session.seal, slowly=True)
            self.forms["material"] = form
            column.addWidget(form)
            yield from form.rows
            yield from self._build_checker(lambda: self._material(read()), commit_material, form)

    def _build_checker(self, read: Callable[[], Material], commit: Callable, form: Form) -> Iterator[None]:
        """A check box for the pattern, and its fields while it is there."""
        def set_checker(checker, label, merge):
            commit(msgspec.structs.replace(read(), checker=checker), label, merge)
        form.add("checker", FlagEdit("Two colours"), "A pattern of cubes of two colours in place of the colour.",
                 lambda: read().checker is not None, lambda on: Checker() if on else None,
                 lambda made, merge: set_checker(made, "checker", merge), self.session.seal)
        if read().checker is not None:
            inner = RecordForm(lambda: read().checker or Checker(),
                               lambda made, label, merge: set_checker(made, f"checker {label}", merge), self.session.seal,
                               slowly=True)
            self.forms["checker"] = inner
            form.add_wide(inner)
            yield from inner.rows

    def _add(self, name: str, form: RecordForm, heading: str = "") -> Iterator[None]:
        self.forms[name] = form
        self._place(Section(heading, form) if heading else form)
        yield from form.rows

    def _place(self, widget: QWidget):
        """Below the others, above the empty rest."""
        self.column.insertWidget(self.column.count() - 1, widget)

    def _add_hint(self, text: str):
        label = QLabel(text)
        label.setProperty("role", "hint")
        label.setWordWrap(True)
        self._place(label)

    def _commit(self, place: Place) -> Callable[[Record, str, object], None]:
        def commit(record: Record, label: str, merge: object):
            name = label_of(self.session.scene, place)
            self.session.edit_record(place, record, f"{name}: {label}", merge)
        return commit


class MaterialPicker(QWidget):
    """Which material a node has: its parent's, one of the scene's by name, or one of its own."""

    def __init__(self, session: Session, read: Callable[[], Node], commit: Callable, parent: QWidget | None = None):
        super().__init__(parent)
        self._session, self._read, self._commit = session, read, commit
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        self.combo = QComboBox()
        self.combo.setAccessibleName("Material of the node")
        self.combo.setToolTip("Which material the node has. A named one is shared: a change of it shows wherever it is named.")
        self.combo.addItem("As its parent", INHERITED)
        for name in session.scene.materials:
            self.combo.addItem(f"{name} (shared)", ("named", name))
        self.combo.addItem("Its own", OWN)
        self.combo.activated.connect(self._chosen)
        row.addWidget(self.combo, 1)

    def refresh(self):
        """Show the node's material."""
        material = self._read().material
        wanted = INHERITED if material is None else ("named", material) if isinstance(material, str) else OWN
        self.combo.setCurrentIndex(next(i for i in range(self.combo.count()) if self.combo.itemData(i) == wanted))

    @Slot(int)
    def _chosen(self, index: int):
        wanted, node = self.combo.itemData(index), self._read()
        if wanted == INHERITED:
            material = None
        elif wanted == OWN:
            now = node.material
            material = self._session.scene.materials[now] if isinstance(now, str) else now or self._seen()
        else:
            material = wanted[1]
        try:
            self._commit(msgspec.structs.replace(node, material=material), "material", None)
        except FieldError as error:
            self._session.said.emit("error", str(error))
            self.refresh()

    def _seen(self) -> Material:
        """What the node inherits now, as the start of a material of its own."""
        scene, path = self._session.scene, self._session.selection.key
        for depth in range(len(path) - 1, 0, -1):
            material = record_at(scene, Place("node", path[:depth])).material
            if material is not None:
                return scene.materials[material] if isinstance(material, str) else material
        return DEFAULT_MATERIAL
