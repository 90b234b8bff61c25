"""Every crossing of a line with a shape, a node or a scene, exactly counted and correctly rounded."""
import functools

import numpy as np

from rtcore.algebra import certified, curved, flat
from rtcore.algebra.curved import Crossing, Find
from rtcore.algebra.lines import Place, line_of
from rtcore.algebra.roots import nearest
from rtcore.fields import FieldError
from rtcore.flatten import DTYPES, place as where
from rtcore.scene import Node, Scene, Shape
from rtcore.shapes import Blob, Box, Cone, Cylinder, Implicit, Mesh, Plane, Polygon, Polyhedron, Quadric, Sphere, Torus, Triangle

FINDERS = {
    Sphere: curved.sphere, Plane: flat.plane, Triangle: flat.triangle, Mesh: flat.mesh, Polygon: flat.polygon, Box: flat.box,
    Cylinder: curved.cylinder, Cone: curved.cone, Quadric: curved.quadric, Torus: curved.torus, Polyhedron: flat.polyhedron,
    Blob: curved.blob, Implicit: certified.implicit,
}
DIGITS = {"f64": (53, -1074), "f32": (24, -149)}      # of the precision: binary digits, power of the smallest number


def crossings(shape: Shape | Node | Scene, origin, direction, precision: str = "f64") -> np.ndarray:
    """Every t at which the line origin + t direction crosses a surface, ascending, before the origin too: a 1-D array of the precision's
    type. Of a node or scene, all visible shapes' crossings together; a shape's `sides` are obeyed.

    origin, direction: three numbers each; in "f32" they and the shape's own numbers are first rounded to float32, transforms are not.
    From there all is done in whole numbers (`rtcore.algebra`): how many there are is certain, and each is the float nearest to the truth;
    what is beyond all floats is ± inf. Only a formula's roots come from intervals and are off by a few roundings (`Implicit`).

    A root counts as often as its multiplicity: a tangent twice. A tangent has no facing, so a shape with one visible side does not show
    it. A line that runs in a surface does not cross it there. Of several faces of one shape met at the very same t (an edge, a corner,
    a rim), those that face the same way count once.

    Raises FieldError for arrays of another shape, numbers that are not finite, a direction of 0.
    """
    if precision not in tuple(DTYPES):
        raise FieldError("one of " + ", ".join(DTYPES), precision, "precision")
    dtype = DTYPES[precision]
    o, d = _vector(origin, "origin", dtype), _vector(direction, "direction", dtype)
    if not any(d):
        raise FieldError("a vector that is not zero", d, "direction")
    line, power = line_of(o, d)
    found = [nearest(c.root, power, *DIGITS[precision]) for find, sides in _finders(_Same(shape), dtype)
             for c in _passages(_seen(find(line), sides)) for _ in range(c.times)]
    with np.errstate(over="ignore"):
        return np.array(sorted(found), np.float64).astype(dtype)


def _vector(value, name: str, dtype: type) -> list[float]:
    try:
        result = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise FieldError("three finite numbers", value, name) from None
    with np.errstate(over="ignore"):
        numbers = result.astype(dtype).tolist()
    if result.shape != (3,) or not np.isfinite(numbers).all():
        raise FieldError("three finite numbers", numbers, name)
    return numbers


class _Same:
    """A frozen record as a key that only itself is equal to: whole scenes are not compared."""

    def __init__(self, record):
        self.record = record

    def __eq__(self, other):
        return self.record is other.record

    def __hash__(self):
        return id(self.record)


@functools.lru_cache(maxsize=16)        # a loop over rays prepares its shapes once
def _finders(same: _Same, dtype: type) -> list[tuple[Find, str]]:
    """What finds the crossings of each visible shape, and which sides it shows."""
    record = same.record
    if isinstance(record, Shape):
        return [(_finder(record, np.eye(4), dtype), record.sides)]
    if not isinstance(record, (Node, Scene)):
        raise FieldError("a shape, a node or a scene", record, "shape")
    result = []
    for leaf in (record if isinstance(record, Scene) else Scene(objects=(record,))).leaves():
        if leaf.visible:
            try:
                result.append((_finder(leaf.shape, leaf.matrix, dtype), leaf.shape.sides))
            except FieldError as error:
                raise error.inside(where(leaf)) from None
    return result


def _finder(shape: Shape, matrix: np.ndarray, dtype: type) -> Find:
    if type(shape) not in FINDERS:
        raise FieldError("one of " + ", ".join(sorted(known.__name__ for known in FINDERS)), type(shape).__name__)
    return FINDERS[type(shape)](shape if dtype is np.float64 else shape.rounded(dtype), Place(matrix))


def _seen(found: list[Crossing], sides: str) -> list[Crossing]:
    """Those on a visible side: the front faces against the ray."""
    return found if sides == "both" else [c for c in found if c.facing == (-1 if sides == "front" else 1)]


def _passages(found: list[Crossing]) -> list[Crossing]:
    """Faces of one shape met at the very same t: those that face the same way count once, and a tangent counts for both."""
    kept: list[Crossing] = []
    for c in sorted(found, key=lambda c: -c.times):
        if not any(k.root == c.root and k.facing in (c.facing, 0) for k in kept):
            kept.append(c)
    return kept
