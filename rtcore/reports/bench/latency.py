"""How soon the live picture answers: the loop that the window's render thread runs, without a window.

For a scene, in milliseconds: from a change of the view to the first picture, the same for steps of a drag, from the moment a pass is not
wanted any more to its end, and from each kind of edit to a picture of every pixel, with the eye's rays that were traced for it. All with
the bytes for the screen. The first of each is not counted: kernels are loaded then.
"""
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from rtcore import camera as moves, film as films
from rtcore.files import load
from rtcore.framing import framed
from rtcore.latest import leaves_of
from rtcore.lights import SHINE, STUDIO
from rtcore.progressive import Renderer, RenderRequest
from rtcore.scene import Background, Fog, Node, Scene
from rtcore.settings import Settings

SIZE = (1280, 720)
ANSWER, MOTION = 0.1, 1 / 30        # seconds to the first picture of a change, and to that of a step of a drag
KINDS = ("fog", "shadows", "reflections", "light", "move_light", "material", "background", "exposure", "view", "hide", "camera")

replace = msgspec.structs.replace


class Spread(NamedTuple):
    """Of some figures the middle one, and that which 95 of 100 do not pass."""

    p50: float
    p95: float


class Told(NamedTuple):
    """One scene's figures, in milliseconds."""

    name: str
    first_frame: Spread
    drag: Spread
    stale: Spread
    edits: dict[str, tuple[Spread, int]]    # by kind: how long, and the most eye's rays traced; without kinds that the scene has no use for


def spread(seconds: Iterable[float]) -> Spread:
    """Seconds as a spread of milliseconds."""
    return Spread(*(float(x) for x in np.percentile([1e3 * s for s in seconds], (50, 95))))


class Loop:
    """The live loop over one scene."""

    def __init__(self, scene: Scene, size: tuple[int, int]):
        self.renderer = Renderer(keep=True)
        self.scene, self.camera = scene, scene.camera or framed(scene, size[0] / size[1])
        self.settings = Settings(size=size, samples=16, adaptive=True)
        self.random = np.random.default_rng(0)
        self._bytes = np.empty((size[1], size[0], 4), np.uint8)
        self._encoders = ThreadPoolExecutor(2)

    def close(self) -> None:
        """End all threads."""
        self.renderer.close()
        self._encoders.shutdown()

    def _encode(self, pixels: np.ndarray) -> None:
        films.encode(pixels, self._bytes, share=self._encoders.map)

    def show(self, scene: Scene, camera, settings: Settings, deadline: float = ANSWER, whole: bool = True) -> tuple[float, int]:
        """Seconds until the first picture, or with `whole` the first of every pixel, is ready for the screen, and the eye's rays traced."""
        enough, start, before = threading.Event(), time.perf_counter(), self._primary()
        taken, rays = 0.0, 0
        for frame in self.renderer.frames(RenderRequest(scene, camera, settings), enough.is_set, deadline=deadline):
            self._encode(frame.pixels)
            if not whole or frame.samples:
                taken, rays = time.perf_counter() - start, frame.rays["primary"]
                enough.set()
        return taken, rays - (before if self.renderer.edits <= {"view", "samples"} and before <= rays else 0)

    def _primary(self) -> int:
        return self.renderer.stats()["rays"]["primary"] if self.renderer.progress else 0

    def moved(self):
        """Another view."""
        return moves.orbit(self.camera, *self.random.uniform(-0.1, 0.1, 2))

    def stale(self, delay: float) -> float:
        """Seconds from the moment when a picture is not wanted any more to the end of all work on it."""
        gone, moment = threading.Event(), []

        def end():
            moment.append(time.perf_counter())
            gone.set()
        timer = threading.Timer(delay, end)
        timer.start()
        for frame in self.renderer.frames(RenderRequest(self.scene, self.moved(), replace(self.settings, samples=4096)), gone.is_set,
                                          deadline=ANSWER):
            self._encode(frame.pixels)
        timer.join()
        return time.perf_counter() - moment[0]


