"""Error against run time: a scene rendered by several methods, each pass compared with a reference that is independent of them all.

`run` measures and tells how far it is, `write` makes `convergence.csv` and `convergence.md` of the rows (`convergence_page` has the words).
"""
import csv
import io
import math
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from rtcore.camera import Camera
from rtcore.files import WriteError, write_file
from rtcore.progressive import Renderer, RenderRequest
from rtcore.reports.convergence_page import page
from rtcore.scene import Scene
from rtcore.settings import Settings

#: What a method's name sets; several can be joined: "adaptive+f32".
METHODS = {"uniform": {"adaptive": False}, "adaptive": {"adaptive": True}, "f32": {"precision": "f32"}, "f64": {"precision": "f64"},
           "textbook": {"solver": "textbook"}}
RUNS = 2                # of each method, with seeds of their own
PARTS = 4               # renders that the reference is the mean of
REFERENCE_SEED = 0x5EED_0000
DARK = 1e-2             # added to the squared reference in relmse, lest black pixels count for all


class Row(NamedTuple):
    """The picture after one pass. Errors are root mean squares over pixels and channels, in linear light."""

    method: str
    run: int
    seconds: float
    samples: float      # per pixel, the mean
    rmse: float         # against the reference, whose own error is taken out
    relmse: float       # mean of squared error over squared reference plus DARK
    estimate: float     # of rmse, by the render itself


class Reference(NamedTuple):
    """A picture float64 (h, w, 3), what it is made of and its own estimated error."""

    pixels: np.ndarray
    samples: int
    error: float

    def rmse(self, pixels: np.ndarray) -> float:
        """Root mean square error of another picture: of the difference, less what is the reference's own share."""
        return math.sqrt(max(float(np.square(pixels - self.pixels).mean()) - self.error ** 2, 0.0))

    def judges(self, error: float) -> bool:
        """Whether another picture's error can be told: it is not below that of the reference."""
        return error >= self.error

    def relmse(self, pixels: np.ndarray) -> float:
        """Mean squared relative error of another picture."""
        return float((np.square(pixels - self.pixels) / (np.square(self.pixels) + DARK)).mean())


class Step(NamedTuple):
    """How far the report is, 0 .. 1, what is under way, and what was measured since the step before."""

    share: float
    what: str
    rows: tuple[Row, ...] = ()
    reference: Reference | None = None


def method(name: str) -> dict | None:
    """The settings a method's name stands for; None if there is no such method."""
    words = name.split("+")
    return {key: value for word in words for key, value in METHODS[word].items()} if all(word in METHODS for word in words) else None


def refer(renderer: Renderer, scene: Scene, camera: Camera, settings: Settings, samples: int,
          cancelled: Callable[[], bool] = lambda: False) -> Iterator[Step]:
    """Render the reference: steps, the last of which has it. PARTS renders with seeds of their own, so that it has other replicates, and
    more of them, than anything it judges; always float64 and uniform. Ends early, without one, if cancelled."""
    each = max(-(-samples // PARTS), 2)
    total, errors = 0.0, []
    for part in range(PARTS):
        seed = (REFERENCE_SEED + part) ^ settings.seed
        chosen = msgspec.structs.replace(settings, samples=each, seed=seed, precision="f64", solver="certain", adaptive=False, seconds=None,
                                         error=None, view="beauty")
        request = RenderRequest(scene, camera, chosen, hits=False)
        for frame in renderer.frames(request, cancelled, coarse=False):     # noqa: B007 -- the last one
            yield Step((part + renderer.progress) / PARTS, "reference")
        if cancelled():
            return
        total = total + frame.pixels.astype(np.float64)
        errors.append(frame.error)
    own = math.sqrt(np.square(errors).sum()) / PARTS
    yield Step(1.0, "reference", (), Reference(total / PARTS, each * PARTS, own))


def run(scene: Scene, camera: Camera, settings: Settings, methods: Iterable[str], reference_samples: int, budget: float,
        cancelled: Callable[[], bool] = lambda: False) -> Iterator[Step]:
    """Render the reference, then each method RUNS times for its share of `budget` seconds a method. Raises FieldError for a scene that
    can't be rendered."""
    methods, renderer, reference = list(methods), Renderer(), None
    try:
        for step in refer(renderer, scene, camera, settings, reference_samples, cancelled):
            reference = step.reference
            yield step._replace(share=step.share / 2)
        if reference is None:
            return
        jobs = [(name, number) for name in methods for number in range(RUNS)]
        for done, (name, number) in enumerate(jobs):
            chosen = msgspec.structs.replace(settings, **method(name), samples=reference.samples, seed=settings.seed + number,
                                             seconds=budget / RUNS, view="beauty")
            if number == 0:     # load kernels and arrays before the clock counts
                short = msgspec.structs.replace(chosen, size=(16, 12), samples=16)
                for _ in renderer.frames(RenderRequest(scene, camera, short, hits=False), cancelled, coarse=False):
                    pass
            rows: dict[int, Row] = {}       # by pass: a frame from within one gives way to that at its end
            for frame in renderer.frames(RenderRequest(scene, camera, chosen, hits=False), cancelled, coarse=False):
                yield Step(0.5 + (done + min(frame.elapsed / chosen.seconds, 1.0)) / len(jobs) / 2, name)
                if (row := compare(name, number, frame, reference)) is not None:
                    if not reference.judges(row.rmse):
                        break
                    rows[frame.number] = row
            yield Step(0.5 + (done + 1) / len(jobs) / 2, name, tuple(rows.values()))
            if cancelled():
                return
    finally:
        renderer.close()


def compare(name: str, number: int, frame, reference: Reference) -> Row | None:
    """The row of a frame; None below two samples per pixel, where there is no estimate."""
    if frame.error is None or frame.samples < 2:
        return None
    return Row(name, number, frame.elapsed, frame.mean, reference.rmse(frame.pixels), reference.relmse(frame.pixels), frame.error)


def write(rows: Iterable[Row], reference: Reference, title: str, folder: str | os.PathLike, note: str = "") -> None:
    """Write `convergence.csv` and `convergence.md` into a folder, which is made if there is none. WriteError if one can't be written."""
    rows, folder = list(rows), Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(folder, f"cannot be made: {error.strerror}") from None
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(Row._fields)
    writer.writerows([f"{value:.6g}" if isinstance(value, float) else value for value in row] for row in rows)
    write_file(folder / "convergence.csv", text.getvalue().encode())
    write_file(folder / "convergence.md", page(rows, reference, title, note).encode())
