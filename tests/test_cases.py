"""Single rays on which a naive kernel fails, in both precisions. The truth is worked out here, in 50 digits on the rounded numbers, and no
answer may be off by more than one ulp of it.
"""
from typing import NamedTuple

import numpy as np
import pytest

import rtcore
from rtcore import (Blob, Box, Cone, Cylinder, FieldError, Matrix, Mesh, Node, Plane, Polygon, Quadric, Rotate, Scale, Scene, Shear, Sphere,
                    Torus, Translate, Triangle)
from rtcore.reports.oracle import mp, nearest

BALL = Sphere((0, 0, 0), 1)
UP, DOWN, X = (0, 0, 1), (0, 0, -1), (1, 0, 0)
BLOCK = Box((-1, -1, -1), (1, 1, 1))
COMB = Polygon(((0, 0, 0), (4, 0, 0), (4, 3, 0), (3, 1, 0), (2, 3, 0), (1, 1, 0), (0, 3, 0)))
FLAT = Mesh([(0, 0, 0), (9, 0, 0), (0, 9, 0), (9, 9, 0)], [(0, 1, 2), (1, 3, 2)] * 4)
RING = Torus(1, 0.25)
F64 = ("f64",)
TILTED = Polygon(((1, 0, 0), (0, 1, 0), (0, 0, 1)))


class Case(NamedTuple):
    """A ray and a shape."""

    shape: object
    origin: tuple
    direction: tuple
    transform: tuple = ()
    precisions: tuple = ("f64", "f32")      # a number of some rows is too large or small for float32


