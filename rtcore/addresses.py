"""Where the kernels of the stages begin in memory, for `stages.advance`."""
import functools

import numpy as np
from numba import types

from rtcore import film as films, fog as fogs, shading
from rtcore.bvh import EMPTY_TREE
from rtcore.indirect import address_of
from rtcore.lights import UNNOTED, UNTOLD, Draw, Reach
from rtcore.scene import Background, Fog
from rtcore.shapes.kind import Table
from rtcore.stages import Primitives
from rtcore.todo import NO_PIXELS
from rtcore.wave import CLOSEST, new_beam, new_wave


def no_primitives(dtype) -> Primitives:
    """None at all, of no kind."""
    return Primitives(EMPTY_TREE, Table(np.zeros((0, 0), dtype), np.zeros((0, 0), dtype), np.zeros(0, np.int8), np.zeros((0, 0))))


@functools.cache
def _examples(dtype) -> dict[str, tuple]:
    """Arguments like those that each sort of kernel gets."""
    wave, beam, film, none = new_wave(0, dtype), new_beam(0, 0, dtype), films.new_film(0, 0), np.zeros(0, np.int32)
    look = shading.make_look((), none, np.zeros(3), Background(), (0, 1, 0))
    view, tile, pixels = np.zeros((4, 3)), np.zeros(8, np.int64), NO_PIXELS
    shine = (wave, 0, np.zeros(1), np.zeros(3), beam, 0, Reach(UNTOLD, UNNOTED, none, np.float32(1)))
    return {
        "sends": (wave, none, view, tile, 0, 0), "sends list": (wave, none, none, view, 0, pixels, 0),
        "meets": (wave.rays, 0, *no_primitives(dtype), 0, CLOSEST), "surface": (wave.rays, 0, wave.surface, no_primitives(dtype).table, 0),
        "finds": (wave.rays.prim, 0, np.zeros(0, np.int64), np.zeros(0, bool)), "notes": (film, wave, 0, none),
        "glows": (wave, 0, look, beam.answer), "shines": shine, "shines sampled": (*shine, Draw(none, none, 0, 0)),
        "notes lit": (film, beam, 0, none, np.float32(1)), "gathers": (wave, beam, 0), "dims": (wave, 0, fogs.numbers(Fog())),
        "deposits": (wave, 0, np.zeros((3, 0), np.float32), True), "bounces": (wave, 0, look, wave, np.zeros(0, np.int64)),
        "sorts": (wave.rays, 0, wave), "tells": (wave.rays, wave, 0),
        "commits": (film, np.zeros((3, 0), np.float32), 0, none)}


ADDRESSES: dict[tuple, int] = {}        # by kernel and precision: to ask numba for one takes some 50 us


def address(kernel, sort: str, dtype, table: Table | None = None) -> int:
    """Where a kernel of this sort begins, see `_examples`; table: for those of a kind of shapes, one of that kind's."""
    key = kernel, dtype
    if key not in ADDRESSES:
        like = tuple(table if table is not None and isinstance(value, Table) else value for value in _examples(dtype)[sort])
        counts = sort.startswith("shines") or sort in ("sends", "sends list", "gathers", "bounces", "sorts", "commits")
        ADDRESSES[key] = address_of(kernel, like, types.int64 if counts else types.none)
    return ADDRESSES[key]
