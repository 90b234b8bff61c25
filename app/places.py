"""Where things stand in a scene: places that can be selected and edited, and the leaves below a node.

A node's path is that of `rtcore.scene.Leaf`: child indices from the scene's objects down, with a 0 for the step through a
use into its definition. What lies behind such a step is shared by every use of the definition.
"""
from bisect import bisect_right
from itertools import accumulate
from typing import NamedTuple

import msgspec

from rtcore.fields import Record
from rtcore.scene import Node, Scene

Path = tuple[int, ...]


class Place(NamedTuple):
    """What can be selected: a ``node`` by its path, a ``light`` by its index, a ``material`` by its name, the ``background``."""

    kind: str
    key: Path | int | str | None = None


def record_at(scene: Scene, place: Place) -> Record | None:
    """The record at a place, or None where the scene has no such place."""
    if place.kind == "node":
        return node_at(scene, place.key)
    if place.kind == "light":
        return lights_of(scene)[place.key] if place.key < len(lights_of(scene)) else None
    if place.kind == "material":
        return scene.materials.get(place.key)
    return scene.background


def with_record(scene: Scene, place: Place, record: Record) -> Scene:
    """The scene with another record at that place; FieldError if the scene can't be so."""
    if place.kind == "node":
        return with_node(scene, place.key, record)
    if place.kind == "light":
        return msgspec.structs.replace(scene, lights=spliced(lights_of(scene), place.key, record))
    if place.kind == "material":
        return msgspec.structs.replace(scene, materials={**scene.materials, place.key: record})
    return msgspec.structs.replace(scene, background=record)


def lights_of(scene: Scene) -> tuple:
    """The scene's lights, or the studio lights that stand in where it names none."""
    if scene.lights is None:
        from rtcore.lights import STUDIO    # here, because the shapes' and lights' modules may bring kernels with them
        return STUDIO
    return scene.lights


def spliced(items: tuple, index: int, item) -> tuple:
    """The tuple with one item replaced."""
    return (*items[:index], item, *items[index + 1:])


def below(scene: Scene, node: Node) -> tuple[Node, ...]:
    """The nodes a step further down: a group's children, or the definition behind a use."""
    if node.use is not None:
        return (scene.definitions[node.use],)
    return node.children or ()


def node_at(scene: Scene, path: Path) -> Node | None:
    """The node at a path, or None where there is none."""
    nodes, node = scene.objects, None
    for index in path:
        if index >= len(nodes):
            return None
        node = nodes[index]
        nodes = below(scene, node)
    return node


def definition_around(scene: Scene, path: Path) -> str | None:
    """Name of the innermost definition that holds the node at `path`, or None if the node stands in the scene itself."""
    name, nodes = None, scene.objects
    for step, index in enumerate(path):
        node = nodes[index]
        if node.use is not None and step + 1 < len(path):
            name = node.use
        nodes = below(scene, node)
    return name


def with_node(scene: Scene, path: Path, new: Node) -> Scene:
    """The scene with another node at `path`. Behind a use it is the definition that changes, so every use shows it."""
    definition, start, nodes = None, 0, scene.objects
    for step, index in enumerate(path):
        node = nodes[index]
        if node.use is not None and step + 1 < len(path):
            definition, start = node.use, step + 2
        nodes = below(scene, node)

    def rebuilt(node: Node, rest: Path) -> Node:
        if not rest:
            return new
        return msgspec.structs.replace(node, children=spliced(node.children, rest[0], rebuilt(node.children[rest[0]], rest[1:])))

    if definition is not None:
        node = rebuilt(scene.definitions[definition], path[start:])
        return msgspec.structs.replace(scene, definitions={**scene.definitions, definition: node})
    return msgspec.structs.replace(scene, objects=spliced(scene.objects, path[0], rebuilt(scene.objects[path[0]], path[1:])))


def kind_of(node: Node) -> str:
    """``group``, ``use`` or the shape's word, as the file format has it."""
    return "use" if node.use is not None else "group" if node.children is not None else type(node.shape).__name__.lower()


def label_of(scene: Scene, place: Place) -> str:
    """What people call the thing at a place."""
    record = record_at(scene, place)
    if record is None:
        return ""
    if place.kind == "node":
        return record.name or record.use or f"{kind_of(record).capitalize()} {place.key[-1] + 1}"
    if place.kind == "light":
        return record.name or f"{type(record).__name__} {place.key + 1}"
    return place.key or "Background"


class Leaves:
    """Leaf indices of one scene, as `Frame.node` has them: a node's leaves are a run of them without a gap."""

    def __init__(self, scene: Scene):
        self.scene = scene
        self._ends: dict[int, list[int]] = {}   # by id of a children tuple, which the scene keeps alive: running sums of leaves

    def span(self, path: Path) -> tuple[int, int]:
        """First leaf at or below the node at `path`, and one past the last."""
        first, nodes, node = 0, self.scene.objects, None
        for index in path:
            first += self._running(nodes)[index - 1] if index else 0
            node = nodes[index]
            nodes = below(self.scene, node) if node.use is not None else node.children or ()
        return first, first + self._count(node)

    def path(self, leaf: int) -> Path | None:
        """The path to a leaf by its index, or None if there is no such leaf."""
        path: Path = ()
        nodes = self.scene.objects
        if not 0 <= leaf < (self._running(nodes) or [0])[-1]:
            return None
        while nodes:
            ends = self._running(nodes)
            index = bisect_right(ends, leaf)
            leaf -= ends[index - 1] if index else 0
            path += (index,)
            nodes = below(self.scene, nodes[index])
        return path

    def _running(self, nodes: tuple[Node, ...]) -> list[int]:
        if len(nodes) == 1:
            return [self._count(nodes[0])]      # a definition's own tuple is made on the fly and has no lasting id
        if id(nodes) not in self._ends:
            self._ends[id(nodes)] = list(accumulate(map(self._count, nodes)))
        return self._ends[id(nodes)]

    def _count(self, node: Node) -> int:
        if node.shape is not None:
            return 1
        if node.use is not None:
            return self._count(self.scene.definitions[node.use])
        return self._running(node.children)[-1] if node.children else 0
