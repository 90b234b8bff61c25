"""The stability report: what it measures is true, what it writes is whole, and a bad solver is caught."""
import csv
import math
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from commandline import ENVIRONMENT, one_line, process, run_here

import rtcore
from rtcore import Blob, Box, Cone, Cylinder, Implicit, Mesh, Plane, Polygon, Scale, Sphere, Torus, solvers
from rtcore.reports import measure, stability
from rtcore.reports.catalogue import CATALOGUE
from rtcore.reports.condition import FORMS, condition
from rtcore.reports.families import Batch, batches, families
from rtcore.reports.making import MAKERS
from rtcore.reports.oracle import TWINS, crossings, mp
from rtcore.reports.rows import COLUMNS, POINT_COLUMNS
from rtcore.reports.targets import TARGETS

HERE = np.eye(4)
TINY = stability.Size(6, 300, 16)


@pytest.fixture
def tiny(monkeypatch):
    """A report of a few rays."""
    monkeypatch.setattr(stability, "QUICK", TINY)


def measured(shapes):
    """The rows of a report made in this process."""
    return [row for step in stability.run(shapes, quick=True, workers=1) for row in step.rows]


def table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


# --- the oracle ---

@pytest.mark.parametrize(("shape", "origin", "direction", "roots"), [
    (Torus(1, 0.25), (1, -5, 0.25), (0, 1, 0), [5] * 4), (Torus(1, 0.25), (-5, 0.75, 0), (1, 0, 0), [4, 5, 5, 6]),
    (Torus(1, 0.25), (-5, 0, 0), (1, 0, 0), [3.75, 4.25, 5.75, 6.25]), (Torus(1, 1), (0, 0, -5), (0, 0, 1), [5] * 4),
    (Torus(0.8125, 0.9375), (0.4375, -0.375, 0.9375), (-0.5, -0.5, 0), [-0.75, -0.75, 0.875, 0.875]),
    (Cone((0.25, 0, 0), 0.375, (0.5, 1, 0.25)), (1.5, 2, 0.25), (-1, -1, 0), [1, 1]),
    (Torus(1, 0.25), (0, 0, -5), (0, 0, 1), []), (Blob((((0, 0, 0), 1, 1),), 1), (-5, 0, 0), (1, 0, 0), [5, 5]),
    (Sphere((0, 0, 0), 1), (0, 1, -5), (0, 0, 1), [5, 5]), (Sphere((0, 0, 0), 1), (1, 0, 0), (0, 1, 0), [0, 0])])
def test_multiple_roots_of_the_oracle(shape, origin, direction, roots):
    assert [float(c.t) for c in crossings(shape, HERE, origin, direction)] == roots


def test_the_oracle_knows_no_size():
    for size in (1e-25, 1e-6, 1e20):
        for shape, ray in ((Torus(size, size / 4), (-5, 0.1, 0.05)), (Blob((((0, 0, 0), size, 1),), 0.6), (-5, 0.1, 0.05))):
            found = crossings(shape, HERE, np.array(ray) * size, (1, 0, 0))
            again = crossings(shape, HERE, np.array(ray) * size, (1e-9, 0, 0))
            assert len(found) == len(again) > 0
            assert all(3.7 * size < c.t < 6.3 * size and abs(c.t * 10 ** 9 / d.t - 1) < 1e-15 for c, d in zip(found, again))


# --- the measure ---

def test_errors_are_counted_in_ulps_of_the_true_value():
    assert measure.ulps(1.0, mp.mpf(1), np.float64) == 0
    assert measure.ulps(1 + 2.0 ** -52, mp.mpf(1), np.float64) == 1
    assert measure.ulps(np.float32(4) + np.float32(2.0 ** -21), mp.mpf(4), np.float32) == 1
    assert measure.ulps(3.0, mp.mpf(3) + mp.mpf(2) ** -53, np.float64) == 0.25


def test_condition_of_a_root():
    """t = h / v of a plane: h and v each with a weight of 1. At a tangent, none is finite."""
    assert condition(Plane((0, 0, 0), (0, 0, 1)), HERE, (0, 0, 7), (0, 0, -2), mp.mpf(3.5)) == pytest.approx(2)
    # 1 of the height's inputs, h = 1e6 + 1 - 1e6
    plane = Plane((0, 0, 1e6), (0, 0, 1))
    assert condition(plane, HERE, (0, 0, 1e6 + 1), (0, 0, -1), mp.mpf(1)) == pytest.approx(2e6, rel=1e-3)
    assert condition(Sphere((0, 0, 0), 1), HERE, (0, 1, -5), (0, 0, 1), mp.mpf(5)) == math.inf


