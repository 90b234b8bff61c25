"""Fog: what it lets through along every ray, the reflected and refracted ones as well."""
import numpy as np

from rtcore.jit import kernel
from rtcore.lanes import LANES, greatest, least, load, load3, narrow, root, select, store, wide, zero
from rtcore.neighbours import store1
from rtcore.powers import decay
from rtcore.scene import FOG_KINDS, Fog
from rtcore.wave import DX, T


def numbers(fog: Fog) -> np.ndarray:
    """What `dim` needs: kind, density, start, end, colour."""
    return np.array([FOG_KINDS.index(fog.kind), fog.density, fog.start, fog.end, *fog.color])


@kernel
def dim(wave, n, fog):
    """Fade each ray's light into the fog's colour over the length of the ray, and note in wave.fade what is left of it."""
    kind, density, start, end = fog[0], fog[1], fog[2], fog[3]
    ray, light = wave.rays.ray, wave.light
    for i in range(0, n, LANES):
        d = wide(load3(ray, DX, i))
        s = wide(load(ray, T, i)) * root(d.x * d.x + d.y * d.y + d.z * d.z)
        if kind == 0:
            f = select(s < np.inf, least(greatest((end - s) / (end - start), 0), 1), 0)
        elif density == 0:
            f = 1 + zero(s)
        elif kind == 1:
            f = decay(density * s)
        else:
            f = decay((density * s) * (density * s))
        for k in range(3):
            store(light, k, i, narrow(f * wide(load(light, k, i)) + (1 - f) * fog[4 + k]))
        store1(wave.fade, i, narrow(f))
