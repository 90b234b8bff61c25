"""Shapes: one file each, with the authoring record, the packing into arrays, the kernel and the surface. Listed once, here."""
from rtcore.shapes.box import Box
from rtcore.shapes.cone import Cone, Cylinder
from rtcore.shapes.plane import Plane
from rtcore.shapes.polygon import Polygon
from rtcore.shapes.sphere import Sphere
from rtcore.shapes.triangle import Mesh, Triangle

SHAPES = (Sphere, Plane, Triangle, Mesh, Polygon, Box, Cylinder, Cone)
