"""The scene document: frozen records that form a DAG of nodes, with materials, lights, fog, background and a camera.

An edit makes a new Scene that shares all it did not touch, so undo is a list of scenes and a render needs no lock.
Nothing here is compiled. Lengths are in scene units, angles in degrees, colours linear red, green, blue.
"""
import math
from collections.abc import Iterator
from typing import Annotated

import msgspec
import numpy as np

from rtcore.camera import Camera
from rtcore.fields import Choice, Color, Field, FieldError, Flag, Maybe, Number, Record, Text, Vec, Vector
from rtcore.leaves import Leaf, Names, walk

MOST_NESTED = 200       # groups inside groups; a deeper file is a mistake or an attack
MOST_LEAVES = 4_000_000  # shapes after every use of a definition is counted


class Shape(Record, frozen=True, kw_only=True):
    """What every shape has besides its own fields. Its module in `rtcore.shapes` holds the rest."""

    sides: Annotated[str, Choice(words=("both", "front", "back"), help="which sides are visible; the normal points to the front")] = "both"

    def count(self) -> int:
        """How many primitives the shape becomes."""
        return 1

    def rounded(self, dtype) -> "Shape":
        """The shape with its numbers rounded to a type of numpy. FieldError where one becomes infinite, or 0 where it must not."""
        with np.errstate(over="ignore"):
            return msgspec.structs.replace(self, **{name: _rounded(getattr(self, name), dtype) for name in self.__struct_fields__})


def _rounded(value, dtype):
    if isinstance(value, tuple):
        return tuple(_rounded(part, dtype) for part in value)
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        return value.astype(dtype).astype(np.float64)
    return float(dtype(value)) if isinstance(value, float) else value


class Light(Record, frozen=True, kw_only=True):
    """What every light has besides its own fields. Its module in `rtcore.lights` holds the rest."""

    color: Annotated[Vec, Color(help="colour of the light, linear")] = (1.0, 1.0, 1.0)
    intensity: Annotated[float, Number(least=0, help="factor of the colour")] = 1.0
    on: Annotated[bool, Flag(help="whether the light shines")] = True
    name: Annotated[str, Text(help="what the light is called")] = ""
    note: Annotated[str, Text(help="a remark of the author")] = ""


class Checker(Record, frozen=True):
    """Cubes of two colours in object space; a surface shows the cube just beneath it, so that a face on a seam does not flicker."""

    even: Annotated[Vec, Color(most=1, help="colour of the cube with a corner at the origin, all coordinates positive")] = (0.9, 0.9, 0.9)
    odd: Annotated[Vec, Color(most=1, help="colour of its neighbours")] = (0.1, 0.1, 0.1)
    size: Annotated[float, Number(above=0, help="edge of a cube", unit="scene units")] = 1.0


class Material(Record, frozen=True, kw_only=True):
    """How a surface answers light: the terms of Whitted's model (*An Improved Illumination Model for Shaded Display*, 1980).

    Seen light = emission + color·(ambient·Ia + diffuse·Σ I·cos) + highlight·Σ I·cosʰ + reflected and refracted light.
    With `fresnel`, reflection and transmission are shared out by Fresnel's equations for the index `ior`. With `roughness` the reflected
    and refracted rays scatter as at facets after the GGX distribution of width roughness² (`rtcore.gloss`).
    """

    color: Annotated[Vec, Color(most=1, help="diffuse colour")] = (0.8, 0.8, 0.8)
    checker: Annotated[Checker | None, Maybe(help="a pattern of two colours in place of the colour")] = None
    ambient: Annotated[float, Number(least=0, help="share of the ambient light that is returned")] = 1.0
    diffuse: Annotated[float, Number(least=0, help="share of the light that is scattered evenly (Lambert)")] = 1.0
    specular: Annotated[float, Number(least=0, help="strength of the highlight (Blinn-Phong)")] = 0.0
    shininess: Annotated[float, Number(above=0, help="exponent of the highlight: the higher, the smaller it is")] = 50.0
    reflection: Annotated[float, Number(least=0, most=1, help="share of the mirror image")] = 0.0
    roughness: Annotated[float, Number(least=0, most=1, help="blur of mirror image and of what goes through: 0 sharp, 1 all around")] = 0.0
    transmission: Annotated[float, Number(least=0, most=1, help="share of the light that goes through")] = 0.0
    ior: Annotated[float, Number(above=0, help="index of refraction of the inside against the outside")] = 1.5
    fresnel: Annotated[bool, Flag(help="let the angle share the light out between reflection and transmission")] = False
    tint: Annotated[Vec, Color(most=1, help="colour of the mirror image and of what goes through")] = (1.0, 1.0, 1.0)
    emission: Annotated[Vec, Color(help="light that the surface shows of itself; it lights nothing else")] = (0.0, 0.0, 0.0)
    note: Annotated[str, Text(help="a remark of the author")] = ""


