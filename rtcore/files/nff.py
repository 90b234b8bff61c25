"""NFF, the Neutral File Format 3.9, all of it.

A file is a stream of tokens: an entity's word, then its numbers, which may break across lines. What a fill lights is gathered
into as few nodes as stay readable: the triangles of a fill are one mesh, its patches another, its spheres a group, and so on.
Colours, Kd and the highlight are display values, and made linear here; so is the ambient light, the 0.1 of the format's reference
reader. A light without a colour of its own has the intensity 1/sqrt(n) of n lights.
"""
import math
import os
from typing import NamedTuple

import numpy as np

from rtcore import shapes
from rtcore.camera import Camera
from rtcore.fields import FieldError, linear_from_srgb
from rtcore.files._errors import FileError, Said, read_text, unknown
from rtcore.files._outlines import normals_filled, triangles_of
from rtcore.lights import Ambient, Point
from rtcore.scene import Background, Material, Node, Scene

MOST_BYTES = 64 * 2**20
AMBIENT = linear_from_srgb(0.1)
BLINN = 4.0     # Phong's cosine to the power n is about as wide as Blinn's to the power 4n
ENTITIES = ("v", "b", "l", "f", "s", "c", "p", "pp")

_VIEW = {"from": 3, "at": 3, "up": 3, "angle": 1, "hither": 1, "resolution": 2}     # words of a view and how many numbers each has
_NAMES = {"lookfrom": "from", "lookat": "at", "fov": "angle", "diffuse": "Kd", "specular": "Ks", "apex": "apex centre"}  # NFF's
_FLAT = 1e-12       # a polygon with less area than this share of its extent squared has none


def load(path: str | os.PathLike) -> Scene:
    """The scene in an NFF file; FileError with the line of what is wrong."""
    return _Reader(path, read_text(path, MOST_BYTES)).scene()


class _Fill(NamedTuple):
    """A material and what it covers so far. A triangle is 9 numbers, a patch, of three corners with normals, 18."""

    material: Material
    spheres: list[Node]
    tubes: list[Node]
    polygons: list[Node]
    triangles: list[list[float]]
    patches: list[list[float]]

    @property
    def sides(self) -> str:
        """Objects are one-sided unless their material transmits."""
        return "both" if self.material.transmission > 0 else "front"


