"""A colour per material: things that share one look alike."""
import numpy as np

from rtcore.views.view import View, palette


def draw(seen):
    colors = palette(int(seen.material.max(initial=-1)) + 1)[seen.material]
    return np.concatenate([colors, np.zeros((1, 3), np.float32)])[seen.node]     # -1, nothing, is the last row: black


MATERIAL = View("material", "which material is seen", draw)
