"""Every shape's kernel against its twin in 50 digits: hits, normals, sides, texture coordinates; plain and under transforms.

The bound on t says how far the hit point may be off at right angles to the surface: BOUND roundings of the largest number that the point
is made from, times the condition of the transform, over the cosine of the incidence. It is what the first kernels reach, and no target:
NUMERICS' 1 and 2 ulp are for the error-bounded kernels to come.
"""
import functools

import msgspec
import numpy as np
import pytest

import rtcore
from rtcore import (Blob, Box, Cone, Cylinder, Implicit, Matrix, Mesh, Node, Plane, Polygon, Polyhedron, Quadric, Scene, Sphere, Torus,
                    Triangle)
from rtcore.flatten import flatten
from rtcore.reports.oracle import crossings, mp, nearest, vector
from rtcore.shapes import SHAPES
from rtcore.wave import CLOSEST, DX, OX, START, T, UNWANTED, new_rays

BOUND = 8
UNIT = {"f64": 2.0 ** -53, "f32": 2.0 ** -24}
DTYPE = {"f64": np.float64, "f32": np.float32}
L_SHAPE = ((-1, -1, 0), (1, -1, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0), (-1, 1, 0))
TETRAHEDRON = Mesh([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])

#: One of each class at least, all within -1.5 .. 1.5.
EXAMPLES = {
    "sphere": Sphere((0.1, -0.2, 0.3), 0.9),
    "plane": Plane((0.1, 0.2, -0.1), (0.3, 1, -0.4)),
    "triangle": Triangle((-1, -0.9, 0.2), (1.1, -0.7, -0.3), (0.1, 1.2, 0.4)),
    "mesh": TETRAHEDRON,
    "polygon": Polygon(L_SHAPE),
    "box": Box((-1, -0.5, -0.75), (0.5, 1, 0.25)),
    "cylinder": Cylinder((-0.3, -0.8, 0.1), (0.4, 0.7, -0.2), 0.6),
    "tube": Cylinder((0, -1, 0), (0, 1, 0), 0.7, capped=False),
    "cone": Cone((0.1, -1, 0), 0.9, (0, 1, 0.2)),
    "frustum": Cone((0, 0, -0.75), 0.4, (0, 0, 0.75), 0.9),
    "funnel": Cone((-1, 0, 0), 0.0, (1, 0.2, 0), 1.0, capped=False),
    "saddle": Quadric((1, -0.7, 0, 0.2, 0, 0, 0, 0, -1, 0.1), (-1, -1, -1), (1, 1.2, 1)),
    "hyperboloid": Quadric((1, 1.5, -0.8, 0, 0.1, 0, 0, 0.2, 0, -0.25)),
    "torus": Torus(0.9, 0.35),
    "spindle": Torus(0.4, 0.7),
    "gem": Polyhedron([((0, 0, 1), (0.1, 0, 1)), ((0, 0, -1), (0, 0.2, -1)), ((0.7, 0, 0), (1, 0.3, 0.4)), ((-0.8, 0, 0), (-1, 0.2, 0.1)),
                       ((0, 0.9, 0), (0.2, 1, 0)), ((0, -0.6, 0), (0, -1, 0.3))]),
    "wedge": Polyhedron([((0, 0.2, 0), (0.5, 1, 0)), ((0, -0.4, 0), (0.2, -1, 0.3))]),
    "blob": Blob([((-0.5, 0.1, 0), 1, 1), ((0.5, -0.1, 0.2), 0.9, 1.2)], 0.35),
    "bitten blob": Blob([((0.1, 0, 0), 1.3, 1), ((0.7, 0.6, 0.2), 1, -0.9)], 0.3),
    "blob of eight": Blob([
        ((0.3, -0.2, 0.7), 0.8, 1.1), ((-0.7, 0.5, 0.1), 0.7, 0.9), ((0.1, 0.6, -0.4), 0.8, 1.3), ((-0.2, -0.7, 0.2), 0.7, 1),
        ((0.6, 0.3, 0.1), 0.6, 0.8), ((-0.4, -0.1, -0.6), 0.75, 1.2), ((0.5, -0.5, -0.3), 0.65, 1), ((-0.3, 0.2, 0.6), 0.7, 0.7)], 0.4),
    "gyroid": Implicit("sin(3*x)*cos(3*y) + sin(3*y)*cos(3*z) + sin(3*z)*cos(3*x)", (-1, -0.9, -1.1), (1, 1.1, 0.9)),
    "drop": Implicit("smin(sqrt(x^2 + y^2 + (z + .4)^2) - .6, sqrt(x^2 + y^2 + (z - .5)^2) - .4, .3)", (-1, -0.7, -1.1), (0.9, 1, 1.2)),
}



def test_every_shape_has_an_example():
    assert {type(shape) for shape in EXAMPLES.values()} == set(SHAPES)


