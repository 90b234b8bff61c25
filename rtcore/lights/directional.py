"""Directional light: authoring record."""
from typing import Annotated

from rtcore.fields import Vec, Vector
from rtcore.scene import Light


class Directional(Light, frozen=True, kw_only=True):
    """Parallel light, like the sun's; it does not fall off."""

    direction: Annotated[Vec, Vector(nonzero=True, help="the way the light travels")]
