"""Torus: eight quartics at once, isolated between critical points, polished on the distance itself.

With the ray's origin at the closest approach to the centre and everything scaled to R + r = 1 the quartic has no cubic term to
speak of and coefficients of order 1. Its second derivative's roots isolate those of the first, these isolate the quartic's own (Yuksel,
*High-Performance Polynomial Root Finding for Graphics*, 2022). Signs come from the factored form

    f = g₁ g₂,  g₁ = (ρ - R)² + z² - r²,  g₂ = (ρ + R)² + z² - r²,  ρ = |(x, y)|,

which does not cancel, and each root takes Newton steps on its own factor.
"""
from typing import Annotated

import numpy as np

from rtcore.bvh import PACKET, begin, new_walk, next_leaf, shrink
from rtcore.fields import Number
from rtcore.jit import inline, kernel
from rtcore.lanes import along, any_lane, dot, fma, greatest, least, load, load3, root, select, size, splat3
from rtcore.scene import Shape, invertible
from rtcore.shapes.kind import CENTER, FRONT, OWN, Kind, Packed, around, forward, into, placed, placed_bounds, put_placed, unit_hit
from rtcore.wave import DX, OX, START, record

MAJOR, MINOR = OWN, OWN + 1
STEPS = 9           # of bisected Newton: the interval is then below 1/512 of the first, or Newton has long converged


class Torus(Shape, frozen=True):
    """All points at `minor_radius` from a circle of `major_radius` about the origin in the plane z = 0. A minor radius above the major
    one gives a spindle, whose inner skin is part of the surface."""

    major_radius: Annotated[float, Number(above=0, help="radius of the circle in the middle of the tube", unit="scene units")]
    minor_radius: Annotated[float, Number(above=0, help="radius of the tube", unit="scene units")]

    def kind(self, matrix: np.ndarray) -> Kind:
        return TORUS

    def pack(self, matrix: np.ndarray) -> Packed:
        most = self.major_radius + self.minor_radius
        local = matrix @ np.diag([most] * 3 + [1.0])
        return Packed(TORUS, placed(local, invertible(local), self.major_radius / most, self.minor_radius / most)[None])


@inline
def factors(n, e, s, major, square):
    """g₁ and g₂ at n + s e."""
    p = along(n, s, e)
    off = root(p.x * p.x + p.y * p.y)
    rest = p.z * p.z - square
    return fma(off - major, off - major, rest), fma(off + major, off + major, rest)


@inline
def newton(lo, hi, rising, p, q, c, order):
    """The root of σ⁴ + pσ² + qσ + c (order 0) or of its derivative (order 1) between lo and hi, where it goes through 0 once, upward
    where `rising`. Steps that leave the bracket are halvings."""
    x = 0.5 * (lo + hi)
    for _ in range(STEPS):
        if order == 0:
            y, slope = fma(fma(fma(x, x, p), x, q), x, c), fma(fma(4 * x, x, 2 * p), x, q)
        else:
            y, slope = fma(fma(4 * x, x, 2 * p), x, q), fma(12 * x, x, 2 * p)
        below = (y < 0) ^ ~rising
        lo, hi = select(below, x, lo), select(below, hi, x)
        x = x - y / slope
        x = select((x >= lo) & (x <= hi), x, 0.5 * (lo + hi))      # at the bracket's end it has converged
    return x


@inline
def polish(n, e, s, major, square, reach):
    """Three Newton steps on the factor that is nearest to 0; a step longer than `reach` is not taken (a tangent has no slope)."""
    for _ in range(3):
        p = along(n, s, e)
        off = root(p.x * p.x + p.y * p.y)
        rest = p.z * p.z - square
        g, h = fma(off - major, off - major, rest), fma(off + major, off + major, rest)
        outer = size(g) <= size(h)
        inward = select(outer, off - major, off + major)
        slope = 2 * (inward * (p.x * e.x + p.y * e.y) / off + p.z * e.z)
        step = select(outer, g, h) / slope
        s = select(size(step) <= reach, s - step, s)
    return s


