"""Point light."""
from typing import Annotated

import numpy as np

from rtcore.directions import normalized
from rtcore.fields import Choice, Vec, Vector
from rtcore.jit import kernel
from rtcore.lanes import LANES, select, vec3, zero
from rtcore.lights._shine import hit_points, shine_on
from rtcore.scene import Light
from rtcore.wave import finish


class Point(Light, frozen=True, kw_only=True):
    """Light from one point. With `falloff="inverse-square"` a surface at distance d gets color·intensity/d²; with
    `"constant"`, the classroom's, the same at every distance."""

    position: Annotated[Vec, Vector(help="where it is", unit="scene units")]
    falloff: Annotated[str, Choice(words=("inverse-square", "constant"), help="how the light weakens with distance")] = "inverse-square"

    def numbers(self) -> np.ndarray:
        """What `shine` needs: position, whether it falls off."""
        return np.array([*self.position, float(self.falloff == "inverse-square")])


@kernel
def shine(wave, n, light, color, beam, first, reach):
    """Shadow rays from the hits of the wave toward a light, whose way ends on it at t = 1, and what they would bring, into the columns from
    `first` on; returns the column after the last."""
    for i in range(0, n, LANES):
        hit = hit_points(wave, i)
        x, y, z = light[0] - hit.x, light[1] - hit.y, light[2] - hit.z
        square = x * x + y * y + z * z
        # a surface that contains the light is not lit by it
        strength = select(square > 0, 1 / square if light[3] != 0 else 1 + zero(square), 0)
        way = vec3(x, y, z)
        first += shine_on(wave, i, beam, first, color, way, normalized(way), 1 + zero(square), strength, reach)
    finish(beam.rays, first)
    return first
