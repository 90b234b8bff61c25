"""Polygon: the plane's hit, then the crossing rule with half-open edges in the two axes that the normal points at least; in double-double
for rays that pass an edge by less than plain float64 may be off.
"""
from fractions import Fraction
from typing import Annotated

import numpy as np

from rtcore.across import lowest_bit
from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import moved, parts, rationals
from rtcore.fields import FieldError, Vec, Vectors
from rtcore.indices import among, common, rows_of
from rtcore.jit import inline, kernel
from rtcore.lanes import LANES, any_lane, bits, load, size, wide
from rtcore.pairs import add, divide, multiply, scale, subtract, two_sum
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import U64, lowest
from rtcore.shapes._flat import NORMAL, POINT, approach, exact_plane, height_and_speed, meet, settle
from rtcore.shapes._surface import put_flats
from rtcore.shapes.kind import Kind, Packed
from rtcore.wave import DX, OX, record

FLAT, DROP, FIRST, COUNT = 3, 6, 7, 8       # columns after the middle: normal, axis to drop, where the outline begins, its length
#: Columns of Table.extra after the corner: the corner seen from the middle as rounded to floats, as pairs, so that short numbers are exact.
SEEN, SEEN_REST = 3, 6


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
        seen = [parts(x - m for x, m in zip(moved(matrix, corner), rationals(exact[POINT:POINT + 3]))) for corner in corners]
        return Packed(POLYGON, np.array([row]), np.concatenate([points, seen], axis=1), exact=exact[None])


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
def in_outline(ray, i, extra, first, count, a, b, t, off):
    """Lanes whose point at t is inside the outline extra[first .. first + count - 1], in the axes a and b; and those that pass an edge, or
    the height of a corner, by less than this may be wrong about, t being off by `off` at most."""
    # all seen from the ray's origin, so that a scene far from the world's keeps its digits
    ox, oy = wide(load(ray, OX + a, i)), wide(load(ray, OX + b, i))
    u, v = wide(load(ray, DX + a, i)), wide(load(ray, DX + b, i))
    x, y = t * u, t * v
    blur_x = off * size(u) + 8 * U64 * (size(ox) + size(x))
    blur_y = off * size(v) + 8 * U64 * (size(oy) + size(y))
    inside = t < t     # no lane
    near, previous = ~(off < np.inf), first + count - 1
    for k in range(first, first + count):
        x0, y0, x1, y1 = extra[previous, a], extra[previous, b], extra[k, a], extra[k, b]
        # written from the lower end up, so that two polygons sharing an edge decide alike whichever way each runs it
        if y0 > y1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        low, wx, wy = y0 - oy, x1 - x0, y1 - y0
        across, up = x - (x0 - ox), y - low
        inside = inside ^ ((up >= 0) & (y < y1 - oy) & (across * wy < up * wx))
        most_x, most_y = blur_x + 8 * U64 * (abs(x0) + abs(x1)), blur_y + 8 * U64 * (abs(y0) + abs(y1))
        beside = size(across * wy - up * wx) <= 2 * (most_x * wy + most_y * abs(wx) + most_x * most_y)
        beside = beside & (up >= -most_y) & (y - (y1 - oy) <= most_y)
        near = near | beside | (size(up) <= most_y) | (size(y - (y1 - oy)) <= most_y)
        previous = k
    return inside, near


@inline
def seen_from_middle(ray, i, exact, q, axis, t, t1):
    """The axis's part of the points at the pair t of eight rays, as a pair, seen from the rounded middle of polygon q."""
    x, e = two_sum(wide(load(ray, OX + axis, i)), -exact[q, POINT + axis])
    p, p1 = scale(t, t1, wide(load(ray, DX + axis, i)))
    return add(x, e, p, p1)


