"""The quartic x⁴ + a x³ + b x² + c x + d as the product of two quadratics, (x² + α₁ x + β₁)(x² + α₂ x + β₂).

After Orellana and De Michele, *Algorithm 1010: Boosting Efficiency in Solving Quartic Equations with No Compromise in Accuracy*, ACM TOMS
46:20 (2020), for real roots: a complex pair of conjugate factors has none. The form is written as L D Lᵀ with

    L's last row (l₁, l₂, l₃) and D = diag(1, d₂, d₃),  l₁ = a/2,  l₃ = b/6 + φ/2,  d₂ = 2b/3 - φ - l₁²,  l₂ = (c - a l₃) / 2 d₂,

φ the root of greatest size of the resolvent cubic, so that d₃ = 0; each number that can be had by several formulas is taken by the one
that reproduces the coefficients best.
"""
import numpy as np

from rtcore.jit import inline


@inline
def off(value, wanted):
    """How far a value is from a coefficient: relative to it, where it is not 0."""
    return abs(value - wanted) if wanted == 0 else abs((value - wanted) / wanted)


@inline
def off_factors(a, b, c, aq, bq, cq, dq):
    """How far two factors' product is from the quartic in its first three coefficients."""
    return off(aq + cq, a) + off(bq + aq * cq + dq, b) + off(bq * cq + aq * dq, c)


@inline
def off_form(b, c, d, d2, l1, l2, l3):
    """How far L D Lᵀ is from the quartic."""
    return off(d2 + l1 * l1 + l3 + l3, b) + off((d2 * l2 + l1 * l3) + (d2 * l2 + l1 * l3), c) + off(d2 * l2 * l2 + l3 * l3, d)


@inline
def resolvent(a, b, c, d, kind):
    """φ, the real root of greatest size of x³ + g x + h, from the quartic shifted to where its cubic's coefficients are small; then
    Newton steps as long as they help."""
    square = kind(9) * a * a - kind(24) * b
    s = -a / kind(4)
    if square > 0:
        w = np.sqrt(square)
        s = -kind(2) * b / (kind(3) * a + (w if a > 0 else -w))
    aq, bq = a + kind(4) * s, b + kind(3) * s * (a + kind(2) * s)
    cq, dq = c + s * (kind(2) * b + s * (kind(3) * a + kind(4) * s)), d + s * (c + s * (b + s * (a + s)))
    gg, hh = bq * bq / kind(9), aq * cq
    g = hh - kind(4) * dq - kind(3) * gg
    h = (kind(8) * dq + hh - kind(2) * gg) * bq / kind(3) - cq * cq - dq * aq * aq
    q, r = -g / kind(3), h / kind(2)
    if r * r < q * q * q:
        angle = np.arccos(r / (q * np.sqrt(q)))
        turn = kind(angle / kind(3)) if r > 0 else kind((angle + kind(2 * np.pi)) / kind(3))
        x = -kind(2) * np.sqrt(q) * kind(np.cos(turn))
    else:
        u = kind(np.cbrt(abs(r) + np.sqrt(r * r - q * q * q)))
        u = -u if r > 0 else u
        x = u + (q / u if u != 0 else u)
    f = (x * x + g) * x + h
    for _ in range(8):
        slope = kind(3) * x * x + g
        if f == 0 or slope == 0:
            break
        y = x - f / slope
        after = (y * y + g) * y + h
        if not abs(after) < abs(f):
            break
        x, f = y, after
    return x


