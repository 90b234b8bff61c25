"""The ray and the ball, with a certain answer: what spheres and ellipsoids share.

Plain float64 arithmetic comes first, with a bound on the error of the discriminant; then one Newton step on a double-double residual,
with a bound on what it leaves. Lanes that either bound can't vouch for go one by one to sums in some hundred digits. A float32 ray is first
rejected in float32, by the same bound, and widened if that can't.
"""
import numpy as np

from rtcore.expansions import LONG, expand, put_products, solve_quadratic
from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import along, any_lane, dot, fma, root, rounded, select, size, wide, with_sign
from rtcore.pairs import ordered_sum, square, two_product, two_sum
from rtcore.shapes.kind import BACK, FRONT
from rtcore.wave import SLOW, START, record_one

U64, U32 = 2.0 ** -53, 2.0 ** -24


@inline
def extent(v):
    """|x| + |y| + |z|: at least the length, at most 1.74 of it."""
    return size(v.x) + size(v.y) + size(v.z)


@inline
def closest(f, d, radius, far, u):
    """Of eight lines f + s d and the ball of the radius about the origin: 1/d², s of the closest approach, the discriminant (the square of
    half the chord) and a bound on its error, for arithmetic of unit roundoff u. f may be off by 4 u times `far`, which is at least |f|.

    The foot l of the perpendicular is then off by 12 u far at most, its square by 24 u far |l|.
    """
    inverse = 1 / dot(d, d)
    middle = -dot(f, d) * inverse
    foot = along(f, middle, d)
    return inverse, middle, radius * radius - dot(foot, foot), 32 * u * (extent(foot) + radius) * (far + radius)


@inline
def may_meet(near):
    """Lanes for which the discriminant and its bound, as `closest` gives them, don't rule a crossing out."""
    return ~(near[2] < -near[3])


@inline
def leads_away(f, near, radius, doubt):
    """Lanes that start outside the ball for certain and move away from it, as those do that leave it: half of all tests that come so far
    are of a ray and the sphere that sent it. doubt: what f² - radius² may be off; so little that where rounding has got the sign of f·d
    wrong, the line passes at |f| to all digits, and misses."""
    return (near[1] < 0) & (dot(f, f) - radius * radius > doubt)


@inline
def advance(f, f1, s, v, v1):
    """(f + f1) + s (v + v1) as a pair."""
    p, e = two_product(s, v)
    h, r = two_sum(f, p)
    return ordered_sum(h, r + (fma(s, v1, e) + f1))


@inline
def polish(f, f1, v, v1, s, radius, radius1, far, speed):
    """One Newton step from s on |f + s v|² - radius², f, v and radius as pairs; the size of the slope; and a bound on what the step leaves,
    times that slope. f may be off by 8 U64² times `far`, |v| is at most `speed`, and v may be off by 4 U64 speed."""
    x, x1 = advance(f.x, f1.x, s, v.x, v1.x)
    y, y1 = advance(f.y, f1.y, s, v.y, v1.y)
    z, z1 = advance(f.z, f1.z, s, v.z, v1.z)
    xx, xx1 = square(x, x1)
    yy, yy1 = square(y, y1)
    zz, zz1 = square(z, z1)
    rr, rr1 = square(radius, radius1)
    a, e = two_sum(xx, yy)
    b, e1 = two_sum(a, zz)
    c, e2 = two_sum(b, -rr)
    excess = c + ((e + e1 + e2) + ((xx1 + yy1) + (zz1 - rr1)))
    slope = 2 * (x * v.x + y * v.y + z * v.z)
    step = excess / slope
    # Newton's own error; that of the slope times the step; that of the excess
    across = speed * size(step)
    return s - step, size(slope), across * (across + 16 * U64 * radius) + 32 * U64 * U64 * radius * (far + radius)


