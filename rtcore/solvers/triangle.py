"""Solvers of the triangle; numbers: its three corners. The renderer's own is the watertight test of Woop, Benthin and Wald (2013)."""
import numpy as np

from rtcore.jit import inline, kernel

MOST = 1


def numbers(shape) -> np.ndarray:
    return np.array([*shape.a, *shape.b, *shape.c])


@inline
def edges(rays, numbers, i):
    """Two edges from the first corner, and the way from it to the origin."""
    return ((numbers[3] - numbers[0], numbers[4] - numbers[1], numbers[5] - numbers[2]),
            (numbers[6] - numbers[0], numbers[7] - numbers[1], numbers[8] - numbers[2]),
            (rays[0, i] - numbers[0], rays[1, i] - numbers[1], rays[2, i] - numbers[2]))


@inline
def determinant(a, b, c):
    """Of the matrix with these columns, by its first column."""
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])


@kernel
def cramer(rays, numbers, roots, count):
    """The lecture's: a - P₀ = β (P₁ - P₀) + γ (P₂ - P₀) - t d, three equations in β, γ and t, by Cramer's rule."""
    for i in range(rays.shape[1]):
        e, f, s = edges(rays, numbers, i)
        minus = (-rays[3, i], -rays[4, i], -rays[5, i])
        whole = determinant(e, f, minus)
        if whole != 0:
            beta, gamma = determinant(s, f, minus) / whole, determinant(e, s, minus) / whole
            if beta >= 0 and gamma >= 0 and beta + gamma <= 1:
                roots[i, 0], count[i] = determinant(e, f, s) / whole, 1


@kernel
def moeller_trumbore(rays, numbers, roots, count):
    """Möller and Trumbore, *Fast, Minimum Storage Ray/Triangle Intersection*, Journal of Graphics Tools 2:1 (1997), both sides visible,
    without their epsilon."""
    one = numbers.dtype.type(1)
    for i in range(rays.shape[1]):
        e, f, s = edges(rays, numbers, i)
        u, v, w = rays[3, i], rays[4, i], rays[5, i]
        px, py, pz = v * f[2] - w * f[1], w * f[0] - u * f[2], u * f[1] - v * f[0]
        inverse = one / (e[0] * px + e[1] * py + e[2] * pz)
        beta = (s[0] * px + s[1] * py + s[2] * pz) * inverse
        qx, qy, qz = s[1] * e[2] - s[2] * e[1], s[2] * e[0] - s[0] * e[2], s[0] * e[1] - s[1] * e[0]
        gamma = (u * qx + v * qy + w * qz) * inverse
        if beta >= 0 and gamma >= 0 and beta + gamma <= 1:
            roots[i, 0], count[i] = (f[0] * qx + f[1] * qy + f[2] * qz) * inverse, 1


SOLVERS = {"cramer": cramer, "moeller-trumbore": moeller_trumbore}
