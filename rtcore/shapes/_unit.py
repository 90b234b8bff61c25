"""Rays in the unit space of a placed shape: plainly, as pairs and as expansions.

Table.exact begins with the three parts of the centre c, in which p_unit = L (p - c), and then with those of L by rows.
"""
import numpy as np

from rtcore.expansions import EXACT_NOISE, LONG, NOISE, expand, put_products
from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import load3, splat3, vec3, wide
from rtcore.pairs import add, multiply, ordered_sum, two_sum
from rtcore.wave import DX, OX

PLACE, INTO, BEYOND = 0, 9, 36      # columns: parts of c, parts of L; a kind's own numbers follow


@inline
def into_plain(exact, q, v):
    """L v by the leading parts of L."""
    a, b, c = splat3(exact, q, INTO), splat3(exact, q, INTO + 3), splat3(exact, q, INTO + 6)
    return vec3(a.x * v.x + a.y * v.y + a.z * v.z, b.x * v.x + b.y * v.y + b.z * v.z, c.x * v.x + c.y * v.y + c.z * v.z)


@inline
def row(exact, q, k, v, v1):
    """Row k of L times (v + v1), as a pair."""
    a, b, zero = INTO + 3 * k, INTO + 9 + 3 * k, 0 * v.x
    x, x1 = multiply(v.x, v1.x, exact[q, a] + zero, exact[q, b] + zero)
    y, y1 = multiply(v.y, v1.y, exact[q, a + 1] + zero, exact[q, b + 1] + zero)
    z, z1 = multiply(v.z, v1.z, exact[q, a + 2] + zero, exact[q, b + 2] + zero)
    s, s1 = add(x, x1, y, y1)
    return add(s, s1, z, z1)


@inline
def into_pairs(exact, q, v, v1):
    """L (v + v1), as pairs."""
    x, x1 = row(exact, q, 0, v, v1)
    y, y1 = row(exact, q, 1, v, v1)
    z, z1 = row(exact, q, 2, v, v1)
    return vec3(x, y, z), vec3(x1, y1, z1)


@inline
def line_in_pairs(ray, i, exact, q):
    """Origins and directions of eight rays in the unit space of primitive q, as pairs; off by 8 U64² and 4 U64² of what L's largest number
    makes of them."""
    o, d, c = wide(load3(ray, OX, i)), wide(load3(ray, DX, i)), splat3(exact, q, PLACE)
    x, x1 = two_sum(o.x, -c.x)
    y, y1 = two_sum(o.y, -c.y)
    z, z1 = two_sum(o.z, -c.z)
    zero = 0 * x
    f, f1 = into_pairs(exact, q, vec3(x, y, z), vec3(x1, y1, z1) - splat3(exact, q, PLACE + 3))
    v, v1 = into_pairs(exact, q, d, vec3(zero, zero, zero))
    return f, f1, v, v1


@inline
def line_in_unit(ray, i, exact, q, even):
    """As `line_in_pairs`, the same bits in a tenth of the time where L is `even` times the identity and `even` a power of two; else it
    is 0."""
    if even == 0:
        return line_in_pairs(ray, i, exact, q)
    f, v, c, rest = wide(load3(ray, OX, i)), wide(load3(ray, DX, i)), splat3(exact, q, PLACE), splat3(exact, q, PLACE + 3)
    x, x1 = two_sum(f.x, -c.x)
    y, y1 = two_sum(f.y, -c.y)
    z, z1 = two_sum(f.z, -c.z)
    x, x1 = ordered_sum(x, x1 - rest.x)
    y, y1 = ordered_sum(y, y1 - rest.y)
    z, z1 = ordered_sum(z, z1 - rest.z)
    zero = 0 * x
    return vec3(x, y, z) * even, vec3(x1, y1, z1) * even, v * even, vec3(zero, zero, zero)


@inline
def noise_here(exact, q, first, last):
    """What sums of the numbers of primitive q may be off: its place, L, and those whose third parts are the columns first .. last - 1.
    Less if none has a third part: then they are exact."""
    rest = 0.0
    for k in range(3):
        rest = max(rest, abs(exact[q, PLACE + 6 + k]))
    for k in range(9):
        rest = max(rest, abs(exact[q, INTO + 18 + k]))
    for k in range(first, last):
        rest = max(rest, abs(exact[q, k]))
    return NOISE if rest > 0 else EXACT_NOISE


@kernel
def line_expanded(ray, i, exact, q, f, v):
    """Origin and direction of ray i in the unit space of primitive q as expansions, into f and v (3, LONG) each. Returns their largest
    terms: what their errors are roundings of."""
    out_of_line()
    far, speed = 0.0, 0.0
    terms, g = np.empty(7 * LONG * LONG), np.empty((3, LONG))
    for k in range(3):
        terms[0] = ray[OX + k, i]
        for j in range(3):
            terms[1 + j] = -exact[q, PLACE + 3 * j + k]
        expand(terms, 4, g[k])
    for k in range(3):
        n = 0
        for j in range(3):
            a = INTO + 3 * k + j
            n = put_products(terms, n, 1.0, (exact[q, a], exact[q, a + 9], exact[q, a + 18]), g[j])
            far, speed = max(far, abs(exact[q, a] * g[j, 0])), max(speed, abs(exact[q, a] * ray[DX + j, i]))
        expand(terms, n, f[k])
        n = 0
        for j in range(3):
            a = INTO + 3 * k + j
            n = put_products(terms, n, 1.0, (exact[q, a], exact[q, a + 9], exact[q, a + 18]), (np.float64(ray[DX + j, i]), 0.0))
        expand(terms, n, v[k])
    return far, speed