@inline
def choose(todo, near, f, f1, v, v1, radius, radius1, far, speed, start, end, side, like, where):
    """Where the lanes `todo` first cross a ball between start and end; `near` is what `closest` gave. Returns s, the lanes that found
    it, and those for which this arithmetic isn't certain. What comes after the start is told once s is rounded to the type of `like`.
    Unless it matters `where`, as it doesn't to shadow rays, an s well between start and end is good enough as plain arithmetic gives it.
    """
    inverse, middle, off, fuzz = near
    sure = off > 1024 * fuzz
    unsure = todo & ~sure
    todo = todo & sure
    half = root(off * inverse)
    outer = middle + with_sign(half, middle)
    inner = (dot(f, f) - radius * radius) * inverse / outer
    slack = half * 2.0 ** -10       # at least what plain arithmetic is off
    s = 0 * middle
    found = todo & ~todo
    if side & BACK == 0:
        enter = select(outer > 0, inner, outer)      # outer, not middle: that may be 0 of either sign
        todo = todo & (enter - slack < end)
        if not where:
            found = todo & (enter - slack > start) & (enter + slack < end)
            s = enter
            todo = todo & ~found
        want = todo & (enter + slack > start)
        if any_lane(want):
            r, slope, left = polish(f, f1, v, v1, enter, radius, radius1, far, speed)
            ok = certain(r, slope, left, start, end)
            unsure = unsure | (want & ~ok)
            met = want & ok & (wide(rounded(r, like)) > start)
            s, found = select(met, r, s), found | met
            todo = todo & ~(want & ~ok) & ~met
    if side & FRONT == 0:
        leave = select(outer > 0, outer, inner)
        if not where:
            met = todo & (leave - slack > start) & (leave + slack < end)
            s, found, todo = select(met, leave, s), found | met, todo & ~met
        want = todo & (leave + slack > start) & (leave - slack < end)
        if any_lane(want):
            r, slope, left = polish(f, f1, v, v1, leave, radius, radius1, far, speed)
            ok = certain(r, slope, left, start, end)
            unsure = unsure | (want & ~ok)
            s = select(want & ok, r, s)
            found = found | (want & ok)
    return s, found, unsure


@inline
def after_start(ray, i, t):
    """Whether t, rounded to the ray's precision, is past the start of ray i."""
    return (np.float64(np.float32(t)) if ray.itemsize == 4 else t) > ray[START, i]


@inline
def lowest(mask):
    """Number of the lowest bit that is set."""
    k = 0
    while not (mask >> k) & 1:
        k += 1
    return k


@inline
def certain(t, slope, left, start, end):
    """Lanes whose t, off by left / slope at most, is known to half an ulp or certain to lie outside the interval."""
    return (left <= slope * (U64 * size(t))) | (left < slope * (start - t)) | (left < slope * (t - end))


@kernel
def settle_one(rays, i, p, f, d, noise, radius, radius1, power, side, opacity):
    """Record where ray i alone crosses the ball: f and d are expansions (3, LONG) in units of `power`, `noise` is what `solve_quadratic`
    wants. A tangent has no side."""
    out_of_line()
    rays.tally[SLOW] += 1
    terms = np.empty(6 * LONG * LONG + 8 + LONG)
    form, roots = np.empty((3, LONG)), np.empty((2, 2))
    n = 0
    for k in range(3):
        n = put_products(terms, n, 1.0, d[k], d[k])
    expand(terms, n, form[0])
    n = 0
    for k in range(3):
        n = put_products(terms, n, 1.0, f[k], d[k])
    expand(terms, n, form[1])
    n = 0
    for k in range(3):
        n = put_products(terms, n, 1.0, f[k], f[k])
    n = put_products(terms, n, -1.0, (radius, radius1), (radius, radius1))
    expand(terms, n, form[2])
    if solve_quadratic(form[0], form[1], form[2], noise, roots) == 0 and side & (FRONT | BACK):
        return
    enter, leave = min(roots[0, 0], roots[1, 0]) * power, max(roots[0, 0], roots[1, 0]) * power
    if side & BACK == 0 and after_start(rays.ray, i, enter):
        record_one(rays, i, p, enter, opacity)
    elif side & FRONT == 0:
        record_one(rays, i, p, leave, opacity)
