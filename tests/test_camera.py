"""The camera: the lecture's chain, rays, projection, and the moves of the mouse as pure functions."""
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rtcore.camera import Camera, dolly, fly, frame, orbit, pan
from rtcore.fields import FieldError

numbers = st.floats(-100, 100)
points = st.tuples(numbers, numbers, numbers)
angles = st.floats(-1.2, 1.2)


@st.composite
def cameras(draw, span=None):
    """Any sound camera of moderate size whose up is at least three degrees off the view."""
    eye = np.array(draw(points))
    direction, up = (np.array(draw(points)) for _ in range(2))
    assume(np.linalg.norm(direction) > 1e-3 and np.linalg.norm(up) > 1e-3)
    direction /= np.linalg.norm(direction)
    up /= np.linalg.norm(up)
    assume(abs(up @ direction) < 0.998)
    return Camera(lookfrom=eye, lookat=eye + direction * draw(st.floats(0.1, 100)), up=up, fov=draw(st.floats(1, 170)),
                  span=span or draw(st.sampled_from(["edges", "centers"])))


def eye_of(camera):
    return np.array(camera.lookfrom)


def test_the_exercise_of_the_notes_gives_the_identity():
    chain = Camera(lookfrom=(0, 0, 0), lookat=(0, 0, 1), up=(0, 1, 0), fov=90).chain(640, 480, d=1)
    assert np.array_equal(chain.view_to_world, np.eye(4))
    # T1 takes the middle of the picture to (0, 0, d), where P_world = d w as well
    assert np.allclose(chain.matrix @ [320, 240, 0, 1], [0, 0, 1, 1], atol=1e-15)
    # half the picture's height is tan(fov / 2) = 1 away; x to the right is away from u, which points to the left
    assert np.allclose(chain.matrix @ [320, 480, 0, 1], [0, 1, 1, 1], atol=1e-14)
    assert np.allclose(chain.matrix @ [640, 240, 0, 1], [-4 / 3, 0, 1, 1], atol=1e-14)


@given(cameras(), st.integers(2, 2000), st.integers(2, 2000), st.floats(0.01, 100), st.floats(0, 1), st.floats(0, 1))
def test_the_chain_and_the_rays_agree(camera, nx, ny, d, across, down):
    x, y = across * nx, down * ny
    eye, corner, right, below = camera.rays(nx, ny)
    assert np.array_equal(eye, camera.lookfrom)
    world = camera.chain(nx, ny, d).matrix @ [x, ny - y, 0, 1]
    direction = (corner + x * right + y * below) * d
    assert world[3] == 1
    assert np.allclose(world[:3] - eye, direction, rtol=1e-9, atol=1e-9 * (d + np.abs(eye).max() + np.abs(direction).max()))


@given(cameras())
def test_the_view_basis_is_right_handed_and_of_length_one(camera):
    u, v, w = camera.basis()
    assert np.allclose(camera.basis() @ camera.basis().T, np.eye(3), atol=1e-9)
    assert np.allclose(np.cross(u, v), w, atol=1e-9)
    assert np.allclose(w * camera.distance(), np.subtract(camera.lookat, camera.lookfrom), atol=1e-9)
    assert v @ camera.up > 0        # up is up in the picture
    assert abs(u @ camera.up) < 1e-9


@given(cameras(), st.floats(-20, 20), st.floats(0.1, 50))
def test_up_needs_not_be_at_right_angles(camera, lean, length):
    _, v, w = camera.basis()
    assert np.allclose(camera.at(up=(v + lean * w) * length).basis(), camera.basis(), atol=1e-6)


