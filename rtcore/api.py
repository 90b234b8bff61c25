"""The Python API: render a scene, or ask what given rays hit."""
import io
import math
import os
import threading
import weakref
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from rtcore import rows
from rtcore.fields import FieldError
from rtcore.film import encode
from rtcore.flatten import Geometry, flatten
from rtcore.framing import framed
from rtcore.progressive import Renderer, RenderRequest
from rtcore.scene import Scene
from rtcore.settings import Settings
from rtcore.wave import CLOSEST, GX, OPAQUE, RAY_ROWS, SURFACE_ROWS, U, Rays, new_rays, new_tally, padded

CHUNK = 1 << 13     # rays traced in one go: their arrays stay in the second-level cache
KEPT = 4            # scenes and precisions whose geometry is kept for the next query


class Image(NamedTuple):
    """A rendered picture: pixels (h, w, 3) linear float32, and the stats of the command line's --stats."""

    pixels: np.ndarray
    stats: dict

    def save(self, path) -> None:
        """Write the picture as .png (sRGB) or .exr (linear). Raises FileError, and leaves an old file as it was, if that fails."""
        from rtcore.files import save_image
        save_image(self.pixels, path)

    def _repr_png_(self) -> bytes:
        """How notebooks show it."""
        from PIL import Image as Pillow
        buffer = io.BytesIO()
        Pillow.fromarray(np.ascontiguousarray(encode(self.pixels)[:, :, 2::-1])).save(buffer, "png")
        return buffer.getvalue()


class Hits:
    """What N rays hit: t (N,), inf for nothing; node (N,), the index among `scene.leaves()`, -1 for nothing; normal (N, 3), the
    geometric one, of length 1, on the shape's front; uv (N, 2). Where nothing is hit, normal and uv are 0.

    t and node are there at once. normal and uv are worked out when one of them is first asked for; until then the rays are kept, 64 bytes
    each (float32: 32).
    """

    def __init__(self, t: np.ndarray, node: np.ndarray, traced: "Traced"):
        self.t, self.node = t, node
        self._traced, self._surface = traced, None

    @property
    def normal(self) -> np.ndarray:
        return self._found()[0]

    @property
    def uv(self) -> np.ndarray:
        return self._found()[1]

    def _found(self) -> tuple[np.ndarray, np.ndarray]:
        traced = self._traced       # looked at once: another thread may be doing the same
        if traced is not None:
            self._surface = traced.surface()
            self._traced = None
        return self._surface

    def __iter__(self):
        """For t, node, normal, uv = hits."""
        return iter((self.t, self.node, self.normal, self.uv))

    def __getstate__(self) -> tuple:
        return tuple(self)

    def __setstate__(self, state: tuple):
        self.t, self.node, *surface = state
        self._traced, self._surface = None, tuple(surface)

    def __repr__(self) -> str:
        return f"<Hits: {np.count_nonzero(self.node >= 0)} of {len(self.t)} rays>"


