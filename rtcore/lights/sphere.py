"""Spherical light."""
from typing import Annotated

import numpy as np

from rtcore.fields import Number, Vec, Vector
from rtcore.jit import kernel
from rtcore.lanes import LANES, greatest, load, root, select, vec3, zero
from rtcore.lights._sampled import draw_eight, new_draws
from rtcore.lights._shine import hit_points, shine_on
from rtcore.sampling import disk
from rtcore.scene import Light
from rtcore.wave import finish


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
    room, radius = new_draws(), light[3]
    for i in range(0, n, LANES):
        draw_eight(room, wave, i, draw)
        for lane in range(LANES):
            if wave.rays.prim[i + lane] >= 0:
                room[0, lane], room[1, lane] = disk(room[0, lane], room[1, lane])
        hit, a, b = hit_points(wave, i), load(room, 0, 0), load(room, 1, 0)
        x, y, z = light[0] - hit.x, light[1] - hit.y, light[2] - hit.z
        d = root(x * x + y * y + z * z)
        share = radius / d
        share = share * share       # sin² of half the cone's angle
        rest = root(1 - share)
        cap = share / (1 + rest)            # 1 - cos of that half
        low = cap * (a * a + b * b)         # and of the angle off the axis
        spread, sine = root(cap * (2 - low)), low * (2 - low)
        x, y, z = x / d, y / d, z / d
        # two directions across the axis: Duff and others, "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017
        sign = select(z >= 0, 1, zero(z) - 1)
        p = -1 / (sign + z)
        q = x * y * p
        a, b = a * spread, b * spread
        way = vec3((1 - low) * x + a * (1 + sign * x * x * p) + b * q, (1 - low) * y + a * sign * q + b * (sign + y * y * p),
                   (1 - low) * z - a * sign * x - b * y)
        end = d * (1 - low - root(greatest(share - sine, 0))) - radius * 2.0 ** -10
        first += shine_on(wave, i, beam, first, color, way, way, end, select(share < 1, 2 / (d * d * (1 + rest)), 0), reach)
    finish(beam.rays, first)
    return first
