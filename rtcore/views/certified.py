"""Where the first hit is proven: the picture in grey, orange where a formula's root, or that there is none, was not certified, and where a
textbook's formula found it."""
import numpy as np

from rtcore.views.view import View

ORANGE = np.array((1.0, 0.25, 0.0), np.float32)


def draw(seen):
    shown = np.repeat(0.6 * (seen.pixels @ np.array((0.2126, 0.7152, 0.0722), np.float32))[:, :, None], 3, axis=2)
    doubtful = seen.doubt() != 0
    shown[doubtful] = 0.3 * shown[doubtful] + 0.7 * ORANGE
    return shown


CERTIFIED = View("certified", "which hits are certain; orange ones are not", draw, needs_light=True,
                 kernels=("recast",))
