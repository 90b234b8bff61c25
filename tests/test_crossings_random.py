"""Crossings of random lines with every shape against its 50-digit twin, in number and value, under transforms whose scales along the axes
reach from 1e-6 to 1e6; and what must hold without any twin.

CROSSINGS_RAYS=10000 in the environment gives every class of shapes that many lines, half in each precision; by default those whose twin
is slow get fewer.
"""
import os

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rtcore
from rtcore import (Blob, Box, Cone, Cylinder, Matrix, Mesh, Node, Plane, Polygon, Polyhedron, Quadric, Rotate, Scale, Scene, Shear,
                    Sphere, Torus, Translate, Triangle)

from rtcore.reports.oracle import crossings, mp
from test_shapes import EXAMPLES, rays_at, transform

DTYPE = {"f64": np.float64, "f32": np.float32}
OF_CLASS = {name: sum(type(other) is type(shape) for other in EXAMPLES.values()) for name, shape in EXAMPLES.items()}
EXACT = {Sphere, Plane, Triangle, Mesh, Polygon, Box, Cylinder, Cone, Quadric, Torus, Polyhedron, Blob}      # whose roots are algebraic
SLOW = {Torus: 300, Blob: 120}      # their twins find the complex roots of quartics
TILTED = Polygon(((1, 0, 0), (0, 1, 0), (0, 0, 1)))
SHAPES = {name: shape for name, shape in EXAMPLES.items() if type(shape) in EXACT} | {"tilted polygon": TILTED}


def lines_for(shape, name: str) -> int:
    every = int(os.environ.get("CROSSINGS_RAYS", 0)) or SLOW.get(type(shape), 2000)
    return every // (2 * OF_CLASS.get(name, 1))


def stretched(rng) -> tuple:
    """Scales along the axes from 1e-6 to 1e6, sheared, turned and moved, some mirrored, half of them along axes at an angle."""
    scale = Scale(tuple(10 ** rng.uniform(-6, 6, 3) * rng.choice([-1, 1], 3)))
    shear = Shear(**dict(zip(("xy", "xz", "yx", "yz", "zx", "zy"), rng.uniform(-0.3, 0.3, 6).tolist())))
    steps = [scale, shear, Rotate(tuple(rng.normal(size=3)), rng.uniform(0, 360)),
             Translate(tuple(rng.normal(size=3) * 10 ** rng.uniform(-3, 3)))]
    return (Rotate(tuple(rng.normal(size=3)), rng.uniform(0, 360)), *steps) if rng.random() < 0.5 else tuple(steps)


def lines(rng, matrix, n: int, dtype):
    """Lines through a box about the shape, as far as rounding lets them."""
    target, start = rng.uniform(-1.1, 1.1, (n, 3)), rng.normal(size=(n, 3)) * 10 ** rng.uniform(-0.5, 2, (n, 1))
    far, near = (p @ matrix[:3, :3].T + matrix[:3, 3] for p in (start, target))
    origin = far.astype(dtype)
    return origin, ((near - origin) * 10 ** rng.uniform(-2, 2, (n, 1))).astype(dtype)


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", SHAPES)
def test_crossings_are_the_twins(name, precision):
    rng = np.random.default_rng([len(name), ord(name[-1]), len(precision)])
    shape, dtype, total, met = SHAPES[name], DTYPE[precision], lines_for(SHAPES[name], name), 0
    exact = shape.rounded(dtype)
    for first in range(0, total, 20):
        node = Node(shape=shape, transform=stretched(rng))
        matrix = node.matrix()
        for o, d in zip(*lines(rng, matrix, min(20, total - first), dtype)):
            found, true = rtcore.crossings(node, o, d, precision), [c.t for c in crossings(exact, matrix, o, d)]
            at = (shape, node.transform, o.tolist(), d.tolist(), found.tolist())
            assert found.dtype == dtype and len(found) == len(true), at
            for t, c in zip(found, true):
                assert abs(mp.mpf(float(t)) - c) <= (0.5 + 1e-9) * mp.mpf(float(np.spacing(abs(t)))), at
            met += len(true)
    assert met >= total * (0.1 if precision == "f64" else 0.02)


@pytest.mark.parametrize("sides", ["front", "back"])
@pytest.mark.parametrize("name", SHAPES)
def test_sides(name, sides):
    rng = np.random.default_rng(len(name))
    shape, met = msgspec.structs.replace(SHAPES[name], sides=sides), 0
    for kind in ("mirrored", "sheared"):
        matrix = transform(rng, kind)
        node = Node(shape=shape, transform=(Matrix(matrix.tolist()),))
        for o, d in zip(*rays_at(rng, matrix, 15, "f64")):
            true = [float(c.t) for c in crossings(shape, matrix, o, d)]
            assert rtcore.crossings(node, o, d).tolist() == true
            met += len(true)
    assert met >= 1


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", SHAPES)
def test_the_first_crossing_is_what_intersect_finds(name, precision):
    rng = np.random.default_rng(len(name))
    for kind in ("rigid", "stretched"):
        matrix = transform(rng, kind)
        scene = Scene(objects=[Node(shape=SHAPES[name], transform=[Matrix(matrix.tolist())])])
        origins, directions = rays_at(rng, matrix, 60, precision)
        found = rtcore.intersect(scene, origins, directions, precision=precision).t
        for o, d, t in zip(origins, directions, found):
            true = rtcore.crossings(scene, o, d, precision)
            error = 1e-6 if precision == "f64" else 0.02
            first = float(min(true[true > 0], default=np.inf))
            assert first == pytest.approx(float(t), rel=error), (matrix.tolist(), o.tolist(), d.tolist())


