"""The walk of rays through a tree: 64 at a time where they keep together, one at a time where they don't.

Rays that keep together - from the eye, toward a light, off a plane mirror - are walked as a *beam*: the pyramid around them is tested
against the eight children of a node at once. Where a child is wider than the pyramid that is all; the others and all leaves are tested
against the rays, sixteen at a time. Where few of them are left, and from the root on for rays that scatter, it is each ray that is tested
against the eight children; through large trees, rays that scatter are walked singly, several in turns, so that none waits for memory.
Whichever way, `next_leaf` gives the next leaf that may be hit and the vectors of rays that may hit it: a shape's kernel knows no
difference.

A ray enters the tree's frame at the root's box and with a direction whose largest part is 1: neither distance nor speed costs precision,
and no inf or NaN can arise. Tests are conservative: origins are shifted outward by a bound on all rounding (SLACK), so no hit is culled.
"""
from typing import NamedTuple

import numpy as np

from rtcore.across import largest, lowest_bit
from rtcore.bvh import LINK, NO_CHILD, NODE, ORDER, STACK, WIDTH
from rtcore.jit import inline, inline_new
from rtcore.lanes import (along, any_lane, bits, fma, greatest, least, load, load3, narrow, select, size, splat, store, vec3, with_sign)
from rtcore.pyramid import (ACTIVE, ALIVE, AXIS, BEAM_FROM, BEAM_TO, ENTER, FARTHEST, FLOOR, FROM, HIGHS, INVERSE, LEAVE, LOWS, MODE,
                            OCTANT, REACH, RUNNING, SIGN, SLOPE_FROM, SLOPE_TO, TOP, WAITING, WAY, bundle, common)
from rtcore.turns import empty_sets, joined, keep, meeting, octets, ones, prefetch_either, push
from rtcore.wave import DX, OX, START, UNWANTED, T

PACKET = 64
GROUPS = PACKET // 8
SLACK = np.float32(2.0 ** -21)
ONE = np.float32(1)
TINY = 2.0 ** -60       # a direction's part that counts as 0

#: state[MODE]: a pyramid around all rays, each ray on its own, those that meet a node together; or there is one leaf and nothing to walk.
BEAM, SINGLY, SOME, ALONE = range(4)
#: Of a beam that meets a node with no more rays than this, these are walked on as SOME: the gallery's snail, tree and mount take 6 to 9 %
#: less, a flake of 66,430 spheres 2 %, balls and tetra as long as ever; with 16 or 64 it is the same within 2 %.
FEW = 32
APART = -2              # in place of a leaf: a beam has just come down to few rays
SLOTS = 8               # rays walked in turns; a power of two
BEAM_SLACK = np.float32(2.0 ** -17)     # rounding of slopes, entries and products comes to less than a quarter of it

#: A beam's rays have at least this part along a common axis, and slopes that differ by no more than SPREAD; or WIDE where rays that scatter
#: would be walked singly. Others scatter.
STRAIGHT, SPREAD, WIDE = np.float32(0.4), np.float32(0.05), np.float32(0.35)


class Walk(NamedTuple):
    """Scratch of one packet's walk."""

    coarse: np.ndarray  # float32 (16, 64), rows as named above, in the tree's frame
    fine: np.ndarray    # P (2, 64): where the ray enters the frame, how its t scales
    beam: np.ndarray    # float32 (16), as named above
    limit: np.ndarray   # int32 (16, 64): the bits of coarse
    keys: np.ndarray    # int64 (slots, most): what waits of single rays, as `push` leaves it
    stack: np.ndarray   # int32 (1, most): what waits of beams: 2 (8 node + column) + whether all meet it; of SOME rays, the link to it
    entry: np.ndarray   # float32 (1, most): where it is entered
    mask: np.ndarray    # int64 (most): the vectors that wait for a node; of SOME rays, the rays
    slots: np.ndarray   # int64 (slots, 2): the ray, -1 none any more; how many nodes wait
    near: np.ndarray    # float32 (1, 8): where the children of a node are
    met: np.ndarray     # int64 (8): which rays meet each child of a node
    state: np.ndarray   # int64, as named above


