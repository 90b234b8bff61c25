"""Which share of the lights reaches the first hit: white where all do, blue where none does, because something is in the way or the
surface is turned away from them. Nothing is black."""
import numpy as np

from rtcore.views.view import View

SHADE = np.array((0.01, 0.03, 0.16), np.float32)


def draw(seen):
    shown = SHADE + seen.lit()[:, :, None] * (1 - SHADE)
    shown[seen.node < 0] = 0
    return shown


SHADOW = View("shadow", "which share of the lights reaches what is seen: white all, blue none", draw, needs_light=True, needs_lit=True,
              kernels=("recast",))
