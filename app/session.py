"""The session: document, camera, options, selection and worker wired together. Panels and viewport talk to it and to nothing else."""
import itertools
from typing import NamedTuple

import msgspec
import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal, Slot

from app.compiling import Compiling
from app.document import Document
from app.engine import Job
from app.history import ViewHistory
from app.options import Options
from app.outline import Outline, trace_outline
from app.places import Leaves, Place, label_of, record_at, with_record
from app.tasks import Tasks
from app.worker import Shown, Worker
from rtcore import camera as moves
from rtcore.camera import Camera
from rtcore.fields import FieldError, Record
from rtcore.scene import Scene


#: Milliseconds that the picture's size keeps still before it is rendered anew. Beside a thread that renders, a step of a window's resize
#: takes the window's own thread twice as long, 8 ms and now and then 20; and when that picture came, it was of a size gone by.
SETTLE = 30


class Under(NamedTuple):
    """What the cursor points at: pixel of the picture, distance from the eye (inf: nothing is hit) and its place."""

    x: int
    y: int
    distance: float
    place: Place | None


class Session(QObject):
    """All that the window shows and everything that can be done to it. Every change ends in a new job for the worker."""

    camera_changed = Signal()
    options_changed = Signal()
    paused_changed = Signal()
    selection_changed = Signal()
    frame_changed = Signal()            # `shown` is another frame, or has another outline
    hover_changed = Signal()
    compiling_changed = Signal()
    aiming_changed = Signal()
    said = Signal(str, str)             # level ("error", "info"), text of one line

    def __init__(self, worker: Worker | None = None, parent: QObject | None = None):
        super().__init__(parent)
        self.document = Document(self)
        self.tasks = Tasks(self)
        self.worker = worker or Worker(parent=self)
        self.views = ViewHistory()
        self.camera: Camera | None = None       # None until a scene is open
        self.home: Camera | None = None         # the camera the file came with, or the one framed for it
        self.options = Options()
        self.paused = False
        self.selection: Place | None = None
        self.under: Under | None = None
        self.aiming = False                     # the next click in the picture tells what is to be sharp
        self.shown: Shown | None = None
        self.leaves = Leaves(self.document.scene)
        self._size, self._ratio = (0, 0), 1.0
        self._numbers = itertools.count(1)
        self._floor = 0                         # frames of jobs before this one are stale
        self._opened = 0
        self._rendered: Scene | None = None
        self._merge: object = None              # the drag that the last change was a step of
        self._continues = False
        self._settling = QTimer(self, interval=SETTLE, singleShot=True)
        self._settling.timeout.connect(self._settled)
        self.document.changed.connect(self._scene_changed)
        self.worker.newest.connect(self._take_frame)
        self.worker.progressed.connect(self._compiling_moved)
        self.worker.failed.connect(self._failed)
        self.tasks.crashed.connect(self._failed)

    # the scene

    @property
    def scene(self) -> Scene:
        return self.document.scene

    def open_scene(self, scene: Scene, path, camera: Camera, keep_view: bool = False):
        """Show another scene; with `keep_view` from where the old one was looked at."""
        self._opened += 1
        self.home = camera
        if not (keep_view and self.camera is not None):
            self.camera = camera
            self.views.start(camera)
        selection = self.selection if keep_view and self.selection and record_at(scene, self.selection) else None
        self.document.open(scene, path)
        self.select(selection)
        self.camera_changed.emit()

    def edit(self, scene: Scene, label: str, merge: object = None):
        """Replace the scene; edits in a row with the same `merge` are one step of undo."""
        self._merge, before = merge, self._merge
        self._continues = merge is not None and merge == before
        self.document.edit(scene, label, merge)
        self._continues = False

    def edit_record(self, place: Place, record: Record, label: str, merge: object = None):
        """Replace what stands at a place; FieldError if the scene can't be so."""
        self.edit(with_record(self.scene, place, record), label, merge)

    def seal(self):
        """The drag is over: the next edit is an undo step of its own."""
        self._merge = None
        self.document.seal()

    @Slot()
    def _scene_changed(self):
        if self.scene is not self._rendered:
            self._rendered = self.scene
            self.leaves = Leaves(self.scene)
            if self.selection is not None and record_at(self.scene, self.selection) is None:
                self.select(None)
            self._tell_outline()
            self.submit(self._continues)

    # the view

    def move(self, camera: Camera, gesture: object = None):
        """Look from elsewhere. Moves of one `gesture` are one step of the view's history."""
        continues = gesture is not None and gesture == self._merge
        self._merge = gesture
        self.camera = camera
        self.views.visit(camera, gesture)
        self.submit(continues)      # first: then it is rendered while the panels tell of it
        self.camera_changed.emit()

    def orbit(self, right: float, up: float, gesture: object):
        self._try_move(moves.orbit, right, up, gesture=gesture)

    def pan(self, right: float, up: float, gesture: object):
        self._try_move(moves.pan, right, up, gesture=gesture)

    def dolly(self, factor: float, toward=None, gesture: object = None):
        self._try_move(moves.dolly, factor, toward, gesture=gesture)

    def fly(self, right: float, up: float, forward: float, gesture: object):
        self._try_move(moves.fly, right, up, forward, gesture=gesture)

    def _try_move(self, how, *amounts, gesture):
        if self.camera is None:
            return
        try:
            with np.errstate(all="ignore"):
                camera = how(self.camera, *amounts)
        except FieldError:
            return      # at the edge of what a camera can be (a dolly to 1e308): the view stays
        self.move(camera, gesture)

    def back(self):
        self._look(self.views.back())

    def forward(self):
        self._look(self.views.forward())

    def reset_view(self):
        """The camera of the file again."""
        if self.home is not None:
            self.move(self.home)

    def _look(self, camera: Camera):
        self.camera, self._merge = camera, None
        self.submit()
        self.camera_changed.emit()

    def frame_all(self):
        """Draw the camera back until every bounded shape is in the picture."""
        scene = self.scene

        def bounds():
            from rtcore.bounds import scene_bounds
            return scene, scene_bounds(scene)
        self.tasks.run(bounds, self._frame_box, name="bounds")

    def frame_selection(self):
        """The same for the selected node; for everything if none is selected."""
        if self.selection is None or self.selection.kind != "node":
            return self.frame_all()
        scene, (first, last) = self.scene, self.leaves.span(self.selection.key)

        def bounds():
            from rtcore.bounds import leaf_bounds
            boxes = [box for leaf in itertools.islice(scene.leaves(), first, last) if (box := leaf_bounds(leaf)) is not None]
            if not boxes:
                return scene, None
            lows, highs = (np.array(side) for side in zip(*boxes))
            return scene, (lows.min(axis=0), highs.max(axis=0))
        self.tasks.run(bounds, self._frame_box, name="bounds")

    def _frame_box(self, result):
        scene, box = result
        if scene is not self.scene:
            return
        if box is None or not np.isfinite(box).all():
            self.said.emit("info", "Nothing here has an end that could be framed.")
        elif self.camera is not None:
            self._try_move(moves.frame, *box, self.aspect, gesture=None)

    @property
    def aspect(self) -> float:
        """Width over height of the picture."""
        return self._size[0] / self._size[1] if all(self._size) else 4 / 3

    # options, selection, cursor

    def set_options(self, options: Options, merge: object = None):
        """Change settings of the picture; steps of one drag share `merge`."""
        continues = merge is not None and merge == self._merge
        self._merge = merge
        if options != self.options:
            self.options = options
            self._tell_outline()
            self.submit(continues)
            self.options_changed.emit()

    def switch(self, name: str, on: bool):
        """Turn shadows, fog or reflections on or off in the picture."""
        self.set_options(msgspec.structs.replace(self.options, **{name: on}))

    def pause(self, on: bool):
        """Stop refining the picture, or go on with it. What changes meanwhile is shown with a sample per pixel."""
        if on != self.paused:
            self.paused = on
            self.worker.pause(on)
            self.paused_changed.emit()

    def brighten(self, stops: float):
        """Show the picture brighter by so many stops, or darker; within what the options allow."""
        exposure = min(max(self.options.exposure + stops, -10.0), 10.0)
        self.set_options(msgspec.structs.replace(self.options, exposure=exposure))

    def choose_region(self, region: tuple[float, float, float, float] | None):
        """Refine this part of the picture first: left, top, right and bottom in 0 .. 1 of it; None: all alike."""
        self.set_options(msgspec.structs.replace(self.options, region=region))

    def resize(self, size: tuple[int, int], ratio: float):
        """The viewport has this many device pixels, `ratio` of them to a pixel of the desktop's. While that changes, the last frame is
        shown, scaled to the height."""
        if (size, ratio) != (self._size, self._ratio):
            self._size, self._ratio = size, ratio
            self._tell_outline()
            self.worker.drop()
            self._settling.start()

    @Slot()
    def _settled(self):
        self.submit(continues=True)

    def select(self, place: Place | None):
        if place != self.selection:
            self.selection = place
            self._tell_outline()
            self.selection_changed.emit()
            self._redraw_outline()      # last: its thread would have the panels wait for Python's lock

    def place_under(self, x: float, y: float) -> Under | None:
        """What is at (x, y), given in 0 .. 1 of the picture's width and height."""
        if self.shown is None or not (0 <= x < 1 and 0 <= y < 1):
            return None
        frame = self.shown.frame
        height, width = frame.node.shape
        column, row = int(x * width), int(y * height)
        path = self._leaves_of(self.shown).path(int(frame.node[row, column]))
        return Under(column, row, float(frame.distance[row, column]), None if path is None else Place("node", path))

    def point_under(self, x: float, y: float):
        """The point of the scene seen at (x, y); where nothing is hit, one as far away as lookat."""
        under = self.place_under(x, y)
        if under is None or self.camera is None:
            return None
        height, width = self.shown.frame.node.shape
        eye, corner, right, down = self.camera.rays(width, height)
        direction = moves.unit(corner + x * width * right + y * height * down)
        distance = under.distance if np.isfinite(under.distance) else self.camera.distance()
        return tuple((eye + direction * distance).tolist())

    def aim(self, on: bool):
        """Let the next click in the picture tell what is to be sharp; or no longer."""
        if on != self.aiming:
            self.aiming = on
            self.aiming_changed.emit()

    def focus(self, x: float, y: float):
        """Focus on what is seen at (x, y); a step of the view's history."""
        self.aim(False)
        under = self.place_under(x, y)
        if under is None or not np.isfinite(under.distance):
            self.said.emit("info", "There is nothing to focus on: the view goes past everything there.")
            return
        self._try_move(moves.focus_on, self.point_under(x, y), gesture=None)
        if self.camera.aperture == 0:
            self.said.emit("info", f"In focus at {self.camera.focus:.4g}. All is sharp until the camera has an aperture.")

    def pick(self, x: float, y: float):
        """Select what is seen at (x, y), or nothing where nothing is hit."""
        under = self.place_under(x, y)
        place = under.place if under else None
        self.select(place if place and record_at(self.scene, place) else None)

    def hover(self, at: tuple[float, float] | None):
        """The cursor is over (x, y) of the picture, or not over it."""
        self.under = self.place_under(*at) if at else None
        self.hover_changed.emit()

    def name_of(self, place: Place) -> str:
        return label_of(self.scene, place)

    def _leaves_of(self, shown: Shown) -> Leaves:
        return self.leaves if shown.job.scene is self.scene else Leaves(shown.job.scene)

    # frames

    def submit(self, continues: bool = False, anew: bool = False):
        """Ask the worker for the picture as things stand now; `anew`: from its start, whatever is known of it."""
        self._settling.stop()
        if self.camera is None or not all(self._size):
            return
        number = next(self._numbers)
        if not continues:
            self._floor = number
        scale = self.options.scale
        size = tuple(max(16, round(side * scale)) for side in self._size)
        self.worker.submit(Job(number, self.scene, self.camera, self.options, size, continues, self._opened, anew))

    @Slot()
    def _take_frame(self):
        shown = self.worker.take()
        if shown is not None and shown.job.number >= self._floor:
            self.shown = shown
            self.frame_changed.emit()

    def _outline_width(self) -> int:
        return max(1, round(2 * self._ratio * self.options.scale))

    def _tell_outline(self):
        place = self.selection
        span = self.leaves.span(place.key) if place and place.kind == "node" else None
        self.worker.outline(span, self._outline_width())

    def _redraw_outline(self):
        """Outline the selection in the frame on the screen; there may be no next one."""
        shown, place = self.shown, self.selection
        if shown is None:
            return
        if place is None or place.kind != "node":
            return self._set_outline(shown, None)
        leaves, width = self._leaves_of(shown), self._outline_width()

        def work():
            return shown, place, trace_outline(shown.frame.node, leaves.span(place.key), width)
        self.tasks.run(work, self._outlined, name="outline")

    def _outlined(self, result):
        shown, place, outline = result
        if self.selection == place:
            self._set_outline(shown, outline)

    def _set_outline(self, shown: Shown, outline: Outline | None):
        if self.shown is shown:
            self.shown = shown._replace(outline=outline)
            self.frame_changed.emit()

    @property
    def compiling(self) -> Compiling | None:
        return self.worker.compiling

    @Slot()
    def _compiling_moved(self):
        self.compiling_changed.emit()

    @Slot(str)
    def _failed(self, text: str):
        self.said.emit("error", text)

    def close(self):
        """End all threads; at most two seconds."""
        self.worker.close()
        self.tasks.close()
