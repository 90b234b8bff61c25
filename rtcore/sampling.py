"""Where in a pixel a sample lies: keyed on (pixel, sample), so the picture is the same for any order, tile and thread count."""
import numpy as np

from rtcore.jit import inline

# The plastic number's powers: the R2 sequence (Roberts 2018) spreads any number of points evenly over the square.
R2_X, R2_Y = 0.7548776662466927, 0.5698402909980532


@inline
def hash32(x):
    """A well mixed 32-bit hash of an integer (the finaliser of MurmurHash3)."""
    x = np.uint32(x)
    x = np.uint32((x ^ (x >> np.uint32(16))) * np.uint32(0x85EBCA6B))
    x = np.uint32((x ^ (x >> np.uint32(13))) * np.uint32(0xC2B2AE35))
    return np.uint32(x ^ (x >> np.uint32(16)))


@inline
def jitter(pixel, sample, seed):
    """Offset (x, y) in 0 .. 1 of a sample in its pixel. Sample 0 is the pixel's centre; the others follow R2 from a start
    of the pixel's own."""
    if sample == 0:
        return 0.5, 0.5
    key = hash32(pixel * 2 + 1) ^ hash32(seed + 0x9E37)
    u = hash32(key) * 2.0 ** -32 + sample * R2_X
    v = hash32(key + 0x68E3) * 2.0 ** -32 + sample * R2_Y
    return u - np.floor(u), v - np.floor(v)
