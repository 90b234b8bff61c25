"""Normals as colours: x red, y green, z blue, -1 .. 1 as 0 .. 1 on the screen."""
import numpy as np

from rtcore.views.view import View


def draw(seen):
    shown = (0.5 + 0.5 * seen.normal()) ** np.float32(2.2)
    shown[seen.node < 0] = 0
    return shown.astype(np.float32)


NORMAL = View("normal", "the surface's normal, x y z as red green blue", draw, kernels=("recast",))
