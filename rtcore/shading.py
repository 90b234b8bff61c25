"""Materials: what a surface shows of itself, what a light brings, which rays go on. Whitted's model, see `scene.Material`.

All in float64 over the wave's columns, eight rays at a time; every ray may differ in material.
"""
import math
from typing import NamedTuple

import numpy as np

from rtcore.across import count, lowest_bit
from rtcore.directions import normalized
from rtcore.indices import chosen, common_chosen, pick, pick3, rows_of
from rtcore.jit import inline, kernel
from rtcore.lanes import (LANES, any_lane, bits, exceeds, fill, greatest, load, load3, narrow, root, rounded, select, size, splat, store,
                          vec3, wide, with_sign, zero)
from rtcore.neighbours import consecutive, copy, copy_twice, count_up, load1, store1, store_by_turns
from rtcore.powers import floor
from rtcore.latest import Latest
from rtcore.leaves import Leaf
from rtcore.scene import Background, Material, invertible
from rtcore.wave import DEPTH_UNIT, DX, ERR, GLOSS, GX, OPAQUE, OX, POLISH, PX, START, T, finish, shading_normal

# columns of Look.material
(COLOR, AMBIENT, DIFFUSE, SPECULAR, SHININESS, REFLECTION, TRANSMISSION, IOR, FRESNEL, TINT, EMISSION, CHECKER, EVEN, ODD,
 SIZE, PATTERN, ROUGHNESS) = 0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 14, 17, 18, 21, 24, 25, 37
MATERIAL_COLUMNS = 38

#: A ray that adds to its pixel less than this share of the light it meets is not followed: for white, a twentieth of the first step above
#: black in an 8-bit picture.
NEGLIGIBLE = 2.0 ** -16


REFLECTED, REFRACTED = 0, 1     # sorts of rays that go on


class Look(NamedTuple):
    """All that shading needs to know."""

    material: np.ndarray    # float64 (m, 38)
    of: np.ndarray          # int32 (primitives): row of material
    opacity: np.ndarray     # int32 (primitives): optical depth for shadow rays, or OPAQUE
    ambient: np.ndarray     # float64 (3): sum of the ambient lights
    backdrop: np.ndarray    # float64 (3, 3): lower colour, upper colour, up


def make_look(leaves: tuple[Leaf, ...], leaf: np.ndarray, ambient: np.ndarray, background: Background, up) -> Look:
    """Tables for the leaves that the primitives (their leaf indices) belong to."""
    top = background.color if background.top is None else background.top
    backdrop = np.array([background.color, top, np.array(up) / np.linalg.norm(up)], np.float64)
    return Look(*_tables(leaves, leaf), ambient, backdrop)


