"""The command line: exit codes, one line on stderr for what is wrong, results where they were asked for, and no Qt."""
import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app import __main__ as cli
from app.commands import COMMANDS, _progress, _shared
from app.commands import render as render_command

ROOT = Path(__file__).parent.parent
BALL = """\
rayscope: 1
name: a ball
camera: {lookfrom: [0, 0, -5], lookat: [0, 0, 0]}
lights: [{directional: {direction: [0, -1, 1]}}]
scene:
  - sphere: {center: [0, 0, 0], radius: 1}
  - plane: {point: [0, -1, 0], normal: [0, 1, 0]}
"""


@pytest.fixture
def scene(tmp_path, monkeypatch) -> Path:
    """A small scene in the current folder."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "ball.yaml"
    path.write_text(BALL)
    return path


@pytest.fixture
def run(capsys):
    """Runs a command line in this process; returns exit code, stdout and stderr, which holds no traceback."""
    def run(*words):
        code = cli.main([str(word) for word in words])
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        return code, out, err
    return run


def process(*words, **options) -> subprocess.Popen:
    """A command line in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **options.pop("env", {})}
    return subprocess.Popen([sys.executable, "-m", "app", *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            env=environment, **options)


def picture(path) -> Image.Image:
    """A picture with all its pixels and text in memory, its file closed."""
    with Image.open(path) as found:
        found.load()
        return found


def one_line(err: str) -> bool:
    return err.count("\n") == 1 and err.endswith("\n") and err.startswith("rayscope")


# --- render ---

def test_render_writes_the_picture_and_nothing_to_stdout(scene, run):
    assert run("render", scene, "-o", "a.png", "--size", "32x24", "--spp", "2") == (0, "", "")
    found = picture("a.png")
    assert found.size == (32, 24) and found.text["Title"] == "a ball" and found.text["Samples"] == "2"
    assert np.asarray(found).max() > 50


def test_stats_are_those_of_the_contract(scene, run):
    assert run("render", scene, "-o", "a.png", "--size", "32x24", "--spp", 1, "--threads", 1, "--stats", "s.json")[0] == 0
    stats = json.loads(Path("s.json").read_text())
    assert set(stats) >= {"scene", "size", "samples_per_pixel", "precision", "threads", "rays", "seconds", "peak_memory_mib",
                          "nonfinite_pixels", "stages", "left_out", "error"}
    assert stats["scene"] == str(scene) and stats["size"] == [32, 24] and stats["samples_per_pixel"] == 1
    assert stats["precision"] == "f64" and stats["threads"] == 1 and stats["nonfinite_pixels"] == 0
    assert set(stats["rays"]) == {"primary", "primary_hits", "shadow", "shadow_hits", "reflection", "refraction"}
    assert stats["rays"]["primary"] == 32 * 24 and stats["rays"]["reflection"] == 0
    assert list(stats["seconds"]) == ["load", "prepare", "compile", "trace", "total"]
    assert 0 < stats["seconds"]["load"] < stats["seconds"]["total"] and stats["seconds"]["trace"] < stats["seconds"]["total"]
    assert all(set(item) == {"stage", "why"} for item in stats["left_out"]) and "rmse_estimate" in stats["error"]


def test_every_option_reaches_the_render(scene, run):
    Path("lit.yaml").write_text(BALL + "    material: {reflection: 0.5}\nfog: {density: 0.2}\n")
    run("render", "lit.yaml", "-o", "a.png", "--size", "16x16", "--spp", 1, "--stats", "all.json")
    run("render", "lit.yaml", "-o", "b.png", "--size", "16x16", "--spp", 1, "--no-shadows", "--no-fog", "--no-reflections",
        "--stats", "bare.json")
    full, bare = (json.loads(Path(name).read_text()) for name in ("all.json", "bare.json"))
    assert {"fog", "shadow rays", "reflected and refracted rays"} <= set(full["stages"]) - set(bare["stages"])
    assert full["rays"]["shadow"] > 0 == bare["rays"]["shadow"] and full["rays"]["reflection"] > 0 == bare["rays"]["reflection"]
    run("render", "lit.yaml", "-o", "a.png", "--size", "16x16", "--spp", 1, "--max-depth", 1, "--precision", "f32", "--stats", "flat.json")
    flat = json.loads(Path("flat.json").read_text())
    assert flat["precision"] == "f32" and flat["rays"]["reflection"] == 0


def test_a_view_and_a_seed_change_the_picture(scene, run):
    pictures = []
    for extra in ((), ("--seed", 7), ("--view", "depth")):
        assert run("render", scene, "-o", "a.png", "--size", "16x16", "--spp", 4, *extra)[0] == 0
        pictures.append(np.asarray(picture("a.png")))
    assert not any(np.array_equal(a, b) for a, b in zip(pictures, pictures[1:]))


def test_time_and_error_end_a_render(scene, run):
    start = time.monotonic()
    assert run("render", scene, "-o", "a.png", "--size", "64x64", "--time", 0.2, "--stats", "s.json")[0] == 0
    assert time.monotonic() - start < 30 and json.loads(Path("s.json").read_text())["samples_per_pixel"] >= 1
    assert run("render", scene, "-o", "a.png", "--size", "32x32", "--error", 0.1, "--stats", "s.json")[0] == 0
    stats = json.loads(Path("s.json").read_text())
    assert stats["samples_per_pixel"] < render_command.NO_END and stats["error"]["rmse_estimate"] <= 0.1


def test_a_mesh_file_renders_framed_and_lit(scene, run):
    Path("a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert run("render", "a.obj", "-o", "a.png", "--size", "32x24", "--spp", 1, "--stats", "s.json")[0] == 0
    assert json.loads(Path("s.json").read_text())["rays"]["primary_hits"] > 20


def test_stdout_and_stderr_are_quiet_where_there_is_no_terminal_and_rich_is_used_on_one(scene, run, monkeypatch):
    shown = []
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(_progress.Progress, "show", lambda self, share, doing="", left=None: shown.append(share))
    code, out, err = run("render", scene, "-o", "a.png", "--size", "64x64", "--spp", 8)
    assert code == 0 and out == "" and "a.png: 64 x 64, 8 samples per pixel" in err
    assert shown and all(0 <= share <= 1 for share in shown)


USAGE = [
    (("-o", "a.png", "--size", "640"), "argument --size: expected WIDTHxHEIGHT such as 640x480, got '640'"),
    (("-o", "a.png", "--size", "0x5"), "argument --size: expected a width and a height from 1 to 16384, got '0x5'"),
    (("-o", "a.png", "--size", "99999x5"), "argument --size: expected a width and a height from 1 to 16384, got '99999x5'"),
    (("-o", "a.png", "--size", "-1x5"), "argument --size: expected one argument"),
    (("-o", "a.png", "--spp", "0"), "argument --spp: expected a whole number from 1 to 1048576, got 0"),
    (("-o", "a.png", "--spp", "many"), "argument --spp: expected a whole number, got 'many'"),
    (("-o", "a.png", "--time", "nan"), "argument --time: expected a number greater than 0, got nan"),
    (("-o", "a.png", "--error", "0"), "argument --error: expected a number greater than 0, got 0.0"),
    (("-o", "a.png", "--spp", "1", "--time", "1"), "argument --time: not allowed with argument --spp"),
    (("-o", "a.png", "--precision", "f16"), "argument --precision: expected one of f64, f32, got 'f16'"),
    (("-o", "a.png", "--threads", "-2"), "argument --threads: expected a whole number from 0 to 1024, got -2"),
    (("-o", "a.png", "--max-depth", "0"), "argument --max-depth: expected a whole number from 1 to 64, got 0"),
    (("-o", "a.png", "--view", "beuaty"), "argument --view: expected one of beauty,"),
    (("-o", "a.png", "--sise", "1x1"), "unrecognized arguments: --sise 1x1"),
    ((), "the following arguments are required: -o/--output"),
]


@pytest.mark.parametrize(("words", "said"), USAGE)
def test_wrong_use_is_one_line_and_exit_code_2(scene, run, words, said):
    code, out, err = run("render", scene, *words)
    assert code == 2 and out == "" and one_line(err) and err.startswith(f"rayscope render: {said}")


PLACES = [
    (("-o", "a.jpg"), "a.jpg: expected a picture whose name ends in .png or .exr, got '.jpg'"),
    (("-o", "none/a.png"), "none/a.png: cannot be written: there is no folder none"),
    (("-o", "folder.png"), "folder.png: cannot be written: it is a folder"),
    (("-o", "a.png", "--stats", "none/s.json"), "none/s.json: cannot be written: there is no folder none"),
    (("-o", "a.png", "--stats", "a.png"), "a.png: expected another file for the stats than for the picture"),
    (("-o", "a.png", "--stats", "ball.yaml"), "ball.yaml: expected another file than the scene itself"),
]


@pytest.mark.parametrize(("words", "said"), PLACES)
def test_places_that_can_not_be_written_are_refused_before_the_work(scene, run, monkeypatch, words, said):
    monkeypatch.setattr(render_command, "trace", lambda *_: pytest.fail("rendered"))
    (scene.parent / "folder.png").mkdir()
    code, out, err = run("render", scene, *words)
    assert code == 2 and out == "" and err == f"rayscope: {said}\n" and scene.read_text() == BALL


def test_a_full_disk_leaves_the_old_picture_and_is_exit_code_1(scene, run, monkeypatch):
    Path("a.png").write_bytes(b"old")

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    monkeypatch.setattr(os, "fsync", full)
    code, _, err = run("render", scene, "-o", "a.png", "--size", "8x8", "--spp", 1)
    assert code == 1 and err == "rayscope: a.png: cannot be written: No space left on device\n" and Path("a.png").read_bytes() == b"old"


def test_a_picture_that_memory_can_not_hold_is_refused(scene, run, monkeypatch):
    monkeypatch.setattr(_shared, "memory", lambda: 1 << 30)
    code, _, err = run("render", scene, "-o", "a.png", "--size", "16384x16384")
    assert code == 1 and one_line(err) and "needs about 25.0 GiB of memory, and there are 1.0 GiB" in err


def test_what_memory_there_is():
    assert _shared.memory() is None or _shared.memory() > 1 << 26


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


# --- Ctrl-C ---

TELLING = """\
import sys
from app.__main__ import main
from rtcore.progressive import Renderer
silent = Renderer.frames
def frames(*args, **words):
    for frame in silent(*args, **words):
        print("a frame", file=sys.stderr, flush=True)
        yield frame
Renderer.frames = frames
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_ctrl_c_saves_what_there_is(scene):
    words = ("render", str(scene), "-o", "a.png", "--size", "200x200", "--spp", "60000", "--stats", "s.json")
    with subprocess.Popen([sys.executable, "-c", TELLING, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          env={**os.environ, "PYTHONPATH": str(ROOT)}) as running:
        assert running.stderr.readline() == "a frame\n"
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=60)
    said = err.replace("a frame\n", "")
    assert running.returncode == 130 and out == "" and one_line(said) and "a.png shows what was rendered so far" in said
    assert picture(scene.parent / "a.png").size == (200, 200)
    assert json.loads((scene.parent / "s.json").read_text())["rays"]["primary"] > 0


def test_ctrl_c_before_the_first_pixel_writes_nothing(scene, run, monkeypatch):
    from rtcore.progressive import Renderer

    def frames(self, request, cancelled, coarse):
        signal.raise_signal(signal.SIGINT)
        assert cancelled()
        return iter(())
    monkeypatch.setattr(Renderer, "frames", frames)
    code, out, err = run("render", scene, "-o", "a.png")
    assert (code, out, err) == (130, "", "rayscope: interrupted before there was anything to save\n") and not Path("a.png").exists()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_second_ctrl_c_ends_at_once():
    with render_command.interruptible() as interrupted:
        assert not interrupted()
        signal.raise_signal(signal.SIGINT)
        assert interrupted() and signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


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


def test_measuring_shares_leaves_the_tracer_as_it_was(scene, run):
    from rtcore import trace
    before = trace.Tracer.__init__, trace.cast, trace.shading.glow, trace.films.commit
    assert run("plan", scene)[0] == 0
    assert (trace.Tracer.__init__, trace.cast, trace.shading.glow, trace.films.commit) == before


def test_warm_compiles_what_a_scene_needs_and_no_more(scene, run, monkeypatch):
    from rtcore import warm
    compiled = []
    monkeypatch.setattr(warm, "missing", lambda scene, settings: ["core.f64", "sphere.f64"])
    monkeypatch.setattr(warm, "compile_kernels", lambda names, progress: compiled.extend(names))
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
                          env={**os.environ, "PYTHONPATH": str(ROOT)})
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
    assert code == 0 and err == "" and all(f"  {command.NAME} " in out for command in COMMANDS)
    assert run("--version")[0] == 0
    for command in COMMANDS:
        code, out, err = run(command.NAME, "--help")
        assert code == 0 and err == "" and f"usage: rayscope {command.NAME}" in out


def test_help_is_quick_to_come_by():
    code = ("import sys; from app.__main__ import main; main(['render', '--help'])\n"
            "assert not {'numba', 'numpy', 'PySide6'} & set(sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.DEVNULL).returncode == 0


def test_a_reader_of_stdout_that_goes_away_is_no_reason_for_a_traceback(scene):
    with process("check", scene) as running:
        running.stdout.close()
        assert running.stderr.read() == "" and running.wait(60) == 1


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_stdout_that_is_full_is_said(scene):
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-m", "app", "check", str(scene)], stdout=full, stderr=subprocess.PIPE, text=True,
                              env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert (done.returncode, done.stderr) == (1, "rayscope: stdout: No space left on device\n")


def test_a_name_that_is_no_text_does_no_harm(tmp_path):
    done = subprocess.run([sys.executable, "-m", "app", "check", b"n\xff\n.yaml"], cwd=tmp_path, capture_output=True,
                          env={**os.environ, "PYTHONPATH": str(ROOT)})
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


def test_kernels_that_are_missing_are_compiled_with_progress(scene, run, monkeypatch):
    from rtcore import warm
    told = []
    monkeypatch.setattr(warm, "missing", lambda scene, settings: ["core.f64"])

    def compile_kernels(names, progress=lambda *_: None):
        told.append(names)
        for done in (0, 1):
            progress(done, 1, "core.f64")
    monkeypatch.setattr(warm, "compile_kernels", compile_kernels)
    assert run("render", scene, "-o", "a.png", "--size", "8x8", "--spp", 1)[0] == 0 and told[0] == ["core.f64"]