@pytest.mark.parametrize("shape", TARGETS, ids=lambda shape: shape.__name__)
def test_condition_is_the_sensitivity(shape):
    """No change of the inputs by 1e-12 moves a root by more than the condition allows, and some change moves it by a good part of that."""
    rng = np.random.default_rng(2)
    batch = next(batches("plain", shape, np.float64, 8, 1))
    true = [truth.t for truth in measure.truths(batch)]
    k = next(k for k, t in enumerate(true) if t is not None)
    o, d, t = batch.origins[k], batch.directions[k], true[k]
    allowed = condition(batch.shape, HERE, o, d, t) * 1e-12
    moved = []
    for _ in range(25):
        shift = iter(rng.choice([-1e-12, 1e-12], 2000))
        near = batch.shape.rounded(lambda x, shift=shift: x * (1 + next(shift))) if shape not in (Implicit, Mesh, Polygon) else batch.shape
        hits = crossings(near, HERE, o * (1 + rng.choice([-1e-12, 1e-12], 3)), d * (1 + rng.choice([-1e-12, 1e-12], 3)))
        moved.append(float(min((abs(c.t - t) for c in hits), default=0) / t))
    assert max(moved) <= allowed * 1.001 and max(moved) >= allowed / 50


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_a_family_is_the_same_each_time_and_of_the_precision(precision):
    dtype = {"f32": np.float32, "f64": np.float64}[precision]
    for family in families(Box):
        one, two = (list(batches(family, Box, dtype, 20, 7)) for _ in range(2))
        assert sum(len(b.origins) for b in one) > 5
        for a, b in zip(one, two):
            assert (a.shape, a.transform, a.size) == (b.shape, b.transform, b.size)
            assert (a.origins == b.origins).all() and (a.directions == b.directions).all()
            assert a.origins.dtype == a.directions.dtype == dtype and a.shape == a.shape.rounded(dtype)


def test_every_shape_has_what_the_report_needs():
    assert set(TARGETS) == set(MAKERS) == set(FORMS) <= set(TWINS)
    assert {"plain", "far", "grazing", "tiny", "huge", "scaled", "sheared", "nested", "surface"} <= set(families(Torus))
    assert "thin" not in families(Sphere) and "edges" in families(Cylinder) and "edges" not in families(Torus)
    assert set(CATALOGUE) <= set(TARGETS)


def test_the_targets_of_quadratics_and_the_torus():
    assert TARGETS[Sphere].words("f64", "far") == "2 ulp, 0 wrong" and TARGETS[Sphere].words("f32", "far") == "1 ulp, 0 wrong"
    assert TARGETS[Torus].words("f64", "far") == "4 ulp or 4 cond u, 0 wrong"
    assert TARGETS[Mesh].words("f64", "edges") == "2 ulp or 4 cond u" != TARGETS[Mesh].words("f64", "plain")


def test_the_textbook_is_shown_as_it_is():
    """The catalogue's row of the sphere holds the 5.8e7 ulp of the formula of school, and its NaN of a tangent that starts there."""
    rows = {row.solver: row for row in measure.measure(Sphere, "catalogue", "f64", 1, 0, 16)}
    assert set(rows) == set(solvers.names(Sphere))
    assert 5.7e7 < rows["textbook"].max_ulp < 5.9e7 and rows["textbook"].met is None
    assert rows["stable"].nonfinite > 0
    assert rows["renderer"].wrong == rows["renderer"].nonfinite == 0
    assert all(row.rays == len(CATALOGUE[Sphere]) and row.ns_per_ray > 0 for row in rows.values())


def test_another_crossing_is_wrong(monkeypatch):
    """The far wall in place of the near one is no error of some ulps."""
    batch = Batch(Sphere((0, 0, 0), 1), (), np.array([(0, 0, -5.0)] * 2), np.array([(0, 0, 1.0)] * 2), 1)
    monkeypatch.setattr(measure, "batches", lambda *_: [batch])
    monkeypatch.setattr(measure, "by_renderer", lambda *_: measure.Answer(np.array([6.0, 4.5]), np.full(2, True), np.full(2, False)))
    row = next(measure.measure(Sphere, "far", "f64", 2, 0, 16))
    assert (row.rays, row.wrong, row.met) == (2, 1, False) and row.max_ulp == pytest.approx(0.5 * 2 ** 50)
    assert "another crossing than the first (t = 6.0); true t 4.0" in row.worst[0].what


def test_rays_in_the_shapes_own_space():
    batch = Batch(Sphere((0, 0, 0), 1), (Scale((2, 4, 8)),), np.array([(2.0, 4, 8)]), np.array([(1.0, 1, 1)]), 1)
    assert measure.own_space(batch)[:, 0].tolist() == [1, 1, 1, 0.5, 0.25, 0.125]


# --- the report ---

def test_the_files(tmp_path, tiny):
    rows = measured(["plane", "triangle"])
    stability.write(rows, tmp_path / "new")
    lines = table(tmp_path / "new" / "stability.csv")
    assert len(lines) == len(rows) and tuple(lines[0]) == COLUMNS
    for shape in (Plane, rtcore.Triangle):
        mine = [line for line in lines if line["shape"] == shape.__name__.lower()]
        assert {line["solver"] for line in mine} == set(solvers.names(shape))
        assert {line["precision"] for line in mine} == {"f32", "f64"}
        assert {line["family"] for line in mine} >= {*families(shape), "any-hit", "leaving", "gap"}
        assert all((line["met"] in ("True", "False")) == (line["solver"] == "renderer") for line in mine)
    points = table(tmp_path / "new" / "stability.points.csv")
    assert tuple(points[0]) == POINT_COLUMNS
    assert all(math.isfinite(float(point[name])) for point in points for name in ("distance", "scale", "ulp"))
    text = (tmp_path / "new" / "stability.md").read_text()
    assert text.index("targets are met" if "targets are met" in text else "Every target is met") < text.index("## The worst rays")
    assert text.index("## The worst rays") < text.index("## Solvers") < text.index("## Plane")
    assert {path.name for path in (tmp_path / "new").iterdir()} == {"stability.csv", "stability.points.csv", "stability.md"}


