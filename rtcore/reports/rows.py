"""What the stability report is made of: a row per shape, solver, precision and family, with the worst rays and points for plots."""
from dataclasses import dataclass, field
from typing import NamedTuple

from rtcore.scene import Shape
from rtcore.shapes import Mesh

COLUMNS = ("shape", "solver", "precision", "family", "rays", "wrong", "p50", "p99", "max_ulp", "nonfinite", "ns_per_ray", "target", "met")
POINT_COLUMNS = ("shape", "solver", "precision", "family", "distance", "scale", "ulp")


class Worst(NamedTuple):
    """A ray to show: whether it misses a target, its error (inf for a wrong hit-or-miss), what went wrong, and Python code that does it
    again. The greatest is the worst."""

    missed: bool
    ulp: float
    what: str
    code: str


def example(shape: Shape | str, transform: tuple, origin, direction, precision: str) -> str:
    """Python code that sends one ray at a placed shape, a record or the code for one."""
    if isinstance(shape, Mesh):
        shape = f"Mesh({shape.vertices.tolist()}, {shape.faces.tolist()})"
    return (f"node = Node(shape={shape}, transform={transform!r})\n"
            f"intersect(Scene(objects=[node]), [{list(map(float, origin))}], [{list(map(float, direction))}], precision={precision!r}).t")


class Point(NamedTuple):
    """One ray in the plots: the origin's distance in radii of the shape, the shape's size in the world, the error of t."""

    distance: float
    scale: float
    ulp: float


@dataclass(frozen=True)
class Row:
    """What one solver does with one family of rays. Errors in ulp of the true t, over the rays that are hits in truth and by the solver;
    NaN where there are none. `target` is empty for solvers that have none, `met` then None."""

    shape: str
    solver: str
    precision: str
    family: str
    rays: int
    wrong: int              # hits that are misses in truth, misses that are hits, and hits of another crossing than the first
    p50: float
    p99: float
    max_ulp: float
    nonfinite: int          # rays with a root or a normal that is not finite
    ns_per_ray: float
    target: str = ""
    met: bool | None = None
    worst: tuple[Worst, ...] = field(default=(), repr=False)
    points: tuple[Point, ...] = field(default=(), repr=False)
