"""The session between document, worker and whoever looks: requests, stale frames, picking, moves, files."""
import msgspec
import numpy as np
import pytest

import rtcore
from app.filing import Filing
from app.places import Place, node_at
from rtcore.camera import Camera
from rtcore.files.image import srgb_bytes


@pytest.fixture
def said(session):
    """All messages of the session."""
    messages = []
    session.said.connect(lambda level, text: messages.append((level, text)))
    return messages


def at_pixel(column: float, row: float) -> tuple[float, float]:
    return (column + 0.5) / 160, (row + 0.5) / 120


def test_a_picture_comes_by_itself(session, settled):
    settled(session)
    assert session.shown.job.size == (160, 120)


@pytest.mark.parametrize("name", ["shadows", "fog", "reflections"])
def test_switches_ask_for_another_picture(session, double, settled, name):
    settled(session)
    asked = len(double.jobs)
    session.switch(name, False)
    settled(session)
    assert len(double.jobs) == asked + 1 and getattr(double.jobs[-1].options, name) is False
    session.switch(name, False)
    assert session.shown.job is double.jobs[-1]     # nothing new to ask for
    assert not session.document.modified            # not an edit of the scene


def test_stale_frames_are_dropped(session, double, qtbot, settled):
    settled(session)
    double.pause = 0.2
    frames = []
    session.frame_changed.connect(lambda: frames.append(session.shown.job.options.shadows))
    session.switch("shadows", False)
    qtbot.waitUntil(lambda: len(double.jobs) > 1 and double.jobs[-1].options.shadows is False)
    session.worker._show(double, session.shown.frame, session.shown.job)      # a straggler of the old job, come too late
    qtbot.wait(50)
    assert True not in frames
    settled(session)


def test_picking_selects_what_is_seen(session, settled):
    settled(session)
    session.pick(*at_pixel(80, 60))
    assert session.selection == Place("node", (1,))
    session.pick(*at_pixel(80, 2))
    assert session.selection is None


def test_picking_finds_the_leaf_inside_a_use(session, settled):
    settled(session)
    column, row = next(np.argwhere(session.shown.frame.node == 5)[0][::-1].tolist() for _ in [0])
    session.pick(*at_pixel(column, row))
    assert session.selection == Place("node", (3, 0, 1)) and session.name_of(session.selection) == "base"


def test_the_selection_is_outlined_and_stays_so_in_new_frames(session, settled, qtbot):
    settled(session)
    session.select(Place("node", (2,)))
    qtbot.waitUntil(lambda: session.shown.outline is not None)
    session.switch("shadows", False)
    settled(session)
    assert session.shown.outline is not None
    session.select(None)
    assert session.shown.outline is None


def test_hiding_takes_the_object_out_of_the_picture_and_undo_brings_it_back(session, settled):
    settled(session)
    ball = node_at(session.scene, (1,))
    session.edit_record(Place("node", (1,)), msgspec.structs.replace(ball, visible=False), "hide")
    settled(session)
    assert not (session.shown.frame.node == 1).any() and session.document.modified
    session.document.undo()
    settled(session)
    assert (session.shown.frame.node == 1).any() and not session.document.modified


def test_the_mouse_moves_the_camera_and_not_the_document(session):
    start = session.camera
    for _ in range(4):
        session.orbit(0.1, 0.05, gesture=1)
    session.pan(0.1, 0.0, gesture=2)
    assert session.camera != start and not session.document.modified
    session.back()
    session.back()
    assert session.camera == start
    session.forward()
    assert session.camera != start
    session.reset_view()
    assert session.camera == start


def test_the_wheel_draws_toward_the_point_under_the_cursor(session, settled):
    settled(session)
    at = at_pixel(85, 60)
    point = session.point_under(*at)
    assert np.linalg.norm(point) == pytest.approx(1.0, abs=1e-3)     # on the red ball
    before = session.camera.project(point, 160, 120)
    session.dolly(0.8, point, gesture=1)
    assert session.camera.project(point, 160, 120) == pytest.approx(before, abs=1e-6)
    assert np.linalg.norm(np.subtract(session.camera.lookfrom, point)) < 0.81 * np.linalg.norm(np.subtract((0, 0, -10), point))


