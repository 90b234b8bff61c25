"""Shapes: one file each, with the authoring record, the packing into arrays, the kernel and the surface. Listed once, here."""
from rtcore.shapes.blob import BLOB, Blob
from rtcore.shapes.box import BOX, Box
from rtcore.shapes.cone import CONE, Cone, Cylinder
from rtcore.shapes.implicit import IMPLICIT, Implicit
from rtcore.shapes.plane import PLANE, Plane
from rtcore.shapes.polygon import POLYGON, Polygon
from rtcore.shapes.polyhedron import OPEN_POLYHEDRON, POLYHEDRON, Polyhedron
from rtcore.shapes.quadric import OPEN_QUADRIC, QUADRIC, Quadric
from rtcore.shapes.sphere import ELLIPSOID, SPHERE, Sphere
from rtcore.shapes.torus import TORUS, Torus
from rtcore.shapes.triangle import TRIANGLE, Mesh, Triangle

SHAPES = (Sphere, Plane, Triangle, Mesh, Polygon, Box, Cylinder, Cone, Quadric, Torus, Polyhedron, Blob, Implicit)

#: Every kind of primitive that a shape can become.
KINDS = (SPHERE, ELLIPSOID, PLANE, TRIANGLE, POLYGON, BOX, CONE, QUADRIC, OPEN_QUADRIC, TORUS, POLYHEDRON, OPEN_POLYHEDRON, BLOB,
         IMPLICIT)
