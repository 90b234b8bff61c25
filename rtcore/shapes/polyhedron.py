"""Polyhedron: a solid bounded by planes, by the notes' rule: a ray is inside from the last plane it enters to the first it leaves.

Plain float64, with a bound on its error, says which of eight rays may be inside at all; those are clipped in double-double.
"""
import functools
import itertools
from typing import Annotated, NamedTuple

import numpy as np

from rtcore.across import lowest_bit
from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import dot as product, moved, parts, rationals, turned
from rtcore.fields import Field, FieldError, Vec, Vector
from rtcore.indices import among
from rtcore.jit import inline, kernel
from rtcore.lanes import LANES, any_lane, bits, dot, greatest, least, load, load3, rounded, select, size, splat3, vec3, wide, zero
from rtcore.pairs import add, divide, multiply, two_sum
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import U64, extent as length
from rtcore.shapes._surface import extent_of, hits_from, put_flat_coordinates, put_surfaces
from rtcore.shapes.kind import FRONT, Kind, Packed
from rtcore.wave import DX, OX, START, alive, record, until

MOST_PLANES = 64
#: Columns after the centre. A plane's row of Table.extra: its normal, its height above the centre, the inverse of the normal's length; what
#: the first two leave of the exact ones.
LOW, HIGH, FIRST, COUNT = 3, 6, 9, 10
HEIGHT, INVERSE, REST, HEIGHT_REST = 3, 4, 5, 8
DIM = 2.0 ** -98            # what sums of pairs may be off, as a share of their terms


class Planes(Field):
    """A list of (point, outward normal)."""

    def take(self, value):
        if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__iter__"):
            raise FieldError("a list of planes: [point, normal] each", value)
        result = []
        for i, plane in enumerate(value):
            try:
                point, normal = plane
            except (TypeError, ValueError):
                raise FieldError("a plane: [point, normal]", plane, f"[{i}]") from None
            try:
                result.append((Vector().take(point), Vector(nonzero=True).take(normal)))
            except FieldError as error:
                raise error.inside(f"[{i}]") from None
        if not 1 <= len(result) <= MOST_PLANES:
            raise FieldError(f"1 to {MOST_PLANES} planes", len(result))
        return tuple(result)


class Polyhedron(Shape, frozen=True):
    """What lies behind all `planes`, each a point and a normal that points outward. It may be unbounded, but not empty."""

    planes: Annotated[tuple[tuple[Vec, Vec], ...], Planes(help="point and outward normal of each plane")]

    def check(self):
        if body_of(self.planes).box is None:
            raise FieldError("planes with room behind all of them", [list(p) for p in self.planes], "planes")

    def kind(self, matrix: np.ndarray) -> Kind:
        return POLYHEDRON if body_of(self.planes).closed else OPEN_POLYHEDRON

    def pack(self, matrix: np.ndarray) -> Packed:
        invertible(matrix)
        points, closed, box = body_of(self.planes)
        corners = np.array(list(itertools.product(*zip(*box)))) @ matrix[:3, :3].T + matrix[:3, 3]
        low, high = corners.min(0), corners.max(0)
        # heights of the planes above a point inside: small numbers for a small solid, wherever it is
        center = brief(low / 2 + high / 2 if closed else points[0] @ matrix[:3, :3].T + matrix[:3, 3])
        rows = []
        for point, normal in self.planes:
            normal = turned(matrix, normal)
            height = product(normal, [x - c for x, c in zip(moved(matrix, point), rationals(center))])
            leading, rest = np.split(np.array(parts([*normal, height])), 2)
            rows.append([*leading, 1 / np.linalg.norm(leading[:3]), *rest])
        row = np.array([[*center, *low, *high, 0.0, len(points)]])
        return Packed(POLYHEDRON if closed else OPEN_POLYHEDRON, row, np.array(rows, float), exact=center[None])


def brief(numbers: np.ndarray) -> np.ndarray:
    """Numbers rounded to 20 bits: differences from them, and their products with short numbers, are exact."""
    mantissa, exponent = np.frexp(numbers)
    return np.ldexp(np.rint(mantissa * 2.0 ** 20), exponent - 20)


class Body(NamedTuple):
    """What planes enclose."""

    points: np.ndarray      # (n, 3): one on each plane
    closed: bool            # it has an end in every direction
    box: tuple[np.ndarray, np.ndarray] | None   # low and high corner, see `extent`


@functools.lru_cache(maxsize=1024)
def body_of(planes: tuple[tuple[Vec, Vec], ...]) -> Body:
    """The body behind some planes. It takes a millisecond for a dozen of them, 150 for 64, and is asked for with every edit."""
    points, normals = half_spaces(planes)
    return Body(points, bounded(normals), extent(points, normals))