def test_the_examples_run(tiny):
    rows = measured(["mesh", "sphere"])
    codes = [worst.code for row in rows for worst in row.worst[:1]]
    assert len(codes) > 40
    for code in codes:
        *first, last = code.split("\n")
        scope = {**vars(rtcore), "np": np}
        exec("\n".join(first), scope)
        assert len(eval(last, scope)) > 0


def test_a_bad_default_is_caught(tiny, monkeypatch):
    """A report whose renderer is the textbook's formula misses, and says by how much and where."""
    def textbook(batch, precision):
        return measure.by_solver(batch, "textbook")
    monkeypatch.setattr(measure, "by_renderer", textbook)
    rows = [row for job in stability.jobs(["sphere"], True, 0) if job.family in ("catalogue", "far") for row in stability.work(job)]
    missed = stability.misses(stability.in_order(rows))
    assert any(line.startswith("sphere f64 catalogue: 4 of ") and "5.81e+07 ulp (target 2 ulp, 0 wrong)" in line for line in missed)
    bad = next(row for row in rows if row.met is False and row.family == "catalogue" and row.precision == "f64")
    assert bad.worst[0].missed and bad.worst[0].ulp == math.inf and "not finite" in bad.worst[0].what


def test_a_shape_that_there_is_not():
    with pytest.raises(ValueError, match="expected a shape: sphere"):
        next(stability.run(["teapot"]))


def test_progress_in_a_process_of_its_own(tmp_path):
    ran = subprocess.run([sys.executable, "-m", "rtcore.reports.stability", str(tmp_path), "--quick", "--shape", "plane"],
                         capture_output=True, text=True, env=ENVIRONMENT, timeout=120)
    lines = [line.split(" ", 2) for line in ran.stdout.splitlines()]
    done = [int(line[0]) for line in lines]
    assert done[0] == 0 and done[-1] == int(lines[-1][1]) and done == sorted(done) and lines[-1][2].startswith("plane f")
    missed = [line for line in table(tmp_path / "stability.csv") if line["met"] == "False"]
    assert ran.returncode == (1 if missed else 0)
    assert ran.stderr.count("misses its target: plane") == len(missed) == ran.stderr.count("\n")


# --- the command ---

def test_the_command(tmp_path, capsys, tiny, monkeypatch):
    drawn = []
    monkeypatch.setattr("app.commands.stability._draw", drawn.append)
    code, out, err = run_here(capsys, ["stability", "-o", tmp_path / "report", "--shape", "plane", "--quick"])
    missed = [line for line in table(tmp_path / "report" / "stability.csv") if line["met"] == "False"]
    assert (code, out) == (1 if missed else 0, "") and drawn == [tmp_path / "report"]
    assert err.count("rayscope: misses its target: plane") == len(missed)


def test_the_command_refuses(tmp_path, capsys):
    code, out, err = run_here(capsys, ["stability", "-o", tmp_path, "--shape", "teapot"])
    assert (code, out) == (2, "") and one_line(err) and "expected one of sphere, plane" in err
    (tmp_path / "file").touch()
    code, out, err = run_here(capsys, ["stability", "-o", tmp_path / "file"])
    assert (code, out) == (2, "") and one_line(err) and "cannot be made" in err


def test_without_mpmath(tmp_path):
    program = ("import sys; sys.modules['mpmath'] = None\nfrom app.__main__ import main\n"
               f"sys.exit(main(['stability', '-o', {str(tmp_path)!r}, '--quick']))")
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=ENVIRONMENT, timeout=120)
    assert (ran.returncode, ran.stdout) == (1, "") and one_line(ran.stderr) and "pip install mpmath" in ran.stderr


def test_without_qt_there_are_tables(tmp_path, capsys, monkeypatch):
    import app
    from app.commands import stability as command
    monkeypatch.setitem(sys.modules, "app.plots", None)
    monkeypatch.delattr(app, "plots", raising=False)    # where another test has imported it already
    command._draw(tmp_path)
    assert "no plots, only tables" in capsys.readouterr().err


def test_interrupted(tmp_path):
    """Ctrl-C keeps what was measured so far."""
    running = process("stability", "-o", tmp_path, "--quick")
    time.sleep(8)
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=60)
    assert (running.returncode, out) == (130, "") and "interrupted" in err and "Traceback" not in err
    assert ("holds what was measured so far" in err) == (tmp_path / "stability.csv").exists()
    if (tmp_path / "stability.csv").exists():
        assert "Interrupted: only a part of it was measured." in (tmp_path / "stability.md").read_text()
