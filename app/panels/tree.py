"""The scene tree: what there is, what is shown, what is selected."""
from PySide6.QtCore import QItemSelectionModel, QModelIndex, QSize, Slot
from PySide6.QtWidgets import QAbstractItemView, QVBoxLayout, QWidget

from app.panels.rows import SceneView
from app.places import record_at
from app.session import Session
from app.theme import Theme
from app.tree_model import BRANCHES, SceneModel


class TreePanel(QWidget):
    """Selection goes both ways: a click in the picture selects the row, a row selects and outlines the object."""

    title, icon, area, tip = "Scene", "scene", "left", "What the scene consists of"

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(parent)
        self.session = session
        self.model = SceneModel(session, self)
        self.view = SceneView(self.model, self)
        self.view.setAccessibleName("Scene tree")
        self.view.setEditTriggers(QAbstractItemView.EditTrigger.DoubleClicked | QAbstractItemView.EditTrigger.EditKeyPressed)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.view)
        self._following = False
        self.view.selectionModel().currentChanged.connect(self._picked)
        self.model.modelReset.connect(self._opened)
        session.selection_changed.connect(self.follow)
        self._opened()

    def dress(self, theme: Theme):
        self.model.dress(theme)
        self.view.dress(theme)

    def sizeHint(self) -> QSize:
        return QSize(230, 400)

    @Slot()
    def _opened(self):
        self.view.expand(self.model.index(BRANCHES.index("scene"), 0))
        self.follow()

    @Slot(QModelIndex, QModelIndex)
    def _picked(self, index: QModelIndex, _: QModelIndex):
        if not self._following:
            self.session.select(self.model.place(index) if index.isValid() else None)

    @Slot()
    def follow(self):
        """Show the session's selection."""
        place = self.session.selection
        self._following = True
        try:
            if place is None or record_at(self.session.scene, place) is None:
                self.view.selectionModel().clear()
            else:
                index = self.model.find(place)
                self.view.selectionModel().setCurrentIndex(index, QItemSelectionModel.SelectionFlag.ClearAndSelect)
                self.view.scrollTo(index)
        finally:
            self._following = False
