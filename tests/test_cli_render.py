"""`rayscope render`: pictures and stats where they were asked for, one line for what is wrong, Ctrl-C saves what there is."""
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
from commandline import BALL, ENVIRONMENT, one_line, picture

from app.commands import _progress, _shared
from app.commands import render as render_command


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


def test_progress_toward_an_error_is_told_by_the_error(scene, run, monkeypatch):
    shown = []
    monkeypatch.setattr(_progress.Progress, "show", lambda self, share, doing="", left=None: shown.append((share, doing, left)))
    assert run("render", scene, "-o", "a.png", "--size", "160x120", "--error", 0.002)[0] == 0
    told = [one for one in shown if "until the error is 0.002" in one[1]]
    assert len(told) > 3 and all(0 <= share <= 1 for share, *_ in told) and told[-1][0] > 0.9
    assert all(left is None or left < 60 for *_, left in told)


def test_samples_are_adaptive_where_they_end_by_time_or_error_and_else_if_asked_for(scene, run):
    def samples(*words):
        assert run("render", scene, "-o", "a.png", "--size", "64x48", *words, "--stats", "s.json")[0] == 0
        return json.loads(Path("s.json").read_text())["samples"]
    assert samples("--spp", 16) == {"least": 16, "mean": 16, "most": 16}
    spread = samples("--spp", 16, "--adaptive")
    assert spread["least"] == 8 and spread["most"] > 32 and 15 < spread["mean"] <= 16
    assert samples("--error", 0.004)["most"] > 8 and len(set(samples("--error", 0.004, "--no-adaptive").values())) == 1


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
    (("-o", "a.png", "--filter", "lanczos"), "argument --filter: expected one of box, gaussian, mitchell"),
    (("-o", "a.png", "--solver", "newton"), "argument --solver: expected one of certain, textbook, got 'newton'"),
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
    assert code == 1 and one_line(err) and "needs about 35.0 GiB of memory, and there are 1.0 GiB" in err


def test_what_memory_there_is():
    assert _shared.memory() is None or _shared.memory() > 1 << 26


def test_kernels_that_are_missing_are_compiled_with_progress(scene, run, monkeypatch):
    from app import compiling
    from rtcore import warm
    told, shown = [], []
    monkeypatch.setattr(warm, "missing", lambda scene, settings: ["core.f64"])
    monkeypatch.setattr(_progress.Progress, "show", lambda self, share, doing="", left=None: shown.append((share, doing)))

    def compile_kernels(self, names, progress):
        told.append(names)
        progress(compiling.Compiling(0, 1, ("core.f64",)))
        return ""
    monkeypatch.setattr(compiling.Compiler, "compile", compile_kernels)
    assert run("render", scene, "-o", "a.png", "--size", "8x8", "--spp", 1)[0] == 0
    assert told == [["core.f64"]] and shown[0][0] == 0 and "core" in shown[0][1]


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
                          env=ENVIRONMENT) as running:
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
