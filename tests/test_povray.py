"""Against POV-Ray: the same numbers give the same hits, but for pixels on the outline, where the last digit decides."""
import itertools
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from PIL import Image

import rtcore
from rtcore import Blob, Camera, Implicit, Material, Node, Polyhedron, Quadric, Rotate, Scale, Scene, Shear, Torus, Translate

pytestmark = pytest.mark.skipif(shutil.which("povray") is None, reason="POV-Ray is not installed")

SIZE = 200, 150
OPTIONS = (f"+W{SIZE[0]}", f"+H{SIZE[1]}", "+FN8", "+WT1", "-A", "-J", "-D", "-P", "-GA")

HEAD = """#version 3.7;
global_settings {{ assumed_gamma 1 max_trace_level 2 }}
camera {{ perspective location {eye} direction {ahead} right {right} up {up} }}
"""
LIGHT = "pigment { rgb 1 } finish { emission 1 ambient 0 diffuse 0 }"
WHITE = Material(diffuse=0, emission=(1, 1, 1))

VIEWS = {"from the side": Camera(lookfrom=(0.3, -4.2, 0.6), lookat=(0.0, 0.0, 0.1), up=(0, 0, 1), fov=44),
         "oblique": Camera(lookfrom=(2.1, 2.3, 2.9), lookat=(0.1, -0.1, 0.0), up=(0.2, 0.1, 1), fov=40),
         "from afar": Camera(lookfrom=(-300.0, 180.0, 240.0), lookat=(0.0, 0.0, 0.0), up=(0, 1, 0), fov=0.45),
         "close": Camera(lookfrom=(1.45, 0.9, 0.75), lookat=(0.2, 0.1, 0.1), up=(0, 0, 1), fov=75)}
BENT = Scale((1.2, 0.7, 0.9)), Shear(xy=0.4, yz=-0.25), Rotate((1, 2, -1), 50), Translate((0.2, 0.1, -0.15))
TRANSFORMS = {"as it is": (), "bent, turned and moved": BENT}


def vector(numbers) -> str:
    """In POV-Ray's spelling, with every digit."""
    return "<" + ", ".join(repr(float(x)) for x in numbers) + ">"


def matrix(columns: np.ndarray) -> str:
    """Our 4 x 4, which stands before a column, as POV-Ray's, which stands behind a row."""
    return f"matrix {vector(columns[:3].T.ravel())}"


def torus(shape: Torus) -> str:
    turned = np.eye(4)[[0, 2, 1, 3]]        # POV-Ray's lies around y, ours around z
    return f"torus {{ {shape.major_radius!r}, {shape.minor_radius!r} sturm {matrix(turned)} "


def blob(shape: Blob) -> str:
    parts = " ".join(f"sphere {{ {vector(center)}, {radius!r}, {strength!r} }}" for center, radius, strength in shape.elements)
    return f"blob {{ threshold {shape.threshold!r} {parts} sturm "


def quadric(shape: Quadric) -> str:
    c = shape.coefficients
    cut = f"clipped_by {{ box {{ {vector(shape.low)}, {vector(shape.high)} }} }} " if shape.low else ""
    return f"quadric {{ {vector(c[0:3])}, {vector(c[3:6])}, {vector(c[6:9])}, {c[9]!r} {cut}"


def polyhedron(shape: Polyhedron) -> str:
    planes = ""
    for point, normal in shape.planes:
        unit = np.array(normal) / np.linalg.norm(normal)
        planes += f"plane {{ {vector(unit)}, {float(unit @ point)!r} }} "
    return f"intersection {{ {planes}"


def cut_cube() -> Polyhedron:
    """A cube with its corners cut off."""
    axes = [(axis, axis) for axis in (0.95 * np.concatenate([np.eye(3), -np.eye(3)])).tolist()]
    corners = [((0.5 * np.array(c)).tolist(), c) for c in np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T.tolist()]
    return Polyhedron(planes=[*axes, *corners])


def isosurface(shape: Implicit) -> str:
    function = re.sub(r"(\w)\^(\d)", r"pow(\1, \2)", shape.expression)
    box = f"box {{ {vector(shape.low)}, {vector(shape.high)} }}"
    return (f"isosurface {{ function {{ {function} }} threshold 0 contained_by {{ {box} }} accuracy 1e-8 max_gradient 40 "
            "all_intersections open ")


