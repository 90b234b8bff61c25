"""Materials: what a surface shows of itself, what a light brings, which rays go on. Whitted's model, see `scene.Material`.

All in float64 over the wave's columns: one ray at a time, since every ray may differ in material.
"""
import math
from typing import NamedTuple

import numpy as np

from rtcore.jit import inline, kernel
from rtcore.scene import Background, Leaf, Material, invertible
from rtcore.shapes.kind import normalized
from rtcore.wave import DEPTH_UNIT, DX, DY, DZ, ERR, GLOSS, GX, GY, GZ, NX, NY, NZ, OPAQUE, POLISH, PX, PY, PZ, finish, put_ray

# columns of Look.material
(COLOR, AMBIENT, DIFFUSE, SPECULAR, SHININESS, REFLECTION, TRANSMISSION, IOR, FRESNEL, TINT, EMISSION, CHECKER, EVEN, ODD,
 SIZE, PATTERN) = 0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 14, 17, 18, 21, 24, 25
MATERIAL_COLUMNS = 37

#: A ray that adds to its pixel less than this share of the light it meets is not followed: for white, a twentieth of the first step above
#: black in an 8-bit picture.
NEGLIGIBLE = 2.0 ** -16


class Look(NamedTuple):
    """All that shading needs to know."""

    material: np.ndarray    # float64 (m, 37)
    of: np.ndarray          # int32 (primitives): row of material
    opacity: np.ndarray     # int32 (primitives): optical depth for shadow rays, or OPAQUE
    ambient: np.ndarray     # float64 (3): sum of the ambient lights
    backdrop: np.ndarray    # float64 (3, 3): lower colour, upper colour, up


def make_look(leaves: tuple[Leaf, ...], leaf: np.ndarray, ambient: np.ndarray, background: Background, up) -> Look:
    """Tables for the leaves that the primitives (their leaf indices) belong to."""
    rows, index, used = [], {}, np.unique(leaf)
    row_of, depth_of = np.zeros(len(leaves), np.int32), np.zeros(len(leaves), np.int32)
    for i in used:
        material, matrix = leaves[i].material, leaves[i].matrix
        # a pattern sits in the object's space, so its leaves need rows of their own
        key = (id(material), matrix.tobytes() if material.checker else b"")
        if key not in index:
            index[key] = len(rows)
            rows.append(_row(material, matrix))
        row_of[i] = index[key]
        depth_of[i] = optical_depth(material)
    top = background.color if background.top is None else background.top
    backdrop = np.array([background.color, top, np.array(up) / np.linalg.norm(up)], np.float64)
    return Look(np.array(rows).reshape(-1, MATERIAL_COLUMNS), row_of[leaf], depth_of[leaf], ambient, backdrop)


def optical_depth(material: Material) -> int:
    """What a shadow ray loses: the share of the light that goes through, as an integer depth."""
    return OPAQUE if material.transmission <= 0 else min(round(-math.log(material.transmission) / DEPTH_UNIT), OPAQUE - 1)


def _row(m: Material, matrix: np.ndarray) -> np.ndarray:
    row = np.zeros(MATERIAL_COLUMNS)
    row[COLOR:COLOR + 3], row[TINT:TINT + 3], row[EMISSION:EMISSION + 3] = m.color, m.tint, m.emission
    row[AMBIENT], row[DIFFUSE], row[SPECULAR], row[SHININESS] = m.ambient, m.diffuse, m.specular, m.shininess
    row[REFLECTION], row[TRANSMISSION], row[IOR], row[FRESNEL] = m.reflection, m.transmission, m.ior, float(m.fresnel)
    if m.checker:
        row[CHECKER], row[EVEN:EVEN + 3], row[ODD:ODD + 3], row[SIZE] = 1, m.checker.even, m.checker.odd, m.checker.size
        row[PATTERN:PATTERN + 12] = invertible(matrix)[:3].ravel()
    return row


@inline
def _color(m, row, surface, i):
    """Diffuse colour at hit i: plain, or that of the checker's cube just beneath the surface."""
    if m[row, CHECKER] == 0:
        return m[row, COLOR], m[row, COLOR + 1], m[row, COLOR + 2]
    odd = 0
    x, y, z = np.float64(surface[PX, i]), np.float64(surface[PY, i]), np.float64(surface[PZ, i])
    for k in range(3):
        q = PATTERN + 4 * k
        at = m[row, q] * x + m[row, q + 1] * y + m[row, q + 2] * z + m[row, q + 3]
        inward = m[row, q] * surface[GX, i] + m[row, q + 1] * surface[GY, i] + m[row, q + 2] * surface[GZ, i]
        odd += int(np.floor(at / m[row, SIZE] - 1e-3 * np.sign(inward) * (abs(inward) > 1e-6)))
    at = ODD if odd % 2 else EVEN
    return m[row, at], m[row, at + 1], m[row, at + 2]


@inline
def _faced(rays, surface, i):
    """Unit geometric and shading normal on the side that ray i comes from, and 1 if that is the front, else -1."""
    d = rays.ray
    side = 1.0 if d[DX, i] * surface[GX, i] + d[DY, i] * surface[GY, i] + d[DZ, i] * surface[GZ, i] < 0 else -1.0
    gx, gy, gz = side * surface[GX, i], side * surface[GY, i], side * surface[GZ, i]
    nx, ny, nz = side * surface[NX, i], side * surface[NY, i], side * surface[NZ, i]
    return gx, gy, gz, nx, ny, nz, side


