"""`rayscope bench`: the scenes it makes, the same scene for POV-Ray, rows and ratios, the command."""
import json
import os
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest
from commandline import ball_in, one_line, run_here

import rtcore
from rtcore import Camera, Cone, Cylinder, Implicit, Material, Mesh, Plane, Point, Polygon, Scene, Sphere, Torus, Triangle
from rtcore.lights import Directional
from rtcore.reports.bench import databases, jobs, meshes, povray, report, rivals, timing

CONTRACT = {"work", "ours", "rival", "rival_name", "unit", "ratio", "spread"}
SIDE = 128


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """name -> (path, scene): the databases at a small size."""
    folder = tmp_path_factory.mktemp("databases")
    found = {}
    for database in databases.DATABASES:
        path = folder / f"{database.name}.nff"
        path.write_text(database.make(3))
        found[database.name] = path, rtcore.load(path)
    return found


def primitives(scene: Scene) -> int:
    return sum(leaf.shape.count() if isinstance(leaf.shape, Mesh) else 1 for leaf in scene.leaves())


@pytest.mark.parametrize("name, count", [("balls", 91 + 1), ("tree", 2 * 7 + 1), ("mount", 2 * 64 + 4), ("tetra", 64)])
def test_databases_hold_what_they_say_and_are_in_view(made, name, count):
    scene = made[name][1]
    assert primitives(scene) == count
    rays = rtcore.render(scene, size=(SIDE, SIDE)).stats["rays"]
    assert 0.1 < rays["primary_hits"] / rays["primary"] <= 1
    assert rays["shadow_hits"] > 0


def test_databases_of_full_size_have_some_eight_thousand_primitives(tmp_path):
    for database in databases.DATABASES:
        (tmp_path / "scene.nff").write_text(database.make(database.levels))
        assert 4000 < primitives(rtcore.load(tmp_path / "scene.nff")) < 9000, database.name


def test_balls_of_a_sphereflake_touch_their_parents_and_do_not_reach_into_them(made):
    balls = np.array([(*leaf.shape.center, leaf.shape.radius) for leaf in made["balls"][1].leaves() if isinstance(leaf.shape, Sphere)])
    gap = np.linalg.norm(balls[:, None, :3] - balls[None, :, :3], axis=2) - balls[:, None, 3] - balls[None, :, 3]
    np.fill_diagonal(gap, np.inf)
    assert np.abs(gap[1:].min(axis=1)).max() < 1e-4