@given(cameras(), st.integers(2, 2000), st.integers(2, 2000))
def test_fov_is_vertical_and_spans_what_span_says(camera, nx, ny):
    _, corner, right, below = camera.rays(nx, ny)
    inset = 0.5 if camera.span == "centers" else 0.0
    top, bottom = (corner + nx / 2 * right + y * below for y in (inset, ny - inset))
    cosine = top @ bottom / np.linalg.norm(top) / np.linalg.norm(bottom)
    assert math.isclose(math.degrees(math.acos(np.clip(cosine, -1, 1))), camera.fov, rel_tol=1e-6)
    assert math.isclose(np.linalg.norm(right), np.linalg.norm(below), rel_tol=1e-9)   # pixels are square
    assert abs(right @ below) < 1e-9 * np.linalg.norm(right) ** 2


@given(cameras(), st.floats(0, 1), st.floats(0, 1), st.floats(0.01, 100))
def test_projection_undoes_the_rays(camera, across, down, t):
    nx, ny = 640, 480
    x, y = across * nx, down * ny
    eye, corner, right, below = camera.rays(nx, ny)
    direction = corner + x * right + y * below
    assert camera.project(eye + t * direction, nx, ny) == pytest.approx((x, y), abs=1e-3)
    assert camera.project(eye - t * direction, nx, ny) is None


@given(cameras())
def test_lookat_is_the_middle_of_the_picture(camera):
    assert camera.project(camera.lookat, 101, 57) == pytest.approx((50.5, 28.5), abs=1e-6)


@given(cameras(), angles, angles, st.none() | points)
def test_orbit_keeps_the_distance_and_can_be_undone(camera, right, up, pivot):
    center = np.array(camera.lookat if pivot is None else pivot)
    there = orbit(camera, right, up, pivot)
    radius = np.linalg.norm(eye_of(camera) - center)
    assert math.isclose(np.linalg.norm(eye_of(there) - center), radius, rel_tol=1e-9, abs_tol=1e-9)
    assert math.isclose(there.distance(), camera.distance(), rel_tol=1e-9)
    pole = np.array(camera.up) / np.linalg.norm(camera.up)
    assume(math.cos(math.radians(1.1)) > abs(there.basis()[2] @ pole))     # it did not stop short of a pole
    back = orbit(there, -right, -up, pivot)
    assert np.allclose(back.lookfrom, camera.lookfrom, atol=1e-6)
    assert np.allclose(back.lookat, camera.lookat, atol=1e-6)


def test_orbit_lets_the_content_follow_the_mouse():
    camera = Camera(lookfrom=(0, 0, -5), lookat=(0, 0, 0))
    before = camera.project((0, 0, -1), 100, 100)          # a point of the near side
    assert orbit(camera, 0.1, 0).project((0, 0, -1), 100, 100)[0] > before[0] + 1
    assert orbit(camera, 0, 0.1).project((0, 0, -1), 100, 100)[1] < before[1] - 1


@given(cameras(), angles, st.sampled_from([-10.0, -0.3, 0.3, 10.0]))
def test_orbit_stops_short_of_the_poles(camera, right, up):
    pole = np.array(camera.up) / np.linalg.norm(camera.up)
    for _ in range(12):
        camera = orbit(camera, right, up)       # a degenerate camera would raise
    angle = math.degrees(math.acos(np.clip(camera.basis()[2] @ pole, -1, 1)))
    assert 0.99 < angle < 179.01
    _, v, _ = camera.basis()
    assert v @ pole > 0                         # never upside down


@given(cameras("edges"), st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 1), st.floats(0, 1))
def test_pan_carries_the_content_with_the_cursor(camera, right, up, across, down):
    nx, ny = 640, 480
    eye, corner, step, below = camera.rays(nx, ny)
    x, y = across * nx, down * ny
    point = eye + (corner + x * step + y * below) * camera.distance()      # under the cursor, as deep as lookat
    moved = pan(camera, right, up)
    assert moved.project(point, nx, ny) == pytest.approx((x + right * ny, y - up * ny), abs=1e-3)
    assert np.allclose(moved.basis(), camera.basis(), atol=1e-6)


