"""Stands in for `python -m rtcore.reports.stability OUTDIR [--quick] [--shape NAME]`: the same lines, the same files, nothing measured."""
import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np

ROWS = ("shape", "solver", "precision", "family", "rays", "wrong", "p50", "p99", "max_ulp", "nonfinite", "ns_per_ray", "target", "met")
POINTS = ("shape", "solver", "precision", "family", "distance", "scale", "ulp")
#: Per shape: solver, nanoseconds in float64, growth of its error with distance, share of wrong hits.
SOLVERS = {"sphere": (("renderer", 9.0, 0.0, 0), ("textbook", 4.0, 1.0, 0.02), ("stable", 5.0, 0.5, 0.004)),
           "torus": (("renderer", 160.0, 0.05, 0), ("ferrari", 90.0, 0.9, 0.05), ("sturm", 420.0, 0.2, 0), ("companion", 900.0, 0.3, 0))}
FAMILIES = ("far", "grazing", "tiny", "huge", "sheared", "on the surface")


def write(folder: Path, shapes: list[str], n: int = 60):
    """A report about these shapes."""
    dice, rows, points = np.random.default_rng(7), [], []
    for shape in shapes:
        for solver, time_, growth, wrong in SOLVERS[shape]:
            for precision, factor in (("f32", 0.6), ("f64", 1.0)):
                for family in FAMILIES:
                    distance, scale = 10 ** dice.uniform(0, 7, n), 10 ** dice.uniform(-6, 6, n)
                    ulp = np.abs(dice.normal(size=n)) * 0.4 * distance ** growth
                    points += [(shape, solver, precision, family, *point) for point in zip(distance, scale, ulp)]
                    target, met = ("2 ulp, 0 wrong", bool(ulp.max() < 1.5)) if solver == "renderer" else ("", "")
                    rows.append((shape, solver, precision, family, n, round(wrong * n), *np.percentile(ulp, (50, 99, 100)), 0,
                                 time_ * factor * dice.uniform(0.9, 1.3), target, met))
    for name, columns, lines in (("stability.csv", ROWS, rows), ("stability.points.csv", POINTS, points)):
        with open(folder / name, "w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([columns, *lines])
    (folder / "stability.md").write_text("# A report that measured nothing\n", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--shape", action="append")
    parser.add_argument("--pause", type=float, default=0.01)
    options = parser.parse_args()
    shapes = options.shape or list(SOLVERS)
    if unknown := set(shapes) - set(SOLVERS):
        print(f"stability: no such shape: {', '.join(unknown)}", file=sys.stderr)
        return 2
    total = 6 if options.quick else 30
    for done in range(total):
        print(done, total, f"{shapes[0]}, far, f64")
        time.sleep(options.pause)
    write(options.folder, shapes)
    print(total, total, "done")
    return 1        # a default solver misses a target


if __name__ == "__main__":
    sys.exit(main())
