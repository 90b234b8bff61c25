"""The render panel: how much work goes into the picture."""
import os

from PySide6.QtCore import Slot
from PySide6.QtWidgets import QLabel, QWidget

from app.editors import Editor, GridEdit, MaybeEdit, SliderEdit
from app.forms import RecordForm, Section
from app.options import Options
from app.panels.base import Panel
from app.session import Session

WHOLE = ("max_depth", "threads", "seed")
SEEN, ENDS = ("view", "exposure", "scale"), ("samples", "seconds", "error")
HOW = ("adaptive", "filter", "max_depth", "threads", "precision", "solver", "seed")


class RenderPanel(Panel):
    """Settings of the picture, not of the scene."""

    title, icon, tip = "Render", "render", "How the picture is computed"

    def __init__(self, session: Session, parent: QWidget | None = None):
        super().__init__(session, parent)
        editors = {name: GridEdit(whole=True) for name in WHOLE}
        editors["exposure"], editors["scale"] = SliderEdit(-10, 10), SliderEdit(0.25, 2)
        editors["samples"] = MaybeEdit(SliderEdit(1, 1024, log=True, whole=True), Options().samples)
        editors["seconds"], editors["error"] = MaybeEdit(GridEdit(), 10.0), MaybeEdit(GridEdit(), 0.002)
        editors["max_depth"] = SliderEdit(1, 16, whole=True)
        editors["threads"] = SliderEdit(0, os.cpu_count() or 1, whole=True)
        self.editors: dict[str, Editor] = editors
        self.ends = QLabel()
        for heading, names in ((None, SEEN), ("Stop at", ENDS), ("How", HOW)):
            form = RecordForm(lambda: session.options, self._commit, session.seal, only=names, editors=editors)
            editors |= form.editors
            self.column.addWidget(form if heading is None else Section(heading, form))
            session.options_changed.connect(form.refresh)
            if names is ENDS:
                form.add_wide(self.ends)
        self.size = QLabel()
        for label, name in ((self.ends, "When it stops"), (self.size, "Size of the picture")):
            label.setProperty("role", "hint")
            label.setWordWrap(True)
            label.setAccessibleName(name)
        self.column.addWidget(self.size)
        self.column.addStretch(1)
        session.options_changed.connect(self._tell_ends)
        session.frame_changed.connect(self._frame)
        self._tell_ends()

    def _commit(self, options: Options, label: str, merge: object):
        self.session.set_options(options, merge)

    @Slot()
    def _tell_ends(self):
        self.ends.setText(ends_text(self.session.options))
        self.ends.setVisible(bool(self.ends.text()))

    @Slot()
    def _frame(self):
        width, height = self.session.shown.job.size
        self.size.setText(f"The picture has {width} × {height} pixels.")


def ends_text(options: Options) -> str:
    """When the picture stops, in words, as far as the rows above do not say it."""
    unseen = "no error is left that could be seen" if options.adaptive else ""
    match sum(end is not None for end in (options.samples, options.seconds, options.error)):
        case 0:
            return f"Goes on until {unseen}." if unseen else "Never stops."
        case 1:
            return f"Stops before that if {unseen}." if unseen else ""
        case _:
            return f"Whichever comes first, or when {unseen}." if unseen else "Whichever comes first."
