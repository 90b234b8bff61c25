"""Runs of the picture: what was asked for, and its error as it fell. Without Qt."""
import csv
import io
from dataclasses import dataclass, field
from typing import NamedTuple

from app.engine import Job
from app.options import MOST_SAMPLES
from rtcore.camera import Camera
from rtcore.scene import Scene

#: How a field of the options is told where it differs from that of another run.
WORDS = {"adaptive": ("adaptive", "uniform"), "shadows": ("shadows", "no shadows"), "fog": ("fog", "no fog"),
         "reflections": ("reflections", "no reflections")}
NUMBERS = {"samples": "samples", "max_depth": "rays deep", "threads": "threads", "seed": "seed"}
LIMITS = {"seconds": "{} s", "error": "to error {}"}
SILENT = ("view", "scale")      # another view of the same run; the scale shows in the size


class Subject(NamedTuple):
    """What a reference can be compared with: all that the finished picture depends on, but for samples, precision and solver."""

    scene: Scene
    camera: Camera
    size: tuple[int, int]
    shadows: bool
    fog: bool
    reflections: bool
    max_depth: int
    filter: str

    @classmethod
    def of(cls, job: Job) -> "Subject":
        options = job.options
        return cls(job.scene, job.camera, job.size, options.shadows, options.fog, options.reflections, int(options.max_depth),
                   options.filter)

    def matches(self, other: "Subject") -> bool:
        """Whether both have the same picture. Scenes are told apart by identity, as everywhere."""
        return self.scene is other.scene and self[1:] == other[1:]


class Point(NamedTuple):
    """A frame: seconds, samples per pixel, estimated error and, where a reference tells it, the true one."""

    seconds: float
    samples: float
    estimate: float
    error: float | None


@dataclass(eq=False)
class Run:
    """One render from its start."""

    job: Job
    points: list[Point] = field(default_factory=list)
    done: bool = False

    def goes_on(self, job: Job) -> bool:
        """Whether a job is this run still, at most seen otherwise."""
        return Subject.of(job).matches(Subject.of(self.job)) and _options(job) == _options(self.job)

    def add(self, point: Point):
        """Note a frame; one that is older than what is known, of a true error worked out on a thread, stands where it belongs."""
        self.points = sorted([*(p for p in self.points if p.seconds != point.seconds), point])


def _options(job: Job) -> dict:
    return {name: value for name, value in job.options.settings().items() if name not in SILENT}


def _words(job: Job) -> dict[str, str]:
    """All that can be told of a job, by field."""
    told = {"scene": job.scene.name or "a scene", "size": "{} × {}".format(*job.size)}
    for name, value in _options(job).items():
        if name in LIMITS:
            told[name] = LIMITS[name].format("any" if value is None else f"{value:g}")
            continue
        if name == "samples" and value == MOST_SAMPLES:
            told[name] = "no end of samples"
            continue
        told[name] = WORDS[name][not value] if name in WORDS else f"{value} {NUMBERS[name]}" if name in NUMBERS else str(value)
    return told


def names(runs: list[Run]) -> list[str]:
    """A name for each run: that in which they differ from one another, and a number where they don't."""
    told = [_words(run.job) for run in runs]
    differ = [name for name in (told[0] if told else ()) if len({words[name] for words in told}) > 1]
    cameras = list(dict.fromkeys(run.job.camera for run in runs))
    result = [", ".join([words[name] for name in differ] + ([f"view {cameras.index(run.job.camera) + 1}"] if len(cameras) > 1 else []))
              for run, words in zip(runs, told)]
    if not differ and len(cameras) < 2:
        result = [words["adaptive"] for words in told]
    return [name if result.count(name) == 1 else f"{name} ({result[:i + 1].count(name)})" for i, name in enumerate(result)]


def as_csv(runs: list[Run]) -> bytes:
    """All points of all runs as a table."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("run", "name", "seconds", "samples", "estimate", "rmse"))
    for number, (run, name) in enumerate(zip(runs, names(runs))):
        for point in run.points:
            numbers = ("" if value is None else f"{value:.6g}" for value in point)
            writer.writerow((number, name, *numbers))
    return text.getvalue().encode()
