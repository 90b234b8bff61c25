"""Crossings: the rows of the table of cases with their multiplicities, against mpmath; what counts at edges; scenes; what is refused."""
import warnings

import msgspec
import numpy as np
import pytest

import rtcore
from rtcore import (Blob, Box, Cone, Cylinder, FieldError, Implicit, Mesh, Node, Plane, Polygon, Polyhedron, Quadric, Rotate, Scale, Scene,
                    Shear, Sphere, Torus, Translate, Triangle)
from rtcore.scene import Shape

from rtcore.reports.oracle import crossings as twin
from rtcore.reports.oracle import mp

BALL, RING = Sphere((0, 0, 0), 1), Torus(1, 0.25)
X, Y, UP, DOWN = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)
TWO = Blob([((0.75, 0, 0), 1, 1), ((-0.75, 0, 0), 1, 1)], 0.3828125)
CONE = Cone((0, 0, 0), 1, UP)
BLOCK = Box((-1, -1, -1), (1, 1, 1))
EYE = np.eye(4)


# --- roots and their multiplicities ---

def sphere(s, p):
    return sum((x - c) ** 2 for x, c in zip(p, s.center)) - mp.mpf(s.radius) ** 2


def torus(s, p):
    big, small = mp.mpf(s.major_radius), mp.mpf(s.minor_radius)
    return (sum(x * x for x in p) + big ** 2 - small ** 2) ** 2 - 4 * big ** 2 * (p[0] ** 2 + p[1] ** 2)


def quadric(s, p):
    x, y, z = p
    return sum(mp.mpf(c) * v for c, v in zip(s.coefficients, (x * x, y * y, z * z, x * y, x * z, y * z, x, y, z, 1)))


def blob(s, p):
    """Where all elements reach."""
    depths = ((1 - sum((x - c) ** 2 for x, c in zip(p, center)) / mp.mpf(r) ** 2, strength) for center, r, strength in s.elements)
    return sum(strength * w ** 2 for w, strength in depths) - mp.mpf(s.threshold)


FORMS = {Sphere: sphere, Torus: torus, Quadric: quadric, Blob: blob}


def truth(shape, o, d, multiple: dict) -> list:
    """All real roots of the form along the ray, a polynomial of degree 4 at most, made from five of its values. The multiple roots are
    given; that they are roots of this order is checked by dividing them out."""
    at = [mp.mpf(t) for t in range(-2, 3)]
    values = [FORMS[type(shape)](shape, [mp.mpf(float(x)) + t * mp.mpf(float(v)) for x, v in zip(o, d)]) for t in at]
    p = list(mp.lu_solve(mp.matrix([[t ** k for k in (4, 3, 2, 1, 0)] for t in at]), mp.matrix(values)))
    most = max(map(abs, p))
    while abs(p[0]) < most * mp.mpf(10) ** -40:
        p.pop(0)
    found = []
    for root, times in multiple.items():
        for _ in range(times):
            for i in range(1, len(p)):
                p[i] += p[i - 1] * root
            assert abs(p.pop()) < most * mp.mpf(10) ** -35
        found += [mp.mpf(root)] * times
    with warnings.catch_warnings():     # newer releases of mpmath want the order of coefficients said, older ones don't know the word
        warnings.simplefilter("ignore", DeprecationWarning)
        rest = mp.polyroots(p, maxsteps=500, extraprec=400) if len(p) > 1 else []
    return sorted(found + [mp.re(r) for r in rest if abs(mp.im(r)) < mp.mpf(10) ** -25 * (1 + abs(r))])


