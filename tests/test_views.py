"""Views that are worked out from first hits when they are asked for: against counts, weights and lights found another way; a switch to
them traces nothing."""
import numpy as np
import pytest

import rtcore
from rtcore import Box, Camera, Directional, Material, Mesh, Node, Plane, Point, Rotate, Scene, Sphere, Translate
from rtcore.bvh import LINK, NODE, leaf_range
from rtcore.flatten import flatten
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings
from rtcore.views import VIEWS
from rtcore.views.cost import WHITE
from rtcore.views.shadow import SHADE
from rtcore.views.view import heat

CAMERA = Camera(lookfrom=(0.5, 1, -6), lookat=(0, 0, 0), fov=40)
SIZE = (32, 24)
MANY = Scene(camera=CAMERA, objects=[
    Plane((0, -1, 0), (0, 1, 0)), Box((-0.3, -0.9, -2), (0.4, -0.5, -1.2)),
    *(Sphere((x, y, z), 0.35) for x in np.arange(-3.5, 4) for y in (-0.5, 0.5, 1.5) for z in np.arange(5.0))])


def last_frame(renderer: Renderer, scene: Scene, **settings):
    *_, frame = renderer.frames(RenderRequest(scene, scene.camera, Settings(size=SIZE, **settings)), coarse=True)
    return frame


@pytest.fixture
def renderer():
    made = Renderer()
    yield made
    made.close()


