"""Spheres as a first course has them: the quadratic by b² - 4ac, in plain floats of the rays' precision. To be compared with what is
certain: far from the eye the square of the distance leaves nothing of the radius, near a tangent rounding decides who hits."""
from rtcore.jit import inline, kernel
from rtcore.lanes import load, load3, root, select, splat3
from rtcore.shapes.kind import BACK, FRONT, into
from rtcore.walk import ACTIVE, PACKET, begin, leaf_end, leaf_first, new_walk, next_leaf, shrink
from rtcore.wave import DX, OX, START, record


@inline
def _dot(p, q):
    """p·q, each step rounded, as a textbook's program would."""
    return p.x * q.x + p.y * q.y + p.z * q.z


@inline
def meet(rays, i, p, f, d, square, side, opacity):
    """Rays i .. i+7, seen as f + t d, meet primitive p, all points with |f + t d|² = square."""
    a, b, c = _dot(d, d), 2 * _dot(f, d), _dot(f, f) - square
    twist = root(b * b - 4 * a * c)
    near, far = (-b - twist) / (2 * a), (twist - b) / (2 * a)
    if side & FRONT:
        t = near
    elif side & BACK:
        t = far
    else:
        t = select(near > load(rays.ray, START, i), near, far)
    record(rays, i, p, t, twist >= 0, opacity)      # a NaN is not


@kernel
def intersect_sphere(rays, n, tree, table, first, opacity):
    walk = new_walk(rays)
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                radius = table.data[q, 3] * table.data[q, 4]
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        i = start + g * 8
                        f = load3(rays.ray, OX, i) - splat3(table.data, q, 0)
                        meet(rays, i, first + q, f, load3(rays.ray, DX, i), radius * radius, table.side[q], opacity)
            shrink(walk, rays, start, walk.state[ACTIVE])
            leaf = next_leaf(walk, tree, table)


@kernel
def intersect_ellipsoid(rays, n, tree, table, first, opacity):
    walk, data = new_walk(rays), table.data
    for start in range(0, n, PACKET):
        begin(walk, rays, start, n, tree, False)
        leaf = next_leaf(walk, tree, table)
        while leaf >= 0:
            for q in range(leaf_first(leaf), leaf_end(leaf)):
                for g in range(PACKET // 8):
                    if (walk.state[ACTIVE] >> g) & 1:
                        i = start + g * 8
                        f = into(data, q, load3(rays.ray, OX, i) - splat3(data, q, 0))
                        meet(rays, i, first + q, f, into(data, q, load3(rays.ray, DX, i)), 1, table.side[q], opacity)
            shrink(walk, rays, start, walk.state[ACTIVE])
            leaf = next_leaf(walk, tree, table)
