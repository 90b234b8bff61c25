"""The Python API: render a scene, or ask what given rays hit."""
import io
import math
import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from rtcore.fields import FieldError
from rtcore.film import encode
from rtcore.flatten import Geometry, flatten
from rtcore.framing import framed
from rtcore.progressive import Renderer, RenderRequest
from rtcore.scene import Scene
from rtcore.settings import Settings
from rtcore.trace import CLOSEST
from rtcore.wave import DEAD, DX, GX, OPAQUE, OX, START, SURFACE_ROWS, T, U, Rays, new_rays

CHUNK = 1 << 14     # rays traced in one go: their arrays stay in the second-level cache


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


class Hits(NamedTuple):
    """What N rays hit: t (N,), inf for nothing; node (N,), the index among `scene.leaves()`, -1 for nothing; normal (N, 3), the
    geometric one, of length 1, on the shape's front; uv (N, 2). Where nothing is hit, normal and uv are 0."""

    t: np.ndarray
    node: np.ndarray
    normal: np.ndarray
    uv: np.ndarray


def render(scene: Scene, size: tuple[int, int] = (640, 480), spp: int = 1, **settings) -> Image:
    """Render a scene: `size` (width, height) in pixels, `spp` samples per pixel, and any other field of `Settings`.

    Raises FieldError for settings or a scene that can't be rendered.
    """
    chosen = Settings(size=size, samples=spp, **settings)
    renderer = Renderer()
    try:
        for frame in renderer.frames(RenderRequest(scene, framed(scene, size[0] / size[1]), chosen), coarse=False):
            last = frame
        return Image(last.pixels, renderer.stats())
    finally:
        renderer.close()


def intersect(scene: Scene, origins, directions, t_min=0.0, t_max=math.inf, precision: str = "f64", threads: int | None = None) -> Hits:
    """Nearest hits of N rays with t_min < t < t_max.

    origins, directions: (N, 3); directions of any length other than 0, t counts in their lengths. t_min (of at least 0) and t_max: a
    number or (N,).
    precision "f64" or "f32", threads None for one per core. Raises FieldError for arrays of another shape or numbers that are not finite.
    """
    rays, stretch, geometry, n = _rays(scene, origins, directions, t_min, t_max, precision)
    surface = np.zeros((SURFACE_ROWS, rays.ray.shape[1]), geometry.dtype)

    def trace(a: int, b: int) -> None:
        part = rays._replace(ray=np.ascontiguousarray(rays.ray[:, a:b]), prim=rays.prim[a:b], depth=rays.depth[a:b], doubt=rays.doubt[a:b])
        for group in geometry.groups:
            group.kind.intersect(part, b - a, group.tree, group.table, group.first, CLOSEST)
        found = np.zeros((SURFACE_ROWS, b - a), geometry.dtype)
        for group in geometry.groups:
            group.kind.surface(part, b - a, found, group.table, group.first)
        rays.ray[T, a:b], surface[:, a:b] = part.ray[T], found

    _share(trace, rays.ray.shape[1], threads)
    hit = rays.prim[:n] >= 0
    node = np.where(hit, geometry.leaf[rays.prim[:n]] if len(geometry.leaf) else -1, -1)
    with np.errstate(over="ignore"):    # a hit beyond all numbers of the type
        t = np.where(hit, rays.ray[T, :n] * stretch, np.inf).astype(geometry.dtype)
    return Hits(t, node.astype(np.int32), np.ascontiguousarray(surface[GX:GX + 3, :n].T), np.ascontiguousarray(surface[U:U + 2, :n].T))


def occluded(scene: Scene, origins, directions, t_max=math.inf, precision: str = "f64", threads: int | None = None) -> np.ndarray:
    """Whether anything at all, transparent or not, is hit at 0 < t < t_max: (N,) bool. Arguments as for `intersect`."""
    rays, _, geometry, n = _rays(scene, origins, directions, 0.0, t_max, precision)
    opaque = np.full(max(len(geometry.leaf), 1), OPAQUE, np.int32)

    def trace(a: int, b: int) -> None:
        part = rays._replace(ray=np.ascontiguousarray(rays.ray[:, a:b]), prim=rays.prim[a:b], depth=rays.depth[a:b], doubt=rays.doubt[a:b])
        for group in geometry.groups:
            group.kind.intersect(part, b - a, group.tree, group.table, group.first, opaque)

    _share(trace, rays.ray.shape[1], threads)
    return rays.prim[:n] >= 0


def _rays(scene, origins, directions, t_min, t_max, precision) -> tuple[Rays, np.ndarray, Geometry, int]:
    """Checked rays; a power of two per ray by which their t is smaller than the caller's, so that no length of a direction overflows."""
    Settings(precision=precision)
    geometry = flatten(scene, precision)
    o, d = _points(origins, "origins", geometry.dtype), _points(directions, "directions", geometry.dtype)
    if len(o) != len(d):
        raise FieldError(f"as many directions as origins, {len(o)}", len(d), "directions")
    n = len(o)
    longest = np.abs(d).max(1, initial=0)
    if n and not longest.all():
        raise FieldError("a vector that is not zero", d[longest == 0][0].tolist(), f"directions[{int(np.flatnonzero(longest == 0)[0])}]")
    exponent = np.frexp(longest)[1]
    rays = new_rays(n, geometry.dtype)
    rays.ray[:] = 0
    rays.ray[DX], rays.ray[T], rays.prim[:], rays.depth[:] = 1, DEAD, -1, 0
    rays.ray[OX:OX + 3, :n] = o.T
    rays.ray[DX:DX + 3, :n] = np.ldexp(d, -exponent[:, None]).T
    with np.errstate(over="ignore"):
        stretch = np.ldexp(np.ones(n), -exponent)
        rays.ray[START, :n] = _bound(t_min, "t_min", n, 0.0) / stretch
        rays.ray[T, :n] = _bound(t_max, "t_max", n, -math.inf) / stretch
    return rays, stretch, geometry, n


def _bound(value, name: str, n: int, least: float) -> np.ndarray:
    """A number or (n,) as (n,), none NaN or below `least`."""
    try:
        bound = np.broadcast_to(np.asarray(value, np.float64), (n,))
    except (TypeError, ValueError):
        raise FieldError(f"a number or an array ({n},)", value, name) from None
    bad = bound[~(bound >= least)]
    if len(bad):
        raise FieldError("a number" if least == -math.inf else f"a number of at least {least:g}", float(bad[0]), name)
    return bound


def _points(array, name: str, dtype) -> np.ndarray:
    try:
        result = np.asarray(array, np.float64)
    except (TypeError, ValueError):
        raise FieldError("an array (N, 3)", array, name) from None
    if result.ndim != 2 or result.shape[1] != 3:
        raise FieldError("an array (N, 3)", result.shape, name)
    with np.errstate(over="ignore"):
        result = result.astype(dtype)
    bad = np.flatnonzero(~np.isfinite(result).all(axis=1))
    if len(bad):
        raise FieldError("three finite numbers", result[bad[0]].tolist(), f"{name}[{bad[0]}]")
    return result


def _share(trace, n: int, threads: int | None) -> None:
    """Call trace(a, b) for chunks of columns, on several threads if there is more than one."""
    edges = list(range(0, n, CHUNK)) + [n]
    spans = [(a, b) for a, b in zip(edges, edges[1:]) if b > a]
    threads = min(threads or os.cpu_count() or 1, len(spans))
    if threads <= 1:
        for a, b in spans:
            trace(a, b)
        return
    with ThreadPoolExecutor(threads) as pool:
        for done in [pool.submit(trace, a, b) for a, b in spans]:
            done.result()
