"""The render panel: how much work goes into the picture."""
import os

from PySide6.QtCore import Slot
from PySide6.QtWidgets import QLabel, QWidget

from app.editors import GridEdit, MaybeEdit, SliderEdit
from app.forms import RecordForm
from app.options import Options
from app.panels.base import Panel
from app.session import Session

WHOLE = ("samples", "max_depth", "threads", "seed")


class RenderPanel(Panel):
    """Settings of the picture, not of the scene."""

    title, icon, tip = "Render", "render", "How the picture is computed"

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(session, parent)
        editors = {name: GridEdit(whole=True) for name in WHOLE}
        editors["samples"] = SliderEdit(1, 1024, log=True, whole=True)
        editors["max_depth"] = SliderEdit(1, 16, whole=True)
        editors["threads"] = SliderEdit(0, os.cpu_count() or 1, whole=True)
        editors["seconds"], editors["error"] = MaybeEdit(GridEdit(), 10.0), MaybeEdit(GridEdit(), 0.002)
        editors["scale"] = SliderEdit(0.25, 2)
        self.form = RecordForm(lambda: session.options, self._commit, session.seal, skip=("shadows", "fog", "reflections"), editors=editors)
        self.column.addWidget(self.form)
        self.size = QLabel()
        self.size.setProperty("role", "hint")
        self.size.setAccessibleName("Size of the picture")
        self.column.addWidget(self.size)
        self.column.addStretch(1)
        session.options_changed.connect(self.form.refresh)
        session.frame_changed.connect(self._frame)

    def _commit(self, options: Options, label: str, merge: object):
        self.session.set_options(options, merge)

    @Slot()
    def _frame(self):
        width, height = self.session.shown.job.size
        self.size.setText(f"The picture has {width} × {height} pixels.")
