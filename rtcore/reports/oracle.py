"""Brute-force twins of the kernels: what a ray meets, in 50 digits, one ray and one shape at a time.

Every formula works on the record as its author wrote it, in the shape's own space, to which the exact inverse of the node's matrix takes
the ray. None uses the kernels' tricks (unit shapes, closest approach, shear, boxes): the quadratics are the textbook's, flat shapes are
solved as linear systems, a box is six rectangles. At 50 digits cancellation is no concern.
"""
import functools
import warnings
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from rtcore.reports import formulas
from rtcore.shapes import Blob, Box, Cone, Cylinder, Implicit, Mesh, Plane, Polygon, Polyhedron, Quadric, Sphere, Torus, Triangle

try:
    import mpmath
except ModuleNotFoundError:
    raise ModuleNotFoundError("the stability report compares with mpmath: pip install mpmath", name="mpmath") from None

mp = mpmath.MPContext()
mp.dps = 50
NOTHING = mp.mpf(10) ** -44     # of the size of its terms: a sum that is 0 but for the last digits; no float64 numbers leave so little


class Crossing(NamedTuple):
    """Where a ray crosses a surface: the t, and the unit normal on the front, in the space of the ray."""

    t: mpmath.mpf
    normal: tuple


def vector(numbers) -> tuple:
    """Three numbers exactly as they are."""
    return tuple(mp.mpf(float(x)) if not isinstance(x, mp.mpf) else x for x in numbers)


def add(a, b):
    return tuple(x + y for x, y in zip(a, b))


def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def times(s, a):
    return tuple(s * x for x in a)


def dot(a, b):
    return sum((x * y for x, y in zip(a, b)), mp.mpf(0))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    """At length 1; the normal of a singular point, 0, stays 0."""
    return times(1 / mp.sqrt(dot(a, a)), a) if any(a) else a


def determinant(a, b, c):
    return dot(a, cross(b, c))


def quadratic(a, b, c) -> list:
    """Real roots of a t² + 2 b t + c; a double one twice."""
    if a == 0:
        return [-c / (2 * b)] if b != 0 else []
    if c == 0:      # exactly, not but for a root's last digit
        return sorted([mp.mpf(0), -2 * b / a])
    square = b * b - a * c
    if abs(square) <= NOTHING * (b * b + abs(a * c)):
        square = mp.mpf(0)
    return [] if square < 0 else [(-b - mp.sqrt(square)) / a, (-b + mp.sqrt(square)) / a]


def real_roots(coefficients, tolerance) -> list:
    """Real roots of a polynomial, highest power first, each as often as it counts: those whose imaginary part is less than the tolerance,
    relative to 1 + |root|."""
    with warnings.catch_warnings():     # newer releases of mpmath want the order of coefficients said, older ones don't know the word
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            roots = mp.polyroots(coefficients, maxsteps=100, extraprec=400)
        except mp.NoConvergence:        # roots of high multiplicity: those of p / gcd(p, p') are simple, the rest are the gcd's
            whole = [Fraction(*mpmath.libmp.to_rational(x._mpf_)) for x in coefficients]
            common = gcd(whole, [x * (len(whole) - 1 - k) for k, x in enumerate(whole[:-1])])
            if len(common) == 1:
                raise
            parts = [[mp.mpf(x.numerator) / x.denominator for x in part] for part in (divided(whole, common)[0], common)]
            return [root for part in parts if len(part) > 1 for root in real_roots(part, tolerance)]
    return [mp.re(root) for root in roots if abs(mp.im(root)) <= tolerance * (1 + abs(root))]


def divided(a: list, b: list) -> tuple[list, list]:
    """Quotient and remainder of two polynomials of fractions, highest power first."""
    a, quotient = list(a), []
    while len(a) >= len(b):
        quotient.append(a[0] / b[0])
        a = [x - quotient[-1] * y for x, y in zip(a, b + [0] * (len(a) - len(b)))][1:]
    return quotient, a


