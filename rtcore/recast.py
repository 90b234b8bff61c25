"""What the eye's first rays tell when it is asked for later: where on its surface a pixel's first hit lies, and how many boxes and
primitives its ray had to be tested against. Both follow from the pixel's centre and what the film keeps of sample 0; nothing is traced, and
the kernels that trace know nothing of it.
"""
from collections.abc import Callable

import numpy as np

from rtcore.across import count, lowest_bit
from rtcore.bvh import LINK, NODE, STACK
from rtcore.film import Film, sources
from rtcore.flatten import Geometry
from rtcore.jit import inline, kernel
from rtcore.lanes import bits, greatest, least, load, wide
from rtcore.shapes.kind import normalized
from rtcore.wave import SURFACE_ROWS, U, V, finish, new_rays, put_ray

CHUNK = 1 << 13     # rays whose surface is worked out in one go: their arrays stay in the second-level cache
TINY = 2.0 ** -60   # a direction's part that counts as 0
ROUNDING = 1 + 2.0 ** -22   # the film keeps distances in float32: no box is missed for that


@inline
def _through(view, pixel, width):
    """Direction of length 1 of the ray through a pixel's centre; view as for `eye.cast`."""
    u, v = pixel % width + 0.5, pixel // width + 0.5
    return normalized(view[1, 0] + u * view[2, 0] + v * view[3, 0], view[1, 1] + u * view[2, 1] + v * view[3, 1],
                      view[1, 2] + u * view[2, 2] + v * view[3, 2])


@kernel
def cast_again(rays, n, view, width, pixels, film):
    """Fill `rays` with the first rays of n pixels as they were when they had hit."""
    for i in range(n):
        p = pixels[i]
        dx, dy, dz = _through(view, p, width)
        put_ray(rays, i, view[0, 0], view[0, 1], view[0, 2], dx, dy, dz, film.distance[p])
        rays.prim[i] = film.prim[p]
    finish(rays, n)


@kernel
def note_places(rays, surface, n, pixels, first, last, triangles, out):
    """Where the n rays that hit one of the primitives first .. last - 1 did: out[pixels[i]] becomes the weights of a triangle's corners, or
    what u and v are above a whole number, and 0."""
    for i in range(n):
        if first <= rays.prim[i] < last:
            p, u, v = pixels[i], np.float64(surface[U, i]), np.float64(surface[V, i])
            if triangles:
                out[p, 0], out[p, 1], out[p, 2] = 1 - u - v, u, v
            else:
                out[p, 0], out[p, 1], out[p, 2] = u - np.floor(u), v - np.floor(v), 0


@kernel
def count_tests(tree, primitives, view, width, pixels, distance, tests):
    """Add to tests[p] of every listed pixel the boxes and primitives of one kind that its first ray must be tested against: the children
    of all nodes that it enters before `distance`, beginning with the root, and what is in the leaves among them. Without a tree that is
    every one of so many `primitives`."""
    box, link, frame = tree.box, tree.link, tree.frame
    ox, oy, oz = (view[0, 0] - frame[0]) * frame[3], (view[0, 1] - frame[1]) * frame[3], (view[0, 2] - frame[2]) * frame[3]
    stack = np.empty(STACK, np.int64)
    for k in range(len(pixels)):
        p = pixels[k]
        if link.shape[0] == 0:
            tests[p] += primitives
            continue
        dx, dy, dz = _through(view, p, width)
        ix = 1 / (dx if abs(dx) > TINY else TINY)
        iy = 1 / (dy if abs(dy) > TINY else TINY)
        iz = 1 / (dz if abs(dz) > TINY else TINY)
        x0, x1 = (0, 3) if ix > 0 else (3, 0)
        y0, y1 = (1, 4) if iy > 0 else (4, 1)
        z0, z1 = (2, 5) if iz > 0 else (5, 2)
        far = np.float64(distance[p]) * frame[3] * ROUNDING
        stack[0], top, tested = 0, 1, 0
        while top > 0:
            top -= 1
            row = stack[top] * NODE
            ax, bx = (wide(load(box, row + x0, 0)) - ox) * ix, (wide(load(box, row + x1, 0)) - ox) * ix
            ay, by = (wide(load(box, row + y0, 0)) - oy) * iy, (wide(load(box, row + y1, 0)) - oy) * iy
            az, bz = (wide(load(box, row + z0, 0)) - oz) * iz, (wide(load(box, row + z1, 0)) - oz) * iz
            tested += count(load(box, row, 0) <= load(box, row + 3, 0))
            entered = bits(greatest(greatest(ax, ay), greatest(az, 0.0)) <= least(least(bx, by), least(bz, far)))
            while entered:
                child = link[row + LINK, lowest_bit(entered)]
                entered &= entered - 1
                if child >= 0:
                    stack[top] = child
                    top += 1
                else:
                    tested += ((-1 - child) & 7) + 1
        tests[p] += tested


