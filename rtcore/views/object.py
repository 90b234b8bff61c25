"""A colour per object."""
import numpy as np

from rtcore.views.view import View, palette


def draw(seen):
    colors = np.concatenate([palette(int(seen.node.max(initial=-1)) + 1), np.zeros((1, 3), np.float32)])
    return colors[seen.node]     # -1, nothing, is the last row: black


OBJECT = View("object", "which object is seen", draw)
