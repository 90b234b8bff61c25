"""Ray sorting: every ray that is alive once, those that keep together left together, the answers told where they belong; and no bit of a
picture knows of it."""
import msgspec
import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

import rtcore
from rtcore import Camera, Directional, Material, Node, Plane, Point, Scene, Sphere, progressive
from rtcore.flatten import DTYPES
from rtcore.plan import plan
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings
from rtcore.sorting import WORTH, sort_rays, tell_hits
from rtcore.walk import PACKET
from rtcore.wave import DEAD, DX, OX, START, T, new_wave, padded


def bounced(o, d, dtype, known=()):
    """A wave as a bounce leaves it; the hits of rays `known` are known."""
    n = len(o)
    wave = new_wave(n, dtype)
    rays = wave.rays
    rays.ray[:], rays.ray[DX], rays.ray[T], rays.prim[:], rays.doubt[:] = 0, 1, DEAD, -1, 0
    rays.ray[OX:OX + 3, :n], rays.ray[DX:DX + 3, :n], rays.ray[T, :n] = np.transpose(o), np.transpose(d), np.inf
    rays.ray[START, known] = rays.ray[T, known] = 3
    return wave


def scattered(n, seed=0):
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(n, 3))
    return rng.uniform(-1, 1, (n, 3)), d / np.linalg.norm(d, axis=1)[:, None]


def check(wave, room, n, alive):
    """That the rays of `room` are those of the wave that are alive; returns the column that each had."""
    m, before = sort_rays(wave.rays, n, room), wave.rays.ray.copy()
    came, found = room.owner[:m].copy(), room.rays
    assert sorted(came) == list(alive)
    np.testing.assert_array_equal(found.ray[OX:START, :m], wave.rays.ray[OX:START, came])
    assert (found.ray[START, :m] == 0).all() and (found.ray[T, :m] == np.inf).all()
    assert (found.prim[:m] == -1).all() and (found.doubt[:m] == 0).all()
    assert (found.ray[T, m:padded(m)] == DEAD).all()
    np.testing.assert_array_equal(wave.rays.ray, before)
    return came


@pytest.mark.parametrize("dtype", DTYPES.values(), ids=DTYPES)
@pytest.mark.parametrize("n", [1, 7, 8, 63, 64, 65, 200, 4096])
def test_rays_that_scatter_are_brought_together(n, dtype):
    o, d = scattered(n)
    known = np.arange(0, n, 5)
    alive = np.setdiff1d(np.arange(n), known)
    wave = bounced(o, d, dtype, known)
    came = check(wave, new_wave(n + 20, dtype), n, alive)
    octant = (d < 0) @ [1, 2, 4]
    assert (np.diff(octant[came]) >= 0).all()
    if n == 4096:       # neighbours start nearer each other than they did
        apart = np.linalg.norm(np.diff(o[came], axis=0), axis=1).mean()
        assert apart < 0.6 * np.linalg.norm(np.diff(o[alive], axis=0), axis=1).mean()


@pytest.mark.parametrize("dtype", DTYPES.values(), ids=DTYPES)
def test_packets_that_keep_together_stay(dtype):
    """They come first and as they were; of one that stays, rays whose hit is known are left out like any."""
    o, d = scattered(5 * PACKET)
    for packet in (1, 3):
        these = slice(packet * PACKET, (packet + 1) * PACKET)
        d[these] = [0.6, 0, 0.8] + 0.01 * d[these]
        d[these] /= np.linalg.norm(d[these], axis=1)[:, None]
    known = [PACKET + 3]
    came = check(bounced(o, d, dtype, known), new_wave(5 * PACKET, dtype), 5 * PACKET, np.setdiff1d(np.arange(5 * PACKET), known))
    stay = [*range(PACKET, PACKET + 3), *range(PACKET + 4, 2 * PACKET), *range(3 * PACKET, 4 * PACKET)]
    assert came[:len(stay)].tolist() == stay


@pytest.mark.parametrize("dtype", DTYPES.values(), ids=DTYPES)
def test_hits_are_told_where_they_belong(dtype):
    n, known = 300, np.arange(10, 40)
    wave, room = bounced(*scattered(n), dtype, known), new_wave(n, dtype)
    wave.rays.prim[known], wave.rays.doubt[known] = 77, 1
    m = sort_rays(wave.rays, n, room)
    came = room.owner[:m].copy()
    room.rays.prim[:m], room.rays.ray[T, :m], room.rays.doubt[:m] = came * 3, came * 0.5, came % 2
    tell_hits(wave.rays, room, m)
    columns = np.arange(n)
    met = np.isin(columns, known)
    np.testing.assert_array_equal(wave.rays.prim[:n], np.where(met, 77, columns * 3))
    np.testing.assert_array_equal(wave.rays.ray[T, :n], np.where(met, 3, columns * 0.5))
    np.testing.assert_array_equal(wave.rays.doubt[:n], np.where(met, 1, columns % 2))


