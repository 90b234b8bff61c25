"""Plane: authoring record."""
from typing import Annotated

from rtcore.fields import Vec, Vector
from rtcore.scene import Shape


class Plane(Shape, frozen=True):
    """The unbounded plane through `point`; `sides="front"` makes it the notes' one-sided plane."""

    point: Annotated[Vec, Vector(help="any point of it", unit="scene units")]
    normal: Annotated[Vec, Vector(nonzero=True, help="at right angles to it, on its front; of any length")]
