"""Point light."""
from typing import Annotated

import numpy as np

from rtcore.fields import Choice, Vec, Vector
from rtcore.jit import kernel
from rtcore.scene import Light
from rtcore.wave import AIM_REACH, AIM_STRENGTH, PX, PY, PZ


class Point(Light, frozen=True, kw_only=True):
    """Light from one point. With `falloff="inverse-square"` a surface at distance d gets color·intensity/d²; with
    `"constant"`, the classroom's, the same at every distance."""

    position: Annotated[Vec, Vector(help="where it is", unit="scene units")]
    falloff: Annotated[str, Choice(words=("inverse-square", "constant"), help="how the light weakens with distance")] = "inverse-square"

    def numbers(self) -> np.ndarray:
        """What `aim` needs: position, whether it falls off."""
        return np.array([*self.position, float(self.falloff == "inverse-square")])


@kernel
def aim(wave, n, numbers, out):
    """Rows of Beam.aim for the rays of the wave that hit something: the way to the light ends on it at t = 1."""
    surface = wave.surface
    for i in range(n):
        if wave.rays.prim[i] >= 0:
            x, y, z = numbers[0] - surface[PX, i], numbers[1] - surface[PY, i], numbers[2] - surface[PZ, i]
            square = x * x + y * y + z * z
            out[0, i], out[1, i], out[2, i] = x, y, z
            out[AIM_REACH, i] = 1.0
            # a surface that contains the light is not lit by it
            out[AIM_STRENGTH, i] = 0.0 if square == 0 else 1.0 / square if numbers[3] != 0 else 1.0
