"""The document: the current scene, its undo stack and whether it is saved. Nothing else replaces the scene."""
from pathlib import Path
from typing import NamedTuple

from PySide6.QtCore import QObject, Signal

from rtcore.scene import Scene

MOST_STEPS = 500


class Step(NamedTuple):
    """One edit: what the menu calls it, the scene after it, and which edits it merges with."""

    label: str
    scene: Scene
    merge: object


class Document(QObject):
    """A stack of frozen scenes. Scenes share what an edit did not touch, so a step costs little memory."""

    changed = Signal()      # the scene, or what can be undone, or whether it is saved
    replaced = Signal()     # another file stands here now; `changed` follows

    def __init__(self, parent: QObject | None = None):
        super().__init__(parent)
        self.path: Path | None = None       # where Save writes; None for a scene that has no file yet
        self._steps = [Step("", Scene(), None)]
        self._at = 0
        self._saved: Scene | None = self.scene

    @property
    def scene(self) -> Scene:
        return self._steps[self._at].scene

    @property
    def modified(self) -> bool:
        """Whether the scene differs from the saved one: by identity, so undoing back to the saved state is clean again."""
        return self.scene is not self._saved

    @property
    def undo_label(self) -> str | None:
        """What Undo would take back, or None."""
        return self._steps[self._at].label if self._at else None

    @property
    def redo_label(self) -> str | None:
        """What Redo would do again, or None."""
        return self._steps[self._at + 1].label if self._at + 1 < len(self._steps) else None

    def open(self, scene: Scene, path: Path | None):
        """Put another scene here, saved and with nothing to undo."""
        self._steps, self._at, self._saved, self.path = [Step("", scene, None)], 0, scene, path
        self.replaced.emit()
        self.changed.emit()

    def edit(self, scene: Scene, label: str, merge: object = None):
        """Make `scene` the current one. Edits in a row with the same `merge` (anything but None) are one step of undo."""
        if scene is self.scene:
            return
        del self._steps[self._at + 1:]
        step = Step(label, scene, merge)
        if merge is not None and self._at and self._steps[self._at].merge == merge:
            self._steps[self._at] = step
        else:
            self._steps.append(step)
            del self._steps[:-MOST_STEPS]
            self._at = len(self._steps) - 1
        self.changed.emit()

    def seal(self):
        """End the run of merging edits: the next one is a step of its own."""
        self._steps[self._at] = self._steps[self._at]._replace(merge=None)

    def undo(self):
        self._go(-1 if self._at else 0)

    def redo(self):
        self._go(1 if self._at + 1 < len(self._steps) else 0)

    def saved(self, scene: Scene, path: Path):
        """`scene`, which was the current one when the save began, is now in the file at `path`."""
        self._saved, self.path = scene, path
        self.seal()
        self.changed.emit()

    def _go(self, step: int):
        if step:
            self._at += step
            self.seal()
            self.changed.emit()
