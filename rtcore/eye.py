"""Primary rays: a tile of the picture, of a coarse lattice over it, or a list of pixels, as a wave."""
import numpy as np

from rtcore.directions import normalized
from rtcore.jit import inline, inline_new, kernel
from rtcore.lanes import LANES, fill, load, rounded, splat, store, vec3, zero
from rtcore.neighbours import count_up
from rtcore.sampling import jitter
from rtcore.wave import DX, OX, START, T, finish


@inline_new
def _new_places():
    """Room for where eight rays go through the picture, (2, 8), in pixels from the top left."""
    return np.zeros((2, LANES))


@inline
def _put(wave, n, target, places, pixel, x, y):
    """Note that primary ray n goes through (x, y), for `pixel`."""
    places[0, n & 7], places[1, n & 7] = x, y
    target[n] = pixel


@inline_new
def _new_numbers():
    """0 .. 7."""
    made = np.zeros((1, LANES))
    for lane in range(LANES):
        made[0, lane] = lane
    return made


@inline
def _aim(wave, n, u, v, view):
    """Primary rays n .. n+7 through the places (u, v) of the picture, in pixels from the top left."""
    ray = wave.rays.ray
    d = normalized(vec3(view[1, 0] + u * view[2, 0] + v * view[3, 0], view[1, 1] + u * view[2, 1] + v * view[3, 1],
                        view[1, 2] + u * view[2, 2] + v * view[3, 2]))
    like = load(ray, OX, n)
    store(ray, OX, n, zero(like) + view[0, 0])
    store(ray, OX + 1, n, zero(like) + view[0, 1])
    store(ray, OX + 2, n, zero(like) + view[0, 2])
    store(ray, DX, n, rounded(d.x, like))
    store(ray, DX + 1, n, rounded(d.y, like))
    store(ray, DX + 2, n, rounded(d.z, like))
    store(ray, START, n, zero(like))
    store(ray, T, n, zero(like) + np.inf)
    fill(wave.rays.prim, n, -1)
    fill(wave.rays.depth, n, 0)
    for k in range(3):
        store(wave.weight, k, n, splat(np.float32(1)))
    count_up(wave.owner, n, n, 1)


@kernel
def cast(wave, target, view, tile, sample, seed):
    """Fill the wave with the rays of a tile and return their number; `target` (n) gets each ray's pixel, row·width + column.

    view (4, 3): eye, direction to the picture's top left corner, steps to the right and down (`Camera.rays`). tile (8,): first
    lattice column and row, columns, rows, spacing, whether to leave out what is on the lattice twice as coarse, width and height
    of the picture. Rays run through blocks of 8 x 8 pixels, so that a packet is a compact bundle.
    """
    x0, y0, columns, rows, spacing, skip, width, height = tile
    n, places, lanes = 0, _new_places(), load(_new_numbers(), 0, 0)
    for by in range(0, rows, 8):
        for bx in range(0, columns, 8):
            # whole rows before those with gaps: eight neighbours are noted in the film at once
            for gaps in range(1 + skip):
                for j in range(by, min(by + 8, rows)):
                    if skip and (y0 + j) % 2 == gaps:
                        continue
                    x, y = (x0 + bx) * spacing, (y0 + j) * spacing
                    if sample == 0 and not gaps and n & 7 == 0 and bx + 8 <= columns and x + 7 * spacing < width and y < height:
                        # the centres of eight pixels in a row
                        count_up(target, n, y * width + x, spacing)
                        _aim(wave, n, lanes * spacing + (x + 0.5), zero(lanes) + (y + 0.5), view)
                        n += 8
                        continue
                    for i in range(bx, min(bx + 8, columns)):
                        x, y = (x0 + i) * spacing, (y0 + j) * spacing
                        if gaps and (x0 + i) % 2 == 0 or x >= width or y >= height:
                            continue
                        u, v = jitter(y * width + x, sample, seed)
                        _put(wave, n, target, places, y * width + x, u + x, v + y)
                        n += 1
                        if n & 7 == 0:
                            _aim(wave, n - 8, load(places, 0, 0), load(places, 1, 0), view)
    if n & 7:
        _aim(wave, n & -8, load(places, 0, 0), load(places, 1, 0), view)
    finish(wave.rays, n)
    return n


@kernel
def cast_list(wave, target, number, view, width, pixels, seed):
    """Fill the wave with rays for a list of pixels and return how many; view and `target` as for `cast`, number (n): which of its pixel's
    samples each is. pixels (m, 3): a pixel's number, its first sample and the one after its last. A pixel's samples follow one another, so
    that a packet is a narrow bundle."""
    n, places = 0, _new_places()
    for i in range(len(pixels)):
        pixel, x, y = pixels[i, 0], pixels[i, 0] % width, pixels[i, 0] // width
        for sample in range(pixels[i, 1], pixels[i, 2]):
            u, v = jitter(pixel, sample, seed)
            number[n] = sample
            _put(wave, n, target, places, pixel, u + x, v + y)
            n += 1
            if n & 7 == 0:
                _aim(wave, n - 8, load(places, 0, 0), load(places, 1, 0), view)
    if n & 7:
        _aim(wave, n & -8, load(places, 0, 0), load(places, 1, 0), view)
    finish(wave.rays, n)
    return n