def gcd(a: list, b: list) -> list:
    """The greatest common divisor of two polynomials of fractions, its leading coefficient 1."""
    while b:
        remainder = divided(a, b)[1]
        while remainder and remainder[0] == 0:
            remainder.pop(0)
        a, b = b, remainder
    return [x / a[0] for x in a]


def power_near(x):
    """A power of two near x, by which numbers are scaled without rounding: a double root stays one."""
    return mp.mpf(2) ** mp.floor(mp.log(x, 2))


# --- the shapes: (t, normal of any length) of every crossing with o + t d ---

def _sphere(s: Sphere, o, d):
    f = sub(o, vector(s.center))
    for t in quadratic(dot(d, d), dot(f, d), dot(f, f) - mp.mpf(s.radius) ** 2):
        yield t, add(f, times(t, d))


def _plane(s: Plane, o, d):
    n = vector(s.normal)
    if dot(n, d) != 0:
        yield dot(n, sub(vector(s.point), o)) / dot(n, d), n


def _corners(a, b, c, o, d):
    """a + β (b - a) + γ (c - a) = o + t d by Cramer's rule."""
    a, b, c = vector(a), vector(b), vector(c)
    e, f, minus, s = sub(b, a), sub(c, a), times(-1, d), sub(o, a)
    whole = determinant(e, f, minus)
    if whole != 0:
        beta, gamma = determinant(s, f, minus) / whole, determinant(e, s, minus) / whole
        if beta >= 0 and gamma >= 0 and beta + gamma <= 1:
            yield determinant(e, f, s) / whole, cross(e, f)


def _triangle(s: Triangle, o, d):
    yield from _corners(s.a, s.b, s.c, o, d)


def _mesh(s: Mesh, o, d):
    for face in s.faces:
        yield from _corners(*s.vertices[face], o, d)


def _polygon(s: Polygon, o, d):
    """The winding number about the point where the ray meets the plane, in coordinates of the plane."""
    points = [vector(p) for p in s.vertices]
    n = (mp.mpf(0),) * 3
    for p, q in zip(points, points[1:] + points[:1]):
        n = add(n, cross(sub(p, points[0]), sub(q, points[0])))
    if dot(n, d) == 0:
        return
    t = dot(n, sub(points[0], o)) / dot(n, d)
    x = next(e for e in (sub(p, points[0]) for p in points[1:]) if dot(e, e) > 0)
    y = cross(n, x)
    hit = add(o, times(t, d))
    flat = [(dot(sub(p, hit), x), dot(sub(p, hit), y)) for p in points]
    winding = 0
    for (px, py), (qx, qy) in zip(flat, flat[1:] + flat[:1]):
        left = px * qy - qx * py
        if py <= 0 < qy and left > 0:
            winding += 1
        elif qy <= 0 < py and left < 0:
            winding -= 1
    if winding:
        yield t, n


def _box(s: Box, o, d):
    for k in range(3):
        for end, sign in ((s.low, -1), (s.high, 1)):
            if d[k] == 0:
                continue
            t = (mp.mpf(end[k]) - o[k]) / d[k]
            p = add(o, times(t, d))
            if all(s.low[j] <= p[j] <= s.high[j] for j in range(3) if j != k):
                yield t, tuple(mp.mpf(sign if j == k else 0) for j in range(3))


def _round(base, base_radius, apex, apex_radius, capped, o, d):
    """|p - base|² - h² = (r0 + k h)², h the height along the axis; then the discs."""
    base, axis = vector(base), sub(vector(apex), vector(base))
    length = mp.sqrt(dot(axis, axis))
    w = times(1 / length, axis)
    r0, r1 = mp.mpf(base_radius), mp.mpf(apex_radius)
    k = (r1 - r0) / length
    f = sub(o, base)
    fh, dh = dot(f, w), dot(d, w)
    a = dot(d, d) - dh * dh - (k * dh) ** 2
    b = dot(f, d) - fh * dh - (r0 + k * fh) * k * dh
    c = dot(f, f) - fh * fh - (r0 + k * fh) ** 2
    for t in quadratic(a, b, c):
        height = fh + t * dh
        if -NOTHING * length <= height <= (1 + NOTHING) * length:       # the apex and the rims belong to it
            radial = sub(add(f, times(t, d)), times(height, w))
            radius = r0 + k * height
            if radius > 0:
                yield t, sub(times(1 / radius, radial), times(k, w))
            else:
                yield t, times(-1 if k > 0 else 1, w)
    if capped and dh != 0:
        for height, radius, sign in ((mp.mpf(0), r0, -1), (length, r1, 1)):
            t = (height - fh) / dh
            off = sub(add(f, times(t, d)), times(height, w))
            if dot(off, off) <= radius * radius:
                yield t, times(sign, w)


