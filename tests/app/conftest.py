"""A session and a window around the double, on Qt's offscreen platform, and a watch over what a test leaves behind."""
import os
import threading
import time

os.environ["QT_QPA_PLATFORM"] = "offscreen"     # before Qt is imported

import pytest  # noqa: E402
from double import Double  # noqa: E402
from PySide6.QtCore import QCoreApplication, QEvent, QSettings  # noqa: E402

from app.session import Session  # noqa: E402
from app.settings import Preferences  # noqa: E402
from app.window import Window  # noqa: E402
from app.worker import Worker  # noqa: E402
from rtcore.camera import Camera  # noqa: E402
from rtcore.lights import Point  # noqa: E402
from rtcore.scene import Checker, Fog, Material, Node, Scene, Translate  # noqa: E402
from rtcore.shapes import Plane, Sphere  # noqa: E402

CAMERA = Camera(lookfrom=(0, 0, -10), lookat=(0, 0, 0), fov=40)


@pytest.fixture(autouse=True)
def leftovers(qapp):
    """Objects to be deleted are deleted, and a thread that outlives its test fails it."""
    before = set(threading.enumerate())
    yield
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    deadline = time.monotonic() + 2
    while (left := [t for t in threading.enumerate() if t not in before and "pytest_timeout" not in t.name]):
        assert time.monotonic() < deadline, left
        time.sleep(0.01)


@pytest.fixture
def scene() -> Scene:
    """A floor, a red ball in the middle, a group of two balls, and a definition used twice."""
    pawn = Node(name="pawn body", children=(Node(name="head", shape=Sphere((0, 1, 0), 0.3)),
                                            Node(name="base", shape=Sphere((0, 0, 0), 0.6))))
    return Scene(name="Test scene", objects=(
        Node(name="floor", shape=Plane(point=(0, -3, 0), normal=(0, 1, 0)), material="floor"),
        Node(name="red ball", shape=Sphere((0, 0, 0), 1.0), material=Material(color=(1, 0, 0))),
        Node(name="pair", children=(Node(name="left", shape=Sphere((2.5, 2, 0), 0.5)),
                                    Node(name="right", shape=Sphere((-2.5, 2, 0), 0.5)))),
        Node(name="first pawn", use="pawn", transform=(Translate((2.5, -1, 0)),)),
        Node(name="second pawn", use="pawn", transform=(Translate((-2.5, -1, 0)),))),
        materials={"floor": Material(checker=Checker())}, definitions={"pawn": pawn}, lights=(Point(position=(0, 5, -5)),),
        fog=Fog(density=0.02), camera=CAMERA)


@pytest.fixture
def double() -> Double:
    return Double()


@pytest.fixture
def session(qapp, double, scene):
    """A session that shows the scene at 160 x 120 pixels."""
    session = Session(Worker(renderer_factory=lambda: double))
    session.resize((160, 120), 1.0)
    session.open_scene(scene, None, scene.camera)
    yield session
    session.close()
    session.deleteLater()


@pytest.fixture
def settled(qtbot):
    """Waits until a session shows the finished picture of things as they are."""
    def wait(session: Session):
        qtbot.waitUntil(lambda: session.shown is not None and session.shown.frame.done and session.shown.job.scene is session.scene
                        and session.shown.job.camera == session.camera and session.shown.job.options == session.options, timeout=5000)
    return wait


@pytest.fixture
def preferences(tmp_path) -> Preferences:
    return Preferences(QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat))


@pytest.fixture
def window(qtbot, session, preferences, settled):
    """The window around the session, shown."""
    window = Window(session, preferences)
    window.resize(1000, 700)
    window.show()
    qtbot.waitExposed(window)
    settled(session)
    yield window
    session.document.open(session.scene, None)      # nothing unsaved, so that closing does not ask
    window.close()
    window.deleteLater()
