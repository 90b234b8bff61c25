"""Directional light."""
from typing import Annotated

import numpy as np

from rtcore.fields import Vec, Vector
from rtcore.jit import kernel
from rtcore.lanes import LANES, vec3, zero
from rtcore.lights._shine import hit_points, shine_on
from rtcore.scene import Light
from rtcore.wave import finish


class Directional(Light, frozen=True, kw_only=True):
    """Parallel light, like the sun's; it does not fall off."""

    direction: Annotated[Vec, Vector(nonzero=True, help="the way the light travels")]

    def numbers(self) -> np.ndarray:
        """What `shine` needs: the unit vector toward the light."""
        toward = -np.array(self.direction) / np.abs(self.direction).max()
        return toward / np.linalg.norm(toward)


@kernel
def shine(wave, n, light, color, beam, first, reach):
    """As that of a point light, but the way to the light has no end."""
    for i in range(0, n, LANES):
        none = zero(hit_points(wave, i).x)
        way = vec3(none + light[0], none + light[1], none + light[2])
        first += shine_on(wave, i, beam, first, color, way, way, none + np.inf, none + 1, reach)
    finish(beam.rays, first)
    return first
