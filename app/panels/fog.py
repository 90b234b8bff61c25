"""The fog panel: the scene's fog, with only those fields enabled that its kind knows."""
import msgspec
from PySide6.QtCore import Slot
from PySide6.QtWidgets import QLabel, QWidget

from app.editors import FlagEdit, SliderEdit
from app.forms import RecordForm
from app.panels.base import Panel
from app.session import Session
from rtcore.scene import Fog

ORDER = ("on", "kind", "color", "density", "start", "end")
NONE = Fog(on=False)    # what the panel shows of a scene without fog


class FogPanel(Panel):
    """The fog is part of the scene: what is changed here is undone and saved. The toolbar's switch only leaves it out of the picture."""

    title, icon, tip = "Fog", "fog", "The fog of the scene"

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(session, parent)
        editors = {"density": SliderEdit(0.001, 2, log=True), "on": FlagEdit("There is fog")}
        self.form = RecordForm(self._fog, self._commit, session.seal, only=ORDER, editors=editors)
        self.column.addWidget(self.form)
        self.hint = QLabel()
        self.hint.setProperty("role", "hint")
        self.hint.setWordWrap(True)
        self.column.addWidget(self.hint)
        self.column.addStretch(1)
        session.document.changed.connect(self.refresh)
        session.options_changed.connect(self.refresh)
        self.refresh()

    def _fog(self) -> Fog:
        return self.session.scene.fog or NONE

    def _commit(self, fog: Fog, label: str, merge: object):
        fog = fog if self.session.scene.fog or fog.on else msgspec.structs.replace(fog, on=True)   # a first change means: let there be fog
        self.session.edit(msgspec.structs.replace(self.session.scene, fog=fog), f"fog {label}", merge)

    @Slot()
    def refresh(self):
        """Show the scene's fog."""
        self.form.refresh()
        fog = self._fog()
        for name in ("kind", "color", "density", "start", "end"):
            applies = {"density": fog.kind != "linear", "start": fog.kind == "linear", "end": fog.kind == "linear"}.get(name, True)
            self.form.enable(name, fog.on and applies)
        left_out = fog.on and not self.session.options.fog
        self.hint.setText("The toolbar's fog switch is off, so the picture leaves the fog out." if left_out else "")
        self.hint.setVisible(left_out)
