"""Solvers of implicit surfaces; numbers: the box, a bound on the slope, the length of the tape and the tape. The renderer's own is the
search by intervals of `rtcore.shapes._march`."""
import numpy as np

from rtcore.jit import inline, kernel
from rtcore.shapes._formula import (ABS, ADD, ADD_C, ATAN2, C_DIVIDE, C_SUB, CONSTANT, COSINE, DIVIDE, DIVIDE_C, EXP, FLOOR, LOG, MAX, MIN,
                                    MOD, MOST_STEPS, MULTIPLY, MULTIPLY_C, NEGATE, POWER, REAL_POWER, ROOT, SINE, SMOOTH_MIN, SQUARE, SUB,
                                    TANGENT, A, B, C, X, Y, Z, compiled)

MOST = 1
SLOPE, COUNT, TAPE = 6, 7, 8
SAMPLES, STEPS, PIECES = 24, 512, 128      # of the grid a side, of sphere tracing, of bracketing
CLOSE = 2.0 ** -20                         # how near sphere tracing comes, in sizes of the box


def numbers(shape) -> np.ndarray:
    tape = compiled(shape.expression)
    head = np.array([*shape.low, *shape.high, 0.0, len(tape)])
    whole = np.concatenate([head, tape.ravel()])
    grid = np.stack(np.meshgrid(*np.linspace(shape.low, shape.high, SAMPLES).T, indexing="ij"))
    values = np.empty(grid[0].shape)
    values_at(whole, grid.reshape(3, -1), values.reshape(-1))
    with np.errstate(all="ignore"):
        slopes = np.gradient(values, *((np.subtract(shape.high, shape.low)) / (SAMPLES - 1)))
        steep = np.sqrt(sum(g * g for g in slopes))
    whole[SLOPE] = np.max(steep, where=np.isfinite(steep), initial=0) or 1
    return whole


@inline
def value(k, row, x, y, z):
    """The formula at a point; `row` is room for its steps."""
    kind = row.dtype.type
    count = int(k[COUNT])
    for i in range(count):
        at = TAPE + 4 * i
        op, c = int(k[at]), k[at + C]
        a = row[int(k[at + A])] if k[at + A] >= 0 else c
        b = row[int(k[at + B])] if k[at + B] >= 0 else c
        if op == CONSTANT:
            row[i] = c
        elif op == X:
            row[i] = x
        elif op == Y:
            row[i] = y
        elif op == Z:
            row[i] = z
        elif op == ADD:
            row[i] = a + b
        elif op == ADD_C:
            row[i] = a + c
        elif op == SUB:
            row[i] = a - b
        elif op == C_SUB:
            row[i] = c - a
        elif op == NEGATE:
            row[i] = -a
        elif op == MULTIPLY:
            row[i] = a * b
        elif op == MULTIPLY_C:
            row[i] = a * c
        elif op == DIVIDE:
            row[i] = a / b
        elif op == DIVIDE_C:
            row[i] = a / c
        elif op == C_DIVIDE:
            row[i] = c / a
        elif op == SQUARE:
            row[i] = a * a
        elif op in (POWER, REAL_POWER):
            row[i] = a ** c
        elif op == ROOT:
            row[i] = np.sqrt(a)
        elif op == EXP:
            row[i] = np.exp(a)
        elif op == LOG:
            row[i] = np.log(a)
        elif op == SINE:
            row[i] = np.sin(a)
        elif op == COSINE:
            row[i] = np.cos(a)
        elif op == TANGENT:
            row[i] = np.tan(a)
        elif op == ABS:
            row[i] = abs(a)
        elif op == MIN:
            row[i] = min(a, b)
        elif op == MAX:
            row[i] = max(a, b)
        elif op == SMOOTH_MIN:
            near = max(c - abs(a - b), kind(0))
            row[i] = min(a, b) - near * near / (kind(4) * c)
        elif op == ATAN2:
            row[i] = np.arctan2(a, b)
        elif op == FLOOR:
            row[i] = np.floor(a)
        elif op == MOD:
            row[i] = a - c * np.floor(a / c)
    return row[count - 1]


@kernel
def values_at(numbers, points, out):
    """The formula's values at points (3, n)."""
    row = np.empty(MOST_STEPS, points.dtype)
    for i in range(points.shape[1]):
        out[i] = value(numbers, row, points[0, i], points[1, i], points[2, i])


@inline
def stretch(rays, numbers, i):
    """Where ray i enters and leaves the box."""
    kind = rays.dtype.type
    enter, leave = kind(0), kind(np.inf)
    for axis in range(3):
        o, d = rays[axis, i], rays[3 + axis, i]
        if d == 0:
            if o < numbers[axis] or o > numbers[3 + axis]:
                leave = -kind(np.inf)
        else:
            p, q = (numbers[axis] - o) / d, (numbers[3 + axis] - o) / d
            enter, leave = max(enter, min(p, q)), min(leave, max(p, q))
    return enter, leave


@inline
def along(rays, numbers, row, i, t):
    return value(numbers, row, rays[0, i] + t * rays[3, i], rays[1, i] + t * rays[4, i], rays[2, i] + t * rays[5, i])


@kernel
def sphere_tracing(rays, numbers, roots, count):
    """Steps of the value over the greatest slope, here one sampled on a grid: Hart, *Sphere Tracing*, The Visual Computer 12:10 (1996). A
    root is where the steps become short."""
    kind = rays.dtype.type
    row = np.empty(MOST_STEPS, rays.dtype)
    size = max(numbers[3] - numbers[0], max(numbers[4] - numbers[1], numbers[5] - numbers[2]))
    for i in range(rays.shape[1]):
        t, leave = stretch(rays, numbers, i)
        speed = np.sqrt(rays[3, i] * rays[3, i] + rays[4, i] * rays[4, i] + rays[5, i] * rays[5, i])
        for _ in range(STEPS):
            step = abs(along(rays, numbers, row, i, t)) / numbers[SLOPE]
            if not t <= leave:
                break
            if step <= kind(CLOSE) * size:
                roots[i, 0], count[i] = t, 1
                break
            t += step / speed


@kernel
def bracketing(rays, numbers, roots, count):
    """Equal pieces until the sign changes, then halving to the last bit; a pole is taken for a root, a touch is missed."""
    kind = rays.dtype.type
    row = np.empty(MOST_STEPS, rays.dtype)
    for i in range(rays.shape[1]):
        enter, leave = stretch(rays, numbers, i)
        if not enter < leave or leave == kind(np.inf):
            continue
        low, f = enter, along(rays, numbers, row, i, enter)
        for piece in range(1, PIECES + 1):
            high = enter + (leave - enter) * kind(piece) / kind(PIECES)
            g = along(rays, numbers, row, i, high)
            if (f < 0) != (g < 0):
                middle = (low + high) / kind(2)
                while low < middle < high:
                    if (along(rays, numbers, row, i, middle) < 0) == (f < 0):
                        low = middle
                    else:
                        high = middle
                    middle = (low + high) / kind(2)
                roots[i, 0], count[i] = high, 1
                break
            low, f = high, g


SOLVERS = {"sphere-tracing": sphere_tracing, "bracketing": bracketing}
