"""Compile kernels ahead of time into the cache, and know which are there.

A kernel group is named by what it does and the precision, "sphere.f64", "core.f32". `python -m rtcore.warm NAME ...` compiles some in a
process of its own and tells its progress, a line "DONE TOTAL NAME" each. `python -m rtcore.warm -` compiles those whose names it is given,
a line each, and answers each with the same line: several such helpers share a list of groups.
"""
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from rtcore import adaptive, bvh, eye, film as films, filters, fog as fogs, gloss, jit, lens, recast, rows, shading, sorting
from rtcore.camera import Camera
from rtcore.flatten import DTYPES, flatten
from rtcore.keep import Memory, Recall
from rtcore.lights import SAMPLED, SHINE, UNNOTED, UNTOLD, Draw, Reach
from rtcore.plan import plan
from rtcore.scene import Background, Fog, Material, Node, Scene
from rtcore.scratch import Scratch
from rtcore.settings import Settings
from rtcore.shapes import KIND_MODULES, TEXTBOOK, kind_named
from rtcore.stages import COUNTS
from rtcore.todo import new_todo
from rtcore.trace import Tracer
from rtcore.wave import CLOSEST, NO_ANSWER, SURFACE_ROWS, find_kinds, new_beam, new_rays, new_wave


def _wave(dtype):
    """A wave of one 8 x 8 tile, cast."""
    wave, target = new_wave(64, dtype), np.empty(64, np.int32)
    n = eye.cast(wave, target, Camera().rays(8, 8), np.array([0, 0, 8, 8, 1, 0, 8, 8], np.int64), 0, 0)
    return wave, target, n


def _look():
    return shading.make_look((), np.zeros(0, np.int32), np.zeros(3), Background(), (0, 1, 0))


def _core(dtype):
    wave, target, n = _wave(dtype)
    film, sample = films.new_film(8, 8), np.zeros((3, 64), np.float32)
    films.note_first_hits(film, wave, n, target)
    films.commit(film, sample, n, target)
    find_kinds(wave.rays.prim, n, np.zeros(0, np.int64), np.zeros(0, bool))
    _advance(dtype)
    pixels, node, distance = np.empty((8, 8, 3), np.float32), np.empty((8, 8), np.int32), np.empty((8, 8), np.float32)
    films.develop(film, np.zeros(0, np.int32), 8, 0, 8, 1, pixels, node, distance)


def _advance(dtype):
    scene, settings, camera = Scene(), Settings(view="depth", precision=_precision(dtype)), Camera()
    tracer = Tracer(flatten(scene, settings.precision), plan(scene, settings), settings, camera.rays(8, 8), None, camera.up, Background(),
                    None, True, False)
    tracer.trace(Scratch(dtype, True), films.new_film(8, 8), new_todo(np.array([[0, 0, 8, 8, 1, 0, 8, 8]])), range(1), lambda: False)


def _precision(dtype):
    return next(name for name, d in DTYPES.items() if d == dtype)


def _lens(dtype):
    wave, target, n = _wave(dtype)
    lens.bend(wave, n, target, np.ones(n, np.int32), Camera(aperture=1).lens(), 0)


def _filter(dtype):
    wave, target, n = _wave(dtype)
    one, signs = filters.made("mitchell"), np.empty(n, np.float32)
    filters.spread(wave, n, target, np.ones(n, np.int32), Camera().rays(8, 8), 8, one.place, one.sign, 0, signs)
    film = films.new_film(8, 8, signed=True)
    filters.commit(film, np.zeros((3, 64), np.float32), n, target, signs)
    filters.settled(film, one.gain)


def _glow(dtype):
    wave, _, n = _wave(dtype)
    shading.glow(wave, n, _look(), NO_ANSWER)
    films.deposit(wave, n, np.zeros((3, 64), np.float32), True)


def _doubt(dtype):
    wave, target, n = _wave(dtype)
    films.note_doubt(films.new_film(8, 8), wave, n, target, 0, 0)


def _samples(dtype):
    wave, target, _ = _wave(dtype)
    eye.cast_list(wave, target, np.empty(64, np.int32), Camera().rays(8, 8), 8, np.array([[p, 1, 2] for p in range(64)], np.int32), 0)
    films.rmse_estimate(films.new_film(8, 8))


def _screen(dtype):
    films.encode(np.empty((8, 8, 3), np.float32))


def _adaptive(dtype):
    adaptive.squared_errors(films.new_film(8, 8), 8, 8)


