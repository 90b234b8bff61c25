"""A window under random edits, drags, toggles, resizes, file opens and undos, with the real renderer.

    python tests/app/soak.py [--seconds 600] [--seed 1] [--scene NAME ...] [-o DIR]

Prints how long the window's thread did not answer, and what threads, memory and kernels were before and after.
"""
import argparse
import contextlib
import os
import random
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2])]
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import msgspec  # noqa: E402
import numpy as np  # noqa: E402
from heart import PATIENCE, Heart  # noqa: E402
from held import Held  # noqa: E402
from PySide6.QtCore import QEvent, QEventLoop, QObject, QPoint, QPointF, QSettings, Qt, QTimer, Slot  # noqa: E402
from PySide6.QtGui import QMouseEvent, QWheelEvent  # noqa: E402
from PySide6.QtWidgets import QApplication  # noqa: E402

from app.editors import SliderEdit  # noqa: E402
from app.gallery import GALLERY  # noqa: E402
from app.garbage import Garbage  # noqa: E402
from app.gui import SWITCH  # noqa: E402
from app.places import Place, node_at  # noqa: E402
from app.session import Session  # noqa: E402
from app.settings import Preferences  # noqa: E402
from app.window import Window  # noqa: E402
from rtcore.fields import FieldError  # noqa: E402
from rtcore.scene import Material, Translate  # noqa: E402
from rtcore.settings import VIEW_NAMES  # noqa: E402

LEFT, NO_BUTTON, NO_KEYS = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier
SIZE, SMALLEST, LARGEST = (1280, 800), (900, 650), (1600, 1000)
GROWTH = 128        # MiB of memory that the process may hold more after it: less than one largest picture and what is kept of it


