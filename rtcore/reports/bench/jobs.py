"""What is measured: one function a group of lines, each a generator of rows that works in a folder of its own."""
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rtcore.api import intersect, render
from rtcore.files import load, save
from rtcore.framing import framed
from rtcore.reports.bench import databases, meshes
from rtcore.reports.bench.povray import Untold, povray_text
from rtcore.reports.bench.rivals import DEPTH, RIVALS, Helper, environment, povray_seconds, tachyon_seconds
from rtcore.reports.bench.timing import Row, Target, alternate, row, seconds_of
from rtcore.scene import Scene

THREADS = 2
OURS = "ours"


class WorkFailed(Exception):
    """Our own work failed; in one line, how."""


@dataclass
class Bench:
    """What all jobs share: the rivals wanted and there, how much is done, the command that starts Rayscope, remarks for the reader."""

    against: tuple[str, ...]
    command: list[str]
    folder: Path
    quick: bool = False
    notes: list[str] = field(default_factory=list)

    @property
    def rounds(self) -> int:
        return 1 if self.quick else 5

    @property
    def side(self) -> int:
        """Of the pictures in pixels."""
        return 64 if self.quick else 512

    def note(self, line: str) -> None:
        """A remark, once."""
        if line not in self.notes:
            self.notes.append(line)

    def measure(self, what: str, runners: dict) -> dict[str, list[float]]:
        """`alternate`, with a remark on every rival that fails."""
        return alternate(runners, self.rounds, lambda name, why: self.note(f"{RIVALS[name].title} on {what}: {why}"))

    def row(self, work: str, unit: str, ours: list[float], rival: list[float] | None = None, name: str | None = None,
            target: Target | None = None) -> Row:
        return row(work, unit, ours, rival, name, target, judged=not self.quick)

    def render(self, scene: Path, *words: object) -> dict:
        """The stats of one `rayscope render` in a process of its own, with one sample a pixel."""
        stats = self.folder / "stats.json"
        self.run("render", scene, "-o", self.folder / "ours.png", "--spp", 1, "--stats", stats, *words)
        return json.loads(stats.read_text())

    def run(self, *words: object) -> None:
        """Run Rayscope with these arguments."""
        ran = subprocess.run([*self.command, *map(str, words)], capture_output=True, text=True, stdin=subprocess.DEVNULL, env=environment())
        if ran.returncode:
            raise WorkFailed(f"rayscope {words[0]} ended with code {ran.returncode}: {ran.stderr.strip()[-300:]}")

    def trace(self, scene: Path, *words: object) -> Callable[[], float]:
        """A runner: the seconds of tracing alone."""
        return lambda: self.render(scene, *words)["seconds"]["trace"]


# --- pictures ---

def picture(bench: Bench, name: str, path: Path, judged: bool) -> Iterator[Row]:
    """A scene at depth 5 on two threads, beside POV-Ray and Tachyon."""
    side = bench.side
    size = side, side
    runners = {OURS: bench.trace(path, "--size", f"{side}x{side}", "--max-depth", DEPTH, "--threads", THREADS)}
    if "povray" in bench.against:
        scene = load(path)
        written = bench.folder / f"{path.stem}.pov"
        try:
            written.write_text(povray_text(scene, framed(scene), size, DEPTH))
            runners["povray"] = lambda: povray_seconds(written, size, THREADS)
        except Untold as error:
            bench.note(f"POV-Ray is not given {name}: {error}")
    if "tachyon" in bench.against:
        if path.suffix.lower() == ".nff":
            runners["tachyon"] = lambda: tachyon_seconds(path.resolve(), size, THREADS, bench.folder)
            bench.note("Tachyon draws NFF files mirrored, at a wider angle and without refraction: that is what its times are of")
        else:
            bench.note(f"Tachyon is not given {name}: it is no NFF file")
    found = bench.measure(name, runners)
    ours, work = found.pop(OURS), f"{name}, {side} x {side}, depth {DEPTH}, {THREADS} threads"
    targets = {"povray": Target(5.0), "tachyon": Target(1.5)}
    for rival, theirs in found.items():
        yield bench.row(work, "s", ours, theirs, RIVALS[rival].title, targets[rival] if judged else None)
    if not found:
        yield bench.row(work, "s", ours)


def threads(bench: Bench, name: str, path: Path) -> Iterator[Row]:
    """Two threads against one."""
    words = "--size", f"{bench.side}x{bench.side}", "--max-depth", DEPTH, "--threads"
    found = bench.measure(name, {"two": bench.trace(path, *words, THREADS), "one": bench.trace(path, *words, 1)})
    yield bench.row(f"{name}: {THREADS} threads", "s", found["two"], found["one"], "1 thread", Target(1.8))


