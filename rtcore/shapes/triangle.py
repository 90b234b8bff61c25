"""Triangle and Mesh: authoring records."""
from typing import Annotated

import numpy as np

from rtcore.fields import Field, FieldError, Maybe, Text, Vec, Vector, Vectors
from rtcore.scene import Shape


class Triangle(Shape, frozen=True):
    """Three corners; with `normals`, one a corner, it is shaded as if curved."""

    a: Annotated[Vec, Vector(help="first corner", unit="scene units")]
    b: Annotated[Vec, Vector(help="second corner; counter-clockwise seen from the front", unit="scene units")]
    c: Annotated[Vec, Vector(help="third corner", unit="scene units")]
    normals: Annotated[tuple[Vec, Vec, Vec] | None, Maybe(inner=Vectors(least=3), help="normals at the corners")] = None

    def check(self):
        if self.normals is not None and len(self.normals) != 3:
            raise FieldError("three normals", self.normals, "normals")


class Array(Field):
    """A read-only array with three columns: float64, or int32 for faces."""

    def __init__(self, dtype, **words):
        super().__init__(**words)
        object.__setattr__(self, "dtype", dtype)

    def take(self, value):
        integer = np.issubdtype(self.dtype, np.integer)
        expected = "a list of " + ("faces, three vertex indices each" if integer else "points, three finite numbers each")
        try:
            array = np.asarray(value)
            if array.size == 0:
                array = np.zeros((0, 3), self.dtype)
            if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in ("iu" if integer else "iuf"):
                raise TypeError
        except (TypeError, ValueError):
            raise FieldError(expected, value) from None
        bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
        if len(bad):
            raise FieldError("three finite numbers", array[bad[0]].tolist(), f"[{bad[0]}]")
        if integer and (array.max(initial=0) > 2**31 - 1 or array.min(initial=0) < 0):
            raise FieldError(expected, value)
        array = np.ascontiguousarray(array, dtype=self.dtype)
        if array is value and array.flags.writeable or array.base is not None:
            array = array.copy()
        array.flags.writeable = False
        return array


class Mesh(Shape, frozen=True, eq=False):
    """Triangles over shared vertices; with `normals`, one a vertex, they are shaded as if curved.

    vertices (V, 3), faces (F, 3) indices from 0, normals (V, 3) or None. A mesh that came from a file remembers it in
    `file`, so that a saved scene can name it instead of writing every number out.
    """

    vertices: Annotated[np.ndarray, Array(np.float64, help="points", unit="scene units")]
    faces: Annotated[np.ndarray, Array(np.int32, help="three vertex indices each, from 0")]
    normals: Annotated[np.ndarray | None, Maybe(inner=Array(np.float64), help="normals at the vertices")] = None
    file: Annotated[str, Text(help="the mesh file these came from")] = ""

    def check(self):
        if len(self.faces) == 0:
            raise FieldError("at least one face", 0, "faces")
        over = np.flatnonzero((self.faces >= len(self.vertices)).any(axis=1))
        if len(over):
            raise FieldError(f"indices less than the number of vertices, {len(self.vertices)}", self.faces[over[0]].tolist(), f"faces[{over[0]}]")
        if self.normals is not None and len(self.normals) != len(self.vertices):
            raise FieldError(f"as many normals as vertices, {len(self.vertices)}", len(self.normals), "normals")

    def __eq__(self, other):
        return (isinstance(other, Mesh) and self.sides == other.sides and self.file == other.file
                and np.array_equal(self.vertices, other.vertices) and np.array_equal(self.faces, other.faces)
                and (self.normals is other.normals or (self.normals is not None and other.normals is not None and np.array_equal(self.normals, other.normals))))

    def __hash__(self):
        return id(self)