def povrays_counts(text: str, folder) -> tuple[int, int]:
    """Rays and shadow tests that POV-Ray says it did."""
    (folder / "scene.pov").write_text(text)
    ran = subprocess.run(["povray", "+Iscene.pov", "+Oout.png", f"+W{SIDE}", f"+H{SIDE}", "-A", "-D"], cwd=folder, capture_output=True,
                         text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr[-2000:]
    counts = [line.split(":")[1].split()[0] for line in ran.stderr.splitlines() if line.startswith(("Rays:", "Shadow Ray Tests:"))]
    return int(counts[0]), int(counts[1])


@pytest.mark.skipif(shutil.which("povray") is None, reason="POV-Ray is not installed")
@pytest.mark.parametrize("name", ["balls", "tree", "tetra"])
def test_pov_ray_traces_the_rays_that_we_trace(made, name, tmp_path):
    scene = made[name][1]
    rays, shadows = povrays_counts(povray.povray_text(scene, scene.camera, (SIDE, SIDE), 5), tmp_path)
    ours = rtcore.render(scene, size=(SIDE, SIDE), max_depth=5).stats["rays"]
    assert rays == pytest.approx(ours["primary"] + ours["reflection"], rel=0.05)
    assert shadows == pytest.approx(ours["shadow"], rel=0.05)


@pytest.mark.skipif(shutil.which("povray") is None, reason="POV-Ray is not installed")
@pytest.mark.parametrize("shape", [
    Plane((0, -1, 0), (0.1, 1, 0)), Triangle((-1, 0, 0), (1, 0, 0), (0, 1, 0)), Polygon(((-1, 0, 0), (1, 0, 0), (0, 0.3, 0), (0, 1, 0))),
    Triangle((-1, 0, 0), (1, 0, 0), (0, 1, 0), normals=((0, 0, -1), (0.1, 0, -1), (0, 0.1, -1))), rtcore.Box((-1, 0, 0), (1, 0.5, 1)),
    Cylinder((-1, 0, 0), (1, 0.2, 0), 0.4), Cone((0, -1, 0), 0.8, (0, 1, 0), 0.2, capped=False), Torus(0.9, 0.3)],
    ids=lambda shape: type(shape).__name__)
def test_every_shape_told_to_pov_ray_covers_the_same_pixels(shape, tmp_path):
    """Counted by the shadow rays toward a light at the eye, one for each hit."""
    camera = Camera(lookfrom=(0.3, 0.8, -4), lookat=(0, 0, 0), fov=45)
    scene = Scene(objects=(rtcore.Node(shape=shape, material=Material(), transform=(rtcore.Rotate((1, 2, 3), 20),)),), camera=camera,
                  lights=(Point(position=camera.lookfrom),))
    hits = rtcore.render(scene, size=(SIDE, SIDE)).stats["rays"]["primary_hits"]
    _, shadows = povrays_counts(povray.povray_text(scene, camera, (SIDE, SIDE), 5), tmp_path)
    assert hits > 300 and shadows == pytest.approx(hits, rel=0.02)


def test_what_pov_ray_is_not_told_is_said():
    scene = Scene(objects=(Implicit("x^2 + y^2 + z^2 - 1", low=(-1, -1, -1), high=(1, 1, 1)),), lights=(Directional(direction=(0, -1, 0)),))
    with pytest.raises(povray.Untold, match="^Implicit is no shape"):
        povray.povray_text(scene, Camera(), (8, 8), 5)
    with pytest.raises(povray.Untold, match="^a lens"):
        povray.povray_text(Scene(), Camera(aperture=0.1), (8, 8), 5)
    with pytest.raises(povray.Untold, match="^SphereLight is no light"):
        povray.povray_text(Scene(lights=[rtcore.SphereLight(position=(0, 5, 0))]), Camera(), (8, 8), 5)
    rough = rtcore.Node(shape=rtcore.Sphere((0, 0, 0), 1), material=Material(reflection=1, roughness=0.1))
    with pytest.raises(povray.Untold, match="^a rough mirror"):
        povray.povray_text(Scene(objects=[rough]), Camera(), (8, 8), 5)


def test_subdivided_meshes_keep_their_surface_and_share_their_vertices():
    cube = meshes.of_scene(Scene(objects=(Triangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), Triangle((1, 0, 0), (1, 1, 0), (0, 1, 0)))))
    assert cube.faces.shape[0] == 2 * 4 ** 8
    corners = cube.vertices[cube.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all() and normals[:, 2].sum() / 2 == pytest.approx(1)
    once = meshes.Triangles(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), np.array([[0, 1, 2], [1, 3, 2]])).subdivided()
    assert (len(once.vertices), len(once.faces)) == (4 + 5, 8)
    assert meshes.of_scene(Scene(objects=(Sphere((0, 0, 0), 1),))) is None


def test_a_mesh_written_as_ply_is_read_as_it_was(tmp_path):
    mesh = meshes.Triangles(*databases.ground(databases.heights(3)))
    (tmp_path / "mesh.ply").write_bytes(mesh.ply())
    found, = (leaf.shape for leaf in rtcore.load(tmp_path / "mesh.ply").leaves())
    assert np.array_equal(found.vertices, mesh.vertices.astype(np.float32)) and np.array_equal(found.faces, mesh.faces)


def test_primary_rays_come_tile_by_tile():
    _, directions = meshes.primary(Camera(lookfrom=(0, 0, -5)), 256)
    tile = directions[:64]
    assert np.ptp(tile[:, 0]) < np.ptp(directions[:, 0]) / 2 and np.ptp(tile[:, 1]) < np.ptp(directions[:, 1]) / 2


def test_ratios_are_of_each_round_and_above_1_where_ours_is_faster():
    target = timing.Target(2.0)
    slower = timing.row("work", "s", [1.0, 2.0, 4.0], [3.0, 4.0, 4.0], "rival", target)
    assert (slower.ours, slower.rival, slower.ratio, slower.met) == (2.0, 4.0, 2.0, True)
    assert slower.spread == pytest.approx((2.5 - 1.5) / 2)
    rates = timing.row("work", "Mrays/s", [10.0], [20.0], "rival", target)
    assert (rates.ratio, rates.met) == (0.5, False)
    assert timing.row("work", "s", [1.0], [9.0], "rival", target, judged=False).met is None
    alone = timing.row("memory", "MiB", [699.0, 700.0, 900.0], target=timing.Target(most=700.0))
    assert (alone.ratio, alone.rival, alone.met) == (None, None, True)


