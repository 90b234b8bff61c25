"""Makes the snail of the gallery: `python -m resources.snail` writes meshes/snail-shell.ply and meshes/snail-body.ply.

Body and shell are each the zero set of a smooth field, negative inside. The field is sampled on a lattice; every cell that the surface
passes gets a vertex, every edge of the lattice that it crosses a square of four of them (Gibson, *Constrained Elastic Surface Nets*,
1998). Newton steps bring the vertices onto the surface itself, and the field's gradient there gives the normals.
"""
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

MESHES = Path(__file__).parent / "meshes"

Points = np.ndarray         # (..., 3)
Field = Callable[[Points], np.ndarray]      # (..., 3) -> (...)

HEART = np.array([-0.42, 1.10, -0.12])        # where the shell's spiral ends
WIDTH = 0.80        # from there to the middle of the tube at its mouth
GROWTH = 2.2       # of the spiral with each turn
TUBE = 0.47         # radius of the tube, as a share of its distance from the heart: neighbouring turns overlap a little
SPIRE = 0.62        # how far the turns are pushed aside, as a share of what they have shrunk
MOUTH = -0.75       # angle at which the tube begins, in radians
TURNS = 5
RIBS, RIDGE = 30, 0.016     # growth lines in a turn, and their height as a share of the tube's radius

#: The body as rods between two balls: (center, radius) each.
TRUNK = ((((-2.05, 0.08, 0.0), 0.05), ((-1.0, 0.20, 0.0), 0.22)), (((-1.0, 0.20, 0.0), 0.22), ((0.75, 0.24, 0.0), 0.30)),
         (((0.75, 0.24, 0.0), 0.30), ((1.30, 0.50, 0.0), 0.26)), (((1.30, 0.50, 0.0), 0.26), ((1.62, 1.0, 0.0), 0.23)),
         (((0.25, 0.3, -0.05), 0.30), ((0.10, 0.62, -0.1), 0.34)), (((-0.75, 0.22, 0.0), 0.27), ((-0.5, 0.62, 0.0), 0.26)))
FEELERS = ((((1.72, 1.14, 0.10), 0.085), ((2.06, 1.80, 0.34), 0.05)), (((1.72, 1.14, -0.10), 0.085), ((2.10, 1.74, -0.30), 0.05)),
           (((1.84, 0.92, 0.09), 0.06), ((2.13, 0.84, 0.20), 0.04)), (((1.84, 0.92, -0.09), 0.06), ((2.13, 0.84, -0.18), 0.04)))
EYES = ((2.07, 1.82, 0.345), 0.085), ((2.11, 1.76, -0.305), 0.085)


