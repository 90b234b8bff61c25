"""Rays that leave a surface: spawned as the shading spawns them, they neither meet a convex shape again on its outside, nor miss what
stands a hair away."""
from fractions import Fraction

import msgspec
import numpy as np
import pytest

import rtcore
from rtcore import Box, Cone, Cylinder, Matrix, Mesh, Node, Plane, Polygon, Scale, Scene, Sphere, Triangle
from rtcore.flatten import flatten
from rtcore.wave import CLOSEST, DEAD, DX, ERR, GX, OX, PX, START, SURFACE_ROWS, T, new_rays

RAYS = 100_000
EPS = {"f64": 2.0 ** -53, "f32": 2.0 ** -24}

CONVEX = {
    "sphere": Sphere((0.3, -0.2, 0.1), 0.9),
    "plane": Plane((0.1, 0.2, 0.3), (1, -2, 0.5)),
    "triangle": Triangle((-1, -1, 0.2), (1.2, -0.7, -0.4), (0.1, 1.3, 0.3)),
    "mesh": Mesh([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]),
    "polygon": Polygon(((-1, -1, 0), (1, -1, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0))),
    "box": Box((-1, -0.5, -0.7), (0.4, 1, 0.3)),
    "cylinder": Cylinder((-0.3, -0.8, 0.1), (0.4, 0.7, -0.2), 0.6),
    "cone": Cone((0.1, -1, 0), 0.9, (0, 1, 0.2)),
    "frustum": Cone((0, 0, -0.75), 0.4, (0, 0, 0.75), 0.9),
}
TRANSFORMS = {
    "plain": np.eye(4),
    "small and far": [[1e-3, 0, 0, 7], [0, 0, -1e-3, -3], [0, 1e-3, 0, 11], [0, 0, 0, 1]],
    "large": [[0, -900, 0, 40], [900, 0, 0, 2e3], [0, 0, 900, -7], [0, 0, 0, 1]],
    "mirrored and stretched": [[-1, 0, 0, 3], [0, 2, 0.1, 0], [0, 0.3, 0.5, -2], [0, 0, 0, 1]],
    "sheared": [[1, 0.8, -0.3, 0], [0, 1, 0.5, 30], [0.2, 0, 1, 0], [0, 0, 0, 1]],
}


def rays_of(o, d, n, dtype):
    rays = new_rays(n, dtype)
    rays.ray[:], rays.ray[DX], rays.ray[T], rays.prim[:], rays.depth[:] = 0, 1, DEAD, -1, 0
    rays.ray[OX:OX + 3, :n], rays.ray[DX:DX + 3, :n], rays.ray[START, :n], rays.ray[T, :n] = o, d, 0, np.inf
    return rays


def trace(geometry, o, d):
    """Rays (3, n) against a scene: their rays and the surfaces they hit."""
    n = o.shape[1]
    rays = rays_of(o, d, n, geometry.dtype)
    surface = np.zeros((SURFACE_ROWS, rays.ray.shape[1]), geometry.dtype)
    for group in geometry.groups:
        group.kind.intersect(rays, n, group.tree, group.table, group.first, CLOSEST)
    for group in geometry.groups:
        group.kind.surface(rays, n, surface, group.table, group.first)
    return rays, surface


def first_hits(geometry, matrix, rng, far: float):
    """Rays from all around at the shape; of those that hit, the direction, and the surface's rows."""
    m = np.array(matrix, float)
    target = m[:3, :3] @ rng.uniform(-1, 1, (3, RAYS)) + m[:3, 3:]
    way = rng.normal(size=(3, RAYS))
    way /= np.linalg.norm(way, axis=0)
    o = (target + way * np.abs(m[:3, :3]).sum() * far).astype(geometry.dtype)
    rays, surface = trace(geometry, o, (-way).astype(geometry.dtype))
    hit = np.flatnonzero(rays.prim[:RAYS] >= 0)
    assert len(hit) > RAYS / 40
    return rays.ray[DX:DX + 3, hit].astype(float), surface[:, hit]


