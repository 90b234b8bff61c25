"""The snail's meshes are closed, lie on the fields they were made from, and are made the same way every time."""
import numpy as np
import pytest

import resources
import rtcore
from resources import snail


@pytest.fixture(scope="module", params=snail.PARTS, ids=lambda part: part[0])
def part(request):
    """Name, field and the mesh as the scene file gets it."""
    name, field, *_ = request.param
    return name, field, rtcore.load(snail.MESHES / f"{name}.ply").objects[0].shape


def test_it_is_large_enough_to_be_shown_and_small_enough_to_be_carried(part):
    name, _, mesh = part
    assert 20_000 < len(mesh.faces) < 50_000 and mesh.normals is not None
    assert (snail.MESHES / f"{name}.ply").stat().st_size < 800_000


def test_it_is_closed_and_faces_outward(part):
    _, _, mesh = part
    faces = np.asarray(mesh.faces, np.int64)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    one_way, other_way = (np.sort(pair @ [1 << 32, 1]) for pair in (edges, edges[:, ::-1]))
    assert (one_way == other_way).all()         # every edge as often in one direction as in the other
    assert (np.diff(one_way) == 0).mean() < 1e-3        # and once, but where the surface passes a cell twice
    a, b, c = (np.asarray(mesh.vertices)[faces[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 > 0.3        # the volume
    assert (np.cross(b - a, c - a) * np.asarray(mesh.normals)[faces[:, 0]]).sum(1).mean() > 0


def test_it_lies_on_its_field_with_the_fields_normals(part):
    _, field, mesh = part
    points = np.asarray(mesh.vertices)
    slope = snail.gradient(field, points)
    off = np.abs(field(points)) / np.linalg.norm(slope, axis=1)
    assert np.quantile(off, 0.99) < 1e-4 and off.max() < 5e-3      # where turns of the shell meet, the field has a fold
    cosine = (slope * np.asarray(mesh.normals)).sum(1) / np.linalg.norm(slope, axis=1)
    assert np.quantile(cosine, 0.01) > 0.999


def test_it_is_made_the_same_way_every_time(part):
    name, field, low, high, step = next(p for p in snail.PARTS if p[0] == part[0])
    first, second = (snail.ply(*snail.surface_net(field, low, high, 4 * step)) for _ in range(2))
    assert first == second and first.startswith(b"ply\nformat binary_little_endian 1.0\n")


def test_a_ball_comes_out_as_a_ball():
    vertices, faces, normals = snail.surface_net(lambda p: np.linalg.norm(p - 0.1, axis=-1) - 1, (-1.2,) * 3, (1.3,) * 3, 0.11)
    assert np.abs(np.linalg.norm(vertices - 0.1, axis=1) - 1).max() < 1e-12
    assert np.abs(vertices - 0.1 - normals).max() < 1e-6
    assert len(vertices) - len(faces) * 3 // 2 + len(faces) == 2        # Euler's


def test_the_scene_shows_it(tmp_path):
    leaves = list(rtcore.load(resources.ROOT / "scenes" / "snail.yaml").leaves())
    assert sum(len(leaf.shape.faces) for leaf in leaves if isinstance(leaf.shape, rtcore.Mesh)) > 50_000
