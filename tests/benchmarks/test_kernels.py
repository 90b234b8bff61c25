"""What a ray costs a kernel: nanoseconds a ray for every kind of shape, and nanoseconds a box for the walk through the tree.

    pytest tests/benchmarks --benchmark-only --benchmark-columns=min,median,iqr

The nanoseconds stand above pytest-benchmark's own tables. One thread, 16,384 rays, which stay in the second-level cache.
"""
import numpy as np
import pytest

pytest.importorskip("pytest_benchmark", reason="needs pytest-benchmark")

from rtcore import Material, Mesh, Node, Scene, Sphere, Torus, render
from rtcore.camera import Camera
from rtcore.flatten import flatten
from rtcore.framing import framed
from rtcore.reports.bench.meshes import primary
from rtcore.scene import Fog
from rtcore.shapes import KINDS
from rtcore.wave import CLOSEST, DX, OX, START, T, new_rays

COUNT = 1 << 14
ROUNDS = 20
DTYPE = {"f32": np.float32, "f64": np.float64}


def time_kernel(benchmark, scene: Scene, precision: str, origins, directions) -> float:
    """Nanoseconds that one ray takes at best, all kinds of the scene together."""
    geometry = flatten(scene, precision)
    rays = new_rays(len(origins), DTYPE[precision])
    rays.ray[OX:OX + 3], rays.ray[DX:DX + 3], rays.ray[START] = origins.T, directions.T, 0

    def reset():
        rays.ray[T], rays.prim[:], rays.depth[:] = np.inf, -1, 0

    def trace():
        for group in geometry.groups:
            group.kind.intersect(rays, len(origins), group.tree, group.table, group.first, CLOSEST)

    benchmark.pedantic(trace, setup=reset, rounds=ROUNDS, warmup_rounds=2)
    assert (rays.prim >= 0).any()
    return benchmark.stats.stats.min / len(origins) * 1e9


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_ray_and_one_shape(benchmark, record_property, kind, precision):
    """Eye rays on one shape that fills the picture, in the order of tiles."""
    shape, transform = kind.example
    scene = Scene(objects=(Node(shape=shape, transform=transform),))
    origins, directions = primary(framed(scene), COUNT)
    benchmark.group = f"one shape, {precision}"
    record_property("ns a ray", time_kernel(benchmark, scene, precision, origins, directions))


def slivers(count: int) -> Mesh:
    """Triangles that are nothing but the diagonals of their boxes: a ray meets many boxes, and next to never what is in them."""
    random = np.random.default_rng(2)
    corner = random.uniform(-1, 1, (count, 3))
    span = random.choice([-0.08, 0.08], (count, 3))
    ends = np.stack([corner, corner + span, corner + 0.5 * span + 1e-5], axis=1)
    return Mesh(vertices=ends.reshape(-1, 3), faces=np.arange(3 * count).reshape(-1, 3))


def boxes_met(mesh: Mesh, origins, directions) -> float:
    """How many boxes of triangles a ray meets, on average over some of the rays."""
    corners = mesh.vertices[mesh.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    some = slice(None, None, len(origins) // 64)
    met = 0
    for o, d in zip(origins[some].astype(float), directions[some].astype(float)):
        a, b = (low - o) / d, (high - o) / d
        met += (np.minimum(a, b).max(axis=1).clip(0) <= np.maximum(a, b).min(axis=1)).sum()
    return met / len(origins[some])


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("order", ["coherent", "scattered"])
def test_a_ray_and_a_box_on_its_way(benchmark, record_property, order, precision):
    """The walk through a tree over 20,000 boxes, told by each box of a triangle that a ray meets; the inner ones come on top."""
    mesh = slivers(20_000)
    if order == "coherent":
        origins, directions = primary(Camera(lookfrom=(0.3, 0.4, -4), fov=25), COUNT)
    else:
        random = np.random.default_rng(3)
        origins, directions = (x.astype(np.float32) for x in (random.uniform(-1, 1, (COUNT, 3)), random.normal(size=(COUNT, 3))))
    benchmark.group = f"walk, {precision}"
    ray = time_kernel(benchmark, Scene(objects=(mesh,)), precision, origins, directions)
    record_property("ns a ray", ray)
    record_property("ns a box", ray / boxes_met(mesh, origins, directions))


MIRROR = Material(reflection=0.3)
BALLS = tuple(Node(shape=Sphere((x, 0.3 * x * y, y), 0.45), material=MIRROR) for x in range(-4, 5) for y in range(9))
RING = Node(shape=Torus(1, 0.3), visible=False)
UNUSED = {"plain": {}, "with what it does not use": {"objects": (*BALLS, RING), "fog": Fog(on=False), "definitions": {"ring": RING}}}


@pytest.mark.parametrize("extras", UNUSED)
def test_what_a_scene_does_not_use_costs_it_nothing(benchmark, extras):
    """A pair to compare: mirroring spheres, and the same with a hidden torus, a definition that nobody uses and fog turned off."""
    scene = Scene(**{"objects": BALLS, **UNUSED[extras]})
    benchmark.group = "a scene of spheres"
    benchmark.pedantic(lambda: render(scene, (256, 256), threads=1), rounds=10, warmup_rounds=1)