def test_a_move_out_of_all_bounds_leaves_the_view(session):
    start = session.camera
    session.dolly(1e308, gesture=1)
    session.dolly(1e308, gesture=1)
    assert np.isfinite(session.camera.lookfrom).all() and session.camera.fov == start.fov


def test_framing_all_and_the_selection(session, settled, qtbot):
    settled(session)
    session.frame_all()
    qtbot.waitUntil(lambda: session.camera != session.home)
    for corner in ((3, 2.5, 0), (-3, 2.5, 0), (3, -1.6, 0)):
        x, y = session.camera.project(corner, 160, 120)
        assert 0 <= x <= 160 and 0 <= y <= 120
    everything = session.camera
    session.select(Place("node", (2, 0)))
    session.frame_selection()
    qtbot.waitUntil(lambda: session.camera != everything)
    assert session.camera.lookat == pytest.approx((2.5, 2, 0))


def test_what_is_under_the_cursor(session, settled):
    settled(session)
    session.hover(at_pixel(80, 60))
    assert session.under.place == Place("node", (1,)) and session.under.distance == pytest.approx(9.0, abs=0.01)
    session.hover(at_pixel(80, 2))
    assert session.under.place is None and session.under.distance == np.inf
    session.hover(None)
    assert session.under is None


def test_resolution_scale_changes_the_size_of_the_picture(session, settled):
    session.set_options(msgspec.structs.replace(session.options, scale=0.5))
    settled(session)
    assert session.shown.job.size == (80, 60)


def test_while_its_size_changes_the_picture_is_not_rendered(session, double, qtbot, settled):
    settled(session)
    session._settling.setInterval(300)      # a step takes long where all processors are busy
    double.pause = 0.2
    session.switch("fog", False)
    qtbot.waitUntil(lambda: len(double.jobs) == 2)
    for width in range(161, 171):
        session.resize((width, 120), 1.0)
        qtbot.wait(5)
    assert len(double.jobs) == 2
    double.pause = 0.0
    qtbot.waitUntil(lambda: session.shown.job.size == (170, 120) and session.shown.frame.done)
    assert len(double.jobs) == 3 and session.shown.job.options.fog is False
    qtbot.wait(400)
    assert len(double.jobs) == 3        # what was ended on the way does not go on


def test_a_change_beside_a_resize_is_not_kept_waiting(session, double, qtbot, settled):
    settled(session)
    session.resize((180, 120), 1.0)
    session.switch("fog", False)
    qtbot.waitUntil(lambda: session.shown.job.size == (180, 120) and session.shown.frame.done)
    qtbot.wait(150)
    assert len(double.jobs) == 2        # it was the picture for the new size as well


@pytest.fixture
def filing(session):
    return Filing(session)


def test_a_scene_is_saved_with_the_camera_and_opened_again(session, filing, tmp_path, qtbot, said):
    session.orbit(0.5, 0.2, gesture=1)
    session.edit(msgspec.structs.replace(session.scene, note="by hand"), "note")
    camera, path = session.camera, tmp_path / "saved.yaml"
    with qtbot.waitSignal(session.document.changed):
        filing.save(path)
    assert not session.document.modified and session.document.path == path
    scene = rtcore.load(path)
    assert scene.note == "by hand" and scene.camera == camera
    session.reset_view()
    with qtbot.waitSignal(filing.opened, timeout=5000):
        filing.open(path)
    assert session.camera == camera and not session.document.modified and session.selection is None


def test_reload_keeps_camera_and_selection(session, filing, tmp_path, qtbot):
    path = tmp_path / "saved.yaml"
    rtcore.save(session.scene, path)
    with qtbot.waitSignal(filing.opened, timeout=5000):
        filing.open(path)
    session.orbit(0.5, 0.0, gesture=1)
    session.select(Place("node", (1,)))
    camera = session.camera
    rtcore.save(msgspec.structs.replace(session.scene, name="changed outside"), path)
    with qtbot.waitSignal(filing.opened, timeout=5000):
        filing.reload()
    assert session.scene.name == "changed outside" and session.camera == camera and session.selection == Place("node", (1,))


