"""Rectangular light."""
import math
from typing import Annotated

import numpy as np

from rtcore.fields import FieldError, Vec, Vector
from rtcore.jit import kernel
from rtcore.lanes import LANES, load, load3, wide
from rtcore.lights._sampled import drawn
from rtcore.lights._shine import shine_on
from rtcore.scene import Light
from rtcore.wave import DX, DY, DZ, PX, PY, PZ, T, finish


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
    surface, ray, strength = wave.surface, beam.rays.ray, beam.bring
    for i in range(0, n, LANES):
        for lane in range(LANES):
            if wave.rays.prim[i + lane] < 0:
                continue
            at = first + lane       # the rays' own columns serve as room for the eight
            u, v = drawn(wave, i + lane, draw)
            u, v = u - 0.5, v - 0.5
            x = light[0] + u * light[3] + v * light[6] - surface[PX, i + lane]
            y = light[1] + u * light[4] + v * light[7] - surface[PY, i + lane]
            z = light[2] + u * light[5] + v * light[8] - surface[PZ, i + lane]
            height = -(x * light[9] + y * light[10] + z * light[11])     # of the hit before the panel's plane
            if not height > 0:
                strength[0, at] = 0
                continue
            square = x * x + y * y + z * z
            ray[DX, at], ray[DY, at], ray[DZ, at] = x, y, z
            ray[T, at] = 1 - light[12] / height
            strength[0, at] = height / (square * np.sqrt(square))
        way, end = wide(load3(ray, DX, first)), wide(load(ray, T, first))
        first += shine_on(wave, i, beam, first, color, way, end, wide(load(strength, 0, first)), reach)
    finish(beam.rays, first)
    return first
