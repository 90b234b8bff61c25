"""How many samples each pixel has, in octaves: black is the fewest."""
import numpy as np

from rtcore.views.view import View, heat


def draw(seen):
    octaves = np.log2(np.maximum(seen.count, 1))
    least = octaves.min()
    return heat((octaves - least + 1) / max(octaves.max() - least + 1, 6))


SAMPLES = View("samples", "how many samples each pixel has got, brighter by the octave", draw, needs_light=True, needs_hits=False)
