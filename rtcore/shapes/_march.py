"""The search for roots of a formula along rays: eight rays at a time, each from front to back in pieces of its own, certified by intervals.

A piece is passed where the interval of its values excludes 0; or where the values at its ends have one sign and the slope between them,
by its interval, is too flat to reach 0 (from both ends: |f(a)|/fall + |f(b)|/rise > b - a); or where the slope has one sign and the ends
too. Where the slope has one sign and the ends differ there is one root, which interval Newton steps enclose. All else is cut, down to a
floor of resolution, where `settle` looks at what is there: a touch, a crossing without a proof, a jump or pole, or nothing.
"""
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import fma, greatest, least, load, size, store
from rtcore.shapes._precise import new_rows, put_along, told, value_of
from rtcore.shapes._tape import AT_ROWS, DIRECTION, GONE, INPUT, ROUGH, SLOPE, VALUE, new_registers, run
from rtcore.shapes.kind import FRONT

#: Rows of a local ray and of the state of a lane: base point and direction, what these leave of the true ones, and what a point may be
#: off beside its roundings; then, along the ray by s = t - T0, where the search begins and ends, its floor of resolution, and T0, FIRST and
#: FAR in t; then the piece A .. B, a point, f at A (0 on the surface, where its sign is not known), the step, whether a single root is
#: enclosed, and how many pieces were looked at.
BASE, WAY, BASE_REST, WAY_REST, DRIFT = 0, 3, 6, 9, 12
BEGIN, END, FLOOR, T0, FIRST, FAR, RAY_ROWS = 13, 14, 15, 16, 17, 18, 19
A, B, POINT, AT_A, STEP, ENCLOSED, TRIES, STATE_ROWS = 19, 20, 21, 22, 23, 24, 25, 26

PAD = 3 * 2.0 ** -53        # of base, direction, and the two roundings of a position
CURVE = 2.0 ** 16           # widths at the floor to each side, over which a smooth value is a parabola
NEAR = 2.0 ** 10            # floors from the start within which a root is polished: t is small there
PATIENCE = 256              # pieces after which the floor rises, so that no formula keeps a ray for ever
REACH = 32.0                # `settle` looks this much further with each lane


class Search(NamedTuple):
    """What the search works on; made once per kernel call."""

    reg: np.ndarray         # registers of the tape
    at: np.ndarray          # (AT_ROWS, 8): pieces
    point: np.ndarray       # (AT_ROWS, 8): points
    state: np.ndarray       # (STATE_ROWS, 8)
    probe: np.ndarray       # as state, at and point, of eight places on one ray
    probe_at: np.ndarray
    probe_point: np.ndarray
    rows: np.ndarray        # of the tape in double-double
    closely: np.ndarray     # (3, 3): a point in double-double
    whose: np.ndarray       # int64 (8): the ray of each lane, -1 none
    verdict: np.ndarray     # (4): what `settle` says


@kernel
def new_search():
    return Search(new_registers(), np.zeros((AT_ROWS, 8)), np.zeros((AT_ROWS, 8)), np.zeros((STATE_ROWS, 8)), np.zeros((STATE_ROWS, 8)),
                  np.zeros((AT_ROWS, 8)), np.zeros((AT_ROWS, 8)), new_rows(), np.zeros((3, 3)), np.full(8, -1), np.zeros(4))


@inline
def place(state, at, first, last):
    """The interval of positions between rows `first` and `last` of the state, whatever the rounding of the ray."""
    a, b = load(state, first, 0), load(state, last, 0)
    far, drift = greatest(size(a), size(b)), load(state, DRIFT, 0)
    for k in range(3):
        base, way = load(state, BASE + k, 0), load(state, WAY + k, 0)
        p, q = fma(a, way, base), fma(b, way, base)
        slack = fma(size(base) + far * size(way), PAD, drift)
        store(at, INPUT + 2 * k, 0, least(p, q) - slack)
        store(at, INPUT + 2 * k + 1, 0, greatest(p, q) + slack)
        store(at, DIRECTION + k, 0, way)


@kernel
def look_closely(code, search, state, k, s):
    """The value at s on the true ray of lane k of a state, and a bound on its error, by double-double."""
    out_of_line()
    for axis in range(3):
        put_along(search.closely, axis, state[BASE + axis, k], state[BASE_REST + axis, k], state[WAY + axis, k], state[WAY_REST + axis, k],
                  s, state[DRIFT, k])
    return value_of(code, search.rows, search.closely)


