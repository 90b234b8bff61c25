"""The picture itself."""
from rtcore.views.view import View

BEAUTY = View("beauty", "the picture", lambda seen: seen.pixels, needs_light=True, needs_hits=False)
