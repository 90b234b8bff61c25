"""The scene as an item model: rows are made when they are first looked at, so a scene of many thousand nodes opens at once."""
from typing import NamedTuple

import msgspec
from PySide6.QtCore import QAbstractItemModel, QModelIndex, QObject, Qt
from PySide6.QtGui import QColor

from app.icons import icon
from app.places import Place, below, definition_around, kind_of, label_of, lights_of, record_at
from app.session import Session
from app.theme import DARK, Theme
from rtcore.fields import FieldError

TOP = QModelIndex()     # above all rows
SELECTABLE = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable       # made once: Qt asks for them row by row
EDITABLE = SELECTABLE | Qt.ItemFlag.ItemIsUserCheckable | Qt.ItemFlag.ItemIsEditable
BRANCHES = ("scene", "lights", "materials", "background")     # the rows of the first level

TIPS = {"scene": "What the scene consists of", "lights": "What lights the scene",
        "materials": "Materials that nodes name; select one to edit it", "material": "A material of the scene; select it to edit it",
        "background": "What is seen where nothing is hit; select it to edit it"}


class Row:
    """A row that has been looked at: a place, or one of the branches. Its children come into being one by one."""

    __slots__ = ("parent", "number", "place", "record", "children", "depth")

    def __init__(self, parent: "Row | None", number: int, place: Place, record: object):
        self.parent, self.number, self.place, self.record = parent, number, place, record
        self.depth: int = parent.depth + 1 if parent is not None else 0
        self.children: dict[int, Row] = {}


class Look(NamedTuple):
    """All that is seen of a row; `checked` is None where there is no box, `depth` 1 on the first level."""

    text: str
    icon: str
    checked: bool | None
    faint: bool
    depth: int


