"""Tori: no crossing too many or too few, tangents by an ulp, far, thin, spindle-shaped and distorted, against exact crossings."""
import numpy as np
import pytest

import rtcore
from rtcore import Matrix, Node, Scale, Scene, Shear, Torus
from rtcore.flatten import flatten
from rtcore.shapes.kind import SIDES
from rtcore.wave import CLOSEST, DX, ERR, OX, SLOW, START, SURFACE_ROWS, T, new_rays

DTYPES = {"f64": np.float64, "f32": np.float32}
RING, HORN, SPINDLE, THIN = Torus(1, 0.25), Torus(1, 1), Torus(0.5, 1.25), Torus(1, 1e-6)
MORE, LESS = 1 + 2.0 ** -52, 1 - 2.0 ** -53
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
EXTREME = np.array([[1e-6, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1e6, 0.3], [0, 0, 0, 1]])
TRANSFORMS = {"none": (), "moved": (Matrix([[0.36, 0.48, -0.8, 5], [-0.8, 0.6, 0, -7], [0.48, 0.64, 0.6, 3], [0, 0, 0, 1]]),),
              "stretched": (Matrix(EXTREME.tolist()),), "sheared": (Scale((1, 2, 0.1)), Shear(xy=3))}


def one_after_the_other(shape, o, d, precision="f64"):
    """Every hit of one ray, each beyond the one before."""
    scene, t, found = Scene(objects=[shape]), 0.0, []
    while len(found) < 6:
        t = float(rtcore.intersect(scene, [o], [d], precision=precision, t_min=t).t[0])
        if t == np.inf:
            return found
        found.append(t)


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("shape,o,d,true", [
    (RING, (0, 0, -5), Z, []), (RING, (-5, 0, 0), X, [3.75, 4.25, 5.75, 6.25]), (RING, (1, -5, 0.25), Y, [5]),
    (RING, (-5, 0.75, 0), X, [4, 5, 6]), (RING, (1.25, -5, 0), Y, [5]), (HORN, (0, 0, -5), Z, [5]), (RING, (1.25, 0, 0), X, []),
    (RING, (1.25, 0, 0), (-1, 0, 0), [0.5, 2, 2.5]), (SPINDLE, (0, 0, -5), Z, [3.85435607626104, 6.14564392373896]),
])
def test_cases(shape, o, d, true, precision):
    assert one_after_the_other(shape, o, d, precision) == [DTYPES[precision](t) for t in true]


@pytest.mark.parametrize("o,d,count", [
    ((MORE, -5, 0.25), Y, 0), ((LESS, -5, 0.25), Y, 2), ((1, -5, 0.25 * MORE), Y, 0), ((1, -5, 0.25 * LESS), Y, 2),
    ((1.25 * MORE, -5, 0), Y, 0), ((1.25 * LESS, -5, 0), Y, 2), ((-5, 0.75 * LESS, 0), X, 4), ((-5, 0.75 * MORE, 0), X, 2),
    ((1.25 * MORE, -1e5, 0), Y, 0), ((1.25 * LESS, -1e5, 0), Y, 2),
])
def test_an_ulp_beside_a_tangent(o, d, count):
    hits = one_after_the_other(RING, o, d)
    assert len(hits) == count
    assert hits == sorted(set(rtcore.crossings(RING, o, d).tolist()))


def families(rng, shape, n):
    """Origins and directions: grazing, at the surface, from near and far, along the axis, and small fractions that meet by chance."""
    big, small = shape.major_radius, shape.minor_radius
    a, b = rng.uniform(0, 2 * np.pi, (2, n))
    ring = np.stack([np.cos(a), np.sin(a), 0 * a], 1)
    normal = np.cos(b)[:, None] * ring + np.sin(b)[:, None] * np.array([0, 0, 1])
    p, any_way = big * ring + small * normal, rng.normal(size=(n, 3))
    any_way /= np.linalg.norm(any_way, axis=1, keepdims=True)
    tangent = np.cross(normal, any_way)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    off = 10 ** rng.uniform(-16, -2, (n, 1)) * rng.choice([-1, 1], (n, 1))
    for distance in (3, 1e3):
        yield p + small * off * normal - distance * (big + small) * tangent, tangent
    yield p, any_way
    yield p + 1e-9 * normal, normal + 0.9 * any_way
    for distance in (3, 1e3, 1e7):
        yield p - distance * (big + small) * any_way, any_way * 10 ** rng.uniform(-3, 3, (n, 1))
    yield big * ring + 0.5 * small * normal, any_way
    yield np.stack([10 ** rng.uniform(-12, -1, n), 0 * a, 0 * a - 5], 1), np.broadcast_to(np.array([0.0, 0, 1]), (n, 3))
    whole = rng.integers(-2, 3, (n, 3)).astype(float)
    yield rng.integers(-12, 13, (n, 3)) / 4.0, np.where(whole.any(1)[:, None], whole, 1.0)