def spawn(surface, side, rng, dtype):
    """As `lights._shine` and `shading.bounce` do: the point moved by ERR along the normal, toward `side`; cosine distributed, or all but
    level with the surface."""
    n = surface.shape[1]
    normal = surface[GX:GX + 3].astype(float) * side
    origin = (surface[PX:PX + 3].astype(float) + surface[ERR].astype(float) * normal).astype(dtype)
    way = rng.normal(size=(3, n))
    way /= np.linalg.norm(way, axis=0)
    way = np.where(np.arange(n) % 2, way + normal, way - normal * (way * normal).sum(0) + 1e-4 * normal)
    way /= np.linalg.norm(way, axis=0)
    keep = (way * normal).sum(0) > 1e-5
    return origin[:, keep], way[:, keep].astype(dtype), keep


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("place", TRANSFORMS)
@pytest.mark.parametrize("name", CONVEX)
def test_convex_shape_is_not_met_again(name, place, precision):
    matrix = TRANSFORMS[place]
    scene = Scene(objects=[Node(shape=CONVEX[name], transform=[Matrix(np.array(matrix).tolist())])])
    geometry = flatten(scene, precision)
    rng = np.random.default_rng(5)
    for far in (1.0, 300.0):
        d, surface = first_hits(geometry, matrix, rng, far)
        # on the outside of a closed shape the normal's; of a flat one the side that the eye is on
        side = np.where((d * surface[GX:GX + 3]).sum(0) < 0, 1.0, -1.0)
        outside = side > 0 if name in ("sphere", "mesh", "box", "cylinder", "cone", "frustum") else side != 0
        o, way, _ = spawn(surface[:, outside], side[outside], rng, geometry.dtype)
        again, _ = trace(geometry, o, way)
        bad = np.flatnonzero(again.prim[:o.shape[1]] >= 0)
        assert len(bad) == 0, (len(bad), o.shape[1], o[:, bad[0]].tolist(), way[:, bad[0]].tolist(), again.ray[T, bad[0]])


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("place", TRANSFORMS)
@pytest.mark.parametrize("name", CONVEX)
def test_ray_into_a_closed_shape_comes_out(name, place, precision):
    """A refracted ray starts beneath the surface: it meets the far wall, however near, and never leaves unnoticed."""
    matrix = TRANSFORMS[place]
    geometry = flatten(Scene(objects=[Node(shape=CONVEX[name], transform=[Matrix(np.array(matrix).tolist())])]), precision)
    rng = np.random.default_rng(6)
    d, surface = first_hits(geometry, matrix, rng, 2.0)
    if name in ("plane", "triangle", "polygon"):    # nothing is behind these
        o, way, _ = spawn(surface, np.where((d * surface[GX:GX + 3]).sum(0) < 0, -1.0, 1.0), rng, geometry.dtype)
        assert (trace(geometry, o, way)[0].prim[:o.shape[1]] < 0).all()
        return
    entering = (d * surface[GX:GX + 3]).sum(0) < -1e-3
    o, way, _ = spawn(surface[:, entering], np.full(entering.sum(), -1.0), rng, geometry.dtype)
    again, _ = trace(geometry, o, way)
    lost = again.prim[:o.shape[1]] < 0
    # a start within an error bound of an edge may lie outside the neighbouring face: in float32 that bound is 1e-6 of the size, and
    # a hundredth of it where a thing of size 1e-3 stands 11 from the origin
    assert lost.mean() <= (0 if precision == "f64" else 5e-3 if place == "small and far" else 1e-4), lost.sum()


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", CONVEX)
def test_second_surface_at_a_tiny_gap_is_met(name, precision):
    """A plane over the shape, a gap of 64 roundings of their coordinates apart, is met by every ray that leaves toward it, and a
    shadow ray to beyond it is stopped."""
    geometry = flatten(Scene(objects=[CONVEX[name]]), precision)
    rng = np.random.default_rng(7)
    d, surface = first_hits(geometry, np.eye(4), rng, 1.5)
    side = np.where((d * surface[GX:GX + 3]).sum(0) < 0, 1.0, -1.0)
    for k in rng.integers(0, surface.shape[1], 40):
        normal = surface[GX:GX + 3, k].astype(float) * side[k]
        gap = 64 * EPS[precision] * max(np.abs(surface[PX:PX + 3, k]).max(), surface[ERR, k] / (16 * EPS[precision]))
        lid = Plane(tuple(surface[PX:PX + 3, k].astype(float) + normal * gap), tuple(normal))
        both = flatten(Scene(objects=[CONVEX[name], lid]), precision)
        same = np.repeat(surface[:, k:k + 1], 100, axis=1)
        o, way, _ = spawn(same, np.full(100, side[k]), rng, geometry.dtype)
        rays, _ = trace(both, o, way)
        steep = (way * normal[:, None]).sum(0) > 0.02
        met = both.leaf[rays.prim[:o.shape[1]]] == 1
        assert (met & (rays.prim[:o.shape[1]] >= 0))[steep].all(), (k, normal.tolist(), gap)


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_error_bound_covers_the_error(precision):
    """ERR against the true distance of the point from a sphere and a plane, in longer arithmetic."""
    rng = np.random.default_rng(9)
    for shape in (msgspec.structs.replace(CONVEX["sphere"], center=(30.0, -7.0, 2.0)), CONVEX["plane"]):
        m = np.eye(4)
        m[:3, 3] = (30, -7, 2) if isinstance(shape, Sphere) else (0, 0, 0)
        geometry = flatten(Scene(objects=[shape]), precision)
        _, surface = first_hits(geometry, m, rng, 5.0)
        p = surface[PX:PX + 3].astype(np.longdouble)
        row = geometry.groups[0].table.data[0].astype(np.longdouble)
        if isinstance(shape, Sphere):
            off = np.abs(np.sqrt(((p - row[:3, None]) ** 2).sum(0)) - row[3] * row[4])
        else:
            off = np.abs(((p - row[:3, None]) * row[3:6, None]).sum(0))
        assert (off <= surface[ERR]).all()
        assert (off > 0).any()


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("scale", [(1, 1, 1), (1, 2, 0.5)], ids=["sphere", "ellipsoid"])
@pytest.mark.parametrize("center", [(0, 0, 0), (3.5, -40.25, 7)], ids=["near", "far"])
def test_starts_a_few_roundings_from_a_sphere_are_told_apart(center, scale, precision):
    """In or out, toward or away, and all but level with the surface: whether anything is met, against fractions."""
    n, radius, rng = 3000, 0.1, np.random.default_rng(11)
    dtype = np.dtype("f8" if precision == "f64" else "f4").type
    eps, stretch = EPS[precision], np.array(scale)
    up = rng.normal(size=(n, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    level = np.cross(up, rng.normal(size=(n, 3)))
    steep = rng.choice([-1, 1], n) * 10 ** rng.uniform(np.log10(eps) - 1, 0.5, n)
    off = eps * rng.choice([-1, 1], n) * 10 ** rng.uniform(-1, 3.5, n)
    origin = ((np.array(center) + radius * up * (1 + off[:, None])) * stretch).astype(dtype)
    direction = ((level + steep[:, None] * up) * stretch).astype(dtype)
    ball = Sphere(center, float(dtype(radius)))
    scene = Scene(objects=[Node(shape=ball, transform=[Scale(scale)] if scale != (1, 1, 1) else [])])
    met = np.isfinite(rtcore.intersect(scene, origin, direction, precision=precision).t)
    for o, d, found in zip(origin.tolist(), direction.tolist(), met):
        f = [Fraction(x) / Fraction(s) - Fraction(c) for x, s, c in zip(o, scale, center)]
        v = [Fraction(x) / Fraction(s) for x, s in zip(d, scale)]
        a, b, c = (sum(x * y for x, y in zip(*pair)) for pair in ((v, v), (f, v), (f, f)))
        c -= Fraction(ball.radius) ** 2
        assert found == (c < 0 or (b < 0 and b * b >= a * c)), (o, d)
    assert 0.2 < met.mean() < 0.9