@kernel
def sign_at(code, search, state, k, s):
    """The value at s on the true ray of lane k of a state, as near to 0 as it may be; 0 where even double-double can't tell its sign."""
    out_of_line()
    value, off = look_closely(code, search, state, k, s)
    return told(value, off)


@kernel
def polish(code, search, k, s):
    """Two Newton steps from s toward the only root in the piece of lane k."""
    out_of_line()
    state, slope = search.state, middle(search.at[SLOPE, k], search.at[SLOPE + 1, k])
    for _ in range(2):
        value, off = look_closely(code, search, state, k, s)
        if off < np.inf:
            s = min(max(s - value / slope, state[A, k]), state[B, k])
    return s


@inline
def sure(at, k):
    """The value at a point, as near to 0 as it may be; 0 if its sign is not known."""
    low, high = at[VALUE, k], at[VALUE + 1, k]
    return 0.0 if at[GONE, k] + at[ROUGH, k] > 0 else low if low > 0 else high if high < 0 else 0.0


@inline
def middle(low, high):
    return 0.5 * low + 0.5 * high


@inline
def begin_at(state, k, a, f, step):
    """Lane k goes on from a, where the formula's value is f."""
    state[A, k], state[AT_A, k], state[STEP, k], state[ENCLOSED, k] = a, f, step, 0.0
    state[B, k] = state[POINT, k] = min(a + step, state[END, k])


@inline
def bisect(code, search, low, high, sign, row):
    """Where the value (row VALUE) or the slope (SLOPE) takes the given sign between low and high, to the last digit: by ninths."""
    probe, point = search.probe, search.probe_point
    for _ in range(20):
        width = (high - low) / 9
        for j in range(8):
            probe[POINT, j] = low + width * (j + 1)
        if not low < probe[POINT, 0] < probe[POINT, 7] < high:
            break
        place(probe, point, POINT, POINT)
        run(code, search.reg, point, row == SLOPE)
        for j in range(8):
            if middle(point[row, j], point[row + 1, j]) * sign > 0:
                high = probe[POINT, j]
                break
            low = probe[POINT, j]
    return middle(low, high)


@kernel
def touches(code, search, s, width, sign):
    """Whether the value, of the given sign on both sides, may reach 0 about s, where its slope goes through 0 or jumps."""
    out_of_line()
    probe, point, h = search.probe, search.probe_point, CURVE * width
    for i in range(8):
        probe[A, i], probe[B, i] = s - 2 * width, s + 2 * width
    place(probe, point, A, B)
    run(code, search.reg, point, True)
    if sure(point, 0) * sign > 0:
        return False
    # the bottom of the parabola through three values; at a kink, where the slope jumps by as much as it is, there is none
    before, off = look_closely(code, search, probe, 0, s - h)
    at, off1 = look_closely(code, search, probe, 0, s)
    after, off2 = look_closely(code, search, probe, 0, s + h)
    rise = sign * ((before - at) + (after - at))
    if not (point[SLOPE + 1, 0] - point[SLOPE, 0]) * h < 0.01 * rise:
        return True
    below = (after - before) ** 2 / (8 * rise)
    return not sign * at - below > 2.0 ** -10 * below + 8 * (off + off1 + off2)


