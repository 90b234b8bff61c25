"""`rayscope convergence`: tables and a plot of error against time, a reference of its own, and one line for what is wrong."""
import csv
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from commandline import one_line

import rtcore
from rtcore.progressive import Renderer
from rtcore.reports import calibration as calibration_table
from rtcore.reports import convergence
from rtcore.reports.convergence import Reference, Row
from rtcore.reports.convergence_page import calibration, fitted_slope, page, seconds_to
from rtcore.settings import Settings

SMALL = "--size", "32x24", "--reference-spp", 64, "--budget", 1


def test_the_report_has_its_files_and_columns(scene, run):
    assert run("convergence", scene, "-o", "out", *SMALL, "--methods", "uniform,adaptive+f32") == (0, "", "")
    with open("out/convergence.csv") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["method", "run", "seconds", "samples", "rmse", "relmse", "estimate"]
    assert {(row["method"], row["run"]) for row in rows} == {(m, r) for m in ("uniform", "adaptive+f32") for r in "01"}
    for row in rows:
        assert all(float(row[name]) >= 0 for name in ("seconds", "samples", "rmse", "relmse", "estimate"))
        assert 0.4 < float(row["estimate"]) / float(row["rmse"]) < 2.5
    first = [row for row in rows if (row["method"], row["run"]) == ("uniform", "0")]
    assert [float(row["samples"]) for row in first][:3] == [2, 4, 8]
    assert [float(row["seconds"]) for row in first] == sorted(float(row["seconds"]) for row in first)
    text = Path("out/convergence.md").read_text()
    assert "| uniform | 2 |" in text and "| adaptive+f32 | 2 |" in text and "MSE x time" in text and "ball.yaml" in text
    if sys.modules.get("app.curves"):
        assert Path("out/convergence.png").stat().st_size > 5000


def test_without_qt_there_are_tables_and_a_line(scene, run, monkeypatch):
    monkeypatch.setitem(sys.modules, "app.curves", None)
    monkeypatch.delattr("app.curves", raising=False)
    code, out, err = run("convergence", scene, "-o", "out", *SMALL, "--methods", "uniform")
    assert code == 0 and out == "" and one_line(err) and err.startswith("rayscope: no plot, only tables: ")
    assert Path("out/convergence.md").is_file() and not Path("out/convergence.png").exists()


WRONG = [(("--methods", "uniform,fast"), "argument --methods: expected some of uniform, adaptive, f32, f64, textbook, got 'fast'"),
         (("--methods", ""), "argument --methods: expected some of uniform, adaptive, f32, f64, textbook, got ''"),
         (("--reference-spp", 4), "argument --reference-spp: expected a whole number from 8 to 1048576, got 4"),
         (("--budget", 0), "argument --budget: expected a number greater than 0, got 0.0"),
         (("--budget", "nan"), "argument --budget: expected a number greater than 0, got nan"),
         (("--size", "0x9"), "argument --size: expected a width and a height from 1 to 16384, got '0x9'")]


@pytest.mark.parametrize(("words", "said"), WRONG)
def test_wrong_use_is_one_line_and_exit_code_2(scene, run, words, said):
    code, out, err = run("convergence", scene, "-o", "out", *words)
    assert code == 2 and out == "" and one_line(err) and err.startswith(f"rayscope convergence: {said}")
    assert not Path("out").exists()


def test_a_folder_that_is_a_file_is_refused(scene, run):
    code, out, err = run("convergence", scene, "-o", scene)
    assert code == 2 and out == "" and one_line(err)


def test_a_picture_without_error_is_told_of(tmp_path, run, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("flat.yaml").write_text("rayscope: 1\ncamera: {lookfrom: [0, 0, 5]}\nbackground: {color: [0.2, 0.3, 0.4]}\nlights: []\n"
                                 "scene: []\n")
    assert run("convergence", "flat.yaml", "-o", "out", *SMALL) == (0, "", "")
    assert "| uniform | 2 | 64 |" in Path("out/convergence.md").read_text()


def test_the_reference_is_independent_and_right(scene):
    loaded = rtcore.load(scene)
    renderer, settings = Renderer(), Settings(size=(32, 24))
    *_, step = convergence.refer(renderer, loaded, loaded.camera, settings, 64)
    renderer.close()
    reference = step.reference
    assert reference.samples == 64 and step.share == 1
    same = rtcore.render(loaded, (32, 24), 16, seed=convergence.REFERENCE_SEED).pixels
    assert (reference.pixels != same).any()
    exact = rtcore.render(loaded, (32, 24), 4096).pixels
    true = float(np.sqrt(np.square(reference.pixels - exact).mean()))
    assert 0.6 < reference.error / true < 1.6


def test_the_errors_own_share_of_the_reference_is_taken_out():
    random = np.random.default_rng(0)
    truth = random.random((60, 80, 3))
    reference = Reference(truth + 0.01 * random.normal(size=truth.shape), 64, 0.01)
    assert reference.rmse(truth + 0.02 * random.normal(size=truth.shape)) == pytest.approx(0.02, rel=0.03)
    assert reference.rmse(reference.pixels) == 0
    assert reference.relmse(reference.pixels * 1.1) == pytest.approx(0.0085, rel=0.1)


def test_slope_time_and_calibration():
    seconds = np.array([1.0, 2, 4, 8])
    assert fitted_slope(seconds, 3 * seconds ** -0.75) == pytest.approx(-0.75)
    assert fitted_slope(seconds[:2], seconds[:2]) is None and fitted_slope(seconds, np.zeros(4)) is None
    assert seconds_to(seconds, 1 / seconds, 1 / 3) == pytest.approx(3) and seconds_to(seconds, 1 / seconds, 2) == 1
    assert seconds_to(seconds, 1 / seconds, 0.1) is None
    rows = [Row("uniform", 0, s, s, 1 / s, 1 / s, f / s) for s, f in zip(seconds, (1, 1, 1, 2))]
    mean, worst = calibration(rows)
    assert mean == pytest.approx(2 ** 0.25) and worst == pytest.approx(2) and all(map(math.isnan, calibration([])))
    text = page(rows, Reference(np.zeros((6, 8, 3)), 64, 1e-3), "x")
    assert "| uniform | 1 | 8 | 8 | 0.125 | 0.188 | -1.00 | 1.19 | 2.00 | 8 |" in text and "rmse 0.125 is that of 8 uniform samples" in text


def test_the_table_of_calibration(scene, capsys):
    assert calibration_table.main([str(scene), "--size", "32", "24", "--reference-spp", "256"]) == 0
    out, err = capsys.readouterr()
    name, rmse, ratio, share, samples = (cell.strip() for cell in out.splitlines()[2].strip("|").split("|"))
    assert err == "" and name == "ball" and 0 < float(rmse) < 0.1 and 0.6 < float(ratio) < 1.6
    assert share.startswith("x ") and 8 < float(samples) < 64
    assert calibration_table.main(["nowhere.yaml"]) == 2 and one_line(capsys.readouterr().err.replace("rtcore", "rayscope", 1))
