"""What the window asks of the renderer besides scene and camera: the toolbar's switches and the Render panel's numbers."""
from typing import Annotated

import msgspec

from rtcore.fields import Choice, FieldError, Flag, Maybe, Number, Numbers, Record
from rtcore.settings import FILTER_NAMES, SOLVER_NAMES, VIEW_NAMES

MOST_SAMPLES = 1 << 20      # what the renderer is asked for where no end is set


class Options(Record, frozen=True, kw_only=True):
    """Settings of the picture, not of the scene: they are not undone and not saved with it."""

    shadows: Annotated[bool, Flag(help="let things stand in one another's light")] = True
    fog: Annotated[bool, Flag(help="show the scene's fog")] = True
    reflections: Annotated[bool, Flag(help="follow mirrored and refracted light")] = True
    view: Annotated[str, Choice(words=VIEW_NAMES, help="what is shown of the picture; a switch traces nothing")] = "beauty"
    exposure: Annotated[float, Number(least=-10, most=10, help="how bright it is shown; one stop doubles it. PNG files are as shown, EXR "
                                      "files keep the light as it is", unit="stops")] = 0.0
    region: Annotated[tuple[float, float, float, float] | None, Maybe(inner=Numbers(count=4), help="what is refined first: left, top, "
                      "right and bottom in 0 to 1 of the picture")] = None
    adaptive: Annotated[bool, Flag(help="put the samples where the error is: the number of samples is then their mean")] = True
    samples: Annotated[int | None, Maybe(inner=Number(least=1, most=MOST_SAMPLES), help="stop after so many rays through each pixel")] = 16
    seconds: Annotated[float | None, Maybe(inner=Number(above=0), help="stop after so many seconds of tracing")] = None
    error: Annotated[float | None, Maybe(inner=Number(above=0), help="stop once the estimated error is so low (white is 1)")] = None
    filter: Annotated[str, Choice(words=FILTER_NAMES, help="how what lies about a pixel's centre counts: mitchell is sharpest")] = "box"
    scale: Annotated[float, Number(least=0.1, most=2, help="resolution of the picture against that of the screen")] = 1.0
    max_depth: Annotated[int, Number(least=1, most=64, help="longest chain of rays, the eye's included")] = 5
    threads: Annotated[int, Number(least=0, most=256, help="threads that trace; 0 takes every core")] = 0
    precision: Annotated[str, Choice(words=("f64", "f32"), help="float type of the shapes' arithmetic")] = "f64"
    solver: Annotated[str, Choice(words=SOLVER_NAMES, help="how hits are found: for certain, or on spheres by the textbook's b² − 4ac, "
                                  "which fails far away")] = "certain"
    seed: Annotated[int, Number(least=0, most=2**31 - 1, help="start of the random sequence; the same seed gives the same picture")] = 0

    def check(self):
        for name in ("samples", "max_depth", "threads", "seed"):
            value = getattr(self, name)
            if value is not None and value != int(value):
                raise FieldError("a whole number", value, name)
        if self.region is not None:
            left, top, right, bottom = self.region
            if not (0 <= left < right <= 1 and 0 <= top < bottom <= 1):
                raise FieldError("a rectangle within 0 to 1", self.region, "region")

    def gain(self) -> float:
        """What the light is multiplied by to be shown. False colours are no light and stay as they are."""
        return 2.0 ** self.exposure if self.view == "beauty" else 1.0

    def looks_like(self, other: "Options") -> bool:
        """Whether both come to the same picture, at most shown brighter or darker, or traced in another order."""
        return msgspec.structs.replace(self, exposure=other.exposure, region=other.region) == other

    def settings(self) -> dict:
        """The keyword arguments of `rtcore.progressive.Settings`, but for the size."""
        return {"shadows": self.shadows, "fog": self.fog, "reflections": self.reflections, "view": self.view,
                "adaptive": self.adaptive, "samples": int(self.samples or MOST_SAMPLES), "seconds": self.seconds, "error": self.error,
                "filter": self.filter, "max_depth": int(self.max_depth), "threads": int(self.threads), "precision": self.precision,
                "solver": self.solver, "seed": int(self.seed)}