ROWS = {
    "far sphere": (BALL, (0, 0.5, -4100), UP, {}),
    "very far sphere": (BALL, (0, 0.5, -1e8), UP, {}),
    "close above a large sphere": (Sphere((0, 0, 0), 1e6), (0, 0, 1e6 + 2.0 ** -10), DOWN, {}),
    "grazing sphere": (BALL, (0, 1 - 2.0 ** -53, -5), UP, {}),
    "just beside a sphere": (BALL, (0, 1 + 2.0 ** -52, -5), UP, {}),
    "tangent sphere": (BALL, (0, 1, -5), UP, {5: 2}),
    "tangent at the start": (BALL, X, Y, {0: 2}),
    "sphere from its centre": (BALL, (0, 0, 0), UP, {}),
    "sphere from its surface": (BALL, DOWN, UP, {}),
    "roots that coincide in float64": (Quadric((94906265.625, 0, 0, 0, 0, 0, -189812534, 0, 0, 94906268.375)), (0, 0, 0), X, {}),
    "paraboloid along its axis": (Quadric((1, 1, 0, 0, 0, 0, 0, 0, -1, 0)), (0.5, 0, 5), DOWN, {}),
    "torus along its axis": (RING, (0, 0, -5), UP, {}),
    "torus across": (RING, (-5, 0, 0), X, {}),
    "torus, tangent to its top circle": (RING, (1, -5, 0.25), Y, {5: 4}),
    "torus, touched from within its hole": (RING, (-5, 0.75, 0), X, {5: 2}),
    "torus from far": (RING, (-1e4, 0.1, 0.05), X, {}),
    "thin torus": (Torus(1, 1e-6), (-3, 0.1, 5e-7), X, {}),
    "horn torus along its axis": (Torus(1, 1), (0, 0, -5), UP, {5: 4}),
    "large torus": (Torus(143, 113.2), (-400, 31, 290), (1, 0.1, -0.7), {}),
    "spindle through its poles": (Torus(0.5, 1.25), (0, 0, -5), UP, {5 - mp.sqrt(mp.mpf(21) / 16): 2, 5 + mp.sqrt(mp.mpf(21) / 16): 2}),
    "blob of one": (Blob([((0, 0, 0), 1, 1)], 0.6), (-5, 0, 0), X, {}),
    "blob's saddle": (TWO, (0, -5, 0), Y, {5: 2}),
    "blob of one point": (Blob([((0, 0, 0), 1, 1)], 1), (-5, 0, 0), X, {5: 2}),
}


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", ROWS)
def test_row(name, precision):
    shape, o, d, multiple = ROWS[name]
    dtype = {"f64": np.float64, "f32": np.float32}[precision]
    o, d = np.array(o, dtype), np.array(d, dtype)
    if precision == "f32":
        numbers = [x for value in (getattr(shape, f) for f in shape.__struct_fields__ if f != "sides") if value is not None
                   for x in np.ravel(np.array(value, object)) if isinstance(x, float)]
        if any(float(np.float32(x)) != x for x in numbers) or name in ("grazing sphere", "just beside a sphere"):
            pytest.skip("no float32 numbers")
    true = truth(shape, o, d, multiple)
    if isinstance(shape, Blob):
        true = [t for t in true if any(sum((o[k] + t * d[k] - c[k]) ** 2 for k in range(3)) < r * r for c, r, _ in shape.elements)]
    found = rtcore.crossings(shape, o, d, precision)
    assert found.dtype == dtype and len(found) == len(true)
    for t, c in zip(found, true):
        assert abs(mp.mpf(float(t)) - c) <= (0.5 + 1e-9) * mp.mpf(float(np.spacing(abs(t)))), (found, true)


def test_a_blob_scaled_by_a_thousandth():
    node = Node(shape=TWO, transform=(Scale((1e-3,) * 3),))
    true = [float(c.t) for c in twin(TWO, node.matrix(), (1e-4, -5e-3, 0), (0, 1e-3, 0))]
    assert rtcore.crossings(node, (1e-4, -5e-3, 0), (0, 1e-3, 0)).tolist() == true and len(true) == 2


