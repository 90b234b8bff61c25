"""How many boxes and primitives an eye ray must be tested against, on a logarithmic scale: black is none, white 1,023 and more."""
import numpy as np

from rtcore.views.view import View, heat

WHITE = 1 << 10     # one more than that many tests
TONES = heat(np.log2(np.arange(1, WHITE + 1)) / np.log2(WHITE) + (np.arange(WHITE) == WHITE - 1))     # by their number


def draw(seen):
    return TONES[np.minimum(seen.tests(), WHITE - 1)]


COST = View("cost", f"how many boxes and primitives an eye ray must be tested against, brighter by the octave; white: {WHITE - 1:,}", draw,
            kernels=("recast",))
