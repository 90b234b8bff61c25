"""Lights: one file each. Listed once, here."""
from rtcore.lights.ambient import Ambient
from rtcore.lights.directional import Directional
from rtcore.lights.point import Point

LIGHTS = (Point, Directional, Ambient)

#: What lights a scene that names no lights: a key light from the left and above behind the eye's usual place, and a soft fill.
STUDIO = (Directional(direction=(-0.5, -1.0, 0.7), intensity=0.9, name="key"), Ambient(intensity=0.25, name="fill"))