FOG_KINDS = ("linear", "exponential", "exponential-squared")


class Fog(Record, frozen=True, kw_only=True):
    """Fog between two points a distance s apart lets through f of the light and adds (1 - f) of its colour.

    linear: f = (end - s)/(end - start), exponential: f = exp(-density·s), exponential-squared: f = exp(-(density·s)²).
    """

    kind: Annotated[str, Choice(words=FOG_KINDS, help="how the fog grows with distance")] = "exponential"
    color: Annotated[Vec, Color(help="colour of the fog")] = (0.7, 0.75, 0.8)
    density: Annotated[float, Number(least=0, help="of the exponential kinds", unit="1/scene unit")] = 0.1
    start: Annotated[float, Number(least=0, help="where linear fog begins", unit="scene units")] = 0.0
    end: Annotated[float, Number(above=0, help="where linear fog hides all", unit="scene units")] = 50.0
    on: Annotated[bool, Flag(help="whether there is fog")] = True

    def check(self):
        if self.end <= self.start:
            raise FieldError(f"a number greater than start, {self.start:g}", self.end, "end")


class Background(Record, frozen=True, kw_only=True):
    """What a ray sees that hits nothing: one colour, or a gradient from `color` below to `top` above (along the camera's up)."""

    color: Annotated[Vec, Color(help="the colour, or that of the lower end")] = (0.0, 0.0, 0.0)
    top: Annotated[Vec | None, Maybe(inner=Color(), help="colour of the upper end, if there is a gradient")] = None


class Translate(Record, frozen=True):
    """A shift."""

    offset: Annotated[Vec, Vector(help="by how much", unit="scene units")]

    def matrix(self) -> np.ndarray:
        m = np.eye(4)
        m[:3, 3] = self.offset
        return m


class Rotate(Record, frozen=True):
    """A turn about an axis through the origin, counter-clockwise seen against it (Rodrigues)."""

    axis: Annotated[Vec, Vector(nonzero=True, help="the axis")]
    angle: Annotated[float, Number(help="how far", unit="degrees")]

    def matrix(self) -> np.ndarray:
        x, y, z = np.array(self.axis) / math.hypot(*self.axis)
        quarter, rest = divmod(self.angle, 90.0)   # exact quarter turns stay exact
        c, s = (1.0, 0.0) if rest == 0 else (math.cos(math.radians(rest)), math.sin(math.radians(rest)))
        for _ in range(int(quarter) % 4):
            c, s = -s, c
        k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        m = np.eye(4)
        m[:3, :3] = c * np.eye(3) + s * k + (1 - c) * np.outer((x, y, z), (x, y, z))
        return m


class Scale(Record, frozen=True):
    """A stretch along x, y and z; negative factors mirror."""

    factors: Annotated[Vec, Vector(help="along x, y and z; none 0")]

    def check(self):
        if not all(self.factors):
            raise FieldError("three factors other than 0", self.factors, "factors")

    def matrix(self) -> np.ndarray:
        return np.diag([*self.factors, 1.0])


class Shear(Record, frozen=True, kw_only=True):
    """x' = x + xy·y + xz·z, and so on."""

    xy: Annotated[float, Number(help="how x grows with y")] = 0.0
    xz: Annotated[float, Number(help="how x grows with z")] = 0.0
    yx: Annotated[float, Number(help="how y grows with x")] = 0.0
    yz: Annotated[float, Number(help="how y grows with z")] = 0.0
    zx: Annotated[float, Number(help="how z grows with x")] = 0.0
    zy: Annotated[float, Number(help="how z grows with y")] = 0.0

    def matrix(self) -> np.ndarray:
        return np.array([[1, self.xy, self.xz, 0], [self.yx, 1, self.yz, 0], [self.zx, self.zy, 1, 0], [0, 0, 0, 1.0]])

    def check(self):
        invertible(self.matrix())