class Soak(QObject):
    """Does one random thing after another to a window, each a generator of the milliseconds until its next step."""

    def __init__(self, window: Window, heart: Heart, scenes: list[Path], seed: int):
        super().__init__()
        self.window, self.session, self.heart, self.scenes = window, window.session, heart, scenes
        self.random = random.Random(seed)
        self.done: dict[str, int] = {}
        self._step: Iterator[float] = iter(())
        self._timer = QTimer(self, singleShot=True)
        self._timer.timeout.connect(self._go_on)
        #: What is done, and how often against one another.
        self.ways = {self.orbit: 6, self.pan: 3, self.wheel: 2, self.fly: 1, self.toggle: 4, self.view: 2, self.expose: 2, self.edit: 6,
                     self.slide: 3, self.hide: 3, self.undo: 4, self.select: 3, self.hover: 2, self.resize: 2, self.open: 3, self.pause: 1,
                     self.region: 1, self.panel: 2, self.light: 3, self.rest: 2}

    def start(self):
        self._timer.start(0)

    def stop(self):
        self._timer.stop()
        self._step = iter(())
        self.session.pause(False)

    @Slot()
    def _go_on(self):
        wait = next(self._step, None)
        while wait is None:
            way = self.random.choices(list(self.ways), list(self.ways.values()))[0]
            self.heart.doing = way.__name__
            self.done[way.__name__] = self.done.get(way.__name__, 0) + 1
            self._step = way()
            wait = next(self._step, None)
        self._timer.start(round(wait))

    # the mouse

    def _point(self) -> QPointF:
        view = self.window.viewport
        return QPointF(self.random.uniform(5, view.width() - 5), self.random.uniform(5, view.height() - 5))

    def _mouse(self, kind: QEvent.Type, at: QPointF, button=NO_BUTTON, buttons=NO_BUTTON, keys=NO_KEYS):
        view = self.window.viewport
        QApplication.sendEvent(view, QMouseEvent(kind, at, view.mapToGlobal(at), button, buttons, keys))

    def _drag(self, keys) -> Iterator[float]:
        start, end = self._point(), self._point()
        steps = self.random.randrange(5, 40)
        self._mouse(QEvent.Type.MouseButtonPress, start, LEFT, LEFT, keys)
        for i in range(1, steps + 1):
            self._mouse(QEvent.Type.MouseMove, start + (end - start) * (i / steps), NO_BUTTON, LEFT, keys)
            yield 16
        self._mouse(QEvent.Type.MouseButtonRelease, end, LEFT, NO_BUTTON, keys)

    def orbit(self) -> Iterator[float]:
        return self._drag(NO_KEYS)

    def pan(self) -> Iterator[float]:
        return self._drag(Qt.KeyboardModifier.ShiftModifier)

    def region(self) -> Iterator[float]:
        yield from self._drag(Qt.KeyboardModifier.ControlModifier)
        yield self.random.uniform(0, 500)
        self.window.viewport.ask_region(False)

    def wheel(self) -> Iterator[float]:
        at, view = self._point(), self.window.viewport
        for _ in range(self.random.randrange(1, 6)):
            turn = QPoint(0, self.random.choice((-120, 120)))
            QApplication.sendEvent(view, QWheelEvent(at, view.mapToGlobal(at), QPoint(), turn, NO_BUTTON, NO_KEYS,
                                                     Qt.ScrollPhase.NoScrollPhase, False))
            yield 40

    def fly(self) -> Iterator[float]:
        for _ in range(20):
            self.session.fly(0.01, 0.0, 0.01, "soak")
            yield 16
        self.session.back()

    def hover(self) -> Iterator[float]:
        for _ in range(30):
            self._mouse(QEvent.Type.MouseMove, self._point())
            yield 10

    def select(self) -> Iterator[float]:
        at = self._point()
        self._mouse(QEvent.Type.MouseButtonPress, at, LEFT, LEFT)
        self._mouse(QEvent.Type.MouseButtonRelease, at, LEFT)
        yield self.random.uniform(0, 200)

    # options

    def toggle(self) -> Iterator[float]:
        name = self.random.choice(("shadows", "fog", "reflections"))
        for _ in range(2):
            self.window.actions_by_id[name].trigger()
            yield self.random.uniform(0, 300)

    def view(self) -> Iterator[float]:
        for name in (self.random.choice(VIEW_NAMES), "beauty"):
            self.session.set_options(msgspec.structs.replace(self.session.options, view=name))
            yield self.random.uniform(0, 300)

    def expose(self) -> Iterator[float]:
        slider = self.window.panels["Render"].editors["exposure"].slider
        for value in np.linspace(500, self.random.uniform(300, 700), 20):
            slider.setValue(round(value))
            yield 16
        self.window.actions_by_id["unexposed"].trigger()

    def pause(self) -> Iterator[float]:
        for _ in range(2):
            self.window.actions_by_id["pause"].trigger()
            yield self.random.uniform(0, 300)

    # the scene

    def _node(self) -> Place:
        """A node, picked like a walk down the tree."""
        path, scene = (), self.session.scene
        count = len(scene.objects)
        while count:
            path += (self.random.randrange(count),)
            count = len(node_at(scene, path).children or ())
        return Place("node", path)

    def _put(self, place: Place, label: str, merge: object = None, **fields):
        with contextlib.suppress(FieldError):       # not everything can be moved
            self.session.edit_record(place, msgspec.structs.replace(node_at(self.session.scene, place.key), **fields), label, merge)

    def edit(self) -> Iterator[float]:
        place = self._node()
        self.session.select(place)
        yield 20
        before = node_at(self.session.scene, place.key)
        for i in range(15):
            self._put(place, "move", "soak", transform=(*before.transform, Translate((0.02 * i, 0.0, 0.0))))
            yield 16
        self.session.seal()
        self._put(place, "paint", material=Material(color=tuple(self.random.random() for _ in range(3))))
        yield self.random.uniform(0, 300)

    def slide(self) -> Iterator[float]:
        editors = [editor for editor in self.window.panels["Properties"].findChildren(SliderEdit) if editor.isVisible()]
        if editors:
            slider = self.random.choice(editors).slider
            for value in np.linspace(slider.value(), self.random.uniform(0, slider.maximum()), 15):
                slider.setValue(round(value))
                yield 16
            self.session.seal()

    def hide(self) -> Iterator[float]:
        place = self._node()
        for on in (False, True):
            self._put(place, "hide", visible=on)
            yield self.random.uniform(0, 300)

    def light(self) -> Iterator[float]:
        lights = self.session.scene.lights or ()
        places = [Place("light", i) for i, light in enumerate(lights) if hasattr(light, "intensity")]
        if places:
            place = self.random.choice(places)
            self.session.select(place)
            for _ in range(10):
                now = self.session.scene.lights[place.key]
                dimmed = msgspec.structs.replace(now, intensity=now.intensity * self.random.uniform(0.9, 1.1))
                self.session.edit_record(place, dimmed, "dim", "soak")
                yield 16
            self.session.seal()

    def undo(self) -> Iterator[float]:
        for _ in range(self.random.randrange(1, 6)):
            self.window.actions_by_id[self.random.choice(("undo", "undo", "redo", "back"))].trigger()
            yield self.random.uniform(0, 100)

    # the window

    def resize(self) -> Iterator[float]:
        wide, high = (self.random.randrange(*ends) for ends in zip(SMALLEST, LARGEST))
        for share in np.linspace(0, 1, 12):
            self.window.resize(*(round(a + (b - a) * share) for a, b in zip(SIZE, (wide, high))))
            yield 16
        yield self.random.uniform(0, 300)
        self.window.resize(*SIZE)

    def panel(self) -> Iterator[float]:
        dock = self.random.choice(list(self.window.docks.values()))
        self.heart.doing = f"panel {dock.windowTitle()}"
        shown = dock.isVisible()
        dock.setVisible(True)
        dock.raise_()
        yield self.random.uniform(100, 500)
        dock.setVisible(shown)

    def open(self) -> Iterator[float]:
        path = self.random.choice(self.scenes)
        self.window.filing.open(path)
        yield self.random.uniform(100, 1500)

    def rest(self) -> Iterator[float]:
        yield self.random.uniform(200, 1500)


