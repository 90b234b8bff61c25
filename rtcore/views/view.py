"""What a view is."""
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class View:
    """A name, a line of help, and `draw(pixels, node, distance, normal, doubt)`: linear picture (h, w, 3) float32, leaf first hit (h, w),
    its distance (h, w), normal (h, w, 3) and whether it lacks a proof (h, w) to a linear picture. One that needs no light is drawn from
    the first hits alone."""

    name: str
    help: str
    draw: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
    needs_light: bool = False