def turn(rng) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def transform(rng, kind: str) -> np.ndarray:
    """A random 4 x 4 matrix, its size 1e-3 .. 1e3."""
    m, scale = np.eye(4), 10 ** rng.uniform(-3, 3)
    m[:3, :3] = turn(rng) * scale
    if kind == "stretched":
        m[:3, :3] = turn(rng) @ np.diag(10 ** rng.uniform(-0.7, 0.7, 3)) @ turn(rng) * scale
    elif kind == "mirrored":
        m[:3, :3] = turn(rng) @ np.diag([1, -1, 1.5]) * scale
    elif kind == "sheared":
        m[:3, :3] = turn(rng) @ np.array([[1, 0.8, -0.3], [0, 1, 0.5], [0.2, 0, 1]]) * scale
    m[:3, 3] = rng.normal(size=3) * scale * 3
    return m


def rays_at(rng, matrix, n: int, precision: str):
    """Rays toward what is within the box -1.1 .. 1.1 under the matrix, half of them toward its middle, some from within; of any length."""
    target = rng.uniform(-1.1, 1.1, (n, 3)) * np.where(np.arange(n) % 2, 0.4, 1)[:, None] @ matrix[:3, :3].T + matrix[:3, 3]
    way = rng.normal(size=(n, 3))
    way *= (10 ** rng.uniform(-0.5, 1, n) * np.abs(matrix[:3, :3]).sum() / np.linalg.norm(way, axis=1))[:, None]
    origin = (target + way).astype(DTYPE[precision])
    direction = ((target - origin) * 10 ** rng.uniform(-2, 2, n)[:, None]).astype(DTYPE[precision])
    return origin, direction


def scene_of(shape, matrix) -> Scene:
    return Scene(objects=[Node(shape=shape, transform=[Matrix(matrix.tolist())])])


def doubt(matrix, origin, precision: str) -> float:
    """How far a hit point may be off at right angles to the surface, in scene units."""
    reach = np.abs(matrix[:3, :3]).sum(1).max() * 1.5 + np.abs(matrix[:3, 3]).max()
    return BOUND * UNIT[precision] * np.linalg.cond(matrix[:3, :3]) * (np.abs(origin - matrix[:3, 3]).max() + reach)


def verdict(shape, matrix, o, d, off: float):
    """The twin's nearest hit, and whether rays and starts a little to the side all agree that there is one, and on its face."""
    found = crossings(shape, matrix, o, d)
    hit = next((c for c in found if c.t > 0), None)
    v = vector(d)
    length = mp.sqrt(sum(x * x for x in v))
    # a start on the surface may count either way
    if any(abs(c.t) * length < off * 4 for c in found):
        return hit, False
    across = np.linalg.svd(np.array([float(x / length) for x in v])[None])[2][1:]
    for side in (across[0], 0.9 * across[1] - 0.5 * across[0], -0.9 * across[1] - 0.5 * across[0]):     # a triangle about the ray
        other = nearest(shape, matrix, [mp.mpf(float(o[k])) + mp.mpf(float(side[k]) * off) for k in range(3)], v)
        if (other is None) != (hit is None):
            return hit, False
        if hit is not None and sum(x * y for x, y in zip(hit.normal, other.normal)) < 0.9:
            return hit, False
    return hit, True