@pytest.mark.parametrize("content", [None, b"", b"\0\1\2\3", b"rayscope: 1\nscene:\n  - spere: {}\n", b"rayscope: 99\n"])
def test_a_bad_file_is_told_in_a_line_and_the_old_scene_kept(session, filing, tmp_path, qtbot, said, content):
    path, scene = tmp_path / "bad.yaml", session.scene
    if content is not None:
        path.write_bytes(content)
    filing.open(path)
    qtbot.waitUntil(lambda: bool(said), timeout=5000)
    level, text = said[-1]
    assert level == "error" and "bad.yaml" in text and "\n" not in text
    assert session.scene is scene and filing.loading is None


def test_a_scene_without_a_camera_is_framed(session, filing, tmp_path, qtbot):
    path = tmp_path / "bare.yaml"
    rtcore.save(msgspec.structs.replace(session.scene, camera=None), path)
    with qtbot.waitSignal(filing.opened, timeout=5000):
        filing.open(path)
    assert isinstance(session.camera, Camera)


def test_the_picture_is_saved(session, filing, tmp_path, qtbot, settled, said):
    from PIL import Image
    settled(session)
    filing.save_picture(tmp_path / "picture.png")
    qtbot.waitUntil(lambda: bool(said), timeout=5000)
    assert said[-1][0] == "info"
    with Image.open(tmp_path / "picture.png") as picture:
        assert picture.size == (160, 120)


def test_a_png_is_as_bright_as_shown_and_an_exr_as_it_is(session, filing, tmp_path, qtbot, settled, said):
    from PIL import Image
    OpenEXR = pytest.importorskip("OpenEXR")
    session.brighten(-2.0)
    settled(session)
    for name in ("dark.png", "light.exr"):
        said.clear()
        filing.save_picture(tmp_path / name)
        qtbot.waitUntil(lambda: bool(said), timeout=5000)
    assert "as it is" in said[-1][1]
    light = session.shown.frame.pixels
    with Image.open(tmp_path / "dark.png") as picture:
        assert picture.text["Exposure"] == "-2 stops"
        assert np.abs(np.asarray(picture) / 255 - srgb_bytes(light / 4) / 255).max() < 0.01
    with OpenEXR.File(str(tmp_path / "light.exr")) as file:
        assert np.allclose(file.channels()["RGB"].pixels, light)


def test_brightness_ends_at_ten_stops_and_leaves_false_colours_alone(session, settled):
    for _ in range(25):
        session.brighten(0.5)
    assert session.options.exposure == 10 and session.options.gain() == 1024
    assert msgspec.structs.replace(session.options, view="normal").gain() == 1


def test_a_pause_is_told_once(session, qtbot):
    told = []
    session.paused_changed.connect(lambda: told.append(session.paused))
    for on in (True, True, False):
        session.pause(on)
    assert told == [True, False]


def test_a_picture_for_a_forbidden_place_is_refused(session, filing, tmp_path, qtbot, settled, said):
    settled(session)
    filing.save_picture(tmp_path / "none" / "picture.png")
    qtbot.waitUntil(lambda: bool(said), timeout=5000)
    assert said[-1][0] == "error" and "picture.png" in said[-1][1]


def test_in_place_of_a_bad_first_file_another_is_shown(session, filing, tmp_path, qtbot, said):
    good = tmp_path / "good.yaml"
    rtcore.save(msgspec.structs.replace(session.scene, name="instead"), good)
    with qtbot.waitSignal(filing.opened, timeout=5000):
        filing.open(tmp_path / "none.yaml", instead=good)
    assert session.scene.name == "instead" and said[-1][0] == "error" and "none.yaml" in said[-1][1]
