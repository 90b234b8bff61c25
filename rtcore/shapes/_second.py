"""The ray and a surface of second degree, with a certain answer, in the manner of `_ball.py`.

The form is Ax² + By² + Cz² + Dxy + Exz + Fyz + Gx + Hy + Iz + J, its numbers at most about 1, in a unit space that the exact matrix L
leads to; a box there, a slab, or the whole space says which of its points belong to the surface. Along a ray about its closest approach
to the unit space's origin it is a s² + 2 b s + c.

Columns of Table.exact: those of `_unit.py`; three parts each of the ten numbers; at BOX two parts of the box's corners, or at SLAB, NEXT
and LAST three of the slab's vector e: it is what has |e·p| <= 1/2.
"""
from typing import NamedTuple

import numpy as np

from rtcore.expansions import LONG, expand, noise_of, put_products, solve_quadratic
from rtcore.jit import inline, kernel, out_of_line
from rtcore.lanes import along, any_lane, dot, fma, load, load3, root, rounded, select, size, splat3, vec3, wide, with_sign
from rtcore.pairs import add, multiply
from rtcore.shapes._ball import U64, advance, after_start, certain, extent
from rtcore.shapes._unit import BEYOND, PLACE, into_plain, line_expanded, line_in_unit, noise_here
from rtcore.shapes.kind import BACK, FRONT
from rtcore.wave import DX, OX, SLOW, START, T, record_one, until

FORM, BOX = BEYOND, BEYOND + 30
LAST, NEXT, SLAB = range(BOX, BOX + 9, 3)
EVERYWHERE, IN_BOX, IN_SLAB = 0, 1, 2
GONE = 2.0 ** 14    # how far a bound must be surpassed for plain arithmetic to be a good start


class Near(NamedTuple):
    """What plain arithmetic says of eight rays and a surface, with bounds on its errors."""

    shift: object       # t of the closest approach
    a: object
    b: object
    c: object
    blur: object        # bounds on their errors
    blur_b: object
    blur_c: object
    off: object         # discriminant
    fuzz: object        # bound on its error
    foot: object        # the closest approach
    way: object         # the direction
    far: object         # what the error of the ray's origin in unit space is a rounding of
    speed: object       # bound on the length of its direction there
    reach: object       # |x| + |y| + |z| of the closest approach


@inline
def steepness(pull, mixed, v):
    """The gradient of the form's second-degree part at v."""
    return vec3(2 * pull.x * v.x + mixed.x * v.y + mixed.y * v.z, mixed.x * v.x + 2 * pull.y * v.y + mixed.z * v.z,
                mixed.y * v.x + mixed.z * v.y + 2 * pull.z * v.z)


@inline
def difference(a, b, c, d):
    """a·b - c·d with a rounding error of the result's own size (Kahan; Jeannerod, Louvet, Muller 2013)."""
    w = c * d
    return fma(a, b, -w) - fma(c, d, -w)


@inline
def approach(ray, i, exact, q, most, curved):
    """Eight rays and surface q, plainly. most: the largest number of L; curved: that of the form's second-degree part."""
    g, v = (wide(load3(ray, OX, i)) - splat3(exact, q, PLACE)) - splat3(exact, q, PLACE + 3), wide(load3(ray, DX, i))
    f, d = into_plain(exact, q, g), into_plain(exact, q, v)
    shift = -dot(f, d) / dot(d, d)
    n = along(f, shift, d)
    pull, mixed, slope = splat3(exact, q, FORM), splat3(exact, q, FORM + 3), splat3(exact, q, FORM + 6)
    md, mn = steepness(pull, mixed, d), steepness(pull, mixed, n)
    a, b = 0.5 * dot(md, d), 0.5 * (dot(mn, d) + dot(slope, d))
    c = 0.5 * dot(mn, n) + dot(slope, n) + exact[q, FORM + 9]
    far, speed, reach = most * (extent(g) + extent(v) * size(shift)), most * extent(v), extent(n)
    blur, blur_b, blur_c = 32 * U64 * curved * speed * speed, 32 * U64 * speed * (far + 1), 64 * U64 * (far + 1) * (reach + 1)
    return judged(shift, a, b, c, blur, blur_b, blur_c, n, d, far, speed, reach)