@pytest.mark.parametrize("shape,o,d,expected", [
    (CONE, (0, 0, 5), DOWN, [4, 4, 5]),                             # both halves of the double cone meet in the apex
    (Cone((0, 0, 0), 1, UP, capped=False), (0.5, -5, 1), Y, []),    # level with the apex, beside it
    (CONE, (0, -5, 1), Y, [5, 5]),
    (CONE, (2, 0, -1), (-1, 0, 1), [1]),                            # along a generator: in the wall, but through the rim of the base
    (Cone((0, 0, 0), 1, UP, capped=False), (2, 0, -1), (-1, 0, 1), []),
    (Cylinder((0, 0, 0), UP, 1), (0.5, 0, 5), DOWN, [4, 5]),        # caps only
    (Cylinder((0, 0, 0), UP, 1), (1, 0, 5), DOWN, [4, 5]),          # in the wall: the rims of the caps
    (Cylinder((0, 0, 0), UP, 1, capped=False), (1, 0, 5), DOWN, []),
    (Cylinder((0, 0, 0), UP, 1), (np.nextafter(1, 2), 0, 5), DOWN, []),
    (Cylinder((0, 0, 0), UP, 1), (-1, -5, 0.5), Y, [5, 5]),
    (Cylinder((0, 0, 0), UP, 1), (-2, 0, 2), (1, 0, -1), [1, 2]),   # in through the rim, out through the base
    (Cylinder((0, 0, 0), UP, 1), (-2, 0, -0.5), (1, 0, 0.5), [1, 3]),       # in and out through the rims
    (Cylinder((0, 0, 0), UP, 1), (-2, 0, 0), (1, 0, 1), [1, 1]),    # touches the rim only
    (Cylinder((0, 0, 0), UP, 1), (1, -0.5, 0), (0, 1, 1), [0.5, 0.5]),      # touches the wall only
    (Cylinder((0, 0, 0), UP, 1), (1, -1, 2), (0, 1, -1), [1, 1]),   # touches wall and cap in one point of the rim
    (Plane((0, 0, 1), UP), (0, 0, 1), X, []),                       # in the plane
    (Plane((0, 0, 1), UP), (0, 0, 2), (5, 0, 2), [-0.5]),
    (Quadric((0, 0, 1, 0, 0, 0, 0, 0, 0, 0)), (0, 0, -3), UP, [3, 3]),      # z² = 0, a plane twice
    (Quadric((1, -1, 0, 0, 0, 0, 0, 0, 0, 0)), (0, 0, 0), UP, []),          # along the line where two planes meet
    (Quadric((1, 1, 1, 0, 0, 0, 0, 0, 0, -1), (-1, -1, 0), (1, 1, 1)), (0, 0, -3), UP, [4]),
    (Quadric((1, 1, 1, 0, 0, 0, 0, 0, 0, -1), (-1, -1, 0), (1, 1, 1)), (-3, 0, 0), X, [2, 4]),      # in the box's own face
    (Polyhedron([((0, 0, 0), UP), ((0, 0, -1), DOWN)]), (0, 0, 0), X, []),   # for ever in a face
    (Polyhedron([((0, 0, 0), UP)]), (0, 0, 2), DOWN, [2]),                   # unbounded: in, and never out
    (Polyhedron([((1, 0, 0), X), ((0, 1, 0), Y)]), (3, -1, 0), (-1, 1, 0), [2, 2]),      # an edge, touched
    (BLOCK, (3, 3, 3), (-1, -1, -1), [2, 4]),                       # through two corners
    (BLOCK, (-3, 1, 0), X, [2, 4]),                                 # in a face
    (BLOCK, (-3, 1, 1), X, [2, 4]),                                 # along an edge
    (BLOCK, (3, -1, 0), (-1, 1, 0), [2, 2]),                        # touches an edge
    (BLOCK, (-3, np.nextafter(1, 2), 0), X, []),
    (Triangle((0, 0, 0), X, Y), (0, 0, 1), DOWN, [1]),
    (Triangle((0, 0, 0), X, Y), (0.5, 0.5, 1), DOWN, [1]),
    (Triangle((0, 0, 0), X, Y), (0.5, np.nextafter(0.5, 1), 1), DOWN, []),
    (Triangle((0, 0, 0), X, Y), (-1, 0.25, 0), X, []),              # edge on
    (Triangle((0, 0, 0), X, (2, 0, 0)), (0.5, 0, 1), DOWN, []),     # no area
    (Triangle((0, 0, 0), X, (0.5, 1e-7, 0)), (0.5, 5e-8, 1), DOWN, [1]),
    (Triangle((0, 0, 0), (1e-170, 0, 0), (0, 1e-170, 0)), (2e-171, 2e-171, 1), DOWN, [1]),
])
def test_edges_and_lines_within_surfaces(shape, o, d, expected):
    assert rtcore.crossings(shape, o, d).tolist() == expected
    turned = Node(shape=shape, transform=(Rotate(X, 90), Scale((2, -4, 0.5))))      # exact for any numbers
    turn = turned.matrix()[:3, :3]
    assert rtcore.crossings(turned, turn @ o, turn @ d).tolist() == expected


def fan(count: int) -> Mesh:
    """Triangles around one vertex, a shallow cone, front up."""
    angle = np.arange(count) * 2 * np.pi / count
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.full(count, -0.1)])
    return Mesh([(0, 0, 0), *rim.tolist()], [(0, 1 + k, 1 + (k + 1) % count) for k in range(count)])


def test_a_vertex_of_a_thousand_triangles():
    mesh = fan(1000)
    for o, d in (((0, 0, 1), DOWN), ((0.25, -0.5, 3), (-0.25, 0.5, -3)), ((0, 0, -1), UP)):
        assert rtcore.crossings(mesh, o, d).tolist() == [1]
    assert rtcore.crossings(mesh, (-1, 0, 0), X).tolist() == [1, 1]     # the silhouette: in and out