def blend(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    """The lesser of two fields, rounded where they differ by less than `width` (Quilez' polynomial smooth minimum)."""
    h = np.clip(width - np.abs(a - b), 0, None) / width
    return np.minimum(a, b) - h * h * h * width / 6


def rod(p: Points, first, last) -> np.ndarray:
    """About the distance from a rod that goes from one ball (center, radius) to another."""
    (a, r), (b, s) = first, last
    axis = np.subtract(b, a)
    h = np.clip((p - a) @ axis / (axis @ axis), 0, 1)
    return np.linalg.norm(p - a - h[..., None] * axis, axis=-1) - (r + (s - r) * h)


def body(p: Points) -> np.ndarray:
    """The soft parts: a trunk with a foot that widens to the ground and ripples at its hem, a head, four feelers."""
    x, y, z = np.moveaxis(p, -1, 0)
    flat = np.stack([x, y * (1.15 - 0.1 * np.tanh(3 * y)), z / (1 + 0.55 * np.exp(-5 * np.clip(y, 0, None)))], axis=-1)
    f = rod(flat, *TRUNK[0])
    for ends in TRUNK[1:]:
        f = blend(f, rod(flat, *ends), 0.3)
    f = f - 0.012 * np.sin(9 * x) * np.sin(7 * np.abs(z) + 3 * y + x) * np.exp(-((x - 0.2) / 1.6) ** 2)     # wrinkles
    for ends in FEELERS:
        f = blend(f, rod(p, *ends), 0.14)
    for center, radius in EYES:
        f = blend(f, np.linalg.norm(p - center, axis=-1) - radius, 0.05)
    return -blend(-f, y + 0.005 * np.sin(9 * x), 0.12)      # cut off at the ground


def shell(p: Points) -> np.ndarray:
    """A tube along a logarithmic spiral, each turn a smaller copy of the one before and pushed aside, with growth lines across."""
    x, y, z = np.moveaxis(p - HEART, -1, 0)
    off, around = np.hypot(x, y), np.arctan2(y, x)
    f = np.inf
    for turn in range(TURNS):
        angle = around - MOUTH + 2 * np.pi * turn
        clipped = np.clip(angle, 0, None)
        middle = WIDTH * GROWTH ** (-clipped / (2 * np.pi))
        beyond = np.where(angle < 0, -angle, 0) * off       # past the mouth: a round end
        tube = TUBE * middle * (1 + RIDGE * np.cos(RIBS * clipped))
        one = np.sqrt((off - middle) ** 2 + (z - SPIRE * (WIDTH - middle)) ** 2 + beyond ** 2) - tube
        f = blend(f, one, 0.06)
    return f


def gradient(field: Field, p: Points, step: float = 1e-4) -> np.ndarray:
    """The field's gradient (n, 3) at p (n, 3), by central differences."""
    return np.stack([field(p + shift) - field(p - shift) for shift in np.eye(3) * step], axis=-1) / (2 * step)


def surface_net(field: Field, low, high, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The field's zero set within a box as vertices (V, 3), triangles (F, 3) that run counterclockwise seen from outside, and normals
    (V, 3). The surface must not reach the box's sides."""
    low, count = np.array(low), np.ceil(np.subtract(high, low) / step).astype(int) + 1
    lattice = low + step * np.stack(np.meshgrid(*(np.arange(n) for n in count), indexing="ij"), axis=-1)
    value = np.concatenate([field(slab) for slab in np.array_split(lattice, 16)])
    inside = value < 0
    total, crossings = np.zeros((*(count - 1), 3)), np.zeros(count - 1)
    edges = []
    for axis in range(3):
        a, b = (np.moveaxis(np.moveaxis(value, axis, 0)[part], 0, axis) for part in (slice(None, -1), slice(1, None)))
        crossed = np.argwhere((a < 0) != (b < 0))
        share = (a / (a - b + (a == b)))[tuple(crossed.T)]
        at = low + step * (crossed + share[:, None] * np.eye(3)[axis])
        one, two = (axis + 1) % 3, (axis + 2) % 3
        around = []         # the four cells around such an edge, counterclockwise about the axis
        for i, j in ((0, 0), (-1, 0), (-1, -1), (0, -1)):
            cell = crossed.copy()
            cell[:, one] += i
            cell[:, two] += j
            np.add.at(total, tuple(cell.T), at)
            np.add.at(crossings, tuple(cell.T), 1)
            around.append(cell)
        edges.append((around, inside[tuple(crossed.T)]))
    used = crossings > 0
    number = np.full(crossings.shape, -1)
    number[used] = np.arange(used.sum())
    vertices = total[used] / crossings[used][:, None]
    squares = []
    for around, outward in edges:
        square = np.stack([number[tuple(cell.T)] for cell in around], axis=-1)
        squares.append(np.where(outward[:, None], square, square[:, ::-1]))
    squares = np.concatenate(squares)
    for _ in range(6):      # onto the surface, a step no longer than half a cell
        slope = gradient(field, vertices)
        move = field(vertices)[:, None] * slope / (slope ** 2).sum(axis=1, keepdims=True)
        vertices = vertices - move * np.minimum(1, step / 2 / np.maximum(np.linalg.norm(move, axis=1), 1e-300))[:, None]
    normals = gradient(field, vertices)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return vertices, split(squares, vertices), normals


def split(squares: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Squares (S, 4) as triangles (2S, 3), each cut along its shorter diagonal."""
    a, b, c, d = squares.T
    other = np.linalg.norm(vertices[a] - vertices[c], axis=1) > np.linalg.norm(vertices[b] - vertices[d], axis=1)
    first = np.where(other[:, None], np.stack([a, b, d], axis=1), np.stack([a, b, c], axis=1))
    last = np.where(other[:, None], np.stack([b, c, d], axis=1), np.stack([a, c, d], axis=1))
    return np.concatenate([first, last])


def ply(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> bytes:
    """A mesh as a binary PLY file with a normal at each vertex."""
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    head = (f"ply\nformat binary_little_endian 1.0\ncomment made by resources/snail.py\nelement vertex {len(vertices)}\n{names}"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    rows["count"], rows["corners"] = 3, faces
    return head.encode() + np.hstack([vertices, normals]).astype("<f4").tobytes() + rows.tobytes()


#: Name of the file, field, two corners of a box around it, edge of a cell.
PARTS = (("snail-shell", shell, (-1.7, 0.0, -0.8), (0.95, 2.5, 1.2), 0.0265),
         ("snail-body", body, (-2.5, -0.2, -0.8), (2.4, 2.1, 0.8), 0.031))


def main() -> int:
    """Write the files. Returns the exit code."""
    for name, field, low, high, step in PARTS:
        mesh = surface_net(field, low, high, step)
        (MESHES / f"{name}.ply").write_bytes(ply(*mesh))
        print(f"{name}.ply: {len(mesh[1]):,} triangles")
    return 0


if __name__ == "__main__":
    sys.exit(main())