def _cylinder(s: Cylinder, o, d):
    yield from _round(s.base, s.radius, s.apex, s.radius, s.capped, o, d)


def _cone(s: Cone, o, d):
    yield from _round(s.base, s.base_radius, s.apex, s.apex_radius, s.capped, o, d)


def _quadric(s: Quadric, o, d):
    """The form as the sum of its ten terms, each written out along the ray."""
    a, b, c, m, n, p, g, h, i, j = (mp.mpf(x) for x in s.coefficients)
    (x, y, z), (u, v, w) = o, d
    square = a * u * u + b * v * v + c * w * w + m * u * v + n * u * w + p * v * w
    mixed = m * (x * v + y * u) + n * (x * w + z * u) + p * (y * w + z * v)
    half = (2 * (a * x * u + b * y * v + c * z * w) + mixed + g * u + h * v + i * w) / 2
    rest = a * x * x + b * y * y + c * z * z + m * x * y + n * x * z + p * y * z + g * x + h * y + i * z + j
    for t in quadratic(square, half, rest):
        x, y, z = at = add(o, times(t, d))
        if s.low is None or all(s.low[k] <= at[k] <= s.high[k] for k in range(3)):
            yield t, (2 * a * x + m * y + n * z + g, 2 * b * y + m * x + p * z + h, 2 * c * z + n * x + p * y + i)


def _torus(s: Torus, o, d):
    """The quartic's raw coefficients, all its complex roots, the real ones of them."""
    big, small = mp.mpf(s.major_radius), mp.mpf(s.minor_radius)
    speed = power_near(mp.sqrt(dot(d, d)) / (big + small))      # so that a root that is not real can be told by its size
    d = times(1 / speed, d)
    dd, od, k = dot(d, d), dot(o, d), dot(o, o) + big ** 2 - small ** 2
    flat = [d[0] ** 2 + d[1] ** 2, 2 * (o[0] * d[0] + o[1] * d[1]), o[0] ** 2 + o[1] ** 2]
    whole = [dd * dd, 4 * dd * od, 4 * od ** 2 + 2 * dd * k, 4 * od * k, k * k]
    for t in real_roots([w - 4 * big ** 2 * f for w, f in zip(whole, [0, 0, *flat])], mp.mpf(10) ** -30):
        x, y, z = add(o, times(t, d))
        slope = 4 * (x * x + y * y + z * z + big ** 2 - small ** 2)
        yield t / speed, (slope * x - 8 * big ** 2 * x, slope * y - 8 * big ** 2 * y, slope * z)


def _polyhedron(s: Polyhedron, o, d):
    """Every plane's hit that lies behind all the other planes."""
    planes = [(vector(point), vector(normal)) for point, normal in s.planes]
    for k, (point, normal) in enumerate(planes):
        if dot(normal, d) != 0:
            t = dot(normal, sub(point, o)) / dot(normal, d)
            at = add(o, times(t, d))
            if all(dot(n, sub(at, p)) <= 0 for j, (p, n) in enumerate(planes) if j != k):
                yield t, normal