@pytest.mark.parametrize("transform", TRANSFORMS)
@pytest.mark.parametrize("shape", [RING, HORN, SPINDLE, THIN, Torus(143, 113.2)])
@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_first_crossing(precision, shape, transform):
    """The oracle's hit or miss, and its t to an ulp."""
    rng, dtype = np.random.default_rng(5), DTYPES[precision]
    node = Node(shape=shape, transform=TRANSFORMS[transform])
    matrix, = (leaf.matrix for leaf in Scene(objects=[node]).leaves())
    for o, d in families(rng, shape, 12):
        o, d = (o @ matrix[:3, :3].T + matrix[:3, 3]).astype(dtype), (d @ matrix[:3, :3].T).astype(dtype)
        found = rtcore.intersect(Scene(objects=[node]), o, d, precision=precision).t
        for origin, direction, t in zip(o, d, found):
            true = next((x for x in rtcore.crossings(node, origin, direction, precision) if x > 0), np.inf)
            assert t == true or abs(t - true) <= np.spacing(true), (origin, direction)


@pytest.mark.parametrize("sides", SIDES)
def test_every_crossing_of_visible_sides(sides):
    rng, seen = np.random.default_rng(6), 0
    for big, small in ((1, 0.25), (0.5, 1.25)):
        shape = Torus(big, small, sides=sides)
        for o, d in zip(rng.normal(size=(40, 3)) * 3, rng.uniform(-1, 1, (40, 3))):
            d = d - o
            true = rtcore.crossings(shape, o, d)
            hits = one_after_the_other(shape, o, d)
            assert np.abs(np.array(hits) - true[true > 0]).max(initial=0) < 1e-14
            seen += len(hits)
    assert seen > 40


def cast(scene, o, d, precision):
    """Rays and surface rows straight from the kernels."""
    geometry, rays = flatten(scene, precision), new_rays(len(o), DTYPES[precision])
    rays.ray[OX:OX + 3, :len(o)], rays.ray[DX:DX + 3, :len(o)] = o.T, d.T
    rays.ray[START], rays.ray[T], rays.prim[:] = 0, np.inf, -1
    rays.ray[T, len(o):] = -np.inf
    group, = geometry.groups
    group.kind.intersect(rays, len(o), group.tree, group.table, 0, CLOSEST)
    out = np.zeros((SURFACE_ROWS, rays.ray.shape[1]), DTYPES[precision])
    group.kind.surface(rays, len(o), out, group.table, 0)
    return rays, out[:, :len(o)], rays.prim[:len(o)] >= 0


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_few_rays_are_slow(precision):
    rng = np.random.default_rng(7)
    o = rng.normal(size=(100_000, 3)) * 3
    rays, _, hit = cast(Scene(objects=[RING]), o, rng.uniform(-1, 1, o.shape) - o, precision)
    assert hit.mean() > 0.3 and rays.tally[SLOW] <= 5


@pytest.mark.parametrize("transform", TRANSFORMS)
@pytest.mark.parametrize("shape", [RING, SPINDLE, THIN])
@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_the_point_is_as_close_as_promised(precision, shape, transform):
    """The point of a hit lies within its error bound of the surface."""
    rng = np.random.default_rng(8)
    node = Node(shape=shape, transform=TRANSFORMS[transform])
    matrix, = (leaf.matrix for leaf in Scene(objects=[node]).leaves())
    for o, d in list(families(rng, shape, 40))[2:8]:
        o, d = o @ matrix[:3, :3].T + matrix[:3, 3], d @ matrix[:3, :3].T
        _, out, hit = cast(Scene(objects=[node]), o, d, precision)
        back = np.linalg.inv(matrix[:3, :3].astype(np.longdouble).astype(float)).astype(np.longdouble)
        p = (out[:3, hit].astype(np.longdouble).T - matrix[:3, 3]) @ back.T
        rounded = shape.rounded(DTYPES[precision])
        big, small = np.longdouble(rounded.major_radius), np.longdouble(rounded.minor_radius)
        off = np.hypot(p[:, 0], p[:, 1])
        away = np.minimum(np.abs(np.hypot(off - big, p[:, 2]) - small), np.abs(np.hypot(off + big, p[:, 2]) - small))
        # a step of ERR in the world is one of at least ERR / |matrix| in the torus's own space
        stretch = np.linalg.norm(back.astype(float), 2)
        assert (away <= 1.01 * stretch * out[ERR, hit] + 1e-15).all()
