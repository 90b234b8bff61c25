"""Rays at edges, rims and along surfaces of placed shapes, off them by down to a rounding: hit or miss as exact arithmetic says."""
import numpy as np
import pytest

import rtcore
from rtcore import Box, Cone, Cylinder, Matrix, Node, Plane, Polygon, Polyhedron, Quadric, Scene, Sphere, Torus
from rtcore.reports.making import edges, make

from test_shapes import DTYPE, transform

EDGED, ROUND = (Polygon, Box, Polyhedron, Cylinder, Cone), (Sphere, Plane, Quadric, Torus, Cylinder, Cone)


def check(scene, origins, directions, precision) -> int:
    """Compares first hits with crossings; returns how many there are."""
    found = rtcore.intersect(scene, origins, directions, precision=precision).t
    met = 0
    for o, d, t in zip(origins, directions, found):
        true = rtcore.crossings(scene, o, d, precision)
        first = min(true[true > 0], default=np.inf)
        near = t == first or np.isfinite(t) and abs(t - first) <= 2 * np.spacing(first)
        assert near, (scene.objects, o.tolist(), d.tolist(), float(t), true.tolist())
        met += np.isfinite(t)
    return met


def places(rng, shape, precision):
    """Placed shapes at random, some of them small and far from the world's origin: scene and matrix."""
    for kind in ("rigid", "stretched", "mirrored", "sheared"):
        for away in (1, 1e3):
            matrix = transform(rng, kind)
            matrix[:3, 3] *= away
            record = make(shape, rng, 1, DTYPE[precision])
            yield record, Scene(objects=[Node(shape=record, transform=[Matrix(matrix.tolist())])]), matrix


def rounded(matrix, origins, targets, precision):
    """Rays of the shape's own space in the world, as far as rounding lets them."""
    o = (origins @ matrix[:3, :3].T + matrix[:3, 3]).astype(DTYPE[precision])
    d = (targets @ matrix[:3, :3].T + matrix[:3, 3] - o).astype(DTYPE[precision])
    there = d.any(axis=1)
    return o[there], d[there]


def off(rng, n: int, precision):
    """Vectors of lengths down to a rounding of 1."""
    way = rng.normal(size=(n, 3))
    return way / np.linalg.norm(way, axis=1, keepdims=True) * 10 ** rng.uniform(-7 if precision == "f32" else -16, -2, (n, 1))


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("shape", EDGED, ids=lambda shape: shape.__name__)
def test_at_edges(shape, precision):
    rng, met = np.random.default_rng(len(shape.__name__)), 0
    for record, scene, matrix in places(rng, shape, precision):
        ends = edges(record)[rng.integers(0, len(edges(record)), 24)]
        target = ends[:, 0] + rng.random((24, 1)) * (ends[:, 1] - ends[:, 0]) + off(rng, 24, precision)
        eye = target + rng.normal(size=(24, 3)) * 10 ** rng.uniform(0, 3, (24, 1))
        met += check(scene, *rounded(matrix, eye, target, precision), precision)
    assert 30 < met < 180


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("shape", ROUND, ids=lambda shape: shape.__name__)
def test_along_the_surface(shape, precision):
    """From points beside the surface, and from points on it, along it."""
    rng, met = np.random.default_rng(len(shape.__name__)), 0
    for _, scene, matrix in places(rng, shape, precision):
        eye = rng.normal(size=(24, 3)) * 3
        o, d = rounded(matrix, eye, rng.uniform(-0.6, 0.6, (24, 3)), precision)
        hits = rtcore.intersect(scene, o, d, precision=precision)
        there = np.isfinite(hits.t)
        # back to the shape's own space, where lengths mean the same along every axis
        back, point = np.linalg.inv(matrix[:3, :3]), (o + hits.t[:, None] * d)[there].astype(float)
        point, normal = (point - matrix[:3, 3]) @ back.T, hits.normal[there].astype(float) @ matrix[:3, :3]
        way = np.cross(normal, rng.normal(size=normal.shape))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        target = point + off(rng, len(point), precision)
        distance = rng.choice([0, 1, 10], (len(point), 1))
        met += check(scene, *rounded(matrix, target - distance * way, target + way * (distance == 0), precision), precision)
    assert met > (5 if shape is Plane else 15)


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_from_close_to_a_face(precision):
    """Of a ray that starts beside a face, t is a difference in which nearly all digits may cancel; it is the right number all the same."""
    rng, seen = np.random.default_rng(8), 0
    for record, scene, matrix in places(rng, Box, precision):
        low, high = np.array(record.low), np.array(record.high)
        middle, half = (low + high) / 2, (high - low) / 2
        faces, way = rng.uniform(-1, 1, (60, 3)), rng.normal(size=(60, 3))
        axis = np.arange(60) % 3
        faces[np.arange(60), axis] = np.where(way[np.arange(60), axis] > 0, -1, 1) * (1 + 10 ** rng.uniform(-17, -2, 60))
        o, d = rounded(matrix, middle + faces * half, middle + (faces + way) * half, precision)
        for ray, along, t in zip(o, d, rtcore.intersect(scene, o, d, precision=precision).t):
            true = rtcore.crossings(scene, ray, along, precision)
            first = min(true[true > 0], default=np.inf)
            assert t == first or abs(t - first) <= np.spacing(DTYPE[precision](first)), (scene.objects, ray.tolist(), along.tolist())
            seen += first < 0.01
    assert seen > 100