WIDE = {"low": (-1.2, -1.2, -1.2), "high": (1.2, 1.2, 1.2)}
CASES = {
    "torus": (torus, Torus(major_radius=1.0, minor_radius=0.25)),
    "thin torus": (torus, Torus(major_radius=1.2, minor_radius=0.06)),
    "spindle": (torus, Torus(major_radius=0.5, minor_radius=0.7)),
    "blob": (blob, Blob(elements=(((-0.6, 0, 0), 1.1, 1.0), ((0.6, 0.1, 0.2), 1.0, 1.2), ((0.1, 0.5, 0.4), 0.8, -0.9)), threshold=0.4)),
    "hyperboloid": (quadric, Quadric(coefficients=(1, 1, -0.8, 0, 0, 0, 0, 0, 0, -0.15), low=(-1.1, -1.2, -1), high=(1.2, 1.1, 1))),
    "ellipsoid with all terms": (quadric, Quadric(coefficients=(1.1, 1.6, 0.9, 0.5, -0.3, 0.4, 0.1, -0.2, 0.15, -0.8))),
    "saddle": (quadric, Quadric(coefficients=(1, -1, 0, 0, 0, 0, 0, 0, -1, 0), low=(-1, -1, -0.6), high=(1, 1, 0.7))),
    "cube without corners": (polyhedron, cut_cube()),
    "quartic with holes": (isosurface, Implicit(expression="x^4 + y^4 + z^4 - 1.1*(x^2 + y^2 + z^2) + 0.45", **WIDE)),
    "waves": (isosurface, Implicit(expression="z - 0.3*sin(4*x)*cos(3*y)", **WIDE)),
}


def our_mask(node: Node, camera: Camera, precision: str) -> np.ndarray:
    """(h, w) bool: what is white in our picture of a white thing in the dark."""
    scene = Scene(objects=(node,), camera=camera, lights=())
    return rtcore.render(scene, size=SIZE, precision=precision).pixels[:, :, 0] > 0.5


def povrays_mask(text: str, node: Node, camera: Camera, folder) -> np.ndarray:
    """The same by POV-Ray. Its rays are direction + (x - 1/2) right + (1/2 - y) up with x, y in 0 .. 1 at the pixels' centres."""
    width, height = SIZE
    eye, corner, right, down = camera.rays(width, height)
    right, down = width * right, height * down
    head = HEAD.format(eye=vector(eye), ahead=vector(corner + right / 2 + down / 2), right=vector(right), up=vector(-down))
    placed = next(Scene(objects=(node,)).leaves()).matrix
    folder.mkdir()
    (folder / "scene.pov").write_text(f"{head}{text}{matrix(placed)} {LIGHT} }}\n")
    ran = subprocess.run(["povray", "+Iscene.pov", "+Omask.png", *OPTIONS], cwd=folder, capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr[-2000:]
    with Image.open(folder / "mask.png") as image:
        return np.asarray(image.convert("L")) > 127


def outline(mask: np.ndarray) -> np.ndarray:
    """Pixels that have both hits and misses among themselves and their eight neighbours."""
    height, width = mask.shape
    wide = np.pad(mask, 1, mode="edge")
    near = np.stack([wide[i:i + height, j:j + width] for i in range(3) for j in range(3)])
    return near.any(axis=0) & ~near.all(axis=0)


@pytest.mark.parametrize("case", CASES)
def test_hits_differ_on_the_outline_only(case, tmp_path):
    """From every view, with every transform, in both precisions. POV-Ray takes half a second to end, so its runs overlap."""
    spelled, shape = CASES[case]
    nodes = {name: Node(shape=shape, material=WHITE, transform=transform) for name, transform in TRANSFORMS.items()}
    pictures = list(itertools.product(nodes, VIEWS))
    with ThreadPoolExecutor(len(pictures)) as pool:
        masks = list(pool.map(lambda one: povrays_mask(spelled(shape), nodes[one[0]], VIEWS[one[1]], tmp_path / "-".join(one)), pictures))
    for (transform, view), theirs in zip(pictures, masks):
        for precision in ("f64", "f32"):
            ours = our_mask(nodes[transform], VIEWS[view], precision)
            assert 0.02 < ours.mean() < 0.98
            assert not ((ours != theirs) & ~outline(ours)).any(), (transform, view, precision)


def test_another_size_or_another_place_would_be_noticed(tmp_path):
    """A torus whose tube is 8 % thicker, and one moved by two pixels, differ off the outline too."""
    camera, node = VIEWS["from the side"], Node(shape=Torus(1.0, 0.25), material=WHITE)
    ours = our_mask(node, camera, "f64")
    moved = Node(shape=node.shape, material=WHITE, transform=(Translate((0.046, 0, 0)),))
    for name, other, placed in (("size", Torus(1.0, 0.27), node), ("place", node.shape, moved)):
        theirs = povrays_mask(torus(other), placed, camera, tmp_path / name)
        assert ((ours != theirs) & ~outline(ours)).any()
