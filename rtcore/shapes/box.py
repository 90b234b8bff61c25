"""Box: authoring record."""
from typing import Annotated

from rtcore.fields import FieldError, Vec, Vector
from rtcore.scene import Shape


class Box(Shape, frozen=True):
    """The box from corner `low` to corner `high`, along the axes."""

    low: Annotated[Vec, Vector(help="the corner with the smallest coordinates", unit="scene units")]
    high: Annotated[Vec, Vector(help="the corner with the largest coordinates", unit="scene units")]

    def check(self):
        if not all(a < b for a, b in zip(self.low, self.high)):
            raise FieldError(f"three numbers each greater than those of low, {self.low}", self.high, "high")
