"""Shapes: one file each, with the authoring record, the packing into arrays, the kernel and the surface. Listed once, here, and imported
when first asked for: to read the modules of all of them takes half as long as numba."""
from importlib import import_module
from typing import Any, NamedTuple

from rtcore.scene import Shape
from rtcore.shapes.kind import Kind


class Listed(NamedTuple):
    """What a module has: shapes, by the names of their records, and kinds of primitives, by the names that they have."""

    shapes: tuple[str, ...]
    kinds: tuple[str, ...]


MODULES = {
    "sphere": Listed(("Sphere",), ("sphere", "ellipsoid")),
    "plane": Listed(("Plane",), ("plane",)),
    "triangle": Listed(("Triangle", "Mesh"), ("triangle",)),
    "polygon": Listed(("Polygon",), ("polygon",)),
    "box": Listed(("Box",), ("box",)),
    "cone": Listed(("Cylinder", "Cone"), ("cone",)),
    "quadric": Listed(("Quadric",), ("quadric", "open-quadric")),
    "torus": Listed(("Torus",), ("torus",)),
    "polyhedron": Listed(("Polyhedron",), ("polyhedron", "open-polyhedron")),
    "blob": Listed(("Blob",), ("blob",)),
    "implicit": Listed(("Implicit",), ("implicit",)),
}

#: The module of every shape, and of every kind of primitive that a shape can become.
SHAPE_MODULES = {name: f"rtcore.shapes.{module}" for module, listed in MODULES.items() for name in listed.shapes}
KIND_MODULES = {name: f"rtcore.shapes.{module}" for module, listed in MODULES.items() for name in listed.kinds}

#: Kinds that have a kernel after the textbook as well, in `rtcore.shapes._textbook`.
TEXTBOOK = ("sphere", "ellipsoid")

__all__ = ["KINDS", "KIND_MODULES", "MODULES", "SHAPES", "SHAPE_MODULES", "TEXTBOOK", "kind_named", "shape_named", *SHAPE_MODULES]


def shape_named(name: str) -> type[Shape]:
    """The record of a shape, such as "Sphere"."""
    return getattr(import_module(SHAPE_MODULES[name]), name)


def kind_named(name: str) -> Kind:
    """A kind of primitive, such as "open-quadric"; its module calls it OPEN_QUADRIC."""
    return getattr(import_module(KIND_MODULES[name]), name.upper().replace("-", "_"))


def __getattr__(name: str) -> Any:
    """A shape's record, or all SHAPES and KINDS, which imports them all."""
    if name in SHAPE_MODULES:
        value = shape_named(name)
    elif name == "SHAPES":
        value = tuple(map(shape_named, SHAPE_MODULES))
    elif name == "KINDS":
        value = tuple(map(kind_named, KIND_MODULES))
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
