"""What a view is."""
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class Seen(NamedTuple):
    """What views are drawn from."""

    pixels: np.ndarray          # float32 (h, w, 3): the linear picture
    node: np.ndarray            # int32 (h, w): the leaf first hit, -1 none
    distance: np.ndarray        # float32 (h, w): its distance from the eye, inf none
    normal: np.ndarray          # float32 (h, w, 3): its normal, 0 none
    doubt: np.ndarray           # uint8 (h, w): 1 where that hit lacks a proof
    count: np.ndarray           # int32 (h, w): samples so far
    error: np.ndarray | None    # float32 (h, w): estimated error, inf where unknown; only for a view that needs it


@dataclass(frozen=True)
class View:
    """A name, a line of help, and `draw`, which makes a linear picture (h, w, 3) float32. One that needs no light is drawn from the
    first hits alone, if nothing else was asked for."""

    name: str
    help: str
    draw: Callable[[Seen], np.ndarray]
    needs_light: bool = False
    needs_error: bool = False


def heat(share: np.ndarray) -> np.ndarray:
    """Shares 0 .. 1 (h, w) as linear colours (h, w, 3) from black through violet, red and orange to pale yellow, evenly brighter to the
    eye: a shade below 0 is black, and one above 1 is white."""
    places = np.linspace(0, 1, len(HEAT))
    colors = np.stack([np.interp(share, places, HEAT[:, k], right=1.0) for k in range(3)], axis=-1)
    return (colors ** 2.2).astype(np.float32)


#: Colours of `heat` as a screen shows them.
HEAT = np.array([(0, 0, 0), (0.16, 0.07, 0.35), (0.47, 0.11, 0.43), (0.77, 0.23, 0.31), (0.95, 0.47, 0.12), (0.98, 0.77, 0.23),
                 (0.99, 0.98, 0.75)])