def test_edges_of_a_mesh_are_crossed_once():
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
             (1, 5, 7), (1, 7, 3)]
    cube = Mesh(corners, faces)
    for o, d in (((3, 3, 3), (-1, -1, -1)), ((0, 0, 5), DOWN), ((0.5, 0.5, 5), DOWN), ((3, -1, 0), (-1, 1, 0)), ((3, 3, 0), (-1, -1, 0)),
                 ((0.5, 0.25, 3), (0.5, 0.75, -2))):
        assert rtcore.crossings(cube, o, d).tolist() == rtcore.crossings(BLOCK, o, d).tolist(), (o, d)
        assert len(rtcore.crossings(Mesh(corners, faces, sides="front"), o, d)) == 1


COMB = Polygon(((0, 0, 0), (4, 0, 0), (4, 3, 0), (3, 1, 0), (2, 3, 0), (1, 1, 0), (0, 3, 0)))
STAR = Polygon(((0, 3, 0), (2, -3, 0), (-3, 1, 0), (3, 1, 0), (-2, -3, 0)))


@pytest.mark.parametrize("transform", [(), (Rotate(X, 90),), (Rotate(Y, 90), Translate((1, 2, 3))), (Scale((1, -2, 4)),)])
@pytest.mark.parametrize("shape", [COMB, STAR])
def test_polygons_are_as_intersect_has_them(shape, transform):
    """On corners and edges too: which of them belong, and that a star has a hole."""
    node = Node(shape=shape, transform=transform)
    scene, matrix = Scene(objects=[node]), node.matrix()
    grid = np.arange(-7, 10) * 0.5
    points = np.array([(x, y, 2) for x in grid for y in grid]) @ matrix[:3, :3].T + matrix[:3, 3]
    down = matrix[:3, :3] @ DOWN
    hits = np.isfinite(rtcore.intersect(scene, points, np.tile(down, (len(points), 1))).t)
    assert [len(rtcore.crossings(node, p, down)) for p in points] == hits.astype(int).tolist()
    assert 20 < hits.sum() < 200


@pytest.mark.parametrize("shape,o,d,front,back", [
    (BLOCK, (-3, 0, 0), X, [2], [4]), (BLOCK, (3, -1, 0), (-1, 1, 0), [2], [2]), (BALL, (0, 0, -5), UP, [4], [6]),
    (BALL, (0, 1, -5), UP, [], []),
    (CONE, (0, 0, 5), DOWN, [], [5]), (RING, (-5, 0.75, 0), X, [4], [6]), (RING, (-5, 0, 0), X, [3.75, 5.75], [4.25, 6.25]),
    (Cylinder((0, 0, 0), UP, 1), (1, -1, 2), (0, 1, -1), [1], []), (Plane((0, 0, 0), UP), (0, 0, 5), DOWN, [5], []),
    (Polyhedron([((0, 0, 0), UP)]), (0, 0, -2), UP, [], [2])])
def test_one_visible_side(shape, o, d, front, back):
    """A tangent has no facing; the faces that an edge joins have one."""
    for sides, expected in (("front", front), ("back", back)):
        one = msgspec.structs.replace(shape, sides=sides)
        for mirror in ((1, 1, 1), (1, 1, -1), (-1, -1, -1)):
            node = Node(shape=one, transform=(Scale(mirror),))
            assert rtcore.crossings(node, np.multiply(o, mirror), np.multiply(d, mirror)).tolist() == expected


def test_a_formula():
    """Its roots come from intervals; how often they count and which are seen is as for the other shapes."""
    ball = Implicit("x^2 + y^2 + z^2 - 1", (-2, -2, -2), (2, 2, 2))
    place = (Shear(xy=0.5), Scale((1, 2, 4)), Translate((0, 0, 1)))
    for o, d in (((0.1, 0.2, -1e6), UP), ((3, 4, 5), (-1e-20, -1.5e-20, -2e-20)), ((0.5, 0, 0), (0, 0, 1e30))):
        for precision in ("f64", "f32"):
            exact, found = (rtcore.crossings(Node(shape=shape, transform=place), o, d, precision) for shape in (BALL, ball))
            assert len(found) == len(exact) == 2 and found.dtype == exact.dtype
            assert found == pytest.approx(exact, rel=8 * float(np.finfo(exact.dtype).eps))
    assert rtcore.crossings(ball, (0, 1, -5), (0, 0, 2)).tolist() == [2.5, 2.5]
    for sides, t in (("front", 4), ("back", 6)):
        one = msgspec.structs.replace(ball, sides=sides)
        assert rtcore.crossings(one, (0, 0, -5), UP).tolist() == [t] and not len(rtcore.crossings(one, (0, 1, -5), UP))


# --- scenes, numbers, errors ---