NUMBERS = st.floats(width=32) | st.sampled_from([0.0, -0.0, np.inf, -np.inf, np.nan, 3e38, -3e38, 1e-45])


@given(o=arrays(np.float32, (90, 3), elements=NUMBERS), d=arrays(np.float32, (90, 3), elements=NUMBERS), f64=st.booleans())
def test_no_ray_is_lost_whatever_they_are(o, d, f64):
    """Starts all in one point, farther apart than a float, or nowhere."""
    dtype = np.float64 if f64 else np.float32
    check(bounced(o, d, dtype), new_wave(90, dtype), 90, range(90))


# --- in a picture ---

def crowd(n=700) -> Scene:
    """Mirrors and glass over a checkered floor: many bounces, both sorts."""
    rng = np.random.default_rng(4)
    looks = Material(reflection=0.7), Material(reflection=0.2, transmission=0.7, ior=1.4), Material(reflection=0.5, roughness=0.3)
    balls = [Node(shape=Sphere(tuple(rng.uniform(-1, 1, 3)), rng.uniform(0.02, 0.12)), material=looks[i % 3]) for i in range(n)]
    return Scene(objects=(*balls, Node(shape=Plane((0, -1.1, 0), (0, 1, 0)), material=Material(reflection=0.3))),
                 lights=(Point(position=(2, 4, 3)), Directional(direction=(-1, -2, -0.5))), camera=Camera(lookfrom=(0.3, 0.8, 3.2), fov=40))


SIZE = (72, 56)


def frames_of(*scenes, **settings):
    """The last frame of each of these scenes, edits of one another."""
    renderer, result = Renderer(keep=True), []
    try:
        for scene in scenes:
            *_, last = renderer.frames(RenderRequest(scene, scene.camera, Settings(size=SIZE, samples=3, max_depth=6, **settings)),
                                       coarse=False)
            result.append(last)
    finally:
        renderer.close()
    return result


@pytest.mark.parametrize("precision", DTYPES)
@pytest.mark.parametrize("threads", [1, 2])
def test_pictures_have_the_same_bits(precision, threads, monkeypatch):
    scene = crowd()
    (first,) = frames_of(scene, precision=precision, threads=threads)
    monkeypatch.setattr(progressive, "plan", lambda *words, **more: plan(*words, **more)._replace(sorting=False))
    (second,) = frames_of(scene, precision=precision, threads=1)
    assert any(stage == "ray sorting" for stage, _ in first.seconds) and not any(stage == "ray sorting" for stage, _ in second.seconds)
    assert first.rays == second.rays and first.rays["reflection"] > 2000 and first.rays["refraction"] > 500
    assert first.pixels.std() > 0.05 and first.pixels.tobytes() == second.pixels.tobytes()


def test_an_edit_is_sorted_with_what_is_known_left_out(monkeypatch):
    """A sphere goes: rays that did not meet it keep their hits, others are sorted among themselves."""
    scene = crowd()
    less = msgspec.structs.replace(scene, objects=tuple(
        msgspec.structs.replace(node, visible=False) if i % 90 == 7 else node for i, node in enumerate(scene.objects)))
    _, edited = frames_of(scene, less)
    (anew,) = frames_of(less)
    monkeypatch.setattr(progressive, "plan", lambda *words, **more: plan(*words, **more)._replace(sorting=False))
    _, unsorted = frames_of(scene, less)
    assert 0 < edited.rays["reflection"] < anew.rays["reflection"] and edited.rays == unsorted.rays
    assert edited.pixels.tobytes() == anew.pixels.tobytes() == unsorted.pixels.tobytes()


def test_it_is_kept_where_it_is_worth_it():
    assert "ray sorting" in plan(crowd(WORTH), Settings()).stages
    for scene, settings, why in ((crowd(WORTH - 1), {}, "fewer than"), (crowd(WORTH), {"reflections": False}, "no reflected"),
                                 (Scene(objects=[Node(shape=huge_mesh(), material=Material(reflection=0.5))]), {}, "walked singly")):
        composed = plan(scene, Settings(**settings))
        assert why in dict(composed.left_out)["ray sorting"] and "sorting.f64" not in composed.kernels


def huge_mesh() -> rtcore.Mesh:
    u, v = np.meshgrid(np.arange(110.0), np.arange(110.0))
    k = (np.arange(109)[:, None] * 110 + np.arange(109)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + 110], 1), np.stack([k + 1, k + 111, k + 110], 1)])
    return rtcore.Mesh(np.stack([u, v, 0 * u], -1).reshape(-1, 3), faces)
