"""What is worked out of a scene once, and again only when that which it depends on has changed."""
import functools
from collections.abc import Callable

from rtcore.leaves import Branch, Leaf, Names, walk
from rtcore.scene import TOP, Scene


class Latest:
    """A function that remembers its last result, and gives it again for the very same arguments. Edits share what they don't touch, so
    identity tells that nothing has changed."""

    def __init__(self, function: Callable):
        functools.update_wrapper(self, function)
        self._function = function
        self._last: tuple[tuple, object] = (), None     # replaced at once, so threads may share it

    def __call__(self, *arguments):
        last, result = self._last
        if len(last) != len(arguments) or any(a is not b for a, b in zip(last, arguments)):
            result = self._function(*arguments)
            self._last = arguments, result
        return result


class Each:
    """What a function tells of each leaf, asked again only of leaves that were not among the latest."""

    def __init__(self, function: Callable[[Leaf], object]):
        self._function = function
        self._known: dict[int, tuple[Leaf, object]] = {}        # by identity, which the leaf beside it keeps; replaced at once

    def __call__(self, leaves: tuple[Leaf, ...]) -> list:
        known, now = self._known, {}
        for leaf in leaves:
            entry = known.get(id(leaf))
            now[id(leaf)] = entry if entry is not None else (leaf, self._function(leaf))
        self._known = now
        return [now[id(leaf)][1] for leaf in leaves]


class _Leaves:
    """The leaves of the latest scene, which the next one's share as far as they are the same."""

    def __init__(self):
        self._last: tuple[Names, Branch, tuple[Leaf, ...]] | None = None    # replaced at once, so threads may share it

    def __call__(self, scene: Scene) -> tuple[Leaf, ...]:
        last, same = self._last, False
        if last is not None:
            same = scene.definitions is last[0].definitions and scene.materials is last[0].materials
            if same and scene.objects is last[1].nodes:
                return last[2]
        names = Names(scene.definitions, scene.materials, same)
        branch = walk(scene.objects, TOP, names, last and last[1])
        leaves = tuple(branch.leaves)
        self._last = names, branch, leaves
        return leaves


_leaves = _Leaves()


def leaves_of(scene: Scene) -> tuple[Leaf, ...]:
    """`scene.leaves()`: the very same tuple for scenes that differ in lights, fog or the like only, and the very same leaves where they are
    as they were."""
    return _leaves(scene)