def _node(scene: Scene) -> tuple[int, ...]:
    """The path to a shape somewhere in the middle, or to a use of a definition."""
    path, nodes = [], scene.objects
    while nodes:
        path.append(len(nodes) // 2)
        nodes = nodes[path[-1]].children
    return tuple(path)


def _with_node(scene: Scene, path: tuple[int, ...], **fields) -> Scene:
    """The scene with other fields of one node."""
    def within(nodes: tuple[Node, ...], path: tuple[int, ...]) -> tuple[Node, ...]:
        at, *rest = path
        changed = replace(nodes[at], children=within(nodes[at].children, rest)) if rest else replace(nodes[at], **fields)
        return (*nodes[:at], changed, *nodes[at + 1:])
    return replace(scene, objects=within(scene.objects, path))


def edits_of(scene: Scene, settings: Settings) -> dict[str, Callable[[int], tuple[Scene, Settings]]]:
    """By kind what the k-th edit makes of scene and settings; none of a kind that the scene has no use for."""
    lights = STUDIO if scene.lights is None else scene.lights
    fog = scene.fog or Fog()
    result: dict[str, Callable] = {
        "fog": lambda k: (replace(scene, fog=None if k % 2 else replace(fog, density=0.01 * (k + 1))), settings),
        "shadows": lambda k: (scene, replace(settings, shadows=k % 2 == 1)),
        "reflections": lambda k: (scene, replace(settings, reflections=k % 2 == 1)),
        "background": lambda k: (replace(scene, background=Background(color=(0.05 * k, 0.2, 0.3))), settings),
        "exposure": lambda k: (scene, settings),
        "view": lambda k: (scene, replace(settings, view="normal" if k % 2 == 0 else "beauty"))}
    if lights:
        result["light"] = lambda k: (replace(scene, lights=(*lights[:-1], replace(lights[-1], intensity=0.1 * (k + 1)))), settings)
    at = next((i for i, light in enumerate(lights) if type(light) in SHINE), None)
    if at is not None:
        field = next(name for name in ("position", "direction") if hasattr(lights[at], name))
        place = np.array(getattr(lights[at], field))

        def move(k: int) -> tuple[Scene, Settings]:
            nudged = replace(lights[at], **{field: tuple((place * (1 + 0.01 * (k + 1))).tolist())})
            if field == "direction":
                nudged = replace(lights[at], direction=tuple((place + 0.01 * (k + 1) * np.array((1, 0.3, -1))).tolist()))
            return replace(scene, lights=(*lights[:at], nudged, *lights[at + 1:])), settings
        result["move_light"] = move
    if scene.objects:
        path = _node(scene)
        material = next(leaf.material for leaf in leaves_of(scene) if leaf.path[:len(path)] == path)
        result["material"] = lambda k: (_with_node(scene, path, material=replace(material, color=(0.1 * (k % 10), 0.5, 0.5))), settings)
        result["hide"] = lambda k: (_with_node(scene, path, visible=k % 2 == 1), settings)
    return result


def measure(name: str, scene: Scene, size: tuple[int, int] = SIZE, rounds: int = 20) -> Told:
    """One scene's figures."""
    loop = Loop(scene, size)
    try:
        loop.show(scene, loop.camera, loop.settings)
        first = [loop.show(scene, loop.moved(), loop.settings, whole=False)[0] for _ in range(rounds + 1)][1:]
        drag = [loop.show(scene, loop.moved(), loop.settings, MOTION, whole=False)[0] for _ in range(rounds + 1)][1:]
        stale = [loop.stale(loop.random.uniform(0.005, 0.25)) for _ in range(rounds + 1)][1:]
        camera = [loop.show(scene, loop.moved(), loop.settings) for _ in range(max(rounds // 2, 1) + 1)][1:]
        loop.show(scene, loop.camera, loop.settings)
        edits, wanted = {}, edits_of(scene, loop.settings)
        for kind in KINDS[:-1]:
            if kind in wanted:
                loop.show(scene, loop.camera, loop.settings)
                shown = [loop.show(*_placed(loop, wanted[kind](k))) for k in range(max(rounds // 2, 1) + 2)][2:]
                edits[kind] = spread(taken for taken, _ in shown), max(rays for _, rays in shown)
        edits["camera"] = spread(taken for taken, _ in camera), max(rays for _, rays in camera)
        return Told(name, spread(first), spread(drag), spread(stale), edits)
    finally:
        loop.close()


def _placed(loop: Loop, edited: tuple[Scene, Settings]) -> tuple:
    scene, settings = edited
    return scene, loop.camera, settings


def run(paths: Iterable[Path], size: tuple[int, int] = SIZE, rounds: int = 20) -> Iterator[Told | str]:
    """For each scene its name, then its figures. Raises FileError for one that can't be read, before anything is measured."""
    scenes = [(Path(path).name, load(path)) for path in paths]
    for name, scene in scenes:
        yield name
        yield measure(name, scene, size, rounds)


def as_data(told: Iterable[Told], machine: dict) -> dict:
    """What the command writes."""
    def ms(figures: Spread) -> dict[str, float]:
        return {"p50": round(figures.p50, 2), "p95": round(figures.p95, 2)}
    return {"machine": machine, "scenes": {
        one.name: {"first_frame_ms": ms(one.first_frame), "drag_ms": ms(one.drag), "stale_ms": ms(one.stale),
                   "edits": {kind: {**ms(figures), "primary_rays": rays} for kind, (figures, rays) in one.edits.items()}}
        for one in told}}