def _blob(s: Blob, o, d):
    """The ends of all elements' spheres cut the ray; between them the raw quartic's complex roots, where the field can reach at all."""
    elements = [(vector(c), mp.mpf(r), mp.mpf(w)) for c, r, w in s.elements]
    threshold, forms = mp.mpf(s.threshold), []
    speed = mp.sqrt(dot(d, d)) / max(r for _, r, _ in elements)     # as for the torus
    d = times(1 / speed, d)
    for center, radius, strength in elements:       # 1 - |p - center|²/radius² as a t² + 2 b t + c
        f = sub(o, center)
        forms.append((-dot(d, d) / radius ** 2, -dot(f, d) / radius ** 2, 1 - dot(f, f) / radius ** 2, strength))
    spans = [(*sorted(ends), form) for form in forms if len(ends := quadratic(*form[:3])) == 2]
    ends = sorted({end for low, high, _ in spans for end in (low, high)})
    for low, high in zip(ends, ends[1:]):
        active = [form for first, last, form in spans if first <= low and high <= last]
        whole, most, least = [mp.mpf(0)] * 4 + [-threshold], -threshold, -threshold
        for a, b, c, strength in active:
            square = (a * a, 4 * a * b, 2 * a * c + 4 * b * b, 4 * b * c, c * c)
            whole = [x + strength * y for x, y in zip(whole, square)]
            at_ends = [((a * t + 2 * b) * t + c) ** 2 for t in (low, high)]
            top = (c - b * b / a) ** 2 if low <= -b / a <= high else max(at_ends)
            most, least = most + max(strength * top, strength * min(at_ends)), least + min(strength * top, strength * min(at_ends))
        if most < 0 or least > 0:
            continue
        while whole[0] == 0:
            whole.pop(0)
        for t in real_roots(whole, mp.mpf(10) ** -20):
            if low <= t < high:
                normal = (mp.mpf(0),) * 3
                for (center, radius, _), (a, b, c, strength) in zip(elements, forms):
                    w = (a * t + 2 * b) * t + c
                    if w > 0:
                        normal = add(normal, times(strength * w / radius ** 2, sub(add(o, times(t, d)), center)))
                yield t / speed, normal


def _implicit(s: Implicit, o, d):
    """See `formulas`."""
    yield from formulas.crossings(mp, s, o, d)


TWINS = {Sphere: _sphere, Plane: _plane, Triangle: _triangle, Mesh: _mesh, Polygon: _polygon, Box: _box, Cylinder: _cylinder, Cone: _cone,
         Quadric: _quadric, Torus: _torus, Polyhedron: _polyhedron, Blob: _blob,
         Implicit: _implicit}


# --- placed shapes ---

@functools.lru_cache(maxsize=64)
def inverse(matrix: tuple) -> tuple:
    """Rows of the inverse, in 50 digits, of the 3 x 3 matrix of these nine numbers."""
    a, b, c = (vector(matrix[k:k + 3]) for k in (0, 3, 6))
    columns = [times(1 / determinant(a, b, c), v) for v in (cross(b, c), cross(c, a), cross(a, b))]
    return tuple(zip(*columns))


def crossings(shape, matrix, origin, direction) -> list[Crossing]:
    """Every crossing, ascending, negative t as well; visible sides are obeyed."""
    rows = inverse(tuple(np.asarray(matrix)[:3, :3].ravel().tolist()))
    shifted, v = sub(vector(origin), vector([matrix[k][3] for k in range(3)])), vector(direction)
    o, d = tuple(dot(r, shifted) for r in rows), tuple(dot(r, v) for r in rows)
    found = []
    for t, n in TWINS[type(shape)](shape, o, d):
        facing = dot(n, d)
        if shape.sides == "both" or (facing < 0 if shape.sides == "front" else facing > 0):
            found.append(Crossing(t, unit(tuple(sum((rows[j][k] * n[j] for j in range(3)), mp.mpf(0)) for k in range(3)))))
    return sorted(found, key=lambda c: c.t)


def nearest(shape, matrix, origin, direction, t_min=0.0) -> Crossing | None:
    """The first crossing past t_min."""
    return next((c for c in crossings(shape, matrix, origin, direction) if c.t > t_min), None)
