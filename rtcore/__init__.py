"""rtcore: the ray tracer behind Rayscope.

    scene = rtcore.load("scene.yaml")
    image = rtcore.render(scene, size=(640, 480), spp=4)
    hits = rtcore.intersect(scene, origins, directions)
    t = rtcore.crossings(scene, origin, direction)

Shapes, lights and the parts of a scene are records to be made directly: `rtcore.Sphere((0, 0, 0), 1)`.
"""
from importlib import import_module
from typing import Any

#: The module of each name, imported when that is first asked for: exact crossings bring the algebra, a picture numba.
_MODULES = {name: f"rtcore.{module}" for module, names in {
    "algebra.crossings": ("crossings",),
    "api": ("Hits", "Image", "intersect", "occluded", "render"),
    "camera": ("Camera",),
    "fields": ("FieldError",),
    "files": ("FileError", "load", "save"),
    "lights": ("Ambient", "Directional", "Point", "RectangleLight", "SphereLight"),
    "scene": ("Background", "Checker", "Fog", "Material", "Matrix", "Node", "Rotate", "Scale", "Scene", "Shear", "Translate"),
    "shapes": ("Blob", "Box", "Cone", "Cylinder", "Implicit", "Mesh", "Plane", "Polygon", "Polyhedron", "Quadric", "Sphere", "Torus",
               "Triangle"),
}.items() for name in names}

__all__ = sorted(_MODULES)
__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
