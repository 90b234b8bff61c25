"""A camera for a scene that brings none."""
from rtcore.bounds import scene_bounds
from rtcore.camera import Camera, frame
from rtcore.scene import Scene

#: From the front, a little from the right and above, y up.
LOOK = Camera(lookfrom=(0.55, 0.4, -1.0), lookat=(0.0, 0.0, 0.0))


def framed(scene: Scene, aspect: float = 1.0) -> Camera:
    """The scene's own camera, or one that has all bounded shapes in view; `aspect` is the picture's width over its height."""
    if scene.camera is not None:
        return scene.camera
    box = scene_bounds(scene)
    return LOOK.at(lookfrom=[5 * x for x in LOOK.lookfrom]) if box is None else frame(LOOK, *box, aspect)
