"""Ambient light: authoring record."""
from rtcore.scene import Light


class Ambient(Light, frozen=True, kw_only=True):
    """Light from everywhere, the same everywhere; it casts no shadows. All ambient lights of a scene are summed."""