def flakes(bench: Bench) -> Iterator[Row]:
    """A sphereflake against one of a ninth of its spheres."""
    levels = (3, 4) if bench.quick else (5, 6)
    few, many = (bench.folder / f"flake{level}.nff" for level in levels)
    counts = [(9 ** level - 1) // 8 for level in levels]
    for level, path in zip(levels, (few, many)):
        path.write_text(databases.sphereflake(level))
    words = "--size", f"{bench.side}x{bench.side}", "--max-depth", DEPTH, "--threads", THREADS
    found = bench.measure("sphereflakes", {"many": bench.trace(many, *words), "few": bench.trace(few, *words)})
    yield bench.row(f"sphereflake of {counts[1]:,} spheres", "s", found["many"], found["few"], f"of {counts[0]:,}",
                    Target(1 / 1.6))


def gallery(bench: Bench, name: str, path: Path) -> Iterator[Row]:
    """A scene of the gallery in this process: tracing alone."""
    scene = load(path)

    def trace() -> float:
        return render(scene, (bench.side, bench.side), max_depth=DEPTH, threads=THREADS).stats["seconds"]["trace"]
    found = bench.measure(name, {OURS: trace})
    yield bench.row(f"gallery: {name}, {bench.side} x {bench.side}, depth {DEPTH}, {THREADS} threads", "s", found[OURS])


# --- a mesh ---

def rays(bench: Bench, name: str, mesh: meshes.Triangles) -> Iterator[Row]:
    """Distances along rays against Embree: primary ones in the order of tiles, and random ones inside the mesh's box; one thread."""
    scene, count = mesh.scene(), 1 << (12 if bench.quick else 20)
    sets = {"primary": meshes.primary(meshes.filling(mesh), count), "random": meshes.scattered(mesh, count)}
    file = bench.folder / "rays.npz"
    meshes.save_rays(file, mesh, sets)
    helper = Helper("rtcore.reports.bench.embree_process", file) if "embree" in bench.against else None
    targets = {("primary", "f32"): Target(1.8), ("primary", "f64"): Target(1.3), ("random", "f32"): Target(1.0)}
    try:
        for kind, (origins, directions) in sets.items():
            million = len(origins) / 1e6
            runners = {}
            for precision, dtype in (("f32", "float32"), ("f64", "float64")):
                runners[precision] = _intersecting(scene, origins.astype(dtype), directions.astype(dtype), precision)
            if helper is not None:
                runners["embree"] = lambda kind=kind: helper.ask(kind)
            found = bench.measure(f"{kind} rays", runners)
            rates = {key: [million / seconds for seconds in runs] for key, runs in found.items()}
            if "embree" in found:
                share = meshes.differing(scene, origins, directions, np.load(file.with_name(f"{kind}.npy")))
                bench.note(f"Embree and we answer {share:.4%} of the {kind} rays differently")
            for precision in ("f32", "f64"):
                work = f"{name}: {len(origins):,} {kind} rays, {precision}, 1 thread"
                yield bench.row(work, "Mrays/s", rates[precision], rates.get("embree"), "Embree" if "embree" in rates else None,
                                targets.get((kind, precision)))
    finally:
        if helper is not None:
            helper.close()


def _intersecting(scene: Scene, origins, directions, precision: str) -> Callable[[], float]:
    return lambda: seconds_of(lambda: intersect(scene, origins, directions, precision=precision, threads=1))


def direct(bench: Bench, name: str, mesh: meshes.Triangles) -> Iterator[Row]:
    """Direct light with shadows on a mesh, one sample a pixel, against Mitsuba."""
    side = 64 if bench.quick else 1024
    camera = meshes.filling(mesh)
    light = meshes.lamp(camera)
    surface, path, told = bench.folder / "mesh.ply", bench.folder / "direct.yaml", bench.folder / "direct.json"
    surface.write_bytes(mesh.ply())
    shapes = tuple(leaf.shape for leaf in load(surface).leaves())
    save(Scene(objects=shapes, camera=camera, lights=(light,)), path)
    told.write_text(json.dumps({
        "mesh": str(surface), "size": (side, side), "threads": THREADS, "light": light.position, "intensity": light.intensity,
        "fov": camera.fov, "lookfrom": camera.lookfrom, "lookat": camera.lookat, "up": camera.up}))
    helper = Helper("rtcore.reports.bench.mitsuba_process", told) if "mitsuba" in bench.against else None
    try:
        runners = {OURS: bench.trace(path, "--size", f"{side}x{side}", "--threads", THREADS)}
        if helper is not None:
            runners["mitsuba"] = lambda: helper.ask("render")
        found = bench.measure("direct light", runners)
        work = f"{name}: direct light and shadows, {side} x {side}, 1 sample, {THREADS} threads"
        theirs = found.get("mitsuba")
        yield bench.row(work, "s", found[OURS], theirs, "Mitsuba scalar_rgb" if theirs else None, Target(3.0))
    finally:
        if helper is not None:
            helper.close()


def build(bench: Bench) -> Iterator[Row]:
    """A million triangles from a file: seconds of the build, and the most memory that the whole process held."""
    levels, side = (5, 33) if bench.quick else (10, 708)
    height = databases.heights(levels)[:side + 1, :side + 1]
    mesh = meshes.Triangles(*databases.ground(height))
    path = bench.folder / "million.ply"
    path.write_bytes(mesh.ply())
    seconds, memory = [], []
    for turn in range(bench.rounds + 1):
        stats = bench.render(path, "--size", "64x64", "--threads", THREADS)
        if turn:
            seconds.append(stats["seconds"]["prepare"])
            memory.append(stats["peak_memory_mib"])
    yield bench.row(f"{len(mesh.faces):,} triangles: build", "s", seconds, target=Target(most=3.0))
    if None not in memory:
        yield bench.row(f"{len(mesh.faces):,} triangles: peak memory of the process", "MiB", memory,
                        target=Target(most=700.0))


def start(bench: Bench) -> Iterator[Row]:
    """The whole process of a small render, nothing left to compile, against Python importing numpy and numba."""
    path = bench.folder / "small.nff"
    path.write_text(databases.sphereflake(2))
    picture = "render", path, "-o", bench.folder / "small.png", "--size", "320x240"
    bare = [sys.executable, "-P", "-c", "import numpy, numba"]
    found = bench.measure("start-up", {
        OURS: lambda: seconds_of(lambda: bench.run(*picture)),
        "bare": lambda: seconds_of(lambda: subprocess.run(bare, check=True))})
    yield bench.row("rayscope render, 320 x 240, whole process", "s", found[OURS], found["bare"], "import numpy, numba",
                    Target(0.4))
