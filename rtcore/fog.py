"""Fog: what it lets through along every ray, the reflected and refracted ones as well."""
import numpy as np

from rtcore.jit import kernel
from rtcore.scene import FOG_KINDS, Fog
from rtcore.wave import DX, DY, DZ, T

def numbers(fog: Fog) -> np.ndarray:
    """What `dim` needs: kind, density, start, end, colour."""
    return np.array([FOG_KINDS.index(fog.kind), fog.density, fog.start, fog.end, *fog.color])


@kernel
def dim(wave, n, fog):
    """Fade each ray's light into the fog's colour over the length of the ray, and note in wave.fade what is left of it."""
    kind, density, start, end = fog[0], fog[1], fog[2], fog[3]
    ray = wave.rays.ray
    for i in range(n):
        x, y, z = np.float64(ray[DX, i]), np.float64(ray[DY, i]), np.float64(ray[DZ, i])
        s = np.float64(ray[T, i]) * np.sqrt(x * x + y * y + z * z)
        if kind == 0:
            f = min(max((end - s) / (end - start), 0.0), 1.0) if s < np.inf else 0.0
        elif density == 0:
            f = 1.0
        else:
            f = np.exp(-density * s) if kind == 1 else np.exp(-(density * s) * (density * s))
        for k in range(3):
            wave.light[k, i] = f * wave.light[k, i] + (1 - f) * fog[4 + k]
        wave.fade[i] = f
