"""How many boxes and primitives an eye ray must be tested against, on a logarithmic scale: black is none, white 1,023 and more."""
import numpy as np

from rtcore.views.view import View, heat

WHITE = 1 << 10     # one more than that many tests


def draw(seen):
    return heat(np.log2(1.0 + seen.tests()) / np.log2(WHITE))


COST = View("cost", f"how many boxes and primitives an eye ray must be tested against, brighter by the octave; white: {WHITE - 1:,}", draw,
            kernels=("recast",))