@Latest
def _tables(leaves: tuple[Leaf, ...], leaf: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The first three fields of `Look`."""
    rows, depths, index, row_of = [], [], {}, np.zeros(len(leaves), np.int32)
    used, which = np.unique(leaf).tolist(), []
    for i in used:
        material, matrix = leaves[i].material, leaves[i].matrix
        # a pattern sits in the object's space, so its leaves need rows of their own
        key = (id(material), matrix.tobytes()) if material.checker else id(material)
        row = index.setdefault(key, len(rows))
        if row == len(rows):
            rows.append(_row(material, matrix))
            depths.append(optical_depth(material))
        which.append(row)
    row_of[used] = which
    of = row_of[leaf]
    return np.array(rows).reshape(-1, MATERIAL_COLUMNS), of, np.array(depths, np.int32)[of]


def optical_depth(material: Material) -> int:
    """What a shadow ray loses: the share of the light that goes through, as an integer depth."""
    return OPAQUE if material.transmission <= 0 else min(round(-math.log(material.transmission) / DEPTH_UNIT), OPAQUE - 1)


def _row(m: Material, matrix: np.ndarray) -> np.ndarray:
    row = np.zeros(MATERIAL_COLUMNS)
    row[COLOR:COLOR + 3], row[TINT:TINT + 3], row[EMISSION:EMISSION + 3] = m.color, m.tint, m.emission
    row[AMBIENT], row[DIFFUSE], row[SPECULAR], row[SHININESS] = m.ambient, m.diffuse, m.specular, m.shininess
    row[REFLECTION], row[TRANSMISSION], row[IOR], row[FRESNEL] = m.reflection, m.transmission, m.ior, float(m.fresnel)
    row[ROUGHNESS] = m.roughness
    if m.checker:
        row[CHECKER], row[EVEN:EVEN + 3], row[ODD:ODD + 3], row[SIZE] = 1, m.checker.even, m.checker.odd, m.checker.size
        row[PATTERN:PATTERN + 12] = invertible(matrix)[:3].ravel()
    return row


@inline
def _colors(m, row, surface, i):
    """Diffuse colours at hits i .. i+7: plain, or that of the checker's cube just beneath the surface."""
    color, patterned = pick3(m, row, COLOR), pick(m, row, CHECKER) > 0
    if not any_lane(patterned):
        return color
    p, g = wide(load3(surface, PX, i)), wide(load3(surface, GX, i))
    odd = zero(p.x)
    for k in range(3):
        q = PATTERN + 4 * k
        x, y, z = pick(m, row, q), pick(m, row, q + 1), pick(m, row, q + 2)
        at = x * p.x + y * p.y + z * p.z + pick(m, row, q + 3)
        inward = x * g.x + y * g.y + z * g.z
        odd = odd + floor(at / pick(m, row, SIZE) - with_sign(select(size(inward) > 1e-6, 1e-3 + zero(at), 0), inward))
    even = pick3(m, row, EVEN)
    return select(patterned, select(2 * floor(odd / 2) == odd, even, pick3(m, row, ODD)), color)


@inline
def _faced(ray, surface, i):
    """Unit geometric and shading normals on the sides that rays i .. i+7 come from, and 1 where that is the front, else -1."""
    d, g, n = wide(load3(ray, DX, i)), wide(load3(surface, GX, i)), wide(load3(surface, shading_normal(surface), i))
    side = select(d.x * g.x + d.y * g.y + d.z * g.z < 0, 1, zero(d.x) - 1)
    return g * side, n * side, side


@kernel
def glow(wave, n, look, answer):
    """Light without lights: the background, emission, and the ambient light returned; and, for lights to come, `Beam.answer` if it has
    room. Fog comes later: fade becomes 1."""
    prim, ray, light, fade, of, b = wave.rays.prim, wave.rays.ray, wave.light, wave.fade, look.of, look.backdrop
    for i in range(0, n, LANES):
        store1(fade, i, splat(np.float32(1)))
        hit, d = exceeds(prim, i, -1), wide(load3(ray, DX, i))
        up = 0.5 + 0.5 * (d.x * b[2, 0] + d.y * b[2, 1] + d.z * b[2, 2])
        seen = vec3(b[0, 0] + up * (b[1, 0] - b[0, 0]), b[0, 1] + up * (b[1, 1] - b[0, 1]), b[0, 2] + up * (b[1, 2] - b[0, 2]))
        if any_lane(hit):
            met = rows_of(prim, i, 0, hit)
            row = common_chosen(of, met)
            if row >= 0:
                seen = select(hit, _own(wave, i, look, row, answer), seen)
            else:
                seen = select(hit, _own(wave, i, look, chosen(of, met), answer), seen)
        store(light, 0, i, narrow(seen.x))
        store(light, 1, i, narrow(seen.y))
        store(light, 2, i, narrow(seen.z))


@inline
def _own(wave, i, look, row, answer):
    """What hits i .. i+7 send out by themselves; how they answer lights is noted if there is room. row: their materials', as for `pick`."""
    m, ambient = look.material, look.ambient
    color, own, share = _colors(m, row, wave.surface, i), pick3(m, row, EMISSION), pick(m, row, AMBIENT)
    if answer.shape[1] > 0:
        diffuse = pick(m, row, DIFFUSE)
        store(answer, 0, i, narrow(diffuse * color.x))
        store(answer, 1, i, narrow(diffuse * color.y))
        store(answer, 2, i, narrow(diffuse * color.z))
        store(answer, GLOSS, i, narrow(pick(m, row, SPECULAR)))
        store(answer, POLISH, i, narrow(pick(m, row, SHININESS)))
    return vec3(own.x + share * color.x * ambient[0], own.y + share * color.y * ambient[1], own.z + share * color.z * ambient[2])


@kernel
def gather(wave, beam, n):
    """Add what the beam's n rays bring where nothing opaque is in the way; returns how many met something opaque."""
    prim, depths, owner, bring, light, blocked = beam.rays.prim, beam.rays.depth, beam.owner, beam.bring, wave.light, 0
    for j in range(0, n, LANES):
        stopped = exceeds(prim, j, -1)
        if j + LANES <= n and not any_lane(exceeds(depths, j, 0)) and consecutive(owner, j):
            blocked += count(stopped)
            for k in range(3):
                store(light, k, owner[j], load(light, k, owner[j]) + select(stopped, 0, load(bring, k, j)))
            continue
        for at in range(j, min(j + LANES, n)):
            if prim[at] >= 0:
                blocked += 1
                continue
            i, depth = owner[at], depths[at]
            through = 1.0 if depth == 0 else np.exp(-depth * DEPTH_UNIT)
            for k in range(3):
                light[k, i] += through * bring[k, at]
    return blocked


@inline
def fresnel(cosine, eta):
    """Share of unpolarised light that a dielectric reflects (Fresnel). cosine: of the angle of incidence, 0 .. 1; eta: index of
    refraction of where the light comes from over that of where it goes. 1 for total reflection. Lanes."""
    square = 1 - eta * eta * (1 - cosine * cosine)
    inner = root(square)
    parallel = (cosine - eta * inner) / (cosine + eta * inner)
    across = (eta * cosine - inner) / (eta * cosine + inner)
    return select(square <= 0, 1, 0.5 * (parallel * parallel + across * across))


@inline
def _shares(m, row, cosine, eta, square):
    """How much of what comes along each of eight rays is reflected and how much transmitted; `square` below 0 is total reflection."""
    reflection, transmission = pick(m, row, REFLECTION), pick(m, row, TRANSMISSION)
    clear, inward, smooth = transmission > 0, square <= 0, pick(m, row, FRESNEL) > 0
    plain = clear & inward & ~smooth
    mirrored, passed = select(plain, reflection + transmission, reflection), select(plain, 0, transmission)
    if any_lane(smooth):
        share = fresnel(cosine, eta)
        # what the surface lets pass is shared out by the angle; `reflection` scales the mirrored part
        mirrored = select(smooth, select(clear & inward, 1, reflection) * share, mirrored)
        passed = select(smooth & clear, transmission * (1 - share), passed)
    return mirrored, passed


@inline
def _go_on(made, carried, lane, wave, m, row, i, share, p, d, like):
    """Note eight rays from p along d, which bring the pixel this share; returns those worth following, as bits."""
    fade = share * wide(load1(wave.fade, i))
    r = fade * wide(load(wave.weight, 0, i)) * pick(m, row, TINT)
    g = fade * wide(load(wave.weight, 1, i)) * pick(m, row, TINT + 1)
    b = fade * wide(load(wave.weight, 2, i)) * pick(m, row, TINT + 2)
    d = normalized(d)
    store(made, OX, lane, rounded(p.x, like))
    store(made, OX + 1, lane, rounded(p.y, like))
    store(made, OX + 2, lane, rounded(p.z, like))
    store(made, DX, lane, rounded(d.x, like))
    store(made, DX + 1, lane, rounded(d.y, like))
    store(made, DX + 2, lane, rounded(d.z, like))
    store(carried, 0, lane, narrow(r))
    store(carried, 1, lane, narrow(g))
    store(carried, 2, lane, narrow(b))
    return greatest(r, greatest(g, b)) > NEGLIGIBLE


@inline
def _take(child, i, made, carried, lane, owner, parent, sort):
    """Ray i of the child wave: the one noted in a lane, which descends from column `parent`."""
    for k in range(6):
        child.rays.ray[k, i] = made[k, lane]
    for k in range(3):
        child.weight[k, i] = carried[k, lane]
    child.owner[i], child.source[i] = owner[parent], 2 * parent + sort


@inline
def _take_all(child, i, made, carried, owner, parent):
    """Rays i .. i+7 of the child wave: the first eight noted, all reflected, which descend from columns parent .. parent+7."""
    for k in range(6):
        store(child.rays.ray, k, i, load(made, k, 0))
    for k in range(3):
        store(child.weight, k, i, load(carried, k, 0))
    copy(child.owner, i, owner, parent)
    count_up(child.source, i, 2 * parent + REFLECTED, 2)


@inline
def _take_both(child, i, made, carried, owner, parent):
    """Rays i .. i+15 of the child wave: all sixteen noted, a reflected and a refracted one by turns."""
    for k in range(6):
        store_by_turns(child.rays.ray, k, i, load(made, k, 0), load(made, k, LANES))
    for k in range(3):
        store_by_turns(child.weight, k, i, load(carried, k, 0), load(carried, k, LANES))
    copy_twice(child.owner, i, owner, parent)
    count_up(child.source, i, 2 * parent, 1)
    count_up(child.source, i + LANES, 2 * parent + LANES, 1)


@inline
def _start(rays, i):
    """Let rays i .. i+7 have met nothing yet."""
    none = zero(load(rays.ray, START, i))
    store(rays.ray, START, i, none)
    store(rays.ray, T, i, none + np.inf)
    fill(rays.prim, i, -1)
    fill(rays.depth, i, 0)


@kernel
def bounce(wave, n, look, child, counts):
    """The reflected and refracted rays of the wave's hits into `child`, which needs room for 2n; returns their number. A hit's two rays
    stand side by side, so that the order does not depend on the rest of the wave. counts[0], counts[1] grow by each sort's number."""
    prim, m, of = wave.rays.prim, look.material, look.of
    made, carried = np.empty((6, 2 * LANES), wave.rays.ray.dtype), np.empty((3, 2 * LANES), np.float32)
    total = 0
    for i in range(0, n, LANES):
        hit = exceeds(prim, i, -1)
        if not any_lane(hit):
            continue
        met = rows_of(prim, i, 0, hit)
        row = common_chosen(of, met)
        if row >= 0:
            if m[row, REFLECTION] > 0 or m[row, TRANSMISSION] > 0:
                total = _onward(wave, i, hit, m, row, made, carried, child, total, counts)
            continue
        rows = chosen(of, met)
        hit = hit & ((pick(m, rows, REFLECTION) > 0) | (pick(m, rows, TRANSMISSION) > 0))
        if any_lane(hit):
            total = _onward(wave, i, hit, m, rows, made, carried, child, total, counts)
    for i in range(0, total, LANES):
        _start(child.rays, i)
    finish(child.rays, total)
    return total


@inline
def _onward(wave, i, hit, m, row, made, carried, child, total, counts):
    """The rays that come of hits i .. i+7 into the child wave from column `total` on; returns the column after the last. row: of their
    materials, as for `pick`."""
    ray, surface = wave.rays.ray, wave.surface
    d, like = wide(load3(ray, DX, i)), load(ray, OX, 0)
    g, normal, side = _faced(ray, surface, i)
    cosine = -(d.x * normal.x + d.y * normal.y + d.z * normal.z)
    away = cosine <= 0      # an interpolated normal that looks away from the eye
    normal = select(away, g, normal)
    cosine = select(away, -(d.x * normal.x + d.y * normal.y + d.z * normal.z), cosine)
    eta = pick(m, row, IOR)
    eta = select(side > 0, 1 / eta, eta)
    square = 1 - eta * eta * (1 - cosine * cosine)
    reflection, transmission = _shares(m, row, cosine, eta, square)
    p, err = wide(load3(surface, PX, i)), wide(load(surface, ERR, i))
    reflected = refracted = 0
    if any_lane(hit & (reflection > 0)):
        way = d + normal * (2 * cosine)
        below = way.x * g.x + way.y * g.y + way.z * g.z <= 0        # the true surface: mirror about that instead
        way = select(below, d - g * (2 * (d.x * g.x + d.y * g.y + d.z * g.z)), way)
        reflected = bits(hit & _go_on(made, carried, 0, wave, m, row, i, reflection, p + g * err, way, like))
    if any_lane(hit & (transmission > 0)):
        way = d * eta + normal * (eta * cosine - root(square))
        refracted = bits(hit & _go_on(made, carried, LANES, wave, m, row, i, transmission, p - g * err, way, like))
    if reflected == 255 and refracted == 0:
        _take_all(child, total, made, carried, wave.owner, i)
        counts[REFLECTED] += LANES
        return total + LANES
    if reflected & refracted == 255:
        _take_both(child, total, made, carried, wave.owner, i)
        counts[REFLECTED] += LANES
        counts[REFRACTED] += LANES
        return total + 2 * LANES
    todo = reflected | refracted
    while todo:
        lane = lowest_bit(todo)
        todo &= todo - 1
        if (reflected >> lane) & 1:
            _take(child, total, made, carried, lane, wave.owner, i + lane, REFLECTED)
            total += 1
            counts[REFLECTED] += 1
        if (refracted >> lane) & 1:
            _take(child, total, made, carried, LANES + lane, wave.owner, i + lane, REFRACTED)
            total += 1
            counts[REFRACTED] += 1
    return total
