"""The render thread: latest job wins, buffers are not overwritten while painted, failures are told, kernels compile in a helper."""
import sys
import threading
import time

import numpy as np
import pytest
from double import Double

from app.compiling import Compiler
from app.engine import Job
from app.options import Options
from app.outline import trace_outline
from app.worker import Worker
from rtcore.warm import queue, worth_sharing


@pytest.fixture
def start(qapp):
    """Makes workers and closes them."""
    made = []

    def make(double: Double, **words) -> Worker:
        made.append(Worker(renderer_factory=lambda: double, **words))
        return made[-1]
    yield make
    for worker in made:
        worker.close()


def job(scene, number: int = 1, **words) -> Job:
    return Job(number, scene, scene.camera, Options(), (64, 48), **words)


def test_frames_arrive_and_the_last_is_done(start, qtbot, scene):
    worker = start(Double())
    with qtbot.waitSignal(worker.newest):
        worker.submit(job(scene))
    shown = []
    qtbot.waitUntil(lambda: (shown.append(worker.take()) or True) and any(s and s.frame.done for s in shown))
    last = [s for s in shown if s][-1]
    assert last.bytes.shape == (48, 64, 4) and (last.bytes[..., 3] == 255).all()
    blue, green, red, _ = last.bytes[24, 32].tolist()
    assert red > blue + 60 and red > green + 60


def test_a_newer_job_ends_the_older_one(start, qtbot, scene):
    double = Double(pause=30.0)
    worker = start(double)
    worker.submit(job(scene, 1))
    qtbot.waitUntil(lambda: len(double.jobs) == 1)
    double.pause = 0.0
    began = time.monotonic()
    worker.submit(job(scene, 2))
    worker.submit(job(scene, 3))
    qtbot.waitUntil(lambda: len(double.jobs) >= 2 and double.jobs[-1].number == 3)
    assert time.monotonic() - began < 1.0


def test_a_dropped_job_ends_at_once_and_does_not_come_back(start, qtbot, scene):
    double = Double(pause=0.2, spacings=(1,) * 20)
    worker, numbers = start(double), []
    worker.newest.connect(lambda: numbers.append(worker.take().job.number))
    worker.submit(job(scene, 1))
    qtbot.waitUntil(lambda: len(numbers) == 1)      # refined from now on
    worker.drop()
    qtbot.wait(300)
    assert numbers == [1] and len(double.jobs) == 1
    worker.submit(job(scene, 2))
    qtbot.waitUntil(lambda: len(double.jobs) == 2)
    worker.drop()                                   # before its first frame, and though the next is a step of the same drag
    double.pause = 0.0
    worker.submit(job(scene, 3, continues=True))
    qtbot.waitUntil(lambda: 3 in numbers)
    assert 2 not in numbers


def test_a_step_of_a_drag_may_show_its_first_pass(start, qtbot, scene):
    double = Double(pause=0.08)
    worker, numbers = start(double), []
    worker.newest.connect(lambda: numbers.append(worker.take().job.number))
    for number in range(1, 13):
        worker.submit(job(scene, number, continues=number > 1))
        qtbot.wait(20)
    qtbot.waitUntil(lambda: 12 in numbers)
    assert len(set(numbers)) >= 3     # the drag showed something on its way


def test_the_signal_is_coalesced_and_the_painted_buffer_left_alone(start, qtbot, scene):
    worker, count = start(Double(spacings=(8, 4, 2, 1))), []
    worker.newest.connect(lambda: count.append(1))
    worker.submit(job(scene))

    def finished(number: int) -> bool:
        newest = worker._newest
        return newest is not None and newest.job.number == number and newest.frame.done

    qtbot.waitUntil(lambda: finished(1))
    painted = worker.take()
    before = painted.bytes.copy()
    for number in range(2, 6):
        worker.submit(job(scene, number))
        qtbot.waitUntil(lambda number=number: finished(number))
    assert (painted.bytes == before).all()
    assert len(count) <= 2      # nobody took a frame, so nobody was told again
    buffers = {id(b) for b in worker._spares} | {id(worker._newest.bytes), id(painted.bytes)}
    assert len(buffers) <= 3


