"""Polygon: authoring record."""
from typing import Annotated

from rtcore.fields import Vec, Vectors
from rtcore.scene import Shape


class Polygon(Shape, frozen=True):
    """A flat polygon, convex or not; its front is where the vertices run counter-clockwise."""

    vertices: Annotated[tuple[Vec, ...], Vectors(least=3, help="the corners in order", unit="scene units")]
