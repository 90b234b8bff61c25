"""The stability report: every shape, solver and precision on the catalogue of cases and on random families, against the oracle.

`run` measures, in processes beside this one, and tells how far it is; `write` makes `stability.csv`, `stability.points.csv` and
`stability.md` of the rows. `python -m rtcore.reports.stability DIR` does both in a process of its own and tells its progress, a line
"DONE TOTAL WHAT" each; its exit codes are those of `rayscope stability`.
"""
import argparse
import concurrent.futures
import csv
import io
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from rtcore.files import WriteError, write_file
from rtcore.flatten import DTYPES
from rtcore.reports.brute import brute
from rtcore.reports.families import families
from rtcore.reports.page import page
from rtcore.reports.rows import COLUMNS, POINT_COLUMNS, Row
from rtcore.reports.targets import TARGETS
from rtcore.shapes import Blob, Implicit, Torus

SHAPES = {shape.__name__.lower(): shape for shape in TARGETS}
MOST_WORKERS = 8


class Size(NamedTuple):
    """How much is done: rays of a family that go through the oracle, of a family that needs none, and on the clock."""

    rays: int
    brute: int
    timed: int


QUICK, FULL = Size(40, 12_000, 512), Size(1536, 1_000_000, 4096)
#: The oracle's milliseconds for a ray, where it is slow; and the share of rays that are left for it.
SLOW = {Torus: (6, 1 / 4), Blob: (14, 1 / 8), Implicit: (5, 1 / 4)}
RAY = 0.5           # milliseconds otherwise
BRUTE = 1e-3        # milliseconds a ray without the oracle, shapes thrown among them
MESH_FACTOR = 10    # times as many rays at the shared edges of meshes: 10⁷ in all, as those that leave the surfaces of all shapes


class Progress(NamedTuple):
    """Milliseconds of work done and in all, by estimate; what was measured last; its rows."""

    done: int
    total: int
    what: str
    rows: list[Row]


class Job(NamedTuple):
    """One family of one shape in one precision."""

    shape: str
    precision: str
    family: str
    seed: int
    rays: int
    timed: int          # 0: needs no oracle
    cost: int


def jobs(shapes: Iterable[str] | None, quick: bool, seed: int) -> list[Job]:
    """All that is to be measured, the longest first. Raises ValueError for a shape that there is not."""
    size, found = QUICK if quick else FULL, []
    for name in SHAPES if shapes is None else shapes:
        if name not in SHAPES:
            raise ValueError(f"expected a shape: {', '.join(SHAPES)}; got {name!r}")
        shape = SHAPES[name]
        cost, share = SLOW.get(shape, (RAY, 1))
        for precision in DTYPES:
            n = round(size.rays * share)
            found += [Job(name, precision, family, seed, n, size.timed, round(n * cost) + 50) for family in families(shape)]
            for family in brute(shape):
                n = size.brute * (MESH_FACTOR if family.startswith("shared edges:") else 1)
                found.append(Job(name, precision, family, seed, n, 0, round(n * BRUTE) + 100))
    return sorted(found, key=lambda job: -job.cost)


def work(job: Job) -> list[Row]:
    """The rows of one job."""
    shape = SHAPES[job.shape]
    if not job.timed:
        return brute(shape)[job.family](shape, job.precision, job.rays, job.seed)
    from rtcore.reports.measure import measure      # brings mpmath in
    return list(measure(shape, job.family, job.precision, job.rays, job.seed, job.timed))


