"""Sphere: authoring record."""
from typing import Annotated

from rtcore.fields import Number, Vec, Vector
from rtcore.scene import Shape


class Sphere(Shape, frozen=True):
    """All points at `radius` from `center`."""

    center: Annotated[Vec, Vector(help="the middle", unit="scene units")]
    radius: Annotated[float, Number(above=0, help="distance of the surface from the centre", unit="scene units")]