def half_spaces(planes) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and unit outward normals (n, 3)."""
    normals = np.array([n for _, n in planes])
    normals = normals / np.abs(normals).max(1, keepdims=True)
    return np.array([p for p, _ in planes]), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def bounded(normals: np.ndarray) -> bool:
    """Whether no direction leads away from all planes' fronts for ever: the edges of the cone of such directions are crossings of two
    planes, so those are tried."""
    if np.linalg.matrix_rank(normals, tol=1e-12) < 3:
        return False
    edges = np.cross(*normals[np.array(list(itertools.combinations(range(len(normals)), 2))).T])
    lengths = np.linalg.norm(edges, axis=1, keepdims=True)
    edges = (edges / np.where(lengths > 0, lengths, 1))[lengths[:, 0] > 1e-12]
    edges = np.concatenate([edges, -edges])
    return not (edges @ normals.T <= 1e-12).all(1).any()


def extent(points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Low and high corner of the solid, cut off far outside where it is unbounded; None if it is empty. By its vertices: the
    crossings of three planes that lie behind all others."""
    middle = points.mean(0)
    far = 1e4 * max(np.abs(points - middle).max(), 1e-3 * np.abs(points).max(), 1e-100)
    box = np.concatenate([np.eye(3), -np.eye(3)])
    normals = np.concatenate([normals, box])
    heights = np.concatenate([((points - middle) * normals[:len(points)]).sum(1), np.full(6, far)])
    triples = np.array(list(itertools.combinations(range(len(normals)), 3)))
    systems = normals[triples]
    sound = np.abs(np.linalg.det(systems)) > 1e-12
    vertices = np.linalg.solve(systems[sound], heights[triples[sound]][:, :, None])[:, :, 0]
    inside = (vertices @ normals.T <= heights + 1e-9 * np.abs(vertices).max(1, keepdims=True)).all(1)
    if not inside.any():
        return None
    low, high = vertices[inside].min(0), vertices[inside].max(0)
    pad = 1e-9 * (high - low).max()
    return middle + low - pad, middle + high + pad


@inline
def plainly(o, d, extra, k):
    """Where eight rays cross plane k, plainly: what t may be off, t, the speed toward the front, how far behind the plane they start and
    what that may be off. The first is infinite, or NaN, along the plane."""
    normal = splat3(extra, k, 0)
    height, speed, most = extra[k, HEIGHT] - dot(normal, o), dot(normal, d), length(normal)
    blur = 16 * U64 * (abs(extra[k, HEIGHT]) + most * length(o))
    t = height / speed
    return (blur + 16 * U64 * most * length(d) * size(t)) / size(speed) + 4 * U64 * size(t), t, speed, height, blur


@inline
def may_meet(ray, i, exact, q, extra, first, count):
    """Of eight rays, plainly: those that may be in solid q, of the planes extra[first .. first + count - 1], within their interval; a t
    that they surely do not enter it before, or their start, and one that they surely do not leave it after, or their end."""
    o, d = wide(load3(ray, OX, i)) - splat3(exact, q, 0), wide(load3(ray, DX, i))
    enter, leave = wide(load(ray, START, i)), until(ray, i)
    there = alive(ray, i)
    for k in range(first, first + count):
        slack, t, speed, height, blur = plainly(o, d, extra, k)
        steep = slack < np.inf
        enter = select(steep & (speed < 0), greatest(t - slack, enter), enter)
        leave = select(steep & (speed > 0), least(t + slack, leave), leave)
        there = there & (steep | ~(height < -blur) | (size(speed) > 0))
    return there & ~(enter > leave), enter, leave


@inline
def height_of(normal, rest, x, y, z):
    """normal·(x, y, z) in pairs, and the size of its terms."""
    p, p1 = multiply(normal.x, rest.x, x[0], x[1])
    q, q1 = multiply(normal.y, rest.y, y[0], y[1])
    r, r1 = multiply(normal.z, rest.z, z[0], z[1])
    s, s1 = add(p, p1, q, q1)
    s, s1 = add(s, s1, r, r1)
    return s, s1, size(p) + size(q) + size(r)


