"""The property editor: forms made from the fields of whatever is selected."""
import time
from collections import OrderedDict, deque
from collections.abc import Callable, Iterator

import msgspec
from PySide6.QtCore import Qt, QTimer, Slot
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QMenu, QToolButton, QVBoxLayout, QWidget

from app.dismantle import Dismantler
from app.editors import FlagEdit
from app.forms import Form, RecordForm, Section
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
SLICE = 0.0005      # s of building at a time and the row after: of a node's forms, which take 20 to 40 ms in all, some 3 ms in one go
KEPT = 8            # bodies of forms that are kept, 1 to 5 MiB each: to build one again takes 20 to 40 ms, to show it 1


class Body(QWidget):
    """The forms for all things of one structure, in a column. Which of them they show, the panel says."""

    def __init__(self):
        super().__init__()
        self.column = QVBoxLayout(self)
        self.column.setContentsMargins(0, 0, 0, 0)
        self.column.setSpacing(8)
        self.rest: Iterator[None] = iter(())        # what is still to be built
        self.forms: dict[str, Form] = {}
        self.others: list[Hint | MaterialPicker] = []       # that show what is selected as well

    def place(self, widget: QWidget):
        """Below the others."""
        self.column.addWidget(widget)

    def hint(self, text: Callable[[], str]):
        """A line of text, which tells of what is selected."""
        hint = Hint(text)
        self.others.append(hint)
        self.place(hint)

    def refresh(self):
        """Show what is selected as it is now."""
        for part in (*self.forms.values(), *self.others):
            part.refresh()


class Hint(QLabel):
    """A line of text that may change."""

    def __init__(self, text: Callable[[], str]):
        super().__init__(text())
        self._told = text
        self.setProperty("role", "hint")
        self.setWordWrap(True)

    def refresh(self):
        """Say it as it is now."""
        if (text := self._told()) != self.text():
            self.setText(text)


