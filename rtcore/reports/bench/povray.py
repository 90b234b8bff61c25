"""A scene as POV-Ray reads it: the same shapes, camera, lights and chains of rays, so that its time can be compared with ours.

Colours are carried over as they are, highlights only about: the picture is the same in what is hit, mirrored, seen through and shadowed.
"""
from collections.abc import Iterable, Iterator

import numpy as np

from rtcore.camera import Camera
from rtcore.lights import SAMPLED, Ambient, Point
from rtcore.leaves import Leaf
from rtcore.scene import Light, Material, Scene, Shape
from rtcore.shapes import Box, Cone, Cylinder, Mesh, Plane, Polygon, Sphere, Torus, Triangle


class Untold(ValueError):
    """The scene holds something that is not handed over."""


def povray_text(scene: Scene, camera: Camera, size: tuple[int, int], depth: int) -> str:
    """The scene as the text of a .pov file. Raises Untold for what is not handed over: some shapes, lights with an extent, a lens, rough
    mirrors and glass."""
    if camera.aperture > 0:
        raise Untold("a lens is not handed over")
    width, height = size
    eye, corner, right, down = camera.rays(width, height)
    right, down = width * right, height * down
    parts = ["#version 3.7;", f"global_settings {{ assumed_gamma 1 max_trace_level {depth} }}",
             f"camera {{ perspective location {vector(eye)} direction {vector(corner + right / 2 + down / 2)} "
             f"right {vector(right)} up {vector(-down)} }}", f"background {{ rgb {vector(scene.background.color)} }}"]
    ambient = np.zeros(3)
    for light in scene.lights or ():
        if isinstance(light, Ambient):
            ambient += light.on * light.intensity * np.array(light.color)
        elif light.on:
            parts.append(_light(light, eye))
    names: dict[Material, str] = {}
    for leaf in scene.leaves():
        if leaf.visible:
            if leaf.material not in names:
                names[leaf.material] = f"M{len(names)}"
                parts.append(f"#declare {names[leaf.material]} = {_material(leaf.material, ambient)}")
            parts += _objects(leaf, f"material {{ {names[leaf.material]} }}")
    return "\n".join(parts) + "\n"


def vector(numbers: Iterable[float]) -> str:
    """In POV-Ray's spelling, with every digit."""
    return "<" + ", ".join(repr(float(x)) for x in numbers) + ">"


def _light(light: Light, eye: np.ndarray) -> str:
    if isinstance(light, SAMPLED):
        raise Untold(f"{type(light).__name__} is no light that is handed over")
    color = vector(light.intensity * np.array(light.color))
    if isinstance(light, Point):
        fade = " fade_distance 1 fade_power 2" if light.falloff == "inverse-square" else ""
        return f"light_source {{ {vector(light.position)} rgb {color}{fade} }}"
    toward = light.numbers() * 1e6
    return f"light_source {{ {vector(eye + toward)} rgb {color} parallel point_at {vector(eye)} }}"


def _material(material: Material, ambient: np.ndarray) -> str:
    if material.roughness > 0 and (material.reflection > 0 or material.transmission > 0):
        raise Untold("a rough mirror or glass is not handed over")
    if material.checker is None:
        pigment = f"rgb {vector(material.color)} filter {material.transmission!r}"
    else:
        even, odd = (f"rgb {vector(color)}" for color in (material.checker.even, material.checker.odd))
        pigment = f"checker {even}, {odd} scale {material.checker.size!r}"
    finish = (f"ambient {vector(material.ambient * ambient)} diffuse {material.diffuse!r} phong {material.specular!r} "
              f"phong_size {material.shininess / 4!r} reflection {material.reflection!r}")
    return f"material {{ texture {{ pigment {{ {pigment} }} finish {{ {finish} }} }} interior {{ ior {material.ior!r} }} }}"


def _objects(leaf: Leaf, material: str) -> Iterator[str]:
    """A leaf as objects of POV-Ray's."""
    spell = SPELLINGS.get(type(leaf.shape))
    if spell is None:
        raise Untold(f"{type(leaf.shape).__name__} is no shape that is handed over")
    placed = "" if np.array_equal(leaf.matrix, np.eye(4)) else f" matrix {vector(leaf.matrix[:3].T.ravel())}"
    for text in spell(leaf.shape):
        yield f"{text}{material}{placed} }}"


# --- shapes: a text that its modifiers and a closing brace are to follow ---

def _sphere(shape: Sphere) -> Iterator[str]:
    yield f"sphere {{ {vector(shape.center)}, {shape.radius!r} "


def _plane(shape: Plane) -> Iterator[str]:
    normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
    yield f"plane {{ {vector(normal)}, {float(normal @ shape.point)!r} "


def _triangle(shape: Triangle) -> Iterator[str]:
    yield from _triangles(np.array([[shape.a, shape.b, shape.c]]), None if shape.normals is None else np.array([shape.normals]))


def _mesh(shape: Mesh) -> Iterator[str]:
    yield from _triangles(shape.vertices[shape.faces], None if shape.normals is None else shape.normals[shape.faces])


def _triangles(corners: np.ndarray, normals: np.ndarray | None) -> Iterator[str]:
    if normals is None:
        for three in corners:
            yield f"triangle {{ {', '.join(map(vector, three))} "
    else:
        for three, upright in zip(corners, normals):
            yield f"smooth_triangle {{ {', '.join(f'{vector(p)}, {vector(n)}' for p, n in zip(three, upright))} "


def _polygon(shape: Polygon) -> Iterator[str]:
    closed = (*shape.vertices, shape.vertices[0])
    yield f"polygon {{ {len(closed)}, {', '.join(map(vector, closed))} "


def _box(shape: Box) -> Iterator[str]:
    yield f"box {{ {vector(shape.low)}, {vector(shape.high)} "


def _tube(shape: Cone | Cylinder) -> Iterator[str]:
    ends = (shape.radius, shape.radius) if isinstance(shape, Cylinder) else (shape.base_radius, shape.apex_radius)
    yield f"cone {{ {vector(shape.base)}, {ends[0]!r}, {vector(shape.apex)}, {ends[1]!r} {'' if shape.capped else 'open '}"


def _torus(shape: Torus) -> Iterator[str]:
    turned = np.eye(4)[[0, 2, 1, 3]]        # POV-Ray's lies around y, ours around z
    yield f"torus {{ {shape.major_radius!r}, {shape.minor_radius!r} matrix {vector(turned[:3].T.ravel())} "


SPELLINGS: dict[type[Shape], object] = {Sphere: _sphere, Plane: _plane, Triangle: _triangle, Mesh: _mesh, Polygon: _polygon, Box: _box,
                                        Cylinder: _tube, Cone: _tube, Torus: _torus}
