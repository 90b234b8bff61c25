"""Bounding volume hierarchy: build, walk, validate.

The tree is binary, built by binned surface area (Wald 2007), stored depth first: a node's left child follows it. Boxes are float32 in
the tree's own frame, (world - center)·scale, where the root fits into -1 .. 1: so a scene far from the origin or of any size costs
nothing in precision. The walk takes packets of 64 rays as 8 vectors with a bit per vector still in the node. A ray enters the frame at
the root's box and with a direction whose largest part is 1, so distance and speed cost nothing either, and no inf or NaN can arise.
Tests are conservative: the origin is shifted outward by a bound on all rounding (SLACK), so no true hit is ever culled.
"""
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline, kernel
from rtcore.lanes import any_lane, bits, fma, greatest, along, least, load, load3, narrow, select, size, store, vec3, with_sign
from rtcore.wave import DX, OX, START, T

PACKET = 64
GROUPS = PACKET // 8
BINS = 16
DEEPEST = 48            # below this, splits halve: the stack is bounded whatever the input
STACK = 96
SLACK = np.float32(2.0 ** -21)
TINY = 2.0 ** -60       # a direction's part that counts as 0


class Tree(NamedTuple):
    """box (n, 6) float32: low, high in the tree's frame. link (n, 2) int32: leaf: first primitive, count; inner node: right child,
    -1 - axis. frame (4,) float64: center, scale."""

    box: np.ndarray
    link: np.ndarray
    frame: np.ndarray


class Walk(NamedTuple):
    """Scratch of one packet's walk."""

    coarse: np.ndarray  # float32 (10, 64): 1/direction, offsets of low and of high planes, reach; in the tree's frame
    fine: np.ndarray    # P (2, 64): where the ray enters the frame, how its t scales
    stack: np.ndarray   # int32
    mask: np.ndarray    # int64: the vectors that wait for the node on the stack
    state: np.ndarray   # int64: top of stack, active vectors, signs of the direction


EMPTY_TREE = Tree(np.zeros((0, 6), np.float32), np.zeros((0, 2), np.int32), np.zeros(4))


# --- build ---

@kernel
def _split(low, high, leaf_most, box, link, order):
    """Fill box, link and order; returns the number of nodes."""
    n = low.shape[0]
    stack = np.empty((STACK * 2, 4), np.int32)      # first, last, parent whose right child this is, depth
    stack[0] = np.array([0, n, -1, 0], np.int32)
    top, nodes = 1, 0
    bin_low, bin_high = np.empty((BINS, 3)), np.empty((BINS, 3))
    count, cost = np.empty(BINS, np.int64), np.empty(BINS)
    while top > 0:
        top -= 1
        first, last, parent, depth = stack[top]
        node = nodes
        nodes += 1
        if parent >= 0:
            link[parent, 0] = node
        c_low, c_high = np.empty(3), np.empty(3)
        for k in range(3):
            box[node, k], box[node, 3 + k] = np.inf, -np.inf
            c_low[k], c_high[k] = np.inf, -np.inf
        for j in range(first, last):
            p = order[j]
            for k in range(3):
                box[node, k] = min(box[node, k], low[p, k])
                box[node, 3 + k] = max(box[node, 3 + k], high[p, k])
                c = 0.5 * low[p, k] + 0.5 * high[p, k]
                c_low[k], c_high[k] = min(c_low[k], c), max(c_high[k], c)
        size_ = last - first
        best_cost, best_axis, best_bin = np.inf, -1, 0
        if size_ > 1 and depth < DEEPEST:
            for k in range(3):
                width = c_high[k] - c_low[k]
                if not width > 0:
                    continue
                for b in range(BINS):
                    count[b] = 0
                    for m in range(3):
                        bin_low[b, m], bin_high[b, m] = np.inf, -np.inf
                for j in range(first, last):
                    p = order[j]
                    b = min(int((0.5 * low[p, k] + 0.5 * high[p, k] - c_low[k]) / width * BINS), BINS - 1)
                    count[b] += 1
                    for m in range(3):
                        bin_low[b, m], bin_high[b, m] = min(bin_low[b, m], low[p, m]), max(bin_high[b, m], high[p, m])
                for b in range(BINS):
                    cost[b] = 0.0
                for way in range(2):        # from the left, then from the right
                    l0, l1, l2, h0, h1, h2, seen = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf, 0
                    for step in range(BINS - 1):
                        b = step if way == 0 else BINS - 1 - step
                        seen += count[b]
                        l0, l1, l2 = min(l0, bin_low[b, 0]), min(l1, bin_low[b, 1]), min(l2, bin_low[b, 2])
                        h0, h1, h2 = max(h0, bin_high[b, 0]), max(h1, bin_high[b, 1]), max(h2, bin_high[b, 2])
                        cut = b if way == 0 else b - 1
                        if seen == 0 or seen == size_:
                            cost[cut] = np.inf
                        else:
                            cost[cut] += seen * ((h0 - l0) * (h1 - l1) + (h1 - l1) * (h2 - l2) + (h2 - l2) * (h0 - l0))
                for b in range(BINS - 1):
                    if cost[b] < best_cost:
                        best_cost, best_axis, best_bin = cost[b], k, b
        ex, ey, ez = box[node, 3] - box[node, 0], box[node, 4] - box[node, 1], box[node, 5] - box[node, 2]
        if size_ <= leaf_most and not best_cost + ex * ey + ey * ez + ez * ex < size_ * (ex * ey + ey * ez + ez * ex):
            link[node, 0], link[node, 1] = first, size_
            continue
        middle = first
        if best_axis >= 0:
            width = c_high[best_axis] - c_low[best_axis]
            for j in range(first, last):
                p = order[j]
                if min(int((0.5 * low[p, best_axis] + 0.5 * high[p, best_axis] - c_low[best_axis]) / width * BINS), BINS - 1) <= best_bin:
                    order[j], order[middle] = order[middle], order[j]
                    middle += 1
        if middle in (first, last):
            best_axis, middle = max(best_axis, 0), (first + last) // 2
        link[node, 1] = -1 - best_axis
        stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = middle, last, node, depth + 1
        stack[top + 1, 0], stack[top + 1, 1], stack[top + 1, 2], stack[top + 1, 3] = first, middle, -1, depth + 1
        top += 2
    return nodes


