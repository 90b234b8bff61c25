"""Blobs: the rows of the table of cases, what merges and what only touches, every crossing one after the other, and what is refused."""
import numpy as np
import pytest

import rtcore
from rtcore import Blob, FieldError, Matrix, Node, Scale, Scene, Shear
from rtcore.flatten import flatten
from rtcore.reports.oracle import TWINS, crossings, mp, nearest, vector
from rtcore.wave import CLOSEST, DX, ERR, OX, SLOW, START, SURFACE_ROWS, T, new_rays

ONE = Blob([((0, 0, 0), 1, 1)], 0.6)
TWO = Blob([((0.75, 0, 0), 1, 1), ((-0.75, 0, 0), 1, 1)], 0.3828125)
#: As TWO across the z axis, and between elements whose spheres begin and end in the plane where it is flat.
LATTICE = Blob([((0.75, 0, 0), 1, 1), ((-0.75, 0, 0), 1, 1), ((0, 1, 0), 1, -0.125), ((0, -1, 0), 1, -0.125)], 0.3828125)
FULL = Blob([((0, 0, 0), 0.3, 0.7)], 0.7)
EYE = np.eye(4)


def cast(shape, origins, directions, precision="f64", transform=(), **interval):
    """Nearest hits, once any-hit has been seen to agree."""
    scene = Scene(objects=[Node(shape=shape, transform=transform)])
    directions = np.broadcast_to(np.asarray(directions, float), np.shape(origins))
    hits = rtcore.intersect(scene, origins, directions, precision=precision, **interval)
    if not interval:
        assert (rtcore.occluded(scene, origins, directions, precision=precision) == np.isfinite(hits.t)).all()
    assert np.isfinite(hits.normal).all() and np.isfinite(hits.uv).all() and not np.isnan(hits.t).any()
    return hits


def random_blob(rng, count: int) -> Blob:
    """Elements about the origin, a third of them negative."""
    while True:
        elements = [(rng.uniform(-1, 1, 3), 10 ** rng.uniform(-0.7, 0.2), 10 ** rng.uniform(-0.5, 0.5) * (1 if i % 3 else -0.5))
                    for i in range(1, count + 1)]
        try:
            return Blob(elements, 10 ** rng.uniform(-1.5, -0.5))
        except FieldError:
            continue