def test_a_pause_lets_every_pixel_have_a_sample_and_resuming_goes_on(start, qtbot, scene):
    double = Double(pause=0.02, spacings=(4, 1, 1, 1, 1, 1))
    worker, frames = start(double), []
    worker.newest.connect(lambda: frames.append(worker.take().frame))
    worker.pause(True)
    worker.submit(job(scene))
    qtbot.waitUntil(lambda: bool(frames) and frames[-1].samples == 1)
    qtbot.wait(150)
    assert len(frames) <= 2 and not frames[-1].done     # a frame that nobody took in time is replaced by the next
    worker.pause(False)
    qtbot.waitUntil(lambda: frames[-1].done)
    assert len(double.jobs) == 2 and double.jobs[0] == double.jobs[1]
    worker.pause(True)
    worker.submit(job(scene, 2))        # a change while paused: its first sample, no more
    qtbot.waitUntil(lambda: frames[-1].samples == 1 and not frames[-1].done)
    qtbot.wait(100)
    assert not frames[-1].done and len(double.jobs) == 3


def test_a_change_of_exposure_traces_nothing(start, qtbot, scene):
    double = Double()
    worker, shown = start(double), []
    worker.newest.connect(lambda: shown.append(worker.take()))
    worker.submit(job(scene))
    qtbot.waitUntil(lambda: bool(shown) and shown[-1].frame.done)
    first, plain = shown[-1], shown[-1].bytes.copy()
    worker.submit(job(scene, 2)._replace(options=Options(exposure=-1.0)))
    qtbot.waitUntil(lambda: shown[-1].job.number == 2)
    assert shown[-1].frame is first.frame and len(double.jobs) == 1
    assert (shown[-1].bytes[..., :3] < plain[..., :3]).mean() > 0.9
    worker.submit(job(scene, 3)._replace(options=Options(exposure=-1.0)))     # the very same once more is meant: run again
    qtbot.waitUntil(lambda: shown[-1].job.number == 3 and shown[-1].frame.done)
    assert len(double.jobs) == 2
    worker.submit(job(scene, 4)._replace(options=Options(exposure=1.0, shadows=False)))
    qtbot.waitUntil(lambda: shown[-1].job.number == 4 and shown[-1].frame.done)
    assert len(double.jobs) == 3


def test_a_failure_is_told_and_the_thread_lives_on(start, qtbot, scene, capsys):
    double = Double()
    double.fail = ValueError("no such thing")
    worker = start(double)
    with qtbot.waitSignal(worker.failed) as told:
        worker.submit(job(scene))
    assert "no such thing" in told.args[0] and "\n" not in told.args[0]
    assert "Traceback" in capsys.readouterr().err
    double.fail = None
    with qtbot.waitSignal(worker.newest):
        worker.submit(job(scene, 2))


def test_a_renderer_that_can_not_be_made_is_told(start, qtbot, capsys, monkeypatch):
    def factory():
        raise ImportError("no numba here")
    gate = threading.Event()
    worker = Worker(renderer_factory=lambda: gate.wait() and factory())
    with qtbot.waitSignal(worker.failed) as told:
        gate.set()
    worker.close()
    assert "no numba here" in told.args[0]
    assert "no numba here" in capsys.readouterr().err


HELPER = "import sys, time\nfor name in sys.stdin: time.sleep(0.02); print(name, end='', flush=True)\n"


def test_missing_kernels_are_compiled_by_a_helper_first(start, qtbot, scene):
    double = Double(names=["sphere.f64", "plane.f64"])
    worker, seen = start(double, compiler=Compiler((sys.executable, "-c", HELPER))), []
    worker.progressed.connect(lambda: seen.append(worker.compiling and str(worker.compiling)))
    with qtbot.waitSignal(worker.newest, timeout=10000):
        worker.submit(job(scene))
    qtbot.waitUntil(lambda: seen[-1] is None)
    assert worker.compiling is None and seen[-2:] != [None, None] and "plane" in "".join(filter(None, seen))


