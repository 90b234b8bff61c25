"""Whether the window's thread is at something, as another thread sees it, and how long that one waits."""
import sys
import threading
import time

import pytest
from PySide6.QtCore import QEventLoop, QTimer

from app.courtesy import LOOK, WAIT, Courtesy
from rtcore import Node, Scene, Sphere, Translate
from rtcore.flatten import flatten

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells what a thread is at")


def looks(courtesy: Courtesy, seconds: float, at_work: bool) -> list[bool]:
    """What another thread sees of this one, which spins or waits for events meanwhile."""
    seen, end = [], time.monotonic() + seconds

    def look():
        time.sleep(0.02)
        while time.monotonic() < end - 0.02:
            seen.append(courtesy.busy())
            time.sleep(LOOK)
    watch = threading.Thread(target=look)
    watch.start()
    if at_work:
        while time.monotonic() < end:
            sum(range(1000))
    else:
        loop = QEventLoop()
        QTimer.singleShot(round(1000 * seconds), loop.quit)
        loop.exec()
    watch.join()
    return seen


def test_a_thread_that_works_is_busy_and_one_that_waits_for_events_is_not(qapp):
    courtesy = Courtesy()
    working, waiting = looks(courtesy, 0.3, True), looks(courtesy, 0.3, False)
    assert sum(working) > 0.9 * len(working) > 0 and sum(waiting) < 0.1 * len(waiting)
    courtesy.close()
    assert not courtesy.busy()


def test_it_waits_as_long_as_the_other_is_busy_but_not_for_ever(monkeypatch):
    courtesy, began = Courtesy(), time.monotonic()
    monkeypatch.setattr(courtesy, "busy", lambda: time.monotonic() - began < 0.003)
    courtesy.give_way()
    assert 0.003 <= time.monotonic() - began < WAIT
    monkeypatch.setattr(courtesy, "busy", lambda: True)
    began = time.monotonic()
    courtesy.give_way()         # it has just waited
    assert time.monotonic() - began < 0.002
    time.sleep(0.005)
    began = time.monotonic()
    courtesy.give_way()
    assert WAIT <= time.monotonic() - began < 10 * WAIT
    courtesy.close()


def test_where_nothing_is_told_nobody_waits(monkeypatch):
    monkeypatch.setattr("app.courtesy.SLEEPS", ())
    courtesy = Courtesy()
    assert not courtesy.busy()
    courtesy.give_way()
    courtesy.close()


def test_it_is_asked_before_each_shape_that_is_packed():
    asked, scene = [], Scene(objects=[Node(shape=Sphere((k, 0, 0), 0.3)) for k in range(5)])
    before = flatten(scene, give_way=lambda: asked.append(1))
    assert len(asked) == 5
    moved = Scene(objects=[*scene.objects[:4], Node(shape=Sphere((9, 0, 0), 0.3), transform=[Translate((1, 0, 0))])])
    flatten(moved, previous=before, give_way=lambda: asked.append(1))
    assert len(asked) == 6
