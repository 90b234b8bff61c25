"""Lights: one file each, with the authoring record and, unless it is everywhere, the kernel for its shadow rays. Listed once, here."""
from rtcore.lights import directional, point, rectangle, sphere
from rtcore.lights._sampled import Draw as Draw
from rtcore.lights._shine import UNNOTED as UNNOTED, UNTOLD as UNTOLD, Reach as Reach
from rtcore.lights.ambient import Ambient
from rtcore.lights.directional import Directional
from rtcore.lights.point import Point
from rtcore.lights.rectangle import RectangleLight
from rtcore.lights.sphere import SphereLight

LIGHTS = (Point, Directional, Ambient, SphereLight, RectangleLight)

#: The kernel of each light that casts shadows.
SHINE = {Point: point.shine, Directional: directional.shine, SphereLight: sphere.shine, RectangleLight: rectangle.shine}

#: Those with an extent, of which a sample sees one place: their kernels take a `Draw` as well.
SAMPLED = (SphereLight, RectangleLight)

#: What lights a scene that names no lights: a key light from above and the left of someone who looks along z, and a soft fill.
STUDIO = (Directional(direction=(-0.5, -1.0, 0.7), intensity=0.9, name="key"), Ambient(intensity=0.25, name="fill"))
