"""The picture itself."""
from rtcore.views.view import View

BEAUTY = View("beauty", "the picture", lambda pixels, node, distance, normal, doubt: pixels, needs_light=True)
