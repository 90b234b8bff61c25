"""`rayscope bench --latency`: what it measures is what it says, and the file is as promised."""
import json

import pytest
from commandline import ball_in, one_line, run_here

from rtcore import Ambient, Camera, Material, Node, Point, Scene, Sphere
from rtcore.edits import EDIT
from rtcore.reports.bench import latency

SCENE = Scene(objects=[Node(name="two", children=(Node(shape=Sphere((0, 0, 0), 1), material=Material(reflection=0.3)),
                                                  Node(shape=Sphere((1, 1, 1), 0.5))))],
              lights=[Point(position=(2, 3, -4), intensity=20), Ambient(intensity=0.2)], camera=Camera(lookfrom=(0, 0, -6)))
SIZE = (64, 48)


def test_the_spread_is_in_milliseconds():
    assert latency.spread([0.001 * k for k in range(1, 102)]) == pytest.approx((51, 96))


def test_every_edit_is_what_its_name_says():
    loop = latency.Loop(SCENE, SIZE)
    settings = loop.settings
    edits = latency.edits_of(SCENE, settings)
    assert edits.keys() | {"camera"} == set(latency.KINDS) and set(latency.KINDS) <= EDIT.keys()
    for kind, edit in edits.items():
        for k in range(2):
            loop.show(SCENE, loop.camera, settings)
            scene, chosen = edit(k)
            loop.show(scene, loop.camera, chosen)
            if (scene, chosen) != (SCENE, settings) and kind != "exposure":
                assert kind in loop.renderer.edits, (kind, k, loop.renderer.edits)
    loop.close()


def test_a_scene_without_lights_or_shapes_has_no_use_for_some_edits():
    assert not latency.edits_of(Scene(lights=[]), latency.Settings()).keys() & {"light", "move_light", "material", "hide"}


def test_rays_are_counted_for_the_edit_alone():
    told = latency.measure("two", SCENE, SIZE, 2)
    rays = {kind: traced for kind, (_, traced) in told.edits.items()}
    assert rays["camera"] == SIZE[0] * SIZE[1] and 0 < rays["hide"] < SIZE[0] * SIZE[1]
    assert not any(traced for kind, traced in rays.items() if kind not in ("camera", "hide"))
    assert 0 < told.first_frame.p50 <= told.first_frame.p95 and told.stale.p50 >= 0


def test_the_command_writes_the_contract(capsys, tmp_path):
    scene, out = ball_in(tmp_path), tmp_path / "latency.json"
    code, shown, _ = run_here(capsys, ["bench", "--latency", "--quick", scene, "-o", out])
    assert code == 0 and "first frame" in shown
    told = json.loads(out.read_text())
    assert told.keys() == {"machine", "scenes"} and told["scenes"].keys() == {scene.name}
    one = told["scenes"][scene.name]
    assert one["first_frame_ms"].keys() == one["stale_ms"].keys() == {"p50", "p95"}
    assert set(one["edits"]) <= set(latency.KINDS) and {"fog", "camera", "hide"} <= set(one["edits"])
    assert all(edit.keys() == {"p50", "p95", "primary_rays"} for edit in one["edits"].values())


def test_a_bad_scene_is_told_in_one_line(capsys, tmp_path):
    code, _, said = run_here(capsys, ["bench", "--latency", tmp_path / "none.yaml"])
    assert code == 2 and one_line(said) and "none.yaml" in said