@inline
def judged(shift, a, b, c, blur, blur_b, blur_c, foot, way, far, speed, reach):
    """All that with the discriminant and what it may be off."""
    off = difference(b, b, a, c)
    fuzz = 2 * size(b) * blur_b + size(a) * blur_c + size(c) * blur + blur * blur_c + blur_b * blur_b + 4 * U64 * size(off)
    return Near(shift, a, b, c, blur, blur_b, blur_c, off, fuzz, foot, way, far, speed, reach)


@inline
def may_meet(near):
    """Lanes that may cross the surface."""
    return ~(near.off < -near.fuzz)


@inline
def between(p, e, margin):
    """Lanes whose point is surely in the slab of vector e, and those where it may be."""
    height, margin = size(dot(p, e)), margin * extent(e)
    return height <= 0.5 - margin, height <= 0.5 + margin


class Form(NamedTuple):
    """The form's numbers, each a pair of lanes: of x² y² z², xy xz yz, x y z, and 1."""

    pull: object
    pull1: object
    mixed: object
    mixed1: object
    slope: object
    slope1: object
    rest: object
    rest1: object


@inline
def form_of(exact, q, zero):
    """The form of surface q."""
    return Form(splat3(exact, q, FORM), splat3(exact, q, FORM + 10), splat3(exact, q, FORM + 3), splat3(exact, q, FORM + 13),
                splat3(exact, q, FORM + 6), splat3(exact, q, FORM + 16), exact[q, FORM + 9] + zero, exact[q, FORM + 19] + zero)


@inline
def value(m, x, x1, y, y1, z, z1):
    """The form at (x, y, z), all in pairs; only the leading part."""
    p, p1 = linear(m.slope.x, m.slope1.x, m.pull.x, m.pull1.x, x, x1)
    p, p1 = linear(p, p1, m.mixed.x, m.mixed1.x, y, y1)
    p, p1 = linear(p, p1, m.mixed.y, m.mixed1.y, z, z1)
    q, q1 = linear(m.slope.y, m.slope1.y, m.pull.y, m.pull1.y, y, y1)
    q, q1 = linear(q, q1, m.mixed.z, m.mixed1.z, z, z1)
    r, r1 = linear(m.slope.z, m.slope1.z, m.pull.z, m.pull1.z, z, z1)
    s, s1 = linear(m.rest, m.rest1, p, p1, x, x1)
    s, s1 = linear(s, s1, q, q1, y, y1)
    return linear(s, s1, r, r1, z, z1)[0]


@inline
def linear(s, s1, a, a1, x, x1):
    """s + a x, in pairs."""
    p, p1 = multiply(a, a1, x, x1)
    return add(s, s1, p, p1)


@inline
def polish(m, near, f, f1, v, v1, far, s):
    """One Newton step on the form from t = s; its slope; a bound on what the step leaves, times the slope; the point reached and a bound
    on the latter's error. f, as a pair, may be off by some roundings, in pairs, of `far`."""
    x, x1 = advance(f.x, f1.x, s, v.x, v1.x)
    y, y1 = advance(f.y, f1.y, s, v.y, v1.y)
    z, z1 = advance(f.z, f1.z, s, v.z, v1.z)
    p = vec3(x, y, z)
    slope = dot(steepness(m.pull, m.mixed, p) + m.slope, v)
    step = value(m, x, x1, y, y1, z, z1) / slope
    grow = 1 + extent(p)
    # the slope is off by some roundings of speed·grow, the form by as many of 2⁻¹⁰⁶ (far + 1)·grow
    left = size(near.a) * step * step + 32 * U64 * near.speed * grow * size(step) + 256 * U64 * U64 * (far + 1) * grow
    return s - step, slope, left, along(p, -step, v)


