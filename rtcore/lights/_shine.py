"""What lights share: the rays from a wave's hits toward one, and what each would bring if nothing were in the way."""
from rtcore.across import lowest_bit
from rtcore.jit import inline
from rtcore.lanes import (any_lane, bits, dot, exceeds, fill, greatest, load, load3, narrow, root, rounded, select, size,
                          store, wide, zero)
from rtcore.powers import power
from rtcore.wave import DX, ERR, GLOSS, GX, NX, OX, POLISH, PX, RAY_ROWS, START, T


@inline
def hit_points(wave, i):
    """Where rays i .. i+7 hit, as float64 lanes; anything for those that don't."""
    return wide(load3(wave.surface, PX, i))


@inline
def unit(v):
    """v at length 1, without overflow or underflow; NaN for the zero vector."""
    v = v * (1 / greatest(greatest(size(v.x), size(v.y)), size(v.z)))
    return v * (1 / root(dot(v, v)))


@inline
def shine_on(wave, i, beam, j, color, way, reach, strength):
    """The shadow rays of hits i .. i+7 into the columns of the beam from j on, which has room for eight; returns their number. way, reach,
    strength (lanes): direction to the light, t of the light, how strong it is there. No ray starts from a surface that faces away, or that
    answers no light."""
    surface, answer, ray, bring = wave.surface, beam.answer, beam.rays.ray, beam.bring
    d, g, normal = wide(load3(wave.rays.ray, DX, i)), wide(load3(surface, GX, i)), wide(load3(surface, NX, i))
    side = select(dot(d, g) < 0, 1, zero(d.x) - 1)      # the side that the ray comes from
    g, normal, toward = g * side, normal * side, unit(way)
    cosine, gloss = dot(normal, toward), wide(load(answer, GLOSS, i))
    red, green, blue = wide(load(answer, 0, i)), wide(load(answer, 1, i)), wide(load(answer, 2, i))
    ok = exceeds(wave.rays.prim, i, -1) & (cosine > 0) & (dot(g, toward) > 0) & (strength > 0)
    ok = ok & ((red > 0) | (green > 0) | (blue > 0) | (gloss > 0))
    lit = bits(ok)
    if lit == 0:
        return 0
    highlight = zero(cosine)
    if any_lane(ok & (gloss > 0)):
        h = unit(toward - d)
        highlight = gloss * power(greatest(dot(normal, h), 0), wide(load(answer, POLISH, i)))
    store(bring, 0, j, narrow(strength * color[0] * (red * cosine + highlight)))
    store(bring, 1, j, narrow(strength * color[1] * (green * cosine + highlight)))
    store(bring, 2, j, narrow(strength * color[2] * (blue * cosine + highlight)))
    p, away, like = hit_points(wave, i), wide(load(surface, ERR, i)), load(ray, OX, j)
    store(ray, OX, j, rounded(p.x + away * g.x, like))
    store(ray, OX + 1, j, rounded(p.y + away * g.y, like))
    store(ray, OX + 2, j, rounded(p.z + away * g.z, like))
    store(ray, DX, j, rounded(way.x, like))
    store(ray, DX + 1, j, rounded(way.y, like))
    store(ray, DX + 2, j, rounded(way.z, like))
    store(ray, START, j, zero(like))
    store(ray, T, j, rounded(reach, like))
    fill(beam.rays.prim, j, -1)
    fill(beam.rays.depth, j, 0)
    # the lit ones of the eight move together
    n = 0
    while lit:
        lane = lowest_bit(lit)
        lit &= lit - 1
        beam.owner[j + n] = i + lane
        if lane > n:
            for row in range(RAY_ROWS):
                ray[row, j + n] = ray[row, j + lane]
            for k in range(3):
                bring[k, j + n] = bring[k, j + lane]
        n += 1
    return n
