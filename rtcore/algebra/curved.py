"""Curved shapes along a line: polynomials in the line's parameter that are positive outside.

Each function takes a shape and its `Place` and gives a function from a line of the world to its crossings. All numbers are whole: a
shape's, n / 2^shift, and the line's are brought over one denominator, by which the whole equation is multiplied.
"""
import functools
import math
from collections.abc import Callable
from typing import NamedTuple

from rtcore.algebra.lines import Line, Place, dot, dyadic, minus, times as stretched
from rtcore.algebra.polynomials import Poly, plus, rootless, scaled, sign, times
from rtcore.algebra.roots import Rational, Root, compare, real_roots

Find = Callable[[Line], list["Crossing"]]


class Crossing(NamedTuple):
    """Where a line meets a surface: a root, its multiplicity, and the sign of normal · direction, which is 0 at a tangent."""

    root: Root
    times: int
    facing: int


def crossings_of(outside: Poly) -> list[Crossing]:
    """The roots of a polynomial that is positive on the front of a surface; none of one that is 0, whose line runs in the surface."""
    roots = real_roots(outside)
    if not roots:
        return []
    degree = max(i for i, c in enumerate(outside) if c)
    now, found = sign(outside[degree]) * (-1) ** degree, []
    for root, multiplicity in roots:
        now *= (-1) ** multiplicity
        found.append(Crossing(root, multiplicity, now if multiplicity == 1 else 0))
    return found


def seen_from(line: Line, point, shift: int) -> tuple:
    """The line's points minus point / 2^shift, f + u g, times 2^shift · line.scale."""
    return minus(stretched(1 << shift, line.origin), stretched(line.scale, point)), stretched(1 << shift, line.direction)


def square(f, g) -> Poly:
    """|f + u g|²."""
    return [dot(f, f), 2 * dot(f, g), dot(g, g)]


def sphere(shape, place: Place) -> Find:
    (*center, radius), shift = dyadic(*shape.center, shape.radius)

    def find(line: Line) -> list[Crossing]:
        line = place.local(line)
        return crossings_of(plus(square(*seen_from(line, center, shift)), [-(radius * line.scale) ** 2]))
    return find


def quadric(shape, place: Place) -> Find:
    coefficients, _ = dyadic(*shape.coefficients)
    box = None if shape.low is None else dyadic(*shape.low, *shape.high)

    def find(line: Line) -> list[Crossing]:
        origin, direction, scale = line = place.local(line)
        x, y, z = ([p, q] for p, q in zip(origin, direction))
        terms = (times(x, x), times(y, y), times(z, z), times(x, y), times(x, z), times(y, z),
                 scaled(x, scale), scaled(y, scale), scaled(z, scale), [scale * scale])
        found = crossings_of(functools.reduce(plus, (scaled(term, c) for term, c in zip(terms, coefficients)), []))
        if box is None or not found:
            return found
        ends, shift = box
        within = []
        for k in range(3):
            place_k = [origin[k] << shift, direction[k] << shift]
            within += [plus(place_k, [-ends[k] * scale]), plus(scaled(place_k, -1), [ends[3 + k] * scale])]
        return [c for c in found if all(c.root.sign_of(w) >= 0 for w in within)]
    return find


def cylinder(shape, place: Place) -> Find:
    return frustum(shape, (shape.radius, shape.radius), place)


def cone(shape, place: Place) -> Find:
    return frustum(shape, (shape.base_radius, shape.apex_radius), place)