@inline
def within(p, low, high, margin):
    """Lanes whose point is surely in the box, and those where it may be."""
    sure = ((p.x >= low.x + margin) & (p.y >= low.y + margin) & (p.z >= low.z + margin)
            & (p.x <= high.x - margin) & (p.y <= high.y - margin) & (p.z <= high.z - margin))
    maybe = ((p.x >= low.x - margin) & (p.y >= low.y - margin) & (p.z >= low.z - margin)
             & (p.x <= high.x + margin) & (p.y <= high.y + margin) & (p.z <= high.z + margin))
    return sure, maybe


@inline
def placed(near, s, margin, low, high, part, limit):
    """Lanes whose point at s from the closest approach, plainly and off by `margin`, surely belongs to the part of the form that counts,
    and those whose point may."""
    margin = near.speed * margin + 64 * U64 * (near.far + limit + near.reach)
    if part == IN_SLAB:
        height, margin = size(fma(s, dot(near.way, low), dot(near.foot, low))), margin * extent(low)
        return height <= 0.5 - margin, height <= 0.5 + margin
    return within(along(near.foot, s, near.way), low, high, margin)


@inline
def meet(ray, i, exact, q, most, even, part, limit, todo, near, side, where):
    """Where the lanes `todo` first meet surface q: t in the rays' precision, the lanes that do, those for which that is not certain. part:
    which part of the form belongs to it; none of it is further than `limit` from the origin. even: see `line_in_unit`. where: see
    `_ball.choose`."""
    start, end, like = wide(load(ray, START, i)), until(ray, i), load(ray, T, i)
    low, high = splat3(exact, q, SLAB if part == IN_SLAB else BOX), splat3(exact, q, BOX + 3)   # the slab's vector, or the box's corners
    half = root(near.off)
    w = -(near.b + with_sign(half, near.b))     # the roots are w / a and c / w
    lead = size(near.a) + near.blur
    gone = lead <= 0        # the root w / a is nowhere as a is 0, or lies beyond the limit
    if part != EVERYWHERE:
        gone = gone | (lead * (near.reach + limit) < 0.57 * size(w) * extent(near.way))
    sure = (near.off > GONE * near.fuzz) & (gone | (size(near.a) > GONE * near.blur))
    unsure = todo & ~sure
    todo = todo & sure
    blur_w = near.blur_b + half / GONE      # fuzz / half is less
    if side & (FRONT | BACK):
        # only one of the roots is on the visible side: the form falls at c / w where w > 0, and rises at w / a
        other = w < 0 if side & FRONT else w > 0
        todo = todo & ~(other & gone)
        down = 1 / select(other, near.a, w)
        first = select(other, w, near.c) * down
        slack = slack_of(select(other, blur_w, near.blur_c), select(other, near.blur, blur_w), first, down, near.shift)
        last, slack_last = first, slack
    else:
        down_a, down_w = 1 / near.a, 1 / w
        s0, s1 = w * down_a, near.c * down_w
        slack0 = slack_of(blur_w, near.blur, s0, down_a, near.shift)
        slack1 = slack_of(near.blur_c, blur_w, s1, down_w, near.shift)
        swap = ~gone & (s0 < s1)
        first, last = select(swap, s0, s1), select(gone, np.inf, select(swap, s1, s0))
        slack, slack_last = select(swap, slack0, slack1), select(gone, 0, select(swap, slack1, slack0))
    guess, guess_last = first + near.shift, last + near.shift
    want = todo & (guess + slack > start) & (guess - slack < end)
    inside = want
    if part != EVERYWHERE:
        inside, maybe = placed(near, first, slack, low, high, part, limit)
        want = want & maybe
    t, found = guess, todo & ~todo
    want_last, inside_last = found, found
    if side & (FRONT | BACK) == 0:
        want_last = todo & (guess_last + slack_last > start) & (guess_last - slack_last < end)
        inside_last = want_last
        if part != EVERYWHERE:
            inside_last, maybe = placed(near, last, slack_last, low, high, part, limit)
            want_last = want_last & maybe
    if not where:
        found = want & inside & (guess - slack > start) & (guess + slack < end)
        hit = want_last & inside_last & (guess_last - slack_last > start) & (guess_last + slack_last < end)
        t = select(found, guess, guess_last)
        found = found | hit
        want, want_last = want & ~found, want_last & ~found
    if any_lane(want | want_last):
        m = form_of(exact, q, 0 * w)
        f, f1, v, v1 = line_in_unit(ray, i, exact, q, even)
        far = near.far + most * extent(splat3(exact, q, PLACE))
        for k in range(2):
            if k == 1:
                want = want_last & ~found & ~unsure
                guess = guess_last
            if any_lane(want):
                r, slope, left, p = polish(m, near, f, f1, v, v1, far, guess)
                steep = size(slope)
                ok = certain(r, steep, left, start, end)
                hit = want & ok & (wide(rounded(r, like)) > start) & (r < end)
                if part != EVERYWHERE:
                    margin = 8 * U64 * (limit + near.reach) + near.speed * (left / steep + 2 * U64 * size(r))
                    inside, maybe = within(p, low, high, margin)
                    if part == IN_SLAB:
                        inside, maybe = between(p, low, margin)
                    ok = ok & (inside | ~maybe)
                    hit = hit & inside
                unsure = unsure | (want & ~ok)
                hit = hit & ok
                t = select(hit, r, t)
                found = found | hit
    return rounded(t, like), found, unsure


