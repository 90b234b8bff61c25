"""Shapes at random, of any size and some of them thin, for the families of rays."""
from collections.abc import Callable

import numpy as np

from rtcore.fields import FieldError
from rtcore.scene import Shape
from rtcore.shapes import Blob, Box, Cone, Cylinder, Implicit, Mesh, Plane, Polygon, Polyhedron, Quadric, Sphere, Torus, Triangle

COMB = np.array([(-1, -0.7, 0), (1, -0.8, 0), (0.9, 0.75, 0), (0.4, -0.2, 0), (0.1, 0.8, 0), (-0.3, -0.1, 0), (-0.9, 0.7, 0)])
TETRAHEDRON = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]) * 0.6


def _point(rng, size) -> tuple:
    return tuple((rng.uniform(-1, 1, 3) * size).tolist())


def _sphere(rng, size, thin):
    return Sphere(_point(rng, 0.3 * size), size * rng.uniform(0.5, 1))


def _plane(rng, size, thin):
    return Plane(_point(rng, 0.3 * size), _point(rng, 1))


def _triangle(rng, size, thin):
    a, b, c = rng.uniform(-1, 1, (3, 3)) * size
    if thin:
        c = a + rng.uniform(0.2, 0.8) * (b - a) + (c - a) * 10 ** rng.uniform(-7, -2)
    return Triangle(*(tuple(p.tolist()) for p in (a, b, c)))


def _mesh(rng, size, thin):
    points = (TETRAHEDRON + rng.uniform(-0.3, 0.3, (4, 3))) * size
    if thin:
        points[:, 2] *= 10 ** rng.uniform(-5, -2)
    return Mesh(points, [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])


def _polygon(rng, size, thin):
    """In a plane z = const: its corners stay in one plane when they are rounded."""
    points = COMB * (1, 10 ** rng.uniform(-5, -2) if thin else 1, 1) * rng.uniform(0.7, 1, (len(COMB), 1))
    points[:, 2] = rng.uniform(-0.3, 0.3)
    return Polygon(tuple(tuple(p) for p in (points * size).tolist()))


def _box(rng, size, thin):
    half = rng.uniform(0.3, 0.8, 3) * size
    if thin:
        half[rng.integers(3)] *= 10 ** rng.uniform(-6, -3)
    middle = rng.uniform(-0.2, 0.2, 3) * size
    return Box(tuple((middle - half).tolist()), tuple((middle + half).tolist()))


def _axis(rng, size, thin):
    """Two points and a factor for radii: now and then a needle or a disc."""
    a, b = rng.uniform(-0.8, 0.8, (2, 3)) * size
    return tuple(a.tolist()), tuple(b.tolist()), float(size * (10 ** rng.uniform(-5, -2) if thin else 1))


def _cylinder(rng, size, thin):
    base, apex, radius = _axis(rng, size, thin)
    return Cylinder(base, apex, radius * rng.uniform(0.2, 0.6), capped=bool(rng.random() < 0.7))


def _cone(rng, size, thin):
    base, apex, radius = _axis(rng, size, thin)
    return Cone(base, radius * rng.uniform(0.3, 0.6), apex, radius * rng.choice([0, 0.2, 0.29]), capped=bool(rng.random() < 0.7))


def _quadric(rng, size, thin):
    """x² and so on with these signs: ellipsoid, hyperboloids, cone, cylinder, pair of planes, paraboloid, saddle; turned, and in a box."""
    kinds = ((1, 1, 1, 0, -1), (1, 1, -1, 0, -1), (1, 1, -1, 0, 1), (1, 1, -1, 0, 0), (1, 1, 0, 0, -1), (1, -1, 0, 0, 0), (1, 1, 0, -1, 0),
             (1, -1, 0, -1, 0))
    x, y, z, linear, constant = kinds[rng.integers(len(kinds))]
    form = np.diag([x, y, z]) * rng.uniform(1, 3, 3) * (10 ** rng.uniform(-4, 0, 3) if thin else 1)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    form = turn @ form @ turn.T / size ** 2
    slope = turn[:, 2] * linear / size
    numbers = (*np.diag(form), 2 * form[0, 1], 2 * form[0, 2], 2 * form[1, 2], *slope, constant * rng.uniform(0.3, 1))
    return Quadric(tuple(map(float, numbers)), low=(-size,) * 3, high=(size,) * 3)


def _torus(rng, size, thin):
    return Torus(0.75 * size, 0.75 * size * float(10 ** rng.uniform(-5, -2) if thin else rng.choice([0.1, 0.33, 0.6, 0.9, 1.3])))


