"""The benchmark as a whole: which lines there are to measure, their rows one after the other, and the machine they were measured on."""
import os
import platform
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from rtcore.files import load
from rtcore.progressive import cores
from rtcore.reports.bench import databases, jobs, meshes
from rtcore.reports.bench.rivals import RIVALS
from rtcore.reports.bench.timing import Row
from rtcore.scene import Scene


BUSY = 0.7      # load at which others are at work


class Step(NamedTuple):
    """How far the work is (0 .. 1), what comes next, and the rows and remarks that the work so far has brought."""

    share: float
    what: str
    rows: list[Row]
    notes: list[str]


class Job(NamedTuple):
    """Something to measure, and about how many seconds it takes."""

    what: str
    cost: float
    rows: Callable[[], Iterator[Row]]


def run(scenes: Iterable[str | os.PathLike], against: Iterable[str], command: list[str], gallery: Iterable[Path] = (),
        own_meshes: Iterable[Path] = (), quick: bool = False) -> Iterator[Step]:
    """Measure these scenes or, where there are none, scenes of our own, the gallery, start-up and build.

    against: names in RIVALS; those that are not installed are told in the notes. command: what starts Rayscope. own_meshes: the files that
    make up the mesh of our own. quick: tiny pictures and one round, to see that all of it works. Raises FileError for a scene that can't be
    taken, before anything is measured, and WorkFailed where a render of ours fails.
    """
    with tempfile.TemporaryDirectory(prefix="rayscope-bench-") as name:
        there = tuple(rival for rival in RIVALS if rival in against and RIVALS[rival].version() is not None)
        bench = jobs.Bench(there, command, Path(name), quick)
        for rival in RIVALS:
            if rival in against and rival not in there:
                bench.note(f"{RIVALS[rival].title} is not installed ({RIVALS[rival].install}): nothing is compared with it")
        if hasattr(os, "getloadavg") and os.getloadavg()[0] > BUSY:
            bench.note(f"the machine was busy when this began (load {os.getloadavg()[0]:.1f}): the figures are rough")
        scenes = [Path(scene) for scene in scenes]
        todo = list(_of_scenes(bench, scenes) if scenes else _of_our_own(bench, gallery, own_meshes))
        rows, done, total = [], 0.0, sum(job.cost for job in todo)
        for job in todo:
            yield Step(done / total, job.what, rows, bench.notes)
            for one in job.rows():
                rows.append(one)
                yield Step(done / total, job.what, rows, bench.notes)
            done += job.cost
        yield Step(1.0, "", rows, bench.notes)


def _of_scenes(bench: jobs.Bench, paths: list[Path]) -> Iterator[Job]:
    """The lines for scenes of the caller's: pictures, or for meshes rays and direct light; the first picture also tells the threads."""
    first = True
    for path in paths:
        scene = load(path)
        mesh = None if path.suffix.lower() == ".nff" else meshes.of_scene(scene)
        if mesh is not None:
            yield from _of_mesh(bench, path.stem, mesh)
            continue
        yield _picture(bench, path, path.suffix.lower() == ".nff")
        if first:
            yield _threads(bench, path)
            first = False


def _of_our_own(bench: jobs.Bench, gallery: Iterable[Path], own_meshes: Iterable[Path]) -> Iterator[Job]:
    for database in databases.DATABASES:
        path = bench.folder / f"{database.name}.nff"
        path.write_text(database.make(database.levels - 2 if bench.quick else database.levels))
        yield _picture(bench, path, True)
        if database is databases.DATABASES[0]:
            yield _threads(bench, path)
    shapes = tuple(leaf.shape for path in own_meshes for leaf in load(path).leaves())
    if shapes:
        yield from _of_mesh(bench, "snail", meshes.of_scene(Scene(objects=shapes)))
    yield Job("start-up", 15, lambda: jobs.start(bench))
    yield Job("build", 25, lambda: jobs.build(bench))
    yield Job("sphereflakes", 30, lambda: jobs.flakes(bench))
    for path in gallery:
        yield Job(path.stem, 3, lambda path=path: jobs.gallery(bench, path.stem, path))


def _picture(bench: jobs.Bench, path: Path, judged: bool) -> Job:
    return Job(path.stem, 30, lambda: jobs.picture(bench, path.stem, path, judged))


def _threads(bench: jobs.Bench, path: Path) -> Job:
    return Job(f"{path.stem}, threads", 25, lambda: jobs.threads(bench, path.stem, path))


def _of_mesh(bench: jobs.Bench, name: str, mesh: meshes.Triangles) -> Iterator[Job]:
    title = f"{name}, {len(mesh.faces):,} triangles"
    yield Job(f"rays through {name}", 40, lambda: jobs.rays(bench, title, mesh))
    yield Job(f"direct light on {name}", 20, lambda: jobs.direct(bench, title, mesh))


def machine(against: Iterable[str] = ()) -> dict:
    """What the figures were measured on and with."""
    told = {"cpu": _processor(), "cores": cores(), "system": platform.platform(terse=True), "python": platform.python_version(),
            **{name: metadata.version(name) for name in ("numpy", "numba", "llvmlite")}}
    if hasattr(os, "getloadavg"):
        told["load"] = round(os.getloadavg()[0], 2)
    return {**told, **{name: RIVALS[name].version() for name in RIVALS if name in against}}


def _processor() -> str:
    """The processor's name, as the system tells it."""
    try:
        found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        found = None
    return found[1] if found else platform.processor() or platform.machine()


def as_data(rows: Iterable[Row], notes: list[str], told: dict) -> dict:
    """The report as what its JSON file holds."""
    plain = [{**one._asdict(), "target": one.target.words(one.unit) if one.target else None} for one in rows]
    return {"machine": told, "rows": plain, "notes": notes}
