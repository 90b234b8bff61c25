"""The tree: sound whatever the boxes, no deeper than its stack, and never in the way of a hit."""
import functools

import numpy as np
import pytest

import rtcore
from rtcore import Box, Cone, Cylinder, Matrix, Mesh, Node, Polygon, Scene, Sphere, Triangle
from rtcore.bvh import LINK, NODE, _split, build, validate
from rtcore.flatten import flatten
from rtcore.shapes.triangle import SINGLY
from rtcore.wave import CLOSEST, DEAD, DX, OPAQUE, OX, START, T, new_rays

RNG = np.random.default_rng


def boxes(name: str, n: int = 500):
    rng = RNG(n)
    low = rng.normal(size=(n, 3))
    size = rng.uniform(0, 0.3, (n, 3))
    if name == "clustered":
        low = low[rng.integers(0, min(5, n), n)] * 100 + low * 1e-3
    elif name == "identical":
        low, size = np.ones((n, 3)), np.ones((n, 3))
    elif name == "points":
        low, size = np.full((n, 3), 0.1), np.zeros((n, 3))
    elif name == "flat":
        low[:, 1], size[:, 1] = 0.3, 0
    elif name == "huge":
        low, size = low * 1e30, size * 1e30
    elif name == "tiny":
        low, size = low * 1e-30, size * 1e-30
    elif name == "offset":
        low += 1e7
    elif name == "one huge":
        low[0], size[0] = -1e9, 2e9
    elif name == "geometric":       # each 4 times as far as the last: binning cuts off one at a time
        low, size = np.zeros((n, 3)), np.zeros((n, 3))
        low[:, 0] = 4.0 ** -np.arange(n)
    elif name == "geometric sizes":
        low, size = np.zeros((n, 3)), np.repeat(2.0 ** -np.arange(n)[:, None], 3, 1)
    elif name == "line":
        low, size = np.repeat(np.arange(float(n))[:, None], 3, 1), np.ones((n, 3))
    return low, low + size


