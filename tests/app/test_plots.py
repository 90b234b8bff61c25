"""The report read back, and its plots: what is in them and that they say it legibly."""
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyqtgraph as pg
import pytest
import stand_in
from PIL import Image

from app import plots
from app.report import ReportError, binned, read
from app.theme import DARK, LIGHT


@pytest.fixture
def folder(tmp_path) -> Path:
    """A report on two shapes."""
    stand_in.write(tmp_path, ["sphere", "torus"])
    return tmp_path


def test_a_report_is_read_back(folder):
    report = read(folder)
    assert report.shapes == ["sphere", "torus"] and report.solvers("torus") == ["renderer", "ferrari", "sturm", "companion"]
    assert len(report.rows) == (3 + 4) * 2 * 6 and report.points["sphere", "stable", "f32"].shape == (360, 3)
    own = [row for row in report.rows if row.solver == "renderer"]
    assert all(row.met in (True, False) and row.target for row in own)
    assert all(row.met is None for row in report.rows if row.solver != "renderer")


def test_the_worst_come_first(folder):
    report = read(folder)
    worst = report.worst(len(report.rows))
    missed = [row.met is False for row in worst]
    assert sorted(missed, reverse=True) == missed and any(missed)
    others = [row for row in worst if not row.target]
    assert others[0].failures == max(row.failures for row in others)


def test_numbers_that_are_not_there_are_nan(folder):
    lines = (folder / "stability.csv").read_text().splitlines()
    (folder / "stability.csv").write_text("\n".join([lines[0], "sphere,renderer,f64,any-hit,100,0,,nan,,0,,0 wrong,True"]) + "\n")
    row = read(folder).rows[0]
    assert math.isnan(row.p50) and math.isnan(row.p99) and math.isnan(row.ns_per_ray) and row.met is True
    plots.work_precision(read(folder), "sphere", plots.PRINTED).deleteLater()       # nothing to draw is no error


@pytest.mark.parametrize(("content", "said"), [
    (None, "stability.csv: no such file"), ("shape,solver\nsphere,stable\n", "stability.csv: expected the columns"),
    ("shape,solver,precision,family,rays,wrong,p50,p99,max_ulp,nonfinite,ns_per_ray,target,met\na,b,c,d,e,f,g,h,i,j,k,l,m\n",
     "stability.csv: expected the columns")])
def test_a_report_that_cannot_be_read_is_told_of_in_one_line(tmp_path, content, said):
    if content is not None:
        (tmp_path / "stability.csv").write_text(content)
    with pytest.raises(ReportError, match=said) as error:
        read(tmp_path)
    assert "\n" not in str(error.value) and str(tmp_path) in str(error.value)


def test_bins_hold_median_and_maximum():
    x = np.array([0.1, 0.2, 0.9, 3.6, 3.7, math.nan, 3.8, 1.5])
    y = np.array([1.0, 5.0, 3.0, 7.0, 9.0, 2.0, math.inf, 4.0])
    middles, medians, maxima = binned(x, y)
    assert middles.tolist() == [0.5, 1.5, 2.5, 3.5] and maxima.tolist() == [5, 4, -math.inf, 9]
    assert np.array_equal(medians, [3, math.nan, math.nan, 8], equal_nan=True)
    assert all(len(part) == 0 for part in binned(np.empty(0), np.empty(0)))


def test_labels_are_moved_apart():
    assert plots.apart([1.0, 1.05, 5.0, 0.9], 0.2) == pytest.approx([1.1, 1.3, 5.0, 0.9])


def written(figure) -> list[str]:
    return [item.toPlainText() for item in figure.scene().items() if isinstance(item, pg.TextItem)]


@pytest.mark.parametrize("style", [plots.PRINTED, plots.on_screen(LIGHT), plots.on_screen(DARK)])
def test_every_solver_has_its_name_at_its_curve(qapp, folder, style):
    report = read(folder)
    for draw in plots.FIGURES.values():
        figure = draw(report, "torus", style)
        assert set(report.solvers("torus")) <= set(written(figure))
        figure.deleteLater()


def test_wrong_hits_are_marked_open_at_the_upper_edge(qapp, folder):
    figure = plots.work_precision(read(folder), "torus", plots.PRINTED)
    assert "ferrari: 18 of 360 in float32, 18 of 360 in float64" in written(figure)
    plot = figure.getItem(2, 0)
    failed = [item for item in plot.listDataItems() if item.opts["symbol"] and item.opts["symbolBrush"] is None]
    others = [item.getData()[1] for item in plot.listDataItems() if item not in failed]
    assert len(failed) == 1 and list(failed[0].opts["symbol"]) == ["s", "o"]
    assert np.max(np.concatenate(others)) < failed[0].getData()[1].min() and failed[0].getData()[1].max() < plot.viewRange()[1][1]
    figure.deleteLater()


def test_errors_beyond_all_digits_and_sizes_beyond_all_scenes_do_not_squeeze_the_rest(qapp, folder):
    report = read(folder)
    report.points["sphere", "stable", "f32"][:3] = (1e200, 1e-200, 1.0), (10.0, 1.0, 1e30), (20.0, 1.0, math.inf)
    for what in ("distance", "scale"):
        plot = plots.error_against(report, "sphere", what).getItem(2, 0)
        (left, right), (low, high) = plot.viewRange()
        assert -14 < left < right < 20 and low < plots.FLOOR and high < 8
    row = report.rows[0]._replace(p99=1e40)
    assert plots.height_of(row) == plots.CEILING[row.precision] and plots.height_of(row._replace(p99=0.0)) == plots.FLOOR


def test_axes_have_powers_of_ten(qapp):
    axis = plots.Decades("left")
    (_, labelled), (_, between) = axis.tickValues(-1.3, 7.2, 900)
    assert labelled == [-1, 0, 1, 2, 3, 4, 5, 6, 7] and any(abs(x - math.log10(2)) < 1e-9 for x in between)
    assert axis.tickStrings([-1.0, 0.0, 12.0], 1, 1) == ["10⁻¹", "10⁰", "10¹²"]
    (_, labelled), _ = axis.tickValues(1.6, 2.8, 900)
    assert axis.tickStrings(labelled, 1, 1) == ["50", "100", "200", "500"] and axis.tickStrings([0.0, 8.0], 1, 1) == ["10⁰", "10⁸"]
    (_, labelled), _ = axis.tickValues(-12, 12, 300)
    assert 3 <= len(labelled) <= 7


def test_files_are_written_without_a_display(folder):
    ran = subprocess.run([sys.executable, "-m", "app.plots", folder], capture_output=True, text=True, timeout=120,
                         cwd=Path(plots.__file__).parent.parent)
    assert (ran.returncode, ran.stderr) == (0, "")
    names = {f"stability-{shape}-{plot}.png" for shape in ("sphere", "torus") for plot in ("work-precision", "distance", "scale")}
    assert set(ran.stdout.split()) == {str(folder / name) for name in names} == set(map(str, folder.glob("*.png")))
    for name in names:
        with Image.open(folder / name) as image:
            pixels = np.asarray(image.convert("RGB")).astype(int)
        assert image.size == plots.SIZE and (pixels[0, 0] == 255).all()
        for color in plots.ON_LIGHT[:3]:        # a curve each
            rgb = [int(color[i:i + 2], 16) for i in (1, 3, 5)]
            assert (np.abs(pixels - rgb).max(axis=-1) < 4).sum() > 300, (name, color)


def test_no_report_is_one_line(tmp_path, capsys):
    assert plots.main([str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith("app.plots: ") and plots.main([]) == 2
