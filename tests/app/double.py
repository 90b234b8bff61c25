"""A renderer for the window's tests: spheres by a few lines of numpy, everything else is sky. Nothing is compiled."""
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from app.engine import Job
from rtcore.plan import Plan, plan
from rtcore.settings import Settings
from rtcore.shapes import Sphere


class Frame(NamedTuple):
    """Like `rtcore.progressive.Frame`."""

    number: int
    passes: int
    spacing: int
    samples: int
    pixels: np.ndarray
    node: np.ndarray
    distance: np.ndarray
    rays: dict
    elapsed: float
    done: bool
    plan: Plan
    seconds: dict
    held: dict
    mean: float = 1.0
    error: float | None = None
    converged: bool = False


class Double:
    """Stands in for `app.engine.Engine`. `pause` is how long each pass takes; `jobs` is what was asked for, in order."""

    def __init__(self, pause: float = 0.0, spacings=(4, 1), names=()):
        self.pause, self.spacings, self.names = pause, spacings, list(names)
        self.jobs: list[Job] = []
        self.closed, self.forgotten = False, 0
        self.fail: Exception | None = None

    def request(self, job: Job) -> Job:
        self.jobs.append(job)
        if self.fail:
            raise self.fail
        return job

    def missing(self, job: Job) -> list[str]:
        names, self.names = self.names, []
        return names

    def frames(self, job: Job, cancelled: Callable[[], bool], dragged: bool) -> Iterator[Frame]:
        started = time.monotonic()
        for number, spacing in enumerate(self.spacings):
            end = time.monotonic() + self.pause
            while time.monotonic() < end:
                if cancelled():
                    return
                time.sleep(0.002)
            pixels, node, distance = picture(job, spacing)
            last = number + 1 == len(self.spacings)
            yield Frame(number, len(self.spacings), spacing, int(spacing == 1), pixels, node, distance, {"primary": node.size},
                        time.monotonic() - started + 1e-6, last, plan(job.scene, Settings(size=job.size, **job.options.settings())),
                        {("primary rays", "core"): 0.25, ("hits: sphere", "sphere"): 0.75}, {"shapes": 1024})

    def forget(self):
        self.forgotten += 1

    def encode(self, pixels: np.ndarray, out: np.ndarray, gain: float):
        out[..., 3] = 255
        out[..., 2::-1] = (np.clip(pixels * gain, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)

    def close(self):
        self.closed = True


def picture(job: Job, spacing: int):
    """Pixels, leaf indices and distances of the visible spheres, lit from the upper left; sky and fog by their colours."""
    width, height = job.size
    eye, corner, right, down = job.camera.rays(width, height)
    y, x = np.mgrid[0:height, 0:width]
    x, y = (x // spacing * spacing + 0.5)[..., None], (y // spacing * spacing + 0.5)[..., None]
    direction = corner + x * right + y * down
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    pixels = np.broadcast_to(np.array([0.25, 0.4, 0.7]) + 0.3 * (1 - y / height), (height, width, 3)).copy()
    node, distance = np.full((height, width), -1, np.int32), np.full((height, width), np.inf)
    light = np.array([-0.4, 0.8, -0.45])
    for index, leaf in enumerate(job.scene.leaves()):
        if not leaf.visible or not isinstance(leaf.shape, Sphere):
            continue
        center = leaf.matrix[:3, :3] @ leaf.shape.center + leaf.matrix[:3, 3]
        b = direction @ (eye - center)
        under = b * b - ((eye - center) @ (eye - center) - leaf.shape.radius ** 2)
        t = -b - np.sqrt(np.maximum(under, 0))
        hit = (under > 0) & (t > 0) & (t < distance)
        normal = (eye + t[..., None] * direction - center) / leaf.shape.radius
        shade = 0.15 + 0.85 * np.clip(normal @ light, 0, 1) if job.options.shadows else np.ones(t.shape)
        pixels[hit] = (np.array(leaf.material.color) * shade[..., None])[hit]
        node[hit], distance[hit] = index, t[hit]
    fog = job.scene.fog
    if fog is not None and fog.on and job.options.fog:
        through = np.exp(-fog.density * np.where(np.isfinite(distance), distance, 1e3))[..., None]
        pixels = pixels * through + np.array(fog.color) * (1 - through)
    return pixels.astype(np.float32), node, distance.astype(np.float32)