class Rows(Field):
    """Sixteen finite numbers in four rows, the last 0 0 0 1."""

    def take(self, value):
        try:
            m = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise FieldError("four rows of four finite numbers", value) from None
        if m.shape != (4, 4) or not np.isfinite(m).all():
            raise FieldError("four rows of four finite numbers", value)
        if m[3].tolist() != [0, 0, 0, 1]:
            raise FieldError("a last row of 0, 0, 0, 1", m[3].tolist())
        invertible(m)
        return tuple(tuple(row) for row in m.tolist())


class Matrix(Record, frozen=True):
    """Any affine transform."""

    rows: Annotated[tuple[tuple[float, ...], ...], Rows(help="four rows; the last is 0 0 0 1")]

    def matrix(self) -> np.ndarray:
        return np.array(self.rows)


TRANSFORMS = (Translate, Rotate, Scale, Shear, Matrix)
Transform = Translate | Rotate | Scale | Shear | Matrix


def invertible(matrix: np.ndarray) -> np.ndarray:
    """The inverse of a 4 x 4 affine matrix; FieldError if the numbers are not finite or it has none."""
    with np.errstate(all="ignore"):
        linear = matrix[:3, :3]
        lengths = np.abs(linear).max(axis=0)    # so that a scale of 1e-200 is small, not singular
        singular = not np.isfinite(matrix).all() or not lengths.all()
        singular = singular or abs(np.linalg.det(linear / lengths)) < 1e-15
        if not singular:
            inverse = np.eye(4)
            inverse[:3, :3] = np.linalg.inv(linear / lengths) / lengths[:, None]
            inverse[:3, 3] = -inverse[:3, :3] @ matrix[:3, 3]
            singular = not np.isfinite(inverse).all()
    if singular:
        raise FieldError("an invertible matrix", matrix.tolist())
    return inverse


class Node(Record, frozen=True, kw_only=True):
    """A place in the scene: exactly one of a `shape`, a group of `children`, or the `use` of a named definition.

    The transforms apply in the order of the list. A material is a record, or the name of one of the scene's; where a
    node has none, its parent's holds.
    """

    name: Annotated[str, Text(help="what the node is called")] = ""
    shape: Annotated[Shape | None, Field()] = None
    children: "tuple[Node, ...] | None" = None
    use: Annotated[str | None, Maybe(inner=Text(), help="name of the definition that stands here")] = None
    transform: tuple[Transform, ...] = ()
    material: Material | str | None = None
    visible: Annotated[bool, Flag(help="whether the node and all below it are there at all")] = True
    note: Annotated[str, Text(help="a remark of the author")] = ""

    def check(self):
        given = [word for word in ("shape", "children", "use") if getattr(self, word) is not None]
        if len(given) != 1:
            raise FieldError("exactly one of a shape, a group or a use", given)
        if self.shape is not None and not isinstance(self.shape, Shape):
            raise FieldError("a shape", self.shape, "shape")
        if self.children is not None:
            msgspec.structs.force_setattr(self, "children", as_nodes(self.children, "children"))
        if not isinstance(self.material, (Material, str, type(None))):
            raise FieldError("a material or the name of one", self.material, "material")
        transform = tuple(self.transform)
        for i, t in enumerate(transform):
            if not isinstance(t, TRANSFORMS):
                raise FieldError("a transform", t, f"transform[{i}]")
        msgspec.structs.force_setattr(self, "transform", transform)

    def matrix(self) -> np.ndarray:
        """The 4 x 4 matrix from the node's space to its parent's."""
        m = np.eye(4)
        for t in self.transform:
            m = t.matrix() @ m
        return m


def as_nodes(items, where: str) -> tuple[Node, ...]:
    """Nodes from nodes and bare shapes; what is that already stays the very same."""
    if isinstance(items, tuple) and all(isinstance(item, Node) for item in items):
        return items
    nodes = []
    for i, item in enumerate(items):
        if not isinstance(item, (Node, Shape)):
            raise FieldError("a node or a shape", item, f"{where}[{i}]")
        nodes.append(item if isinstance(item, Node) else Node(shape=item))
    return tuple(nodes)


