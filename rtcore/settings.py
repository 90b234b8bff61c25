"""How a scene is to be rendered: what belongs to the render and not to the scene."""
from typing import Annotated

from rtcore.fields import Choice, Field, FieldError, Flag, Maybe, Number, Record
from rtcore.views import VIEWS

VIEW_NAMES = tuple(view.name for view in VIEWS)
FILTER_NAMES = ("box", "gaussian", "mitchell")
SOLVER_NAMES = ("certain", "textbook")


class Whole(Field):
    """A whole number between two limits."""

    def __init__(self, least: int, most: int, help: str):
        super().__init__(help=help)
        object.__setattr__(self, "least", least)
        object.__setattr__(self, "most", most)

    def take(self, value):
        if isinstance(value, bool) or not isinstance(value, int) or not self.least <= value <= self.most:
            raise FieldError(f"a whole number from {self.least} to {self.most}", value)
        return value


class Size(Field):
    """Width and height of a picture."""

    def take(self, value):
        try:
            w, h = value
            return Whole(1, 16384, "").take(w), Whole(1, 16384, "").take(h)
        except (TypeError, ValueError):
            raise FieldError("a width and a height from 1 to 16384", value) from None


class Region(Field):
    """A part of a picture."""

    def take(self, value):
        try:
            x0, y0, x1, y1 = (Whole(0, 16384, "").take(number) for number in value)
        except (TypeError, ValueError):
            x0, y0, x1, y1 = 0, 0, 0, 0
        if not (x0 < x1 and y0 < y1):
            raise FieldError("the left, upper, right and lower end in pixels, the latter two not included", value)
        return x0, y0, x1, y1


class Settings(Record, frozen=True, kw_only=True):
    """Settings of one render."""

    size: Annotated[tuple[int, int], Size(help="width and height in pixels")] = (640, 480)
    samples: Annotated[int, Whole(1, 1 << 20, "samples per pixel")] = 16
    adaptive: Annotated[bool, Flag(help="put them where the error is: `samples` is then the mean over the picture")] = False
    seconds: Annotated[float | None, Maybe(inner=Number(above=0), help="stop after this time")] = None
    error: Annotated[float | None, Maybe(inner=Number(above=0), help="stop at this estimated root mean square error")] = None
    region: Annotated[tuple[int, int, int, int] | None, Maybe(inner=Region(help="what gets its samples first"))] = None
    filter: Annotated[str, Choice(words=FILTER_NAMES, help="how what lies about a pixel's centre counts")] = "box"
    precision: Annotated[str, Choice(words=("f64", "f32"), help="of the geometry")] = "f64"
    solver: Annotated[str, Choice(words=SOLVER_NAMES, help="for certain or, on spheres, by the textbook's formula")] = "certain"
    threads: Annotated[int, Whole(0, 1024, "render threads; 0: one per core")] = 0
    max_depth: Annotated[int, Whole(1, 64, "longest chain of rays, the eye's included")] = 5
    shadows: Annotated[bool, Flag(help="trace shadow rays")] = True
    fog: Annotated[bool, Flag(help="let the scene's fog be seen")] = True
    reflections: Annotated[bool, Flag(help="follow reflected and refracted rays")] = True
    view: Annotated[str, Choice(words=VIEW_NAMES, help="what the picture shows")] = "beauty"
    seed: Annotated[int, Whole(0, 2**31 - 1, "start of the samples' scatter")] = 0
