"""Shapes: one file each, with the authoring record, the packing into arrays, the kernel and the surface. Listed once, here."""
from rtcore.shapes.box import BOX, Box
from rtcore.shapes.cone import CONE, Cone, Cylinder
from rtcore.shapes.plane import PLANE, Plane
from rtcore.shapes.polygon import POLYGON, Polygon
from rtcore.shapes.sphere import ELLIPSOID, SPHERE, Sphere
from rtcore.shapes.triangle import TRIANGLE, Mesh, Triangle

SHAPES = (Sphere, Plane, Triangle, Mesh, Polygon, Box, Cylinder, Cone)

#: Every kind of primitive that a shape can become.
KINDS = (SPHERE, ELLIPSOID, PLANE, TRIANGLE, POLYGON, BOX, CONE)
