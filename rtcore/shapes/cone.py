"""Cylinder and Cone: authoring records."""
from typing import Annotated

from rtcore.fields import FieldError, Flag, Number, Vec, Vector
from rtcore.scene import Shape


class Cylinder(Shape, frozen=True):
    """A round cylinder from `base` to `apex`, open or with flat caps."""

    base: Annotated[Vec, Vector(help="centre of the one end", unit="scene units")]
    apex: Annotated[Vec, Vector(help="centre of the other end", unit="scene units")]
    radius: Annotated[float, Number(above=0, help="radius", unit="scene units")]
    capped: Annotated[bool, Flag(help="whether the ends are closed")] = True

    def check(self):
        if self.base == self.apex:
            raise FieldError("a point other than base", self.apex, "apex")


class Cone(Shape, frozen=True):
    """A cone from `base` to `apex`, pointed (one radius 0) or cut off, open or with flat caps."""

    base: Annotated[Vec, Vector(help="centre of the one end", unit="scene units")]
    base_radius: Annotated[float, Number(least=0, help="radius at the base", unit="scene units")]
    apex: Annotated[Vec, Vector(help="centre of the other end", unit="scene units")]
    apex_radius: Annotated[float, Number(least=0, help="radius at the apex", unit="scene units")] = 0.0
    capped: Annotated[bool, Flag(help="whether the ends are closed")] = True

    def check(self):
        if self.base == self.apex:
            raise FieldError("a point other than base", self.apex, "apex")
        if self.base_radius == 0 and self.apex_radius == 0:
            raise FieldError("at least one radius greater than 0", 0, "base_radius")
