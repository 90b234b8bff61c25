"""A colour per object."""
import colorsys

import numpy as np

from rtcore.views.view import View


def palette(n: int) -> np.ndarray:
    """`n` colours (n, 3), hues a golden section apart so that neighbours differ."""
    colors = [colorsys.hsv_to_rgb(i * 0.618033988749895 % 1, 0.65, (0.85, 0.6, 1.0)[i % 3]) for i in range(n)]
    return np.array(colors, np.float32).reshape(-1, 3)


def draw(seen):
    colors = np.concatenate([palette(int(seen.node.max(initial=-1)) + 1), np.zeros((1, 3), np.float32)])
    return colors[seen.node]     # -1, nothing, is the last row: black


OBJECT = View("object", "which object is seen", draw)
