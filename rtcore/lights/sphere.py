"""Spherical light."""
from typing import Annotated

import numpy as np

from rtcore.fields import Number, Vec, Vector
from rtcore.jit import kernel
from rtcore.lanes import LANES, load, load3, wide
from rtcore.lights._sampled import drawn
from rtcore.lights._shine import shine_on
from rtcore.sampling import disk
from rtcore.scene import Light
from rtcore.wave import DX, DY, DZ, PX, PY, PZ, T, finish


class SphereLight(Light, frozen=True, kw_only=True):
    """A ball that shines evenly from all its surface, and casts soft shadows. A surface that faces it at distance d from its centre gets
    color·intensity/d², as from a point light: its radiance is color·intensity/(π radius²). The ball itself is not seen, and nothing
    within it is lit."""

    position: Annotated[Vec, Vector(help="where its centre is", unit="scene units")]
    radius: Annotated[float, Number(above=0, help="its radius: the larger, the softer the shadows", unit="scene units")] = 1.0

    def numbers(self) -> np.ndarray:
        """What `shine` needs: position, radius."""
        return np.array([*self.position, self.radius])


@kernel
def shine(wave, n, light, color, beam, first, reach, draw):
    """As that of a point light, toward places of the ball, drawn evenly from the cone in which it is seen (Wang, "Physically Correct Direct
    Lighting for Distribution Ray Tracing", Graphics Gems III, 1992). A ray ends a thousandth of the radius before the ball, so that a
    shape of the same size may show it."""
    surface, ray, strength, radius = wave.surface, beam.rays.ray, beam.bring, light[3]
    for i in range(0, n, LANES):
        for lane in range(LANES):
            if wave.rays.prim[i + lane] < 0:
                continue
            at = first + lane       # the rays' own columns serve as room for the eight
            x = light[0] - surface[PX, i + lane]
            y = light[1] - surface[PY, i + lane]
            z = light[2] - surface[PZ, i + lane]
            d = np.sqrt(x * x + y * y + z * z)
            share = radius / d
            share = share * share       # sin² of half the cone's angle
            if not share < 1:
                strength[0, at] = 0
                continue
            u, v = drawn(wave, i + lane, draw)
            a, b = disk(u, v)
            rest = np.sqrt(1 - share)
            low = share / (1 + rest) * (a * a + b * b)      # 1 - cos of the angle off the axis
            spread = np.sqrt(share / (1 + rest) * (2 - low))
            sine = low * (2 - low)
            x, y, z = x / d, y / d, z / d
            # two directions across the axis: Duff and others, "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017
            sign = 1.0 if z >= 0 else -1.0
            p = -1 / (sign + z)
            q = x * y * p
            a, b = a * spread, b * spread
            ray[DX, at] = (1 - low) * x + a * (1 + sign * x * x * p) + b * q
            ray[DY, at] = (1 - low) * y + a * sign * q + b * (sign + y * y * p)
            ray[DZ, at] = (1 - low) * z - a * sign * x - b * y
            ray[T, at] = d * (1 - low - np.sqrt(max(share - sine, 0.0))) - radius * 2.0 ** -10
            strength[0, at] = 2 / (d * d * (1 + rest))
        way, end = wide(load3(ray, DX, first)), wide(load(ray, T, first))
        first += shine_on(wave, i, beam, first, color, way, end, wide(load(strength, 0, first)), reach)
    finish(beam.rays, first)
    return first
