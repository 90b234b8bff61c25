"""Quadric: Ax² + By² + Cz² + Dxy + Exz + Fyz + Gx + Hy + Iz + J = 0, within a box if one is given.

The quadratic is taken about the ray's closest approach to the box's middle, its discriminant by differences of products with one
rounding (Kahan), the roots by the lecture's stable pair; where A is 0 or nearly, one of them is infinite and drops out. What makes the
answer certain is in `_second.py`.
"""
import math
from fractions import Fraction
from typing import Annotated

import numpy as np

from rtcore.directions import normalized
from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.exact import inverse_parts, moved, parts, rationals
from rtcore.fields import FieldError, Maybe, Numbers, Vec, Vector
from rtcore.indices import among, common, pick, pick3, rows_of
from rtcore.jit import inline, kernel
from rtcore.lanes import LANES, any_lane, bits, select, size, vec3
from rtcore.scene import Shape, invertible
from rtcore.shapes._ball import lowest
from rtcore.shapes._second import BOX, EVERYWHERE, FORM, IN_BOX, approach, may_meet, meet, settle
from rtcore.shapes._unit import INTO
from rtcore.shapes._surface import angles, new_room, put_all_placed, put_coordinates, unit_hits
from rtcore.shapes.kind import OWN, Kind, Packed, forward, placed, placed_bounds
from rtcore.wave import U, alive, record

#: Columns after the placing: the form, the box's corners, the largest number of L, that of the form's second-degree part.
LOW, HIGH, MOST = OWN + 10, OWN + 13, OWN + 16


class Quadric(Shape, frozen=True):
    """The points where the quadratic form of the ten `coefficients`, of x², y², z², xy, xz, yz, x, y, z and 1, is 0. Its front is where
    the form is positive. `low` and `high` cut off what lies outside a box."""

    coefficients: Annotated[tuple[float, ...], Numbers(count=10, help="of x², y², z², xy, xz, yz, x, y, z and 1")]
    low: Annotated[Vec | None, Maybe(inner=Vector(), help="corner of the box with the smallest coordinates", unit="scene units")] = None
    high: Annotated[Vec | None, Maybe(inner=Vector(), help="corner of the box with the largest coordinates", unit="scene units")] = None

    def check(self):
        if not any(self.coefficients[:9]):
            raise FieldError("a coefficient other than 0 besides the last", self.coefficients, "coefficients")
        if (self.low is None) != (self.high is None):
            raise FieldError("both corners of the box, or neither", None, "low" if self.low is None else "high")
        if self.low is not None and not all(a < b for a, b in zip(self.low, self.high)):
            raise FieldError(f"three numbers each greater than those of low, {self.low}", self.high, "high")

    def kind(self, matrix: np.ndarray) -> Kind:
        return OPEN_QUADRIC if self.low is None else QUADRIC

    def pack(self, matrix: np.ndarray) -> Packed:
        invertible(matrix)
        kind = self.kind(matrix)
        low, high = np.array(self.low or (-1.0, -1.0, -1.0)), np.array(self.high or (1.0, 1.0, 1.0))    # a box that an open one won't use
        middle, half = low / 2 + high / 2, power_over((high / 2 - low / 2).max())
        form = moved_form(rationals(self.coefficients), rationals(middle), Fraction(half))
        box = [(x - m) / Fraction(half) for corner in (low, high) for x, m in zip(rationals(corner), rationals(middle))]
        exact = np.array([*parts(moved(matrix, middle), 3), *(inverse_parts(matrix) / half), *parts(form, 3), *parts(box)])
        unit = np.diag([half] * 3 + [1.0])
        unit[:3, 3] = middle
        local = matrix @ unit
        numbers = [*exact[FORM:FORM + 10], *exact[BOX:BOX + 6], np.abs(exact[INTO:INTO + 9]).max(), np.abs(exact[FORM:FORM + 6]).max()]
        return Packed(kind, placed(local, invertible(local), *numbers)[None], exact=exact[None])


def power_over(size: float) -> float:
    """The least power of two that is not below `size`."""
    mantissa, exponent = np.frexp(size)
    return float(np.ldexp(1.0, exponent - (mantissa == 0.5)))