def test_a_scene_has_the_crossings_of_all_that_is_visible():
    pair = Node(children=(BALL, Node(shape=BALL, transform=(Translate((0, 0, 3)),))))
    scene = Scene(definitions={"pair": pair}, objects=(
        Node(use="pair"), Node(use="pair", transform=(Translate((0, 0, 10)), Scale((1, 1, 2)))), Node(shape=BALL, visible=False)))
    assert rtcore.crossings(scene, (0, 0, -5), UP).tolist() == [4, 6, 7, 9, 23, 27, 29, 33]
    assert rtcore.crossings(pair, (0, 0, -5), UP).tolist() == [4, 6, 7, 9]
    assert rtcore.crossings(pair, [0, 0, 20], [0, 0, 2]).tolist() == [-10.5, -9.5, -9, -8]
    assert rtcore.crossings(Scene(), (0, 0, 0), UP).shape == (0,)


def test_float32_rounds_the_shape_and_the_ray_but_not_the_matrix():
    ball = Sphere((0, 0, 0), 0.1)
    assert rtcore.crossings(ball, (0, 0, 0), UP, "f32").tolist() == [-np.float32(0.1), np.float32(0.1)]
    node = Node(shape=BALL, transform=(Scale((0.1, 0.1, 0.1)),))
    true = [c.t for c in twin(BALL, node.matrix(), np.array((0.01, 0.02, 1), np.float32), np.array((0, 0, 0.3), np.float32))]
    assert rtcore.crossings(node, (0.01, 0.02, 1), (0, 0, 0.3), "f32").tolist() == [float(np.float32(float(t))) for t in true]


@pytest.mark.parametrize("shape,o,d,precision,expected", [
    (Sphere((0, 0, 0), 1e20), (0, 0, -3e20), UP, "f32", [2e20, 4e20]), (BALL, (0, 0, -5), (0, 0, 1e-23), "f32", [4e23, 6e23]),
    (BALL, (0, 0, -5), (0, 0, 1e20), "f32", [4e-20, 6e-20]), (Sphere((0, 0, 0), 1e200), (0, 0, -3e200), UP, "f64", [2e200, 4e200]),
    (Sphere((0, 0, 0), 1e300), (0, 0, 0), (0, 0, 1e-300), "f64", [-np.inf, np.inf]),
    (Sphere((0, 0, 0), 1e30), (0, 0, 0), (0, 0, 1e-30), "f32", [-np.inf, np.inf]),
    (Sphere((0, 0, 0), 1e-200), (0, 0, 0), (0, 0, 1e200), "f64", [0, 0]),
    (Sphere((0, 0, 0), 1e-300), (0, 0, 0), (0, 0, 1e20), "f64", [-1e-320, 1e-320])])
def test_sizes_at_the_ends_of_the_floats(shape, o, d, precision, expected):
    dtype = {"f64": np.float64, "f32": np.float32}[precision]
    assert rtcore.crossings(shape, o, d, precision) == pytest.approx(np.array(expected, dtype), rel=4 * float(np.finfo(dtype).eps), abs=0)


@pytest.mark.parametrize("o,d,word", [((0, 0), UP, "origin"), ((0, 0, 0), [UP], "direction"), ("abc", UP, "origin"),
                                      ((0, 0, 0), (0, 0, 0), "direction"), ((0, np.nan, 0), UP, "origin"),
                                      ((0, 0, 0), (np.inf, 0, 0), "direction"), (None, UP, "origin")])
def test_wrong_lines(o, d, word):
    with pytest.raises(FieldError) as error:
        rtcore.crossings(BALL, o, d)
    assert error.value.path == word


class Unknown(Shape, frozen=True):
    """A shape that nobody has taught to be crossed."""


def test_what_else_is_refused():
    for shape, o, precision in ((BALL, (0, 0, 0), "f16"), (BALL, (1e39, 0, 0), "f32"), (Sphere((0, 0, 0), 1e39), (0, 0, 0), "f32"),
                                (Unknown(), (0, 0, 0), "f64"), ("sphere", (0, 0, 0), "f64"), (Node(use="nothing"), (0, 0, 0), "f64"),
                                (Mesh([(1e39, 0, 0), X, Y], [(0, 1, 2)]), (0, 0, 0), "f32")):
        with pytest.raises(FieldError):
            rtcore.crossings(shape, o, UP, precision)
    with pytest.raises(FieldError, match="direction"):
        rtcore.crossings(BALL, (0, 0, 0), (0, 0, 1e-60), "f32")
    flat = Node(children=(Node(shape=BALL, transform=(Scale((1e-200,) * 3),)),), transform=(Scale((1e-200,) * 3),))
    with pytest.raises(FieldError, match=r"scene\[0\]\[0\]"):
        rtcore.crossings(flat, (0, 0, 0), UP)