def _polyhedron(rng, size, thin):
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    normals = np.concatenate([turn, -turn, rng.normal(size=(2, 3))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    heights = rng.uniform(0.4, 0.7, len(normals)) * size
    if thin:
        heights[[0, 3]] *= 10 ** rng.uniform(-5, -2)
    return Polyhedron(tuple((tuple(p), tuple(n)) for p, n in zip((normals * heights[:, None]).tolist(), normals.tolist())))


def _blob(rng, size, thin):
    elements = [(_point(rng, 0.4 * size), size * rng.uniform(0.5, 0.9), s) for s in (1.0, rng.uniform(0.5, 2), rng.uniform(-0.8, 0.8))]
    return Blob(tuple(elements), float(1 - 10 ** rng.uniform(-5, -2) if thin else rng.uniform(0.2, 0.7)))


def _implicit(rng, size, thin):
    """A sphere, a torus, a gyroid, a smooth union, a sextic of ours; thin ones are shells with a double root between their walls."""
    x, y, z = (f"({name}/{size!r})" for name in "xyz")
    square, a = f"({x}^2+{y}^2+{z}^2)", round(rng.uniform(0.2, 0.6), 6)
    forms = (f"{square}-{a}", f"({square}+{a}-0.05)^2-{4 * a:.6f}*({x}^2+{y}^2)",
             f"sin(4*{x})*cos(4*{y})+sin(4*{y})*cos(4*{z})+sin(4*{z})*cos(4*{x})-{a - 0.4:.6f}",
             f"smin({square}-{a}, ({x}-0.7)^2+{y}^2+{z}^2-0.2, 0.3)", f"{x}^6+{y}^4*2+{z}^2-{x}*{y}*{z}-{a}")
    text = forms[rng.integers(len(forms))]
    if thin:
        text = f"({square}-{a})^2-{10 ** rng.uniform(-12, -4):.3e}"
    return Implicit(text, (-size,) * 3, (size,) * 3)


MAKERS: dict[type[Shape], Callable] = {
    Sphere: _sphere, Plane: _plane, Triangle: _triangle, Mesh: _mesh, Polygon: _polygon, Box: _box, Cylinder: _cylinder, Cone: _cone,
    Quadric: _quadric, Torus: _torus, Polyhedron: _polyhedron, Blob: _blob,
    Implicit: _implicit}

#: Shapes that have nothing to be thin in.
NEVER_THIN = (Sphere, Plane)


def make(shape: type[Shape], rng: np.random.Generator, size: float, dtype, thin: bool = False) -> Shape:
    """A shape of about this size about the origin, its numbers of the type. Raises FieldError where the size is beyond it."""
    for _ in range(100):
        try:
            return MAKERS[shape](rng, size, thin).rounded(dtype)
        except FieldError as error:
            last = error        # a thin one that rounding made flat: the next throw
    raise last


def edges(shape: Shape) -> np.ndarray | None:
    """Ends of the shape's edges, (n, 2, 3), in its own space; None for one that has none."""
    if isinstance(shape, Triangle):
        return _ring([shape.a, shape.b, shape.c])
    if isinstance(shape, Polygon):
        return _ring(shape.vertices)
    if isinstance(shape, Mesh):
        return np.concatenate([_ring(shape.vertices[face]) for face in shape.faces])
    if isinstance(shape, Box):
        corners = np.array([[(shape.low, shape.high)[(k >> axis) & 1][axis] for axis in range(3)] for k in range(8)])
        return np.array([(corners[k], corners[k | 1 << axis]) for k in range(8) for axis in range(3) if not k >> axis & 1])
    if isinstance(shape, Polyhedron):
        corners = _corners(shape)
        return np.stack([corners, np.roll(corners, 1, axis=0)], axis=1)
    if isinstance(shape, (Cone, Cylinder)):
        return _rims(shape)
    return None


def _ring(points) -> np.ndarray:
    points = np.array(points, float)
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


def _corners(shape: Polyhedron) -> np.ndarray:
    """Where three planes meet behind all others."""
    points, normals = (np.array(part) for part in zip(*shape.planes))
    heights, found = (points * normals).sum(1), []
    size = np.abs(heights).max()
    for i in range(len(points)):
        for j in range(i):
            for k in range(j):
                m = normals[[i, j, k]]
                if abs(np.linalg.det(m)) > 1e-3:
                    corner = np.linalg.solve(m, heights[[i, j, k]])
                    if (normals @ corner <= heights + 1e-9 * size).all():
                        found.append(corner)
    return np.array(found)


def _rims(shape: Cone | Cylinder) -> np.ndarray:
    """Points of both rims, twice: a rim has no straight edge."""
    radii = (shape.radius,) * 2 if isinstance(shape, Cylinder) else (shape.base_radius, shape.apex_radius)
    axis = np.subtract(shape.apex, shape.base)
    x = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    x /= np.linalg.norm(x)
    y = np.cross(axis / np.linalg.norm(axis), x)
    angle = np.arange(16)[:, None] / 16 * 2 * np.pi
    rims = [end + radius * (np.cos(angle) * x + np.sin(angle) * y) for end, radius in zip((shape.base, shape.apex), radii)]
    points = np.concatenate(rims)
    return np.stack([points, points], axis=1)