def _recast(dtype):
    film, pixels = films.new_film(8, 8, lit=True), np.zeros(0, np.int32)
    films.sources(film, 8, 8, 1, np.empty(64, np.int32))
    films.note_lit(film, new_beam(8, 1, dtype), 0, pixels, np.float32(1))
    recast.cast_again(new_rays(8, dtype), 0, Camera().rays(8, 8), 8, pixels, film)
    recast.note_places(new_rays(8, dtype), np.empty((SURFACE_ROWS, 8), dtype), 0, pixels, 0, 0, False, np.empty((0, 3), np.float32))
    recast.count_tests(bvh.EMPTY_TREE, 0, Camera().rays(8, 8), 8, pixels, film.distance, pixels)


def _leaf(dtype):
    bvh.build(np.zeros((1, 3)), np.ones((1, 3)), 2)


def _tree(dtype):
    low = np.arange(24.0).reshape(8, 3)
    bvh.build(low, low + 0.1, 2)


def _rows(dtype):
    rays, stretch, points, limit = new_rays(8, dtype), np.empty(8), np.ones((8, 3), dtype), np.ones(1)
    rows.take(points, points, limit, limit, rays, stretch)
    rows.give(rays, stretch, np.zeros(0, np.int32), points[:, 0].copy(), np.empty(8, np.int32))


def _lit(dtype):
    wave, _, n = _wave(dtype)
    shading.gather(wave, new_beam(n, 1, dtype), 0)


def _keep(dtype):
    wave, _, n = _wave(dtype)
    beam, recall, boxes = new_beam(n, 1, dtype), Recall([]), np.zeros((1, 6))
    films.note_lit(films.new_film(8, 8, lit=True), beam, 0, np.zeros(0, np.int32), np.float32(1))
    recall.hits(wave, n)
    recall.note_hits(wave, n)
    recall.note_rows(wave, n, [(0, 0)])
    recall.note_shadows(beam, (), 0, 0)
    whole = Recall(recall.kept())
    whole.hits(wave, n)
    whole.note_hits(wave, n)
    whole.rows(wave)
    memory = Memory()
    memory.tiles[b""] = recall.kept()
    memory.renumber(np.ones(0, np.int32), True, boxes)
    again = Recall(memory.tiles[b""])
    again.hits(wave, n)
    again.note_hits(wave, n)
    again.rows(wave)
    again.shadows(beam, (), 0, 0)


def _fog(dtype):
    wave, _, n = _wave(dtype)
    fogs.dim(wave, n, fogs.numbers(Fog()))


def _bounce(dtype):
    wave, _, n = _wave(dtype)
    shading.bounce(wave, n, _look(), new_wave(2 * n, dtype), np.zeros(len(COUNTS), np.int64))


def _sorting(dtype):
    (wave, _, n), room = _wave(dtype), new_wave(64, dtype)
    sorting.tell_hits(wave.rays, room, sorting.sort_rays(wave.rays, n, room))


def _gloss(dtype):
    wave, target, n = _wave(dtype)
    gloss.roughen(wave, new_wave(n, dtype), 0, _look(), target, target, target, target, 0)


def _light(kind):
    def compile_light(dtype):
        wave, target, n = _wave(dtype)
        draw = (Draw(target, target, 2, 0),) if kind in SAMPLED else ()
        SHINE[kind](wave, 0, np.zeros(4), np.zeros(3), new_beam(n, 1, dtype), 0, Reach(UNTOLD, UNNOTED, target, np.float32(1)), *draw)
    return compile_light


def _example(kind, dtype):
    return flatten(Scene(objects=[Node(shape=kind.example[0], transform=kind.example[1], material=Material())]), _precision(dtype))


def _kind(name):
    def compile_kind(dtype):
        kind, (wave, _, n) = kind_named(name), _wave(dtype)
        (group,) = _example(kind, dtype).groups
        kind.intersect(wave.rays, n, group.tree, group.table, 0, CLOSEST)
        kind.surface(wave.rays, n, wave.surface, group.table, 0)
    return compile_kind


def _textbook(name):
    def compile_textbook(dtype):
        kind, (wave, _, n) = kind_named(name), _wave(dtype)
        (group,) = _example(kind, dtype).groups
        kind.textbook(wave.rays, n, group.tree, group.table, 0, CLOSEST)
    return compile_textbook


