"""Distance from the eye as brightness: what is nearest is white, what is farthest nearly black, nothing is black."""
import numpy as np

from rtcore.views.view import View


def draw(seen):
    hit = seen.node >= 0
    out = np.zeros((*seen.node.shape, 3), np.float32)
    if hit.any():
        # even in the logarithm, and blind to the farthest hundredth, so that a plane to the horizon does not flatten the rest
        d = np.log(np.maximum(seen.distance[hit], np.finfo(np.float32).tiny))
        near, far = d.min(), np.quantile(d, 0.99)
        out[hit] = (1 - 0.95 * np.clip((d - near) / max(far - near, 1e-6), 0, 1))[:, None] ** np.float32(2.2)
    return out


DEPTH = View("depth", "the distance from the eye", draw)