def frustum(shape, radii, place: Place) -> Find:
    """With q = p - base, A = apex - base and h = q · A its wall is A·A (A·A |q|² - h²) = (r₀ A·A + (r₁ - r₀) h)²."""
    numbers, shift = dyadic(*shape.base, *shape.apex, *radii)
    base, axis, (r0, r1) = numbers[:3], minus(numbers[3:6], numbers[:3]), numbers[6:]
    length2 = dot(axis, axis)

    def find(line: Line) -> list[Crossing]:
        line = place.local(line)
        f, g = seen_from(line, base, shift)
        q2, h, top = square(f, g), [dot(f, axis), dot(g, axis)], length2 * line.scale
        radius = plus([r0 * top], scaled(h, r1 - r0))
        wall = plus(scaled(plus(scaled(q2, length2), scaled(times(h, h), -1)), length2), scaled(times(radius, radius), -1))
        below = plus([top], scaled(h, -1))
        found = [c for c in crossings_of(wall) if c.root.sign_of(h) >= 0 and c.root.sign_of(below) >= 0]
        if shape.capped and h[1]:
            for height, reach, way in ((0, r0 * r0, -1), (top, r1 * r1 + length2, 1)):
                root = Rational(height - h[0], h[1])
                if reach > (length2 if height else 0) and root.sign_of(plus(q2, [-reach * line.scale ** 2])) <= 0:
                    found.append(Crossing(root, 1, way * sign(h[1])))
        return found
    return find


def torus(shape, place: Place) -> Find:
    """(|p|² + R² - r²)² = 4 R² (x² + y²)."""
    (big, small), shift = dyadic(shape.major_radius, shape.minor_radius)

    def find(line: Line) -> list[Crossing]:
        line = place.local(line)
        f, g = seen_from(line, (0, 0, 0), shift)
        p2, unit = square(f, g), line.scale ** 2
        if p2[1] ** 2 < 4 * p2[2] * (p2[0] - (big + small) ** 2 * unit):
            return []       # farther from the middle than any point of the torus
        whole = plus(p2, [(big * big - small * small) * unit])
        flat = square((f[0], f[1], 0), (g[0], g[1], 0))
        return crossings_of(plus(times(whole, whole), scaled(flat, -4 * big * big * unit)))
    return find


def blob(shape, place: Place) -> Find:
    """The ends of the elements' spheres cut the line into stretches, on each of which the field is one quartic."""
    spheres, shift = dyadic(*(x for center, radius, _ in shape.elements for x in (*center, radius)))
    (threshold, *strengths), _ = dyadic(shape.threshold, *(strength for _, _, strength in shape.elements))
    strong = max(1, *strengths)
    level = threshold / strong * (1 - 1e-9)
    elements = [(spheres[4 * k:4 * k + 3], spheres[4 * k + 3], strength) for k, strength in enumerate(strengths) if strength]

    def find(line: Line) -> list[Crossing]:
        line = place.local(line)
        ends = []
        for center, radius, strength in elements:
            reach = (radius * line.scale) ** 2
            depth = plus([reach], scaled(square(*seen_from(line, center, shift)), -1))
            roots = real_roots(depth)
            if len(roots) == 2:
                c, b, a = depth
                peak = (4 * a * c - b * b) / (4 * a * reach)
                element = depth, radius ** 4, strength, max(strength, 0) / strong * peak ** 2
                ends += [(root, element) for root, _ in roots]
        ends.sort(key=functools.cmp_to_key(lambda a, b: compare(a[0], b[0])))
        found, active = [], []
        for (low, element), (high, _) in zip(ends, ends[1:]):
            # of an element's two ends the first puts it in and the second takes it out
            known = len(active)
            active = [a for a in active if a is not element]
            if len(active) == known:
                active.append(element)
            if sum(most for *_, most in active) < level or compare(low, high) == 0:
                continue
            common = math.lcm(*(fourth for _, fourth, _, _ in active))
            outside = [threshold * common * line.scale ** 4]
            for depth, fourth, strength, _ in active:
                outside = plus(outside, scaled(times(depth, depth), -strength * (common // fourth)))
            if not rootless(outside, low.cell(24)[0], high.cell(24)[0] + 1, 24):
                found += [c for c in crossings_of(outside) if compare(c.root, low) >= 0 and compare(c.root, high) < 0]
        return found
    return find
