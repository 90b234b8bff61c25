"""What is worked out of a scene once, and again only when that which it depends on has changed."""
import functools
from collections.abc import Callable

from rtcore.scene import Leaf, Scene, walk


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


@Latest
def _leaves(objects, definitions, materials) -> tuple[Leaf, ...]:
    return tuple(walk(objects, definitions, materials))


def leaves_of(scene: Scene) -> tuple[Leaf, ...]:
    """`scene.leaves()`, the very same tuple for scenes that differ in lights, fog or the like only."""
    return _leaves(scene.objects, scene.definitions, scene.materials)
