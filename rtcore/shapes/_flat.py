"""The ray and a plane, with a certain answer: what planes and polygons share.

Height above it over the speed of falling, in plain float64 first, with a bound on their errors; then, for lanes that may hit, in
double-double, with another; lanes for which that is not certain go one by one to sums in some hundred digits.

Columns of Table.exact: three parts each of a point of the plane and of its normal, whose largest number is 1/2 .. 1.
"""
import numpy as np

from rtcore.exact import parts, turned
from rtcore.expansions import LONG, NOISE, clear, expand, put_products
from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import dot, load, load3, rounded, size, splat3, wide
from rtcore.pairs import add, divide, multiply, scale, two_sum
from rtcore.shapes._ball import U64, extent
from rtcore.shapes.kind import BACK, FRONT
from rtcore.wave import DX, OX, SLOW, START, T, record_one, until

POINT, NORMAL = 0, 9


def exact_plane(matrix: np.ndarray, point, normal) -> list[float]:
    """A row of Table.exact for the plane through a point of the world (rationals), its normal given in the space of the matrix."""
    return [*parts(point, 3), *parts(turned(matrix, normal), 3)]


@inline
def approach(ray, i, exact, q):
    """Where eight rays reach plane q, plainly, what that may be off, and those that may do so within their interval."""
    p, d, normal = splat3(exact, q, POINT), wide(load3(ray, DX, i)), splat3(exact, q, NORMAL)
    down = p - wide(load3(ray, OX, i))
    height, speed = dot(normal, down), dot(normal, d)
    t = height / speed
    # the point and the normal are known to a rounding each; part by part, or every ray that leaves a level floor would be in doubt
    heft = (size(normal.x) * (size(down.x) + size(p.x)) + size(normal.y) * (size(down.y) + size(p.y))
            + size(normal.z) * (size(down.z) + size(p.z)))
    slack = 2.0 ** -20 * size(t) + 7 * U64 * heft / size(speed)
    off = 16 * U64 * (extent(down) + extent(p) + extent(d) * size(t)) / size(speed)     # no number of the normal is above 1
    start, end = wide(load(ray, START, i)), until(ray, i)
    return t, off, (end > start) & ((size(speed) <= 2.0 ** -24 * extent(d)) | ~((t + slack < start) | (t - slack > end)))


@inline
def height_and_speed(ray, i, exact, q):
    """How far below plane q eight rays start, and how fast they rise, as two pairs."""
    o, d = wide(load3(ray, OX, i)), wide(load3(ray, DX, i))
    p, p1, n, n1 = splat3(exact, q, POINT), splat3(exact, q, POINT + 3), splat3(exact, q, NORMAL), splat3(exact, q, NORMAL + 3)
    x, x1 = fall(o.x, p.x, p1.x, n.x, n1.x)
    y, y1 = fall(o.y, p.y, p1.y, n.y, n1.y)
    z, z1 = fall(o.z, p.z, p1.z, n.z, n1.z)
    h, h1 = add(x, x1, y, y1)
    h, h1 = add(h, h1, z, z1)
    x, x1 = scale(n.x, n1.x, d.x)
    y, y1 = scale(n.y, n1.y, d.y)
    z, z1 = scale(n.z, n1.z, d.z)
    v, v1 = add(x, x1, y, y1)
    v, v1 = add(v, v1, z, z1)
    return h, h1, v, v1


@inline
def meet(ray, i, exact, q, todo, side):
    """Where the lanes `todo` reach plane q: t in the rays' precision, the lanes that do, those for which this is not certain."""
    o, d, start, end = wide(load3(ray, OX, i)), wide(load3(ray, DX, i)), load(ray, START, i), load(ray, T, i)
    h, h1, v, v1 = height_and_speed(ray, i, exact, q)
    t, _ = divide(h, h1, v, v1)
    blur = 32 * U64 * U64
    reach = blur * (extent(o) + extent(splat3(exact, q, POINT)))
    turn = blur * extent(d)
    falls = size(v) > turn
    off = (reach + turn * size(t)) / (size(v) - turn)
    first, last = wide(start), until(ray, i)
    outside = (t + off < first) | (t - off > last)
    sure = falls & ((off <= U64 * size(t)) | outside)
    hit = todo & sure & ~outside
    if side == FRONT:
        hit = hit & (v < 0)
    elif side == BACK:
        hit = hit & (v > 0)
    return rounded(t, end), hit, todo & ~sure


@inline
def fall(o, p, p1, n, n1):
    """(n + n1)·((p + p1) - o) as a pair."""
    s, e = two_sum(p, -o)
    s, e = two_sum(s, e + p1)
    return multiply(s, e, n, n1)


@kernel
def settle(rays, i, p, table, q, opacity):
    """Ray i against plane q, the slow and certain way."""
    out_of_line()
    rays.tally[SLOW] += 1
    exact, ray = table.exact, rays.ray
    terms, down, height, speed = np.empty(18 * LONG + LONG), np.empty(LONG), np.empty(LONG), np.empty(LONG)
    more = np.empty(18 + LONG)
    n, m = 0, 0
    for k in range(3):
        normal = exact[q, NORMAL + k], exact[q, NORMAL + 3 + k], exact[q, NORMAL + 6 + k]
        more[0], more[1], more[2], more[3] = exact[q, POINT + k], exact[q, POINT + 3 + k], exact[q, POINT + 6 + k], -ray[OX + k, i]
        expand(more, 4, down)
        n = put_products(terms, n, 1.0, normal, down)
    expand(terms, n, height)
    for k in range(3):
        normal = exact[q, NORMAL + k], exact[q, NORMAL + 3 + k], exact[q, NORMAL + 6 + k]
        m = put_products(more, m, 1.0, normal, (np.float64(ray[DX + k, i]),))
    expand(more, m, speed)
    # a third part that is not 0 may have been rounded; then sums below what that leaves are 0
    pace, size, turned, placed = 0.0, 0.0, False, False
    for k in range(3):
        pace, size = pace + abs(ray[DX + k, i]), size + abs(ray[OX + k, i]) + abs(exact[q, POINT + k])
        turned, placed = turned or exact[q, NORMAL + 6 + k] != 0, placed or exact[q, POINT + 6 + k] != 0
    clear(speed, NOISE * pace if turned else 0.0)
    clear(height, NOISE * size if turned or placed else 0.0)
    if (speed[0] < 0 and table.side[q] != BACK) or (speed[0] > 0 and table.side[q] != FRONT):
        record_one(rays, i, p, divide(height[0], height[1], speed[0], speed[1])[0], opacity)
