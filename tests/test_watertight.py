"""A million rays at the shared edges and vertices of closed meshes: none gets through."""
import numpy as np
import pytest

import rtcore
from rtcore import Matrix, Mesh, Node, Scene

#: Rays per mesh, 10^6 in all; the fan, where every leaf is full of needles, takes its time.
RAYS = {"ball": 320_000, "grid": 320_000, "needles": 310_000, "fan": 50_000}


def ball(parts: int):
    """A bumpy sphere: vertices and faces of a subdivided octahedron."""
    vertices = [np.array(v, float) for v in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]
    faces = [(a, b, c) for a in (0, 1) for b in (2, 3) for c in (4, 5)]
    for _ in range(parts):
        middle, finer = {}, []

        def between(i, j, middle=middle):
            key = (min(i, j), max(i, j))
            if key not in middle:
                middle[key] = len(vertices)
                v = vertices[i] + vertices[j]
                vertices.append(v / np.linalg.norm(v))
            return middle[key]
        for a, b, c in faces:
            p, q, r = between(a, b), between(b, c), between(c, a)
            finer += [(a, p, r), (p, b, q), (r, q, c), (p, q, r)]
        faces = finer
    points = np.array(vertices)
    return points * (1 + 0.1 * np.sin(7 * points[:, :1]) * np.cos(5 * points[:, 1:2])), np.array(faces)


def grid():
    """A closed box of 6 flat sides, 24 squares along each edge, whose edges are parallel to the axes and whose diagonals are shared."""
    n = 24
    i = np.arange(n)
    corner = (i[:, None] * (n + 1) + i).ravel()
    square = np.concatenate([np.stack([corner, corner + n + 1, corner + 1], 1), np.stack([corner + 1, corner + n + 1, corner + n + 2], 1)])
    u, v = (g.ravel() / n * 2 - 1 for g in np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij"))
    vertices, faces = [], []
    for axis in range(3):
        for end in (-1.0, 1.0):
            side = np.empty((len(u), 3))
            side[:, axis], side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = end, u, v
            faces.append(square + len(vertices) * len(u))
            vertices.append(side)
    return np.concatenate(vertices), np.concatenate(faces)


def fan():
    """A double cone of 1,000 triangles about each of its two apexes."""
    angle = np.arange(1000) / 1000 * 2 * np.pi
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    i, j = np.arange(1000), (np.arange(1000) + 1) % 1000
    faces = np.concatenate([np.stack([i, j, np.full(1000, 1000)], 1), np.stack([j, i, np.full(1000, 1001)], 1)])
    return np.concatenate([rim, [(0, 0, 0.8), (0, 0, -0.8)]]), faces


def needles():
    """A long thin tube, closed at both ends: triangles 1,000 times as long as wide."""
    angle = np.arange(64) / 64 * 2 * np.pi
    ring = np.stack([0.01 * np.cos(angle), 0.01 * np.sin(angle), 0 * angle], 1)
    i, j = np.arange(64), (np.arange(64) + 1) % 64
    vertices = np.concatenate([ring - (0, 0, 1), ring + (0, 0, 1), [(0, 0, -1), (0, 0, 1)]])
    return vertices, np.concatenate([np.stack([i, j, i + 64], 1), np.stack([j, j + 64, i + 64], 1), np.stack([j, i, np.full(64, 128)], 1),
                                     np.stack([i + 64, j + 64, np.full(64, 129)], 1)])


MESHES = {"ball": ball(4), "grid": grid(), "fan": fan(), "needles": needles()}


@pytest.mark.parametrize("name", MESHES)
def test_mesh_is_closed(name):
    assert sum(RAYS.values()) == 1_000_000
    vertices, faces = MESHES[name]
    _, same = np.unique(np.round(vertices, 12), axis=0, return_inverse=True)
    edges = np.sort(np.concatenate([same.ravel()[faces][:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("name", MESHES)
def test_no_ray_gets_through(name, precision):
    """The eye is inside, where every way out is a hit; rays aim at vertices and at points on edges, computed as closely as the
    precision lets them be. Half of the rays start at one point, as a camera's do, half anywhere inside."""
    (vertices, faces), n = MESHES[name], RAYS[name]
    dtype = {"f32": np.float32, "f64": np.float64}[precision]
    rng = np.random.default_rng(len(name))
    vertices = vertices.astype(dtype).astype(float)     # what the kernel sees
    corners = vertices[faces[rng.integers(0, len(faces), n)]]
    first = rng.integers(0, 3, n)
    a, b = corners[np.arange(n), first], corners[np.arange(n), (first + 1) % 3]
    share = rng.choice([0, 0.5, 0.25, -1], n, p=[0.4, 0.1, 0.1, 0.4])
    share = np.where(share < 0, rng.random(n), share)[:, None]
    target = a + share * (b - a)
    small = 0.005 if name == "needles" else 0.3
    anywhere = rng.uniform(-small, small, (n, 3)) * (0.7, 0.7, 1)
    origin = np.where(np.arange(n)[:, None] % 2, anywhere, (small / 3, -small / 7, small / 9)).astype(dtype).astype(float)
    hits = rtcore.intersect(Scene(objects=[Mesh(vertices, faces)]), origin, target - origin, precision=precision)
    lost = np.flatnonzero(~np.isfinite(hits.t))
    assert len(lost) == 0, (len(lost), origin[lost[0]].tolist(), target[lost[0]].tolist())
    assert rtcore.occluded(Scene(objects=[Mesh(vertices, faces)]), origin, target - origin, precision=precision).all()
    # near the target, that is: a hit on a far wall would be a leak too
    if name != "needles":
        assert np.abs(hits.t.astype(float) - 1).max() < 1e-3


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_no_ray_gets_through_under_a_transform(precision):
    """A mirrored, sheared, moved mesh, and an eye a thousand sizes away: what is aimed at is the silhouette's inside."""
    vertices, faces = MESHES["ball"]
    m = np.array([[-3, 1, 0, 50], [0.5, 2, 0.3, -20], [0, 0.1, 4, 7], [0, 0, 0, 1.0]])
    scene = Scene(objects=[Node(shape=Mesh(vertices, faces), transform=[Matrix(m.tolist())])])
    rng = np.random.default_rng(8)
    edges = vertices[faces[rng.integers(0, len(faces), 100_000)]]
    target = (0.3 * edges[:, 0] + 0.7 * edges[:, 1]) @ m[:3, :3].T + m[:3, 3]
    inside = rng.uniform(-0.3, 0.3, (100_000, 3)) @ m[:3, :3].T + m[:3, 3]
    assert np.isfinite(rtcore.intersect(scene, inside, target - inside, precision=precision).t).all()
    eye = inside + (inside - target) * 1000
    assert np.isfinite(rtcore.intersect(scene, eye, inside - eye, precision=precision).t).all()