@inline
def hit_solid(ray, i, exact, q, extra, first, count, near, side):
    """Where eight rays meet solid q, in their precision, and whether they do; in double-double. near: what `may_meet` says; planes that
    can't be the last entered nor the first left are passed over. Rays that miss an edge, or leave the direction of a plane, by less than
    DIM of the way count as touching it, or along it."""
    o, d, c, start = wide(load3(ray, OX, i)), wide(load3(ray, DX, i)), splat3(exact, q, 0), load(ray, START, i)
    x, y, z, zero = two_sum(o.x, -c.x), two_sum(o.y, -c.y), two_sum(o.z, -c.z), 0 * o.x
    enter, enter1, leave, leave1 = zero - np.inf, zero, zero + np.inf, zero
    todo, soonest, latest = near
    for k in range(first, first + count):
        slack, t, speed, _, _ = plainly(o - c, d, extra, k)
        if not any_lane(todo & ~((speed < 0) & (t + slack < soonest) | (speed > 0) & (t - slack > latest))):
            continue
        normal, rest = splat3(extra, k, 0), splat3(extra, k, REST)
        h, h1, terms = height_of(normal, rest, x, y, z)
        h, h1 = add(zero + extra[k, HEIGHT], zero + extra[k, HEIGHT_REST], -h, -h1)     # how far behind the plane the ray starts
        speed, speed1, most = height_of(normal, rest, (d.x, zero), (d.y, zero), (d.z, zero))
        along = size(speed) <= DIM * most
        t, t1 = divide(h, h1, speed, speed1)
        # a ray along the plane is never behind it if it starts before it
        beside = along & (h < -DIM * (terms + abs(extra[k, HEIGHT])))
        last = ~along & (speed < 0) & ((t > enter) | ((t == enter) & (t1 > enter1)))
        next_ = ~along & (speed > 0) & ((t < leave) | ((t == leave) & (t1 < leave1)))
        enter, enter1 = select(beside, np.inf, select(last, t, enter)), select(last, t1, enter1)
        leave, leave1 = select(next_, t, leave), select(next_, t1, leave1)
    apart = select((enter > -np.inf) & (leave < np.inf), (leave - enter) + (leave1 - enter1) + DIM * (size(enter) + size(leave)), 0)
    t = rounded(enter, start)
    t = select(t > start, t, rounded(leave, start))
    if side != 0:
        t = rounded(enter, start) if side & FRONT else rounded(leave, start)
    return t, todo & (enter < np.inf) & (apart >= 0) & (t < np.inf)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            touched = 0
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                begins, count = int(table.data[q, FIRST]), int(table.data[q, COUNT])
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        i = start + g * 8
                        near = may_meet(rays.ray, i, table.exact, q, table.extra, begins, count)
                        if any_lane(near[0]):
                            touched |= 1 << g
                            t, ok = hit_solid(rays.ray, i, table.exact, q, table.extra, begins, count, near, table.side[q])
                            record(rays, i, first + q, t, ok, opacity)
            shrink(walk, rays, start, touched)
            leaf = next_leaf(walk, tree, table)


@kernel
def intersect_open(rays, n, tree, table, first, opacity):
    for q in range(table.data.shape[0]):
        begins, count = int(table.data[q, FIRST]), int(table.data[q, COUNT])
        for i in range(0, n, 8):
            near = may_meet(rays.ray, i, table.exact, q, table.extra, begins, count)
            if any_lane(near[0]):
                t, ok = hit_solid(rays.ray, i, table.exact, q, table.extra, begins, count, near, table.side[q])
                record(rays, i, first + q, t, ok, opacity)


@kernel
def surface(rays, n, out, table, first):
    prim, last = rays.prim, first + table.data.shape[0]
    for i in range(0, n, LANES):
        todo = bits(among(prim, i, first, last))
        while todo:     # one polyhedron after the other, for they have different numbers of planes
            q = prim[i + lowest_bit(todo)] - first
            mine = among(prim, i, first + q, first + q + 1)
            todo &= ~bits(mine)
            _put_faces(rays, i, mine, out, table.data, table.extra, table.exact, q)


@inline
def _put_faces(rays, i, mine, out, data, extra, exact, q):
    """Surface rows of hits on polyhedron q. The face is the one whose plane the point is nearest to; the point is put onto it."""
    center = splat3(exact, q, 0)
    p = hits_from(rays, i, center)
    off, x, y, z, reach = zero(p.x) - np.inf, zero(p.x), zero(p.x), zero(p.x), 0.0
    for k in range(int(data[q, FIRST]), int(data[q, FIRST] + data[q, COUNT])):
        over = extra[k, INVERSE]
        height = (p.x * extra[k, 0] + p.y * extra[k, 1] + p.z * extra[k, 2] - extra[k, HEIGHT]) * over
        reach = max(reach, abs(extra[k, HEIGHT] * over))
        nearer = height > off
        off = select(nearer, height, off)
        x, y, z = select(nearer, extra[k, 0] * over, x), select(nearer, extra[k, 1] * over, y), select(nearer, extra[k, 2] * over, z)
    normal = vec3(x, y, z)
    p = p - normal * off
    put_surfaces(out, i, mine, center + p, normal, extent_of(center) + reach)
    put_flat_coordinates(out, i, mine, p, normal)


def _bounds(data, extra):
    return data[:, LOW:LOW + 3], data[:, HIGH:HIGH + 3]


_CORNER = tuple(((0.0, 0.0, 0.0), tuple(-float(i == k) for i in range(3))) for k in range(3))
POLYHEDRON = Kind("polyhedron", intersect, surface, _bounds, (Polyhedron((*_CORNER, ((1, 0, 0), (1, 1, 1)))), ()), shared_extra=True)
OPEN_POLYHEDRON = Kind("open-polyhedron", intersect_open, surface, None, (Polyhedron(_CORNER), ()), shared_extra=True)