@inline_new
def new_walk(rays):
    """Scratch for walks over these rays."""
    coarse = np.empty((16, PACKET), np.float32)
    return Walk(coarse, np.empty((2, PACKET), rays.ray.dtype), np.empty(16, np.float32), coarse.view(np.int32),
                np.empty((SLOTS, STACK + WIDTH), np.int64), np.empty((1, STACK), np.int32), np.empty((1, STACK), np.float32),
                np.empty(STACK, np.int64), np.empty((SLOTS, 2), np.int64), np.empty((1, WIDTH), np.float32), np.empty(WIDTH, np.int64),
                np.empty(9, np.int64))


@inline
def begin(walk, rays, start, n, tree, singly):
    """Bring the packet of rays start .. min(start + 64, n) to the tree's root; none of them once they are not wanted any more. singly:
    whether rays that scatter are walked singly, which costs less in a tree so large that nodes come from memory."""
    eps = 2.0 ** -20 if rays.ray.itemsize == 4 else 2.0 ** -49      # 8 roundings of the ray's precision
    frame, coarse, fine, state, box = tree.frame, walk.coarse, walk.fine, walk.state, tree.box
    alone = box.shape[0] > 0 and tree.link[LINK, 0] < 0 and box[0, 1] > box[3, 1]
    # the box that rays are tested against: the only leaf's, or the frame itself
    l0, l1, l2 = (box[0, 0], box[1, 0], box[2, 0]) if alone else (-ONE, -ONE, -ONE)
    h0, h1, h2 = (box[3, 0], box[4, 0], box[5, 0]) if alone else (ONE, ONE, ONE)
    groups = min(GROUPS, (n - start + 7) // 8) if rays.tally[UNWANTED] == 0 else 0
    alive, waiting = 0, 0
    two = splat(np.float32(2))
    x0, y0, z0, x1, y1, z1 = two, two, two, -two, -two, -two
    fuzz = splat(BEAM_SLACK)
    for g in range(groups):
        i, j = start + g * 8, g * 8
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
        pad = away + 0.001
        a0, b0, c0 = (l0 - pad - o.x) * ix, (l1 - pad - o.y) * iy, (l2 - pad - o.z) * iz
        a1, b1, c1 = (h0 + pad - o.x) * ix, (h1 + pad - o.y) * iy, (h2 + pad - o.z) * iz
        enter = greatest(greatest(least(a0, a1), least(b0, b1)), greatest(least(c0, c1), 0))
        leave = least(least(greatest(a0, a1), greatest(b0, b1)), greatest(c0, c1))
        far = load(rays.ray, T, i)
        meets = (enter <= leave) & (far > load(rays.ray, START, i))
        if any_lane(meets):
            alive |= 1 << g
            waiting |= bits(meets) << j
        if alone:
            continue
        o = along(o, enter, d)
        store(fine, 0, j, enter)
        store(fine, 1, j, speed)
        kx, ky, kz = fma(size(o.x) + 1, SLACK, away), fma(size(o.y) + 1, SLACK, away), fma(size(o.z) + 1, SLACK, away)
        store(coarse, INVERSE, j, narrow(ix))
        store(coarse, INVERSE + 1, j, narrow(iy))
        store(coarse, INVERSE + 2, j, narrow(iz))
        store(coarse, LOWS, j, narrow(-(o.x + kx) * ix))
        store(coarse, LOWS + 1, j, narrow(-(o.y + ky) * iy))
        store(coarse, LOWS + 2, j, narrow(-(o.z + kz) * iz))
        store(coarse, HIGHS, j, narrow(-(o.x - kx) * ix))
        store(coarse, HIGHS + 1, j, narrow(-(o.y - ky) * iy))
        store(coarse, HIGHS + 2, j, narrow(-(o.z - kz) * iz))
        store(coarse, REACH, j, select(meets, _reach(far, speed, enter), np.float32(-1)))
        dx, dy, dz = narrow(d.x), narrow(d.y), narrow(d.z)
        store(coarse, WAY, j, dx)
        store(coarse, WAY + 1, j, dy)
        store(coarse, WAY + 2, j, dz)
        store(coarse, FROM, j, narrow(o.x))
        store(coarse, FROM + 1, j, narrow(o.y))
        store(coarse, FROM + 2, j, narrow(o.z))
        fuzz = greatest(fuzz, narrow(away))
        x0, x1 = least(x0, select(meets, dx, two)), greatest(x1, select(meets, dx, -two))
        y0, y1 = least(y0, select(meets, dy, two)), greatest(y1, select(meets, dy, -two))
        z0, z1 = least(z0, select(meets, dz, two)), greatest(z1, select(meets, dz, -two))
    state[TOP], state[FLOOR], state[WAITING], state[ALIVE] = 0, -1, waiting, alive
    if alive == 0 or box.shape[0] == 0:
        state[MODE] = BEAM
    elif alone:
        state[MODE], state[ACTIVE], state[TOP] = ALONE, alive, 1
    else:
        # the axis along which all rays go the same way, and furthest
        along_x, along_y, along_z = common(x0, x1), common(y0, y1), common(z0, z1)
        axis = 0 if along_x >= along_y and along_x >= along_z else 1 if along_y >= along_z else 2
        state[MODE] = BEAM
        straight = max(along_x, max(along_y, along_z)) >= STRAIGHT
        if not straight or not bundle(coarse, walk.beam, state, axis, largest(fuzz), groups, WIDE if singly else SPREAD):
            if singly:
                state[MODE], state[RUNNING] = SINGLY, SLOTS
                for k in range(SLOTS):
                    walk.slots[k, 0], walk.slots[k, 1] = 0, 0
            else:
                state[MODE] = SOME
        some = lowest_bit(waiting)
        state[OCTANT] = (coarse[WAY, some] < 0) + 2 * (coarse[WAY + 1, some] < 0) + 4 * (coarse[WAY + 2, some] < 0)
        walk.stack[0, 0], walk.entry[0, 0], walk.mask[0], state[TOP] = -1, 0, alive, 1
        if state[MODE] == SOME:
            walk.stack[0, 0], walk.mask[0], state[FLOOR] = 0, waiting, 0


@inline
def _reach(far, speed, enter):
    """How far past its entry a ray may still hit, in the tree's frame, float32 rounded up."""
    return narrow(far * speed - enter + fma(enter, SLACK, SLACK)) * np.float32(1 + 2.0 ** -20)


@inline
def shrink(walk, rays, start, touched):
    """After a leaf: the vectors `touched`, as bits, which may have hit something, need not look past it. Most leaves are met for nothing;
    to have all active ones look took 1 % of the time of a flake of 7,381 spheres, 5 % of one of 66,430."""
    coarse = walk.coarse
    if walk.state[MODE] == ALONE or touched == 0:
        return
    while touched:
        g = lowest_bit(touched)
        touched &= touched - 1
        reach = _reach(load(rays.ray, T, start + g * 8), load(walk.fine, 1, g * 8), load(walk.fine, 0, g * 8))
        store(coarse, REACH, g * 8, least(load(coarse, REACH, g * 8), reach))
    if walk.state[MODE] == BEAM:
        farthest = splat(np.float32(-1))
        for g in range(GROUPS):
            if (walk.state[ALIVE] >> g) & 1:
                farthest = greatest(farthest, load(coarse, REACH, g * 8))
        walk.beam[FARTHEST] = largest(farthest)


@inline
def next_leaf(walk, tree, table):
    """The next leaf that rays of the packet may hit, as `leaf_first` and `leaf_end` read it, or -1; `active` tells the vectors that may.
    table: of the primitives, a `kind.Table`, to be fetched ahead."""
    state, leaf = walk.state, APART
    if state[MODE] == ALONE:
        state[TOP] -= 1
        return -1 - np.int64(tree.link[LINK, 0]) if state[TOP] == 0 else -1
    if state[MODE] == SINGLY:
        return _next_of_ray(walk, tree, table)
    while leaf == APART:
        if state[FLOOR] >= 0:
            leaf = _next_of_some(walk, tree, table)
            if leaf >= 0 or state[MODE] == SOME:
                return leaf
            state[FLOOR] = -1
        leaf = _next_of_beam(walk, tree, table)
    return leaf


@inline
def only_ray(walk):
    """The only ray of the packet that may hit the leaf, or -1: any of the active vectors' may."""
    return walk.slots[walk.state[TOP], 0] if walk.state[MODE] == SINGLY else -1


@inline
def leaf_first(leaf):
    """The leaf's first primitive."""
    return leaf >> 3


@inline
def leaf_end(leaf):
    """The primitive after the leaf's last."""
    return (leaf >> 3) + (leaf & 7) + 1


@inline
def _next_of_ray(walk, tree, table):
    """Rays singly, some in turns: while one's next node comes from memory, the others go on."""
    coarse, limit, keys, state, slots = walk.coarse, walk.limit, walk.keys, walk.state, walk.slots
    box, link = tree.box, tree.link
    slot, running, waiting = state[TOP], state[RUNNING], state[WAITING]
    while running > 0:
        slot = (slot + 1) & (SLOTS - 1)
        ray, top = slots[slot, 0], slots[slot, 1]
        if top == 0:
            if waiting == 0:
                running -= ray >= 0
                slots[slot, 0] = -1
                continue
            ray, top = lowest_bit(waiting), 1
            slots[slot, 0], keys[slot, 0] = ray, 0       # the root, entered at 0
            waiting &= waiting - 1
        top -= 1
        reach, key = limit[REACH, ray], keys[slot, top]
        while top > 0 and key >> 32 > reach:
            top -= 1
            key = keys[slot, top]
        slots[slot, 1] = top
        if key >> 32 > reach:
            continue
        node = np.int64(np.int32(key))
        if node < 0:
            state[TOP], state[RUNNING], state[WAITING], state[ACTIVE] = slot, running, waiting, 1 << (ray >> 3)
            return -1 - node
        ix, iy, iz = coarse[INVERSE, ray], coarse[INVERSE + 1, ray], coarse[INVERSE + 2, ray]
        # the planes that are met first, and those that are met last
        x0, x1 = (0, 3) if ix > 0 else (3, 0)
        y0, y1 = (1, 4) if iy > 0 else (4, 1)
        z0, z1 = (2, 5) if iz > 0 else (5, 2)
        row = node << 3
        x = fma(load(box, row + x0, 0), ix, coarse[LOWS + x0, ray])
        y = fma(load(box, row + y0, 0), iy, coarse[LOWS + y0, ray])
        z = fma(load(box, row + z0, 0), iz, coarse[LOWS + z0, ray])
        u = fma(load(box, row + x1, 0), ix, coarse[LOWS + x1, ray])
        v = fma(load(box, row + y1, 0), iy, coarse[LOWS + y1, ray])
        w = fma(load(box, row + z1, 0), iz, coarse[LOWS + z1, ray])
        enter = greatest(greatest(x, y), greatest(z, np.float32(0)))
        top += push(keys, slot, top, enter, link, row + LINK, enter <= least(least(u, v), least(w, coarse[REACH, ray])))
        slots[slot, 1] = top
        child = np.int64(np.int32(keys[slot, max(top - 1, 0)]))
        prefetch_either(child >= 0, box, NODE * child, table.data, table.exact, leaf_first(-1 - child))
    state[TOP], state[RUNNING], state[WAITING] = slot, running, waiting
    return -1


@inline
def _next_of_some(walk, tree, table):
    """Rays that scatter, or are few, all of which that meet a node together: each against its eight children at once. Down to the floor of
    the stack, below which a beam's nodes wait."""
    coarse, stack, mask, met, state = walk.coarse, walk.stack, walk.mask, walk.met, walk.state
    box, link = tree.box, tree.link
    top, octant, floor = state[TOP], state[OCTANT], state[FLOOR]
    while top > floor:
        top -= 1
        node, rays, below = np.int64(stack[0, top]), mask[top], np.int64(stack[0, max(top - 1, floor)])
        prefetch_either(below >= 0, box, NODE * below, table.data, table.exact, leaf_first(-1 - below))
        if node < 0:
            state[TOP], state[ACTIVE] = top, octets(rays)
            return -1 - node
        row = node << 3
        x0, y0, z0 = load(box, row, 0), load(box, row + 1, 0), load(box, row + 2, 0)
        x1, y1, z1 = load(box, row + 3, 0), load(box, row + 4, 0), load(box, row + 5, 0)
        sets = empty_sets()
        while rays:
            j, bit = lowest_bit(rays), rays & -rays
            rays ^= bit
            ix, iy, iz = coarse[INVERSE, j], coarse[INVERSE + 1, j], coarse[INVERSE + 2, j]
            a, u = fma(x0, ix, coarse[LOWS, j]), fma(x1, ix, coarse[HIGHS, j])
            b, v = fma(y0, iy, coarse[LOWS + 1, j]), fma(y1, iy, coarse[HIGHS + 1, j])
            c, w = fma(z0, iz, coarse[LOWS + 2, j]), fma(z1, iz, coarse[HIGHS + 2, j])
            near = greatest(greatest(least(a, u), least(b, v)), greatest(least(c, w), np.float32(0)))
            far = least(least(greatest(a, u), greatest(b, v)), least(greatest(c, w), coarse[REACH, j]))
            sets = joined(sets, near <= far, bit)
        keep(met, sets)
        order = np.int64(link[row + ORDER, octant]) & 0xFFFFFFFF | NO_CHILD << 32      # eight leave no room for the end
        while order & 15 != NO_CHILD:
            k = order & 15
            stack[0, top], mask[top] = link[row + LINK, k], met[k]
            top += met[k] != 0
            order >>= 4
    state[TOP] = floor
    return -1


@inline
def _next_of_beam(walk, tree, table):
    """All rays together: the next leaf that one of them meets, or APART once few meet a node. A box that is wider than the beam around them
    is taken to be met."""
    coarse, beam, stack, entry, mask, near, state = walk.coarse, walk.beam, walk.stack, walk.entry, walk.mask, walk.near, walk.state
    box, link = tree.box, tree.link
    top, axis = state[TOP], state[AXIS]
    p, q = (axis + 1) % 3, (axis + 2) % 3
    sign, farthest = beam[SIGN], beam[FARTHEST]
    main0, main1 = (axis, axis + 3) if sign > 0 else (axis + 3, axis)
    while top > 0:
        top -= 1
        place, waiting, node = np.int64(stack[0, top]), mask[top], np.int64(0)
        below = max(np.int64(stack[0, max(top - 1, 0)]), 0)
        child = np.int64(link[((below >> 4) << 3) + LINK, (below >> 1) & 7])
        prefetch_either(child >= 0, box, NODE * child, table.data, table.exact, leaf_first(-1 - child))
        if not entry[0, top] <= farthest:
            continue
        if place >= 0:
            k = (place >> 1) & 7
            row = (place >> 4) << 3
            node = np.int64(link[row + LINK, k])
            if node < 0 or place & 1 == 0:
                rays = meeting(coarse, box, row, k) & state[WAITING]       # not what a longer packet has left behind
                waiting &= octets(rays)
                if waiting == 0:
                    continue
                if node < 0:
                    state[TOP], state[ACTIVE] = top, waiting
                    return -1 - node
                if ones(rays) <= FEW:
                    stack[0, top], mask[top], state[TOP], state[FLOOR] = node, rays, top + 1, top
                    return APART
        row = node << 3
        enter = greatest(fma(load(box, row + main0, 0), sign, beam[ENTER]), np.float32(0))
        leave = least(fma(load(box, row + main1, 0), sign, beam[LEAVE]), farthest)
        s0, s1 = beam[SLOPE_FROM + p], beam[SLOPE_TO + p]
        low = least(s0 * enter, s0 * leave) + beam[BEAM_FROM + p]
        high = greatest(s1 * enter, s1 * leave) + beam[BEAM_TO + p]
        a, b = load(box, row + p, 0), load(box, row + p + 3, 0)
        ok, narrower = (enter <= leave) & (low <= b) & (high >= a), high - low <= b - a
        s0, s1 = beam[SLOPE_FROM + q], beam[SLOPE_TO + q]
        low = least(s0 * enter, s0 * leave) + beam[BEAM_FROM + q]
        high = greatest(s1 * enter, s1 * leave) + beam[BEAM_TO + q]
        a, b = load(box, row + q, 0), load(box, row + q + 3, 0)
        met, sure = bits(ok & (low <= b) & (high >= a)), bits(narrower & (high - low <= b - a))
        store(near, 0, 0, enter)
        base = top
        while met:
            k = lowest_bit(met)
            met &= met - 1
            at, there = near[0, k], top
            while there > base and entry[0, there - 1] < at:
                entry[0, there], stack[0, there] = entry[0, there - 1], stack[0, there - 1]
                there -= 1
            entry[0, there], stack[0, there], mask[top] = at, (node << 4) + 2 * k + ((sure >> k) & 1), waiting
            top += 1
    state[TOP] = 0
    return -1
