"""Primary rays: a tile of the picture, of a coarse lattice over it, or a list of pixels, as a wave."""
import numpy as np

from rtcore.jit import inline, kernel
from rtcore.sampling import jitter
from rtcore.shapes.kind import normalized
from rtcore.wave import finish, put_ray


@inline
def _put(wave, n, target, view, pixel, u, v):
    """Primary ray n: through (u, v) pixels from the top left, for `pixel`."""
    dx, dy, dz = normalized(view[1, 0] + u * view[2, 0] + v * view[3, 0], view[1, 1] + u * view[2, 1] + v * view[3, 1],
                            view[1, 2] + u * view[2, 2] + v * view[3, 2])
    put_ray(wave.rays, n, view[0, 0], view[0, 1], view[0, 2], dx, dy, dz, np.inf)
    wave.weight[0, n] = wave.weight[1, n] = wave.weight[2, n] = 1
    wave.owner[n] = n
    target[n] = pixel


@kernel
def cast(wave, target, view, tile, sample, seed):
    """Fill the wave with the rays of a tile and return their number; `target` (n) gets each ray's pixel, row·width + column.

    view (4, 3): eye, direction to the picture's top left corner, steps to the right and down (`Camera.rays`). tile (8,): first
    lattice column and row, columns, rows, spacing, whether to leave out what is on the lattice twice as coarse, width and height
    of the picture. Rays run through blocks of 8 x 8 pixels, so that a packet is a compact bundle.
    """
    x0, y0, columns, rows, spacing, skip, width, height = tile
    n = 0
    for by in range(0, rows, 8):
        for bx in range(0, columns, 8):
            for j in range(by, min(by + 8, rows)):
                for i in range(bx, min(bx + 8, columns)):
                    if skip and (x0 + i) % 2 == 0 and (y0 + j) % 2 == 0:
                        continue
                    x, y = (x0 + i) * spacing, (y0 + j) * spacing
                    if x >= width or y >= height:
                        continue
                    u, v = jitter(y * width + x, sample, seed)
                    _put(wave, n, target, view, y * width + x, u + x, v + y)
                    n += 1
    finish(wave.rays, n)
    return n


@kernel
def cast_list(wave, target, view, width, pixels, seed):
    """Fill the wave with rays for a list of pixels and return their number; view and `target` as for `cast`. pixels (m, 3): a pixel's
    number, its first sample and the one after its last. A pixel's samples follow one another, so that a packet is a narrow bundle."""
    n = 0
    for i in range(len(pixels)):
        pixel, x, y = pixels[i, 0], pixels[i, 0] % width, pixels[i, 0] // width
        for sample in range(pixels[i, 1], pixels[i, 2]):
            u, v = jitter(pixel, sample, seed)
            _put(wave, n, target, view, pixel, u + x, v + y)
            n += 1
    finish(wave.rays, n)
    return n
