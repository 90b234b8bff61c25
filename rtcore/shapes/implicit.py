"""Implicit: where a formula in x, y, z that a person typed is 0.

The formula is a tape that the kernels interpret (`_formula`, `_tape`), so a new one needs no compiling; its first root along a ray is
certified by intervals (`_march`). All of it is float64 whatever the precision of the render. A ray begins where it enters the box, a
point that is worked out in double-double: neither a far eye nor a far box costs digits.
"""
from typing import Annotated

import numpy as np

from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import inverse, parts
from rtcore.fields import FieldError, Formula, Vec, Vector
from rtcore.jit import inline, inline_new, kernel
from rtcore.lanes import greatest, least, load, load3, rounded, select, size, store, wide
from rtcore.pairs import add, multiply, two_product, two_sum
from rtcore.scene import Shape, invertible
from rtcore.shapes._formula import MOST_STEPS, compiled
from rtcore.shapes._landing import land, new_landing
from rtcore.shapes._march import (BASE, BASE_REST, BEGIN, DRIFT, END, FAR, FIRST, FLOOR, RAY_ROWS, T0, WAY, WAY_REST, march, middle,
                                  new_search)
from rtcore.shapes._precise import ROUNDING
from rtcore.shapes.kind import (FORWARD, INVERSE, OWN, REACH, Kind, Packed, Table, around, into1, normalized, placed, put_placed,
                                unit_hit)
from rtcore.wave import DX, ERR, OX, START, UNCERTIFIED, T, U, new_rays, record, until

#: Columns of Table.exact after those of a placed shape: what the inverse's float64 leave of it, the box, the tape.
INVERSE_REST, LOW, HIGH, COUNT, CODE = OWN, OWN + 9, OWN + 12, OWN + 15, OWN + 16
EXACT = CODE + 4 * MOST_STEPS
MOST_ROOTS = 1024           # along one line
UNPROVEN, GIVEN_UP = 1, 2   # bits of Rays.doubt: the hit has no proof; the search for a nearer one was not brought to its end


class Expression(Formula):
    """A formula in x, y and z."""

    def take(self, value):
        value = super().take(value)
        compiled(value)
        return value


class Implicit(Shape, frozen=True):
    """The points within the box `low` .. `high` where the value of a formula is 0. Its front is where the value is positive.

    A formula has x, y, z, numbers, pi, + - * / ^ ( ), sin cos tan exp log sqrt abs floor, min max atan2 mod of two arguments, and
    smin(a, b, k), the smaller of a and b rounded off where they differ by less than k. It is refused with the place of the mistake.
    """

    expression: Annotated[str, Expression(help="formula in x, y and z; the surface is where it is 0")]
    low: Annotated[Vec, Vector(help="corner of the box with the smallest coordinates", unit="scene units")]
    high: Annotated[Vec, Vector(help="corner of the box with the largest coordinates", unit="scene units")]

    def check(self):
        if not all(a < b for a, b in zip(self.low, self.high)):
            raise FieldError(f"three numbers each greater than those of low, {self.low}", self.high, "high")

    def kind(self, matrix: np.ndarray) -> Kind:
        return IMPLICIT

    def pack(self, matrix: np.ndarray) -> Packed:
        exact = np.zeros(EXACT)
        exact[:OWN] = placed(matrix, invertible(matrix))
        exact[INVERSE:FORWARD], exact[INVERSE_REST:LOW] = np.reshape(parts(x for row in inverse(matrix) for x in row), (2, 9))
        exact[LOW:HIGH], exact[HIGH:COUNT] = self.low, self.high
        linear, farthest = np.abs(matrix[:3, :3]), np.maximum(np.abs(self.low), np.abs(self.high))
        with np.errstate(over="ignore"):        # what overflows is refused when the table is made
            exact[REACH] = np.abs(matrix[:3, 3]).max() + (linear @ farthest).max()
            center = matrix[:3, :3] @ (np.array(self.low) / 2 + np.array(self.high) / 2) + matrix[:3, 3]
            half = linear @ (np.array(self.high) / 2 - np.array(self.low) / 2)
        tape = compiled(self.expression)
        exact[COUNT], exact[CODE:CODE + tape.size] = len(tape), tape.ravel()
        return Packed(IMPLICIT, np.concatenate([center - half, center + half])[None], exact=exact[None])


@inline_new
def take_code(code, exact, q):
    """The tape of implicit q, as the interpreter takes it."""
    count = int(exact[q, COUNT])
    for r in range(count):
        for k in range(4):
            code[r, k] = exact[q, CODE + 4 * r + k]
    return code[:count]


@inline
def slab(o, d, low, high):
    """Where eight lines enter and leave what is between two planes."""
    p, q = (low - o) / d, (high - o) / d
    within = (d == 0) & (o >= low) & (o <= high)
    return select(within, -np.inf, select(d == 0, np.inf, least(p, q))), select(within, np.inf, select(d == 0, -np.inf, greatest(p, q)))


