"""From hits on a formula's surface to points on it, with normals by exact derivatives and a bound on how far off the points may be.

Points are brought near by Newton steps on the intervals' middles. Where these values are so rough that the bound would be more than the
rounding of the point, double-double takes a last step and gives the bound.
"""
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline, kernel, out_of_line
from rtcore.shapes._march import PAD, middle
from rtcore.shapes._precise import new_rows, value_of
from rtcore.shapes._tape import AT_ROWS, DIRECTION, INPUT, ROUGH, SLOPE, VALUE, new_registers, run

LONGEST = 0.05              # a step toward the surface, and
WORST = 2.0 ** -20          # what a point may be off where the surface has no slope, as shares of the box
ROUGHLY = 2.0 ** -48        # as a share of the point's coordinates: a bound that double-double is called for
BACK = 2.0 ** -13           # how far before it, on the ray, such a place is looked at for a normal


class Landing(NamedTuple):
    """Eight hits on one formula, in its own space."""

    reg: np.ndarray         # registers of the tape
    at: np.ndarray          # (AT_ROWS, 8)
    slope: np.ndarray       # (6, 8): low and high of the gradient's x, y and z
    point: np.ndarray       # (3, 8): where the rays hit; `land` brings it onto the surface
    way: np.ndarray         # (3, 8): the rays' directions, of length 1
    normal: np.ndarray      # (3, 8)
    error: np.ndarray       # (8): bound on the distance of the point from the surface
    rows: np.ndarray        # of the tape in double-double
    closely: np.ndarray     # (3, 3): a point in double-double


@kernel
def new_landing():
    return Landing(new_registers(), np.zeros((AT_ROWS, 8)), np.zeros((6, 8)), np.zeros((3, 8)), np.zeros((3, 8)), np.zeros((3, 8)),
                   np.zeros(8), new_rows(), np.zeros((3, 3)))


@inline
def look(code, landing):
    """The formula at the eight points: value in `at`, gradient in `slope`."""
    at, point = landing.at, landing.point
    for k in range(3):
        for j in range(8):
            slack = abs(point[k, j]) * PAD
            at[INPUT + 2 * k, j], at[INPUT + 2 * k + 1, j] = point[k, j] - slack, point[k, j] + slack
    for axis in range(3):
        for j in range(8):
            for k in range(3):
                at[DIRECTION + k, j] = 1.0 if k == axis else 0.0
        run(code, landing.reg, at, True)
        for j in range(8):
            landing.slope[2 * axis, j], landing.slope[2 * axis + 1, j] = at[SLOPE, j], at[SLOPE + 1, j]


@inline
def gradient(slope, j):
    """Gradient of lane j as direction and length, and a bound on what it may be off; length 0 and infinitely off if it is not finite."""
    x, y, z = middle(slope[0, j], slope[1, j]), middle(slope[2, j], slope[3, j]), middle(slope[4, j], slope[5, j])
    off = 0.5 * ((slope[1, j] - slope[0, j]) + (slope[3, j] - slope[2, j]) + (slope[5, j] - slope[4, j]))
    most = max(abs(x), max(abs(y), abs(z)))
    if not (0 < most < np.inf and off < np.inf):
        return 0.0, 0.0, 0.0, 0.0, np.inf
    x, y, z = x / most, y / most, z / most
    length = np.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length, length * most, off


@kernel
def closer(code, landing, j, steep):
    """Bring point j nearer by a Newton step, `steep` being the gradient's length there, and return a bound on what the value is then."""
    out_of_line()
    point, closely = landing.point, landing.closely
    value = off = np.inf
    for again in range(2):
        for k in range(3):
            closely[k, 0], closely[k, 1], closely[k, 2] = point[k, j], 0.0, 0.0
        value, off = value_of(code, landing.rows, closely)
        if again == 0 and off < np.inf:
            for k in range(3):
                point[k, j] -= value / steep * landing.normal[k, j]
    return abs(value) + off


@kernel
def land(code, landing, box):
    """Bring the points onto the surface by Newton steps along the gradient; normals and error bounds there. box: the box's longest edge."""
    at, slope, point, way, normal, error = landing.at, landing.slope, landing.point, landing.way, landing.normal, landing.error
    for again in range(9):
        look(code, landing)
        moved = False
        for j in range(8):
            x, y, z, steep, off = gradient(slope, j)
            f, noise = middle(at[VALUE, j], at[VALUE + 1, j]), 0.5 * (at[VALUE + 1, j] - at[VALUE, j])
            # on it; or at a touch, an edge or a jump, which a step would leave
            if again < 8 and abs(f) > 0.5 * noise and steep > 4 * off and at[ROUGH, j] == 0 and abs(f) <= LONGEST * box * steep:
                step, moved = f / steep, True
                point[0, j], point[1, j], point[2, j] = point[0, j] - step * x, point[1, j] - step * y, point[2, j] - step * z
        if not moved:
            break
    flat = False
    for j in range(8):
        x, y, z, steep, off = gradient(slope, j)
        noise = max(abs(at[VALUE, j]), abs(at[VALUE + 1, j]))
        normal[0, j], normal[1, j], normal[2, j] = x, y, z
        error[j] = min(2 * noise / (steep - off), WORST * box) if steep > 4 * off else WORST * box
        if ROUGHLY * max(abs(point[0, j]), max(abs(point[1, j]), abs(point[2, j]))) < error[j] < WORST * box:
            error[j] = min(error[j], 2 * closer(code, landing, j, steep) / (steep - off))
        flat = flat or steep <= 4 * off
    if flat:
        for j in range(8):
            for k in range(3):
                landing.point[k, j] -= BACK * box * way[k, j]
        look(code, landing)
        for j in range(8):
            for k in range(3):
                landing.point[k, j] += BACK * box * way[k, j]
            if error[j] == WORST * box:     # the normal of a little before it, else against the ray
                x, y, z, steep, off = gradient(slope, j)
                normal[0, j], normal[1, j], normal[2, j] = (x, y, z) if steep > 4 * off else (-way[0, j], -way[1, j], -way[2, j])
