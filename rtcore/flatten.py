"""Scene to arrays: every visible shape as primitives of its kind, the kinds' tables and trees, and what belongs to a primitive.

Primitives are numbered through all kinds, kinds by name and, within one, in the order of its tree's leaves.
"""
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from rtcore.bvh import EMPTY_TREE, Tree, build
from rtcore.fields import FieldError
from rtcore.latest import leaves_of
from rtcore.leaves import Leaf, same_place
from rtcore.memory import carved
from rtcore.scene import Scene
from rtcore.shapes.kind import MIRRORED, SIDES, Kind, Packed, Table

FEW, MANY = 16, 20_000      # of leaves with so few primitives what they were packed to is kept, in kinds of not too many leaves
DTYPES = {"f32": np.float32, "f64": np.float64}


class Group(NamedTuple):
    """All primitives of one kind."""

    kind: Kind
    tree: Tree
    table: Table
    first: int          # number of the first one
    has_tree: bool      # False: a handful in one box, or unbounded
    key: tuple          # what it was made from: a group is made anew only when that has changed
    owner: np.ndarray   # int32: the leaf of each of its primitives
    order: np.ndarray   # int32: where each of them stood before the tree was built: leaf by leaf, in the order of the shape
    packs: dict[int, Packed]    # of leaves of few primitives: what they were packed to, for packing takes longer than all the rest
    dropped: int        # degenerate primitives left out


class Geometry(NamedTuple):
    """A scene's shapes, ready for the kernels of one precision."""

    groups: tuple[Group, ...]
    leaf: np.ndarray            # int32 (primitives): which of scene.leaves() each belongs to
    leaves: tuple[Leaf, ...]
    dropped: int                # degenerate primitives left out
    dtype: type
    nbytes: int


def flatten(scene: Scene, precision: str = "f64", previous: Geometry | None = None,
            give_way: Callable[[], None] | None = None) -> Geometry:
    """Arrays and trees for the visible shapes of a scene; kinds of which nothing has changed are taken over from `previous`.
    give_way: called before each shape is packed.

    Raises FieldError where a placed shape's numbers are not finite or its transforms together can't be inverted.
    """
    dtype = DTYPES[precision]
    leaves = leaves_of(scene)
    if previous is not None and previous.dtype == dtype and (previous.leaves is leaves or _placed_alike(previous.leaves, leaves)):
        return previous._replace(leaves=leaves)
    kinds: dict[Kind, list[int]] = {}
    for index, leaf in enumerate(leaves):
        if leaf.visible:
            kinds.setdefault(leaf.shape.kind(leaf.matrix), []).append(index)
    old = {g.kind: g for g in previous.groups} if previous is not None and previous.dtype == dtype else {}
    groups, owners, first, dropped = [], [np.zeros(0, np.int32)], 0, 0
    for kind in sorted(kinds, key=lambda kind: kind.name):
        key = tuple((index, leaves[index].shape, leaves[index].matrix.tobytes()) for index in kinds[kind])
        group = old.get(kind)
        if group is None or not _same(group.key, key):
            known = {} if group is None else {index: group.packs[index] for index, *same in group.key
                                              if index in group.packs and index < len(leaves) and _is(same, leaves[index])}
            packs = []
            for index in kinds[kind]:
                if give_way is not None and index not in known:
                    give_way()
                packs.append((index, known.get(index) or packed(leaves[index], dtype)))
            group = _gather(kind, key, packs, leaves, dtype)
        if len(group.owner):        # all of it may be degenerate
            groups.append(group._replace(first=first))
        owners.append(group.owner)
        first += len(group.owner)
        dropped += group.dropped
    return Geometry(tuple(groups), np.concatenate(owners), leaves, dropped, dtype, nbytes((g.tree, g.table) for g in groups))


def nbytes(arrays: Iterable) -> int:
    """Bytes of arrays, of tuples of arrays and so on."""
    return sum(a.nbytes if isinstance(a, np.ndarray) else nbytes(a) for a in arrays)


def _is(placed: list, leaf: Leaf) -> bool:
    """Whether a leaf is this shape under this matrix."""
    return placed[0] is leaf.shape and placed[1] == leaf.matrix.tobytes()


def _placed_alike(a: tuple[Leaf, ...], b: tuple[Leaf, ...]) -> bool:
    """Whether leaves differ in materials at most."""
    return len(a) == len(b) and all(
        x is y or x.shape is y.shape and x.visible == y.visible and same_place(x, y) for x, y in zip(a, b))


def _same(a: tuple, b: tuple) -> bool:
    """Whether two group keys name the very same shapes in the same places."""
    return len(a) == len(b) and all(x[0] == y[0] and x[1] is y[1] and x[2] == y[2] for x, y in zip(a, b))