@inline
def hit_torus(rays, i, number, o, d, major, minor, side, opacity):
    """Eight rays, o and d in the unit space of a torus of these radii (numbers)."""
    start = load(rays.ray, START, i)
    speed = root(dot(d, d))
    e = d * (1 / speed)
    n = along(o, -dot(o, e), e)
    moved = dot(n, e)                       # the closest approach once more: what the first step's rounding left
    n = along(n, -moved, e)
    shift = dot(n - o, e)
    nn, square = dot(n, n), minor * minor
    inside = 1 - nn
    if not any_lane(inside >= 0):
        return
    reach = root(greatest(inside, 0)) * 1.0001 + 1e-6
    k = nn + (major * major - square)
    p = 2 * k - 4 * major * major * (e.x * e.x + e.y * e.y)
    q = -8 * major * major * (n.x * e.x + n.y * e.y)
    c = k * k - 4 * major * major * (n.x * n.x + n.y * n.y)
    bend = least(root(greatest(-p / 6, 0)), reach)
    # the derivative's roots, one in each stretch between the bends where it changes sign; else the stretch's end
    c0 = stationary(-reach, -bend, p, q)
    c1 = stationary(-bend, bend, p, q)
    c2 = stationary(bend, reach, p, q)
    best, lo = 0 * start + np.inf, -reach
    g, h = factors(n, e, lo, major, square)
    f = g * h
    for piece in range(4):
        hi = c0 if piece == 0 else c1 if piece == 1 else c2 if piece == 2 else reach
        g, h = factors(n, e, hi, major, square)
        after = g * h
        cross = ((f > 0) ^ (after > 0)) & (inside >= 0) & ~(best < np.inf)
        if side != 0:
            cross = cross & (f > 0) if side & FRONT else cross & ~(f > 0)
        if any_lane(cross):
            s = newton(lo, hi, ~(f > 0), p, q, c, 0)
            s = polish(n, e, s, major, square, 1e-2 * minor)
            t = (s + shift) / speed
            best = select(cross & (t > start), t, best)
        lo, f = hi, after
    record(rays, i, number, best, best < np.inf, opacity)


@inline
def stationary(lo, hi, p, q):
    """Where the quartic's derivative changes sign between lo and hi, else hi."""
    at_lo, at_hi = fma(fma(4 * lo, lo, 2 * p), lo, q), fma(fma(4 * hi, hi, 2 * p), hi, q)
    cross = (at_lo > 0) ^ (at_hi > 0)
    if not any_lane(cross):
        return hi
    return select(cross, newton(lo, hi, ~(at_lo > 0), p, q, q, 1), hi)


@kernel
def intersect(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    data = table.data
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree)
        node = next_leaf(walk, tree)
        while node >= 0:
            for q in range(tree.link[node, 0], tree.link[node, 0] + tree.link[node, 1]):
                for g in range(PACKET // 8):
                    if (walk.state[1] >> g) & 1:
                        i = start + g * 8
                        o = into(data, q, load3(rays.ray, OX, i) - splat3(data, q, CENTER))
                        d = into(data, q, load3(rays.ray, DX, i))
                        hit_torus(rays, i, first + q, o, d, data[q, MAJOR], data[q, MINOR], table.side[q], opacity)
            shrink(walk, rays, start)
            node = next_leaf(walk, tree)


@kernel
def surface(rays, n, out, table, first):
    last = first + table.data.shape[0]
    data = table.data
    for i in range(n):
        if first <= rays.prim[i] < last:
            q = rays.prim[i] - first
            x, y, z = unit_hit(rays, i, data, q)
            major, minor = np.float64(data[q, MAJOR]), np.float64(data[q, MINOR])
            off = np.sqrt(x * x + y * y)
            cx, cy = (x / off * major, y / off * major) if off > 0 else (major, 0.0)
            out_ = 1.0
            if abs((off + major) ** 2 + z * z - minor * minor) < abs((off - major) ** 2 + z * z - minor * minor):
                cx, cy, out_ = -cx, -cy, -1.0       # the inner skin of a spindle
            nx, ny, nz = x - cx, y - cy, z
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            if length > 0:
                nx, ny, nz = nx / length, ny / length, nz / length
            else:
                nx, ny, nz = 0.0, 0.0, 1.0
            u, v = around(out, y, x), around(out, z, off - major)
            put_placed(out, i, data, q, cx + minor * nx, cy + minor * ny, minor * nz, out_ * nx, out_ * ny, out_ * nz, u, v)


def _bounds(data, extra):
    m = forward(data)
    half = data[:, MAJOR, None] * np.hypot(m[:, :, 0], m[:, :, 1]) + data[:, MINOR, None] * np.sqrt((m ** 2).sum(2))
    return placed_bounds(data, half)


TORUS = Kind("torus", intersect, surface, _bounds, (Torus(1, 0.25), ()))