def random_rays(rng, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Through the cube -1 .. 1, a third of them from within."""
    origins = rng.normal(size=(n, 3)) * np.where(np.arange(n) % 3, 4, 0.6)[:, None]
    return origins, rng.uniform(-1, 1, (n, 3)) - origins


def field(blob: Blob, points: np.ndarray) -> np.ndarray:
    """Field minus threshold at points (..., 3)."""
    total = np.full(points.shape[:-1], -blob.threshold, points.dtype)
    for center, radius, strength in blob.elements:
        total += strength * np.maximum(1 - ((points - center) ** 2).sum(-1) / radius ** 2, 0) ** 2
    return total


def test_one_element():
    truth = nearest(ONE, EYE, (-5, 0, 0), (1, 0, 0)).t
    hits = cast(ONE, [(-5, 0, 0)], (1, 0, 0))
    assert abs(mp.mpf(hits.t[0]) - truth) <= np.spacing(5) and hits.normal.tolist() == [[-1, 0, 0]]


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("shape", [TWO, LATTICE])
def test_the_saddle_where_two_merge(shape, precision):
    roots = [t for t, _ in TWINS[Blob](shape, vector((0, -5, 0)), vector((0, 1, 0)))]
    assert roots and all(abs(t - 5) < 1e-12 for t in roots)
    assert cast(shape, [(0, -5, 0)], (0, 1, 0), precision).t.tolist() == [5]
    off = np.concatenate([-np.logspace(-12, -2, 200), np.logspace(-12, -2, 200)])
    neck = cast(shape, np.stack([off, 0 * off - 5, 0 * off], 1), (0, 1, 0), precision)
    assert np.isfinite(neck.t).all()        # no hole: along the axis the field rises from the saddle
    assert (np.abs(neck.t - 5) <= np.abs(off) * 2 + 1e-6 * (precision == "f32") + 2e-8).all()
    beside = cast(shape, np.stack([0 * off, 0 * off - 5, off], 1), (0, 1, 0), precision)
    assert (beside.t[np.abs(off) > 1e-7] == np.inf).all()      # and no speck above or below it
    # past the saddle from within one of the two
    rim = np.abs(off[np.abs(off) > 1e-7])
    through = cast(shape, np.stack([0 * rim - 0.75, 0 * rim, rim], 1), (1, 0, 0), precision)
    assert (through.t < 0.75).all() and (0.75 - through.t < 2 * rim + 1e-6).all()


@pytest.mark.parametrize("factor", [1e-3, 2.0 ** -10, 1e-9, 1e6])
@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_scaled(factor, precision):
    dtype = {"f64": np.float64, "f32": np.float32}[precision]
    origins = np.array([(-5, 0.25, 0.1), (0.8, -5, 0.2), (-0.7, 0.1, 4)], dtype)
    directions = np.array([(1, 0, 0), (0, 1, 0), (0, 0, -1)], dtype)
    scale = [Scale((factor,) * 3)]
    plain = cast(TWO, origins, directions, precision)
    small = cast(TWO, (origins * dtype(factor)).astype(dtype), directions, precision, scale)
    assert np.isfinite(plain.t).all()
    if np.log2(factor) % 1 == 0:
        assert (small.t == plain.t * dtype(factor)).all()
        return
    for o, d, t in zip((origins * dtype(factor)).astype(dtype), directions, small.t):
        truth = nearest(TWO, np.diag([factor] * 3 + [1]), o, d).t
        assert abs(mp.mpf(float(t)) - truth) <= 4 * float(np.spacing(dtype(truth)))


def test_threshold_equal_to_the_strength():
    origins = np.array([(0, -5, 0), (0, 0, 5), (-5, 0, 0), (1e-3, -5, 0)], float)
    hits = cast(FULL, origins, [(0, 1, 0), (0, 0, -1), (1, 0, 0), (0, 1, 0)])
    assert hits.t.tolist() == [5, 5, 5, np.inf]
    assert np.allclose(np.linalg.norm(hits.normal[:3], axis=1), 1)


def test_every_crossing_one_after_the_other():
    rng, seen = np.random.default_rng(2), 0
    for _ in range(8):
        blob = random_blob(rng, 4)
        for o, d in zip(*random_rays(rng, 5)):
            true, t, found = [c for c in crossings(blob, EYE, o, d) if c.t > 0], 0.0, []
            while t < np.inf:
                hits = cast(blob, [o], [d], t_min=t * (1 + 1e-12))
                t = float(hits.t[0])
                found += [(t, hits.normal[0])] * (t < np.inf)
            assert len(found) == len(true)
            for (t, normal), crossing in zip(found, true):
                facing = abs(float(sum(x * y for x, y in zip(crossing.normal, d))))
                assert abs(t - float(crossing.t)) <= 1e-14 / facing * max(1, np.abs(o).max())
                assert np.abs(normal - [float(x) for x in crossing.normal]).max() < 1e-11
                seen += 1
    assert seen > 30


@pytest.mark.parametrize("count", [1, 5, 40, 256])
def test_nothing_is_passed_over(count):
    """The field keeps its sign from the start to the hit, and on along the ray where nothing is hit."""
    rng = np.random.default_rng([count, 2])
    blob = random_blob(rng, count)
    origins, directions = random_rays(rng, 150)
    hits = cast(blob, origins, directions)
    met = np.isfinite(hits.t)
    assert met.mean() > 0.05
    steps = np.where(met, hits.t, 3.0)[:, None] * np.linspace(0, 1, 400)[1:-1]
    inside = field(blob, origins[:, None] + steps[:, :, None] * directions[:, None]) > 0
    assert (inside == inside[:, :1]).all()
    size = blob.threshold + sum(abs(strength) for _, _, strength in blob.elements)
    assert np.abs(field(blob, origins + np.where(met, hits.t, 0)[:, None] * directions)[met]).max() < 1e-13 * size


def test_far_negative_and_tiny_elements_do_no_harm():
    plain = cast(ONE, [(-5, 0.1, 0)], (1, 0, 0)).t
    more = Blob([*ONE.elements, ((1e200, 0, 0), 1e199, -1), ((0, 9, 0), 1e-40, 1e-200), ((0, 0, 3), 1, 0)], 0.6)
    assert np.allclose(cast(more, [(-5, 0.1, 0)], (1, 0, 0)).t, plain, rtol=1e-15)
    pit = Blob([*ONE.elements, ((0, 0, 0), 1e40, -0.1)], 0.6)      # as if the threshold were 0.7
    assert np.allclose(cast(pit, [(-5, 0, 0)], (1, 0, 0)).t, cast(Blob(ONE.elements, 0.7), [(-5, 0, 0)], (1, 0, 0)).t, rtol=1e-15)


EIGHT = random_blob(np.random.default_rng(9), 8)
TINY = Blob([((0.3, -0.2, 0.1), 1e-3, 1), ((0.3, -0.2, 0.1015), 1e-3, 1), ((-0.5, 0, 0), 0.8, 0.9)], 0.4)
TURN = Matrix([[0.36, 0.48, -0.8, 5], [-0.8, 0.6, 0, -7], [0.48, 0.64, 0.6, 3], [0, 0, 0, 1]])
PLACES = {"as it is": (), "scaled": (Scale((1e-3,) * 3),), "moved": (TURN,), "sheared": (Scale((1, 2, 0.1)), Shear(xy=3)),
          "stretched": (Scale((1e-6, 1, 1e6)),)}


def rays_at(rng, blob, n):
    """Rays from near and far at points of the elements, from within, past a saddle, and by small fractions."""
    centers = np.array([c for c, _, _ in blob.elements])
    radii = np.array([r for _, r, _ in blob.elements])
    k, way = rng.integers(len(radii), size=n), rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    aims = centers[k] + rng.uniform(-0.5, 0.5, (n, 3)) * radii[k, None]
    for distance in (3, 1e4):
        yield aims - distance * way, way * 10 ** rng.uniform(-2, 2, (n, 1))
    yield aims, way
    off = 10 ** rng.uniform(-20, -3, (n, 2)) * rng.choice([-1, 0, 1], (n, 2))
    yield np.stack([off[:, 0], np.full(n, -5), off[:, 1]], 1), np.broadcast_to(np.array([0.0, 1, 0]), (n, 3))
    whole = rng.integers(-2, 3, (n, 3)).astype(float)
    yield rng.integers(-6, 7, (n, 3)) / 4.0, np.where(whole.any(1)[:, None], whole, 1.0)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("blob", [ONE, TWO, FULL, EIGHT, TINY])
@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_first_crossing(precision, blob, place):
    """The oracle's hit or miss, and its t to an ulp."""
    rng, dtype = np.random.default_rng(4), {"f64": np.float64, "f32": np.float32}[precision]
    node = Node(shape=blob, transform=PLACES[place])
    matrix, = (leaf.matrix for leaf in Scene(objects=[node]).leaves())
    for o, d in rays_at(rng, blob, 8):
        o, d = (o @ matrix[:3, :3].T + matrix[:3, 3]).astype(dtype), (d @ matrix[:3, :3].T).astype(dtype)
        hits = rtcore.intersect(Scene(objects=[node]), o, d, precision=precision)
        for origin, direction, t in zip(o, d, hits.t):
            true = next((x for x in rtcore.crossings(node, origin, direction, precision) if x > 0), np.inf)
            assert t == true or abs(t - true) <= np.spacing(dtype(true)), (origin, direction)


def test_beside_a_saddle():
    """Across it the field falls by the square of the distance, too little for double-double."""
    for off in (2.0 ** -45, 2.0 ** -52, 1e-17):
        for o, hit in (((0, -5, 0), True), ((off, -5, 0), True), ((0, -5, off), False), ((off, -5, off * 4), False)):
            assert np.isfinite(cast(TWO, [o], (0, 1, 0)).t[0]) == hit == bool(len(rtcore.crossings(TWO, o, (0, 1, 0))))


def kernels(blob, origins, directions, precision):
    """Rays and surface rows straight from the kernels."""
    group, = flatten(Scene(objects=[blob]), precision).groups
    rays = new_rays(len(origins), {"f64": np.float64, "f32": np.float32}[precision])
    rays.ray[OX:OX + 3], rays.ray[DX:DX + 3], rays.ray[START], rays.ray[T], rays.prim[:] = origins.T, directions.T, 0, np.inf, -1
    group.kind.intersect(rays, len(origins), group.tree, group.table, 0, CLOSEST)
    out = np.zeros((SURFACE_ROWS, len(origins)), rays.ray.dtype)
    group.kind.surface(rays, len(origins), out, group.table, 0)
    return rays, out[:, rays.prim >= 0]


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_few_rays_are_slow(precision):
    rays, _ = kernels(EIGHT, *random_rays(np.random.default_rng(3), 40_000), precision)
    assert (rays.prim >= 0).mean() > 0.2 and rays.tally[SLOW] <= 8


@pytest.mark.parametrize("blob", [ONE, TWO, EIGHT, TINY])
@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_the_point_is_as_close_as_promised(precision, blob):
    """Field by slope, or by a parabola's rise where the slope vanishes: the surface is within ERR of the point."""
    for origins, directions in rays_at(np.random.default_rng(6), blob, 200):
        _, out = kernels(blob, origins, directions, precision)
        shape = blob if precision == "f64" else blob.rounded(np.float32)
        p = out[:3].T.astype(np.longdouble)
        steep = np.zeros_like(p)
        for center, radius, strength in shape.elements:
            u = p - center
            steep += 4 * strength / radius ** 2 * np.maximum(1 - (u ** 2).sum(-1) / radius ** 2, 0)[:, None] * u
        value, slope, error = np.abs(field(shape, p)), np.linalg.norm(steep.astype(float), axis=1), out[ERR]
        assert (value <= 1.01 * error * slope + 8 * error.astype(float) ** 2 + 1e-17).all()


@pytest.mark.parametrize("elements,threshold,message", [
    ("abc", 1, "elements: expected a list of elements: [center, radius, strength] each, got 'abc'"),
    ([], 1, "elements: expected 1 to 256 elements, got 0"),
    ([((0, 0, 0), 1, 2)] * 257, 1, "elements: expected 1 to 256 elements, got 257"),
    ([((0, 0, 0), 1)], 1, "elements[0]: expected an element: [center, radius, strength], got ((0, 0, 0), 1)"),
    ([((0, 0, 0), 1, 2), ((0, 0), 1, 2)], 1, "elements[1].center: expected three finite numbers, got (0, 0)"),
    ([((0, 0, 0), 1, 2)] * 2 + [((0, 0, 0), 0, 2)], 1, "elements[2].radius: expected a number greater than 0, got 0"),
    ([((0, 0, 0), 1, float("nan"))], 1, "elements[0].strength: expected a finite number, got nan"),
    ([((0, 0, 0), 1, 2)], 0, "threshold: expected a number greater than 0, got 0"),
    ([((0, 0, 0), 1, 2), ((0, 0, 0), 1, -5)], 2.5, "elements: expected positive strengths that together reach the threshold, 2.5, got 2.0"),
])
def test_what_is_refused(elements, threshold, message):
    with pytest.raises(FieldError) as caught:
        Blob(elements, threshold)
    assert str(caught.value) == message
