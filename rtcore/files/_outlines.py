"""Flat outlines as triangles, and normals for corners that have none: what readers of polygons need."""
import numpy as np


def area_normal(corners: np.ndarray) -> np.ndarray:
    """Twice the area of a closed outline (N, 3) as a vector along its normal (Newell)."""
    return np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)


def triangles_of(corners: np.ndarray) -> list[list[int]]:
    """Indices of the triangles that make up a simple flat outline (N, 3), in its winding: a fan where it is convex, else ears
    cut off one by one."""
    n = len(corners)
    normal = area_normal(corners - corners[0])
    edges = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(np.roll(edges, 1, axis=0), edges) @ normal
    if n < 4 or (turns >= 0).all():
        return [[0, i, i + 1] for i in range(1, n - 1)]
    drop = int(np.abs(normal).argmax())
    flat = np.delete(corners, drop, axis=1) * ([1, -1] if drop == 1 else [1, 1]) * ([1, np.sign(normal[drop])])
    left, triangles, tried = list(range(n)), [], 0
    while len(left) > 3 and tried < len(left):
        a, b, c = left[-1], left[0], left[1]
        if _turn(flat, a, b, c) > 0 and not any(_within(flat, a, b, c, p) for p in left[2:-1]):
            triangles.append([a, b, c])
            del left[0]
            tried = 0
        else:
            left.append(left.pop(0))
            tried += 1
    return triangles + [[left[0], left[i], left[i + 1]] for i in range(1, len(left) - 1)]


def _turn(flat: np.ndarray, a: int, b: int, c: int) -> float:
    """Twice the signed area of a triangle in the plane."""
    (ax, ay), (bx, by), (cx, cy) = flat[a], flat[b], flat[c]
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _within(flat: np.ndarray, a: int, b: int, c: int, p: int) -> bool:
    """Whether a point lies in a counter-clockwise triangle or on its edge."""
    return _turn(flat, a, b, p) >= 0 and _turn(flat, b, c, p) >= 0 and _turn(flat, c, a, p) >= 0


def normals_filled(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Normals (V, 3) with the mean normal of the faces around it in place of each that is zero."""
    lost = ~normals.any(axis=1)
    if not lost.any():
        return normals
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    flat = np.cross(b - a, c - a)
    mean = np.zeros_like(normals)
    for i in range(3):
        np.add.at(mean, faces[:, i], flat)
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    mean = np.where(length > 0, mean / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])
    return np.where(lost[:, None], mean, normals)
