"""Solvers of the torus; numbers: major and minor radius. All solve a quartic with leading coefficient 1; they differ in where its
coefficients are taken and in how. The renderer's own is isolation between critical points and Newton steps (Yuksel 2022)."""
import numpy as np

from rtcore.jit import inline, kernel
from rtcore.solvers._orellana import put_orellana
from rtcore.solvers._quartic import put_ferrari, put_sturm

MOST = 4


def numbers(shape) -> np.ndarray:
    return np.array([shape.major_radius, shape.minor_radius])


@inline
def raw(rays, numbers, i):
    """Coefficients of t³, t², t and 1 for the ray as it comes."""
    kind = rays.dtype.type
    x, y, z, u, v, w = rays[0, i], rays[1, i], rays[2, i], rays[3, i], rays[4, i], rays[5, i]
    big = kind(4) * numbers[0] * numbers[0]
    dd, od = u * u + v * v + w * w, x * u + y * v + z * w
    k = x * x + y * y + z * z + numbers[0] * numbers[0] - numbers[1] * numbers[1]
    lead = dd * dd
    return (kind(4) * dd * od / lead, (kind(4) * od * od + kind(2) * dd * k - big * (u * u + v * v)) / lead,
            (kind(4) * od * k - kind(2) * big * (x * u + y * v)) / lead, (k * k - big * (x * x + y * y)) / lead)


@inline
def near(rays, numbers, i):
    """Coefficients of s², s and 1, that of s³ being 0, with s from the closest approach to the centre, in units of R + r; then the unit,
    the way to the closest approach, and the direction's length: t = (s unit + way) / length."""
    kind = rays.dtype.type
    x, y, z, u, v, w = rays[0, i], rays[1, i], rays[2, i], rays[3, i], rays[4, i], rays[5, i]
    unit = numbers[0] + numbers[1]
    big, small = numbers[0] / unit, numbers[1] / unit
    length = np.sqrt(u * u + v * v + w * w)
    u, v, w = u / length, v / length, w / length
    way = -(x * u + y * v + z * w)
    x, y, z = (x + way * u) / unit, (y + way * v) / unit, (z + way * w) / unit
    k = x * x + y * y + z * z + big * big - small * small
    square = kind(4) * big * big
    return (kind(2) * k - square * (u * u + v * v), -kind(2) * square * (x * u + y * v), k * k - square * (x * x + y * y),
            unit, way, length)


@inline
def place(roots, count, i, unit, way, length):
    """From s to t."""
    for j in range(count[i]):
        roots[i, j] = (roots[i, j] * unit + way) / length


@kernel
def ferrari(rays, numbers, roots, count):
    """Ferrari's closed form on the coefficients along the ray as it comes."""
    for i in range(rays.shape[1]):
        a, b, c, d = raw(rays, numbers, i)
        put_ferrari(a, b, c, d, roots, count, i)


@kernel
def ferrari_near(rays, numbers, roots, count):
    """Ferrari's closed form, the origin moved to the closest approach."""
    for i in range(rays.shape[1]):
        p, q, r, unit, way, length = near(rays, numbers, i)
        put_ferrari(p - p, p, q, r, roots, count, i)
        place(roots, count, i, unit, way, length)


@kernel
def sturm(rays, numbers, roots, count):
    """Bisection by the number of roots that Sturm's sequence tells, the origin moved to the closest approach."""
    for i in range(rays.shape[1]):
        p, q, r, unit, way, length = near(rays, numbers, i)
        put_sturm(p - p, p, q, r, roots, count, i)
        place(roots, count, i, unit, way, length)


@kernel
def orellana(rays, numbers, roots, count):
    """Algorithm 1010, Orellana and De Michele, ACM TOMS 46:20 (2020): two quadratic factors, polished together; the origin moved to the
    closest approach."""
    for i in range(rays.shape[1]):
        p, q, r, unit, way, length = near(rays, numbers, i)
        put_orellana(p - p, p, q, r, roots, count, i)
        place(roots, count, i, unit, way, length)


@kernel
def coefficients(rays, numbers, out):
    """p, q, r, unit, way and length of `near`, a row a ray."""
    for i in range(rays.shape[1]):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5] = near(rays, numbers, i)


def companion(rays, numbers, roots, count):
    """Eigenvalues of the companion matrix (LAPACK), those without an imaginary part; the origin moved to the closest approach."""
    row = np.empty((rays.shape[1], 6), rays.dtype)
    coefficients(rays, numbers, row)
    good = np.isfinite(row).all(axis=1)
    matrix = np.zeros((good.sum(), 4, 4), rays.dtype)
    matrix[:, [1, 2, 3], [0, 1, 2]] = 1
    matrix[:, 0, 3], matrix[:, 1, 3], matrix[:, 2, 3] = -row[good, 2], -row[good, 1], -row[good, 0]
    s = np.full((len(row), 4), np.nan, np.result_type(rays.dtype, np.complex64))
    s[good] = np.linalg.eigvals(matrix)
    real = (s.imag == 0) | ~good[:, None]
    order = np.argsort(~real, axis=1, kind="stable")
    roots[:] = np.take_along_axis((s.real * row[:, 3:4] + row[:, 4:5]) / row[:, 5:6], order, axis=1)
    count[:] = real.sum(axis=1)


SOLVERS = {"ferrari": ferrari, "ferrari-near": ferrari_near, "companion": companion, "sturm": sturm, "orellana": orellana}
