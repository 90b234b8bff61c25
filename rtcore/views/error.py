"""The estimated error of each pixel: black below what a screen shows, white from a tenth of full white on."""
import numpy as np

from rtcore.views.view import View, heat

LEAST, MOST = 2.0 ** -14, 0.1


def draw(seen):
    error = seen.error()
    share = np.log(np.maximum(error, LEAST) / LEAST) / np.log(MOST / LEAST)
    return heat(np.where(np.isfinite(error), share, 0))


ERROR = View("error", "the estimated error of each pixel, on a logarithmic scale", draw, needs_light=True, needs_hits=False,
             kernels=("adaptive",))