CASES = {
    "far sphere": Case(BALL, (0, 0.5, -4100), UP),
    "very far sphere": Case(BALL, (0, 0.5, -1e8), UP),
    "close above a large sphere": Case(Sphere((0, 0, 0), 1e6), (0, 0, 1e6 + 2.0 ** -10), DOWN),
    "grazing sphere": Case(BALL, (0, 1 - 2.0 ** -53, -5), UP),
    "sphere from its centre": Case(BALL, (0, 0, 0), UP),
    "sphere from its surface inward": Case(BALL, (0, 0, -1), UP),
    "sphere from its surface outward": Case(BALL, (0, 0, 1), UP),
    "tangent at the start": Case(BALL, (1, 0, 0), (0, 1, 0)),
    "huge sphere": Case(Sphere((0, 0, 0), 1e20), (0, 0, -3e20), UP),
    "huge sphere in f64": Case(Sphere((0, 0, 0), 1e200), (0, 0, -3e200), UP, precisions=F64),
    "tiny sphere": Case(Sphere((0, 0, 0), 1e-25), (0, 0, -3e-25), UP),
    "slow ray": Case(BALL, (0, 0, -5), (0, 0, 1e-23)),
    "fast ray": Case(BALL, (0, 0, -5), (0, 0, 1e20)),
    "sphere far away, eye close to it": Case(Sphere((8e5, 0, 0), 3e4), (8e5, 33200, 0), (0.3, -1, 0.2)),
    "needle-like ellipsoid": Case(BALL, (0.5e-4, 0.25, -3e4), UP, (Scale((1e-4, 1, 1e4)),)),
    "needle-like ellipsoid across": Case(BALL, (-1, 0.25, 100), X, (Scale((1e-4, 1, 1e4)),)),
    "cone from above its apex": Case(Cone((0, 0, 0), 1, UP), (0, 0, 5), DOWN),
    "cylinder along its axis": Case(Cylinder((0, 0, 0), UP, 1), (0.5, 0, 5), DOWN),
    "open cylinder along its axis": Case(Cylinder((0, 0, 0), UP, 1, capped=False), (0.5, 0, 5), DOWN),
    "cylinder along its wall, just outside": Case(Cylinder((0, 0, 0), UP, 1), (1.001, 0, 5), DOWN),
    "far cylinder": Case(Cylinder((0, 0, -1), UP, 1), (-1e8, 0.25, 0.1), X),
    "cylinder 4,100 away": Case(Cylinder((0, 0, -1), UP, 1), (-4100, 0.25, 0.1), X),
    "far cone": Case(Cone((0, 0, -1), 1, UP), (-1e8, 0.25, 0), X),
    "needle": Case(Triangle((0, 0, 0), X, (0.5, 1e-7, 0)), (0.5, 5e-8, 1), DOWN),
    "small triangle": Case(Triangle((0, 0, 0), (1e-15, 0, 0), (0, 1e-15, 0)), (2e-16, 2e-16, 1), DOWN),
    "tiny triangle": Case(Triangle((0, 0, 0), (1e-25, 0, 0), (0, 1e-25, 0)), (2e-26, 2e-26, 1), DOWN),
    "tiny triangle in f64": Case(Triangle((0, 0, 0), (1e-170, 0, 0), (0, 1e-170, 0)), (2e-171, 2e-171, 1), DOWN, precisions=F64),
    "coplanar ray": Case(Triangle((0, 0, 0), X, (0, 1, 0)), (-1, 0.25, 0), X),
    "coplanar ray, polygon": Case(COMB, (-1, 0.25, 0), X),
    "coplanar ray, plane": Case(Plane((0, 0, 0), UP), (0, 0, 0), X),
    "parallel ray, plane": Case(Plane((0, 0, 0), UP), (0, 0, 1), X),
    "slanted plane far away": Case(Plane((0, 0, 1e7), (1e-3, 2e-3, 1)), (3, 4, 0), UP),
    "plane seen at a flat angle": Case(Plane((0, 0, 0), UP), (0, 0, 1), (1, 0, -1e-30)),
    "polygon with a diagonal normal": Case(TILTED, (2, 2.1, 2.2), (-1, -1, -1)),
    "box with -0.0": Case(BLOCK, (0.5, 0.5, -5), (-0.0, -0.0, 1)),
    "box with the eye on a face": Case(BLOCK, (0, 0, -1), UP),
    "box from within": Case(BLOCK, (0.25, 0.5, 0), UP),
    "beside a face's plane": Case(BLOCK, (np.nextafter(1, 2), 0, -5), UP),
    "flat group, -0.0": Case(FLAT, (1, 2, 5), (-0.0, 0, -1)),
    "mirrored": Case(BALL, (0.3, 3, 0.2), (0, -1, 0), (Scale((-1, 2, 3)), Rotate((1, 1, 0), 30))),
    "sheared": Case(BLOCK, (0.3, 5, 0.2), (0.1, -1, 0), (Shear(xy=0.5, zx=-0.25), Rotate((1, 2, 3), 40))),
    "nested shifts of 1e7": Case(BALL, (1, 2, -3), (-0.1, -0.1, 1), (Translate((1e7, 0, 0)), Translate((-1e7 + 1, 2, 0)))),
    "far from the origin": Case(BALL, (1e7, 2e7, -5), UP, (Translate((1e7, 2e7, 0)),)),
    "quadratic with nearly equal roots": Case(
        Quadric((94906265.625, 0, 0, 0, 0, 0, -189812534, 0, 0, 94906268.375)), (0, 0, 0), X, precisions=F64),
    "paraboloid along its axis": Case(Quadric((1, 1, 0, 0, 0, 0, 0, 0, -1, 0)), (0.5, 0, 5), DOWN),
    "quadric cone along a generator": Case(Quadric((1, 1, -1, 0, 0, 0, 0, 0, 0, 0)), (2, 0, 2), (-1, 0, -1)),
    "quadric cone through its apex": Case(Quadric((1, 1, -1, 0, 0, 0, 0, 0, 0, 0)), (2, 0, 1), (-2, 0, -1)),
    "plane pair across its edge": Case(Quadric((1, -1, 0, 0, 0, 0, 0, 0, 0, 0)), (-3, 0, 1), X),
    "torus along its axis": Case(RING, (0, 0, -5), UP),
    "torus through its middle": Case(RING, (-5, 0, 0), X),
    "torus touched four times": Case(RING, (1, -5, 0.25), (0, 1, 0)),
    "torus touched from within": Case(RING, (-5, 0.75, 0), X),
    "torus from far": Case(RING, (-1e4, 0.1, 0.05), X),
    "thin torus": Case(Torus(1, 1e-6), (-3, 0.1, 5e-7), X),
    "torus without a hole, along its axis": Case(Torus(1, 1), (0, 0, -5), UP),
    "large torus from some radii": Case(Torus(143, 113.2), (-612.3, 33.1, 250.7), (0.9, -0.05, -0.4)),
    "blob of one": Case(Blob([((0, 0, 0), 1, 1)], 0.6), (-5, 0, 0), X),
    "saddle of two blobs": Case(Blob([((-0.75, 0, 0), 1, 1), ((0.75, 0, 0), 1, 1)], 0.3828125), (0, -5, 0), (0, 1, 0)),
    "small blob": Case(Blob([((0, 0, 0), 1, 1)], 0.6), (-5e-3, 0, 0), X, (Scale((2.0 ** -10,) * 3),)),
}


