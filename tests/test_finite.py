"""No picture of a gallery scene has a pixel that is not finite: from afar, from close up, from inside of things and from their surface."""
import numpy as np
import pytest

import resources
import rtcore
from rtcore.bounds import leaf_bounds, scene_bounds
from rtcore.camera import Camera, dolly, unit
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings

SIZE = 48, 32
GALLERY = sorted((resources.ROOT / "scenes").glob("*.yaml"))
FAR = 1e4       # sizes of the scene
LOOKS = np.array([(0.5, 0.5), (0.3, 0.4), (0.72, 0.61), (0.45, 0.85)])     # parts of the picture's width and height


def looking(eye, way) -> Camera:
    """A camera at `eye` that looks along `way`, any direction."""
    way = unit(np.array(way, float))
    up = (0, 1, 0) if abs(way[1]) < 0.9 else (1, 0, 0)
    return Camera(lookfrom=eye, lookat=np.array(eye) + way, up=up, fov=70)


def cameras(scene: rtcore.Scene):
    """Name and camera of every view."""
    home = scene.camera
    yield "home", home
    low, high = scene_bounds(scene)
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    away = unit(np.subtract(home.lookfrom, home.lookat))
    for fov in (40.0, np.degrees(2 / FAR)):
        yield "far", Camera(lookfrom=middle + away * FAR * size, lookat=middle, up=home.up, fov=fov)

    eye, corner, right, down = home.rays(*SIZE)
    ways = corner + LOOKS[:, :1] * SIZE[0] * right + LOOKS[:, 1:] * SIZE[1] * down
    hits = rtcore.intersect(scene, np.tile(eye, (len(ways), 1)), ways)
    seen = np.isfinite(hits.t)
    for way, t, normal in zip(ways[seen], hits.t[seen], hits.normal[seen]):
        point = eye + t * way
        for distance in (1e-3, 1e-9):
            yield "near", dolly(home.at(lookat=point), distance)
        aside = np.cross(normal, way)
        for look in (normal, -normal, aside if aside.any() else normal, way):
            yield "on the surface", looking(point, look)

    known = set()
    for leaf in scene.leaves():
        box = leaf_bounds(leaf)
        if box is not None and type(leaf.shape) not in known:
            known.add(type(leaf.shape))
            for look in ((0.3, -1, 0.2), np.subtract(home.lookfrom, box[0]), (0, 0, -1)):
                yield f"inside a {type(leaf.shape).__name__}", looking((box[0] + box[1]) / 2, look)


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_every_pixel_is_finite(path, precision):
    scene, settings = rtcore.load(path), Settings(size=SIZE, samples=1, precision=precision)
    renderer, bad, views = Renderer(), [], 0
    try:
        for name, camera in cameras(scene):
            *_, frame = renderer.frames(RenderRequest(scene, camera, settings), coarse=False)
            views += 1
            if renderer.stats()["nonfinite_pixels"] or not np.isfinite(frame.pixels).all():
                bad.append((name, camera))
    finally:
        renderer.close()
    assert not bad
    assert views > 12
