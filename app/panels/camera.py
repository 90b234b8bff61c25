"""The camera panel: every number of the view, both ways bound to the mouse, and the lecture's chain of matrices."""
import numpy as np
from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QFontDatabase
from PySide6.QtWidgets import QHBoxLayout, QLabel, QVBoxLayout, QWidget

from app.editors import SliderEdit
from app.forms import RecordForm, Section
from app.icons import icon
from app.panels.base import Panel, button, small_button
from app.session import Session
from app.theme import DARK, Theme
from rtcore.camera import Camera

MATRICES = (("T₄", "t4", "moves the view to lookfrom"), ("R₃", "r3", "turns the view's axes u, v, w into the world's"),
            ("S₂", "s2", "scales pixels to scene units and turns the sign of x"),
            ("T₁", "t1", "moves the picture's centre to the axis, at distance d = 1"))
CHAIN = "P_world = T₄ R₃ S₂ T₁ P, the chain that takes a pixel to the world"


class CameraPanel(Panel):
    """A number that would make the camera degenerate is refused where it is typed."""

    title, icon, tip = "Camera", "camera", "Where the picture is seen from"

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(session, parent)
        self.form = RecordForm(lambda: session.camera or Camera(), lambda camera, label, merge: session.move(camera, merge), session.seal,
                               only=("lookfrom", "lookat", "up", "fov", "aperture", "focus"), editors={"fov": SliderEdit(5, 120)})
        self.column.addWidget(self.form)
        self.back = small_button(icon("back", DARK), "View back", "The view before this one (Alt+Left)", session.back)
        self.forward = small_button(icon("forward", DARK), "View forward", "The view that Back left (Alt+Right)", session.forward)
        everything = button("Frame all", "Draw back until everything is in the picture (Home)", session.frame_all)
        chosen = button("Frame selection", "Draw back until the selected node fills the picture (F)", session.frame_selection)
        reset = button("Reset view", "The camera that the file came with (Ctrl+Home)", session.reset_view)
        self.focus = button("Focus by click", "Then click in the picture on what is to be sharp, or Esc; the same as Ctrl and click",
                            lambda: session.aim(not session.aiming))
        self.focus.setCheckable(True)
        self.column.addWidget(self.focus)
        views, frames = QHBoxLayout(), QHBoxLayout()
        for row, widgets in ((views, (self.back, self.forward, reset)), (frames, (everything, chosen))):
            row.setSpacing(6)
            for widget in widgets:
                row.addWidget(widget, int(widget not in (self.back, self.forward)))
            self.column.addLayout(row)
        self.chain = ChainView()
        self.section = Section("Matrix chain", self.chain, opened=False, tip=CHAIN)
        self.column.addWidget(self.section)
        self.column.addStretch(1)
        self.section.toggled.connect(self.refresh)
        session.camera_changed.connect(self.refresh)
        session.frame_changed.connect(self._frame)
        session.aiming_changed.connect(self._aiming)
        self.refresh()

    def dress(self, theme: Theme):
        self.back.setIcon(icon("back", theme))
        self.forward.setIcon(icon("forward", theme))

    @Slot()
    def _aiming(self):
        self.focus.setChecked(self.session.aiming)

    @Slot()
    def refresh(self):
        """Show the session's camera."""
        self.form.refresh()
        self.form.setEnabled(self.session.camera is not None)
        self.focus.setEnabled(self.session.camera is not None)
        self.back.setEnabled(self.session.views.can_back)
        self.forward.setEnabled(self.session.views.can_forward)
        self._frame()

    @Slot()
    def _frame(self):
        if self.section.button.isChecked() and self.session.camera is not None and self.session.shown is not None:
            height, width = self.session.shown.frame.node.shape
            self.chain.show_chain(self.session.camera, width, height)


class ChainView(QWidget):
    """The four matrices and their product, as numbers."""

    def __init__(self, parent: QWidget | None = None):
        super().__init__(parent)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(8)
        self._labels: dict[str, QLabel] = {}
        fixed = QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)
        for sign, name, does in (*MATRICES, ("T₄R₃S₂T₁", "matrix", "takes a pixel (x, y, 0, 1) to its point in the world")):
            head = QLabel(f"<b>{sign}</b>  {does}")
            head.setWordWrap(True)
            head.setProperty("role", "hint")
            numbers = QLabel()
            numbers.setFont(fixed)
            numbers.setStyleSheet(f"font-family: '{fixed.family()}'; font-size: 8.5pt;")
            numbers.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            numbers.setAccessibleName(f"Matrix {name}")
            numbers.setToolTip(f"{sign} {does}. Can be selected and copied.")
            column.addWidget(head)
            column.addWidget(numbers)
            self._labels[name] = numbers

    def show_chain(self, camera: Camera, width: int, height: int):
        """Show the chain of a camera for a picture of this size."""
        chain = camera.chain(width, height)
        for name, label in self._labels.items():
            label.setText(matrix_text(getattr(chain, name)))


def matrix_text(matrix: np.ndarray) -> str:
    """A matrix in four aligned lines."""
    return "\n".join("  ".join(f"{0.0 if abs(x) < 1e-12 else x:8.4g}" for x in row) for row in matrix)