@pytest.mark.parametrize(("name", "precision"), [(name, p) for name, case in CASES.items() for p in case.precisions])
def test_case(name, precision):
    case = CASES[name]
    dtype = {"f64": np.float64, "f32": np.float32}[precision]
    node = Node(shape=case.shape, transform=case.transform)
    o, d = np.array(case.origin, dtype), np.array(case.direction, dtype)
    truth = nearest(case.shape.rounded(dtype), node.matrix(), o, d)
    hits = rtcore.intersect(Scene(objects=[node]), [o], [d], precision=precision)
    t = float(hits.t[0])
    assert np.isfinite(hits.normal).all() and np.isfinite(hits.uv).all() and not np.isnan(t)
    assert bool(rtcore.occluded(Scene(objects=[node]), [o], [d], precision=precision)[0]) == (truth is not None)
    if truth is None:
        assert t == np.inf
        return
    assert t < np.inf
    ulp = float(np.spacing(dtype(truth.t)))
    assert abs(float(mp.mpf(t) - truth.t)) <= ulp, (t, float(truth.t), float((mp.mpf(t) - truth.t) / ulp))
    assert abs(np.linalg.norm(hits.normal[0].astype(float)) - 1) < 4 * np.finfo(dtype).eps


def test_tangent_ray_is_kept():
    assert rtcore.intersect(Scene(objects=[BALL]), [(0, 1, -5)], [UP]).t.tolist() == [5]


def test_cone_along_a_generator_is_no_nan():
    cone = Cone((0, 0, 0), 1, UP, capped=False)
    for o in ((2, 0, -1), (1, 0, 0), (-1, 0, 2)):
        for d in ((-1, 0, 1), (1, 0, -1)):
            hits = rtcore.intersect(Scene(objects=[cone]), [o], [d])
            assert not np.isnan(hits.t).any() and np.isfinite(hits.normal).all()


@pytest.mark.parametrize("matrix", [np.zeros((4, 4)), np.diag([1, 1, 0, 1]), [[1, 2, 0, 0], [2, 4, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]])
def test_singular_matrix_is_refused(matrix):
    with pytest.raises(FieldError):
        Matrix(np.array(matrix, float).tolist())


@pytest.mark.parametrize("radius", [0, -1, np.nan, np.inf])
def test_radius_is_refused(radius):
    with pytest.raises(FieldError):
        Sphere((0, 0, 0), radius)


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_half_open_rule_of_polygons(precision):
    """Rays level with a vertex or an edge, on both sides of it: each point of a tiling belongs to exactly one tile."""
    outline = ((0, 0), (0.5, 0.25), (1, 0), (1, 1), (0.5, 1.25), (0, 1))
    tiles = [Polygon(tuple((x + i, y + j, 0) for x, y in outline)) for i in range(3) for j in range(3)]
    scene = Scene(objects=tiles)
    grid = np.arange(2, 11) * 0.25
    points = np.array([(x, y, 1) for x in grid for y in grid if 0.25 <= y <= 2.75], float)
    down = np.tile(DOWN, (len(points), 1))
    inside = [np.isfinite(rtcore.intersect(Scene(objects=[tile]), points, down, precision=precision).t) for tile in tiles]
    count = np.sum(inside, axis=0)
    assert (count == 1).all(), points[count != 1]
    assert (rtcore.intersect(scene, points, down, precision=precision).t == 1).all()


@pytest.mark.parametrize("y,expected", [(3.0, []), (2.0, [(0, 0.5), (1.5, 2.5), (3.5, 4)]), (1.0, [(0, 4)]), (0.5, [(0, 4)])])
def test_concave_polygon_level_with_its_vertices(y, expected):
    x = np.arange(-0.5, 4.5, 0.125) + 0.0625
    hits = rtcore.intersect(Scene(objects=[COMB]), np.stack([x, x * 0 + y, x * 0 + 1], 1), np.tile(DOWN, (len(x), 1)))
    assert (np.isfinite(hits.t) == np.any([(a < x) & (x < b) for a, b in expected] or [x < x], axis=0)).all()


def test_zero_area_triangles_are_dropped():
    mesh = Mesh([(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 0, 3), (1, 1, 1), (0, 1, 3)])
    hits = rtcore.intersect(Scene(objects=[mesh]), [(0.2, 0.2, 1), (0.5, 0, 1), (1.5, 0, 1)], [DOWN] * 3)
    assert hits.t.tolist() == [1, 1, np.inf]


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("power", [-40, -7, 12, 33])
def test_scaling_by_a_power_of_two_scales_t_bitwise(power, precision):
    rng = np.random.default_rng(1)
    o, d = rng.uniform(-3, 3, (500, 3)).astype(np.float32), rng.normal(size=(500, 3)).astype(np.float32)
    for shape in (BALL, BLOCK, COMB, TILTED, Cone((0, 0, 0), 1, UP), Cylinder(X, UP, 0.5), Triangle(X, UP, (0, 2, 1)), Plane(X, UP)):
        s = 2.0 ** power
        one = rtcore.intersect(Scene(objects=[shape]), o, d, precision=precision)
        two = rtcore.intersect(Scene(objects=[Node(shape=shape, transform=[Scale((s, s, s))])]), o * s, d, precision=precision)
        assert np.isfinite(one.t).any()
        assert (one.t * s == two.t).all(), shape