NAMES = ["random", "clustered", "identical", "points", "flat", "huge", "tiny", "offset", "one huge", "geometric", "geometric sizes", "line"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("n", [1, 4, 5, 9, 500])
def test_tree_is_sound(name, n):
    low, high = boxes(name, n)
    tree, order = build(low, high, 4)
    assert sorted(order.tolist()) == list(range(n))
    validate(tree, low[order], high[order])
    there = tree.box.reshape(-1, NODE, 8)[:, :6]
    there = there.transpose(0, 2, 1).reshape(-1, 6)
    there = there[there[:, 0] <= there[:, 3]]
    assert np.isfinite(there).all() and np.abs(there).max() < 1.001


@pytest.mark.parametrize("name", ["random", "clustered", "geometric"])
@pytest.mark.parametrize("n", [2, 9, 40, 200])
def test_the_sum_of_the_nodes_areas_is_the_least_there_is(name, n):
    """Against all ways to cut the same binary tree, by trying them."""
    low, high = (side / 1e3 for side in boxes(name, n))
    box, link = np.empty((2 * n, 6)), np.empty((2 * n, 2), np.int32)
    box = box[:_split(low, high, 1, box, link, np.arange(n, dtype=np.int32))]
    size = box[:, 3:] - box[:, :3]
    area = size[:, 0] * size[:, 1] + size[:, 1] * size[:, 2] + size[:, 2] * size[:, 0]

    @functools.cache
    def least(b: int, room: int) -> float:
        """Of all nodes below b if it may become so many children of one node."""
        if link[b, 1] > 0:
            return 0.0
        alone = area[b] + min(least(b + 1, k) + least(link[b, 0], 8 - k) for k in range(1, 8))
        return min([alone] + [least(b + 1, k) + least(link[b, 0], room - k) for k in range(1, room)])
    tree, _ = build(low, high, 1)
    nodes, links = tree.box.reshape(-1, NODE, 8).astype(float), tree.link.reshape(-1, NODE, 8)[:, LINK]
    x, y, z = (nodes[:, 3 + k] - nodes[:, k] for k in range(3))
    inner = (links > 0) & (x >= 0)
    total = area[0] + (x * y + y * z + z * x)[inner].sum() / tree.frame[3] ** 2
    assert total == pytest.approx(least(0, 1), rel=1e-4)


def test_validate_finds_a_primitive_that_sticks_out():
    low, high = boxes("random")
    tree, order = build(low, high, 4)
    low, high = low[order], high[order]
    low[17] -= 5
    with pytest.raises(AssertionError, match="sticks out"):
        validate(tree, low, high)


def test_validate_finds_a_primitive_that_is_in_two_leaves():
    low, high = boxes("random")
    tree, order = build(low, high, 4)
    nodes, links = tree.box.reshape(-1, NODE, 8), tree.link.reshape(-1, NODE, 8)[:, LINK]
    there = nodes[:, 0] <= nodes[:, 3]
    leaf = tuple(np.argwhere(there & (links < -8))[3])
    links[leaf] += 8        # begins one primitive sooner
    for row in range(6):
        nodes[:, row][there] = -2 if row < 3 else 2
    with pytest.raises(AssertionError, match="several"):
        validate(tree, low[order], high[order])


# --- walk ---

def place(i: int, rng, spread: float) -> list:
    m = np.eye(4)
    m[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.05, 0.4) @ np.diag([1, rng.uniform(0.3, 1), 1])
    m[:3, 3] = rng.uniform(-1, 1, 3) * spread
    return [Matrix(m.tolist())]


SHAPES = {
    "sphere": Sphere((0, 0, 0), 1), "triangle": Triangle((-1, -1, 0), (1, -1, 0), (0, 1, 0)), "box": Box((-1, -1, -1), (1, 1, 1)),
    "polygon": Polygon(((-1, -1, 0), (1, -1, 0), (0, 0, 0), (0, 1, 0))), "cylinder": Cylinder((0, 0, -1), (0, 0, 1), 0.5),
    "cone": Cone((0, 0, -1), 1, (0, 0, 1)),
}


def crowd(name: str, offset=(0, 0, 0), scale: float = 1.0, n: int = 60) -> Scene:
    rng = RNG(11)
    shift = np.eye(4) * scale
    shift[3, 3], shift[:3, 3] = 1, offset
    group = Node(children=[Node(shape=SHAPES[name], transform=place(i, rng, 1.0)) for i in range(n)], transform=[Matrix(shift.tolist())])
    return Scene(objects=[group])


def trace(scene: Scene, o, d, precision: str, with_tree: bool):
    """Nearest t, leaf hit, and whether anything was, with the scene's trees or with such as cull nothing."""
    geometry = flatten(scene, precision)
    n = len(o)

    def rays():
        r = new_rays(n, geometry.dtype)
        r.ray[:], r.ray[DX], r.ray[T], r.prim[:], r.depth[:] = 0, 1, DEAD, -1, 0
        r.ray[OX:OX + 3, :n], r.ray[DX:DX + 3, :n], r.ray[START, :n], r.ray[T, :n] = np.transpose(o), np.transpose(d), 0, np.inf
        return r

    closest, anything = rays(), rays()
    for group in geometry.groups:
        tree = group.tree
        if not with_tree:
            low, high = np.full((len(group.owner), 3), -1e30), np.full((len(group.owner), 3), 1e30)
            tree, _ = build(low, high, 8)
        else:
            assert group.has_tree
        group.kind.intersect(closest, n, tree, group.table, group.first, CLOSEST)
        group.kind.intersect(anything, n, tree, group.table, group.first, np.full(len(geometry.leaf), OPAQUE, np.int32))
    return closest.ray[T, :n], closest.prim[:n], anything.prim[:n] >= 0


def compare(scene, o, d, precision, least_hits):
    dtype = {"f64": np.float64, "f32": np.float32}[precision]
    o, d = o.astype(dtype), d.astype(dtype)
    t, prim, shadow = trace(scene, o, d, precision, True)
    t_all, prim_all, shadow_all = trace(scene, o, d, precision, False)
    wrong = np.flatnonzero((t != t_all) | (prim != prim_all))
    assert len(wrong) == 0, (len(wrong), o[wrong[0]].tolist(), d[wrong[0]].tolist(), t[wrong[0]], t_all[wrong[0]])
    assert (shadow == shadow_all).all() and (shadow == (prim >= 0)).all()
    assert (prim >= 0).sum() >= least_hits


def directions(rng, n: int) -> np.ndarray:
    """Random ones; some with parts 0 or -0.0, some along an axis, some all but along one."""
    d = rng.normal(size=(n, 3))
    d[::5, 0], d[1::5, 1], d[2::5, 2] = 0.0, -0.0, 1e-30
    d[3::25, :2] = -0.0
    d[8::25, 1:] = 1e-20
    return d


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", SHAPES)
class TestWalk:
    """The same bits with the tree as without: nothing culled, nothing found twice."""

    def test_near(self, name, precision):
        rng = RNG(1)
        compare(crowd(name), rng.uniform(-1.5, 1.5, (4000, 3)), directions(rng, 4000), precision, 300)

    def test_directions_of_any_length(self, name, precision):
        rng = RNG(2)
        d = directions(rng, 3000) * 10.0 ** rng.uniform(-12, 12, (3000, 1))
        compare(crowd(name), rng.uniform(-1.5, 1.5, (3000, 3)), d, precision, 200)

    @pytest.mark.parametrize("far", [1e3, 1e8])
    def test_far_eye(self, name, precision, far):
        rng = RNG(3)
        way = rng.normal(size=(3000, 3))
        way /= np.linalg.norm(way, axis=1)[:, None]
        compare(crowd(name), rng.uniform(-1, 1, (3000, 3)) + way * far, -way, precision, 100 if precision == "f64" or far < 1e6 else 0)

    @pytest.mark.parametrize("offset,scale", [((1e7, -3e6, 2e7), 1e5), ((0, 0, 0), 1e12), ((0, 0, 0), 1e-12), ((3e4, 0, 0), 1.0)])
    def test_offset_and_size(self, name, precision, offset, scale):
        rng = RNG(4)
        o = rng.uniform(-1.5, 1.5, (3000, 3)) * scale + offset
        compare(crowd(name, offset, scale), o, directions(rng, 3000), precision, 100)

    def test_far_from_the_origin(self, name, precision):
        """Shapes of size 1 at 1e7: in float32 hardly a digit is left, but the tree must not see less than the kernel does."""
        rng = RNG(5)
        o = rng.uniform(-1.5, 1.5, (3000, 3)) + (1e7, 0, 0)
        compare(crowd(name, (1e7, 0, 0)), o, directions(rng, 3000), precision, 10)


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", SHAPES)
def test_a_beam_that_comes_apart(name, precision):
    """Parallel rays among shapes smaller than their bundle: of a packet only few meet a node. A packet of nine comes after a full one, and
    what is in the columns behind it stays as it was, alive though it looks."""
    geometry, n = flatten(crowd(name, n=300), precision), 73
    (group,) = geometry.groups
    u, v = np.meshgrid(np.linspace(-1, 1, 8), np.linspace(-1, 1, 8))
    full = np.stack([u.ravel(), v.ravel(), u.ravel() * 0 - 3], 1)
    o = np.concatenate([full, full])        # behind the nine are those that the packet before has at these places
    results = []
    for tree in group.tree, build(np.full((300, 3), -1e30), np.full((300, 3), 1e30), 8)[0]:
        rays = new_rays(len(o), geometry.dtype)
        rays.ray[:], rays.prim[:], rays.depth[:] = 0, -1, 0
        rays.ray[OX:OX + 3], rays.ray[DX + 2], rays.ray[T] = o.T, 1, np.inf
        rays.ray[T, n:80] = DEAD            # the rest of the last vector
        group.kind.intersect(rays, n, tree, group.table, group.first, CLOSEST)
        results.append((rays.ray[T].copy(), rays.prim.copy()))
    (t, prim), (t_all, prim_all) = results
    np.testing.assert_array_equal(prim, prim_all)
    np.testing.assert_array_equal(t, t_all)
    assert (t[80:] == np.inf).all() and (prim[80:] == -1).all() and (prim[80 - 64:64] >= 0).sum() > 5


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_rays_in_the_planes_of_box_faces(precision):
    """A wall of equal boxes: rays along the seams, in the planes that boxes and nodes share."""
    scene = Scene(objects=[Box((i, j, 0), (i + 1, j + 1, 1)) for i in range(6) for j in range(6)])
    at = np.arange(0, 6.5, 0.5)
    across, level = [(x, -3, z) for x in at for z in (0, 0.5, 1)], [(-3, y, z) for y in at for z in (0, 1)]
    o = np.array([*((x, y, -3) for x in at for y in at), *across, *level])
    d = np.array([(0, 0, 1)] * len(at) ** 2 + [(-0.0, 1, 0)] * 3 * len(at) + [(1, 0, -0.0)] * 2 * len(at), float)
    compare(scene, o, d, precision, len(o))


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_flat_mesh_and_coplanar_rays(precision):
    x, y = np.meshgrid(np.arange(12.0), np.arange(12.0))
    vertices = np.stack([x.ravel(), y.ravel(), x.ravel() * 0], 1)
    corner = (np.arange(11)[:, None] * 12 + np.arange(11)).ravel()
    faces = np.concatenate([np.stack([corner, corner + 1, corner + 12], 1), np.stack([corner + 1, corner + 13, corner + 12], 1)])
    scene = Scene(objects=[Mesh(vertices, faces)])
    rng = RNG(6)
    o = np.concatenate([rng.uniform(0, 11, (2000, 3)) * (1, 1, 0) + (0, 0, 1), rng.uniform(-1, 12, (500, 3)) * (1, 1, 0)])
    d = np.concatenate([np.tile([-0.0, 0.0, -1], (2000, 1)), rng.normal(size=(500, 3)) * (1, 1, 0)])
    compare(scene, o, d, precision, 2000)
    assert (rtcore.intersect(scene, o[:2000], d[:2000], precision=precision).t == 1).all()


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_geometric_series_is_traced(precision):
    """Spheres each half as large and half as far as the last, to the limits of float32."""
    scene = Scene(objects=[Sphere((2.0 ** -i, 0, 0), 2.0 ** -i / 8) for i in range(60)])
    o = np.array([(2.0 ** -i, 0, -2.0 ** -i) for i in range(60)])
    hits = rtcore.intersect(scene, o, np.tile((0, 0, 1), (60, 1)), precision=precision)
    assert hits.node.tolist() == list(range(60))
    assert (hits.t == 2.0 ** -np.arange(60) * (1 - 1 / 8)).all()


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("spread", [0.0, 0.02, 0.5, 3.0])
@pytest.mark.parametrize("side", [30, 120])
def test_rays_that_scatter_by_and_by_hit_the_same(side, spread, precision):
    """Packets as narrow as a pixel's, as wide as a reflection's, and without any direction, in a tree through which rays that scatter are
    walked together, and in one of so many triangles that they are walked singly: all find what a tree finds that culls nothing."""
    u, v = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
    points = np.stack([u, v, 0.2 * np.sin(5 * u) * np.cos(4 * v)], -1).reshape(-1, 3)
    k = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + side], 1), np.stack([k + 1, k + side + 1, k + side], 1)])
    scene = Scene(objects=[Mesh(points, faces)])
    assert (len(faces) >= SINGLY) == (side == 120)
    rng = RNG(3)
    d = np.array([0.2, -0.1, -1.0]) + spread * rng.normal(size=(160, 3))
    o = np.where(spread < 1, [0.1, 0.0, 2.0], rng.uniform(-1, 1, (160, 3)))
    with_tree, without = trace(scene, o, d, precision, True), trace(scene, o, d, precision, False)
    assert np.isfinite(with_tree[0]).sum() > 30
    for found, expected in zip(with_tree, without):
        np.testing.assert_array_equal(found, expected)
