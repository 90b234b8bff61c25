"""Boxes around what is bounded: for framing, and for the window's selection."""
import numpy as np

from rtcore.leaves import Leaf
from rtcore.scene import Scene


def leaf_bounds(leaf: Leaf) -> tuple[np.ndarray, np.ndarray] | None:
    """Low and high corner (3,) of a leaf in the world, or None for an unbounded shape."""
    return packed_bounds(leaf.shape.pack(leaf.matrix))


def packed_bounds(packed) -> tuple[np.ndarray, np.ndarray] | None:
    """The same of what a leaf was packed to."""
    if packed.kind.bounds is None or not len(packed.data):
        return None
    low, high = packed.kind.bounds(packed.data, packed.extra)
    return low.min(0), high.max(0)


def scene_bounds(scene: Scene) -> tuple[np.ndarray, np.ndarray] | None:
    """Low and high corner (3,) of all that is visible and bounded, or None if nothing is."""
    boxes = [box for leaf in scene.leaves() if leaf.visible and (box := leaf_bounds(leaf)) is not None]
    if not boxes:
        return None
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)
