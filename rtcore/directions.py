"""Vectors of lanes at length 1."""
from rtcore.jit import inline
from rtcore.lanes import bits, greatest, root, select, size, vec3


@inline
def normalized(v):
    """A vector at length 1, without overflow or underflow; the zero vector becomes z."""
    square = v.x * v.x + v.y * v.y + v.z * v.z
    over = 1 / root(square)
    ordinary = (square > 1e-280) & (square < 1e280)
    made = vec3(v.x * over, v.y * over, v.z * over)
    if bits(ordinary) != 255:       # what becomes of a lane must not hang on the others
        made = select(ordinary, made, _normalized_slowly(v))
    return made


@inline
def _normalized_slowly(v):
    """The same for any vector: seven divisions and roots in place of two, which were half the time of casting eye rays."""
    most = greatest(size(v.x), greatest(size(v.y), size(v.z)))
    x, y, z = v.x / most, v.y / most, v.z / most
    length = root(x * x + y * y + z * z)
    some = most > 0
    return vec3(select(some, x / length, 0), select(some, y / length, 0), select(some, z / length, 1))
