"""The order in which a picture is traced: lattices from coarse to fine, whole samples, then lists of single pixels."""
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

LATTICES = (16, 8, 4, 2, 1)     # their spacings
COARSEST = LATTICES[0]
TILE = 64           # lattice points along a tile's edge: 4,096 rays, some milliseconds
FURTHER = 0         # in place of a spacing: samples beyond the first
EVEN = dict.fromkeys((*LATTICES, FURTHER), TILE)
BLOCK = 8           # pixels along the edge of what is traced together


class Pass(NamedTuple):
    """What one pass traces: samples of a lattice, or more samples of listed pixels."""

    spacing: int
    skip: bool                          # what the lattice twice as coarse has already
    samples: range
    pixels: np.ndarray | None = None    # int32 (m, 3) as `eye.cast_list` takes them, in `tile_order`
    coarser: tuple[int, ...] = ()       # spacings of lattices that are traced in the same pass, before its own
    region: tuple[int, int, int, int] | None = None     # only tiles that have a part of it: x0, y0, x1, y1 in pixels, half open


def passes(coarse: bool, first: int = COARSEST) -> list[Pass]:
    """The schedule for everybody's first sample: with `coarse` lattice by lattice, those down to the spacing `first` in one pass."""
    if not coarse:
        return [Pass(1, False, range(1))]
    rest = [spacing for spacing in LATTICES if spacing < first]
    return [Pass(first, first < COARSEST, range(1), coarser=tuple(spacing for spacing in LATTICES if spacing > first)),
            *(Pass(spacing, True, range(1)) for spacing in rest)]


def further(samples: int, region: tuple | None = None) -> list[Pass]:
    """The schedule from one sample to a number of samples per pixel, all over the picture or where it has a part of a region."""
    done, result = 1, []
    while done < samples:
        result.append(Pass(1, False, range(done, min(2 * done, samples)), region=region))
        done = result[-1].samples.stop
    return result


def weight(one: Pass, width: int, height: int) -> float:
    """How much a pass is, in samples of every pixel."""
    if one.pixels is not None:
        return int((one.pixels[:, 2] - one.pixels[:, 1]).sum()) / (width * height)
    if one.region is not None:
        return len(one.samples) * sum(int(tile[2] * tile[3]) for tile in tiles(one, width, height)) / (width * height)
    return len(one.samples) * (0.75 if one.skip and not one.coarser else 1.0) / one.spacing ** 2


def tiles(one: Pass, width: int, height: int, edges: Mapping[int, int] = EVEN) -> np.ndarray:
    """What the threads take one after the other, int64 (m, 8). Tiles as `eye.cast` takes them, coarse lattices first, each from the middle
    of the picture outward. Or parts of the list that have about as many rays: the first of its rows, one past the last, rays, 1, zeros.
    edges: by the lattice's spacing, or FURTHER, how many points a tile is wide."""
    if one.pixels is not None:
        return _parts(one.pixels, edges[FURTHER] ** 2)
    result = []
    for spacing in (*one.coarser, one.spacing):
        columns, rows, edge = -(-width // spacing), -(-height // spacing), edges[FURTHER if one.samples.start else spacing]
        skip = one.skip and spacing < COARSEST
        result += [(x, y, min(edge, columns - x), min(edge, rows - y), spacing, skip, width, height)
                   for x, y in _corners(columns, rows, edge)]
    if one.region is not None:
        x0, y0, x1, y1 = one.region
        result = [tile for tile in result if tile[0] < x1 and tile[1] < y1 and tile[0] + tile[2] > x0 and tile[1] + tile[3] > y0]
    return np.array(result, np.int64).reshape(-1, 8)


def _parts(pixels: np.ndarray, most: int) -> np.ndarray:
    rays = np.concatenate([[0], np.cumsum(pixels[:, 2] - pixels[:, 1])])
    cuts = np.unique(np.searchsorted(rays[1:], np.arange(0, rays[-1], most)))
    parts = np.zeros((len(cuts), 8), np.int64)
    parts[:, 0], parts[:, 1], parts[:, 3] = cuts, [*cuts[1:], len(pixels)], 1
    parts[:, 2] = rays[parts[:, 1]] - rays[parts[:, 0]]
    return parts


def _corners(columns: int, rows: int, edge: int) -> list[tuple[int, int]]:
    corners = [(x, y) for y in range(0, rows, edge) for x in range(0, columns, edge)]
    return sorted(corners, key=lambda c: (c[0] + edge / 2 - columns / 2) ** 2 + (c[1] + edge / 2 - rows / 2) ** 2)


def tile_order(width: int, height: int) -> np.ndarray:
    """All pixels, int32 (h·w), in the order in which they are traced: tile by tile, and in each block by block."""
    across, down = -(-width // TILE), -(-height // TILE)
    number = np.full((down * TILE, across * TILE), -1, np.int32)
    number[:height, :width] = np.arange(height * width, dtype=np.int32).reshape(height, width)
    parts = TILE // BLOCK
    number = number.reshape(down, parts, BLOCK, across, parts, BLOCK).transpose(0, 3, 1, 4, 2, 5).reshape(down * across, -1)
    number = number[[y // TILE * across + x // TILE for x, y in _corners(width, height, TILE)]].ravel()
    return number[number >= 0]