class _Reader:
    """Reads the tokens of one file from the first to the last."""

    def __init__(self, path, text: str):
        self._path = path
        self._words: list[str] = []
        self._lines: list[int] = []     # line of each word
        for number, line in enumerate(text.split("\n"), 1):
            words = line.partition("#")[0].split()
            self._words += words
            self._lines += [number] * len(words)
        self._at = 0            # index of the next word
        self._line = 1          # line of the entity at hand
        self._camera: Camera | None = None
        self._background = Background()
        self._lights: list[tuple[list[float], list[float]]] = []
        self._fills: list[_Fill] = []
        self._flat = 0          # degenerate polygons left out

    def scene(self) -> Scene:
        """Everything in the file as a scene."""
        readers = {word: getattr(self, f"_read_{word}") for word in ENTITIES}
        while self._at < len(self._words):
            word, self._line = self._words[self._at], self._lines[self._at]
            if word not in readers:
                raise self._wrong(*unknown(word, ENTITIES))
            if self._camera is None and word in ("s", "c", "p", "pp"):
                raise self._wrong("a view (v) before the first object", word)
            self._at += 1
            try:
                readers[word]()
            except FieldError as error:
                raise FileError.expected(self._path, error.expected, error.got, line=self._line,
                                         place=f"{word} {_NAMES.get(error.path, error.path)}".strip()) from None
        if self._camera is None:
            self._line = self._lines[-1] if self._lines else 1
            raise self._wrong("a view (v)", Said("the end of the file"))
        try:
            return self._assembled()
        except FieldError as error:
            raise FileError.of(self._path, error) from None

    # --- tokens ---

    def _wrong(self, expected: str, got: object, line: int | None = None) -> FileError:
        return FileError.expected(self._path, expected, got, line=line or self._line)

    def _numbers(self, count: int, what: str) -> list[float]:
        """The next `count` numbers."""
        words = self._words[self._at:self._at + count]
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            numbers = []
        wanted = f"{count:,} number{'s' * (count > 1)} ({what})"
        if len(numbers) < count or not all(map(math.isfinite, numbers)) or any("_" in word for word in words):
            for i, word in enumerate(words):
                if not _is_number(word):
                    raise self._wrong(wanted, word, self._lines[self._at + i])
            raise self._wrong(wanted, Said(f"the end of the file after {len(words)}"), self._lines[-1])
        self._at += count
        return numbers

    def _more_numbers(self) -> bool:
        return self._at < len(self._words) and _is_number(self._words[self._at])

    # --- entities ---

    def _read_v(self):
        if self._camera is not None:
            raise self._wrong("one view (v)", Said("a second one"))
        found: dict[str, list[float]] = {}
        while len(found) < len(_VIEW):
            word = self._words[self._at] if self._at < len(self._words) else None
            if word not in _VIEW or word in found:
                line = self._lines[min(self._at, len(self._lines) - 1)]
                expected = " or ".join(w for w in _VIEW if w not in found) + " of the view"
                raise self._wrong(expected, Said("the end of the file") if word is None else word, line)
            self._at += 1
            found[word] = self._numbers(_VIEW[word], f"of {word}")
        self._camera = Camera(lookfrom=found["from"], lookat=found["at"], up=found["up"], fov=found["angle"][0], span="centers")

    def _read_b(self):
        self._background = Background(color=self._color("of the background"))

    def _read_l(self):
        position = self._numbers(3, "position of a light")
        self._lights.append((position, self._color("colour of a light") if self._more_numbers() else []))

    def _read_f(self):
        r, g, b, diffuse, specular, shine, clear, index = self._numbers(8, "r g b Kd Ks Shine T ior of a fill")
        color = tuple(linear_from_srgb(min(max(c, 0.0), 1.0)) for c in (r, g, b))
        # What adds up is a display value too; reflection and transmission scale light that is linear already. Below 0: the record refuses.
        scattered, highlight = (linear_from_srgb(share) if share > 0 else share for share in (diffuse, specular))
        # The index may be anything, even 0, where nothing goes through.
        self._fills.append(_Fill(Material(
            color=color, diffuse=scattered, specular=highlight, shininess=max(BLINN * shine, 1e-3), reflection=min(specular, 1.0),
            fresnel=False, transmission=min(max(clear, 0.0), 1.0), ior=index if index > 0 else 1.0), [], [], [], [], []))

    def _read_s(self):
        x, y, z, radius = self._numbers(4, "centre and radius of a sphere")
        if radius == 0:
            raise self._wrong("a radius other than 0", radius)
        fill = self._fill("sphere")
        fill.spheres.append(Node(shape=shapes.Sphere(center=(x, y, z), radius=abs(radius), sides=_turned(fill.sides, radius < 0))))

    def _read_c(self):
        *base, base_radius, x, y, z, apex_radius = self._numbers(8, "base and apex of a cone, with their radii")
        fill, apex = self._fill("cone"), (x, y, z)
        if base_radius * apex_radius < 0:
            raise self._wrong("two radii of the same sign", Said(f"{base_radius:g} and {apex_radius:g}"))
        sides = _turned(fill.sides, base_radius < 0 or apex_radius < 0)
        if base_radius == apex_radius:
            shape = shapes.Cylinder(base=base, apex=apex, radius=abs(base_radius), capped=False, sides=sides)
        else:
            shape = shapes.Cone(base=base, base_radius=abs(base_radius), apex=apex, apex_radius=abs(apex_radius), capped=False, sides=sides)
        fill.tubes.append(Node(shape=shape))

    def _read_p(self):
        count = self._count("polygon")
        fill, numbers = self._fill("polygon"), self._numbers(3 * count, f"{count} vertices of a polygon")
        corners = _rows(numbers, 3)
        if _has_no_area(corners):
            self._flat += 1
        elif count == 3:
            fill.triangles.append(numbers)
        else:
            fill.polygons.append(Node(shape=shapes.Polygon(vertices=corners)))

    def _read_pp(self):
        count = self._count("patch")
        fill, numbers = self._fill("patch"), self._numbers(6 * count, f"{count} vertices of a patch, with their normals")
        if _has_no_area(corners := _rows(numbers, 6)):
            self._flat += 1
        elif count == 3:
            fill.patches.append(numbers)
        else:
            pieces = [[corners[i] for i in three] for three in triangles_of(np.array(corners)[:, :3])]
            fill.patches.extend([number for corner in piece for number in corner] for piece in pieces if not _has_no_area(piece))

    def _fill(self, what: str) -> _Fill:
        if not self._fills:
            raise self._wrong(f"a fill (f) before the first {what}", Said("none"))
        return self._fills[-1]

    def _count(self, what: str) -> int:
        count, = self._numbers(1, f"how many vertices the {what} has")
        if count != int(count) or count < 3:
            raise self._wrong(f"a {what} of at least 3 vertices", Said(f"{count:g}"))
        return int(count)

    def _color(self, what: str) -> tuple[float, ...]:
        """Three display values as linear light; above 1 they are as bright as they say."""
        color = self._numbers(3, f"colour {what}" if not what.startswith("colour") else what)
        if min(color) < 0:
            raise self._wrong("a colour whose parts are at least 0", color)
        return tuple(linear_from_srgb(c) if c <= 1 else c for c in color)

    # --- the scene ---

    def _assembled(self) -> Scene:
        names: dict[Material, str] = {}
        nodes = []
        for fill in self._fills:
            kinds = _nodes_of(fill)
            if kinds:
                name = names.setdefault(fill.material, f"m{len(names) + 1}")
                nodes.append(_under(name, kinds))
        share = 1 / math.sqrt(len(self._lights) or 1)
        lights = [Point(position=position, falloff="constant", name=f"light {i}", **({"color": color} if color else {"intensity": share}))
                  for i, (position, color) in enumerate(self._lights, 1)]
        dropped = f"{self._flat:,} degenerate polygon{'s' * (self._flat > 1)} left out" if self._flat else ""
        return Scene(objects=tuple(nodes), camera=self._camera, background=self._background, note=dropped,
                     lights=(*lights, Ambient(intensity=AMBIENT, name="NFF ambient")),
                     materials={name: material for material, name in names.items()}, name=os.path.splitext(os.path.basename(self._path))[0])