def build(low: np.ndarray, high: np.ndarray, leaf_most: int) -> tuple[Tree, np.ndarray]:
    """A tree over n >= 1 boxes, low and high (n, 3) float64, with leaves of at most `leaf_most` (one leaf if there are no more).

    Returns the tree and the order (n,) in which the primitives have to be stored: the tree counts them so.
    """
    n = len(low)
    order = np.arange(n, dtype=np.int32)
    # a number of either precision; any point near will do
    center = np.float64(np.float32(np.clip(0.5 * low.min(0) + 0.5 * high.max(0), -1e38, 1e38)))
    half = float(max((high.max(0) - center).max(), (center - low.min(0)).max()))
    scale = 2.0 ** -np.ceil(np.log2(half)) if half > 0 else 1.0
    low, high = (low - center) * scale, (high - center) * scale
    if n <= leaf_most:
        box, link = np.concatenate([low.min(0), high.max(0)])[None], np.array([[0, n]], np.int32)
    else:
        box, link = np.empty((2 * n, 6)), np.empty((2 * n, 2), np.int32)
        nodes = _split(low, high, leaf_most, box, link, order)
        box, link = box[:nodes], link[:nodes].copy()
    outward = box.astype(np.float32)
    outward[:, :3] = np.nextafter(outward[:, :3], np.float32(-np.inf))
    outward[:, 3:] = np.nextafter(outward[:, 3:], np.float32(np.inf))
    return Tree(outward, link, np.array([*center, scale])), order


def validate(tree: Tree, low: np.ndarray, high: np.ndarray) -> None:
    """Raise AssertionError unless every box (in the tree's order) lies in its leaf, every node in its parent, each leaf once."""
    low, high = (low - tree.frame[:3]) * tree.frame[3], (high - tree.frame[:3]) * tree.frame[3]
    seen = np.zeros(len(low), int)
    todo = [(0, 0)]
    while todo:
        node, depth = todo.pop()
        first, count = tree.link[node]
        assert depth < STACK - 2, "deeper than the stack"
        if count > 0:
            seen[first:first + count] += 1
            inside = (low[first:first + count] >= tree.box[node, :3]) & (high[first:first + count] <= tree.box[node, 3:])
            assert inside.all(), f"a primitive sticks out of leaf {node}"
            continue
        for child in (node + 1, first):
            inside = (tree.box[child, :3] >= tree.box[node, :3]).all() and (tree.box[child, 3:] <= tree.box[node, 3:]).all()
            assert inside, f"node {child} sticks out"
            todo.append((child, depth + 1))
    assert (seen == 1).all(), "a primitive in no leaf or in several"


# --- walk ---

@inline
def new_walk(rays):
    """Scratch for walks over these rays."""
    return Walk(np.empty((10, PACKET), np.float32), np.empty((2, PACKET), rays.ray.dtype), np.empty(STACK, np.int32),
                np.empty(STACK, np.int64), np.empty(3, np.int64))


