"""The thin lens: a wave's primary rays, sent through the pinhole, are bent so that they start all over the lens and meet again in the plane
that is sharp (Cook, Porter and Carpenter, "Distributed Ray Tracing", SIGGRAPH 1984)."""
import numpy as np

from rtcore.jit import kernel
from rtcore.sampling import LENS, centered, disk
from rtcore.shapes.kind import normalized
from rtcore.wave import DX, DY, DZ, OX, OY, OZ


@kernel
def bend(wave, n, target, number, lens, seed):
    """Let the wave's n primary rays, of pixels `target` and sample numbers `number` (both n), start on the lens (`Camera.lens`) and go
    through the point of its sharp plane that they went through. Their directions are of length 1 as before."""
    ray = wave.rays.ray
    for i in range(n):
        u, v = centered(target[i], number[i], LENS, seed)
        left, up = disk(u, v)
        dx, dy, dz = np.float64(ray[DX, i]), np.float64(ray[DY, i]), np.float64(ray[DZ, i])
        far = 1 / (lens[2, 0] * dx + lens[2, 1] * dy + lens[2, 2] * dz)
        x, y, z = left * lens[0, 0] + up * lens[1, 0], left * lens[0, 1] + up * lens[1, 1], left * lens[0, 2] + up * lens[1, 2]
        ray[OX, i], ray[OY, i], ray[OZ, i] = ray[OX, i] + x, ray[OY, i] + y, ray[OZ, i] + z
        ray[DX, i], ray[DY, i], ray[DZ, i] = normalized(far * dx - x, far * dy - y, far * dz - z)