@kernel
def settle(code, search, k):
    """What there is at the piece of lane k, which can't be cut further. Writes into search.verdict: whether there is a hit (1) or the
    search goes on (0), where, the value there if its sign is known, and the sign of the slope (0 of a touch)."""
    state, probe, out = search.state, search.probe, search.verdict
    at, point = search.probe_at, search.probe_point
    a, width, f = state[A, k], state[B, k] - state[A, k], state[AT_A, k]
    for j in range(8):
        for row in range(RAY_ROWS):
            probe[row, j] = state[row, k]
        probe[A, j], probe[POINT, j] = a, min(a + width * REACH ** j, state[END, k])
    place(probe, at, A, POINT)
    run(code, search.reg, at, False)
    place(probe, point, POINT, POINT)
    run(code, search.reg, point, True)
    out[0], out[1], out[2], out[3] = 0.0, probe[POINT, 0], sure(point, 0), 0.0
    if at[ROUGH, 0] > 0:
        # an edge of the domain that the values run up to closes in on 0; a jump or a pole stays as wide as it is
        near, far = at[VALUE + 1, 0] - at[VALUE, 0], at[VALUE + 1, 1] - at[VALUE, 1]
        if near < 0.5 * far < np.inf:
            out[0] = 1.0
        return
    if f == 0:      # on the surface: past what can't be told from it
        for j in range(8):
            if at[ROUGH, j] > 0:
                return
            out[1], out[2] = probe[POINT, j], sure(point, j)
            if out[2] != 0:
                return
        return
    sign = 1.0 if f > 0 else -1.0
    for j in range(8):
        if at[ROUGH, j] > 0:
            break
        there = sure(point, j) * sign
        if there == 0:      # short of where the slope has turned, only the other sign tells
            there = min(sign_at(code, search, probe, j, probe[POINT, j]) * sign, 0.0)
        turned = point[SLOPE, j] > 0 if sign > 0 else point[SLOPE + 1, j] < 0
        if turned and there >= 0:
            end = probe[POINT, j]
            s = bisect(code, search, a, end, sign, SLOPE)
            f = sign_at(code, search, probe, 0, s)
            if f * sign >= 0:
                out[1], out[2] = end, there * sign
                if touches(code, search, s, width, sign):
                    out[0], out[1], out[2] = 1.0, s, 0.0
                return
            there = f * sign
            probe[POINT, j] = s
        if there < 0:
            out[0], out[1], out[3] = 1.0, bisect(code, search, a, probe[POINT, j], -sign, VALUE), -sign
            return
        if there > 0:       # nothing to be seen of what could not be excluded
            out[1], out[2] = probe[POINT, j], there * sign
            return
    out[0] = 1.0


@inline
def begin(search, rays, n, waiting, k):
    """Give lane k the next of n rays that meets the box, or none. Returns the number of the one after."""
    state = search.state
    search.whose[k] = -1
    while waiting < n and not rays[END, waiting] > rays[BEGIN, waiting]:
        waiting += 1
    if waiting == n:
        return n
    for row in range(RAY_ROWS):
        state[row, k] = rays[row, waiting]
    search.whose[k], state[TRIES, k] = waiting, -1
    begin_at(state, k, state[BEGIN, k], 0.0, 0.0)      # a first look at the start
    return waiting + 1


@inline
def enclose(search, k):
    """One interval Newton step toward the only root in the piece of lane k; True once it is as near as it gets, the root then POINT."""
    state, a, b, m = search.state, search.state[A, k], search.state[B, k], search.state[POINT, k]
    low, high, d, d1 = search.point[VALUE, k], search.point[VALUE + 1, k], search.at[SLOPE, k], search.at[SLOPE + 1, k]
    if d1 < 0:
        low, high, d, d1 = -high, -low, -d1, -d
    slope = middle(d, min(d1, 2.0 ** 20 * d))
    guess = m - middle(low, high) / slope
    slack = 0.125 * state[FLOOR, k]
    na, nb = max(a, m - high / (d if high > 0 else d1) - slack), min(b, m - low / (d if low < 0 else d1) + slack)
    state[A, k], state[B, k] = na, max(na, nb)
    state[POINT, k] = min(max(guess, na), nb)
    slow = nb - na > 0.5 * (b - a)
    if low <= 0 <= high and (slow or d1 <= 1.01 * d) or nb - na <= 4 * slack or not na < middle(na, nb) < nb:
        return True
    if slow or not na < guess < nb:
        state[POINT, k] = middle(na, nb)
    return False