class Traced(NamedTuple):
    """Rays that were traced, chunk by chunk, and what they were traced through."""

    geometry: Geometry
    spans: list[tuple[int, int]]    # which rays each chunk holds
    chunks: list[Rays]
    threads: int | None

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Normals (N, 3) and texture coordinates (N, 2) where they hit, 0 elsewhere."""
        n = self.spans[-1][1] if self.spans else 0
        normal, uv = np.empty((n, 3), self.geometry.dtype), np.empty((n, 2), self.geometry.dtype)

        def look(number: int) -> None:
            a, b = self.spans[number]
            found = np.zeros((SURFACE_ROWS, b - a), self.geometry.dtype)
            for group in self.geometry.groups:
                group.kind.surface(self.chunks[number], b - a, found, group.table, group.first)
            normal[a:b], uv[a:b] = found[GX:GX + 3].T, found[U:U + 2].T

        _share(look, len(self.spans), self.threads)
        return normal, uv


def render(scene: Scene, size: tuple[int, int] = (640, 480), spp: int = 1, **settings) -> Image:
    """Render a scene: `size` (width, height) in pixels, `spp` samples per pixel, and any other field of `Settings`.

    Raises FieldError for settings or a scene that can't be rendered.
    """
    chosen = Settings(size=size, samples=spp, **settings)
    renderer = Renderer()
    try:
        for frame in renderer.frames(RenderRequest(scene, framed(scene, size[0] / size[1]), chosen, hits=False), coarse=False):
            last = frame
        return Image(last.pixels, renderer.stats())
    finally:
        renderer.close()


def intersect(scene: Scene, origins, directions, t_min=0.0, t_max=math.inf, precision: str = "f64", threads: int | None = None) -> Hits:
    """Nearest hits of N rays with t_min < t < t_max.

    origins, directions: (N, 3); directions of any length other than 0, t counts in their lengths. t_min (of at least 0) and t_max: a
    number or (N,).
    precision "f64" or "f32", threads None for one per core. Raises FieldError for arrays of another shape or numbers that are not finite.

    Fastest with arrays of the precision, rays that keep together next to one another, and one scene asked again: what was made of the
    scenes asked last is kept as long as they live.
    """
    query = Query(scene, origins, directions, t_min, t_max, precision)
    dtype, spans = query.geometry.dtype, query.spans
    t, node = np.empty(query.n, dtype), np.empty(query.n, np.int32)
    chunks = _chunks(spans, dtype)
    leaf = query.geometry.leaf if len(query.geometry.leaf) else np.zeros(1, np.int32)

    def trace(number: int) -> None:
        a, b = spans[number]
        stretch = query.take(a, b, chunks[number])
        for group in query.geometry.groups:
            group.kind.intersect(chunks[number], b - a, group.tree, group.table, group.first, CLOSEST)
        rows.give(chunks[number], stretch, leaf, t[a:b], node[a:b])

    _share(trace, len(spans), threads)
    return Hits(t, node, Traced(query.geometry, spans, chunks, threads))


def occluded(scene: Scene, origins, directions, t_max=math.inf, precision: str = "f64", threads: int | None = None) -> np.ndarray:
    """Whether anything at all, transparent or not, is hit at 0 < t < t_max: (N,) bool. Arguments as for `intersect`."""
    query = Query(scene, origins, directions, 0.0, t_max, precision)
    opaque = np.full(max(len(query.geometry.leaf), 1), OPAQUE, np.int32)
    result = np.empty(query.n, bool)

    def trace(number: int) -> None:
        a, b = query.spans[number]
        rays = new_rays(b - a, query.geometry.dtype)
        query.take(a, b, rays)
        for group in query.geometry.groups:
            group.kind.intersect(rays, b - a, group.tree, group.table, group.first, opaque)
        np.greater_equal(rays.prim[:b - a], 0, out=result[a:b])

    _share(trace, len(query.spans), threads)
    return result


# --- what is asked ---

_geometries: OrderedDict[tuple[int, str], tuple[weakref.ref, Geometry]] = OrderedDict()     # the one asked last at the end
_geometries_lock = threading.Lock()


def geometry_of(scene: Scene, precision: str) -> Geometry:
    """The scene, which can't change, flattened: kept for the next query, as long as the scene lives and is among those asked last."""
    key = id(scene), precision
    with _geometries_lock:
        if key in _geometries:
            _geometries.move_to_end(key)
            return _geometries[key][1]
    geometry = flatten(scene, precision)
    with _geometries_lock:
        # called when the scene goes, before another can have its id; no lock there: it may be while this one is held
        _geometries[key] = weakref.ref(scene, lambda _: _geometries.pop(key, None)), geometry
        while len(_geometries) > KEPT:
            _geometries.popitem(last=False)
    return geometry



