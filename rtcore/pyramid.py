"""The beam of a packet: the pyramid around rays that keep together; and where a packet's numbers stand."""
import numpy as np

from rtcore.across import largest, smallest
from rtcore.jit import inline
from rtcore.lanes import greatest, least, load, select, size, splat

# rows of Walk.coarse: 1/direction, offsets of low and of high planes, reach, direction, origin
INVERSE, LOWS, HIGHS, REACH, WAY, FROM = 0, 3, 6, 9, 10, 13
# places in Walk.state; nodes are eight rows and eight children, so that places are told by shifts. FLOOR: where on the stack what waits of
# SOME rays begins, -1: a beam is whole
TOP, ACTIVE, MODE, WAITING, AXIS, ALIVE, RUNNING, OCTANT, FLOOR = range(9)
# places in Walk.beam: over all rays the least and the largest origin and slope (the step for a step along the main axis), the main axis'
# direction, how far any ray still reaches, and what to add to a plane for its earliest entry and latest exit
BEAM_FROM, BEAM_TO, SLOPE_FROM, SLOPE_TO, SIGN, FARTHEST, ENTER, LEAVE = 0, 3, 6, 9, 12, 13, 14, 15


@inline
def common(low, high):
    """The least size of numbers that lie between the smallest of `low` and the largest of `high`; negative if they differ in sign."""
    return max(smallest(low), -largest(high))


@inline
def bundle(coarse, beam, state, axis, fuzz, groups, most):
    """The beam around a packet's rays, which all run the same way along `axis` and are off by `fuzz` at most; whether it is narrow enough
    to be walked, slopes differing by `most` at most."""
    much = splat(np.float32(1e30))
    x0, y0, z0, x1, y1, z1 = much, much, much, -much, -much, -much
    u0, v0, w0, u1, v1, w1 = much, much, much, -much, -much, -much
    farthest = -much
    for g in range(groups):
        j = g * 8
        reach = load(coarse, REACH, j)
        live = reach >= 0
        x, y, z = load(coarse, FROM, j), load(coarse, FROM + 1, j), load(coarse, FROM + 2, j)
        inverse = size(load(coarse, INVERSE + axis, j))
        u, v, w = load(coarse, WAY, j) * inverse, load(coarse, WAY + 1, j) * inverse, load(coarse, WAY + 2, j) * inverse
        x0, x1 = least(x0, select(live, x, much)), greatest(x1, select(live, x, -much))
        y0, y1 = least(y0, select(live, y, much)), greatest(y1, select(live, y, -much))
        z0, z1 = least(z0, select(live, z, much)), greatest(z1, select(live, z, -much))
        u0, u1 = least(u0, select(live, u, much)), greatest(u1, select(live, u, -much))
        v0, v1 = least(v0, select(live, v, much)), greatest(v1, select(live, v, -much))
        w0, w1 = least(w0, select(live, w, much)), greatest(w1, select(live, w, -much))
        farthest = greatest(farthest, reach)
    beam[BEAM_FROM], beam[BEAM_FROM + 1], beam[BEAM_FROM + 2] = smallest(x0), smallest(y0), smallest(z0)
    beam[BEAM_TO], beam[BEAM_TO + 1], beam[BEAM_TO + 2] = largest(x1), largest(y1), largest(z1)
    beam[SLOPE_FROM], beam[SLOPE_FROM + 1], beam[SLOPE_FROM + 2] = smallest(u0), smallest(v0), smallest(w0)
    beam[SLOPE_TO], beam[SLOPE_TO + 1], beam[SLOPE_TO + 2] = largest(u1), largest(v1), largest(w1)
    beam[SIGN], beam[FARTHEST] = np.float32(1) if beam[SLOPE_FROM + axis] > 0 else np.float32(-1), largest(farthest)
    state[AXIS] = axis
    spread = np.float32(0)
    for k in range(3):
        beam[BEAM_FROM + k] -= fuzz
        beam[BEAM_TO + k] += fuzz
        spread = max(spread, beam[SLOPE_TO + k] - beam[SLOPE_FROM + k])
    # along the main axis: the earliest entry into a box and the latest exit, but for the box itself
    sign = beam[SIGN]
    beam[ENTER] = -sign * (beam[BEAM_TO + axis] if sign > 0 else beam[BEAM_FROM + axis])
    beam[LEAVE] = -sign * (beam[BEAM_FROM + axis] if sign > 0 else beam[BEAM_TO + axis])
    return spread <= most and fuzz < 1     # far more than that, and bounds would not be finite