def run(shapes: Iterable[str] | None = None, quick: bool = False, seed: int = 0, workers: int | None = None) -> Iterator[Progress]:
    """Measure: a step of progress after each family, and twice a second without rows.

    shapes: names as in SHAPES, all unless given. workers: processes, one a core unless given; 1 does the work in this process. Closing the
    iterator ends them. Raises ValueError for a shape that there is not, ModuleNotFoundError where mpmath is missing, at the first step.
    """
    todo = jobs(shapes, quick, seed)
    import rtcore.reports.oracle  # noqa: F401 -- says now, not in a process far away, that mpmath is missing
    done, total, what = 0, sum(job.cost for job in todo), "starting"
    yield Progress(done, total, what, [])
    workers = min(os.cpu_count() or 1, MOST_WORKERS) if workers is None else workers
    if workers <= 1:
        for job in todo:
            rows, done = work(job), done + job.cost
            yield Progress(done, total, _what(job), rows)
        return
    before = set(multiprocessing.active_children())
    with concurrent.futures.ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _follow) as pool:
        waiting = {pool.submit(work, job): job for job in todo}
        try:
            while waiting:
                ready, _ = concurrent.futures.wait(waiting, 0.5, concurrent.futures.FIRST_COMPLETED)
                if not ready:
                    yield Progress(done, total, what, [])
                for future in ready:
                    job = waiting.pop(future)
                    done, what = done + job.cost, _what(job)
                    yield Progress(done, total, what, future.result())
        finally:
            if waiting:
                pool.shutdown(wait=False, cancel_futures=True)
                for child in set(multiprocessing.active_children()) - before:
                    child.terminate()


def _what(job: Job) -> str:
    return f"{job.shape} {job.precision} {job.family}"


def _follow() -> None:
    """A worker leaves Ctrl-C to the process that started it, and ends when that has ended, however it did."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def end():
        multiprocessing.parent_process().join()
        os._exit(1)
    threading.Thread(target=end, daemon=True).start()


def misses(rows: Iterable[Row]) -> list[str]:
    """A line for each target that a default solver misses."""
    lines = []
    for row in rows:
        if row.met is False:
            found = [f"{row.wrong} of {row.rays} wrong"] * (row.wrong > 0) + [f"{row.nonfinite} not finite"] * (row.nonfinite > 0)
            found += [f"{row.max_ulp:.3g} ulp"] * (row.max_ulp == row.max_ulp)
            lines.append(f"{row.shape} {row.precision} {row.family}: {', '.join(found)} (target {row.target})")
    return lines


def in_order(rows: Iterable[Row]) -> list[Row]:
    """Rows by shape, precision, solver (the default first) and family."""
    place = {name: i for i, name in enumerate(SHAPES)}
    return sorted(rows, key=lambda row: (place[row.shape], row.precision, row.met is None, row.solver, row.family))


def write(rows: Iterable[Row], folder: str | os.PathLike, note: str = "") -> None:
    """Write the report's three files into a folder, which is made if there is none. WriteError if one can't be written."""
    rows, folder = in_order(rows), Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(folder, f"cannot be made: {error.strerror}") from None
    write_file(folder / "stability.csv", _csv(COLUMNS, ([_cell(getattr(row, name)) for name in COLUMNS] for row in rows)))
    points = ([*map(_cell, (row.shape, row.solver, row.precision, row.family, *point))] for row in rows for point in row.points)
    write_file(folder / "stability.points.csv", _csv(POINT_COLUMNS, points))
    write_file(folder / "stability.md", page(rows, misses(rows), note).encode())


def _csv(header: tuple, lines: Iterable[list]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(lines)
    return text.getvalue().encode()


def _cell(value) -> str:
    if value is None or value != value:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def main(argv: list[str] | None = None) -> int:
    """The helper process."""
    parser = argparse.ArgumentParser(prog="python -m rtcore.reports.stability", allow_abbrev=False)
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument("--shape", choices=SHAPES)
    parser.add_argument("--quick", action="store_true")
    args = parser.parse_args(argv)
    rows, told = [], -1
    try:
        for step in run([args.shape] if args.shape else None, args.quick):
            rows += step.rows
            if step.done > told:
                print(step.done, step.total, step.what, flush=True)
            told = step.done
        write(rows, args.folder)
    except (ModuleNotFoundError, WriteError) as error:
        print(f"rtcore.reports.stability: {error}", file=sys.stderr)
        return 1
    lines = misses(rows)
    for line in lines:
        print(f"rtcore.reports.stability: misses its target: {line}", file=sys.stderr)
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