@kernel
def march(code, search, rays, n, side, single, found, doubt, roots):
    """The first root of each of n local rays (RAY_ROWS, n or more) that counts, into found (n) as t (inf: none) and doubt (n) whether it,
    or that there is none, lacks a proof.

    side: as in Table.side. single: t will be rounded to float32. roots: (0, 2), or of one ray every root is written there, as t and how
    often, and nothing into found; returns how many.
    """
    state, at, point, whose = search.state, search.at, search.point, search.whose
    found[:n] = np.inf
    doubt[:n] = 0
    waiting, live, count = 0, 0, 0
    for k in range(8):
        waiting = begin(search, rays, n, waiting, k)
        live += whose[k] >= 0
    while live > 0:
        place(state, at, A, B)
        run(code, search.reg, at, True)
        place(state, point, POINT, POINT)
        run(code, search.reg, point, False)
        for k in range(8):
            if whose[k] < 0:
                continue
            a, b, f, f1 = state[A, k], state[B, k], state[AT_A, k], sure(point, k)
            low, high, d, d1 = at[VALUE, k], at[VALUE + 1, k], at[SLOPE, k], at[SLOPE + 1, k]
            tries = state[TRIES, k] + 1
            state[TRIES, k] = tries
            if tries > 8 * PATIENCE:        # it gives up, which is no proof that there is nothing
                doubt[whose[k]] = 1
                waiting = begin(search, rays, n, waiting, k)
                live -= whose[k] < 0
                continue
            hit, proven, s, facing = False, True, 0.0, 0.0
            if tries == 0:      # the first look: on which side of the surface it starts
                if f1 == 0:
                    f1 = sign_at(code, search, state, k, a)
                begin_at(state, k, a, f1, 0.25 * (state[END, k] - a))
                continue
            if state[ENCLOSED, k] != 0:
                if not enclose(search, k):
                    continue
                hit, s, facing = True, state[POINT, k], 1.0 if d > 0 else -1.0
                if s - state[BEGIN, k] < NEAR * state[FLOOR, k]:
                    s = polish(code, search, k, s)
            else:
                passed, share, h = at[GONE, k] > 0 or low > 0 or high < 0, 0.0, b - a
                if not passed and not at[ROUGH, k] > 0:
                    monotone = d > 0 or d1 < 0
                    alike = (f > 0) == (f1 > 0)
                    if monotone and f != 0 and f1 != 0 and not alike:
                        state[ENCLOSED, k] = 1.0
                        state[POINT, k] = min(max(a + h * (f / (f - f1)), a + 0.05 * h), b - 0.05 * h)
                        continue
                    if monotone:
                        passed, share = f1 != 0, 0.6
                    elif f != 0 and f1 != 0 and alike:
                        fall, rise = (abs(d), abs(d1)) if f > 0 else (abs(d1), abs(d))
                        share = (abs(f) / fall + abs(f1) / rise) / h
                        passed = share > 1 + 1e-12
                if passed:
                    if b >= state[END, k]:
                        waiting = begin(search, rays, n, waiting, k)
                        live -= whose[k] < 0
                    else:
                        f = f1 if f1 != 0 else low if low > 0 else high if high < 0 else 0.0
                        begin_at(state, k, b, f, max(h, state[STEP, k]) * min(max(0.8 * share, 1.5), 3.0))
                    continue
                lowest = state[FLOOR, k] * (1.0 if tries < PATIENCE else 2.0 ** min((tries - PATIENCE) / 16, 900))
                if h > lowest:
                    begin_at(state, k, a, f, max(h * min(max(0.9 * share, 0.25), 0.6), 0.99 * lowest))
                    continue
                settle(code, search, k)
                hit, proven, s, facing = search.verdict[0] != 0, False, search.verdict[1], search.verdict[3]
                if not hit:
                    if s >= state[END, k] or not s > a:
                        waiting = begin(search, rays, n, waiting, k)
                        live -= whose[k] < 0
                    else:
                        begin_at(state, k, s, search.verdict[2], h)
                    continue
            t = state[T0, k] + s
            t = np.float64(np.float32(t)) if single else t
            seen = side == 0 or facing == 0 or (facing < 0) == (side & FRONT != 0)
            if seen and state[FIRST, k] < t <= state[FAR, k]:
                if roots.shape[0] == 0:
                    found[whose[k]], doubt[whose[k]] = t, not proven
                    waiting = begin(search, rays, n, waiting, k)
                    live -= whose[k] < 0
                    continue
                if count < roots.shape[0]:
                    roots[count, 0], roots[count, 1] = t, 1 if facing != 0 else 2
                    count += 1
            if s >= state[END, k] or count == roots.shape[0] > 0:
                waiting = begin(search, rays, n, waiting, k)
                live -= whose[k] < 0
            else:
                begin_at(state, k, s, 0.0, 0.125 * (state[END, k] - s))
    return count
