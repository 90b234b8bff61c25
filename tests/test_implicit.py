"""Implicit surfaces: the rows of the table of cases, first roots against the 50-digit twin, what is certified, rays that leave."""
import msgspec
import numpy as np
import pytest

import rtcore
from rtcore import Implicit, Matrix, Node, Scene
from rtcore.flatten import flatten
from rtcore.progressive import Renderer, RenderRequest
from rtcore.reports.oracle import crossings, mp, nearest
from rtcore.settings import Settings
from rtcore.shapes.implicit import line_roots
from rtcore.views.certified import draw
from rtcore.views.view import Seen
from rtcore.wave import CLOSEST, GX, UNCERTIFIED

from test_leaving import TRANSFORMS, first_hits, rays_of, spawn, trace

EYE, U = np.eye(4), 2.0 ** -53
BOX = ((-2, -2, -2), (2, 2, 2))
UP, RIGHT = (0, 0, 1), (1, 0, 0)
TANH = "(exp(1e6*(z - .3)) - exp(-1e6*(z - .3)))/(exp(1e6*(z - .3)) + exp(-1e6*(z - .3)))"
FORMULAS = {
    "sphere": Implicit("x^2 + y^2 + z^2 - 1", (-1.1, -1.1, -1.1), (1.1, 1.1, 1.1)),
    "torus": Implicit("(x^2 + y^2 + z^2 + 0.75)^2 - 4*(x^2 + y^2)", (-1.6, -1.6, -0.6), (1.6, 1.6, 0.6)),
    "gyroid": Implicit("sin(4*x)*cos(4*y) + sin(4*y)*cos(4*z) + sin(4*z)*cos(4*x)", (-1, -1, -1), (1, 1, 1)),
    "heart": Implicit("(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3", (-1.2, -0.8, -1.1), (1.2, 0.8, 1.3)),
}


def cast(shape, origins, directions, precision="f64", matrix=EYE):
    """Nearest hits, once any-hit has been seen to agree."""
    scene = Scene(objects=[Node(shape=shape, transform=[Matrix(np.asarray(matrix).tolist())])])
    hits = rtcore.intersect(scene, origins, directions, precision=precision)
    assert (rtcore.occluded(scene, origins, directions, precision=precision) == np.isfinite(hits.t)).all()
    assert np.isfinite(hits.normal).all() and np.isfinite(hits.uv).all() and not np.isnan(hits.t).any()
    return hits


@pytest.mark.parametrize("text,origin,direction,true", [
    ("(x^2 + y^2 + z^2 - 1)^2", (0, 0, -3), UP, [2, 2, 4, 4]),
    ("x^2 + y^2 + z^2 - 1", (0, 1, -3), UP, [3, 3]),
    ("1/x", (-1, 0, 0), RIGHT, []),
    ("tan(x)/x", (-1.9, 0.5, 0.5), RIGHT, []),
    (TANH, (0, 0, -1), UP, [1.3]),
    ("1 - 2/(exp(2e6*(z - .3)) + 1)", (0, 0, -1), UP, [1.3]),
    ("sqrt(x) - .5", (-1, 0, 0), RIGHT, [1.25]),
    ("log(x) + 1", (-1, 0, 0), RIGHT, [1 + float(mp.exp(-1))]),
    ("floor(x) - .5", (-1.5, 0, 0), RIGHT, []),
    ("mod(x, 1) - .5", (-2, 0, 0), RIGHT, [0.5, 1.5, 2.5, 3.5]),
    ("abs(x)", (-1, 0, 0), RIGHT, [1, 1]),
    ("abs(x) - 1e-10", (-1, 0, 0), RIGHT, [1 - 1e-10, 1 + 1e-10]),
    ("x^3", (-1, 0, 0), RIGHT, [1]),
    ("(sqrt(x^2 + y^2) - 1)^2 + z^2 - .0625", (-5, .75, 0), RIGHT, [4, 5, 5, 6]),
    ("atan2(y, x)", (-.5, -1, 0), (0, 1, 0), []),
    ("x + 3", (-9, 0, 0), RIGHT, []),       # outside the box
])
def test_rows_of_the_table(text, origin, direction, true):
    shape = Implicit(text, *BOX)
    found = line_roots(shape, EYE, origin, direction)
    assert np.allclose(found, true, rtol=0, atol=4e-8 if "^2)^2" in text or "^3" in text else 4e-15) and len(found) == len(true)
    hits = cast(shape, [origin], [direction])
    assert np.allclose(hits.t, found[:1] or [np.inf], rtol=0, atol=4e-15)


