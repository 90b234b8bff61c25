"""Shapes with flat faces along a line: every crossing is a rational number.

As in `curved`, each function takes a shape and its `Place` and gives a function from a line of the world to its crossings.
"""
import numpy as np

from rtcore.algebra.curved import Crossing, Find, seen_from
from rtcore.algebra.lines import Line, Place, cross, dot, dyadic, minus, times
from rtcore.algebra.polynomials import sign
from rtcore.algebra.roots import Rational

NOISE = 2.0 ** -42      # more than the error of `possible`'s volumes: 6 products of at most 9, each with at most 12 roundings of a factor


def plane(shape, place: Place) -> Find:
    point, shift = dyadic(*shape.point)
    normal, _ = dyadic(*shape.normal)

    def find(line: Line) -> list[Crossing]:
        f, g = seen_from(place.local(line), point, shift)
        speed = dot(normal, g)
        return [Crossing(Rational(-dot(normal, f), speed), 1, sign(speed))] if speed else []
    return find


def corners(line: Line, points, shift: int) -> list[Crossing]:
    """A triangle, edges and corners included, its points n / 2^shift: by the signs of the volumes between the line and the edges."""
    f, d = seen_from(line, (0, 0, 0), shift)
    a, b, c = (minus(times(line.scale, p), f) for p in points)
    u, v, w = dot(d, cross(c, b)), dot(d, cross(a, c)), dot(d, cross(b, a))
    if min(u, v, w) < 0 < max(u, v, w):
        return []
    normal = cross(minus(b, a), minus(c, a))
    speed = dot(normal, d)
    return [Crossing(Rational(dot(normal, a), speed), 1, sign(speed))] if speed else []


def triangle(shape, place: Place) -> Find:
    numbers, shift = dyadic(*shape.a, *shape.b, *shape.c)
    points = numbers[:3], numbers[3:6], numbers[6:]
    return lambda line: corners(place.local(line), points, shift)


def mesh(shape, place: Place) -> Find:
    """Those triangles that floats can't exclude, exactly."""
    if not len(shape.faces):
        return lambda line: []
    faces = shape.vertices[shape.faces]
    low, high = faces.min((0, 1)), faces.max((0, 1))
    middle = low / 2 + high / 2
    power = int(np.frexp(np.abs(high / 2 - low / 2).max())[1])
    around = np.ldexp(faces - middle, -power)       # within -1 .. 1, and some roundings
    center, shift = dyadic(*middle)

    def find(line: Line) -> list[Crossing]:
        line = place.local(line)
        f, g = seen_from(line, center, shift)
        length2, ahead = dot(g, g), -dot(f, g)
        size = line.scale * length2 << shift + max(power, 0)
        # where the line comes nearest to the middle
        foot = [(f[k] * length2 + ahead * g[k] << max(-power, 0)) for k in range(3)]
        if max(map(abs, foot)) > 2 * size:
            return []
        way, most = np.array([x / max(map(abs, g)) for x in g]), np.array([x / size for x in foot])
        found = []
        for face in np.flatnonzero(possible(around - most, way)):
            numbers, own = dyadic(*faces[face].ravel())
            found += corners(line, (numbers[:3], numbers[3:6], numbers[6:]), own)
        return found
    return find


def possible(faces: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Which of the triangles (n, 3, 3), seen from a point on the line, the line may meet: its volumes with the edges don't differ in
    sign for certain."""
    a, b, c = faces.transpose(1, 0, 2)
    volumes = np.stack([np.cross(c, b) @ way, np.cross(a, c) @ way, np.cross(b, a) @ way])
    return (volumes.min(0) >= -NOISE) | (volumes.max(0) <= NOISE)


def polygon(shape, place: Place) -> Find:
    """The plane through the middle of the corners with Newell's normal; inside, by the rule of `rtcore.shapes.polygon`: an odd number of
    edges, each with its lower end and without its upper one, in the two axes of the world that the normal points at least."""
    numbers, low = dyadic(*(x for point in shape.vertices for x in point))
    count, shift = len(shape.vertices), low + place.shift
    points = [tuple(dot(row, numbers[k:k + 3]) + (c << low) for row, c in zip(place.rows, place.offset)) for k in range(0, 3 * count, 3)]
    edges = [minus(p, points[0]) for p in points]
    normal = tuple(map(sum, zip(*(cross(p, q) for p, q in zip(edges, edges[1:] + edges[:1])))))
    middle = tuple(map(sum, zip(*points)))
    a, b = {0: (1, 2), 1: (2, 0), 2: (0, 1)}[max(range(3), key=lambda k: abs(normal[k]))]
    outline = [(p[a], p[b]) for p in points]
    # edges from their lower end up
    sides = [(*p, *q) if p[1] <= q[1] else (*q, *p) for p, q in zip(outline, outline[1:] + outline[:1])]

    def find(line: Line) -> list[Crossing]:
        f, g = seen_from(line, (0, 0, 0), shift)
        speed = count * dot(normal, g)
        if not speed:
            return []
        ahead = line.scale * dot(normal, middle) - count * dot(normal, f)
        unit, x, y = line.scale * speed, f[a] * speed + ahead * g[a], f[b] * speed + ahead * g[b]
        if speed < 0:
            unit, x, y = -unit, -x, -y
        inside = False
        for x0, y0, x1, y1 in sides:
            if y0 * unit <= y < y1 * unit:
                inside ^= (x - x0 * unit) * (y1 - y0) < (y - y0 * unit) * (x1 - x0)
        return [Crossing(Rational(ahead, speed), 1, sign(speed * place.determinant))] if inside else []
    return find


def solid(heights) -> list[Crossing]:
    """What lies behind all planes, each the line's height h₀ + h₁ u above it: from the last that it enters to the first that it leaves."""
    enter = leave = None
    for height, speed in heights:
        if speed:
            root = Rational(-height, speed)
            if speed < 0:
                enter = root if enter is None else max(enter, root)
            else:
                leave = root if leave is None else min(leave, root)
        elif height > 0:
            return []
    if enter is not None and leave is not None and enter > leave:
        return []
    return [Crossing(root, 1, facing) for root, facing in ((enter, -1), (leave, 1)) if root is not None]


def box(shape, place: Place) -> Find:
    ends, shift = dyadic(*shape.low, *shape.high)

    def find(line: Line) -> list[Crossing]:
        line = place.local(line)
        (f, g), (f1, _) = seen_from(line, ends[:3], shift), seen_from(line, ends[3:], shift)
        return solid([(-f[k], -g[k]) for k in range(3)] + [(f1[k], g[k]) for k in range(3)])
    return find


def polyhedron(shape, place: Place) -> Find:
    points, shift = dyadic(*(x for point, _ in shape.planes for x in point))
    normals, _ = dyadic(*(x for _, normal in shape.planes for x in normal))
    planes = [(points[k:k + 3], normals[k:k + 3]) for k in range(0, len(points), 3)]

    def find(line: Line) -> list[Crossing]:
        local = place.local(line)
        seen = [(normal, *seen_from(local, point, shift)) for point, normal in planes]
        return solid([(dot(normal, f), dot(normal, g)) for normal, f, g in seen])
    return find