@inline
def begin(walk, rays, start, n, tree):
    """Bring the packet of rays start .. min(start + 64, n) to the tree's root."""
    eps = 2.0 ** -20 if rays.ray.itemsize == 4 else 2.0 ** -49      # 8 roundings of the ray's precision
    frame = tree.frame
    groups = min(GROUPS, (n - start + 7) // 8)
    alive = 0
    for g in range(groups):
        i = start + g * 8
        o = load3(rays.ray, OX, i)
        d = load3(rays.ray, DX, i)
        longest = greatest(greatest(size(d.x), size(d.y)), size(d.z))
        d = d * (1 / longest)
        # 0 * longest makes each splat a lane vector of the rays' own type
        center = vec3(0 * longest + frame[0], 0 * longest + frame[1], 0 * longest + frame[2])
        o = (o - center) * frame[3]
        speed = longest * frame[3]
        ix = 1 / with_sign(greatest(size(d.x), TINY), d.x)
        iy = 1 / with_sign(greatest(size(d.y), TINY), d.y)
        iz = 1 / with_sign(greatest(size(d.z), TINY), d.z)
        away = greatest(greatest(size(o.x), size(o.y)), size(o.z)) * eps
        edge = away + 1.001
        x0, y0, z0 = (-edge - o.x) * ix, (-edge - o.y) * iy, (-edge - o.z) * iz
        x1, y1, z1 = (edge - o.x) * ix, (edge - o.y) * iy, (edge - o.z) * iz
        enter = greatest(greatest(least(x0, x1), least(y0, y1)), greatest(least(z0, z1), 0))
        leave = least(least(greatest(x0, x1), greatest(y0, y1)), greatest(z0, z1))
        far = load(rays.ray, T, i)
        meets = (enter <= leave) & (far > load(rays.ray, START, i))
        if any_lane(meets):
            alive |= 1 << g
        o = along(o, enter, d)
        store(walk.fine, 0, g * 8, enter)
        store(walk.fine, 1, g * 8, speed)
        kx, ky, kz = fma(size(o.x) + 1, SLACK, away), fma(size(o.y) + 1, SLACK, away), fma(size(o.z) + 1, SLACK, away)
        store(walk.coarse, 0, g * 8, narrow(ix))
        store(walk.coarse, 1, g * 8, narrow(iy))
        store(walk.coarse, 2, g * 8, narrow(iz))
        store(walk.coarse, 3, g * 8, narrow(-(o.x + kx) * ix))
        store(walk.coarse, 4, g * 8, narrow(-(o.y + ky) * iy))
        store(walk.coarse, 5, g * 8, narrow(-(o.z + kz) * iz))
        store(walk.coarse, 6, g * 8, narrow(-(o.x - kx) * ix))
        store(walk.coarse, 7, g * 8, narrow(-(o.y - ky) * iy))
        store(walk.coarse, 8, g * 8, narrow(-(o.z - kz) * iz))
        store(walk.coarse, 9, g * 8, select(meets, _reach(far, speed, enter), np.float32(-1)))
    signs = 0
    for k in range(3):
        if rays.ray[DX + k, start] < 0:
            signs |= 1 << k
    walk.stack[0] = 0
    walk.mask[0] = alive
    walk.state[0] = 1 if alive else 0
    walk.state[2] = signs


@inline
def _reach(far, speed, enter):
    """How far past its entry a ray may still hit, in the tree's frame, float32 rounded up."""
    return narrow(far * speed - enter + fma(enter, SLACK, SLACK)) * np.float32(1 + 2.0 ** -20)


@inline
def shrink(walk, rays, start):
    """After a leaf: the active vectors need not look past what they hit."""
    for g in range(GROUPS):
        if (walk.state[1] >> g) & 1:
            reach = _reach(load(rays.ray, T, start + g * 8), load(walk.fine, 1, g * 8), load(walk.fine, 0, g * 8))
            store(walk.coarse, 9, g * 8, least(load(walk.coarse, 9, g * 8), reach))


@inline
def _meets(coarse, i, l0, l1, l2, h0, h1, h2):
    ix, iy, iz = load(coarse, 0, i), load(coarse, 1, i), load(coarse, 2, i)
    x0, y0, z0 = fma(l0, ix, load(coarse, 3, i)), fma(l1, iy, load(coarse, 4, i)), fma(l2, iz, load(coarse, 5, i))
    x1, y1, z1 = fma(h0, ix, load(coarse, 6, i)), fma(h1, iy, load(coarse, 7, i)), fma(h2, iz, load(coarse, 8, i))
    near = greatest(greatest(least(x0, x1), least(y0, y1)), greatest(least(z0, z1), np.float32(0)))
    far = least(least(greatest(x0, x1), greatest(y0, y1)), least(greatest(z0, z1), load(coarse, 9, i)))
    return bits(near <= far) != 0


@inline
def next_leaf(walk, tree):
    """The next leaf that a ray of the packet may hit, or -1; `walk.state[1]` tells the vectors that may."""
    top = walk.state[0]
    while top > 0:
        top -= 1
        node, waiting = walk.stack[top], walk.mask[top]
        l0, l1, l2 = tree.box[node, 0], tree.box[node, 1], tree.box[node, 2]
        h0, h1, h2 = tree.box[node, 3], tree.box[node, 4], tree.box[node, 5]
        active = 0
        for g in range(GROUPS):
            if (waiting >> g) & 1 and _meets(walk.coarse, g * 8, l0, l1, l2, h0, h1, h2):
                active |= 1 << g
        if active == 0:
            continue
        count = tree.link[node, 1]
        if count > 0:
            walk.state[0], walk.state[1] = top, active
            return node
        near, far = node + 1, tree.link[node, 0]
        if (walk.state[2] >> (-1 - count)) & 1:
            near, far = far, near
        walk.stack[top], walk.stack[top + 1] = far, near
        walk.mask[top], walk.mask[top + 1] = active, active
        top += 2
    return -1
