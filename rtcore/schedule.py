"""The order in which a picture is traced: lattices from coarse to fine, whole samples, then lists of single pixels."""
from typing import NamedTuple

import numpy as np

COARSEST = 16       # spacing of the first lattice
TILE = 64           # lattice points along a tile's edge: 4,096 rays, some milliseconds
BLOCK = 8           # pixels along the edge of what is traced together


class Pass(NamedTuple):
    """What one pass traces: samples of a lattice, or more samples of listed pixels."""

    spacing: int
    skip: bool                          # what the lattice twice as coarse has already
    samples: range
    pixels: np.ndarray | None = None    # int32 (m, 3) as `eye.cast_list` takes them, in `tile_order`


def passes(samples: int, coarse: bool) -> list[Pass]:
    """The schedule for a number of samples per pixel."""
    spacing, result = COARSEST if coarse else 1, []
    while spacing >= 1:
        result.append(Pass(spacing, coarse and spacing < COARSEST, range(1)))
        spacing //= 2
    done = 1
    while done < samples:
        result.append(Pass(1, False, range(done, min(2 * done, samples))))
        done = result[-1].samples.stop
    return result


def weight(one: Pass, width: int, height: int) -> float:
    """How much a pass is, in samples of every pixel."""
    if one.pixels is not None:
        return int((one.pixels[:, 2] - one.pixels[:, 1]).sum()) / (width * height)
    return len(one.samples) * (0.75 if one.skip else 1.0) / one.spacing ** 2


def tiles(one: Pass, width: int, height: int) -> list[np.ndarray]:
    """What the threads take one after the other: tiles as `eye.cast` takes them, from the middle of the picture outward, or parts of the
    list that have about as many rays."""
    if one.pixels is not None:
        rays = np.cumsum(one.pixels[:, 2] - one.pixels[:, 1])
        cuts = np.searchsorted(rays, np.arange(TILE ** 2, rays[-1], TILE ** 2))
        return [part for part in np.split(one.pixels, cuts) if len(part)]
    columns, rows = -(-width // one.spacing), -(-height // one.spacing)
    rest = (one.spacing, one.skip, width, height)
    return [np.array([x, y, min(TILE, columns - x), min(TILE, rows - y), *rest], np.int64) for x, y in _corners(columns, rows)]


def _corners(columns: int, rows: int) -> list[tuple[int, int]]:
    corners = [(x, y) for y in range(0, rows, TILE) for x in range(0, columns, TILE)]
    return sorted(corners, key=lambda c: (c[0] + TILE / 2 - columns / 2) ** 2 + (c[1] + TILE / 2 - rows / 2) ** 2)


def tile_order(width: int, height: int) -> np.ndarray:
    """All pixels, int32 (h·w), in the order in which they are traced: tile by tile, and in each block by block."""
    across, down = -(-width // TILE), -(-height // TILE)
    number = np.full((down * TILE, across * TILE), -1, np.int32)
    number[:height, :width] = np.arange(height * width, dtype=np.int32).reshape(height, width)
    parts = TILE // BLOCK
    number = number.reshape(down, parts, BLOCK, across, parts, BLOCK).transpose(0, 3, 1, 4, 2, 5).reshape(down * across, -1)
    number = number[[y // TILE * across + x // TILE for x, y in _corners(width, height)]].ravel()
    return number[number >= 0]
