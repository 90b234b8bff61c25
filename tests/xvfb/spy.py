"""Runs `python -m app ARGS` with a spy in it: five times a second it writes what the window shows and where things are to a file.

    spy.py STATE.json [SCENE]

The window itself is driven from outside, by a mouse and a keyboard; the spy only looks.
"""
import json
import os
import runpy
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))
state_file, sys.argv = Path(sys.argv[1]), ["app", *sys.argv[2:]]

import app.window  # noqa: E402

from PySide6.QtCore import QModelIndex, QPoint, QRect, QTimer  # noqa: E402
from PySide6.QtWidgets import QWidget  # noqa: E402


def place(widget: QWidget, rect: QRect) -> list[int]:
    """A part of a widget in pixels of the screen: x, y, width, height."""
    corner, ratio = widget.mapToGlobal(QPoint(rect.x(), rect.y())), widget.devicePixelRatioF()
    return [round(part * ratio) for part in (corner.x(), corner.y(), rect.width(), rect.height())]


class Watched(app.window.Window):
    """The window, and the timer that writes."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self._ticked, self._longest = time.monotonic(), 0.0
        self._spy = QTimer(self, interval=20)
        self._spy.timeout.connect(self._tick)
        self._spy.start()
        self._written = 0.0

    def _tick(self):
        now = time.monotonic()
        self._longest, self._ticked = max(self._longest, now - self._ticked), now
        if now - self._written > 0.2:
            self._written = now
            part = state_file.with_suffix(".part")
            part.write_text(json.dumps(self._state()))
            os.replace(part, state_file)

    def _state(self) -> dict:
        session, tree = self.session, self.panels["Scene"]
        shown, camera = session.shown, session.camera
        wanted = session.scene, camera, session.options
        current = shown is not None and (shown.job.scene is wanted[0] and (shown.job.camera, shown.job.options) == wanted[1:])
        rows, todo = {}, [QModelIndex()]
        while todo:
            parent = todo.pop()
            for i in range(tree.model.rowCount(parent)):
                index = tree.model.index(i, 0, parent)
                rows[tree.model.data(index)] = place(tree.view.viewport(), tree.view.visualRect(index))
                if tree.view.isExpanded(index):
                    todo.append(index)
        named = [w for w in self.findChildren(QWidget) if w.isVisible() and w.accessibleName()]
        return {"modified": self.isWindowModified(), "stall": self._longest, "fullscreen": self.isFullScreen(),
                "camera": camera and [camera.lookfrom, camera.lookat, camera.up, camera.fov],
                "selection": session.selection and session.name_of(session.selection), "rows": rows,
                "options": {name: getattr(session.options, name) for name in ("shadows", "fog", "reflections")},
                "done": bool(current and shown.frame.done),
                "notice": self.notice.label.text() if self.notice.isVisible() else "", "path": str(session.document.path),
                "picture": place(self.viewport, self.viewport.rect()),
                "hidden": [leaf.path for leaf in session.scene.leaves() if not leaf.visible],
                "widgets": {w.accessibleName(): place(w, w.rect()) for w in named}}


app.window.Window = Watched
runpy.run_module("app", run_name="__main__", alter_sys=True)