class Recast:
    """The first rays of one picture. What was worked out is kept: a film's first hits don't change once they are there."""

    def __init__(self, geometry: Geometry, view: np.ndarray, width: int, height: int):
        self._geometry, self._view, self._width, self._height = geometry, view, width, height
        self._tests, self._coordinates = np.zeros(0, np.int32), np.zeros((0, 3), np.float32)
        self._tested, self._placed = np.zeros((2, 0), bool)

    def spread(self, film: Film, values: np.ndarray, spacing: int) -> np.ndarray:
        """Values of pixels, (h·w, ...), as a picture (h, w, ...): those without a sample show that of the lattice before them."""
        if film.count.all():
            return values.reshape(self._height, self._width, *values.shape[1:]).copy()
        source = np.empty(self._height * self._width, np.int32)
        sources(film, self._width, self._height, spacing, source)
        shown = values[source]
        shown[film.count[source] == 0] = 0
        return shown.reshape(self._height, self._width, *values.shape[1:])

    def tests(self, film: Film, share: Callable = map) -> np.ndarray:
        """Boxes and primitives that each pixel's first ray must be tested against, int32 (h·w); 0 where there is no sample yet. share:
        `map`, or that of a pool of threads."""
        if not len(self._tested):
            self._tests, self._tested = np.zeros(len(film.count), np.int32), np.zeros(len(film.count), bool)

        def work(pixels: np.ndarray) -> None:
            for group in self._geometry.groups:
                count_tests(group.tree, len(group.owner), self._view, self._width, pixels, film.distance, self._tests)

        for _ in share(work, self._fresh(film, self._tested)):
            pass
        return self._tests

    def coordinates(self, film: Film, share: Callable = map) -> np.ndarray:
        """Where on its surface each pixel's first hit lies, float32 (h·w, 3): on a triangle the weights of its corners, which add up to 1,
        else u, v, from 0 to 1 and again, and 0; zeros where nothing is hit or there is no sample yet."""
        if not len(self._placed):
            self._coordinates, self._placed = np.zeros((len(film.count), 3), np.float32), np.zeros(len(film.count), bool)

        def work(pixels: np.ndarray) -> None:
            rays, n = new_rays(CHUNK, self._geometry.dtype), len(pixels)
            surface = np.empty((SURFACE_ROWS, CHUNK), self._geometry.dtype)
            cast_again(rays, n, self._view, self._width, pixels, film)
            for group in self._geometry.groups:
                group.kind.surface(rays, n, surface, group.table, group.first)
                last = group.first + len(group.owner)
                note_places(rays, surface, n, pixels, group.first, last, group.kind.name == "triangle", self._coordinates)

        for _ in share(work, self._fresh(film, self._placed)):
            pass
        return self._coordinates

    @staticmethod
    def _fresh(film: Film, known: np.ndarray) -> list[np.ndarray]:
        """Pixels, int32, that have a sample by now and are not known yet, CHUNK at a time; then they are."""
        pixels = np.flatnonzero((film.count > 0) & ~known).astype(np.int32)
        known[pixels] = True
        return [pixels[start:start + CHUNK] for start in range(0, len(pixels), CHUNK)]