@kernel
def glow(wave, n, look, answer):
    """Light without lights: the background, emission, and the ambient light returned; and, for lights to come, `Beam.answer` if it has
    room. Fog comes later: fade becomes 1."""
    rays, m, b, lit = wave.rays, look.material, look.backdrop, answer.shape[1] > 0
    for i in range(n):
        wave.fade[i] = 1
        p = rays.prim[i]
        if p < 0:
            up = 0.5 + 0.5 * (rays.ray[DX, i] * b[2, 0] + rays.ray[DY, i] * b[2, 1] + rays.ray[DZ, i] * b[2, 2])
            for k in range(3):
                wave.light[k, i] = b[0, k] + up * (b[1, k] - b[0, k])
            continue
        row = look.of[p]
        r, g, b_ = _color(m, row, wave.surface, i)
        share = m[row, AMBIENT]
        wave.light[0, i] = m[row, EMISSION] + share * r * look.ambient[0]
        wave.light[1, i] = m[row, EMISSION + 1] + share * g * look.ambient[1]
        wave.light[2, i] = m[row, EMISSION + 2] + share * b_ * look.ambient[2]
        if lit:
            diffuse = m[row, DIFFUSE]
            answer[0, i], answer[1, i], answer[2, i] = diffuse * r, diffuse * g, diffuse * b_
            answer[GLOSS, i], answer[POLISH, i] = m[row, SPECULAR], m[row, SHININESS]


@kernel
def gather(wave, beam, n):
    """Add what the beam's n rays bring where nothing opaque is in the way; returns how many met something opaque."""
    rays, blocked = beam.rays, 0
    for j in range(n):
        if rays.prim[j] >= 0:
            blocked += 1
            continue
        i, depth = beam.owner[j], rays.depth[j]
        through = 1.0 if depth == 0 else np.exp(-depth * DEPTH_UNIT)
        for k in range(3):
            wave.light[k, i] += through * beam.bring[k, j]
    return blocked


@inline
def fresnel(cosine, eta):
    """Share of unpolarised light that a dielectric reflects (Fresnel). cosine: of the angle of incidence, 0 .. 1; eta: index of
    refraction of where the light comes from over that of where it goes. 1 for total reflection."""
    square = 1 - eta * eta * (1 - cosine * cosine)
    if square <= 0:
        return 1.0
    inner = np.sqrt(square)
    parallel = (cosine - eta * inner) / (cosine + eta * inner)
    across = (eta * cosine - inner) / (eta * cosine + inner)
    return 0.5 * (parallel * parallel + across * across)


@kernel
def bounce(wave, n, look, child, counts):
    """The reflected and refracted rays of the wave's hits into `child`, which needs room for 2n; returns their number. A hit's two rays
    stand side by side, so that the order does not depend on the rest of the wave. counts[0], counts[1] grow by each sort's number."""
    rays, surface, m = wave.rays, wave.surface, look.material
    count = 0
    for i in range(n):
        p = rays.prim[i]
        if p < 0:
            continue
        row = look.of[p]
        reflection, transmission = m[row, REFLECTION], m[row, TRANSMISSION]
        if reflection == 0 and transmission == 0:
            continue
        gx, gy, gz, nx, ny, nz, side = _faced(rays, surface, i)
        dx, dy, dz = np.float64(rays.ray[DX, i]), np.float64(rays.ray[DY, i]), np.float64(rays.ray[DZ, i])
        cosine = -(dx * nx + dy * ny + dz * nz)
        if cosine <= 0:     # an interpolated normal that looks away from the eye
            nx, ny, nz = gx, gy, gz
            cosine = -(dx * nx + dy * ny + dz * nz)
        eta = 1 / m[row, IOR] if side > 0 else m[row, IOR]
        square = 1 - eta * eta * (1 - cosine * cosine)
        if transmission > 0:
            if m[row, FRESNEL] != 0:
                share = fresnel(cosine, eta)
                # what the surface lets pass is shared out by the angle; `reflection` scales the mirrored part
                reflection, transmission = (1.0 if square <= 0 else reflection) * share, transmission * (1 - share)
            elif square <= 0:
                reflection, transmission = reflection + transmission, 0.0
        elif m[row, FRESNEL] != 0:
            reflection = reflection * fresnel(cosine, eta)
        fade, err = np.float64(wave.fade[i]), np.float64(surface[ERR, i])
        for way in range(2):
            share = reflection if way == 0 else transmission
            r = share * fade * wave.weight[0, i] * m[row, TINT]
            g = share * fade * wave.weight[1, i] * m[row, TINT + 1]
            b = share * fade * wave.weight[2, i] * m[row, TINT + 2]
            if not max(r, max(g, b)) > NEGLIGIBLE:
                continue
            if way == 0:
                x, y, z, away = dx + 2 * cosine * nx, dy + 2 * cosine * ny, dz + 2 * cosine * nz, err
                if x * gx + y * gy + z * gz <= 0:       # below the true surface: mirror about that instead
                    c = dx * gx + dy * gy + dz * gz
                    x, y, z = dx - 2 * c * gx, dy - 2 * c * gy, dz - 2 * c * gz
            else:
                c = eta * cosine - np.sqrt(square)
                x, y, z, away = eta * dx + c * nx, eta * dy + c * ny, eta * dz + c * nz, -err
            x, y, z = normalized(x, y, z)
            put_ray(child.rays, count, surface[PX, i] + away * gx, surface[PY, i] + away * gy, surface[PZ, i] + away * gz, x, y, z, np.inf)
            child.weight[0, count], child.weight[1, count], child.weight[2, count] = r, g, b
            child.owner[count], child.source[count] = wave.owner[i], 2 * i + way
            counts[way] += 1
            count += 1
    finish(child.rays, count)
    return count