@inline
def slack_of(blur, blur_down, s, down, shift):
    """Twice what a root s, the quotient of numbers off by `blur` and `blur_down`, and its t may be off; down: 1 over the latter."""
    return 2 * (blur + size(s) * blur_down) * size(down) + 8 * U64 * (size(s) + size(shift))


# --- the slow way ---

@kernel
def second_parts(exact, q, v, out):
    """Half the gradient of the form's second-degree part at v, as expansions (3, LONG) like v."""
    out_of_line()
    terms = np.empty(18 * LONG + LONG)
    places = ((0, 3, 4), (3, 1, 5), (4, 5, 2))      # of the numbers of x², y², z², xy, xz, yz in a matrix
    for k in range(3):
        n = 0
        for j in range(3):
            a = FORM + places[k][j]
            share = 1.0 if j == k else 0.5
            n = put_products(terms, n, share, (exact[q, a], exact[q, a + 10], exact[q, a + 20]), v[j])
        expand(terms, n, out[k])


@kernel
def line_form(exact, q, f, d, form):
    """Expansions of a, b, c of the form along f + s d: form[0], form[1], form[2]."""
    out_of_line()
    mf, md = np.empty((3, LONG)), np.empty((3, LONG))
    second_parts(exact, q, f, mf)
    second_parts(exact, q, d, md)
    terms = np.empty(6 * LONG * LONG + 18 * LONG + 3 + LONG)
    n = 0
    for k in range(3):
        n = put_products(terms, n, 1.0, md[k], d[k])
    expand(terms, n, form[0])
    n = 0
    for k in range(3):
        a = FORM + 6 + k
        n = put_products(terms, n, 1.0, mf[k], d[k])
        n = put_products(terms, n, 0.5, (exact[q, a], exact[q, a + 10], exact[q, a + 20]), d[k])
    expand(terms, n, form[1])
    n = 0
    for k in range(3):
        a = FORM + 6 + k
        n = put_products(terms, n, 1.0, mf[k], f[k])
        n = put_products(terms, n, 1.0, (exact[q, a], exact[q, a + 10], exact[q, a + 20]), f[k])
    terms[n], terms[n + 1], terms[n + 2] = exact[q, FORM + 9], exact[q, FORM + 19], exact[q, FORM + 29]
    expand(terms, n + 3, form[2])


