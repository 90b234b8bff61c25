"""What the window asks of the renderer besides scene and camera: the toolbar's switches and the Render panel's numbers."""
from typing import Annotated

from rtcore.fields import Choice, FieldError, Flag, Maybe, Number, Record
from rtcore.settings import VIEW_NAMES


class Options(Record, frozen=True, kw_only=True):
    """Settings of the picture, not of the scene: they are not undone and not saved with it."""

    shadows: Annotated[bool, Flag(help="let things stand in one another's light")] = True
    fog: Annotated[bool, Flag(help="show the scene's fog")] = True
    reflections: Annotated[bool, Flag(help="follow mirrored and refracted light")] = True
    view: Annotated[str, Choice(words=VIEW_NAMES, help="what is shown of the picture; a switch traces nothing")] = "beauty"
    adaptive: Annotated[bool, Flag(help="put the samples where the error is: the number of samples is then their mean")] = True
    samples: Annotated[int, Number(least=1, most=65536, help="rays through each pixel once the picture is finished")] = 16
    seconds: Annotated[float | None, Maybe(inner=Number(above=0), help="stop after so many seconds, though samples are missing")] = None
    error: Annotated[float | None, Maybe(inner=Number(above=0), help="stop once the estimated error is so low (white is 1)")] = None
    scale: Annotated[float, Number(least=0.1, most=2, help="resolution of the picture against that of the screen")] = 1.0
    max_depth: Annotated[int, Number(least=1, most=64, help="longest chain of rays, the eye's included")] = 5
    threads: Annotated[int, Number(least=0, most=256, help="threads that trace; 0 takes every core")] = 0
    precision: Annotated[str, Choice(words=("f64", "f32"), help="float type of the shapes' arithmetic")] = "f64"
    seed: Annotated[int, Number(least=0, most=2**31 - 1, help="start of the random sequence; the same seed gives the same picture")] = 0

    def check(self):
        for name in ("samples", "max_depth", "threads", "seed"):
            value = getattr(self, name)
            if value != int(value):
                raise FieldError("a whole number", value, name)

    def settings(self) -> dict:
        """The keyword arguments of `rtcore.progressive.Settings`, but for the size."""
        return {"shadows": self.shadows, "fog": self.fog, "reflections": self.reflections, "view": self.view,
                "adaptive": self.adaptive, "samples": int(self.samples), "seconds": self.seconds, "error": self.error,
                "max_depth": int(self.max_depth), "threads": int(self.threads), "precision": self.precision, "seed": int(self.seed)}