def test_helpers_share_the_kernels_from_both_ends():
    names = ["fog.f64", "torus.f32", "core.f64", "torus.f64", "sphere.f64", "core.f32", "lit.f64"]
    assert queue(names) == ["torus.f64", "sphere.f64", "torus.f32", "core.f32", "fog.f64", "lit.f64", "core.f64"]
    seen = []
    assert Compiler((sys.executable, "-u", "-c", HELPER), processes=2).compile(names, seen.append) == ""
    assert set(seen[1].names) == {"torus.f64", "core.f64"}
    assert sorted({name for state in seen for name in state.names}) == sorted(names)
    assert max(len(state.names) for state in seen) == 2
    done = [state.done for state in seen]
    assert done == sorted(done) and done[-1] == 6


def test_a_quick_shape_is_left_to_the_helper_that_has_what_shapes_share():
    assert worth_sharing(["polygon.f64", "fog.f64"]) and worth_sharing(["torus.f64"]) and not worth_sharing(["polygon.f64", "plane.f64"])
    slow = "import sys, time\nfor name in sys.stdin: time.sleep(0.3 * ('sphere' in name)); print(name, end='', flush=True)\n"
    seen = []
    assert Compiler((sys.executable, "-u", "-c", slow), processes=2).compile(["sphere.f64", "polygon.f64", "lit.f64"], seen.append) == ""
    assert not [state for state in seen if set(state.names) == {"sphere.f64", "polygon.f64"}]


def test_one_helper_of_two_that_dies_is_told_and_ends_the_work():
    dying = "import sys\nfor name in sys.stdin:\n if 'torus' in name: raise SystemExit('no torus today')\n print(name, flush=True)\n"
    seen = []
    complaint = Compiler((sys.executable, "-u", "-c", dying), processes=2).compile(["torus.f64", "fog.f64", "lit.f64"], seen.append)
    assert complaint == "no torus today"


def test_a_helper_that_fails_is_told_and_the_picture_comes_all_the_same(start, qtbot, scene, capsys):
    worker = start(Double(names=["sphere.f64"]), compiler=Compiler((sys.executable, "-c", "raise SystemExit('out of breath')")))
    told = []
    worker.failed.connect(told.append)
    with qtbot.waitSignal(worker.newest, timeout=10000):
        worker.submit(job(scene))
    assert len(told) == 1 and "out of breath" in told[0]
    assert "out of breath" in capsys.readouterr().err


def test_closing_kills_the_helper_within_a_second(qapp, qtbot, scene):
    helper = Compiler((sys.executable, "-c", "import time; time.sleep(60)"))
    worker = Worker(renderer_factory=lambda: Double(names=["sphere.f64"]), compiler=helper)
    worker.submit(job(scene))
    qtbot.waitUntil(lambda: len(worker._compiler._processes) == 1, timeout=5000)
    began = time.monotonic()
    worker.close()
    assert time.monotonic() - began < 1.0 and not worker._thread.is_alive()


def test_the_outline_rings_the_selected_pixels():
    node = np.full((40, 60), -1, np.int32)
    node[10:20, 20:30] = 4
    assert trace_outline(node, (5, 9)) is None
    outline = trace_outline(node, (4, 5), 2)
    whole = np.zeros(node.shape, np.uint32)
    high, wide = outline.pixels.shape
    whole[outline.y:outline.y + high, outline.x:outline.x + wide] = outline.pixels
    assert whole[9, 25] == whole[8, 25] == whole[15, 19] == whole[15, 30] == 0xFFFFB02E     # two pixels of ring on every side
    assert whole[7, 25] == whole[10, 25] == 0x70000000 and whole[6, 25] == 0       # a halo outside and inside
    assert not whole[11:19, 21:29].any()


def test_an_outline_at_the_edge_stays_in_the_picture():
    outline = trace_outline(np.zeros((30, 50), np.int32), (0, 1), 3)
    assert (outline.x, outline.y) == (0, 0) and outline.pixels.shape == (30, 50)
