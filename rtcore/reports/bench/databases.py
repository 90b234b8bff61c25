"""Scenes of any size to measure with, made by recursion: a sphereflake, a tetrahedron, a mountain and a tree, as the text of NFF files.

They are of the kinds that Haines' Standard Procedural Databases made a custom (*A Proposal for Standard Graphics Environments*, 1987), by
rules of our own. All are made level by level, the elements of a level as rows of arrays.
"""
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

HEAD = "b {background}\nv\nfrom {eye}\nat {at}\nup 0 0 1\nangle {angle}\nhither 0.01\nresolution 512 512\n"
GREY, MIRROR = "f 0.8 0.75 0.7 0.9 0 100 0 1", "f 0.95 0.85 0.6 0.5 0.5 4 0 1"
GLASS, STONE, BARK, LEAF, GRASS = ("f 1 1 1 0.1 0.1 100 0.9 1.5", "f 0.55 0.5 0.4 1 0 100 0 1", "f 0.5 0.35 0.2 1 0 100 0 1",
                                   "f 0.25 0.6 0.2 1 0 100 0 1", "f 0.3 0.55 0.25 1 0 100 0 1")


class Database(NamedTuple):
    """A scene by recursion: `make(levels)` gives its text."""

    name: str
    make: Callable[[int], str]
    levels: int         # for some 8,000 primitives


def sphereflake(levels: int) -> str:
    """Mirroring spheres, each with nine of a third of its size upon it, and a floor: (9^levels - 1) / 8 + 1 primitives."""
    centers, axes, radius, lines = np.zeros((1, 3)), np.array([[0.0, 0, 1]]), 0.5, []
    around = [(np.radians(60 * k), 0.0) for k in range(6)] + [(np.radians(30 + 120 * k), np.radians(55)) for k in range(3)]
    for _ in range(levels):
        lines += _rows("s", np.column_stack([centers, np.full(len(centers), radius)]))
        side, other = across(axes)
        buds = [np.cos(up) * (np.cos(turn) * side + np.sin(turn) * other) + np.sin(up) * axes for turn, up in around]
        centers = np.concatenate([centers + radius * (4 / 3) * bud for bud in buds])
        axes, radius = np.concatenate(buds), radius / 3
    lights = (4, 3, 2), (1, -4, 4), (-3, 1, 5)
    return _text(((2.1, 1.3, 1.7), (0, 0, 0), 45), lights, [GREY, _floor(12, -0.5), MIRROR, *lines])


def tetrahedron(levels: int) -> str:
    """Sierpinski's tetrahedron: 4^levels triangles."""
    corners = np.array([[[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]])
    for _ in range(levels - 1):
        corners = np.concatenate([(corners + corners[:, k:k + 1]) / 2 for k in range(4)])
    faces = corners[:, [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]].reshape(-1, 9)
    return _text(((3.4, 1.3, 1.9), (0.1, 0, 0), 42), [(9, -4, 12)], ["f 0.9 0.3 0.2 1 0 100 0 1", *_polygons(faces)])


def mountain(levels: int) -> str:
    """A rough mountain of 2·4^levels triangles, and four glass balls over it."""
    points, faces = ground(heights(levels))
    balls = np.array([[-0.7, 0.7, 1.15, 0.18], [-0.5, 0.75, 0.9, 0.18], [-0.75, 0.5, 0.9, 0.18], [-0.9, 0.9, 0.9, 0.18]])
    triangles = points[faces].reshape(-1, 9)
    return _text(((-1.6, 1.6, 1.7), (0, 0, 0), 45), [(-100, -100, 100)], [GLASS, *_rows("s", balls), STONE, *_polygons(triangles)])


def tree(levels: int) -> str:
    """A tree whose every branch ends in a ball and forks in two: 2·(2^levels - 1) primitives, and the ground."""
    start, way, length, radius, lines = np.zeros((1, 3)), np.array([[0.0, 0, 1]]), 1.0, 0.14, [GRASS, _floor(50, 0.0), BARK]
    for level in range(levels):
        end, thin = start + length * way, 0.67 * radius
        if level == levels - 2:
            lines.append(LEAF)
        lines += _rows("c", np.column_stack([start, np.full(len(start), radius), end, np.full(len(start), thin)]))
        lines += _rows("s", np.column_stack([end, np.full(len(start), thin)]))
        side, other = across(way)
        turned = np.cos(2.4 * level) * side + np.sin(2.4 * level) * other        # the golden angle from fork to fork
        start = np.concatenate([end, end])
        way = np.concatenate([np.cos(0.5) * way + np.sin(0.5) * turned, np.cos(0.75) * way - np.sin(0.75) * turned])
        length, radius = 0.72 * length, thin
    lights = (-5, 5, 50), (30, -30, 30), (-40, -30, 20), (10, 30, 40), (-30, 40, 10), (50, 25, 20), (-10, -60, 30)
    return _text(((5.2, 0.6, 1.8), (0, 0, 1.35), 42), lights, lines)


DATABASES = (Database("balls", sphereflake, 5), Database("tree", tree, 12), Database("mount", mountain, 6),
             Database("tetra", tetrahedron, 6))


def heights(levels: int, roughness: float = 0.55, seed: int = 7) -> np.ndarray:
    """A square of 2^levels + 1 heights a side, by diamonds and squares (Fournier, Fussell, Carpenter 1982)."""
    n, random, swing = 1 << levels, np.random.default_rng(seed), 0.35
    height = np.zeros((n + 1, n + 1))
    step = n
    while step > 1:
        half = step // 2
        corners = height[::step, ::step]
        middle = (corners[1:, 1:] + corners[:-1, 1:] + corners[1:, :-1] + corners[:-1, :-1]) / 4
        height[half::step, half::step] = middle + swing * random.uniform(-1, 1, middle.shape)
        for first, second in ((0, half), (half, 0)):        # the middles of edges, from their two ends
            ends = height[first::step, ::step] if first == 0 else height[::step, ::step]
            mean = (ends[:, 1:] + ends[:, :-1]) / 2 if first == 0 else (ends[1:] + ends[:-1]) / 2
            height[first::step, second::step] = mean + swing * random.uniform(-1, 1, mean.shape)
        swing, step = swing * roughness, half
    return height


def ground(height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights over -1 .. 1 as vertices (V, 3) and triangles (F, 3), whose fronts are up."""
    rows, columns = height.shape
    y, x = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    return np.stack([x, y, height], axis=-1).reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([c, d, a], 1)])


def across(axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors each at right angles to unit vectors (n, 3) and to one another."""
    aside = np.eye(3)[np.abs(axes).argmin(axis=1)]
    side = np.cross(axes, aside)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return side, np.cross(axes, side)


# --- text ---

def _text(view: tuple, lights: Iterable[tuple], body: list[str]) -> str:
    eye, at, angle = view
    head = HEAD.format(background="0.08 0.36 0.75", eye=_words(eye), at=_words(at), angle=angle)
    return head + "".join(f"l {_words(light)}\n" for light in lights) + "\n".join(body) + "\n"


def _words(numbers: Iterable[float]) -> str:
    return " ".join(f"{x:.7g}" for x in numbers)


def _rows(word: str, numbers: np.ndarray) -> list[str]:
    return [f"{word} {_words(row)}" for row in numbers.tolist()]


def _polygons(triangles: np.ndarray) -> list[str]:
    return _rows("p 3", triangles)


def _floor(half: float, height: float) -> str:
    return f"p 4 {_words((half, half, height, -half, half, height, -half, -half, height, half, -half, height))}"
