"""The command line: exit codes, one line on stderr for what is wrong, results on stdout, and no Qt."""
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from commandline import BALL, ENVIRONMENT, ROOT, one_line, picture, process

import rtcore
from app import __main__ as cli
from app.commands import COMMANDS, _progress, _shared
from app.commands import render as render_command


@pytest.mark.parametrize("command", ["render", "check", "plan", "warm"])
@pytest.mark.parametrize(("text", "said"), [
    (None, "cannot be read: No such file or directory"), ("", "expected a scene, got an empty file"),
    (BALL.replace("radius: 1", "radius: -1"), "line 6: scene[0].sphere.radius: expected a number greater than 0, got -1")])
def test_a_bad_scene_is_one_line_and_exit_code_2(scene, run, command, text, said):
    if text is not None:
        Path("bad.yaml").write_text(text)
    code, out, err = run(command, "bad.yaml", *(("-o", "a.png") if command == "render" else ()))
    assert (code, out, err) == (2, "", f"rayscope: bad.yaml: {said}\n") and not Path("a.png").exists()


@pytest.mark.parametrize("command", ["render", "check", "plan"])
def test_transforms_that_are_singular_only_together_are_the_files_fault(scene, run, command):
    tiny = "[{scale: 1e-200}]"
    box = "{low: [0, 0, 0], high: [1, 1, 1]}"
    Path("bad.yaml").write_text(BALL + f"  - transform: {tiny}\n    group: [{{transform: {tiny}, box: {box}}}]\n")
    code, out, err = run(command, "bad.yaml", *(("-o", "a.png", "--size", "8x8") if command == "render" else ()))
    assert code == 2 and out == "" and one_line(err) and err.startswith("rayscope: bad.yaml: scene[2][0]: expected ")


def test_ctrl_c_elsewhere_is_exit_code_130(scene, run, monkeypatch):
    monkeypatch.setattr(_shared, "loaded", None)
    import rtcore

    def interrupt(path):
        raise KeyboardInterrupt
    monkeypatch.setattr(rtcore, "load", interrupt)
    assert run("check", scene) == (130, "", "rayscope: interrupted; nothing was written\n")


# --- check, plan, warm ---

def test_check_says_what_is_there(scene, run):
    assert run("check", scene) == (0, f"{scene}: sound: 2 shapes, 1 light\n", "")


def test_plan_gives_reasons_and_shares(scene, run):
    code, out, err = run("plan", scene, "--json", "p.json")
    plan = json.loads(Path("p.json").read_text())
    assert code == 0 and err == "" and set(plan) == {"stages", "left_out", "kernels", "bytes"}
    shares = {stage["name"]: stage["share"] for stage in plan["stages"]}
    timed = {"primary rays", "hits: sphere", "hits: plane", "light: directional", "shadow rays", "film"}
    assert timed <= {stage for stage, share in shares.items() if share > 0}
    assert sum(shares.values()) == pytest.approx(1) and plan["bytes"] > 0 and plan["kernels"]
    left_out = {item["stage"]: item["why"] for item in plan["left_out"]}
    assert left_out["fog"] == "the scene has none" and all(stage in out and why in out for stage, why in left_out.items())
    assert all(name in out for name in shares)


def test_warm_compiles_what_a_scene_needs_and_no_more(scene, run, monkeypatch):
    from app.compiling import Compiler
    from rtcore import warm
    compiled = []
    monkeypatch.setattr(warm, "missing", lambda scene, settings: ["core.f64", "sphere.f64"])
    monkeypatch.setattr(Compiler, "compile", lambda self, names, progress: compiled.extend(names) or "")
    code, out, _ = run("warm", scene, scene)
    assert code == 0 and compiled == ["core.f64", "sphere.f64"] and out.startswith("2 kernel groups made ready in ")
    compiled.clear()
    assert run("warm")[0] == 0 and compiled == list(warm.ALL)
    monkeypatch.setattr(warm, "missing", lambda scene, settings: [])
    assert run("warm", scene) == (0, "every kernel needed is in the cache already\n", "")


def test_commands_never_import_qt(scene):
    code = ("import sys; from app.__main__ import main\n"
            "for words in (['check', 'ball.yaml'], ['plan', 'ball.yaml'], ['warm', 'ball.yaml'],\n"
            "              ['render', 'ball.yaml', '-oa.png', '--size', '8x8', '--spp', '1']):\n"
            "    assert main(words) == 0\n"
            "found = sorted(m for m in sys.modules if m.partition('.')[0] in ('PySide6', 'shiboken6', 'pyqtgraph'))\n"
            "assert not found, found")
    done = subprocess.run([sys.executable, "-c", code], cwd=scene.parent, capture_output=True, text=True,
                          env=ENVIRONMENT)
    assert done.returncode == 0, done.stderr