def packed(leaf: Leaf, dtype=np.float64) -> Packed:
    """A leaf's primitives, made from the shape's own numbers rounded to the precision; its matrix stays as it is. FieldError if the shape
    can't stand where it is put: the transforms around it may be singular only all together."""
    shape = leaf.shape
    if dtype != np.float64:
        try:
            shape = shape.rounded(dtype)
        except FieldError as error:
            raise FieldError(f"a shape whose numbers fit {np.dtype(dtype).name}", error.got, place(leaf)) from error
    try:
        return shape.pack(leaf.matrix)
    except FieldError as error:
        raise FieldError("transforms that together are invertible", leaf.matrix.tolist(), place(leaf)) from error


def packed_in(geometry: Geometry, index: int) -> Packed:
    """What a leaf was packed to; if that was not kept, it is packed once more."""
    kept = next((group.packs[index] for group in geometry.groups if index in group.packs), None)
    return packed(geometry.leaves[index], geometry.dtype) if kept is None else kept


def place(leaf: Leaf) -> str:
    """Where a leaf stands, as error messages say it."""
    return "scene" + "".join(f"[{i}]" for i in leaf.path)


def _gather(kind: Kind, key: tuple, packs: list[tuple[int, Packed]], leaves, dtype) -> Group:
    """One kind's group, its first primitive numbered 0."""
    data = np.concatenate([p.data for _, p in packs])
    lengths = [len(p.data) for _, p in packs]
    owner = np.repeat(np.array([index for index, _ in packs], np.int32), lengths)
    side = np.repeat(np.array([SIDES[leaves[index].shape.sides] + (MIRRORED if p.mirrored else 0) for index, p in packs], np.int8), lengths)
    exact = np.concatenate([np.zeros((len(p.data), 0)) if p.exact is None else p.exact for _, p in packs])
    extra = np.zeros((0, 3 if kind.shared_extra else 9))
    if kind.shared_extra:
        extra = np.concatenate([p.extra for _, p in packs])
        data[:, -2] = np.concatenate([[0], np.cumsum(data[:-1, -1])])
    elif any(p.extra is not None for _, p in packs):
        # a row of zeros says: flat
        extra = np.concatenate([p.extra if p.extra is not None else np.zeros((len(p.data), 9)) for _, p in packs])
    outline = np.repeat([index for index, _ in packs], [len(p.extra) for _, p in packs]) if kind.shared_extra else owner
    with np.errstate(over="ignore"):
        wild = [of[~np.isfinite(a.astype(kept)).all(axis=1)]
                for a, of, kept in ((data, owner, dtype), (extra, outline, dtype), (exact, owner, np.float64)) if len(a)]
    if any(map(len, wild)):
        leaf = leaves[np.concatenate(wild)[0]]
        raise FieldError(f"a placed shape whose numbers fit {np.dtype(dtype).name}", leaf.matrix.tolist(), place(leaf))
    tree, has_tree, order = EMPTY_TREE, False, np.arange(len(data), dtype=np.int32)
    if kind.bounds is not None and len(data):
        # bounds of the numbers that the kernel will see: kinds that have exact ones use those
        seen = np.float64 if exact.shape[1] else dtype
        low, high = kind.bounds(data.astype(seen).astype(np.float64), extra.astype(seen).astype(np.float64))
        tree, order = build(low, high, kind.leaf_most)
        has_tree = len(data) > kind.leaf_most
        owner = owner[order]
    parts = (data, dtype), (extra, np.float64 if kind.shared_extra else dtype), (side, np.int8), (exact, np.float64)
    table = Table(*carved(*((part.shape, wanted) for part, wanted in parts)))
    for to, (part, wanted) in zip(table, parts):
        if part is extra and (kind.shared_extra or not len(extra)):
            to[:] = part
        else:       # straight to its place: a million triangles twice would be a hundred MiB more
            np.take(part.astype(wanted, copy=False), order, axis=0, out=to, mode="clip")
    kept = {index: p for index, p in packs if len(p.data) <= FEW} if len(packs) <= MANY else {}
    return Group(kind, tree, table, 0, has_tree, key, owner, order, kept, sum(p.dropped for _, p in packs))


def renumbering(old: Geometry, new: Geometry, changed: Iterable[int], gone: int) -> np.ndarray:
    """The new number of each old primitive, int32; `gone` for those of leaves that have changed. The scenes' leaves must be the same
    otherwise."""
    number, kept = np.full(len(old.leaf), gone, np.int32), np.ones(len(old.leaves), bool)
    kept[list(changed)] = False
    groups = {group.kind: group for group in new.groups}
    for group in old.groups:
        now = groups.get(group.kind)
        if now is None or not len(group.owner):
            continue
        place = np.empty(len(now.order), np.int32)
        place[now.order] = np.arange(len(now.order), dtype=np.int32) + now.first
        stays = np.flatnonzero(kept[group.owner])
        # what stays of the old ones stands in the new order as it did, without what came
        old_rank = np.sort(group.order[stays]).searchsorted(group.order[stays])
        new_stays = np.sort(now.order[kept[now.owner]])
        number[group.first + stays] = place[new_stays[old_rank]]
    return number