@pytest.mark.parametrize("factor", ["1e300", "1e-300", "-1e-300", "1e-15"])
def test_a_factor_changes_nothing(factor):
    plain, scaled = (Implicit(f"{f}*(x^2 + y^2 + z^2 - 1)", *BOX) for f in ("1.5", factor))
    rng = np.random.default_rng(1)
    origins = rng.normal(size=(200, 3)) * 3
    directions = rng.uniform(-0.9, 0.9, (200, 3)) - origins
    a, b = cast(plain, origins, directions), cast(scaled, origins, directions)
    assert (np.isfinite(a.t) == np.isfinite(b.t)).all() and np.isfinite(a.t).mean() > 0.4
    met = np.isfinite(a.t)
    assert np.allclose(a.t[met], b.t[met], rtol=1e-14)
    assert np.allclose(np.abs(a.normal), np.abs(b.normal), atol=1e-14)


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", FORMULAS)
def test_first_roots_are_the_twins(name, precision):
    """No miss and no ghost on random rays; t to within 8 roundings of what its condition makes of them."""
    rng = np.random.default_rng(len(name))
    dtype, shape = {"f64": np.float64, "f32": np.float32}[precision], FORMULAS[name]
    count = 20 if name == "gyroid" else 60
    origins = (rng.normal(size=(count, 3)) * np.where(np.arange(count) % 3, 3, 0.5)[:, None]).astype(dtype)
    directions = (rng.uniform(-0.9, 0.9, (count, 3)) - origins).astype(dtype)
    rounded = shape if precision == "f64" else shape.rounded(np.float32)
    hits, seen = cast(shape, origins, directions, precision), 0
    for o, d, t in zip(origins, directions, hits.t):
        true = nearest(rounded, EYE, o, d)
        if true is None:
            assert t == np.inf, (o.tolist(), d.tolist(), t)
            continue
        cosine = abs(float(sum(n * float(x) for n, x in zip(true.normal, d)))) / np.linalg.norm(d.astype(float))
        error = 8 * U * 2 * (np.abs(o).max() + 2) / max(cosine, 1e-9) / np.linalg.norm(d.astype(float))
        error += 0.5 * float(np.spacing(dtype(true.t)))
        assert abs(float(mp.mpf(float(t)) - true.t)) <= error, (o.tolist(), d.tolist(), float(true.t), t)
        seen += 1
    assert seen > count / 4


def test_every_root_along_lines():
    rng = np.random.default_rng(5)
    for name in ("torus", "heart"):
        for _ in range(40):
            origin = rng.normal(size=3) * 3
            direction = rng.uniform(-0.8, 0.8, 3) - origin
            true = [c.t for c in crossings(FORMULAS[name], EYE, origin, direction)]
            found = line_roots(FORMULAS[name], EYE, origin, direction)
            assert len(found) == len(true) and all(abs(a - float(b)) < 1e-13 for a, b in zip(found, true))


def test_a_far_eye_costs_nothing():
    shape, d = FORMULAS["sphere"], np.array([(1.0, 0, 0)])
    for far in (1e3, 1e6, 1e9):
        for height in (0.25, 0.999, 1 + 1e-9):
            o = np.array([(-far, height, 0.01)])
            true = nearest(shape, EYE, o[0], d[0])
            t = cast(shape, o, d).t[0]
            assert (t == np.inf) if true is None else abs(float(mp.mpf(t) - true.t)) <= 2 * np.spacing(far)


@pytest.mark.parametrize("sides,first", [("front", 2), ("back", 4)])
def test_the_front_is_where_it_is_positive(sides, first):
    shape = msgspec.structs.replace(FORMULAS["sphere"], sides=sides)
    assert cast(shape, [(0, 0, -3)], [UP]).t[0] == first


def test_normals_are_exact_and_a_touch_has_one():
    hits = cast(FORMULAS["sphere"], [(0, 0, -3), (3, 0, 0)], [UP, (-1, 0, 0)])
    assert np.allclose(hits.normal, [(0, 0, -1), (1, 0, 0)], atol=1e-15)
    touched = cast(Implicit("(x^2 + y^2 + z^2 - 1)^2", *BOX), [(0, 0, -3)], [UP])
    assert np.allclose(touched.normal, [(0, 0, -1)], atol=1e-6)


