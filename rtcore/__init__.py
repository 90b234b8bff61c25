"""rtcore: the ray tracer behind Rayscope.

    scene = rtcore.load("scene.yaml")
    image = rtcore.render(scene, size=(640, 480), spp=4)
    hits = rtcore.intersect(scene, origins, directions)
    t = rtcore.crossings(scene, origin, direction)

Shapes, lights and the parts of a scene are records to be made directly: `rtcore.Sphere((0, 0, 0), 1)`.
"""
from rtcore.api import Hits, Image, intersect, occluded, render
from rtcore.camera import Camera
from rtcore.fields import FieldError
from rtcore.files import FileError, load, save
from rtcore.lights import Ambient, Directional, Point, RectangleLight, SphereLight
from rtcore.scene import (Background, Checker, Fog, Material, Matrix, Node, Rotate, Scale, Scene, Shear, Translate)
from rtcore.shapes import Blob, Box, Cone, Cylinder, Implicit, Mesh, Plane, Polygon, Polyhedron, Quadric, Sphere, Torus, Triangle

__all__ = ["Ambient", "Background", "Blob", "Box", "Camera", "Checker", "Cone", "Cylinder", "Directional", "FieldError", "FileError",
           "Fog", "Hits", "Image", "Implicit", "Material", "Matrix", "Mesh", "Node", "Plane", "Point", "Polygon", "Polyhedron", "Quadric",
           "RectangleLight", "Rotate", "Scale", "Scene", "Shear", "Sphere", "SphereLight", "Torus", "Translate", "Triangle", "crossings",
           "intersect", "load", "occluded", "render", "save"]
__version__ = "0.1.0"


def __getattr__(name: str):
    """What most programs never call is imported when it is first asked for: exact crossings bring the algebra with them."""
    if name == "crossings":
        from rtcore.algebra.crossings import crossings
        globals()[name] = crossings
        return crossings
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
