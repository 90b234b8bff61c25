"""Polygon: the plane's hit, then the crossing rule with half-open edges in the two axes that the normal points at least."""
from fractions import Fraction
from typing import Annotated

import numpy as np

from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import moved, rationals
from rtcore.fields import FieldError, Vec, Vectors
from rtcore.jit import inline, kernel
from rtcore.lanes import any_lane, bits, load, wide
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import lowest
from rtcore.shapes._flat import NORMAL, approach, exact_plane, meet, settle
from rtcore.shapes.kind import Kind, Packed, put_flat
from rtcore.wave import DX, OX, record

FLAT, DROP, FIRST, COUNT = 3, 6, 7, 8       # columns after the middle: normal, axis to drop, where the outline begins, its length


class Polygon(Shape, frozen=True):
    """A flat polygon, convex or not; its front is where the vertices run counter-clockwise. Vertices off the plane of best fit by more
    than a thousandth of the size are refused."""

    vertices: Annotated[tuple[Vec, ...], Vectors(least=3, help="the corners in order", unit="scene units")]

    def check(self):
        points = np.array(self.vertices)
        with np.errstate(over="ignore", invalid="ignore"):
            size = np.abs(points - points[0]).max()
            normal = newell(points)
        if not np.isfinite(size):
            raise FieldError("corners less than 1e308 apart", self.vertices, "vertices")
        if not size > 0 or not np.linalg.norm(normal) > 1e-14:
            raise FieldError("corners that span an area", self.vertices, "vertices")
        heights = ((points - points.mean(0)) / size) @ (normal / np.linalg.norm(normal))
        worst = int(np.abs(heights).argmax())
        if abs(heights[worst]) > 1e-3:
            raise FieldError("a corner in the plane of the others", self.vertices[worst], f"vertices[{worst}]")

    def kind(self, matrix: np.ndarray) -> Kind:
        return POLYGON

    def pack(self, matrix: np.ndarray) -> Packed:
        invertible(matrix)
        points = np.array(self.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
        corners = [rationals(corner) for corner in self.vertices]
        middle = moved(matrix, [sum(coordinates) / len(corners) for coordinates in zip(*corners)])
        exact = np.array(exact_plane(matrix, middle, exact_newell(corners)))
        normal = exact[NORMAL:NORMAL + 3] / np.linalg.norm(exact[NORMAL:NORMAL + 3])
        row = [*exact[:3], *normal, float(np.abs(normal).argmax()), 0.0, len(points)]
        return Packed(POLYGON, np.array([row]), points, exact=exact[None])


def newell(points: np.ndarray) -> np.ndarray:
    """Newell's normal of a polygon, scaled to its size: twice the area over the size squared."""
    p = points - points[0]
    p = p / max(np.abs(p).max(), np.finfo(float).tiny)
    return np.cross(p, np.roll(p, -1, axis=0)).sum(0)


def exact_newell(points) -> list[Fraction]:
    """Newell's normal of a polygon of rationals, of any length."""
    p = [[x - y for x, y in zip(point, points[0])] for point in points]
    return [sum(a[j] * b[k] - a[k] * b[j] for a, b in zip(p, p[1:])) for j, k in ((1, 2), (2, 0), (0, 1))]


@inline
def in_outline(ray, i, extra, first, count, a, b, t):
    """Lanes whose point at t is inside the outline extra[first .. first + count - 1], in the axes a and b."""
    # all seen from the ray's origin, so that a scene far from the world's keeps its digits
    ox, oy = wide(load(ray, OX + a, i)), wide(load(ray, OX + b, i))
    x, y = t * wide(load(ray, DX + a, i)), t * wide(load(ray, DX + b, i))
    inside = t < t     # no lane
    previous = first + count - 1
    for k in range(first, first + count):
        x0, y0, x1, y1 = extra[previous, a], extra[previous, b], extra[k, a], extra[k, b]
        # written from the lower end up, so that two polygons sharing an edge decide alike whichever way each runs it
        if y0 > y1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        low = y0 - oy
        inside = inside ^ ((y >= low) & (y < y1 - oy) & ((x - (x0 - ox)) * (y1 - y0) < (y - low) * (x1 - x0)))
        previous = k
    return inside


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, 1 << 30)
        leaf = next_leaf(walk, tree)
        while leaf >= 0:
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                drop, begins, count = int(table.data[q, DROP]), int(table.data[q, FIRST]), int(table.data[q, COUNT])
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        i = start + g * 8
                        t, todo = approach(rays.ray, i, table.exact, q)
                        if any_lane(todo):
                            todo = todo & in_outline(rays.ray, i, table.extra, begins, count, (drop + 1) % 3, (drop + 2) % 3, t)
                        if any_lane(todo):
                            s, hit, unsure = meet(rays.ray, i, table.exact, q, todo, table.side[q])
                            record(rays, i, first + q, s, hit, opacity)
                            late = bits(unsure)
                            while late:
                                settle(rays, i + lowest(late), first + q, table, q, opacity)
                                late &= late - 1
            shrink(walk, rays, start)
            leaf = next_leaf(walk, tree)


@kernel
def surface(rays, n, out, table, first):
    last = first + table.data.shape[0]
    for i in range(n):
        if first <= rays.prim[i] < last:
            q = rays.prim[i] - first
            put_flat(rays, i, out, table.data, q, FLAT)


def _bounds(data, extra):
    spans = [extra[int(f):int(f) + int(c)] for f, c in data[:, FIRST:COUNT + 1]]
    low, high = np.array([s.min(0) for s in spans]), np.array([s.max(0) for s in spans])
    # the hit is on the plane, beside the outline by what that is not flat or was rounded: along the axis dropped, at most √3 times that
    beside = [np.abs((s - row[:3]) @ row[FLAT:FLAT + 3]).max() for s, row in zip(spans, data)]
    pad = 1e-6 * (high - low).max(1, keepdims=True) + 2 * np.array(beside)[:, None]
    return low - pad, high + pad


POLYGON = Kind("polygon", intersect, surface, _bounds, (Polygon(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))), ()), shared_extra=True)
