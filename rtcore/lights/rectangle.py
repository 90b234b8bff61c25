"""Rectangular light."""
import math
from typing import Annotated

import numpy as np

from rtcore.directions import normalized
from rtcore.fields import FieldError, Vec, Vector
from rtcore.jit import kernel
from rtcore.lanes import LANES, load, root, select, vec3
from rtcore.lights._sampled import draw_eight, new_draws
from rtcore.lights._shine import hit_points, shine_on
from rtcore.scene import Light
from rtcore.wave import finish


class RectangleLight(Light, frozen=True, kw_only=True):
    """A flat panel (a parallelogram if its edges are not at right angles) that shines evenly to the side where across x along points, and
    casts soft shadows. A surface that faces it from far away, straight ahead of it at distance d, gets color·intensity/d²: its radiance
    is color·intensity/area. The panel itself is not seen."""

    position: Annotated[Vec, Vector(help="where its middle is", unit="scene units")]
    across: Annotated[Vec, Vector(nonzero=True, help="one edge, from end to end", unit="scene units")] = (1.0, 0.0, 0.0)
    along: Annotated[Vec, Vector(nonzero=True, help="the other edge; light goes to where across x along points", unit="scene units")] = (
        0.0, 0.0, 1.0)

    def check(self):
        a, b = (np.array(edge) / np.abs(edge).max() for edge in (self.across, self.along))
        if np.linalg.norm(np.cross(a, b)) < 1e-6 * np.linalg.norm(a) * np.linalg.norm(b):
            raise FieldError("an edge that is not parallel to across", self.along, "along")

    def numbers(self) -> np.ndarray:
        """What `shine` needs: position, the edges, the unit normal, a thousandth of the mean edge."""
        a, b = (np.array(edge) / np.abs(edge).max() for edge in (self.across, self.along))
        normal = np.cross(a, b)
        thin = math.sqrt(math.hypot(*self.across)) * math.sqrt(math.hypot(*self.along)) * 2.0 ** -10
        return np.array([*self.position, *self.across, *self.along, *(normal / np.linalg.norm(normal)), thin])


@kernel
def shine(wave, n, light, color, beam, first, reach, draw):
    """As that of a point light, toward places drawn evenly from the panel, each as strong as its distance and slant let it be. A ray ends a
    thousandth of an edge before the panel, so that a shape of the same size may show it."""
    room = new_draws()
    for i in range(0, n, LANES):
        draw_eight(room, wave, i, draw)
        hit, u, v = hit_points(wave, i), load(room, 0, 0) - 0.5, load(room, 1, 0) - 0.5
        x = light[0] + u * light[3] + v * light[6] - hit.x
        y = light[1] + u * light[4] + v * light[7] - hit.y
        z = light[2] + u * light[5] + v * light[8] - hit.z
        height = -(x * light[9] + y * light[10] + z * light[11])    # of the hit before the panel's plane
        square = x * x + y * y + z * z
        strength = select(height > 0, height / (square * root(square)), 0)
        way = vec3(x, y, z)
        first += shine_on(wave, i, beam, first, color, way, normalized(way), 1 - light[12] / height, strength, reach)
    finish(beam.rays, first)
    return first
