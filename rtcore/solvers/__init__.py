"""Solvers: one file a shape, each with several methods by name, the lecture's own forms among them. Only the reports use them.

A solver is a kernel

    solve(rays, numbers, roots, count)

that takes rays P (6, n), origins above directions, in the shape's own space, and the shape's numbers P (k), and writes count[i] <= m roots
of ray i into roots[i], P (n, m), in any order and negative ones too, all worked out in the precision P of its arguments. What the renderer
itself does is no copy here: it is called "renderer", and measured through the kernels of `rtcore.shapes`.
"""
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rtcore.scene import Shape
from rtcore.shapes import Implicit, Plane, Quadric, Sphere, Torus, Triangle
from rtcore.solvers import implicit, plane, quadric, sphere, torus, triangle

RENDERER = "renderer"       # the default of every shape


class Method(NamedTuple):
    """A solver, how a shape's record becomes its numbers, and the most roots it writes."""

    solve: Callable
    numbers: Callable[[Shape], np.ndarray]
    most: int


MODULES = {Sphere: sphere, Plane: plane, Triangle: triangle, Quadric: quadric, Torus: torus, Implicit: implicit}
METHODS = {shape: {name: Method(solve, module.numbers, module.MOST) for name, solve in module.SOLVERS.items()}
           for shape, module in MODULES.items()}


def names(shape: type[Shape]) -> tuple[str, ...]:
    """The names of a shape's solvers, the default first."""
    return (RENDERER, *METHODS.get(shape, ()))


def roots(shape: Shape, name: str, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All roots that a named solver other than the renderer finds: (n, m) in the precision of `rays` (6, n), and how many they are, (n).

    The rays are in the shape's own space. Raises KeyError for a solver that the shape does not have.
    """
    method = METHODS[type(shape)][name]
    found, count = np.full((rays.shape[1], method.most), np.nan, rays.dtype), np.zeros(rays.shape[1], np.int32)
    method.solve(rays, method.numbers(shape).astype(rays.dtype), found, count)
    return found, count
