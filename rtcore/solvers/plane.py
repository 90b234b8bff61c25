"""Solvers of the plane; numbers: point, normal as it was given."""
import numpy as np

from rtcore.jit import kernel

MOST = 1


def numbers(shape) -> np.ndarray:
    return np.array([*shape.point, *shape.normal])


@kernel
def point_normal(rays, numbers, roots, count):
    """The notes' first form, t = n·(q - p) / n·v for a ray from p along v and a plane through q."""
    for i in range(rays.shape[1]):
        speed = numbers[3] * rays[3, i] + numbers[4] * rays[4, i] + numbers[5] * rays[5, i]
        way = (numbers[3] * (numbers[0] - rays[0, i]) + numbers[4] * (numbers[1] - rays[1, i]) + numbers[5] * (numbers[2] - rays[2, i]))
        if speed != 0:
            roots[i, 0], count[i] = way / speed, 1


@kernel
def height_and_secant(rays, numbers, roots, count):
    """The notes' other form, t = h sec θ: the height h = (p - q)·n above the plane over the cosine between v and -n, both of length 1."""
    one, nx, ny, nz = numbers.dtype.type(1), numbers[3], numbers[4], numbers[5]
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / length, ny / length, nz / length
    for i in range(rays.shape[1]):
        vx, vy, vz = rays[3, i], rays[4, i], rays[5, i]
        speed = np.sqrt(vx * vx + vy * vy + vz * vz)
        height = (rays[0, i] - numbers[0]) * nx + (rays[1, i] - numbers[1]) * ny + (rays[2, i] - numbers[2]) * nz
        cosine = -(vx / speed * nx + vy / speed * ny + vz / speed * nz)
        if cosine != 0:
            secant = one / cosine
            roots[i, 0], count[i] = height * secant / speed, 1


SOLVERS = {"point-normal": point_normal, "height-and-secant": height_and_secant}
