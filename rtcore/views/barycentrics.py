"""Where on its triangle a hit lies: the weights of the corners as red, green and blue. Other shapes show their texture coordinates, u red
and v green, from 0 to 1 and again; what has none, and nothing, is black."""
from rtcore.views.view import View


def draw(seen):
    shown = seen.coordinates()
    return shown * shown        # about even to the eye


BARYCENTRICS = View("barycentrics", "the weights of a triangle's corners as red, green and blue; of other shapes u and v as red and green",
                    draw, kernels=("recast",))
