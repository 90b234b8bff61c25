"""Starts the window."""
import ctypes
import os
import signal
import sys
import threading
import traceback
from pathlib import Path

#: Seconds after which the window's thread gets Python's lock from one that computes. It asks for it after each of Qt's calls that let it
#: go, dozens in an event: with Python's own 5 ms an event could take 60 ms while the renderer prepared a scene.
SWITCH = 0.0001

#: What Qt's window plugin on X11 loads, and the Debian package that has it. Without one of them Qt aborts the process.
XCB = {"libxcb-cursor.so.0": "libxcb-cursor0", "libxcb-icccm.so.4": "libxcb-icccm4", "libxcb-image.so.0": "libxcb-image0",
       "libxcb-keysyms.so.1": "libxcb-keysyms1", "libxcb-randr.so.0": "libxcb-randr0", "libxcb-render-util.so.0": "libxcb-render-util0",
       "libxcb-shape.so.0": "libxcb-shape0", "libxcb-sync.so.1": "libxcb-sync1", "libxcb-xfixes.so.0": "libxcb-xfixes0",
       "libxcb-xkb.so.1": "libxcb-xkb1", "libxcb-shm.so.0": "libxcb-shm0", "libxcb-render.so.0": "libxcb-render0", "libxcb.so.1": "libxcb1",
       "libxcb-util.so.1": "libxcb-util1", "libX11-xcb.so.1": "libx11-xcb1", "libxkbcommon-x11.so.0": "libxkbcommon-x11-0"}

#: What Qt's own libraries load, on any platform.
CORE = {"libEGL.so.1": "libegl1", "libGL.so.1": "libgl1", "libfontconfig.so.1": "libfontconfig1", "libfreetype.so.6": "libfreetype6",
        "libdbus-1.so.3": "libdbus-1-3",
        "libglib-2.0.so.0": "libglib2.0-0", "libX11.so.6": "libx11-6", "libxkbcommon.so.0": "libxkbcommon0"}


def missing_packages(libraries: dict[str, str]) -> list[str]:
    """Debian packages of those libraries that can't be loaded."""
    missing = []
    for library, package in libraries.items():
        try:
            ctypes.CDLL(library)
        except OSError:
            missing.append(package)
    return missing


def obstacle() -> str | None:
    """Why Qt can't start here, in one line, or None. Asked beforehand, because Qt would abort without a word in this program."""
    if not sys.platform.startswith("linux"):
        return None
    platform = os.environ.get("QT_QPA_PLATFORM", "").partition(":")[0]
    x11 = platform == "xcb" or (not platform and not os.environ.get("WAYLAND_DISPLAY"))
    missing = missing_packages({**CORE, **XCB} if x11 else CORE)
    if missing:
        return f"the window needs packages that are not installed; on Debian: apt install {' '.join(missing)}"
    if x11 and not os.environ.get("DISPLAY"):
        return "the window needs a display, and DISPLAY is not set"
    return None


def run(path: str | None) -> int:
    """Show the window with the scene at `path`, or with a scene of the gallery. Returns the exit code."""
    if (reason := obstacle()) is not None:
        print(f"rayscope: {reason}", file=sys.stderr)
        return 1
    try:
        from PySide6.QtCore import Qt
        from PySide6.QtWidgets import QApplication
    except ImportError as error:
        print(f"rayscope: Qt can't be loaded: {error}", file=sys.stderr)
        return 1
    from app.gallery import FIRST_SCENE
    from app.garbage import Garbage
    from app.session import Session
    from app.settings import Preferences
    from app.window import Window

    QApplication.setHighDpiScaleFactorRoundingPolicy(Qt.HighDpiScaleFactorRoundingPolicy.PassThrough)
    app = QApplication.instance() or QApplication(["rayscope"])
    app.setApplicationName("rayscope")
    app.setApplicationDisplayName("Rayscope")
    app.setDesktopFileName("rayscope")
    sys.setswitchinterval(SWITCH)
    session = Session()
    hook = sys.excepthook, threading.excepthook
    sys.excepthook = lambda kind, error, trace: report(session, error)
    threading.excepthook = lambda args: report(session, args.exc_value)
    window = Window(session, Preferences())
    Garbage(session, window.filing)
    window.show()
    signal.signal(signal.SIGINT, signal.SIG_DFL)     # Ctrl-C in the terminal ends the program; Qt's loop would never look
    window.filing.open(Path(path) if path is not None else FIRST_SCENE, instead=FIRST_SCENE)
    try:
        return app.exec()
    finally:
        session.close()
        sys.excepthook, threading.excepthook = hook


def report(session, error: BaseException | None):
    """An exception that nobody caught: the whole of it on stderr, a line of it in the window."""
    if error is None or isinstance(error, KeyboardInterrupt):
        return
    traceback.print_exception(error, file=sys.stderr)
    session.said.emit("error", " ".join(f"Unexpected: {type(error).__name__}: {error}".split()))
