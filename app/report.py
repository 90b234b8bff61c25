"""What `rtcore.reports.stability` writes, read back for plots and tables: stability.csv and stability.points.csv."""
import csv
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROWS, POINTS = "stability.csv", "stability.points.csv"
NUMBERS = ("rays", "wrong", "p50", "p99", "max_ulp", "nonfinite", "ns_per_ray")


class ReportError(Exception):
    """A report that can't be read: one line that names the file."""


class Row(NamedTuple):
    """A solver of a shape, in one precision, against one family of rays. Errors in ulp; NaN where nothing was to be measured."""

    shape: str
    solver: str
    precision: str
    family: str
    rays: float
    wrong: float
    p50: float
    p99: float
    max_ulp: float
    nonfinite: float
    ns_per_ray: float
    target: str             # in words; empty for a solver without one
    met: bool | None

    @property
    def failures(self) -> float:
        """Rays that the solver got wrong altogether."""
        return self.wrong + self.nonfinite


class Report(NamedTuple):
    """All of a report. `points` by (shape, solver, precision): (n, 3) distance in radii, size in scene units, error in ulp."""

    rows: tuple[Row, ...]
    points: dict[tuple[str, str, str], np.ndarray]

    @property
    def shapes(self) -> list[str]:
        """Names of the shapes, in the report's order."""
        return list(dict.fromkeys(row.shape for row in self.rows))

    def solvers(self, shape: str) -> list[str]:
        """Names of a shape's solvers: those that have a target, which are the renderer's own, before the others."""
        rows = [row for row in self.rows if row.shape == shape]
        return list(dict.fromkeys(row.solver for row in sorted(rows, key=lambda row: row.target == "")))

    def worst(self, most: int = 100) -> list[Row]:
        """Rows to worry about first: targets missed, then wrong and not finite, then large errors of the renderer's own solvers."""
        def worry(row: Row):
            return row.met is not False, row.target == "", -row.failures, -(row.max_ulp if row.max_ulp == row.max_ulp else -1.0)
        return sorted(self.rows, key=worry)[:most]


def read(folder: Path) -> Report:
    """The report in a folder; ReportError if there is none or it can't be read."""
    try:
        with open(folder / ROWS, encoding="utf-8", newline="") as file:
            rows = tuple(_row(line) for line in csv.DictReader(file))
        found: dict[tuple[str, str, str], list] = {}
        with open(folder / POINTS, encoding="utf-8", newline="") as file:
            for line in csv.DictReader(file):
                numbers = [_number(line[name]) for name in ("distance", "scale", "ulp")]
                found.setdefault((line["shape"], line["solver"], line["precision"]), []).append(numbers)
    except OSError as error:
        raise ReportError(f"{error.filename}: {(error.strerror or 'unreadable').lower()}") from None
    except (KeyError, ValueError, TypeError, csv.Error) as error:
        raise ReportError(f"{folder / ROWS}: expected the columns of a stability report, got {error}") from None
    return Report(rows, {key: np.array(numbers) for key, numbers in found.items()})


def _row(line: dict[str, str]) -> Row:
    met = {"true": True, "false": False}.get(line["met"].lower())
    return Row(**{name: _number(line[name]) for name in NUMBERS}, met=met,
               **{name: line[name] for name in ("shape", "solver", "precision", "family", "target")})


def _number(text: str) -> float:
    return float(text) if text else math.nan


def binned(x: np.ndarray, y: np.ndarray, least: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middle, median and maximum of y in the decades of x, both (n,) and as logarithms to the base 10. A decade with fewer than `least`
    points has the median NaN, one without any the maximum -inf."""
    good = np.isfinite(x) & np.isfinite(y)
    decade = np.floor(x[good]).astype(int)
    bins = np.arange(decade.min(), decade.max() + 1) if decade.size else np.empty(0, int)
    inside = [y[good][decade == one] for one in bins]
    medians = [np.median(part) if len(part) >= least else math.nan for part in inside]
    return bins + 0.5, np.array(medians), np.array([part.max(initial=-math.inf) for part in inside])