class Query:
    """N rays and what they are traced through. Raises FieldError, at once for shapes of arrays, or when `take` meets what is not right."""

    def __init__(self, scene, origins, directions, t_min, t_max, precision):
        Settings(precision=precision)
        self.geometry = geometry_of(scene, precision)
        self.origins, self.directions = _points(origins, "origins"), _points(directions, "directions")
        self.n = len(self.origins)
        if len(self.directions) != self.n:
            raise FieldError(f"as many directions as origins, {self.n}", len(self.directions), "directions")
        self.t_min, self.t_max = _bound(t_min, "t_min", self.n), _bound(t_max, "t_max", self.n)
        self.spans = [(a, min(a + CHUNK, self.n)) for a in range(0, self.n, CHUNK)]

    def take(self, a: int, b: int, rays: Rays) -> np.ndarray:
        """Let `rays` be rays a .. b-1; returns what their t is to be multiplied with."""
        stretch = np.empty(padded(b - a))
        with np.errstate(over="ignore"):
            points = [np.ascontiguousarray(array[a:b], self.geometry.dtype) for array in (self.origins, self.directions)]
        limits = [bound if len(bound) == 1 else np.ascontiguousarray(bound[a:b]) for bound in (self.t_min, self.t_max)]
        if not rows.take(*points, *limits, rays, stretch):
            self.refuse()
        return stretch

    def refuse(self) -> None:
        """Raise the error for the first number that is not right."""
        dtype = self.geometry.dtype
        for name, array in (("origins", self.origins), ("directions", self.directions)):
            with np.errstate(over="ignore"):
                array = array.astype(dtype)
            bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
            if len(bad):
                raise FieldError("three finite numbers", array[bad[0]].tolist(), f"{name}[{bad[0]}]")
        bad = np.flatnonzero(~array.any(axis=1))
        if len(bad):
            raise FieldError("a vector that is not zero", array[bad[0]].tolist(), f"directions[{bad[0]}]")
        for name, bound, good, expected in (("t_min", self.t_min, self.t_min >= 0, "a number of at least 0"),
                                            ("t_max", self.t_max, ~np.isnan(self.t_max), "a number")):
            if not good.all():
                raise FieldError(expected, float(bound[~good][0]), name)


def _chunks(spans: list[tuple[int, int]], dtype) -> list[Rays]:
    """Rays for every chunk, with nothing set, all in the same few blocks of memory: a system is slow to give many."""
    most = padded(max((b - a for a, b in spans), default=0))
    kinds = (((RAY_ROWS, most), dtype), ((most,), np.int32), ((most,), np.int32), ((most,), np.uint8))
    blocks = [np.empty((len(spans), *shape), kind) for shape, kind in kinds]
    return [Rays(*parts, new_tally()) for parts in zip(*blocks)]


def _bound(value, name: str, n: int) -> np.ndarray:
    """A number or (n,) as float64 (1) or (n)."""
    try:
        bound = np.asarray(value, np.float64)
        if bound.size != 1 or bound.ndim > 1:
            bound = np.broadcast_to(bound, (n,))
    except (TypeError, ValueError):
        raise FieldError(f"a number or an array ({n},)", value, name) from None
    return bound.reshape(-1)


def _points(array, name: str) -> np.ndarray:
    """An array (n, 3) of float32 or float64, the given one if it is that."""
    try:
        result = np.asarray(array)
        if result.dtype not in (np.float32, np.float64):
            result = np.asarray(array, np.float64)
    except (TypeError, ValueError):
        raise FieldError("an array (N, 3)", array, name) from None
    if result.ndim != 2 or result.shape[1] != 3:
        raise FieldError("an array (N, 3)", result.shape, name)
    return result


def _share(work, n: int, threads: int | None) -> None:
    """Call work(0) .. work(n - 1), on several threads if there is more than one."""
    threads = min(threads or os.cpu_count() or 1, n)
    if threads <= 1:
        for number in range(n):
            work(number)
        return
    with ThreadPoolExecutor(threads) as pool:
        try:
            for done in [pool.submit(work, number) for number in range(n)]:
                done.result()
        except FieldError:
            pool.shutdown(cancel_futures=True)
            raise
