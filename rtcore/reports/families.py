"""Families of rays that are hard on a kernel: seeded, at random, for any shape, in either precision."""
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from rtcore.api import intersect
from rtcore.fields import FieldError
from rtcore.reports.catalogue import CATALOGUE, Case
from rtcore.reports.making import NEVER_THIN, edges, make
from rtcore.scene import Node, Rotate, Scale, Scene, Shape, Shear, Translate
from rtcore.shapes import Implicit, Mesh, Polygon

PER_SHAPE = 16      # rays before a new shape is thrown


class Batch(NamedTuple):
    """Rays against one placed shape: a record whose numbers are of the precision, its node's transforms, and rays in world space, (n, 3)
    each, of the precision as well. `size` is the shape's in its own space."""

    shape: Shape
    transform: tuple
    origins: np.ndarray
    directions: np.ndarray
    size: float

    @property
    def matrix(self) -> np.ndarray:
        return Node(shape=self.shape, transform=self.transform).matrix()

    @property
    def scene(self) -> Scene:
        return Scene(objects=[Node(shape=self.shape, transform=self.transform)])


class Throw(NamedTuple):
    """What the families throw dice with: the kind of shape, the dice, the type, and the digits it has."""

    shape: type[Shape]
    rng: np.random.Generator
    dtype: type

    @property
    def digits(self) -> float:
        return 7 if self.dtype == np.float32 else 15

    def ways(self, n: int) -> np.ndarray:
        """Directions of length 1, (n, 3)."""
        way = self.rng.normal(size=(n, 3))
        return way / np.linalg.norm(way, axis=1, keepdims=True)

    def power(self, low: float, high: float, n: int) -> np.ndarray:
        """Powers of ten, (n, 1)."""
        return 10 ** self.rng.uniform(low, high, (n, 1))

    def points(self, shape: Shape, size: float, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Points about the surface and normals there, in the shape's own space: where rays from all around hit it, more or less."""
        way = self.ways(8 * n)
        origins, targets = way * 3 * size, self.rng.uniform(-0.7, 0.7, (8 * n, 3)) * size
        hits = intersect(Scene(objects=[shape]), origins, targets - origins, threads=1)
        good = np.flatnonzero(np.isfinite(hits.t) & np.isfinite(hits.normal).all(axis=1))[:n]
        if not len(good):
            return targets[:n], way[:n]
        good = np.resize(good, n)
        return origins[good] + hits.t[good, None] * (targets - origins)[good], hits.normal[good]

    def batch(self, shape: Shape, size: float, origins, directions, transform=()) -> Batch:
        """Rays of the shape's own space, brought to the world and rounded."""
        m = Node(shape=shape, transform=transform).matrix()
        with np.errstate(over="ignore"):
            o = (origins @ m[:3, :3].T + m[:3, 3]).astype(self.dtype)
            d = (directions @ m[:3, :3].T).astype(self.dtype)
        good = np.isfinite(o).all(axis=1) & np.isfinite(d).all(axis=1) & d.any(axis=1)
        return Batch(shape, transform, o[good], d[good], size)


def _seen(throw: Throw, n: int, size=1.0, thin=False, transform=(), far=(0.2, 0.7)) -> Batch:
    """Rays from around the shape at points on it and beside it."""
    shape = make(throw.shape, throw.rng, size, throw.dtype, thin)
    p, _ = throw.points(shape, size, n)
    target = p + throw.ways(n) * size * throw.power(-3, -0.5, n)
    origins = target + throw.ways(n) * size * throw.power(*far, n)
    return throw.batch(shape, size, origins, target - origins, transform)


def _plain(throw, n):
    return _seen(throw, n)


def _far(throw, n):
    return _seen(throw, n, far=(1, 4 if throw.dtype == np.float32 else 8))


def _grazing(throw, n):
    """All but tangent to the surface, within it or without by down to a rounding."""
    shape = make(throw.shape, throw.rng, 1, throw.dtype)
    p, normal = throw.points(shape, 1, n)
    along = np.cross(normal, throw.ways(n))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    p = p + normal * throw.rng.choice([-1, 1], (n, 1)) * throw.power(-throw.digits, -1, n)
    origins = p - along * throw.power(0.3, 2, n)
    return throw.batch(shape, 1, origins, p - origins)


def _tiny(throw, n):
    return _seen(throw, n, size=float(10 ** -throw.rng.uniform(3, 12 if throw.dtype == np.float32 else 30)))


def _huge(throw, n):
    return _seen(throw, n, size=float(10 ** throw.rng.uniform(3, 12 if throw.dtype == np.float32 else 30)))


def _thin(throw, n):
    return _seen(throw, n, thin=True)


def _turn(throw) -> Rotate:
    return Rotate(tuple(throw.ways(1)[0].tolist()), float(throw.rng.uniform(0, 360)))


def _scaled(throw, n):
    """Stretched unevenly by up to 1e4 and squeezed by as much, and turned."""
    return _seen(throw, n, transform=(Scale(tuple(throw.power(-4, 4, 3)[:, 0].tolist())), _turn(throw)))


def _sheared(throw, n):
    """Sheared, mirrored and turned."""
    xy, yz, zx = throw.rng.uniform(-3, 3, 3).tolist()
    return _seen(throw, n, transform=(Shear(xy=xy), Shear(yz=yz), Scale((-1, 1, 1)), Shear(zx=zx), _turn(throw)))


def _nested(throw, n):
    """Moved far away and back through several nodes, scaled on the way."""
    far = throw.rng.uniform(1e6, 1e7, 3).round()
    scale = float(throw.power(-3, 3, 1)[0, 0])
    back = tuple((-far + throw.rng.uniform(-2, 2, 3) * scale).tolist())
    return _seen(throw, n, transform=(Scale((scale,) * 3), _turn(throw), Translate(tuple(far.tolist())), Translate(back)))


def _offset(throw, n):
    """Shape and eye far from the origin, close to one another."""
    far = throw.ways(1)[0] * 10 ** throw.rng.uniform(2, 4 if throw.dtype == np.float32 else 8)
    return _seen(throw, n, transform=(Translate(tuple(np.round(far).tolist())),))


def _surface(throw, n):
    """From points on the surface, as closely as the precision lets them be."""
    shape = make(throw.shape, throw.rng, 1, throw.dtype)
    p, _ = throw.points(shape, 1, n)
    return throw.batch(shape, 1, p, throw.ways(n))


def _edges(throw, n):
    """At edges and vertices, or off them by down to a rounding. Polygons are not aimed at exactly: there the half-open rule decides."""
    shape = make(throw.shape, throw.rng, 1, throw.dtype)
    ends = edges(shape)
    ends = ends[throw.rng.integers(0, len(ends), n)]
    share = throw.rng.choice([0, 1, 0.5, throw.rng.random()], (n, 1))
    target = ends[:, 0] + share * (ends[:, 1] - ends[:, 0])
    off = throw.ways(n) * throw.power(-throw.digits, -2, n)
    target = target + off * (1 if isinstance(shape, Polygon) else throw.rng.integers(0, 2, (n, 1)))
    origins = (target + throw.ways(n) * throw.power(0, 1, n)).astype(throw.dtype).astype(float)
    return throw.batch(shape, 1, origins, target - origins)


def _aligned(throw, n):
    """Rays along axes and diagonals through lattice points, at a shape whose numbers are odd multiples of 1/16: exact ties."""
    def odd(x):
        return (np.floor(x * 8) + 0.5) / 8
    shape = None
    while shape is None:
        try:
            shape = make(throw.shape, throw.rng, 1, throw.dtype).rounded(odd)
        except FieldError:      # two corners fell together
            continue
    origins = throw.rng.integers(-16, 17, (n, 3)) / 16 * throw.rng.choice([1, 1, 2, 64], (n, 1))
    directions = throw.rng.choice([-1, 0, 0, 1], (n, 3)) * throw.rng.choice([1, 1, 0.5, 3], (n, 1))
    directions[~directions.any(axis=1)] = (0, 0, 1)
    return throw.batch(shape, 1, origins, directions)


#: Family -> one batch of n rays of it.
FAMILIES: dict[str, Callable[[Throw, int], Batch]] = {
    "plain": _plain, "far": _far, "grazing": _grazing, "tiny": _tiny, "huge": _huge, "thin": _thin, "scaled": _scaled, "sheared": _sheared,
    "nested": _nested, "offset": _offset, "surface": _surface, "edges": _edges, "aligned": _aligned}


def families(shape: type[Shape]) -> tuple[str, ...]:
    """The families that a shape has, the catalogue of single cases first where there is any of it."""
    sample = make(shape, np.random.default_rng(0), 1, np.float64)
    lacks = {"thin"} if shape in NEVER_THIN else set()
    if edges(sample) is None:
        lacks.add("edges")
    if shape in (Mesh, Polygon, Implicit):      # at a tie the half-open rule decides, or any of the faces; formulas have no numbers
        lacks.add("aligned")
    return (*(("catalogue",) if shape in CATALOGUE else ()), *(name for name in FAMILIES if name not in lacks))


def batches(family: str, shape: type[Shape], dtype, n: int, seed: int, per_shape: int = PER_SHAPE) -> Iterator[Batch]:
    """About n rays of a family in batches, the same ones for the same seed."""
    if family == "catalogue":
        yield from (batch for case in CATALOGUE.get(shape, ()) if (batch := _case(case, dtype)) is not None)
        return
    name = (family, shape.__name__, np.dtype(dtype).name)
    throw = Throw(shape, np.random.default_rng([seed, *"".join(name).encode()]), dtype)
    for start in range(0, n, per_shape):
        yield FAMILIES[family](throw, min(per_shape, n - start))


def _case(case: Case, dtype) -> Batch | None:
    """A case of the catalogue in a precision; None where its numbers are beyond it."""
    with np.errstate(over="ignore"):
        o, d = np.array([case.origin], dtype), np.array([case.direction], dtype)
    if not (np.isfinite(o).all() and np.isfinite(d).all() and d.any()):
        return None
    try:
        return Batch(case.shape.rounded(dtype), case.transform, o, d, case.size)
    except FieldError:
        return None