def _nodes_of(fill: _Fill) -> list[Node]:
    """A node for each kind of object that a fill covers.

    Polygons and patches are visible from both sides, although the format makes opaque ones one-sided: scenes such as the
    teapot are meant two-sided and nothing in a file tells them apart; in a closed surface the difference is never seen.
    """
    nodes = []
    if fill.triangles:
        corners = np.array(fill.triangles).reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        nodes.append(Node(name=_counted(len(faces), "triangle"), shape=shapes.Mesh(vertices=corners, faces=faces)))
    if fill.patches:
        corners = np.array(fill.patches).reshape(-1, 6)
        vertices, faces = corners[:, :3].copy(), np.arange(len(corners)).reshape(-1, 3)
        mesh = shapes.Mesh(vertices=vertices, faces=faces, normals=normals_filled(vertices, faces, corners[:, 3:].copy()))
        nodes.append(Node(name=_counted(len(faces), "patch", "patches"), shape=mesh))
    cones = sum(isinstance(node.shape, shapes.Cone) for node in fill.tubes)
    tubes = ("cone",) if cones == len(fill.tubes) else ("cylinder",) if not cones else ("cone or cylinder", "cones and cylinders")
    for members, words in ((fill.polygons, ("polygon",)), (fill.tubes, tubes), (fill.spheres, ("sphere",))):
        if len(members) == 1:
            nodes.append(Node(name=words[0], shape=members[0].shape))
        elif members:
            nodes.append(Node(name=_counted(len(members), *words), children=tuple(members)))
    return nodes


def _under(material: str, nodes: list[Node]) -> Node:
    """One node of a material: the only one there is, or a group."""
    if len(nodes) > 1:
        return Node(name=", ".join(node.name for node in nodes), children=tuple(nodes), material=material)
    only, = nodes
    return Node(name=only.name, shape=only.shape, children=only.children, material=material)


def _counted(count: int, one: str, many: str = "") -> str:
    return f"{count:,} {many or one + 's'}" if count != 1 else one


def _rows(numbers: list[float], width: int) -> list[list[float]]:
    return [numbers[i:i + width] for i in range(0, len(numbers), width)]


def _has_no_area(corners: list[list[float]]) -> bool:
    """Whether an outline (rows whose first three numbers are a point) has no area worth the name: Newell's normal, as plain
    numbers, because numpy takes ten times as long over three corners."""
    x0, y0, z0 = corners[0][:3]
    points = [(c[0] - x0, c[1] - y0, c[2] - z0) for c in corners]
    extent = max(max(abs(x), abs(y), abs(z)) for x, y, z in points)
    if not 0 < extent < math.inf:
        return True
    nx = ny = nz = 0.0
    x0, y0, z0 = (c / extent for c in points[-1])
    for x, y, z in points:
        x, y, z = x / extent, y / extent, z / extent
        nx, ny, nz = nx + y0 * z - z0 * y, ny + z0 * x - x0 * z, nz + x0 * y - y0 * x
        x0, y0, z0 = x, y, z
    return max(abs(nx), abs(ny), abs(nz)) < _FLAT


def _turned(sides: str, inside: bool) -> str:
    """The visible sides of a round object whose radius was negative: only the inside, unless it transmits."""
    return "back" if inside and sides == "front" else sides


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word)) and "_" not in word
    except ValueError:
        return False