@inline
def inward(exact, q, row, v, w):
    """Row of L times (v, w), a vector of pairs of lanes, as a pair; and the sum of its terms' sizes, of which it is off by a few 2⁻¹⁰⁶."""
    k = INVERSE + 3 * row
    p, e = 0 * v[0], 0 * v[0]
    total = p
    for j in range(3):
        s, f = multiply(0 * v[j] + exact[q, k + j], 0 * v[j] + exact[q, INVERSE_REST + 3 * row + j], v[j], w[j])
        p, e = add(p, e, s, f)
        total = total + size(s)
    return p, e, total


@inline
def bring(rays, i, exact, q, local, m):
    """Rays i .. i+7 in the space of implicit q, into columns m .. m+7 of `local`, each from where it enters the box."""
    o, d = wide(load3(rays.ray, OX, i)), wide(load3(rays.ray, DX, i))
    start, far = wide(load(rays.ray, START, i)), until(rays.ray, i)
    x, y, z = o.x - exact[q, 0], o.y - exact[q, 1], o.z - exact[q, 2]
    enter = 0 * start - np.inf
    for k in range(3):
        a, b, c = exact[q, INVERSE + 3 * k], exact[q, INVERSE + 3 * k + 1], exact[q, INVERSE + 3 * k + 2]
        near, _ = slab(a * x + b * y + c * z, a * d.x + b * d.y + c * d.z, exact[q, LOW + k], exact[q, HIGH + k])
        enter = greatest(enter, near)
    t0 = greatest(start, select(enter < np.inf, enter, -np.inf))
    t0 = select(size(t0) < np.inf, t0, 0)
    # o + t0 d - c in pairs
    x, fx = two_product(t0, d.x)
    y, fy = two_product(t0, d.y)
    z, fz = two_product(t0, d.z)
    a, e = two_sum(o.x, -exact[q, 0])
    x, fx = add(x, fx, a, e)
    a, e = two_sum(o.y, -exact[q, 1])
    y, fy = add(y, fy, a, e)
    a, e = two_sum(o.z, -exact[q, 2])
    z, fz = add(z, fz, a, e)
    none = 0 * x
    enter, leave, fast, most = start - t0, far - t0, none, 0.0
    place, speed = none, none
    for k in range(3):
        base, base1, off = inward(exact, q, k, (x, y, z), (fx, fy, fz))
        way, way1, off1 = inward(exact, q, k, (d.x, d.y, d.z), (none, none, none))
        place, speed = greatest(place, off), greatest(speed, off1)
        low, high = exact[q, LOW + k], exact[q, HIGH + k]
        near, past = slab(base, way, low, high)
        enter, leave, fast = greatest(enter, near), least(leave, past), greatest(fast, size(way))
        most = max(most, max(abs(low), abs(high)))
        store(local, BASE + k, m, base)
        store(local, WAY + k, m, way)
        store(local, BASE_REST + k, m, base1)
        store(local, WAY_REST + k, m, way1)
    store(local, DRIFT, m, ROUNDING * (place + greatest(size(enter), size(leave)) * speed))
    store(local, BEGIN, m, enter)
    store(local, END, m, leave)
    store(local, FLOOR, m, most * 2.0 ** -49 / fast)
    store(local, T0, m, t0)
    store(local, FIRST, m, start)
    store(local, FAR, m, far)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk, search = new_walk(rays), new_search()
    exact, code, local = table.exact, np.empty((MOST_STEPS, 4)), np.empty((RAY_ROWS, PACKET))
    found, doubt, roots = np.empty((1, PACKET)), np.empty(PACKET, np.uint8), np.empty((0, 2))
    single = rays.ray.itemsize == 4
    if opacity.shape[0] == 0:
        rays.doubt[:n] = 0
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                m = 0
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        bring(rays, start + g * 8, exact, q, local, m)
                        m += 8
                march(take_code(code, exact, q), search, local, m, table.side[q], single, found[0], doubt, roots)
                m = 0
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        i = start + g * 8
                        t = rounded(load(found, 0, m), load(rays.ray, T, i))
                        record(rays, i, first + q, t, t < np.inf, opacity)
                        if opacity.shape[0] == 0:
                            note_doubt(rays, i, first + q, found, doubt, m)
                        m += 8
            shrink(walk, rays, start, walk.state[ACTIVE])
            leaf = next_leaf(walk, tree, table)


@inline
def note_doubt(rays, i, p, found, doubt, m):
    """After `record` of primitive p: which of rays i .. i+7 have a hit on it without a proof, or were given up."""
    for k in range(8):
        if found[0, m + k] == np.inf:
            if doubt[m + k]:
                rays.doubt[i + k] |= GIVEN_UP
                rays.tally[UNCERTIFIED] += 1
        elif rays.prim[i + k] == p:
            rays.doubt[i + k] = rays.doubt[i + k] & GIVEN_UP | UNPROVEN * doubt[m + k]
            rays.tally[UNCERTIFIED] += doubt[m + k]


