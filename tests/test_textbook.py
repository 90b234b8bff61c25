"""The textbook's solver beside the certain one: the same picture near by, another from afar, and nothing of it where nobody asks for it."""
import numpy as np
import pytest

import rtcore
from rtcore import Camera, Material, Matrix, Node, Plane, Point, Scale, Scene, Sphere
from rtcore.flatten import flatten
from rtcore.plan import plan
from rtcore.settings import Settings
from rtcore.shapes import KINDS
from rtcore.wave import CLOSEST, DX, OX, START, T, new_rays

KIND = [kind for kind in KINDS if kind.textbook is not None]
DTYPE = {"f64": np.float64, "f32": np.float32}


def met(shape, transform, o, d, precision, solver):
    """t of each ray (n,), inf for none; origins and directions (n, 3)."""
    (group,) = flatten(Scene(objects=[Node(shape=shape, transform=transform)]), precision).groups
    rays = new_rays(len(o), DTYPE[precision])
    rays.ray[OX:OX + 3, :len(o)], rays.ray[DX:DX + 3, :len(o)] = o.T, d.T
    rays.ray[START], rays.ray[T], rays.prim[:] = 0, np.inf, -1
    rays.ray[T, len(o):] = -np.inf
    getattr(group.kind, solver)(rays, len(o), group.tree, group.table, group.first, CLOSEST)
    assert ((rays.prim[:len(o)] == 0) == np.isfinite(rays.ray[T, :len(o)])).all()
    return rays.ray[T, :len(o)]


def rays_at(far: float, n: int = 2000):
    """From `far` away toward the ball of radius 1.2 about the origin, so that some miss the unit sphere."""
    rng = np.random.default_rng(5)
    o, p = rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    o *= far / np.linalg.norm(o, axis=1)[:, None]
    p *= 1.2 * rng.uniform(size=(n, 1)) ** (1 / 3) / np.linalg.norm(p, axis=1)[:, None]
    return o, (p - o) / far


TRANSFORMS = {"sphere": [], "ellipsoid": [Scale((1, 1.2, 0.9))]}


def test_there_is_one_for_spheres_and_ellipsoids():
    assert {kind.name for kind in KIND} == TRANSFORMS.keys()


@pytest.mark.parametrize("sides", ["both", "front", "back"])
@pytest.mark.parametrize("name", TRANSFORMS)
@pytest.mark.parametrize("far", [0.5, 3.0])
def test_near_by_both_solvers_agree(name, sides, far):
    o, d = rays_at(far)
    one, two = (met(Sphere((0, 0, 0), 1, sides=sides), TRANSFORMS[name], o, d, "f64", solver) for solver in ("intersect", "textbook"))
    assert (np.isfinite(one) == np.isfinite(two)).all() and np.isfinite(one).any() == (sides != "front" or far > 1)
    assert np.allclose(one, two, rtol=1e-9)


@pytest.mark.parametrize(("precision", "far"), [("f32", 2e3), ("f64", 5e7)])
@pytest.mark.parametrize("name", TRANSFORMS)
def test_from_afar_the_textbook_misses_spheres_that_are_there(name, precision, far):
    """As its own formula says, evaluated here step by step in the same precision."""
    o, d = (a.astype(DTYPE[precision]) for a in rays_at(far))
    sphere, transform = Sphere((0, 0, 0), 1), TRANSFORMS[name]
    certain, plain = (met(sphere, transform, o, d, precision, solver) for solver in ("intersect", "textbook"))
    wrong = (np.isfinite(certain) != np.isfinite(plain)).mean()
    assert 0.01 < wrong < 0.5
    if name == "sphere":
        def dot(p, q):
            return p[:, 0] * q[:, 0] + p[:, 1] * q[:, 1] + p[:, 2] * q[:, 2]
        a, b, c = dot(d, d), 2 * dot(o, d), dot(o, o) - o.dtype.type(1)
        with np.errstate(invalid="ignore"):
            twist = np.sqrt(b * b - 4 * a * c)
            near, later = (-b - twist) / (2 * a), (twist - b) / (2 * a)
        assert np.array_equal(plain, np.where(np.isnan(twist), np.inf, np.where(near > 0, near, later)))


def picture(solver, distance, precision="f32", view="beauty"):
    sphere = Node(shape=Sphere((0, 0, 0), 1), material=Material(specular=0.5))
    camera = Camera(lookfrom=(0, 0.3 * distance, -distance), lookat=(0, 0, 0), fov=float(np.degrees(2 * np.arctan(1.5 / distance))))
    scene = Scene(objects=[sphere, Plane((0, -1, 0), (0, 1, 0))], lights=[Point(position=(-4, 5, -4), intensity=50)], camera=camera)
    return rtcore.render(scene, (120, 90), 1, precision=precision, solver=solver, view=view)


def test_pictures_agree_near_by_and_differ_from_afar():
    one, two = (picture(solver, 4, "f64").pixels for solver in ("certain", "textbook"))
    assert np.abs(one - two).max() < 1e-5
    far = [picture(solver, 3000).pixels for solver in ("certain", "textbook")]
    assert (np.abs(far[0] - far[1]).max(2) > 0.05).mean() > 0.02


def test_what_it_hits_is_not_certified():
    certain, textbook = (picture(solver, 4, "f64", "certified").pixels for solver in ("certain", "textbook"))
    orange = textbook[..., 0] > textbook[..., 2] + 0.3
    assert not (certain[..., 0] > certain[..., 2] + 0.3).any() and 0.05 < orange.mean() < 0.5


def test_it_is_loaded_only_where_it_is_asked_for_and_of_use():
    balls, floor = Scene(objects=[Sphere((0, 0, 0), 1)]), Scene(objects=[Plane((0, 0, 0), (0, 1, 0))])
    wanted = Settings(solver="textbook")
    assert "textbook-sphere.f64" in plan(balls, wanted).kernels and "textbook formulas" in plan(balls, wanted).stages
    assert ("textbook formulas", "hits are to be certain") in plan(balls, Settings()).left_out
    assert ("textbook formulas", "no visible shape is solved by one") in plan(floor, wanted).left_out
    for scene, settings in ((balls, Settings()), (floor, wanted)):
        assert not any("textbook" in name for name in plan(scene, settings).kernels)


def test_a_moved_sphere_is_where_the_transform_puts_it():
    o, d = rays_at(3.0)
    shift = np.array((2.0, -1.0, 0.5))
    turned = [Matrix([[0, 2, 0, 2], [2, 0, 0, -1], [0, 0, 2, 0.5], [0, 0, 0, 1]])]
    one = met(Sphere((0, 0, 0), 1), turned, 2 * o + shift, 2 * d, "f64", "textbook")
    assert np.allclose(one, met(Sphere((0, 0, 0), 1), [], o, d, "f64", "textbook"), rtol=1e-9)
