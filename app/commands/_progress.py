"""How far a piece of work is, on stderr: a bar with the time left on a terminal, elsewhere a plain line now and then."""
import sys
import time

EVERY = 15.0        # seconds between two plain lines


class Progress:
    """A context in which `show` is called as the work goes on; nothing is left on a terminal when it ends."""

    def __init__(self, title: str):
        self._title = title
        self._start = self._spoke = time.monotonic()
        self._bar = self._task = None

    def __enter__(self) -> "Progress":
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn
            self._bar = Progress(TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.percentage:3.0f} %"),
                                 TextColumn("{task.fields[left]}", markup=False), console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task(self._title, total=1.0, left="")
            self._bar.start()
        return self

    def __exit__(self, *_) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, share: float, doing: str = "", left: float | None = None) -> None:
        """`share` (0 .. 1) of the work is done, `left` seconds are left: reckoned from the share, unless they are known."""
        now = time.monotonic()
        if left is None and share > 0:
            left = (now - self._start) * (1 - share) / share
        title = f"{self._title}: {doing}" if doing else self._title
        words = "" if left is None else f"{time_in_words(left)} left"
        if self._bar is not None:
            self._bar.update(self._task, completed=share, description=title, left=words)
        elif now - self._spoke >= EVERY:
            self._spoke = now
            print(", ".join(filter(None, (title, f"{100 * share:.0f} %", words))), file=sys.stderr, flush=True)


def time_in_words(seconds: float) -> str:
    """``8 s``, ``3 min 20 s``, ``2 h 05 min``."""
    seconds = max(round(seconds), 0)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60:02} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60:02} min"
