"""What lights with an extent share: the place on the light that a sample of a pixel takes."""
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline
from rtcore.sampling import centered


class Draw(NamedTuple):
    """What a place on a light is drawn by, the same for any wave, tile and thread."""

    target: np.ndarray      # int32: the pixel of each primary ray
    number: np.ndarray      # int32: which of its samples it is
    dimension: int          # pair of dimensions, one for each light and depth
    seed: int


@inline
def drawn(wave, i, draw):
    """Two numbers in 0 .. 1 for ray i of a wave; for a pixel's sample 0 they are the middle."""
    primary = wave.owner[i]
    return centered(draw.target[primary], draw.number[primary], draw.dimension, draw.seed)