def wait(until, seconds: float, beat: int = 20) -> bool:
    """Let the window's loop run until it is so; whether it came."""
    loop, end, timer = QEventLoop(), time.monotonic() + seconds, QTimer(interval=beat)
    timer.timeout.connect(lambda: until() and loop.quit() or time.monotonic() > end and loop.quit())
    timer.start()
    loop.exec()
    timer.stop()
    return bool(until())


def finished(window: Window, path: Path) -> bool:
    """Open a scene and wait for its finished picture."""
    session, opened = window.session, []
    window.filing.opened.connect(opened.append)
    window.filing.open(path)

    def there() -> bool:
        shown = session.shown
        return bool(opened) and shown is not None and shown.frame.done and shown.job.scene is session.scene
    result = wait(there, 300)
    window.filing.opened.disconnect(opened.append)
    return result


def select(window: Window, place: Place):
    """What the property editor shows of it comes to stay."""
    window.session.select(place)
    window.panels["Properties"].complete()
    wait(lambda: False, 0.05)


def warm_up(window: Window, scenes: list[Path]):
    """Show all that is shown later, so that everything that comes to stay is there."""
    session = window.session

    def settled():
        assert wait(lambda: session.shown.job.options == session.options and session.shown.job.scene is session.scene
                    and session.shown.frame.done, 120), "no finished picture"
    for path in scenes:
        assert finished(window, path), f"{path.name}: no picture"
        for name in ("shadows", "fog", "reflections"):
            for on in (False, True):
                session.switch(name, on)
                settled()
        for node in range(min(len(session.scene.objects), 3)):
            place = Place("node", (node,))
            session.edit_record(place, msgspec.structs.replace(node_at(session.scene, place.key), visible=False), "hide")
            settled()
            session.document.undo()
            select(window, place)
        for light in range(len(session.scene.lights or ())):
            select(window, Place("light", light))
        session.select(None)
        settled()
    for name in (*VIEW_NAMES, "beauty"):
        session.set_options(msgspec.structs.replace(session.options, view=name))
        settled()
    for dock in window.docks.values():
        shown = dock.isVisible()
        dock.setVisible(True)
        dock.raise_()
        wait(lambda: False, 0.7)        # some load what they draw with
        dock.setVisible(shown)
    for size in (LARGEST, SIZE):
        window.resize(*size)
        assert finished(window, scenes[0])


