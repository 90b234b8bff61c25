"""Single rays on which naive kernels fail, by shape: reports from the wild and textbook traps. What is true the oracle says."""
from typing import NamedTuple

from rtcore.scene import Rotate, Scale, Shape, Shear, Translate
from rtcore.shapes import Blob, Box, Cone, Cylinder, Implicit, Plane, Polygon, Polyhedron, Quadric, Sphere, Torus, Triangle

X, Y, UP, DOWN = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)
ORIGIN = (0, 0, 0)
BALL, RING = Sphere(ORIGIN, 1), Torus(1, 0.25)
TALL = Scale((1e-4, 1, 1e4))
FAR = (Translate((1e7, 0, 0)), Translate((-1e7 + 1, 2, 0)))
CUBE = Polyhedron(tuple((tuple(s * x for x in axis), tuple(s * x for x in axis)) for axis in (X, Y, UP) for s in (1, -1)))


class Case(NamedTuple):
    """A ray at a placed shape of about this size."""

    shape: Shape
    origin: tuple
    direction: tuple
    transform: tuple = ()
    size: float = 1


def _sphere():
    for z in (-4100, -1e8):
        yield Case(BALL, (0, 0.5, z), UP)
    yield Case(Sphere(ORIGIN, 1e6), (0, 0, 1e6 + 2.0 ** -10), DOWN, size=1e6)
    for y in (1 - 2.0 ** -53, 1 - 2.0 ** -24, 1, 1 + 2.0 ** -23, 1 + 2.0 ** -52):
        yield Case(BALL, (0, y, -5), UP)
    yield Case(BALL, X, Y)
    yield Case(BALL, ORIGIN, UP)
    for d in (UP, DOWN):
        yield Case(BALL, UP, d)
    yield Case(Sphere(ORIGIN, 1e20), (0, 0, -3e20), UP, size=1e20)
    yield Case(Sphere(ORIGIN, 1e200), (0, 0, -3e200), UP, size=1e200)
    for speed in (1e-23, 1e20, 1e-200, 1e200):
        yield Case(BALL, (0, 0, -5), (0, 0, speed))
    yield Case(Sphere((8e5, 0, 0), 3e4), (8e5, 33200, 0), (0.3, -1, 0.2), size=3e4)
    yield Case(BALL, (0.5e-4, 0.25, -3e4), UP, (TALL,))
    yield Case(BALL, (-1, 0.25, 100), X, (TALL,))
    yield Case(BALL, (0.3, 3, 0.2), (0, -1, 0), (Scale((-1, 2, 3)), Rotate((1, 1, 0), 30)))
    yield Case(BALL, (1, 2, -3), (-0.1, -0.1, 1), FAR)
    yield Case(BALL, (1e7, 2e7, -5), UP, (Translate((1e7, 2e7, 0)),))


def _plane():
    for o, d in ((ORIGIN, X), (UP, X), (UP, (1, 0, -1e-30)), (UP, (1, 0, -1e-300)), (UP, DOWN)):
        yield Case(Plane(ORIGIN, UP), o, d)
    yield Case(Plane((0, 0, 1e7), (1e-3, 2e-3, 1)), (3, 4, 0), UP)
    yield Case(Plane(ORIGIN, (1, 1, 1)), (1e8, -1e8, 1), (1, 1, 1.5))


def _triangle():
    needle = Triangle(ORIGIN, X, (0.5, 1e-7, 0))
    yield Case(needle, (0.5, 5e-8, 1), DOWN)
    for size in (1e-15, 1e-25, 1e-170):
        yield Case(Triangle(ORIGIN, (size, 0, 0), (0, size, 0)), (0.2 * size, 0.2 * size, 1), DOWN, size=size)
    yield Case(Triangle(ORIGIN, X, Y), (-1, 0.25, 0), X)
    for o in ((0, 0, 1), (0.5, 0.5, 1), (0, 0.5, 1)):
        yield Case(Triangle(ORIGIN, X, Y), o, DOWN)


def _polygon():
    comb = Polygon((ORIGIN, (4, 0, 0), (4, 3, 0), (3, 1, 0), (2, 3, 0), (1, 1, 0), (0, 3, 0)))
    for x in (0.25, 1.5, 2.5, 3.75):
        for y in (3, 2, 1, 0.5):        # level with vertices, not through them
            yield Case(comb, (x, y, 1), DOWN, size=4)
    yield Case(comb, (-1, 0.25, 0), X, size=4)
    yield Case(Polygon((X, Y, UP)), (2, 2.1, 2.2), (-1, -1, -1))


def _box():
    block = Box((-1, -1, -1), (1, 1, 1))
    yield Case(block, (0.5, 0.5, -5), (-0.0, -0.0, 1))
    yield Case(block, (0, 0, -1), UP)
    yield Case(block, (0.25, 0.5, 0), UP)
    for x in (1, 1 + 2.0 ** -52, 1 + 2.0 ** -23):
        yield Case(block, (x, 0, -5), UP)
    yield Case(block, (1, 1, -5), UP)
    yield Case(block, (0.3, 5, 0.2), (0.1, -1, 0), (Shear(xy=0.5, zx=-0.25), Rotate((1, 2, 3), 40)))
    yield Case(block, (1, 2, -3), (-0.1, -0.1, 1), FAR)


def _cylinder():
    for capped in (True, False):
        can = Cylinder(ORIGIN, UP, 1, capped=capped)
        for x in (0.5, 1, 1.001):
            yield Case(can, (x, 0, 5), DOWN)
    for x in (-4100, -1e8):
        yield Case(Cylinder((0, 0, -1), UP, 1), (x, 0.25, 0.1), X)