class SceneModel(QAbstractItemModel):
    """The session's scene. An edit updates the rows in place, so the tree stays open where it was open."""

    def __init__(self, session: Session, parent: QObject | None = None):
        super().__init__(parent)
        self._session = session
        self._theme: Theme = DARK
        self._scene = session.scene
        self._root = Row(None, 0, Place("root"), None)
        session.document.replaced.connect(self._reset)
        session.document.changed.connect(self._sync)

    def dress(self, theme: Theme):
        """Icons in the colours of a theme."""
        self._theme = theme
        self.layoutChanged.emit()

    # what Qt asks for

    def rowCount(self, parent: QModelIndex = TOP) -> int:
        return self._count(self._row(parent))

    def columnCount(self, parent: QModelIndex = TOP) -> int:
        return 1

    def hasChildren(self, parent: QModelIndex = TOP) -> bool:
        return self.rowCount(parent) > 0

    def index(self, row: int, column: int, parent: QModelIndex = TOP) -> QModelIndex:
        above = self._row(parent)
        if not (0 <= row < self._count(above) and column == 0):
            return QModelIndex()
        return self.createIndex(row, 0, self._child(above, row))

    def parent(self, index: QModelIndex) -> QModelIndex:
        if not index.isValid():
            return QModelIndex()
        above = index.internalPointer().parent
        return QModelIndex() if above is self._root else self.createIndex(above.number, 0, above)

    def flags(self, index: QModelIndex) -> Qt.ItemFlag:
        if not index.isValid():
            return Qt.ItemFlag.NoItemFlags
        return EDITABLE if index.internalPointer().place.kind in ("node", "light") else SELECTABLE

    def data(self, index: QModelIndex, role: int = Qt.ItemDataRole.DisplayRole):
        if not index.isValid():
            return None
        row = index.internalPointer()
        if role == Qt.ItemDataRole.DisplayRole:
            return self._text(row)
        if role == Qt.ItemDataRole.EditRole:
            return getattr(row.record, "name", "")
        if role == Qt.ItemDataRole.DecorationRole:
            return icon(self._icon(row), self._theme, switch=False)
        if role == Qt.ItemDataRole.CheckStateRole and (on := self._checked(row)) is not None:
            return Qt.CheckState.Checked if on else Qt.CheckState.Unchecked
        if role == Qt.ItemDataRole.ForegroundRole and self._hidden(row):
            return QColor(self._theme.faint)
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleDescriptionRole):
            return self._tip(row)
        return None

    def look(self, index: QModelIndex) -> Look:
        """All at once of what `data` tells part by part."""
        row = index.internalPointer()
        return Look(self._text(row), self._icon(row), self._checked(row), self._hidden(row), row.depth)

    def setData(self, index: QModelIndex, value, role: int = Qt.ItemDataRole.EditRole) -> bool:
        row = self._row(index)
        name = label_of(self._scene, row.place)
        try:
            if role == Qt.ItemDataRole.CheckStateRole:
                on = Qt.CheckState(value) == Qt.CheckState.Checked
                field = "visible" if row.place.kind == "node" else "on"
                record = msgspec.structs.replace(row.record, **{field: on})
                self._session.edit_record(row.place, record, f"{'show' if on else 'hide'} {name}")
                return True
            if role == Qt.ItemDataRole.EditRole and value.strip() != row.record.name:
                self._session.edit_record(row.place, msgspec.structs.replace(row.record, name=value.strip()), f"rename {name}")
                return True
        except FieldError as error:
            self._session.said.emit("error", str(error))
        return False

    # places

    def place(self, index: QModelIndex) -> Place | None:
        """The place that a row stands for, or None for a branch."""
        row = self._row(index)
        return row.place if row.place.kind in ("node", "light", "material", "background") else None

    def find(self, place: Place) -> QModelIndex:
        """The row of a place; made, with those above it, if it has not been looked at."""
        if place.kind == "node":
            steps = (BRANCHES.index("scene"), *place.key)
        elif place.kind == "light":
            steps = (BRANCHES.index("lights"), place.key)
        elif place.kind == "material":
            steps = (BRANCHES.index("materials"), list(self._scene.materials).index(place.key))
        else:
            steps = (BRANCHES.index("background"),)
        index = QModelIndex()
        for step in steps:
            index = self.index(step, 0, index)
        return index

    # rows

    def _row(self, index: QModelIndex) -> Row:
        return index.internalPointer() if index.isValid() else self._root

    def _count(self, row: Row) -> int:
        kind = row.place.kind
        if kind == "root":
            return len(BRANCHES)
        if kind == "node":
            return 1 if row.record.use is not None else len(row.record.children or ())
        return len(self._members(kind))

    def _members(self, kind: str) -> tuple:
        if kind == "scene":
            return self._scene.objects
        if kind == "lights":
            return lights_of(self._scene)
        return tuple(self._scene.materials.values()) if kind == "materials" else ()

    def _child(self, row: Row, number: int) -> Row:
        child = row.children.get(number)
        if child is None:
            kind = row.place.kind
            if kind == "root":
                place, record = Place(BRANCHES[number]), self._scene.background
            elif kind == "lights":
                place, record = Place("light", number), lights_of(self._scene)[number]
            elif kind == "materials":
                name, record = list(self._scene.materials.items())[number]
                place = Place("material", name)
            else:
                path = row.place.key if kind == "node" else ()
                nodes = below(self._scene, row.record) if kind == "node" else self._scene.objects
                place, record = Place("node", (*path, number)), nodes[number]
            child = row.children[number] = Row(row, number, place, record)
        return child

    def _reset(self):
        self.beginResetModel()
        self._scene = self._session.scene
        self._root = Row(None, 0, Place("root"), None)
        self.endResetModel()

    def _sync(self):
        """Take over an edited scene. Its structure is usually the same: then only rows whose record changed are touched."""
        old, scene = self._scene, self._session.scene
        if scene is old:
            return
        sizes = [len(self._members(kind)) for kind in BRANCHES]
        self._scene = scene
        touched: list[Row] = []
        same = tuple(old.materials) == tuple(scene.materials) and sizes == [len(self._members(kind)) for kind in BRANCHES]
        if not (same and self._update(self._root, old.definitions is not scene.definitions, touched)):
            return self._reset()
        for row in touched:
            index = self.createIndex(row.number, 0, row)
            self.dataChanged.emit(index, index)

    def _update(self, row: Row, everywhere: bool, touched: list[Row]) -> bool:
        """Put new records into the rows below `row`; False if the structure is another one."""
        for child in row.children.values():
            if child.place.kind in BRANCHES and child.place.kind != "background":
                before = record = None
            else:
                before, record = child.record, record_at(self._scene, child.place)
                if record is None:
                    return False
                if child.place.kind == "node" and (before.use, len(before.children or ())) != (record.use, len(record.children or ())):
                    return False
                child.record = record
            if before is not record:
                touched.append(child)
            if (before is not record or record is None or everywhere) and not self._update(child, everywhere, touched):
                return False
        return True

    # how a row looks

    def _text(self, row: Row) -> str:
        kind, scene = row.place.kind, self._scene
        if kind == "scene":
            return scene.name or "Scene"
        if kind == "lights":
            return "Lights" if scene.lights is not None else "Lights (studio)"
        if kind in ("materials", "background"):
            return kind.capitalize()
        text = label_of(scene, row.place)
        if kind == "node" and row.record.children is not None and len(row.record.children) > 1:
            text += f"  ({len(row.record.children):,})"
        return text

    def _icon(self, row: Row) -> str:
        kind = row.place.kind
        return kind_of(row.record) if kind == "node" else type(row.record).__name__.lower() if kind == "light" else \
            "material" if kind == "materials" else kind

    def _checked(self, row: Row) -> bool | None:
        kind = row.place.kind
        return row.record.visible if kind == "node" else row.record.on if kind == "light" else None

    def _hidden(self, row: Row) -> bool:
        while row is not None:
            if (row.place.kind == "node" and not row.record.visible) or (row.place.kind == "light" and not row.record.on):
                return True
            row = row.parent
        return False

    def _tip(self, row: Row) -> str:
        kind = row.place.kind
        if kind == "node":
            what = kind_of(row.record)
            lines = [f"Use of the definition “{row.record.use}”" if what == "use" else what.capitalize()]
            if (name := definition_around(self._scene, row.place.key)) is not None:
                lines.append(f"Part of the definition “{name}”: what is changed or hidden here changes in every use of it")
            lines += [row.record.note] if row.record.note else []
            return "\n".join([*lines, "The box shows or hides it; double-click to rename"])
        if kind == "light":
            return f"{type(row.record).__name__} light\nThe box switches it on or off; double-click to rename"
        return TIPS[kind]