def soak(seconds: float, seed: int, scenes: list[Path], folder: Path) -> tuple[Heart, Soak, Held, Held]:
    """Warm up, then soak. The window is closed at the end."""
    session = Session()
    window = Window(session, Preferences(QSettings(str(folder / "window.ini"), QSettings.Format.IniFormat)))
    Garbage(session, window.filing)
    window.resize(*SIZE)
    window.show()
    try:
        warm_up(window, scenes)
        before = Held()
        heart = Heart()
        one = Soak(window, heart, scenes, seed)
        heart.start()
        one.start()
        wait(lambda: False, seconds)
        one.stop()
        heart.stop()
        session.set_options(type(session.options)())
        session.document.open(session.scene, None)
        assert finished(window, scenes[0])
        return heart, one, before, Held()
    finally:
        session.document.open(session.scene, None)
        window.close()
        window.deleteLater()


def report(heart: Heart, one: Soak, before: Held, after: Held) -> str:
    """What came of it, in lines."""
    beats = np.array(heart.beats) * 1000
    p50, p99, most = np.percentile(beats, (50, 99, 100))
    lines = [f"{len(beats):,} beats: p50 {p50:.2f} ms, p99 {p99:.2f} ms, longest {most:.1f} ms",
             f"{len(heart.stalls)} over 16 ms, {sum(stall.ours > PATIENCE for stall in heart.stalls)} of them not the machine's fault; of "
             f"these the longest {max((stall.ours for stall in heart.stalls), default=0) * 1000:.1f} ms",
             f"threads {len(before.threads)} -> {len(after.threads)}, memory {before.memory:.0f} -> {after.memory:.0f} MiB, "
             f"signatures {len(before.signatures)} -> {len(after.signatures)}"
             + "".join(f", {name}" for name, _ in after.signatures - before.signatures)
             + "".join(f", thread {name}" for name in set(after.threads) - set(before.threads)),
             "done: " + ", ".join(f"{name} {count}" for name, count in sorted(one.done.items()))]
    lines += [f"  at {stall.at:6.1f} s {stall.doing:17} {stall.took * 1000:6.1f} ms, ran {stall.ran * 1000:6.1f}, no processor "
              f"{stall.waited * 1000:6.1f}, processor asleep {stall.asleep * 1000:5.1f}" for stall in heart.stalls if stall.ours > PATIENCE]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scene", action="append", help="of the gallery, by name; all of them unless given")
    parser.add_argument("--allow", type=float, default=16.0, help="milliseconds of a stall that are forgiven")
    parser.add_argument("-o", "--output", type=Path, help="folder for the stacks of what took long")
    options = parser.parse_args()
    folder = options.output or Path(tempfile.mkdtemp(prefix="rayscope-"))
    folder.mkdir(parents=True, exist_ok=True)
    app = QApplication(["rayscope"])
    sys.setswitchinterval(SWITCH)
    scenes = [GALLERY / f"{name}.yaml" for name in options.scene] if options.scene else sorted(GALLERY.glob("*.yaml"))
    result = soak(options.seconds, options.seed, scenes, folder)
    print(report(*result))
    heart, _, before, after = result
    stalls = sorted(heart.stalls, key=lambda stall: -stall.ours)
    (folder / "stalls.txt").write_text("\n\n".join(f"{stall._replace(stacks='')}\n{stall.stacks}" for stall in stalls))
    print(f"stacks in {folder / 'stalls.txt'}")
    app.processEvents()
    kept = before.threads == after.threads and before.signatures == after.signatures and after.memory - before.memory < GROWTH
    return int(not kept or any(stall.ours > options.allow / 1000 for stall in stalls))


if __name__ == "__main__":
    sys.exit(main())