#: Each group: the modules that its kernels are in, and how to compile it for a precision.
GROUPS: dict[str, tuple[tuple[str, ...], Callable]] = {
    "core": (("rtcore.eye", "rtcore.film", "rtcore.stages", "rtcore.wave"), _core), "glow": (("rtcore.film", "rtcore.shading"), _glow),
    "doubt": (("rtcore.film",), _doubt), "samples": (("rtcore.eye", "rtcore.film"), _samples), "screen": (("rtcore.film",), _screen),
    "leaf": (("rtcore.bvh",), _leaf), "tree": (("rtcore.bvh",), _tree), "lit": (("rtcore.shading",), _lit),
    "bounce": (("rtcore.shading",), _bounce), "lens": (("rtcore.lens",), _lens), "fog": (("rtcore.fog",), _fog),
    "rows": (("rtcore.rows",), _rows), "keep": (("rtcore.film", "rtcore.levels"), _keep), "gloss": (("rtcore.gloss",), _gloss),
    "sorting": (("rtcore.sorting",), _sorting),
    "filter": (("rtcore.filters",), _filter), "adaptive": (("rtcore.adaptive",), _adaptive),
    "recast": (("rtcore.film", "rtcore.recast"), _recast),
    **{f"light-{light.__name__.lower()}": ((light.__module__,), _light(light)) for light in SHINE},
    **{name: ((module,), _kind(name)) for name, module in KIND_MODULES.items()},
    **{f"textbook-{name}": (("rtcore.shapes._textbook",), _textbook(name)) for name in TEXTBOOK},
}
ALL = tuple(f"{name}.{precision}" for precision in DTYPES for name in GROUPS)


def _markers(name: str) -> list[Path]:
    """Files that say that a group is in the cache, one beside the kernels of each of its modules."""
    return [jit.cache_folder(module) / f"{name}.warm" for module in GROUPS[name.split(".")[0]][0]]


def missing(scene: Scene, settings: Settings, screen: bool = False, camera: Camera | None = None) -> list[str]:
    """Names of the kernel groups that this render needs and the cache lacks, and its way to the screen if wanted; from the scene's camera
    if none is given. Compiles nothing."""
    groups = ("screen", "keep") if screen else ()
    names = (*plan(scene, settings, camera=camera).kernels, *(f"{group}.{settings.precision}" for group in groups))
    return [name for name in names if not all(marker.exists() for marker in _markers(name))]


#: Seconds that compiling takes, by group, where it is long.
SLOW = {"implicit": 33, "blob": 30, "cone": 20, "torus": 17, "quadric": 10, "sphere": 9, "open-quadric": 8, "ellipsoid": 7, "core": 7,
        "tree": 5, "triangle": 4, "plane": 3, "samples": 2, "box": 2, "glow": 2}


#: Seconds for the code that kinds of shapes share, which every helper that compiles one has to compile first.
SHARED = 8


def queue(names: Iterable[str]) -> list[str]:
    """Groups in an order for several helpers, of which every other takes from the end: kinds of shapes in front, the longest first;
    everything else behind, the longest last; the default precision before the other."""
    def place(name: str) -> tuple:
        group, precision = name.split(".")
        seconds = SLOW.get(group, 0)
        return (0, precision == "f32", -seconds) if group in KIND_MODULES else (1, precision != "f32", seconds)
    return sorted(names, key=place)


def worth_sharing(names: Iterable[str]) -> bool:
    """Whether a helper that takes from the end should go on with what is left, or leave a few kinds of shapes to the others."""
    groups = [name.partition(".")[0] for name in names]
    return not KIND_MODULES.keys() >= set(groups) or sum(SLOW.get(group, 1) for group in groups) > SHARED


def compile_kernels(names: Iterable[str], progress: Callable[[int, int, str], None] = lambda done, total, name: None) -> None:
    """Compile these groups into the cache; `progress(done, total, name)` before each and, with done = total, at the end.

    Raises KeyError for a name that is not in ALL.
    """
    names, compiled = list(names), False
    for done, name in enumerate(names):
        group, precision = name.split(".")
        progress(done, len(names), name)
        GROUPS[group][1](DTYPES[precision])
        for marker in _markers(name):
            if not marker.exists():
                compiled = True
                marker.parent.mkdir(parents=True, exist_ok=True)
                marker.touch()
    progress(len(names), len(names), "")
    if compiled:
        jit.prune()


def main(names: list[str]) -> int:
    """The helper process: compile `names`, a line of progress each."""
    if names == ["-"]:
        for name in map(str.strip, sys.stdin):
            compile_kernels([name])
            print(name, flush=True)
        return 0
    unknown = [name for name in names if name not in ALL]
    if unknown:
        print(f"rtcore.warm: no kernels are called {', '.join(unknown)}", file=sys.stderr)
        return 2
    compile_kernels(names or ALL, lambda done, total, name: print(done, total, name, flush=True))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