@given(cameras(), st.floats(0.2, 5), st.floats(0, 1), st.floats(0, 1), st.floats(0.2, 50))
def test_dolly_keeps_what_is_under_the_cursor(camera, factor, across, down, t):
    nx, ny = 640, 480
    eye, corner, right, below = camera.rays(nx, ny)
    x, y = across * nx, down * ny
    point = eye + t * (corner + x * right + y * below)
    nearer = dolly(camera, factor, point)
    assert nearer.project(point, nx, ny) == pytest.approx((x, y), abs=1e-3)
    assert math.isclose(math.dist(nearer.lookfrom, point), factor * math.dist(camera.lookfrom, point), rel_tol=1e-6)
    assert np.allclose(dolly(camera, factor).lookat, camera.lookat, atol=1e-12)


@given(cameras(), numbers, numbers, numbers)
def test_flying_moves_along_the_views_axes(camera, right, up, forward):
    u, v, w = camera.basis()
    moved = fly(camera, right, up, forward)
    shift = eye_of(moved) - eye_of(camera)
    assert np.allclose([-u @ shift, v @ shift, w @ shift], [right, up, forward], atol=1e-9)
    assert np.allclose(np.subtract(moved.lookat, camera.lookat), shift, atol=1e-9)


@given(cameras("edges"), points, st.tuples(*[st.floats(1e-3, 50)] * 3), st.floats(0.2, 4))
def test_frame_holds_the_whole_box(camera, low, size, aspect):
    high = np.add(low, size)
    framed = frame(camera, low, high, aspect)
    nx, ny = 1000 * aspect, 1000
    for corner in np.array(np.meshgrid(*zip(low, high))).reshape(3, -1).T:
        x, y = framed.project(corner, nx, ny)
        assert 0 <= x <= nx and 0 <= y <= ny
    assert np.allclose(framed.basis(), camera.basis(), atol=1e-6)
    assert framed.fov == camera.fov


@pytest.mark.parametrize("place", [0.0, 1.0, 1e9])
def test_frame_of_a_single_point_gives_a_sound_camera(place):
    framed = frame(Camera(), (place,) * 3, (place,) * 3)
    assert framed.lookat == (place,) * 3
    assert framed.distance() > 0


@pytest.mark.parametrize(("words", "path", "expected"), [
    ({"lookat": (0, 0, -5)}, "lookat", "other than lookfrom"),
    ({"up": (0, 0, 3)}, "up", "not parallel"),
    ({"up": (0, 0, -1e-9)}, "up", "not parallel"),
    ({"up": (0, 0, 0)}, "up", "not zero"),
    ({"fov": 0}, "fov", "greater than 0 and less than 180"),
    ({"fov": 180}, "fov", "greater than 0 and less than 180"),
    ({"fov": -40}, "fov", "greater than 0"),
    ({"fov": math.nan}, "fov", "a number"),
    ({"fov": "wide"}, "fov", "a number"),
    ({"lookfrom": (0, math.inf, 0)}, "lookfrom", "three finite numbers"),
    ({"lookfrom": (0, 0)}, "lookfrom", "three finite numbers"),
    ({"lookfrom": (-1.7e308, 0, 0), "lookat": (1.7e308, 0, 0)}, "lookat", "a point"),
    ({"span": "rows"}, "span", "edges, centers"),
])
def test_degenerate_cameras_are_refused(words, path, expected):
    with pytest.raises(FieldError) as refusal:
        Camera().at(**words)
    assert refusal.value.path == path
    assert expected in str(refusal.value)


@pytest.mark.parametrize("size", [1e-300, 1e-9, 1.0, 1e9, 1e150])
def test_cameras_of_any_size_are_sound(size):
    camera = Camera(lookfrom=(0, 0, -size), lookat=(0, 0, 0), up=(0, size, size))
    assert np.allclose(camera.basis(), np.eye(3), atol=1e-15)