def test_a_mesh_of_many_triangles():
    """What floats exclude for the mesh, exact arithmetic does for each triangle alone; near the mesh and a million sizes away."""
    rng = np.random.default_rng(5)
    corners = rng.normal(size=(400, 3)) * 3 + 100
    mesh = Mesh((corners[:, None] + rng.normal(size=(400, 3, 3))).reshape(-1, 3), np.arange(1200).reshape(-1, 3))
    parts = Scene(objects=[Triangle(*map(tuple, mesh.vertices[face])) for face in mesh.faces])
    met = 0
    for k in range(12):
        target = corners[k]
        o = target + rng.normal(size=3) * 10.0 ** (k - 4)
        found = rtcore.crossings(mesh, o, target - o)
        assert found.tolist() == rtcore.crossings(parts, o, target - o).tolist()
        met += len(found)
    assert met > 20 and not len(rtcore.crossings(mesh, (0, 0, 0), (1, -1, 0)))


CUBE = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
CUBE_FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7),
              (1, 7, 3)]
AXES = [tuple(s * (j == k) for j in range(3)) for k in range(3) for s in (-1, 1)]
OCTAHEDRON = [(0, 0, 1), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, -1)]
OCTAHEDRON_FACES = [face for k in range(1, 5) for face in ((0, k, k % 4 + 1), (5, k % 4 + 1, k))]


def grid_lines(seed: int, n: int):
    """Lines of few bits: through corners, edges, along edges and faces, tangent to what is round."""
    rng = np.random.default_rng(seed)
    o, d = rng.integers(-4, 5, (n, 3)) / 2, rng.integers(-3, 4, (n, 3))
    return [(a, b) for a, b in zip(o, d) if b.any()]


def test_solids_made_in_several_ways_are_the_same():
    """A cube as a box, a mesh and planes, an octahedron as a mesh and planes: whatever the line touches."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    for alike in ((Box((-1, -1, -1), (1, 1, 1)), Mesh(CUBE, CUBE_FACES), Polyhedron([(axis, axis) for axis in AXES])),
                  (Mesh(OCTAHEDRON, OCTAHEDRON_FACES), Polyhedron([((corner[0], 0, 0), corner) for corner in corners]))):
        counts = {0: 0, 2: 0}
        for o, d in grid_lines(1, 2000):
            found = [rtcore.crossings(shape, o, d).tolist() for shape in alike]
            assert found[1:] == found[:-1], (o.tolist(), d.tolist())
            counts[len(found[0])] += 1
        assert min(counts.values()) > 150


@pytest.mark.parametrize("shape", [Cylinder((0, 0, -1), (0, 0, 1), 1), Cylinder((0, -1, 0), (0.5, 1, 1), 1.5),
                                   Cone((0, 0, -1), 2, (0, 0, 1), 1), Cone((-1, 0, 0), 0.5, (1, 0, 0), 2.5)])
def test_a_convex_solid_is_crossed_twice_or_not_at_all(shape):
    """Rims, walls touched and lines within walls included."""
    counts = [len(rtcore.crossings(shape, o, d)) for o, d in grid_lines(2, 2000)]
    assert set(counts) == {0, 2} and min(counts.count(0), counts.count(2)) > 200


names, seeds = st.sampled_from(sorted(SHAPES)), st.integers(0, 2**32)


def line_at(seed: int, precision: str):
    rng = np.random.default_rng(seed)
    return tuple(a[0] for a in rays_at(rng, np.eye(4), 1, precision))


@given(names, seeds, st.sampled_from(["f64", "f32"]))
def test_a_reversed_line_crosses_at_the_same_points(name, seed, precision):
    o, d = line_at(seed, precision)
    there, back = (rtcore.crossings(SHAPES[name], o, way, precision) for way in (d, -d))
    assert there.tolist() == (-back[::-1]).tolist()


@given(names, seeds, st.integers(-60, 60), st.integers(-60, 60), st.sampled_from(["f64", "f32"]))
def test_powers_of_two_scale_bitwise(name, seed, size, speed, precision):
    o, d = line_at(seed, precision)
    s, v = DTYPE[precision](2.0 ** size), DTYPE[precision](2.0 ** speed)
    node = Node(shape=SHAPES[name], transform=(Scale((float(s),) * 3),))
    assert rtcore.crossings(node, o * s, d * v, precision).tolist() == (rtcore.crossings(SHAPES[name], o, d, precision) * s / v).tolist()


small = st.integers(-2**20, 2**20)


@given(st.tuples(small, small, small), st.integers(1, 2**20), st.sampled_from([(3, 4, 5), (5, 12, 13), (8, 15, 17), (0, 1, 1)]),
       small.filter(bool), small, st.integers(-300, 300), st.sampled_from(["both", "front", "back"]))
def test_an_exact_tangent_is_met_twice(center, half, triple, along, up, power, sides):
    """A Pythagorean triple gives a rational point of the equator; the tangent there runs along (-y, x, anything)."""
    x, y, r = (half * n for n in triple)
    unit = 2.0 ** power
    ball = Sphere(tuple(c * unit for c in center), r * unit, sides=sides)
    way = (-triple[1], triple[0], up / 2**10)
    origin = ((center[0] + x - along * way[0]) * unit, (center[1] + y - along * way[1]) * unit, (center[2] - along * way[2]) * unit)
    found = rtcore.crossings(ball, origin, way)
    assert found.tolist() == ([along * unit] * 2 if sides == "both" else [])