class PropertiesPanel(Panel):
    """Forms are built once for all things of one structure, row by row between other events, and kept; what is selected, and what an edit
    changes, is only shown in them."""

    title, icon, tip = "Properties", "properties", "Everything about what is selected"

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(session, parent)
        self._theme: Theme = DARK
        self._place: Place | None = None            # what the forms show
        self._bodies: OrderedDict[tuple, Body] = OrderedDict()      # by structure; the last one is seen
        self._dismantler = Dismantler(self)
        self._soon = QTimer(self, interval=0)
        self._soon.timeout.connect(self._build_on)
        self.column.addStretch(1)
        session.document.changed.connect(self.refresh)
        session.selection_changed.connect(self.refresh)
        self.refresh()

    @property
    def body(self) -> Body:
        """The one that is seen."""
        return next(reversed(self._bodies.values()))

    @property
    def forms(self) -> dict[str, Form]:
        """Those that are seen, by name."""
        return self.body.forms

    def dress(self, theme: Theme):
        self._theme = theme
        while self._bodies:
            self._drop_oldest()
        self.refresh()

    @Slot()
    def refresh(self):
        """Show what is selected as it is now."""
        another = self.session.selection != self._place
        if another:
            self._leave()
        self._place = place = self.session.selection
        record = record_at(self.session.scene, place) if place is not None else None
        structure = self._structure(record)
        if not self._bodies or structure != next(reversed(self._bodies)):
            self._show(structure, record)
            if another:
                self.verticalScrollBar().setValue(0)
        self.body.refresh()

    def _leave(self):
        """What is being typed belongs to what was selected until now."""
        focus = self.focusWidget()
        if focus is not None and focus.hasFocus():
            focus.clearFocus()
        self.session.seal()

    def _show(self, structure: tuple, record: Record | None):
        """Bring the body for a structure to the front, made if there is none."""
        if self._bodies:
            self.body.hide()
        if structure not in self._bodies:
            self._bodies[structure] = body = Body()
            body.rest = self._build(body, record)
            self.column.insertWidget(0, body)
        self._bodies.move_to_end(structure)
        self._build_on()
        self.body.show()
        while len(self._bodies) > KEPT:
            self._drop_oldest()

    def _drop_oldest(self):
        _, body = self._bodies.popitem(last=False)
        self.column.removeWidget(body)
        body.hide()
        forms = body.forms.values()
        self._dismantler.take([*(editor for form in forms for editor in form.editors.values()), *forms, body])

    def _structure(self, record: Record | None) -> tuple:
        """What decides which editors there are."""
        if not isinstance(record, Node):
            return type(record), isinstance(record, Material) and record.checker is not None
        part = definition_around(self.session.scene, self._place.key) is not None
        points = [len(value) for value in (getattr(record.shape, name) for name in getattr(type(record.shape), "__struct_fields__", ()))
                  if isinstance(value, tuple) and value and isinstance(value[0], tuple)]
        material = self._material(record)
        return (Node, part, type(record.shape), tuple(points), tuple(map(type, record.transform)), material is None, type(record.material),
                material is not None and material.checker is not None, tuple(self.session.scene.materials))

    def _material(self, node: Node) -> Material | None:
        """The material that a node names or has of its own."""
        return self.session.scene.materials[node.material] if isinstance(node.material, str) else node.material

    def complete(self):
        """Build what is still to be built."""
        deque(self.body.rest, maxlen=0)
        self._build_on()

    # building: generators, a step of which is some 1 ms of work

    @Slot()
    def _build_on(self):
        until = time.perf_counter() + SLICE
        while time.perf_counter() < until:
            if next(self.body.rest, self) is self:
                self.widget().setUpdatesEnabled(True)
                return self._soon.stop()
        self.widget().setUpdatesEnabled(False)      # what was there is seen until all of the new is
        self._soon.start()

    def _record(self) -> Record:
        """What is selected."""
        return record_at(self.session.scene, self._place)

    def _commit(self, record: Record, label: str, merge: object):
        """Put another record in the place of what is selected."""
        self.session.edit_record(self._place, record, f"{label_of(self.session.scene, self._place)}: {label}", merge)

    def _build(self, body: Body, record: Record | None) -> Iterator[None]:
        if record is None:
            body.hint(lambda: "Click an object in the picture or in the scene tree to see and change its properties.")
        elif isinstance(record, Node):
            yield from self._build_node(body, record)
        else:
            body.hint(self._heading)
            form = RecordForm(self._record, self._commit, self.session.seal, slowly=True)
            yield from self._add(body, "record", form)
            if isinstance(record, Material):
                yield from self._build_checker(body, self._record, self._commit, form)

    def _heading(self) -> str:
        title = label_of(self.session.scene, self._place)
        return title if self._place.kind == "background" else f"{type(self._record()).__name__} “{title}”"

    def _build_node(self, body: Body, node: Node) -> Iterator[None]:
        read, commit = self._record, self._commit

        def part() -> str | None:
            return definition_around(self.session.scene, self._place.key)
        if part() is not None:
            body.hint(lambda: f"Part of the definition “{part()}”: a change shows in every use of it.")
        yield from self._add(body, "node", RecordForm(read, commit, self.session.seal, only=("name", "visible", "note"), slowly=True))
        if node.shape is not None:
            def commit_shape(shape, label, merge):
                commit(msgspec.structs.replace(read(), shape=shape), label, merge)
            form = RecordForm(lambda: read().shape, commit_shape, self.session.seal, slowly=True)
            yield from self._add(body, "shape", form, type(node.shape).__name__)
        yield from self._build_transforms(body, read, commit)
        yield from self._build_material(body, read, commit)

    def _build_transforms(self, body: Body, read: Callable[[], Node], commit: Callable) -> Iterator[None]:
        content = QWidget()
        column = QVBoxLayout(content)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(6)
        body.place(Section("Transform", content, opened=bool(read().transform)))

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
            body.forms[f"transform {i}"] = form
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

    def _build_material(self, body: Body, read: Callable[[], Node], commit: Callable) -> Iterator[None]:
        content = QWidget()
        column = QVBoxLayout(content)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(6)
        body.place(Section("Material", content))
        picker = MaterialPicker(self.session, read, commit)
        body.others.append(picker)
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
            body.forms["material"] = form
            column.addWidget(form)
            yield from form.rows
            yield from self._build_checker(body, lambda: self._material(read()), commit_material, form)

    def _build_checker(self, body: Body, read: Callable[[], Material], commit: Callable, form: Form) -> Iterator[None]:
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
            body.forms["checker"] = inner
            form.add_wide(inner)
            yield from inner.rows

    def _add(self, body: Body, name: str, form: RecordForm, heading: str = "") -> Iterator[None]:
        body.forms[name] = form
        body.place(Section(heading, form) if heading else form)
        yield from form.rows


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
