"""Directional light."""
from typing import Annotated

import numpy as np

from rtcore.fields import Vec, Vector
from rtcore.jit import kernel
from rtcore.scene import Light
from rtcore.wave import AIM_REACH, AIM_STRENGTH


class Directional(Light, frozen=True, kw_only=True):
    """Parallel light, like the sun's; it does not fall off."""

    direction: Annotated[Vec, Vector(nonzero=True, help="the way the light travels")]

    def numbers(self) -> np.ndarray:
        """What `aim` needs: the unit vector toward the light."""
        toward = -np.array(self.direction) / np.abs(self.direction).max()
        return toward / np.linalg.norm(toward)


@kernel
def aim(wave, n, numbers, out):
    """Rows of Beam.aim for the rays of the wave that hit something: the way to the light has no end."""
    for i in range(n):
        if wave.rays.prim[i] >= 0:
            out[0, i], out[1, i], out[2, i] = numbers[0], numbers[1], numbers[2]
            out[AIM_REACH, i] = np.inf
            out[AIM_STRENGTH, i] = 1.0