def check(shape, matrix, o, d, precision: str, t, normal) -> bool:
    """Compare one ray's hit with the twin's; False where the twin can't tell, being on an edge."""
    off = doubt(matrix, o, precision)
    hit, clear = verdict(shape, matrix, o, d, off)
    if not clear:
        return False
    assert (hit is not None) == np.isfinite(t), (shape, matrix.tolist(), o.tolist(), d.tolist(), hit, t)
    if hit is not None:
        true = np.array([float(x) for x in hit.normal])
        speed = abs(float(d.astype(float) @ true))
        assert abs(float(mp.mpf(float(t)) - hit.t)) <= off / speed, (shape, matrix.tolist(), o.tolist(), d.tolist(), float(hit.t), t)
        assert abs(np.linalg.norm(normal) - 1) <= 4 * UNIT[precision]
        slip = off / (speed / np.linalg.norm(d.astype(float)))     # how far the point is off along the surface
        smallest = np.linalg.svd(matrix[:3, :3])[1].min() * 0.4     # and the least radius of curvature, near enough
        allowed = (slip / smallest + BOUND * UNIT[precision]) * np.linalg.cond(matrix[:3, :3])
        assert np.abs(normal - true).max() <= allowed, (shape, matrix.tolist(), o.tolist(), d.tolist(), normal, true)
    return True


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("kind", ["plain", "rigid", "stretched", "mirrored", "sheared"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_hits_are_the_twins(name, kind, precision):
    rng = np.random.default_rng([len(name), len(kind), len(precision)])
    shape, compared, met = EXAMPLES[name], 0, 0
    for _ in range(2):
        matrix = np.eye(4) if kind == "plain" else transform(rng, kind)
        origins, directions = rays_at(rng, matrix, 14, precision)
        hits = rtcore.intersect(scene_of(shape, matrix), origins, directions, precision=precision)
        for o, d, t, normal in zip(origins, directions, hits.t, hits.normal.astype(float)):
            compared += check(shape, matrix, o, d, precision, t, normal)
        met += np.isfinite(hits.t).sum()
        assert ((hits.node >= 0) == np.isfinite(hits.t)).all()
    assert compared >= 18 and met >= 3     # the test has to see something


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("kind", ["plain", "mirrored"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_sides(name, kind, precision):
    rng = np.random.default_rng(7)
    for sides in ("front", "back"):
        shape = msgspec.structs.replace(EXAMPLES[name], sides=sides)
        matrix = np.eye(4) if kind == "plain" else transform(rng, kind)
        origins, directions = rays_at(rng, matrix, 18, precision)
        hits = rtcore.intersect(scene_of(shape, matrix), origins, directions, precision=precision)
        facing = (hits.normal.astype(float) * directions).sum(1)[np.isfinite(hits.t)]
        assert (facing < 0 if sides == "front" else facing > 0).all()
        rays = zip(origins, directions, hits.t, hits.normal.astype(float))
        assert sum(check(shape, matrix, o, d, precision, t, n) for o, d, t, n in rays) >= 9


@functools.cache
def crowd(name: str, precision: str):
    """Twenty copies of a shape, all over the place, and rays through them."""
    rng = np.random.default_rng(3)
    nodes = []
    for i in range(20):
        m = transform(rng, ("rigid", "stretched", "mirrored", "sheared")[i % 4])
        m[:3] *= 0.3 / np.abs(m[:3, :3]).max()
        m[:3, 3] = rng.uniform(-2, 2, 3)
        sides = ("both", "front", "back")[i % 3]
        nodes.append(Node(shape=msgspec.structs.replace(EXAMPLES[name], sides=sides), transform=[Matrix(m.tolist())]))
    origins = rng.uniform(-3, 3, (20_000, 3))
    directions = rng.normal(size=(20_000, 3))
    return Scene(objects=nodes), origins.astype(DTYPE[precision]), directions.astype(DTYPE[precision])


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_any_hit_is_closest_hit(name, precision):
    scene, origins, directions = crowd(name, precision)
    hits = rtcore.intersect(scene, origins, directions, precision=precision)
    assert (rtcore.occluded(scene, origins, directions, precision=precision) == np.isfinite(hits.t)).all()
    assert np.isfinite(hits.t).mean() > 0.01
    found = np.isfinite(hits.t)
    o, d, t = origins[found], directions[found], hits.t[found].astype(np.float64)
    # an interval that ends well before or after the first hit
    assert not rtcore.occluded(scene, o, d, t_max=t * 0.999, precision=precision).any()
    assert rtcore.occluded(scene, o, d, t_max=t * 1.001, precision=precision).all()


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_texture_coordinates(name, precision):
    scene, origins, directions = crowd(name, precision)
    hits = rtcore.intersect(scene, origins, directions, precision=precision)
    uv = hits.uv[np.isfinite(hits.t)]
    assert np.isfinite(uv).all()
    if name not in ("plane", "polygon", "gem", "wedge", "saddle", "hyperboloid"):    # those count in scene units
        assert uv.min() >= -1e-6 and uv.max() <= 1 + 1e-6
        assert (uv.max(0) - uv.min(0) > 0.5).all()
    assert (hits.normal[~np.isfinite(hits.t)] == 0).all() and (hits.uv[~np.isfinite(hits.t)] == 0).all()


def test_smooth_normals_do_not_bend_the_geometric_one():
    flat = Triangle((0, 0, 0), (1, 0, 0), (0, 1, 0), normals=((1, 0, 1), (0, 1, 1), (-1, 0, 1)))
    hits = rtcore.intersect(Scene(objects=[flat]), [(0.25, 0.25, 1)], [(0, 0, -1)])
    assert hits.normal.tolist() == [[0, 0, 1]] and hits.uv.tolist() == [[0.25, 0.25]]


@pytest.mark.parametrize("name", [name for name, shape in EXAMPLES.items() if shape.kind(np.eye(4)).bounds is not None])
def test_kernels_that_walk_a_tree_leave_off_when_nobody_wants_the_answers(name):
    rng, (group,) = np.random.default_rng(3), flatten(Scene(objects=[EXAMPLES[name]])).groups
    o, d = rays_at(rng, np.eye(4), 256, "f64")
    for wanted in (True, False):
        rays = new_rays(256, np.float64)
        rays.ray[OX:OX + 3], rays.ray[DX:DX + 3], rays.ray[START], rays.ray[T], rays.prim[:] = o.T, d.T, 0, np.inf, -1
        rays.tally[UNWANTED] = not wanted
        group.kind.intersect(rays, 256, group.tree, group.table, group.first, CLOSEST)
        assert (rays.prim >= 0).any() == wanted
