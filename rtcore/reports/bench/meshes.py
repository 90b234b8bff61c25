"""A mesh of some hundred thousand triangles to measure with, and rays to trace through it."""
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rtcore.api import intersect
from rtcore.camera import Camera
from rtcore.framing import framed
from rtcore.lights import Point
from rtcore.scene import Scene
from rtcore.shapes import Mesh, Triangle

MOST = 300_000      # triangles; a mesh is subdivided as long as it stays below
TILE = 8            # pixels a side


class Triangles(NamedTuple):
    """Vertices (V, 3) and faces (F, 3)."""

    vertices: np.ndarray
    faces: np.ndarray

    def scene(self) -> Scene:
        """The mesh alone."""
        return Scene(objects=(Mesh(vertices=self.vertices, faces=self.faces),))

    def subdivided(self) -> "Triangles":
        """Every triangle cut into four at the middles of its edges, which neighbours share."""
        a, b, c = self.faces.T
        ends = np.sort(np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]]), axis=1)
        edges, number = np.unique(ends, axis=0, return_inverse=True)
        ab, bc, ca = (len(self.vertices) + number.reshape(3, -1)).astype(np.int32)
        faces = np.concatenate([np.stack(three, axis=1) for three in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        return Triangles(np.concatenate([self.vertices, self.vertices[edges].mean(axis=1)]), faces)

    def ply(self) -> bytes:
        """As a binary PLY file."""
        head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(self.vertices)}\nproperty float x\nproperty float y\n"
                f"property float z\nelement face {len(self.faces)}\nproperty list uchar int vertex_indices\nend_header\n")
        rows = np.empty(len(self.faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
        rows["count"], rows["corners"] = 3, self.faces
        return head.encode() + self.vertices.astype("<f4").tobytes() + rows.tobytes()


def of_scene(scene: Scene) -> Triangles | None:
    """All triangles of a scene that holds nothing else, subdivided as long as they stay below MOST; else None."""
    vertices, faces, count = [], [], 0
    for leaf in scene.leaves():
        if isinstance(leaf.shape, Mesh):
            points, corners = leaf.shape.vertices, leaf.shape.faces
        elif isinstance(leaf.shape, Triangle):
            points, corners = np.array([leaf.shape.a, leaf.shape.b, leaf.shape.c]), np.array([[0, 1, 2]])
        else:
            return None
        vertices.append(points @ leaf.matrix[:3, :3].T + leaf.matrix[:3, 3])
        faces.append(corners + count)
        count += len(points)
    if not vertices:
        return None
    # numbers that float32 can hold, so that every rival gets the same
    mesh = Triangles(np.concatenate(vertices).astype(np.float32).astype(np.float64), np.concatenate(faces).astype(np.int32))
    while 4 * len(mesh.faces) <= MOST:
        mesh = mesh.subdivided()
    return mesh


def filling(mesh: Triangles) -> Camera:
    """A camera whose square picture the mesh fills, as far as its shape lets it."""
    camera = framed(mesh.scene())
    left, up, ahead = camera.basis() @ (mesh.vertices - camera.lookfrom).T
    return camera.at(fov=2 * math.degrees(math.atan(1.02 * max(np.abs(left / ahead).max(), np.abs(up / ahead).max()))))


def primary(camera: Camera, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (count, 3) float32 of the eye rays of a square picture, tile by tile. count: a power of four."""
    side = round(count ** 0.5)
    eye, corner, right, down = camera.rays(side, side)
    y, x = (grid.reshape(side // TILE, TILE, side // TILE, TILE).swapaxes(1, 2).reshape(-1, 1) + 0.5 for grid in np.indices((side, side)))
    directions = corner + x * right + y * down
    # in rows, as callers have them: numpy keeps the order in which they were made
    return np.tile(eye, (count, 1)).astype(np.float32), directions.astype(np.float32, order="C")


def scattered(mesh: Triangles, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins everywhere in the mesh's box, directions every way: (count, 3) float32 each."""
    random = np.random.default_rng(1)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return random.uniform(low, high, (count, 3)).astype(np.float32), random.normal(size=(count, 3)).astype(np.float32)


def save_rays(path: Path, mesh: Triangles, sets: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    """The file that `embree_process` reads."""
    arrays = {f"{name}_{what}": array for name, pair in sets.items() for what, array in zip(("origins", "directions"), pair)}
    np.savez(path, triangles=mesh.vertices[mesh.faces].astype(np.float32), **arrays)


def differing(scene: Scene, origins: np.ndarray, directions: np.ndarray, theirs: np.ndarray) -> float:
    """Share of the rays that Embree, whose distances these are, and we in float32 answer differently: hit or miss, or more than 1e-3."""
    ours = intersect(scene, origins, directions, precision="f32").t
    hit = np.isfinite(ours)
    theirs = np.where(theirs < 1e30, theirs, np.inf)
    same = np.isclose(np.where(hit, ours, 0), np.where(np.isfinite(theirs), theirs, 0), rtol=1e-3, atol=0) & (hit == np.isfinite(theirs))
    return float(1 - same.mean())


def lamp(camera: Camera) -> Point:
    """A light that shines past the eye's right shoulder."""
    left, up, _ = camera.basis()
    return Point(position=camera.lookfrom + camera.distance() * (0.6 * up - 0.5 * left), intensity=2 * camera.distance() ** 2)