class Scene(Record, frozen=True, kw_only=True, weakref=True):
    """All that a picture needs. `objects` may hold bare shapes; without a camera the scene is framed when it is rendered.

    `lights=None` means the studio lights of `rtcore.lights.STUDIO`; an empty tuple means darkness.
    """

    objects: tuple[Node, ...] = ()
    camera: Camera | None = None
    lights: tuple[Light, ...] | None = None
    background: Background = Background()
    fog: Fog | None = None
    materials: dict[str, Material] = {}
    definitions: dict[str, Node] = {}
    name: Annotated[str, Text(help="title of the scene")] = ""
    note: Annotated[str, Text(help="a remark of the author")] = ""

    def check(self):
        msgspec.structs.force_setattr(self, "objects", as_nodes(self.objects, "objects"))
        if self.lights is not None:
            msgspec.structs.force_setattr(self, "lights", tuple(self.lights))
        for name, types in (("camera", (Camera, type(None))), ("fog", (Fog, type(None))), ("background", Background)):
            if not isinstance(getattr(self, name), types):
                raise FieldError(f"a {name}", getattr(self, name), name)
        for i, light in enumerate(self.lights or ()):
            if not isinstance(light, Light):
                raise FieldError("a light", light, f"lights[{i}]")
        self._check_uses()

    def _check_uses(self):
        """Every name used is defined, no definition uses itself, nesting and the number of leaves are bounded."""
        leaves: dict[str, tuple[int, int]] = {}     # definition -> leaves below it, levels below it

        def plain(node: Node) -> bool:      # most are; thousands are passed in a millisecond
            return node.shape is not None and (not isinstance(node.material, str) or node.material in self.materials)

        def measure(node: Node, path: str, open_: tuple[str, ...], depth: int) -> tuple[int, int]:
            if depth > MOST_NESTED:
                raise FieldError(f"at most {MOST_NESTED} groups inside one another", depth, path)
            if isinstance(node.material, str) and node.material not in self.materials:
                raise FieldError(one_of("material", self.materials), node.material, f"{path}.material")
            if node.use is not None:
                if node.use not in self.definitions:
                    raise FieldError(one_of("definition", self.definitions), node.use, f"{path}.use")
                if node.use in open_:
                    circle = " -> ".join((*open_[open_.index(node.use):], node.use))
                    raise FieldError("definitions that do not use themselves", circle, f"{path}.use")
                if node.use not in leaves:
                    leaves[node.use] = measure(self.definitions[node.use], f"definitions.{node.use}", (*open_, node.use), depth + 1)
                count, levels = leaves[node.use]
            elif node.children is not None:
                below = [(1, 1) if depth + 1 < MOST_NESTED and plain(c) else measure(c, f"{path}.group[{i}]", open_, depth + 1)
                         for i, c in enumerate(node.children)]
                # an empty group counts as well: a walk has to look at each of its uses
                count, levels = max(sum(b[0] for b in below), 1), max((b[1] for b in below), default=0)
            else:
                count, levels = 1, 0
            if count > MOST_LEAVES:
                raise FieldError(f"at most {MOST_LEAVES:,} shapes", count, path)
            if depth + levels + 1 > MOST_NESTED:
                raise FieldError(f"at most {MOST_NESTED} groups inside one another", depth + levels + 1, path)
            return count, levels + 1

        total = sum(1 if plain(node) else measure(node, f"scene[{i}]", (), 0)[0] for i, node in enumerate(self.objects))
        if total > MOST_LEAVES:
            raise FieldError(f"at most {MOST_LEAVES:,} shapes", total, "scene")
        for name, node in self.definitions.items():
            if name not in leaves:
                leaves[name] = measure(node, f"definitions.{name}", (name,), 1)

    def leaves(self) -> Iterator[Leaf]:
        """Every shape of the scene with the uses written out, depth first; a hit's node index counts these, hidden ones too."""
        return iter(walk(self.objects, TOP, Names(self.definitions, self.materials)).leaves)


def one_of(what: str, names) -> str:
    """What an error says that expected one of these names."""
    return f"the name of a {what}: " + (", ".join(sorted(names)) or "there are none")


UNMOVED = np.eye(4)
UNMOVED.flags.writeable = False
DEFAULT_MATERIAL = Material()
TOP = Leaf((), None, UNMOVED, DEFAULT_MATERIAL, True)     # what objects take from above
