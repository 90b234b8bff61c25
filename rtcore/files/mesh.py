"""Mesh files (.obj .ply .stl .glb .gltf .off) as scenes: framed, lit and ready to be looked at."""
import math
import os

import numpy as np

from rtcore.camera import Camera, frame
from rtcore.fields import FieldError, Vec
from rtcore.files._errors import FileError
from rtcore.files._meshes import Part, joined, made, read_parts
from rtcore.lights import Ambient, Directional
from rtcore.scene import Background, Material, Matrix, Node, Scene
from rtcore.shapes import Mesh

AIR = 0.88      # the part of the picture that the model fills
PLASTER = Material(color=(0.62, 0.60, 0.57), specular=0.15, shininess=30.0, note="for what the file gives no material")
BACKDROP = Background(color=(0.40, 0.42, 0.45), top=(0.70, 0.74, 0.80))

#: Directions from the middle of the model to the eye, a three-quarter view from a little above, and up. By custom, models of
#: most formats stand in a world with y up and face z; those for printing (.stl) with z up, facing -y.
Y_UP = (0.55, 0.42, 1.0), (0.0, 1.0, 0.0)
Z_UP = (0.55, -1.0, 0.42), (0.0, 0.0, 1.0)


def load(path: str | os.PathLike) -> Scene:
    """The meshes of a file, each a node under the name it has there; FileError, in one line, if anything is wrong."""
    found = read_parts(path)
    stem, suffix = os.path.splitext(os.path.basename(path))
    whole = os.path.abspath(path)
    materials: dict[str, Material] = {}
    shapes: dict[int, Mesh] = {}        # by id of the vertices: a mesh that stands in several places is one
    several = len(found.parts) > 1 or found.parts[0].matrix is not None
    try:
        nodes = []
        for i, part in enumerate(found.parts):
            if id(part.vertices) not in shapes:
                shapes[id(part.vertices)] = made(f"{whole}#{i}" if several else whole, *part[1:4])
            nodes.append(_node(part, shapes[id(part.vertices)], part.name if len(found.parts) > 1 else stem, materials))
        vertices, faces, _ = joined(found.parts)
        seen = vertices[np.unique(faces)]
        camera, lights = _studio(seen, *(Z_UP if suffix.lower() == ".stl" else Y_UP))
        objects = nodes if len(nodes) == 1 else [Node(name=stem, children=tuple(nodes))]
        return Scene(objects=tuple(objects), camera=camera, lights=lights, background=BACKDROP, materials=materials, name=stem,
                     note=_note(found))
    except FieldError as error:
        raise FileError.of(path, error) from None


def _node(part: Part, shape: Mesh, name: str, materials: dict[str, Material]) -> Node:
    """A part as a node; its material goes into `materials` under a name of its own."""
    name_of_look, look = part.look or ("plaster", PLASTER)
    key, number = name_of_look, 2
    while materials.setdefault(key, look) != look:
        key, number = f"{name_of_look} {number}", number + 1
    return Node(name=name, shape=shape, material=key, note=counted(part.dropped, "degenerate triangle"),
                transform=() if part.matrix is None else (Matrix(part.matrix.tolist()),))


def counted(count: int, what: str) -> str:
    """``12 degenerate triangles left out``, or nothing."""
    return f"{count:,} {what}{'s' if count > 1 else ''} left out" if count else ""


def _note(found) -> str:
    """What is not as the file has it."""
    missing = sorted(set(found.missing))
    return "; ".join(filter(None, (counted(found.empty, "part without extent"), "not found: " + ", ".join(missing) if missing else "")))


def _studio(points: np.ndarray, toward: Vec, up: Vec) -> tuple[Camera, tuple]:
    """A camera that shows the points (N, 3) from the direction `toward`, and lights that stand around that eye: a key light
    from the left and above, a weaker one from the right, and a soft one from everywhere."""
    camera = frame(Camera(lookfrom=toward, lookat=(0.0, 0.0, 0.0), up=up, fov=35.0), points.min(axis=0), points.max(axis=0))
    left, above, ahead = camera.basis()
    key, fill = (np.round(way, 3).tolist() for way in (ahead - 0.9 * above - 0.7 * left, ahead - 0.1 * above + 1.1 * left))
    return _closer(camera, points), (Directional(direction=key, intensity=0.85, name="key"),
                                     Directional(direction=fill, color=(0.85, 0.9, 1.0), intensity=0.25, name="fill"),
                                     Ambient(intensity=0.2, name="ambient"))


def _closer(camera: Camera, points: np.ndarray) -> Camera:
    """The camera moved along its view until the points just fit a square picture, with a little air: the box around them, by
    which it was framed, is mostly empty."""
    left, above, ahead = camera.basis()
    offset = points - np.array(camera.lookat)
    aside = np.maximum(np.abs(offset @ left), np.abs(offset @ above))
    distance = float((aside / (AIR * math.tan(math.radians(camera.fov) / 2)) - offset @ ahead).max())
    if not 0 < distance < camera.distance():
        return camera
    return camera.at(lookfrom=np.array(camera.lookat) - ahead * distance)
