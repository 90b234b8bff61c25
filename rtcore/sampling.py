"""Where samples lie: keyed on (pixel, sample, dimension, seed), so the picture is the same for any order, tile and thread count.

Each pixel has REPLICATES sequences that know nothing of one another: sample s is point s // REPLICATES of sequence s % REPLICATES. Each is
the Sobol (0, 2)-sequence under nested uniform (Owen) scrambling, done by a hash as in Burley, "Practical Hash-based Owen Scrambling"
(JCGT 9(4), 2020): the first 2^k points of a sequence have one point in every box of area 2^-k with sides of powers of two. What the mean
of one sequence differs from that of another by tells the error of their mean; how the samples of one sequence scatter would tell too much.

Dimensions come in pairs. Pair 0 is where in the pixel the sample lies; its sample 0 is the pixel's centre: of all scramblings of the first
sequence those are taken that bring its first point there, so it is one of the stratified points and counts as any other. `centered` does
the same for other pairs: so a picture of one sample is free of noise, its shadows those of the lights' middles.
"""
import numpy as np

from rtcore.jit import inline

LENS, LIGHTS = 1, 2     # pairs of dimensions: the place on the lens; the first one for places on lights
GLOSS = 1 << 30         # the first one for the facets of rough surfaces, as many as there are ways that a ray can have come
REPLICATES = 2      # more would tell the error better and make it larger: edges converge as R^(1/4) N^(-3/4)


@inline
def hash32(x):
    """A well mixed 32-bit hash of an integer (the finaliser of MurmurHash3)."""
    x = np.uint32(x)
    x = np.uint32((x ^ (x >> np.uint32(16))) * np.uint32(0x85EBCA6B))
    x = np.uint32((x ^ (x >> np.uint32(13))) * np.uint32(0xC2B2AE35))
    return np.uint32(x ^ (x >> np.uint32(16)))


@inline
def mirrored(x):
    """The 32 bits of x in reverse order."""
    x = np.uint32(((x >> np.uint32(1)) & np.uint32(0x55555555)) | ((x & np.uint32(0x55555555)) << np.uint32(1)))
    x = np.uint32(((x >> np.uint32(2)) & np.uint32(0x33333333)) | ((x & np.uint32(0x33333333)) << np.uint32(2)))
    x = np.uint32(((x >> np.uint32(4)) & np.uint32(0x0F0F0F0F)) | ((x & np.uint32(0x0F0F0F0F)) << np.uint32(4)))
    x = np.uint32(((x >> np.uint32(8)) & np.uint32(0x00FF00FF)) | ((x & np.uint32(0x00FF00FF)) << np.uint32(8)))
    return np.uint32((x >> np.uint32(16)) | (x << np.uint32(16)))


@inline
def pascal(x):
    """Pascal's triangle modulo 2 times the bits of x: the second Sobol dimension, its digits from the lowest bit up. The triangle is a
    fivefold Kronecker power, so five steps do."""
    x = np.uint32(x ^ ((x >> np.uint32(1)) & np.uint32(0x55555555)))
    x = np.uint32(x ^ ((x >> np.uint32(2)) & np.uint32(0x33333333)))
    x = np.uint32(x ^ ((x >> np.uint32(4)) & np.uint32(0x0F0F0F0F)))
    x = np.uint32(x ^ ((x >> np.uint32(8)) & np.uint32(0x00FF00FF)))
    return np.uint32(x ^ (x >> np.uint32(16)))


@inline
def scrambled(x, key):
    """Nested uniform scrambling of the digits of x, the first in the lowest bit: whether a digit flips depends on the key and the digits
    before it. The hash of Laine and Karras with Vegdahl's constants: every step lets a bit influence only itself and higher ones."""
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x3D20ADEA)))
    x = np.uint32(np.uint32(x + key) * ((key >> np.uint32(16)) | np.uint32(1)))
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x05526C56)))
    return np.uint32(x ^ np.uint32(x * np.uint32(0x53A22864)))


@inline
def keys(pixel, sample, dimension, seed):
    """Two keys of a pixel's sequence for a pair of dimensions."""
    key = hash32(hash32(dimension * REPLICATES + sample % REPLICATES) ^ np.uint32(seed))
    key = hash32(hash32(key + np.uint32(0x9E3779B9)) ^ np.uint32(pixel))
    return key, hash32(key ^ np.uint32(0x68E31DA4))


@inline
def _digits(number, across, down):
    """Point `number` of a sequence for a pair of dimensions, as `square` orders it: two numbers' digits, the first in the lowest bit."""
    index = mirrored(scrambled(mirrored(np.uint32(number)), hash32(across ^ np.uint32(0x2545F491))))
    return scrambled(index, across), scrambled(pascal(index), down)


@inline
def square(pixel, sample, dimension, seed):
    """Two numbers in 0 .. 1, 1 not included, of a sample: for the pair of dimensions 1, 2 ... of what is sampled beside the pixel. Pairs
    are independent: each goes through the sequence in an order of its own, which keeps the first 2^k points together."""
    across, down = keys(pixel, sample, dimension, seed)
    x, y = _digits(sample // REPLICATES, across, down)
    return mirrored(x) * 2.0 ** -32, mirrored(y) * 2.0 ** -32


@inline
def centered(pixel, sample, dimension, seed):
    """`square`, scrambled so that sample 0 lies in the middle."""
    if sample == 0:
        return 0.5, 0.5
    across, down = keys(pixel, sample, dimension, seed)
    x, y = _digits(sample // REPLICATES, across, down)
    if sample % REPLICATES == 0:    # flip the digits so that point 0 comes to 0.1000...: this is a nested scrambling too
        a, b = _digits(0, across, down)
        x, y = np.uint32(x ^ a ^ np.uint32(1)), np.uint32(y ^ b ^ np.uint32(1))
    return mirrored(x) * 2.0 ** -32, mirrored(y) * 2.0 ** -32


@inline
def disk(u, v):
    """A point of the unit disk for one of the unit square, areas and neighbourhoods kept, the middle for the middle (Shirley and Chiu, "A
    Low Distortion Map Between Disk and Square", Journal of Graphics Tools 2(3), 1997)."""
    a, b = 2 * u - 1, 2 * v - 1
    if a == 0 and b == 0:
        return 0.0, 0.0
    if abs(a) > abs(b):
        return a * np.cos(np.pi / 4 * (b / a)), a * np.sin(np.pi / 4 * (b / a))
    return b * np.sin(np.pi / 4 * (a / b)), b * np.cos(np.pi / 4 * (a / b))


@inline
def jitter(pixel, sample, seed):
    """Offset (x, y) in 0 .. 1 of a sample in its pixel. Sample 0 is the pixel's centre."""
    if sample == 0:
        return 0.5, 0.5
    across, down = keys(pixel, sample, 0, seed)
    index = np.uint32(sample // REPLICATES)
    x, y = scrambled(index, across), scrambled(pascal(index), down)
    if sample % REPLICATES == 0:    # flip the digits so that point 0 comes to 0.1000...: this is a nested scrambling too
        x, y = x ^ scrambled(np.uint32(0), across) ^ np.uint32(1), y ^ scrambled(np.uint32(0), down) ^ np.uint32(1)
    return mirrored(np.uint32(x)) * 2.0 ** -32, mirrored(np.uint32(y)) * 2.0 ** -32