@inline
def in_outline_closely(ray, i, exact, q, extra, first, count, a, b):
    """Lanes whose point on the plane of polygon q is inside its outline, in double-double."""
    h, h1, v, v1 = height_and_speed(ray, i, exact, q)
    t, t1 = divide(h, h1, v, v1)
    x, e = seen_from_middle(ray, i, exact, q, a, t, t1)
    y, f = seen_from_middle(ray, i, exact, q, b, t, t1)
    inside, zero = t < t, 0 * t
    previous = first + count - 1
    for k in range(first, first + count):
        low, high = previous, k
        if extra[low, SEEN + b] > extra[high, SEEN + b] or (extra[low, SEEN + b] == extra[high, SEEN + b]
                                                            and extra[low, SEEN_REST + b] > extra[high, SEEN_REST + b]):
            low, high = high, low
        x0, e0, y0, f0 = extra[low, SEEN + a], extra[low, SEEN_REST + a], extra[low, SEEN + b], extra[low, SEEN_REST + b]
        x1, e1, y1, f1 = extra[high, SEEN + a], extra[high, SEEN_REST + a], extra[high, SEEN + b], extra[high, SEEN_REST + b]
        wx, wx1 = subtract(zero + x1, zero + e1, zero + x0, zero + e0)
        wy, wy1 = subtract(zero + y1, zero + f1, zero + y0, zero + f0)
        across, across1 = subtract(x, e, zero + x0, zero + e0)
        up, up1 = subtract(y, f, zero + y0, zero + f0)
        over, _ = subtract(y, f, zero + y1, zero + f1)
        p, p1 = multiply(across, across1, wy, wy1)
        r, r1 = multiply(up, up1, wx, wx1)
        left, _ = subtract(p, p1, r, r1)
        inside = inside ^ ((up >= 0) & (over < 0) & (left < 0))
        previous = k
    return inside


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            touched = 0
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                drop, begins, count = int(table.data[q, DROP]), int(table.data[q, FIRST]), int(table.data[q, COUNT])
                active = walk.state[ACTIVE]
                while active:
                    i = start + 8 * lowest_bit(active)
                    active &= active - 1
                    a, b = (drop + 1) % 3, (drop + 2) % 3
                    t, off, todo = approach(rays.ray, i, table.exact, q)
                    if any_lane(todo):
                        inside, near = in_outline(rays.ray, i, table.extra, begins, count, a, b, t, off)
                        if any_lane(todo & near):
                            closely = in_outline_closely(rays.ray, i, table.exact, q, table.extra, begins, count, a, b)
                            inside = inside & ~near | closely & near
                        todo = todo & inside
                    if any_lane(todo):
                        touched |= 1 << (i - start) // 8
                        s, hit, unsure = meet(rays.ray, i, table.exact, q, todo, table.side[q])
                        record(rays, i, first + q, s, hit, opacity)
                        late = bits(unsure)
                        while late:
                            settle(rays, i + lowest(late), first + q, table, q, opacity)
                            late &= late - 1
            shrink(walk, rays, start, touched)
            leaf = next_leaf(walk, tree, table)


@kernel
def surface(rays, n, out, table, first):
    prim, data = rays.prim, table.data
    for i in range(0, n, LANES):
        ok = among(prim, i, first, first + data.shape[0])
        if any_lane(ok):
            rows = rows_of(prim, i, first, ok)
            row = common(rows)
            if row >= 0:
                put_flats(rays, i, ok, out, data, row, FLAT)
            else:
                put_flats(rays, i, ok, out, data, rows, FLAT)


def _bounds(data, extra):
    spans = [extra[int(f):int(f) + int(c), :3] for f, c in data[:, FIRST:COUNT + 1]]
    low, high = np.array([s.min(0) for s in spans]), np.array([s.max(0) for s in spans])
    # the hit is on the plane, beside the outline by what that is not flat or was rounded: along the axis dropped, at most √3 times that
    beside = [np.abs((s - row[:3]) @ row[FLAT:FLAT + 3]).max() for s, row in zip(spans, data)]
    pad = 1e-6 * (high - low).max(1, keepdims=True) + 2 * np.array(beside)[:, None]
    return low - pad, high + pad


POLYGON = Kind("polygon", intersect, surface, _bounds, (Polygon(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))), ()), shared_extra=True)
