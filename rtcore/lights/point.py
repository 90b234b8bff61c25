"""Point light: authoring record."""
from typing import Annotated

from rtcore.fields import Choice, Vec, Vector
from rtcore.scene import Light


class Point(Light, frozen=True, kw_only=True):
    """Light from one point. With `falloff="inverse-square"` a surface at distance d gets color·intensity/d²; with
    `"constant"`, the classroom's, the same at every distance."""

    position: Annotated[Vec, Vector(help="where it is", unit="scene units")]
    falloff: Annotated[str, Choice(words=("inverse-square", "constant"), help="how the light weakens with distance")] = "inverse-square"