@inline
def factored(a, b, c, d, phi, kind, eps):
    """α₁, β₁, α₂, β₂ and whether they are real."""
    l1, l3 = a / kind(2), b / kind(6) + phi / kind(2)
    rest = c - a * l3
    first = kind(2) * b / kind(3) - phi - l1 * l1
    last = d - l3 * l3
    d2, l2, best = kind(0), kind(0), kind(np.inf)
    if first != 0:
        d2, l2 = first, rest / (first + first)
        best = off_form(b, c, d, d2, l1, l2, l3)
    if rest != 0:
        other = kind(2) * last / rest
        if other != 0:
            error = off_form(b, c, d, rest / (other + other), l1, other, l3)
            if error < best:
                d2, l2, best = rest / (other + other), other, error
        error = off_form(b, c, d, first, l1, other, l3)
        if error < best:
            d2, l2 = first, other
    aq = bq = cq = dq = kind(0)
    real, error = d2 < 0, kind(np.inf)
    if real:
        gamma = np.sqrt(-d2)
        aq, bq, cq, dq = l1 + gamma, l3 + gamma * l2, l1 - gamma, l3 - gamma * l2
        if abs(dq) < abs(bq):
            dq = d / bq
        elif abs(dq) > abs(bq):
            bq = d / dq
        # the smaller of the two linear coefficients lost digits: three formulas for it
        if abs(aq) < abs(cq):
            x = best_of(a, b, c, bq, cq, dq, kind)
            aq = x
        else:
            x = best_of(a, b, c, dq, aq, bq, kind)
            cq = x
        error = off_factors(a, b, c, aq, bq, cq, dq) + off(bq * dq, d)
    # d₂ all but 0: both factors have the same linear coefficient
    if abs(d2) <= eps * max(max(abs(kind(2) * b / kind(3)), abs(phi)), l1 * l1) and last <= 0:
        b1, d1 = l3 + np.sqrt(-last), l3 - np.sqrt(-last)
        if abs(d1) < abs(b1):
            d1 = d / b1
        elif abs(d1) > abs(b1):
            b1 = d / d1
        if not real or off_factors(a, b, c, l1, b1, l1, d1) + off(b1 * d1, d) < error:
            aq, bq, cq, dq, real = l1, b1, l1, d1, True
    return aq, bq, cq, dq, real


@inline
def best_of(a, b, c, bq, cq, dq, kind):
    """α of the factor with β = bq beside the factor (cq, dq)."""
    x = a - cq
    error = off_factors(a, b, c, x, bq, cq, dq)
    if dq != 0:
        y = (c - bq * cq) / dq
        after = off_factors(a, b, c, y, bq, cq, dq)
        if after < error:
            x, error = y, after
    if cq != 0:
        y = (b - dq - bq) / cq
        if off_factors(a, b, c, y, bq, cq, dq) < error:
            x = y
    return x


@inline
def polished(a, b, c, d, aq, bq, cq, dq):
    """Newton's method for the four equations in α₁, β₁, α₂, β₂, as long as it helps."""
    f0, f1, f2, f3 = bq * dq - d, bq * cq + aq * dq - c, bq + aq * cq + dq - b, aq + cq - a
    error = off(bq * dq, d) + off(bq * cq + aq * dq, c) + off(bq + aq * cq + dq, b) + off(aq + cq, a)
    for _ in range(8):
        if error == 0:
            break
        # unknowns x, y of α₁ and β₁ after those of α₂ and β₂ are eliminated: α₂ = -f3 - x, β₂ = -f2 - cq x - aq (-f3 - x) - y
        k = -f2 + aq * f3
        m11, m12, r1 = dq - bq + aq * (aq - cq), cq - aq, -f1 - aq * k + bq * f3
        m21, m22, r2 = bq * (aq - cq), dq - bq, -f0 - bq * k
        det = m11 * m22 - m12 * m21
        if det == 0:
            break
        x, y = (r1 * m22 - m12 * r2) / det, (m11 * r2 - r1 * m21) / det
        a1, b1, c1 = aq + x, bq + y, cq - f3 - x
        d1 = dq + k + (aq - cq) * x - y
        after = off(b1 * d1, d) + off(b1 * c1 + a1 * d1, c) + off(b1 + a1 * c1 + d1, b) + off(a1 + c1, a)
        if not after < error:
            break
        aq, bq, cq, dq, error = a1, b1, c1, d1, after
        f0, f1, f2, f3 = bq * dq - d, bq * cq + aq * dq - c, bq + aq * cq + dq - b, aq + cq - a
    return aq, bq, cq, dq


@inline
def put_orellana(a, b, c, d, roots, count, i):
    """The real roots of both factors."""
    kind = roots.dtype.type
    aq, bq, cq, dq, real = factored(a, b, c, d, resolvent(a, b, c, d, kind), kind, np.finfo(roots.dtype).eps)
    count[i] = 0
    if not real:
        return
    aq, bq, cq, dq = polished(a, b, c, d, aq, bq, cq, dq)
    n = 0
    for k in range(2):
        p, q = (aq, bq) if k == 0 else (cq, dq)
        inside = p * p / kind(4) - q
        if inside >= 0:
            w = np.sqrt(inside)
            far = -p / kind(2) - w if p > 0 else w - p / kind(2)
            roots[i, n], roots[i, n + 1] = far, q / far if far != 0 else far
            n += 2
    count[i] = n
