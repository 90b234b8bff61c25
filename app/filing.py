"""Files in and out, off the window's thread: open, reload, save, save the picture."""
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec
from PySide6.QtCore import QObject, Signal

from app.gallery import GALLERY
from app.session import Session
from rtcore.camera import Camera
from rtcore.scene import Scene


class Loaded(NamedTuple):
    """A scene from a file and the camera it is first looked at with."""

    scene: Scene
    camera: Camera


class Filing(QObject):
    """Loads and saves for the session. A file that can't be taken leaves everything as it was, but for a message."""

    opened = Signal(object)         # the path whose scene now stands in the document
    loading_changed = Signal()

    def __init__(self, session: Session):
        super().__init__(session)
        self._session = session
        self._latest = 0
        self._complaint = ""                # about a file in whose stead another is read
        self.loading: Path | None = None    # what is being read right now

    def open(self, path: Path, keep_view: bool = False, instead: Path | None = None):
        """Read a scene file and show it, unless another is asked for before it is read. A file that can't be taken is told of,
        and where there is nothing to keep, the scene at `instead` is shown."""
        path = Path(path).absolute()
        self._latest += 1
        ticket, aspect = self._latest, self._session.aspect
        self._set_loading(path)

        def work() -> Loaded:
            import rtcore   # its readers bring numba and trimesh with them
            from rtcore.framing import framed
            scene = rtcore.load(path)
            return Loaded(scene, scene.camera or framed(scene, aspect))

        def done(loaded: Loaded):
            if ticket == self._latest:
                self._set_loading(None)
                self._session.open_scene(loaded.scene, path, loaded.camera, keep_view)
                self.opened.emit(path)
                if self._complaint:
                    self._session.said.emit("error", self._complaint)
                    self._complaint = ""

        def failed(error: Exception):
            if ticket == self._latest:
                self._set_loading(None)
                if instead is not None and instead != path:
                    self._complaint = one_line(error, path)
                    self.open(instead)
                else:
                    self._session.said.emit("error", one_line(error, path))

        self._session.tasks.run(work, done, failed, name="load")

    def reload(self):
        """Read the document's file again and keep the view."""
        path = self._session.document.path
        if path is not None:
            self.open(path, keep_view=True)

    @property
    def in_place(self) -> Path | None:
        """Where Save can write without asking; not over a gallery scene, nor a format that is only read."""
        path = self._session.document.path
        if path is None or path.suffix.lower() not in (".yaml", ".yml") or path.parent == GALLERY:
            return None
        return path

    def save(self, path: Path, then: Callable[[], None] = lambda: None):
        """Write the scene with the camera as it is now, then call `then`."""
        session = self._session
        scene, path = session.scene, Path(path).absolute()
        written = msgspec.structs.replace(scene, camera=session.camera)

        def work():
            import rtcore
            rtcore.save(written, path)

        def done(_):
            session.document.saved(scene, path)
            session.said.emit("info", f"Saved {path.name}")
            self.opened.emit(path)
            then()

        session.tasks.run(work, done, lambda error: session.said.emit("error", one_line(error, path)), name="save")

    def save_picture(self, path: Path):
        """Write the picture on the screen: .png in sRGB and as bright as it is shown, .exr in linear light as it is."""
        session = self._session
        if session.shown is None:
            session.said.emit("error", "There is no picture to save yet.")
            return
        shown, path = session.shown, Path(path).absolute()
        text = {"Title": shown.job.scene.name or "Rayscope", "Samples": str(shown.frame.samples),
                "Camera": msgspec.json.encode(shown.job.camera).decode()}
        gain = 1.0 if path.suffix.lower() == ".exr" else shown.job.options.gain()
        if gain != 1:
            text["Exposure"] = f"{shown.job.options.exposure:+g} stops"

        def work():
            from rtcore.files import save_image
            save_image(shown.frame.pixels * gain if gain != 1 else shown.frame.pixels, path, text=text)

        def done(_):
            left = "" if shown.frame.done else ", unfinished as it was"
            as_is = ", the light as it is and not as exposed here" if shown.job.options.gain() != gain else ""
            session.said.emit("info", f"Saved {path.name}{left}{as_is}")

        session.tasks.run(work, done, lambda error: session.said.emit("error", one_line(error, path)), name="save picture")

    def _set_loading(self, path: Path | None):
        self.loading = path
        self.loading_changed.emit()


def one_line(error: Exception, path: Path) -> str:
    """The error as the message bar shows it; it names the file."""
    if isinstance(error, OSError) and error.strerror:
        return f"{path.name}: {error.strerror.lower()}"
    text = " ".join(str(error).split()) or type(error).__name__
    return text if path.name in text else f"{path.name}: {text}"
