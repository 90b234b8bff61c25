"""Closed meshes for rays at shared edges and vertices."""
import numpy as np


def ball(parts: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """An octahedron cut finer, pushed out to a bumpy sphere: vertices (v, 3) and faces (f, 3)."""
    vertices = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float)
    faces = np.array([(a, b, c) for a in (0, 1) for b in (2, 3) for c in (4, 5)])
    for _ in range(parts):
        sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        sides, which = np.unique(sides, axis=0, return_inverse=True)
        p, q, r = (which.reshape(-1, 3) + len(vertices)).T
        middle = vertices[sides].sum(axis=1)
        vertices = np.concatenate([vertices, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        a, b, c = faces.T
        faces = np.concatenate([np.stack(part, axis=1) for part in ((a, p, r), (p, b, q), (r, q, c), (p, q, r))])
    return vertices * (1 + 0.1 * np.sin(7 * vertices[:, :1]) * np.cos(5 * vertices[:, 1:2])), faces


def fan(parts: int = 1000) -> tuple[np.ndarray, np.ndarray]:
    """A double cone of that many triangles about each of its two apexes."""
    angle = np.arange(parts) / parts * 2 * np.pi
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    i, j = np.arange(parts), (np.arange(parts) + 1) % parts
    faces = [np.stack([i, j, np.full(parts, parts + k)], axis=1) for k in (0, 1)]
    return np.concatenate([rim, [(0, 0, 0.8), (0, 0, -0.8)]]), np.concatenate(faces)


def tube(parts: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """A closed tube of needles, a thousand times as long as they are wide."""
    vertices, _ = fan(parts)
    ring = vertices[:parts] * 0.01
    i, j = np.arange(parts), (np.arange(parts) + 1) % parts
    faces = [(i, j, i + parts), (j, j + parts, i + parts), (j, i, 0 * i + 2 * parts), (i + parts, j + parts, 0 * i + 2 * parts + 1)]
    return np.concatenate([ring - (0, 0, 1), ring + (0, 0, 1), [(0, 0, -1), (0, 0, 1)]]), np.concatenate([np.stack(f, 1) for f in faces])


def lattice(n: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """A cube of n x n squares a side, cut along their diagonals: edges parallel to the axes."""
    i = np.arange(n)
    k = (i[:, None] * (n + 1) + i).ravel()
    side = np.concatenate([np.stack([k, k + n + 1, k + 1], axis=1), np.stack([k + 1, k + n + 1, k + n + 2], axis=1)])
    u, v = (g.ravel() / n * 2 - 1 for g in np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij"))
    vertices, faces = [], []
    for axis in range(3):
        for end in (-1.0, 1.0):
            square = np.empty((len(u), 3))
            square[:, axis], square[:, (axis + 1) % 3], square[:, (axis + 2) % 3] = end, u, v
            faces.append(side + len(vertices) * len(u))
            vertices.append(square)
    return np.concatenate(vertices), np.concatenate(faces)


#: Name -> the mesh, how far from the middle an eye may be and still be inside, and its share of the rays.
MESHES = {"ball": (ball(), 0.3, 0.4), "lattice": (lattice(), 0.3, 0.4), "tube": (tube(), 0.005, 0.18), "fan": (fan(), 0.3, 0.02)}
