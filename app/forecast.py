"""How long a picture will take yet, from how fast it went so far."""
import math
from typing import NamedTuple

LEAST = 0.05        # seconds between two points that a speed is taken from
KEPT = 6            # speeds that are believed


SLOPES = -0.5, -1.0     # between which the error falls with time, to what powers of it


class Point(NamedTuple):
    """How far a picture was, in samples per pixel and estimated error, after so many seconds."""

    seconds: float
    samples: float
    error: float | None


class Forecast:
    """Follows one picture at a time. Its pace changes as it goes from the plain parts to the difficult ones, so what is left is an
    interval: at the fastest and at the slowest of the latest paces."""

    def __init__(self):
        self._points: list[Point] = []

    def note(self, seconds: float, samples: float, error: float | None = None):
        """The picture has come so far; it is another picture if that is less than before."""
        last = self._points[-1] if self._points else None
        if last is not None and (seconds < last.seconds or samples < last.samples):
            self._points, last = [], None
        if last is None or seconds - last.seconds >= LEAST:
            self._points = [*self._points[-KEPT:], Point(seconds, samples, error)]

    def left(self, samples: float, seconds: float | None = None, error: float | None = None) -> tuple[float, float] | None:
        """Seconds until there are so many samples per pixel, or so many seconds are over, or the error is so low, whichever is first: at
        the least and at the most. None as long as nothing can be said, and where no end is set."""
        paces = [(b.samples - a.samples) / (b.seconds - a.seconds) for a, b in zip(self._points, self._points[1:])]
        paces = [pace for pace in paces if pace > 0]
        if not paces:
            return None
        now = self._points[-1]
        rest = max(samples - now.samples, 0.0)
        ends = [(rest / max(paces), rest / min(paces))]
        if seconds is not None:
            ends.append((max(seconds - now.seconds, 0.0),) * 2)
        if error is not None and now.error is not None:
            factor = max(now.error / error, 1.0)
            late, early = (now.seconds * (factor ** (-1 / slope) - 1) for slope in SLOPES)
            ends.append((early, late))
        low, high = min(end[0] for end in ends), min(end[1] for end in ends)
        return (low, high) if math.isfinite(high) else None


def left_text(left: tuple[float, float] | None) -> str:
    """An interval of seconds in words: ``8 to 12 s left``, ``2 to 5 min left``."""
    if left is None:
        return ""
    unit, size = ("s", 1) if left[1] < 100 else ("min", 60) if left[1] < 6000 else ("h", 3600)
    low, high = (seconds / size for seconds in left)
    low, high = (f"{x:.1f}" if high < 3 else f"{x:.0f}" for x in (low, high))
    return f"{high} {unit} left" if low == high else f"{low} to {high} {unit} left"