@kernel
def surface(rays, n, out, table, first):
    last, exact, landing, code = first + table.data.shape[0], table.exact, new_landing(), np.empty((MOST_STEPS, 4))
    hits, count, q = np.zeros(8, np.int64), 0, -1
    for i in range(n + 1):
        mine = i < n and first <= rays.prim[i] < last
        # eight hits on the same formula go together; here the ones before end
        if count > 0 and (i == n or count == 8 or mine and rays.prim[i] - first != q):
            box = max(exact[q, HIGH] - exact[q, LOW], max(exact[q, HIGH + 1] - exact[q, LOW + 1], exact[q, HIGH + 2] - exact[q, LOW + 2]))
            land(take_code(code, exact, q), landing, box)
            for j in range(count):
                put(out, hits[j], exact, q, landing, j)
            count = 0
        if mine:
            q = rays.prim[i] - first
            x, y, z = unit_hit(rays, i, exact, q)
            u, v, w = np.float64(rays.ray[DX, i]), np.float64(rays.ray[DX + 1, i]), np.float64(rays.ray[DX + 2, i])
            u, v, w = into1(exact, q, u, v, w)
            u, v, w = normalized(u, v, w)
            for j in range(count, 8):       # lanes without a hit of their own repeat the last one
                landing.point[0, j], landing.point[1, j], landing.point[2, j] = x, y, z
                landing.way[0, j], landing.way[1, j], landing.way[2, j] = u, v, w
            hits[count] = i
            count += 1


@inline
def put(out, i, exact, q, landing, j):
    """Surface rows of ray i, whose hit on implicit q is number j of the landing."""
    x, y, z = landing.point[0, j], landing.point[1, j], landing.point[2, j]
    u, v = 0.0, 0.0
    if out.shape[0] > U:
        u = around(out, y - middle(exact[q, LOW + 1], exact[q, HIGH + 1]), x - middle(exact[q, LOW], exact[q, HIGH]))
        v = (z - exact[q, LOW + 2]) / (exact[q, HIGH + 2] - exact[q, LOW + 2])
    put_placed(out, i, exact, q, x, y, z, landing.normal[0, j], landing.normal[1, j], landing.normal[2, j], u, v)
    scale_ = 0.0
    for k in range(3):
        scale_ = max(scale_, abs(exact[q, FORWARD + 3 * k]) + abs(exact[q, FORWARD + 3 * k + 1]) + abs(exact[q, FORWARD + 3 * k + 2]))
    # the rounding of the formula may move a flat surface further than that of the point
    out[ERR, i] = max(out[ERR, i], scale_ * landing.error[j])


def _bounds(data, extra):
    # far enough outward for what float32 has rounded away
    slack = 2.0 ** -22 * np.maximum(np.abs(data[:, :3]), np.abs(data[:, 3:]))
    return data[:, :3] - slack, data[:, 3:] + slack


@kernel
def _every_root(rays, table, side, roots):
    """Every root along ray 0 within the box of implicit 0 into roots (m, 2), as t and how often; returns how many."""
    local, code = np.empty((RAY_ROWS, 8)), np.empty((MOST_STEPS, 4))
    bring(rays, 0, table.exact, 0, local, 0)
    return march(take_code(code, table.exact, 0), new_search(), local, 1, side, False, np.empty(8), np.empty(8, np.uint8), roots)


def line_roots(shape: Implicit, matrix: np.ndarray, origin, direction, side: int = 0) -> list[float]:
    """Every t at which the line origin + t·direction crosses the shape under a 4 x 4 matrix, ascending, negative ones too; where it only
    touches, twice. Each is off by at most 8 x condition x 2⁻⁵³. side: only what faces this way, as in Table.side."""
    packed, rays = shape.pack(matrix), new_rays(1, np.float64)
    rays.ray[:], rays.ray[START], rays.ray[T] = 1, -np.inf, np.inf
    rays.ray[OX:OX + 3, 0], rays.ray[DX:DX + 3, 0] = origin, direction
    roots = np.empty((MOST_ROOTS, 2))
    table = Table(packed.data, np.zeros((0, 9)), np.zeros(1, np.int8), packed.exact)
    count = _every_root(rays, table, side, roots)
    return [float(t) for t, often in roots[:count] for _ in range(int(often))]


IMPLICIT = Kind("implicit", intersect, surface, _bounds, (Implicit("x^2 + y^2 + z^2 - 1", (-1, -1, -1), (1, 1, 1)), ()), leaf_most=1,
                doubtful=True, lasting=True)
