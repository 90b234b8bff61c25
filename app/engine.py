"""The one door from the window to the compiled half of rtcore. Made and used on the render thread only."""
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from app.options import Options
from rtcore.camera import Camera
from rtcore.scene import Scene

if TYPE_CHECKING:
    from rtcore.progressive import Frame, RenderRequest


SHOWN = 0.013                   # seconds from a picture to the screen: its bytes, the window's thread, painting
ANSWER, MOTION = 0.1 - SHOWN, 1 / 30 - SHOWN        # within which the first picture of a change is to be made, and that of a step of a drag


class Job(NamedTuple):
    """What the window wants to see. Jobs are numbered in the order they are asked for."""

    number: int
    scene: Scene
    camera: Camera
    options: Options
    size: tuple[int, int]       # width, height in pixels of the picture
    continues: bool = False     # a step of the same drag as the job before: that one may still show its first pass
    document: int = 0           # counts opened files: kernels are compiled anew only for another one
    anew: bool = False          # from its start, though there may be something to go on from

    def looks_like(self, other: "Job") -> bool:
        """Whether both come to the same picture, at most shown otherwise; scenes are told apart by identity, as everywhere."""
        return (self.scene is other.scene and (self.camera, self.size) == (other.camera, other.size)
                and self.options.looks_like(other.options))

    def region(self) -> tuple[int, int, int, int] | None:
        """Pixels (x0, y0, x1, y1), half open, that are refined first: all that the options' rectangle touches."""
        if self.options.region is None:
            return None
        width, height = self.size
        left, top, right, bottom = self.options.region
        return math.floor(left * width), math.floor(top * height), math.ceil(right * width), math.ceil(bottom * height)


class Engine:
    """rtcore's renderer behind the few calls the worker needs. Importing it takes a second: numba comes with it."""

    def __init__(self, give_way: Callable[[], None] | None = None):
        from rtcore import film, progressive, warm
        self._film, self._progressive, self._warm = film, progressive, warm
        self._renderer = progressive.Renderer(keep=True, give_way=give_way)
        self._encoders = ThreadPoolExecutor(2, thread_name_prefix="rayscope-encode")     # 4 to 6 ms of one thread at 1280 x 720
        self._warmed: tuple[Scene, Options, bool] | None = None

    def request(self, job: Job) -> "RenderRequest":
        """The renderer's own form of a job."""
        settings = self._progressive.Settings(size=job.size, region=job.region(), **job.options.settings())
        return self._progressive.RenderRequest(job.scene, job.camera, settings)

    def missing(self, job: Job) -> list[str]:
        """Names of the kernels that this job needs and the cache does not have yet. A scene of thousands of shapes is looked
        through once, not at every step of a drag."""
        lens = job.camera.aperture > 0
        if self._warmed is not None and self._warmed[0] is job.scene and self._warmed[1:] == (job.options, lens):
            return []
        names = self._warm.missing(job.scene, self.request(job).settings, screen=True, camera=job.camera)
        self._warmed = None if names else (job.scene, job.options, lens)
        return names

    def frames(self, request: "RenderRequest", cancelled: Callable[[], bool], dragged: bool) -> "Iterator[Frame]":
        """The passes of a picture, from coarse to fine; the first one in time for the eye to take it for an answer, or for a motion."""
        return self._renderer.frames(request, cancelled, deadline=MOTION if dragged else ANSWER)

    def forget(self):
        """Make the next picture from its start."""
        self._renderer.forget()

    def encode(self, pixels: np.ndarray, out: np.ndarray, gain: float):
        """Linear light, multiplied by the gain, into the bytes of QImage.Format_RGB32."""
        self._film.encode(pixels, out, gain, self._encoders.map)

    def close(self):
        """End all threads."""
        self._encoders.shutdown()
        self._renderer.close()
