"""An X display of its own with a window manager, a window on it, and hands: mouse, keyboard, eyes."""
import contextlib
import ctypes
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from PIL import Image

TOOLS = ("Xvfb", "openbox", "xdotool", "import")


class Failed(Exception):
    """The window did not do what it should."""


def missing_tools() -> list[str]:
    """Those of the programs needed that are not installed."""
    return [tool for tool in TOOLS if shutil.which(tool) is None]


@contextlib.contextmanager
def display(width: int, height: int, config: Path, memory: Path | None = None) -> Iterator[dict[str, str]]:
    """The environment of a fresh display with a window manager; preferences are kept under `config`, and what is on the screen in a file
    in the folder `memory`, where one is given (see `Eyes`)."""
    read, write = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", f"{width}x{height}x24", "-nolisten", "tcp",
                               *(["-fbdir", str(memory)] if memory else [])],
                              pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as pipe:
        number = pipe.readline().strip()
    if not number:
        raise Failed("Xvfb did not start")
    environment = {**os.environ, "DISPLAY": f":{number}", "XDG_CONFIG_HOME": str(config)}
    for name in ("QT_QPA_PLATFORM", "WAYLAND_DISPLAY"):
        environment.pop(name, None)
    manager = subprocess.Popen(["openbox"], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield environment
    finally:
        for process in (manager, server):
            process.terminate()
            process.wait(10)


class Eyes:
    """The screen as the server has it in memory: (h, w, 4) uint8, blue first, without a copy."""

    def __init__(self, memory: Path):
        self._map = np.memmap(memory / "Xvfb_screen0", np.uint8, "r")
        head = self._map[:100].view(">u4")      # of an XWD file
        width, height, line, colors = (int(head[i]) for i in (4, 5, 12, 19))
        self.pixels = self._map[int(head[0]) + 12 * colors:][:height * line].reshape(height, line // 4, 4)[:, :width]


class Fingers:
    """The mouse by the XTEST extension, as xdotool has it but without a process for every move."""

    def __init__(self, environment: dict[str, str]):
        self._x, self._test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
        self._x.XOpenDisplay.restype = ctypes.c_void_p
        self._display = ctypes.c_void_p(self._x.XOpenDisplay(environment["DISPLAY"].encode()))

    def move(self, x: int, y: int):
        self._test.XTestFakeMotionEvent(self._display, -1, x, y, 0)
        self._x.XFlush(self._display)

    def press(self, down: bool, button: int = 1):
        self._test.XTestFakeButtonEvent(self._display, button, int(down), 0)
        self._x.XFlush(self._display)

    def close(self):
        self._x.XCloseDisplay(self._display)


class Hands:
    """Drives one window. Every wait ends in `Failed` if what it waits for does not come."""

    def __init__(self, environment: dict[str, str], folder: Path, arguments: list[str]):
        self.folder, self._environment, self._state_file = folder, environment, folder / "state.json"
        self.shots: list[Path] = []
        self._log = open(folder / "window.log", "w", encoding="utf-8")     # noqa: SIM115, closed in `end`
        self.started = time.monotonic()
        self.process = subprocess.Popen([sys.executable, str(Path(__file__).with_name("spy.py")), str(self._state_file), *arguments],
                                        env=environment, stdout=self._log, stderr=subprocess.STDOUT)

    def log(self) -> str:
        """What the window wrote to its terminal."""
        return (self.folder / "window.log").read_text(encoding="utf-8")

    def end(self):
        """Make an end of it, however things stand."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait(10)
        self._log.close()

    def state(self) -> dict:
        """What the spy saw last."""
        try:
            return json.loads(self._state_file.read_text())
        except FileNotFoundError:
            return {}

    def wait(self, what: str, until: Callable[[dict], object], timeout: float = 30.0) -> dict:
        """Wait until the state says so; at least until it was written anew."""
        deadline, old = time.monotonic() + timeout, self._stamp()
        while time.monotonic() < deadline:
            if self.process.poll() is not None:
                raise Failed(f"{what}: the window ended with exit code {self.process.returncode}\n{self.log()}")
            if self._stamp() != old and (state := self.state()) and until(state):
                return state
            time.sleep(0.05)
        state = {name: value for name, value in self.state().items() if name != "widgets"}
        raise Failed(f"{what}: did not come within {timeout:g} s; the state is {state}\n{self.log()}")

    def settled(self, what: str, timeout: float = 60.0) -> dict:
        """Wait for the finished picture of things as they are."""
        return self.wait(f"{what}: a finished picture", lambda s: s["done"], timeout)

    def xdo(self, *arguments: object):
        """An xdotool command."""
        subprocess.run(["xdotool", *map(str, arguments)], env=self._environment, check=True, timeout=30)

    def at(self, rect: list[int], x: float = 0.5, y: float = 0.5) -> tuple[int, int]:
        """A point of a rectangle, given in 0 .. 1."""
        return round(rect[0] + x * rect[2]), round(rect[1] + y * rect[3])

    def click(self, rect: list[int], x: float = 0.5, y: float = 0.5, button: int = 1, times: int = 1):
        self.xdo("mousemove", *self.at(rect, x, y), "sleep", "0.1", "click", "--repeat", times, button, "sleep", "0.1")

    def drag(self, start: tuple[int, int], end: tuple[int, int], button: int = 1, steps: int = 12):
        self.xdo("mousemove", *start, "sleep", "0.1", "mousedown", button)
        for i in range(1, steps + 1):
            self.xdo("mousemove", *(round(a + (b - a) * i / steps) for a, b in zip(start, end)), "sleep", "0.03")
        self.xdo("sleep", "0.1", "mouseup", button)

    def key(self, *keys: str):
        for key in keys:
            self.xdo("key", "--clearmodifiers", key, "sleep", "0.15")

    def type(self, text: str):
        self.xdo("type", "--delay", "15", text)

    def widget(self, name: str) -> list[int]:
        """Where the widget of that accessible name is."""
        return self.wait(f"the widget {name!r}", lambda s: name in s["widgets"])["widgets"][name]

    def shot(self, name: str) -> np.ndarray:
        """The whole screen, kept as a file as well."""
        path = self.folder / f"{len(self.shots):02d}-{name}.png"
        subprocess.run(["import", "-window", "root", str(path)], env=self._environment, check=True, timeout=30)
        self.shots.append(path)
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB")).astype(np.int16)

    def picture(self, name: str) -> np.ndarray:
        """The viewport's part of the screen, without what lies over its edges."""
        x, y, w, h = self.state()["picture"]
        return self.shot(name)[y + h // 5:y + h * 4 // 5, x + 5:x + w - 5]

    def _stamp(self) -> int:
        try:
            return self._state_file.stat().st_mtime_ns
        except FileNotFoundError:
            return 0


def differing(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the pixels that are clearly different, 0 .. 1."""
    return float((np.abs(a - b).max(axis=-1) > 12).mean()) if a.shape == b.shape else 1.0
