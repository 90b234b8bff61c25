"""The condition number of a root: by how much t moves when the inputs do.

t is a root of F(L(o + t d); s), F the surface's implicit function with its numbers s and L the inverse of the node's matrix. The inputs are
x = (o, d, s), the matrix is taken as exact. By the theorem on implicit functions ∂t/∂x = -F_x / F_t, and

    condition = Σ |x_j · F_x_j| / |t · F_t|,

the greatest relative change of t, to first order, over changes of every input by as much as a relative u, divided by u. It is infinite
at a tangent. F_x and F_t are central differences in 50 digits, good for 30.
"""
from rtcore.reports import formulas
from rtcore.reports.oracle import add, cross, dot, inverse, mp, sub, times, vector
from rtcore.shapes import Blob, Box, Cone, Cylinder, Implicit, Mesh, Plane, Polygon, Polyhedron, Quadric, Sphere, Torus, Triangle

STEP = mp.mpf(10) ** -15


def _sphere(s, p):
    yield dot(sub(p, s[:3]), sub(p, s[:3])) - s[3] ** 2


def _plane(s, p):
    yield dot(sub(p, s[:3]), s[3:6])


def _corners(s, p):
    """The plane of each three corners."""
    for k in range(0, len(s), 9):
        a, b, c = s[k:k + 3], s[k + 3:k + 6], s[k + 6:k + 9]
        yield dot(sub(p, a), cross(sub(b, a), sub(c, a)))


def _polygon(s, p):
    points = [s[k:k + 3] for k in range(0, len(s), 3)]
    n = (mp.mpf(0),) * 3
    for a, b in zip(points, points[1:] + points[:1]):
        n = add(n, cross(sub(a, points[0]), sub(b, points[0])))
    yield dot(sub(p, points[0]), n)


def _box(s, p):
    for k in range(6):
        yield p[k % 3] - s[k]


def _round(base, base_radius, apex, apex_radius, p):
    axis, f = sub(apex, base), sub(p, base)
    square = dot(axis, axis)
    height = dot(f, axis) / square
    radial = sub(f, times(height, axis))
    yield dot(radial, radial) - (base_radius + height * (apex_radius - base_radius)) ** 2
    yield dot(f, axis)
    yield dot(sub(p, apex), axis)


def _cylinder(s, p):
    return _round(s[:3], s[6], s[3:6], s[6], p)


def _cone(s, p):
    return _round(s[:3], s[3], s[4:7], s[7], p)


def _quadric(s, p):
    x, y, z = p
    yield sum(c * m for c, m in zip(s, (x * x, y * y, z * z, x * y, x * z, y * z, x, y, z, 1)))


def _torus(s, p):
    x, y, z = p
    yield (x * x + y * y + z * z + s[0] ** 2 - s[1] ** 2) ** 2 - 4 * s[0] ** 2 * (x * x + y * y)


def _polyhedron(s, p):
    for k in range(0, len(s), 6):
        yield dot(sub(p, s[k:k + 3]), s[k + 3:k + 6])


def _blob(s, p):
    total = -s[-1]
    for k in range(0, len(s) - 1, 5):
        w = 1 - dot(sub(p, s[k:k + 3]), sub(p, s[k:k + 3])) / s[k + 3] ** 2
        total += s[k + 4] * w * w if w > 0 else 0
    yield total


#: Shape -> its surfaces' implicit functions of its numbers and a point, and the fields that hold the numbers.
FORMS = {Sphere: (_sphere, ("center", "radius")), Plane: (_plane, ("point", "normal")), Triangle: (_corners, ("a", "b", "c")),
         Mesh: (_corners, ()), Polygon: (_polygon, ("vertices",)), Box: (_box, ("low", "high")),
         Cylinder: (_cylinder, ("base", "apex", "radius")), Cone: (_cone, ("base", "base_radius", "apex", "apex_radius")),
         Quadric: (_quadric, ("coefficients",)), Torus: (_torus, ("major_radius", "minor_radius")), Polyhedron: (_polyhedron, ("planes",)),
         Blob: (_blob, ("elements", "threshold")), Implicit: (None, ())}


def _formula(shape):
    """The formula as a function of its own numbers and a point."""
    def of(s, p):
        constants = iter(s)
        yield formulas.value(formulas.tree(shape.expression), formulas.precise(mp) | dict(zip("xyz", p)), lambda _: next(constants))
    return of


def _constants(shape: Implicit) -> tuple:
    found = []

    def note(x):
        found.append(mp.mpf(x))
        return found[-1]
    formulas.value(formulas.tree(shape.expression), formulas.precise(mp) | dict.fromkeys("xyz", mp.mpf("0.3")), note)
    return tuple(found)


def _flat(value):
    if isinstance(value, tuple):
        for part in value:
            yield from _flat(part)
    else:
        yield mp.mpf(value)


def numbers(shape) -> tuple:
    """All numbers of a shape's record, in 50 digits."""
    if isinstance(shape, Implicit):
        return _constants(shape)
    if isinstance(shape, Mesh):
        return tuple(mp.mpf(float(x)) for x in shape.vertices[shape.faces].ravel())
    return tuple(_flat(tuple(getattr(shape, name) for name in FORMS[type(shape)][1])))


def _slopes(value, at):
    """Partial derivatives of a function of a tuple; 0 where a number can't be another: the exponent of something negative."""
    out = []
    for k, x in enumerate(at):
        h = STEP * (abs(x) if x != 0 else 1)
        try:
            up, down = (value((*at[:k], x + sign * h, *at[k + 1:])) for sign in (1, -1))
        except TypeError:       # complex numbers don't compare
            up = down = mp.mpf(0)
        slope = (up - down) / (2 * h)
        out.append(slope if isinstance(slope, mp.mpf) else mp.mpf(0))
    return out


def condition(shape, matrix, origin, direction, t) -> float:
    """The condition number of the crossing at t, an mpf, of a placed shape with a ray; inf at a tangent."""
    forms, s = _formula(shape) if isinstance(shape, Implicit) else FORMS[type(shape)][0], numbers(shape)
    rows = inverse(tuple(matrix[:3, :3].ravel().tolist()))
    o, d = vector(origin), vector(direction)
    p = tuple(dot(row, sub(add(o, times(t, d)), vector(matrix[:3, 3]))) for row in rows)

    def of_point(k):
        return _slopes(lambda q: list(forms(s, q))[k], p)

    values = list(forms(s, p))
    slopes = [of_point(k) for k in range(len(values))]
    # which of the surfaces it is: the one that p is nearest to
    k = min(range(len(values)), key=lambda k: abs(values[k]) / (mp.sqrt(dot(slopes[k], slopes[k])) or 1))
    world = [sum(slopes[k][j] * rows[j][axis] for j in range(3)) for axis in range(3)]
    speed = dot(world, d)
    if speed == 0 or t == 0:
        return float("inf")
    total = sum(abs(x * g) for x, g in zip(s, _slopes(lambda numbers: list(forms(numbers, p))[k], s)))
    total += sum(abs(x * g) for x, g in zip(o, world)) + abs(t) * sum(abs(x * g) for x, g in zip(d, world))
    return float(total / abs(t * speed))