def _cone():
    hat = Cone(ORIGIN, 1, UP)
    yield Case(hat, (0, 0, 5), DOWN)
    yield Case(hat, (-5, 0, 1), X)
    for o, d in (((2, 0, -1), (-1, 0, 1)), (X, (-1, 0, 1)), ((-1, 0, 2), (1, 0, -1))):
        yield Case(Cone(ORIGIN, 1, UP, capped=False), o, d)
    for x in (-4100, -1e8):
        yield Case(Cone((0, 0, -1), 1, UP), (x, 0.25, 0), X)


def _quadric():
    # along z = 0, from x = 0 in the direction of x: a quadratic without a discriminant in float64
    yield Case(Quadric((94906265.625, 0, 0, 0, 0, 0, -189812534, 0, 0, 94906268.375)), ORIGIN, X)
    yield Case(Quadric((1, 1, 0, 0, 0, 0, 0, 0, -1, 0)), (0.5, 0, 5), DOWN)
    for z in (-4100, -1e8):
        yield Case(Quadric((1, 1, 1, 0, 0, 0, 0, 0, 0, -1)), (0, 0.5, z), UP)
    yield Case(Quadric((1, 1, 1, 0, 0, 0, 0, 0, 0, -1)), (0, 1 - 2.0 ** -53, -5), UP)
    yield Case(Quadric((1, 1, 1, 0, 0, 0, 0, 0, 0, -1)), (0, 1, -5), UP)
    yield Case(Quadric((1, 1, -1, 0, 0, 0, 0, 0, 0, 0)), (0.5, 0, 5), DOWN)
    yield Case(Quadric((1, 1, -1, 0, 0, 0, 0, 0, 0, 0)), (2, 0, 0), (-1, 0, 1))
    yield Case(Quadric((1, -1, 0, 0, 0, 0, 0, 0, 0, 0)), (3, 1, 0), (-1, 0, 0))
    yield Case(Quadric((1, 1, 1, 0, 0, 0, 0, 0, 0, -1)), (0.5e-4, 0.25, -3e4), UP, (TALL,))


def _torus():
    yield Case(RING, (0, 0, -5), UP)
    yield Case(RING, (-5, 0, 0), X)
    yield Case(RING, (1, -5, 0.25), Y)
    yield Case(RING, (-5, 0.75, 0), X)
    yield Case(RING, (-1e4, 0.1, 0.05), X)
    yield Case(Torus(1, 1e-6), (-3, 0.1, 5e-7), X)
    yield Case(Torus(1, 1), (0, 0, -5), UP)
    for distance in (300, 900):
        yield Case(Torus(143, 113.2), (-distance, 20, 30), (1, -0.05, -0.03), size=256)
    yield Case(RING, (1.25, 0, 0), X)
    yield Case(RING, (1.25, 0, 0), (-1, 0, 0))


def _polyhedron():
    for o, d in (((-5, 1, 1), X), ((-5, 1, 0), X), ((-5, -5, 0), (1, 1, 0)), ((0, 0, 0), (1, 1, 1)), ((0, 0, -1), UP), ((-5, 0.5, 0.5), X)):
        yield Case(CUBE, o, d)


def _blob():
    yield Case(Blob(((ORIGIN, 1, 1),), 0.6), (-5, 0, 0), X)
    pair = Blob((((-0.75, 0, 0), 1, 1), ((0.75, 0, 0), 1, 1)), 0.3828125)
    yield Case(pair, (0, -5, 0), Y)
    yield Case(pair, (0, -5e-3, 0), Y, (Scale((1e-3,) * 3),))
    yield Case(Blob(((ORIGIN, 1, 1),), 0.6), (-5e-3, 0, 0), X, (Scale((1e-3,) * 3),))
    yield Case(Blob(((ORIGIN, 1, 1),), 1.0), (-5, 0, 0), X)


def _implicit():
    def within(text):
        return Implicit(text, (-2, -2, -2), (2, 2, 2))
    ball = "x^2+y^2+z^2-1"
    yield Case(within(f"({ball})^2"), (0, 0, -3), UP)
    yield Case(within("1/x"), (-1, 0, 0), X)
    for factor in ("10^300", "10^-300", "1"):
        yield Case(within(f"{factor}*({ball})"), (0, 0.5, -5), UP)
    # tanh(1e6 (z - 0.3))
    yield Case(within("1-2/(exp(2e6*(z-0.3))+1)"), (0, 0, -1), UP)
    yield Case(within("sqrt(x)-0.5"), (-1, 0, 0), X)
    yield Case(within("sqrt(x)+0.5"), (-1, 0, 0), X)
    yield Case(within(ball), (0, 1, -5), UP)
    yield Case(within(ball), (0, 0.5, -1e8), UP)
    yield Case(within(ball), (0.5e-4, 0.25, -3e4), UP, (TALL,))


CATALOGUE: dict[type[Shape], tuple[Case, ...]] = {
    Sphere: tuple(_sphere()), Plane: tuple(_plane()), Triangle: tuple(_triangle()), Polygon: tuple(_polygon()), Box: tuple(_box()),
    Cylinder: tuple(_cylinder()), Cone: tuple(_cone()), Quadric: tuple(_quadric()), Torus: tuple(_torus()),
    Polyhedron: tuple(_polyhedron()), Blob: tuple(_blob()), Implicit: tuple(_implicit())}