# --- the program as a whole ---

def test_without_a_display_the_scene_is_rendered_instead(scene, run, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(render_command, "SAMPLES", 1)
    code, out, err = run(scene)
    assert (code, out) == (0, "")
    assert err == f"rayscope: there is no display for the window; rendering {scene} to rayscope.png instead\n"
    assert picture("rayscope.png").size == (640, 480)
    code, _, err = run("none.yaml")
    assert code == 2 and err.endswith("rayscope: none.yaml: cannot be read: No such file or directory\n")


def test_without_a_display_and_a_scene_the_gallerys_first_is_rendered(scene, run, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    seen = []
    monkeypatch.setattr(render_command, "run", lambda args, parser: seen.append(args.scene) or 0)
    assert run()[0] == 0 and Path(seen[0]).name == "whitted.yaml" and Path(seen[0]).exists()


@pytest.mark.parametrize(("variable", "there"), [("DISPLAY", True), ("WAYLAND_DISPLAY", True), ("QT_QPA_PLATFORM", True), ("TERM", False)])
def test_what_counts_as_a_display(monkeypatch, variable, there):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv(variable, ":0")
    assert cli.has_display() is there
    monkeypatch.setattr(sys, "platform", "darwin")
    assert cli.has_display()


def test_a_command_misspelt_is_told_apart_from_a_scene(run):
    code, _, err = run("rendr")
    assert code == 2 and one_line(err) and "got 'rendr' (did you mean 'render'?)" in err


def test_help_and_version_are_results(run):
    code, out, err = run("--help")
    assert code == 0 and err == "" and all(f"  {command} " in out for command in COMMANDS)
    assert run("--version")[0] == 0
    for command in COMMANDS:
        code, out, err = run(command, "--help")
        assert code == 0 and err == "" and f"usage: rayscope {command}" in out


def test_help_is_quick_to_come_by():
    code = ("import sys; from app.__main__ import main; main(['render', '--help'])\n"
            "assert not {'numba', 'numpy', 'PySide6', 'app.commands.bench'} & set(sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.DEVNULL).returncode == 0


def test_a_reader_of_stdout_that_goes_away_is_no_reason_for_a_traceback(scene):
    with process("check", scene) as running:
        running.stdout.close()
        assert running.stderr.read() == "" and running.wait(60) == 1


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_stdout_that_is_full_is_said(scene):
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-m", "app", "check", str(scene)], stdout=full, stderr=subprocess.PIPE, text=True,
                              env=ENVIRONMENT)
    assert (done.returncode, done.stderr) == (1, "rayscope: stdout: No space left on device\n")


def test_a_name_that_is_no_text_does_no_harm(tmp_path):
    done = subprocess.run([sys.executable, "-m", "app", "check", b"n\xff\n.yaml"], cwd=tmp_path, capture_output=True,
                          env=ENVIRONMENT)
    assert done.returncode == 2 and done.stderr.count(b"\n") == 1 and b"Traceback" not in done.stderr


def test_progress_on_a_terminal_and_elsewhere(capsys, monkeypatch):
    monkeypatch.setattr(_progress, "EVERY", 0.0)
    with _progress.Progress("rendering") as bar:
        bar.show(0.5, "4 of 8 samples", left=75)
        bar.show(0.0)
    assert capsys.readouterr().err == "rendering: 4 of 8 samples, 50 %, 1 min 15 s left\nrendering, 0 %\n"
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with _progress.Progress("rendering") as bar:
        bar.show(0.5, "4 of 8 samples", left=7500)
        assert bar._bar.tasks[0].fields["left"] == "2 h 05 min left" and bar._bar.tasks[0].completed == 0.5


def test_triangles_without_area_are_counted(run, tmp_path):
    path = tmp_path / "flat.yaml"
    path.write_text("rayscope: 1\nscene: [{mesh: {vertices: [[0,0,0],[1,0,0],[0,1,0],[2,0,0]], faces: [[0,1,2],[0,1,3]]}}]\n")
    code, out, err = run("check", path)
    assert (code, err) == (0, "") and "1 degenerate triangle left out" in out
    stats = rtcore.render(rtcore.load(path), (8, 8)).stats
    assert {"stage": "degenerate triangles", "why": "1 without area"} in stats["left_out"]