def test_what_is_not_certified_is_marked_counted_and_shown():
    for text, doubtful in (("x^2 + y^2 + z^2 - 1", False), ("(x^2 + y^2 + z^2 - 1)^2", True)):
        scene = Scene(objects=[Implicit(text, *BOX)])
        (group,) = flatten(scene).groups
        rays = rays_of(np.array([[0.1, 0.2], [0.1, 0.3], [-3, -3]]), np.array([[0, 0], [0, 0], [1, 1]]), 2, np.float64)
        group.kind.intersect(rays, 2, group.tree, group.table, 0, CLOSEST)
        assert rays.prim[:2].tolist() == [0, 0] and (rays.doubt[:2] == doubtful).all() and rays.tally[UNCERTIFIED] == 2 * doubtful
        camera = rtcore.Camera(lookfrom=(0, 0, -6), lookat=(0, 0, 0))
        renderer = Renderer()
        *_, frame = renderer.frames(RenderRequest(scene, camera, Settings(size=(32, 24), view="certified")), coarse=False)
        renderer.close()
        orange = frame.pixels[:, :, 0] > 2 * frame.pixels[:, :, 2] + 0.1
        assert (orange == (frame.node >= 0)).all() if doubtful else not orange.any()
    flags = np.array([[1, 2, 0]], np.uint8)
    shown = draw(Seen(**{**dict.fromkeys(Seen._fields), "pixels": np.zeros((1, 3, 3), np.float32), "node": np.array([[0, -1, 0]]),
                         "doubt": lambda: flags}))
    assert shown[0, :, 0].tolist() == pytest.approx([0.7, 0.7, 0])


def test_a_ray_that_was_given_up_is_shown_whatever_it_meets():
    """A formula that no search gets through within its pieces, before a wall: who looks at the wall sees that something may be missing."""
    tangle = Implicit("1e-3*sin(1e6*z) + 1e-3*sin(1e7*x) + 1.9e-3", *BOX)
    camera = rtcore.Camera(lookfrom=(0.3, 0.2, 6), lookat=(0, 0, 0), fov=30)
    for behind in ((), (rtcore.Plane((0, 0, -3), (0, 0, 1)),)):
        renderer = Renderer()
        request = RenderRequest(Scene(objects=[tangle, *behind]), camera, Settings(size=(16, 12), view="certified"))
        *_, frame = renderer.frames(request, coarse=False)
        shown = frame.pixels[:, :, 0] > 2 * frame.pixels[:, :, 2] + 0.1
        assert renderer.stats()["uncertified"] > 0 and (shown & (frame.node != 0)).any()
        renderer.close()


@pytest.mark.parametrize("text", ["1/(x - x + y*1e-300)", "sin(1e9*x)*sin(1e9*y)", "(x - 1)^20 - 1e-30", "log(x - 5)", "exp(exp(exp(9*x)))",
                                  "tan(1e8/x)",
                                  "floor(1e6*x) - 0.5", "mod(1e9*x, 1) - 0.5", "sqrt(-x^2 - 1)", "x/x - 1", "1e308*x*1e308 - y"])
def test_no_formula_keeps_a_ray_for_long(text):
    rng = np.random.default_rng(0)
    origins = rng.normal(size=(64, 3)) * 3
    cast(Implicit(text, *BOX), origins, -origins + rng.normal(size=(64, 3)) * 0.3)


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("place", TRANSFORMS)
def test_a_sphere_is_not_met_again(place, precision):
    matrix = np.array(TRANSFORMS[place], float)
    geometry = flatten(Scene(objects=[Node(shape=FORMULAS["sphere"], transform=[Matrix(matrix.tolist())])]), precision)
    rng = np.random.default_rng(5)
    d, surface = (rows[:, ::10] for rows in first_hits(geometry, matrix, rng, 1.0))
    facing = (d * surface[GX:GX + 3]).sum(0) < 0
    o, way, _ = spawn(surface[:, facing], np.ones(facing.sum()), rng, geometry.dtype)
    again, _ = trace(geometry, o, way)
    assert (again.prim[:o.shape[1]] < 0).all(), (again.prim[:o.shape[1]] >= 0).sum()
