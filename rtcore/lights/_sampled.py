"""What lights with an extent share: the place on the light that a sample of a pixel takes."""
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline, inline_new
from rtcore.lanes import LANES
from rtcore.sampling import centered


class Draw(NamedTuple):
    """What a place on a light is drawn by, the same for any wave, tile and thread."""

    target: np.ndarray      # int32: the pixel of each primary ray
    number: np.ndarray      # int32: which of its samples it is
    dimension: int          # pair of dimensions, one for each light and depth
    seed: int


@inline_new
def new_draws():
    """Room for the two numbers of eight rays."""
    return np.zeros((2, LANES))


@inline
def draw_eight(room, wave, i, draw):
    """Two numbers in 0 .. 1 for each of rays i .. i+7 of a wave that hits; for a pixel's sample 0 they are the middle."""
    for lane in range(LANES):
        if wave.rays.prim[i + lane] >= 0:
            primary = wave.owner[i + lane]
            room[0, lane], room[1, lane] = centered(draw.target[primary], draw.number[primary], draw.dimension, draw.seed)
