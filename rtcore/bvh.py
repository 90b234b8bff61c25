"""Bounding volume hierarchy: build and validate; `walk.py` walks it.

Built binary by binned surface area (Wald 2007), then collapsed so that a node has up to eight children (Ylitie, Karras, Laine 2017), whose
boxes one vector instruction tests together. Boxes are float32 in the tree's own frame, (world - center)·scale, where the root fits into
-1 .. 1: so a scene far from the origin or of any size costs nothing in precision.
"""
from typing import NamedTuple

import numpy as np

from rtcore.jit import kernel
from rtcore.memory import carved

WIDTH = 8               # children of a node, and primitives in a leaf, at most
BINS = 16
DEEPEST = 48            # below this, splits halve: the stack is bounded whatever the input
STACK = (DEEPEST + 32) * (WIDTH - 1) + 1     # nodes that wait at once: seven a level, at most


class Tree(NamedTuple):
    """box (8 m, 8) float32 and link (8 m, 8) int32, the same memory: eight rows a node, a column a child, four cache lines in all.

    Rows 0 to 5 of a node, in `box`: low x, y, z and high x, y, z of the children in the tree's frame; where there is no child, a box inside
    out, which nothing meets. Row 6, in `link`: a child's node, or for a leaf -1 - (8 first + count - 1) of its primitives. Row 7, in
    `link`, for each octant of directions (bit k: part k is negative): the children from far to near, four bits each, then NO_CHILD.
    frame (4,) float64: center, scale. Node 0 is the root; a node comes after its parent.
    """

    box: np.ndarray
    link: np.ndarray
    frame: np.ndarray


NODE, LINK, ORDER = 8, 6, 7     # rows of a node, and which of them hold the links and the orders
NO_CHILD = 15
EMPTY_TREE = Tree(np.zeros((0, WIDTH), np.float32), np.zeros((0, WIDTH), np.int32), np.zeros(4))
NOWHERE = 2.0 ** 60     # low of a box inside out; times any inverse direction still a float32


# --- build ---

@kernel
def _split(low, high, leaf_most, box, link, order):
    """Fill box, link and order; returns the number of nodes."""
    n = low.shape[0]
    stack = np.empty((2 * (DEEPEST + 32), 4), np.int32)      # first, last, parent whose right child this is, depth
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, n, -1, 0
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


@kernel
def _best_cuts(box, link, cost, cut):
    """Where to cut the binary tree into nodes of up to eight children so that the sum of their areas, which is that of their visits, is the
    least (Ylitie, Karras, Laine 2017, section 3.1; here the leaves are given).

    cost, float32 (n, 8), is scratch: cost[b, i] is the sum below b if b may become i children of one node, of which it is one itself for
    i = 1. cut, int8 (n, 8): how many of them b's left child becomes; 0: b is no more than with i - 1, or a leaf. cut[b, 1] is for b's own
    eight children.
    """
    for b in range(len(box) - 1, -1, -1):       # children come after their parents
        cut[b], cost[b] = 0, 0
        if link[b, 1] > 0:
            continue
        left, right = b + 1, link[b, 0]
        ex, ey, ez = box[b, 3] - box[b, 0], box[b, 4] - box[b, 1], box[b, 5] - box[b, 2]
        for i in range(1, WIDTH):
            most = WIDTH if i == 1 else i
            best, best_k = np.float32(np.inf), 0
            for k in range(1, most):
                c = cost[left, k] + cost[right, most - k]
                if c < best:
                    best, best_k = c, k
            if i == 1:
                best += ex * ey + ey * ez + ez * ex
            elif not best < cost[b, i - 1]:
                best, best_k = cost[b, i - 1], 0
            cost[b, i], cut[b, i] = best, best_k


