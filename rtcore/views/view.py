"""What a view is."""
import colorsys
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class Seen(NamedTuple):
    """What views are drawn from."""

    pixels: np.ndarray          # float32 (h, w, 3): the linear picture
    node: np.ndarray            # int32 (h, w): the leaf first hit, -1 none
    material: np.ndarray        # int32 (leaves): the number of its material
    distance: np.ndarray        # float32 (h, w): its distance from the eye, inf none
    count: np.ndarray           # int32 (h, w): samples so far
    # worked out only for a view that asks; arrays of its own
    normal: Callable[[], np.ndarray]        # float32 (h, w, 3): normal of that hit
    doubt: Callable[[], np.ndarray]         # uint8 (h, w): not 0 where that hit lacks a proof
    error: Callable[[], np.ndarray]         # float32 (h, w): estimated error, inf where unknown
    lit: Callable[[], np.ndarray]           # float32 (h, w): share of the lights that reach that hit
    coordinates: Callable[[], np.ndarray]   # float32 (h, w, 3): on a triangle the weights of its corners, else u, v, 0; 0 none
    tests: Callable[[], np.ndarray]         # int32 (h, w): boxes and primitives that the eye's ray must be tested against


@dataclass(frozen=True)
class View:
    """A name, a line of help, and `draw`, which makes a linear picture (h, w, 3) float32. One that needs no light is drawn from the
    first hits alone, if nothing else was asked for. needs_hits: the film must have noted the first hits; needs_lit: which lights reach
    them. kernels: the groups (`rtcore.warm`) that drawing it takes."""

    name: str
    help: str
    draw: Callable[[Seen], np.ndarray]
    needs_light: bool = False
    needs_hits: bool = True
    needs_lit: bool = False
    kernels: tuple[str, ...] = ()


def palette(n: int) -> np.ndarray:
    """`n` colours (n, 3), hues a golden section apart so that neighbours differ."""
    colors = [colorsys.hsv_to_rgb(i * 0.618033988749895 % 1, 0.65, (0.85, 0.6, 1.0)[i % 3]) for i in range(n)]
    return np.array(colors, np.float32).reshape(-1, 3)


def heat(share: np.ndarray) -> np.ndarray:
    """Shares 0 .. 1 (h, w) as linear colours (h, w, 3) from black through violet, red and orange to pale yellow, evenly brighter to the
    eye. What is above 1 is white."""
    return TONES[np.clip(np.float32(STEPS) * share, 0, STEPS + 1).astype(np.int32)]


#: Colours of `heat` as a screen shows them.
HEAT = np.array([(0, 0, 0), (0.16, 0.07, 0.35), (0.47, 0.11, 0.43), (0.77, 0.23, 0.31), (0.95, 0.47, 0.12), (0.98, 0.77, 0.23),
                 (0.99, 0.98, 0.75)])
STEPS = 1 << 12     # in which it is looked up: a fraction of what a screen shows
_PLACES = np.arange(STEPS + 2) / STEPS
TONES = np.stack([np.interp(_PLACES, np.linspace(0, 1, len(HEAT)), column, right=1.0) for column in HEAT.T], axis=-1) ** 2.2
TONES = TONES.astype(np.float32)