def moved_form(coefficients, middle, half) -> list[Fraction]:
    """The coefficients (10) after p = middle + half·p', over a power of two near the largest; all rationals."""
    a, b, c, d, e, f, g, h, i, j = coefficients
    x, y, z = middle
    slope = [2 * a * x + d * y + e * z + g, d * x + 2 * b * y + f * z + h, e * x + f * y + 2 * c * z + i]
    rest = (x * (slope[0] + g) + y * (slope[1] + h) + z * (slope[2] + i)) / 2 + j
    result = [*(k * half * half for k in (a, b, c, d, e, f)), *(k * half for k in slope), rest]
    scale = Fraction(2) ** math.frexp(max(map(abs, result)))[1]
    return [k / scale for k in result]


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk, where = new_walk(rays), opacity.shape[0] == 0
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            touched = 0
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                most, curved = np.float64(table.data[q, MOST]), np.float64(table.data[q, MOST + 1])
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        i = start + g * 8
                        near = approach(rays.ray, i, table.exact, q, most, curved)
                        todo = may_meet(near) & alive(rays.ray, i)
                        if any_lane(todo):
                            touched |= 1 << g
                            t, found, unsure = meet(rays.ray, i, table.exact, q, most, 0.0, IN_BOX, 2.0, todo, near, table.side[q], where)
                            record(rays, i, first + q, t, found, opacity)
                            late = bits(unsure)
                            while late:
                                settle(rays, i + lowest(late), first + q, table, q, IN_BOX, opacity)
                                late &= late - 1
            shrink(walk, rays, start, touched)
            leaf = next_leaf(walk, tree, table)


@kernel
def intersect_open(rays, n, tree, table, first, opacity):
    where = opacity.shape[0] == 0
    for q in range(table.data.shape[0]):
        most, curved = np.float64(table.data[q, MOST]), np.float64(table.data[q, MOST + 1])
        for i in range(0, n, 8):
            near = approach(rays.ray, i, table.exact, q, most, curved)
            todo = may_meet(near) & alive(rays.ray, i)
            if any_lane(todo):
                t, found, unsure = meet(rays.ray, i, table.exact, q, most, 0.0, EVERYWHERE, 2.0, todo, near, table.side[q], where)
                record(rays, i, first + q, t, found, opacity)
                late = bits(unsure)
                while late:
                    settle(rays, i + lowest(late), first + q, table, q, EVERYWHERE, opacity)
                    late &= late - 1


@kernel
def surface(rays, n, out, table, first):
    prim, data, room = rays.prim, table.data, new_room()
    for i in range(0, n, LANES):
        ok = among(prim, i, first, first + data.shape[0])
        if any_lane(ok):
            rows = rows_of(prim, i, first, ok)
            row = common(rows)
            if row >= 0:
                _put_quadrics(rays, i, ok, out, data, row, room)
            else:
                _put_quadrics(rays, i, ok, out, data, rows, room)


@inline
def _put_quadrics(rays, i, ok, out, data, q, room):
    """Surface rows of hits on quadrics q."""
    p, square, mixed, linear = unit_hits(rays, i, data, q), pick3(data, q, OWN), pick3(data, q, OWN + 3), pick3(data, q, OWN + 6)
    slope = p
    for _ in range(2):      # the point is brought onto the surface along the gradient
        slope = vec3(2 * square.x * p.x + mixed.x * p.y + mixed.y * p.z + linear.x,
                     mixed.x * p.x + 2 * square.y * p.y + mixed.z * p.z + linear.y,
                     mixed.y * p.x + mixed.z * p.y + 2 * square.z * p.z + linear.z)
        both = slope + linear
        value = 0.5 * (p.x * both.x + p.y * both.y + p.z * both.z) + pick(data, q, OWN + 9)
        steep = slope.x * slope.x + slope.y * slope.y + slope.z * slope.z
        # at an apex the gradient vanishes, and a step along it would lead far away
        step = select((steep > 1e-12) & (size(value) < 0.01 * steep), value / steep, 0)
        p = p - slope * step
    put_all_placed(out, i, ok, data, q, p, normalized(slope))
    if out.shape[0] > U:
        put_coordinates(out, i, ok, angles(room, p.y, p.x), p.z)


def _bounds(data, extra):
    m = forward(data)
    low, high = data[:, LOW:LOW + 3], data[:, HIGH:HIGH + 3]
    middle = ((low + high) / 2)[:, None, :]
    centred = data.copy()
    centred[:, :3] += (m * middle).sum(2)
    return placed_bounds(centred, (np.abs(m) * ((high - low) / 2)[:, None, :]).sum(2))


_BALL = (1, 1, 1, 0, 0, 0, 0, 0, 0, -1)
QUADRIC = Kind("quadric", intersect, surface, _bounds, (Quadric(_BALL, (-1, -1, -1), (1, 1, 1)), ()))
OPEN_QUADRIC = Kind("open-quadric", intersect_open, surface, None, (Quadric(_BALL), ()))