def test_runners_take_turns_and_one_that_fails_is_left_out():
    order, told = [], []

    def fail():
        raise timing.RivalFailed("broke")

    def runner(name):
        return lambda: order.append(name) or float(len(order))

    found = timing.alternate({"a": runner("a"), "x": fail, "b": runner("b")}, 2, lambda *words: told.append(words))
    assert order == ["a", "b"] * 3 and told == [("x", "broke")]
    assert found == {"a": [3.0, 5.0], "b": [4.0, 6.0]}


def test_a_helper_that_crashes_is_a_line_not_an_end():
    helper = rivals.Helper("rtcore.reports.bench.embree_process", "no-such-file.npz")
    try:
        with pytest.raises(timing.RivalFailed, match=r"ended with code 1: \w+Error"):
            helper.ask("primary")
    finally:
        helper.close()


def test_the_command_measures_a_scene_and_writes_the_contract(capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(rivals.RIVALS, "povray", rivals.RIVALS["povray"]._replace(version=lambda: None))
    code, out, err = run_here(capsys, ["bench", ball_in(tmp_path), "--quick", "--against", "povray,tachyon", "-o", tmp_path / "bench.json"])
    assert code == 0
    assert "ball, 64 x 64" in out and "2 threads" in out
    assert "rayscope: POV-Ray is not installed (Debian's package povray): nothing is compared with it\n" in err
    data = json.loads((tmp_path / "bench.json").read_text())
    assert set(data) >= {"machine", "rows"} and {"cpu", "cores", "numba"} <= set(data["machine"])
    assert len(data["rows"]) == 2
    for row in data["rows"]:
        assert set(row) >= CONTRACT and row["ours"] > 0 and row["unit"] == "s"
    alone, threads = data["rows"]
    assert (alone["rival"], alone["rival_name"], alone["ratio"]) == (None, None, None)
    assert threads["rival_name"] == "1 thread" and threads["ratio"] == pytest.approx(threads["rival"] / threads["ours"])


def test_a_mesh_is_measured_with_rays_and_direct_light(capsys, tmp_path):
    (tmp_path / "hill.ply").write_bytes(meshes.Triangles(*databases.ground(databases.heights(3))).ply())
    rows = []
    for step in report.run([tmp_path / "hill.ply"], ["embree", "mitsuba"], [sys.executable, "-m", "app"], quick=True):
        rows, notes = step.rows, step.notes
    assert [row.unit for row in rows] == ["Mrays/s"] * 4 + ["s"]
    for module, title in (("embreex", "Embree"), ("mitsuba", "Mitsuba")):
        if rivals.RIVALS[title.lower()].version() is None:
            assert any(note.startswith(f"{title} is not installed (pip install {module})") for note in notes)
        else:
            assert any((row.rival_name or "").startswith(title) for row in rows)


def test_what_is_wrong_is_told_in_one_line(capsys, tmp_path):
    scene = ball_in(tmp_path)
    code, _, err = run_here(capsys, ["bench", scene, "--against", "povray,blender"])
    assert code == 2 and one_line(err) and "expected some of povray, tachyon, embree, mitsuba, got 'blender'" in err
    code, _, err = run_here(capsys, ["bench", tmp_path / "missing.nff"])
    assert code == 2 and one_line(err) and "missing.nff" in err
    code, _, err = run_here(capsys, ["bench", scene, "-o", scene])
    assert code == 2 and one_line(err)
    code, _, err = run_here(capsys, ["bench", scene, "-o", tmp_path / "no" / "folder.json"])
    assert code == 2 and one_line(err)


def test_a_render_that_fails_ends_the_work_with_its_reason(tmp_path):
    bench = jobs.Bench((), [sys.executable, "-c", "raise SystemExit('no memory')"], tmp_path, quick=True)
    with pytest.raises(jobs.WorkFailed, match="no memory"):
        list(jobs.picture(bench, "ball", ball_in(tmp_path), False))


def test_interrupted_it_tells_what_it_has(capsys, tmp_path, monkeypatch):
    def run(*_):
        yield report.Step(0.0, "balls", [], [])
        os.kill(os.getpid(), signal.SIGINT)
        yield report.Step(0.5, "tree", [timing.row("balls", "s", [1.0], [2.0], "POV-Ray")], ["a remark"])
        raise AssertionError("nothing more is measured")

    monkeypatch.setattr(report, "run", run)
    code, out, err = run_here(capsys, ["bench", "-o", tmp_path / "bench.json"])
    assert code == 130 and "POV-Ray" in out
    assert err == "rayscope: a remark\nrayscope: interrupted; the table holds what was measured so far\n"
    assert [row["ratio"] for row in json.loads((tmp_path / "bench.json").read_text())["rows"]] == [2.0]