def centre_rays(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The eye, and the directions (h, w, 3) through the pixels' centres."""
    eye, corner, right, down = camera.rays(*SIZE)
    y, x = np.mgrid[:SIZE[1], :SIZE[0]] + 0.5
    d = corner + x[..., None] * right + y[..., None] * down
    return eye, d / np.linalg.norm(d, axis=2, keepdims=True)


def counted(geometry, eye, d, t) -> int:
    """Boxes and primitives to be tested for one ray that ends at t, box by box and in plain numbers."""
    tests = 0
    for group in geometry.groups:
        tree = group.tree
        todo = [0] if len(tree.link) else []
        tests += 0 if todo else len(group.owner)
        while todo:
            row = NODE * todo.pop()
            for column in range(8):
                low, high = tree.box[row:row + 3, column].astype(float), tree.box[row + 3:row + 6, column].astype(float)
                if low[0] > high[0]:
                    continue
                tests += 1
                planes = np.sort([(face / tree.frame[3] + tree.frame[:3] - eye) / d for face in (low, high)], axis=0)
                if max(planes[0].max(), 0) <= min(planes[1].min(), t):
                    link = int(tree.link[row + LINK, column])
                    if link >= 0:
                        todo.append(link)
                    else:
                        first, last = leaf_range(link)
                        tests += last - first
    return tests


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_cost_is_what_an_independent_walk_counts(renderer, precision):
    frame = last_frame(renderer, MANY, view="cost", precision=precision)
    eye, d = centre_rays(CAMERA)
    geometry = flatten(MANY, precision)
    # a distance is kept in float32
    t = frame.distance * (1 + 1e-6)
    expected = np.array([[counted(geometry, eye, d[y, x], t[y, x]) for x in range(SIZE[0])] for y in range(SIZE[1])])
    assert expected.min() >= 6 and expected.max() > 2 * expected.min()      # root's boxes, box and plane at the least
    assert np.allclose(frame.pixels, heat(np.log2(1.0 + expected) / np.log2(WHITE)), atol=1e-6)
    assert (renderer._render.recast.tests(renderer._render.film).reshape(expected.shape) == expected).all()


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_barycentrics_are_those_of_the_hit_points(renderer, precision):
    corners = np.array([(-2, -1, 0), (2, -1.5, 1), (0.3, 2, 2)])
    scene = Scene(camera=CAMERA, objects=[Mesh(corners, [(0, 1, 2)])])
    frame = last_frame(renderer, scene, view="barycentrics", precision=precision)
    eye, d = centre_rays(CAMERA)
    hit = frame.node >= 0
    points = eye + d * np.where(hit, frame.distance, 0)[..., None]
    points[..., 2] = 1      # seen along z: weights that add up to 1
    weights = np.linalg.solve(np.array([*corners.T[:2], np.ones(3)]), points[..., None])
    assert 50 < hit.sum() < hit.size and (frame.pixels[~hit] == 0).all()
    assert np.allclose(np.sqrt(frame.pixels[hit]), weights[hit, :, 0].clip(0, 1), atol=2e-3)


def test_other_shapes_show_their_texture_coordinates(renderer):
    frame = last_frame(renderer, MANY, view="barycentrics")
    eye, d = centre_rays(CAMERA)
    expected = rtcore.intersect(MANY, np.broadcast_to(eye, (d.size // 3, 3)), d.reshape(-1, 3)).uv.reshape(*frame.node.shape, 2) % 1
    away = np.abs(np.sqrt(frame.pixels[..., :2]) - expected)
    assert np.minimum(away, 1 - away).max() < 1e-3 and (frame.pixels[..., 2] == 0).all() and frame.pixels.max() > 0.9


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_shadow_is_the_share_of_the_lights_that_reach_the_hit(renderer, precision):
    lights = [Point(position=(-3, 5, -4), intensity=30), Directional(direction=(0, -1, 0)), Point(position=(4, 3, -3))]
    glass = Node(shape=Sphere((0, 1.4, 0), 0.5), material=Material(transmission=0.5))
    scene = Scene(camera=CAMERA, objects=[*MANY.objects, glass], lights=lights)
    frame = last_frame(renderer, scene, view="shadow", precision=precision, samples=3)
    eye, d = centre_rays(CAMERA)
    hits = rtcore.intersect(scene, np.broadcast_to(eye, (d.size // 3, 3)), d.reshape(-1, 3))
    hit = np.isfinite(hits.t)
    points = eye + d.reshape(-1, 3)[hit] * hits.t[hit, None]
    normals = hits.normal[hit] * -np.sign((hits.normal[hit] * d.reshape(-1, 3)[hit]).sum(1, keepdims=True))
    reached = np.zeros(hit.sum())
    opaque = Scene(camera=CAMERA, objects=MANY.objects)
    for light in lights:
        to = np.broadcast_to(-np.array(light.direction), points.shape) if isinstance(light, Directional) else light.position - points
        far = np.inf if isinstance(light, Directional) else 1.0
        start = points + 1e-6 * normals
        blocked = rtcore.occluded(opaque, start, to, far)
        through = rtcore.occluded(Scene(objects=[glass]), start, to, far)
        reached += ((normals * to).sum(1) > 0) * ~blocked * np.where(through, 0.5, 1)
    expected = np.zeros((hit.size, 3))
    expected[hit] = SHADE + reached[:, None] / 3 * (1 - SHADE)
    assert set(np.unique(reached)) > {0, 1, 2, 3} and hit.mean() < 1
    assert (np.abs(frame.pixels.reshape(-1, 3) - expected).max(1) < 1e-3).mean() > 0.99      # but at the edges of shadows


@pytest.mark.parametrize("view", [view.name for view in VIEWS])
def test_a_switch_traces_nothing_and_shows_the_same(renderer, view):
    scene = Scene(camera=CAMERA, objects=[*MANY.objects, Node(shape=Box((-1, -1, -1), (1, 1, 1)), transform=[
        Rotate((0, 1, 0), 30), Translate((3, 0, 2))])])
    beauty = last_frame(renderer, scene, samples=2)
    switched = last_frame(renderer, scene, samples=2, view=view)
    assert switched.rays == beauty.rays and switched.done
    alone = Renderer()
    assert np.array_equal(switched.pixels, last_frame(alone, scene, samples=2, view=view).pixels)
    alone.close()
    assert np.array_equal(last_frame(renderer, scene, samples=2).pixels, beauty.pixels)


def test_a_picture_notes_lights_only_if_they_are_asked_for():
    renderer = Renderer()
    for coarse, view, noted in ((False, "beauty", False), (True, "beauty", True), (False, "shadow", True)):
        settings = Settings(size=(16, 8), samples=1, view=view, seed=int(noted))
        *_, frame = renderer.frames(RenderRequest(MANY, CAMERA, settings), coarse=coarse)
        assert (len(renderer._render.film.lit) > 0) == noted and frame.done
    renderer.close()


@pytest.mark.parametrize("view", [view.name for view in VIEWS])
def test_a_picture_alone_is_the_same(renderer, view):
    settings = Settings(size=SIZE, samples=2, view=view)
    *_, whole = renderer.frames(RenderRequest(MANY, CAMERA, settings), coarse=False)
    alone = Renderer()
    *_, frame = alone.frames(RenderRequest(MANY, CAMERA, settings, hits=False), coarse=False)
    assert np.array_equal(frame.pixels, whole.pixels) and frame.rays == whole.rays
    left_out = {entry["stage"]: entry["why"] for entry in alone.stats()["left_out"]}
    if view in ("beauty", "samples", "error"):
        assert frame.node is None and frame.distance is None and left_out["first hits on the film"] == "only the picture was asked for"
        assert frame.held["film"] < whole.held["film"]
    else:       # it is drawn from them
        assert np.array_equal(frame.node, whole.node) and "first hits on the film" not in left_out
    alone.close()


def test_after_a_picture_alone_first_hits_are_to_be_had():
    renderer, settings = Renderer(), Settings(size=SIZE, samples=2)
    *_, alone = renderer.frames(RenderRequest(MANY, CAMERA, settings, hits=False), coarse=False)
    *_, more = renderer.frames(RenderRequest(MANY, CAMERA, settings), coarse=False)
    assert alone.node is None and (more.node >= 0).any() and np.isfinite(more.distance[more.node >= 0]).all()
    assert np.array_equal(more.pixels, alone.pixels)
    *_, depth = renderer.frames(RenderRequest(MANY, CAMERA, Settings(size=SIZE, samples=2, view="depth"), hits=False), coarse=False)
    fresh = Renderer()
    *_, expected = fresh.frames(RenderRequest(MANY, CAMERA, Settings(size=SIZE, samples=2, view="depth")), coarse=False)
    assert np.array_equal(depth.pixels, expected.pixels)
    fresh.close()
    renderer.close()