@inline
def noise_along(exact, q, f, d, far, speed):
    """What is noise in the form along f + s d: as `noise_of`."""
    curved, steep = 0.0, 0.0
    for k in range(6):
        curved = max(curved, abs(exact[q, FORM + k]))
    for k in range(6, 9):
        steep = max(steep, abs(exact[q, FORM + k]))
    return noise_of(f, d, far, speed, curved, steep, abs(exact[q, FORM + 9]), noise_here(exact, q, FORM + 20, FORM + 30))


@kernel
def settle(rays, i, p, table, q, part, opacity):
    """Ray i against surface q, the slow and certain way."""
    out_of_line()
    rays.tally[SLOW] += 1
    exact, ray, side = table.exact, rays.ray, table.side[q]
    f, d, form, roots = np.empty((3, LONG)), np.empty((3, LONG)), np.empty((3, LONG)), np.empty((2, 2))
    far, speed = line_expanded(ray, i, exact, q, f, d)
    line_form(exact, q, f, d, form)
    slope = solve_quadratic(form[0], form[1], form[2], noise_along(exact, q, f, d, far, speed), roots)
    first = 0 if roots[0, 0] <= roots[1, 0] else 1
    for k in range(2):
        j = first if k == 0 else 1 - first
        falls = slope < 0 if j == 0 else slope > 0
        rises = slope > 0 if j == 0 else slope < 0
        if (side & FRONT and not falls) or (side & BACK and not rises) or not after_start(ray, i, roots[j, 0]):
            continue
        if not abs(roots[j, 0]) < np.inf:
            continue
        if (part == EVERYWHERE or (part == IN_BOX and in_box(exact, q, f, d, roots[j]))
                or (part == IN_SLAB and in_slab(exact, q, f, d, roots[j]))):
            record_one(rays, i, p, roots[j, 0], opacity)
            return


@kernel
def in_box(exact, q, f, d, t):
    """Whether the point f + t d of the unit space, in expansions, t a pair, is in the box of surface q, its sides included."""
    out_of_line()
    terms, over = np.empty(5 * LONG + 2 + LONG), np.empty(LONG)
    for k in range(3):
        for end in range(2):
            corner = BOX + 3 * end + k
            n = 0
            for j in range(LONG):
                terms[n] = f[k, j]
                n += 1
            n = put_products(terms, n, 1.0, t, d[k])
            terms[n], terms[n + 1] = -exact[q, corner], -exact[q, corner + 6]
            expand(terms, n + 2, over)
            beyond = -over[0] if end == 0 else over[0]
            if beyond > 2.0 ** -98 * (abs(f[k, 0]) + abs(t[0] * d[k, 0])):
                return False
    return True


@kernel
def heights(exact, q, v, out):
    """e·v as an expansion, e being the slab's vector, v expansions (3, LONG)."""
    out_of_line()
    terms, n = np.empty(18 * LONG + LONG), 0
    for k in range(3):
        n = put_products(terms, n, 1.0, (exact[q, SLAB + k], exact[q, NEXT + k], exact[q, LAST + k]), v[k])
    expand(terms, n, out)


@kernel
def in_slab(exact, q, f, d, t):
    """Whether the point f + t d of the unit space, in expansions, t a pair, is in the slab of surface q, its sides included."""
    out_of_line()
    terms, low, speed, over = np.empty(5 * LONG + 1 + LONG), np.empty(LONG), np.empty(LONG), np.empty(LONG)
    heights(exact, q, f, low)
    heights(exact, q, d, speed)
    for end in range(2):
        sign = 2.0 * end - 1
        for j in range(LONG):
            terms[j] = sign * low[j]
        n = put_products(terms, LONG, sign, t, speed)
        terms[n] = -0.5
        expand(terms, n + 1, over)
        if over[0] > 2.0 ** -98 * (abs(low[0]) + abs(t[0] * speed[0])):
            return False
    return True