@kernel
def _widen(box, link, cut, wide, children):
    """The binary tree with up to eight children a node, cut as `_best_cuts` says. Returns the number of nodes; wide and children, as
    `Tree.box` and `Tree.link`, have room for as many as the binary tree has."""
    stack = np.empty((DEEPEST + 32) * WIDTH, np.int32)      # binary nodes that become wide ones
    slot = np.empty((DEEPEST + 32) * WIDTH, np.int32)       # where their number belongs: 8 parent + column
    kids, key, rank = np.empty(WIDTH, np.int32), np.empty(WIDTH), np.empty(WIDTH, np.int64)
    part, share = np.empty(WIDTH, np.int32), np.empty(WIDTH, np.int64)      # what is still to be cut, into how many
    stack[0], slot[0] = 0, -1
    top, nodes = 1, 0
    while top > 0:
        top -= 1
        node, nodes = nodes, nodes + 1
        if slot[top] >= 0:
            children[NODE * (slot[top] // WIDTH) + LINK, slot[top] % WIDTH] = node
        n, parts = 0, 1
        part[0], share[0] = stack[top], WIDTH
        while parts > 0:
            parts -= 1
            b, i = part[parts], share[parts]
            k = cut[b, 1] if i == WIDTH else cut[b, i]
            while k == 0 and i > 1:
                i -= 1
                k = cut[b, i]
            if i == 1 or link[b, 1] > 0:
                kids[n] = b
                n += 1
            else:
                part[parts], share[parts] = link[b, 0], i - k
                part[parts + 1], share[parts + 1] = b + 1, k
                parts += 2
        for k in range(WIDTH):
            for row in range(3):
                wide[NODE * node + row, k], wide[NODE * node + 3 + row, k] = NOWHERE, -NOWHERE
            children[NODE * node + LINK, k] = -1
        for octant in range(8):
            for k in range(n):
                b, key[k], rank[k] = kids[k], 0.0, k
                for row in range(3):
                    key[k] += (box[b, row] + box[b, 3 + row]) * (-1 if (octant >> row) & 1 else 1)
                at = k
                while at > 0 and key[rank[at - 1]] < key[k]:
                    rank[at] = rank[at - 1]
                    at -= 1
                rank[at] = k
            order = NO_CHILD << (4 * n)
            for k in range(n):
                order |= rank[k] << (4 * k)
            children[NODE * node + ORDER, octant] = np.int32(order)
        for k in range(n):
            b = kids[k]
            for row in range(6):
                wide[NODE * node + row, k] = box[b, row]
            if link[b, 1] > 0:
                children[NODE * node + LINK, k] = -1 - (WIDTH * link[b, 0] + link[b, 1] - 1)
            else:
                stack[top], slot[top] = b, WIDTH * node + k
                top += 1
    return nodes


def build(low: np.ndarray, high: np.ndarray, leaf_most: int) -> tuple[Tree, np.ndarray]:
    """A tree over n >= 1 boxes, low and high (n, 3) float64, with leaves of at most `leaf_most` <= 8 (one leaf if there are no more).

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
        box, link = box[:nodes], link[:nodes]
    outward = box.astype(np.float32)
    outward[:, :3] = np.nextafter(outward[:, :3], np.float32(-np.inf))
    outward[:, 3:] = np.nextafter(outward[:, 3:], np.float32(np.inf))
    rows = _lines(NODE * (len(box) // 2 + 1))
    cut = np.zeros((len(outward), WIDTH), np.int8)
    if n > leaf_most:
        _best_cuts(outward, link, np.empty((len(outward), WIDTH), np.float32), cut)
    nodes = _widen(outward, link, cut, rows.view(np.float32), rows)
    kept = _lines(NODE * nodes)
    kept[:] = rows[:NODE * nodes]
    return Tree(kept.view(np.float32), kept, np.array([*center, scale])), order


def _lines(rows: int) -> np.ndarray:
    """(rows, 8) int32, nodes at the start of cache lines."""
    return carved(((rows, WIDTH), np.int32))[0]


def leaf_range(link: int) -> tuple[int, int]:
    """First primitive and the one after the last of a leaf, from its entry in `Tree.link`."""
    code = -1 - int(link)
    return code // WIDTH, code // WIDTH + code % WIDTH + 1


def validate(tree: Tree, low: np.ndarray, high: np.ndarray) -> None:
    """Raise AssertionError unless every box (in the tree's order) lies in its leaf, every child in its parent, each primitive in one leaf,
    and a walk needs no more than its stack."""
    low, high = (low - tree.frame[:3]) * tree.frame[3], (high - tree.frame[:3]) * tree.frame[3]
    seen = np.zeros(len(low), int)
    todo = [(0, np.full(3, -np.inf), np.full(3, np.inf), 1)]
    while todo:
        node, around_low, around_high, waiting = todo.pop()
        box = tree.box[NODE * node:NODE * node + 6].T
        there = box[:, 0] <= box[:, 3]
        waiting += np.count_nonzero(there) - 1
        assert waiting <= STACK, "deeper than the stack"
        for link, low_, high_ in zip(tree.link[NODE * node + LINK][there], box[there, :3], box[there, 3:]):
            assert (low_ >= around_low).all() and (high_ <= around_high).all(), f"a child of node {node} sticks out"
            if link >= 0:
                todo.append((int(link), low_, high_, waiting))
                continue
            first, last = leaf_range(link)
            seen[first:last] += 1
            assert (low[first:last] >= low_).all() and (high[first:last] <= high_).all(), f"a primitive sticks out of a leaf of node {node}"
    assert (seen == 1).all(), "a primitive in no leaf or in several"
