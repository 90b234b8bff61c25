"""What a default solver has to reach, shape by shape."""
from typing import NamedTuple

from rtcore.scene import Shape
from rtcore.shapes import Blob, Box, Cone, Cylinder, Implicit, Mesh, Plane, Polygon, Polyhedron, Quadric, Sphere, Torus, Triangle

#: Families whose rays are aimed at where a hit turns into a miss, within a rounding.
BORDERLINE = ("edges", "grazing", "surface")
UNIT = {"f32": 2.0 ** -24, "f64": 2.0 ** -53}       # u, half an ulp of 1


class Target(NamedTuple):
    """The error of t may be `ulp` units in the last place or, where `factor` is not 0, factor · condition · u, whichever is more.
    Without `exact_hits`, a ray of the BORDERLINE families may go either way."""

    ulp: dict[str, float]
    factor: float = 0
    exact_hits: bool = True

    def words(self, precision: str, family: str) -> str:
        """The target as the table says it."""
        words = f"{self.ulp[precision]:g} ulp" + (f" or {self.factor:g} cond u" if self.factor else "")
        return words + (", 0 wrong" if self.counts_hits(family) else "")

    def counts_hits(self, family: str) -> bool:
        """Whether a wrong hit-or-miss misses the target in rays of that family."""
        return self.exact_hits or family not in BORDERLINE


QUADRATIC = Target({"f32": 1, "f64": 2})
#: Flat shapes: t is bounded through the condition. At the edges of triangles what counts is that no ray is lost between two of them.
FLAT = Target({"f32": 1, "f64": 2}, 4)
TRIANGLES = FLAT._replace(exact_hits=False)

TARGETS: dict[type[Shape], Target] = {
    Sphere: QUADRATIC, Plane: QUADRATIC, Quadric: QUADRATIC, Cylinder: QUADRATIC, Cone: QUADRATIC,
    Torus: Target({"f32": 4, "f64": 4}, 4), Blob: Target({"f32": 1, "f64": 2}, 8), Implicit: Target({"f32": 1, "f64": 2}, 8),
    Triangle: TRIANGLES, Mesh: TRIANGLES, Polygon: FLAT, Box: FLAT, Polyhedron: FLAT}
