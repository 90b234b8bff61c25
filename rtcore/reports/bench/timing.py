"""Runs in alternation, and what they come to: medians, ratios and their spread."""
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

Runner = Callable[[], float]        # does the work once; returns what it came to, in the row's unit


class RivalFailed(Exception):
    """A rival could not do the work; in one line, why."""


class Target(NamedTuple):
    """What a row should reach: a ratio of at least `ratio`, or a figure of our own of at most `most`."""

    ratio: float | None = None
    most: float | None = None

    def words(self, unit: str) -> str:
        """As the table tells it."""
        return f"≤ {self.most:g} {unit}" if self.ratio is None else f"≥ {self.ratio:.3g}"


class Row(NamedTuple):
    """One line of the report. A ratio above 1 means that ours is faster, or less."""

    work: str
    ours: float                     # median
    rival: float | None             # median; None where there is nothing to compare with
    rival_name: str | None
    unit: str
    ratio: float | None             # median of the rounds' ratios
    spread: float                   # of the rounds' ratios (of our figures where there is no rival): quartile to quartile, over the median
    target: Target | None
    met: bool | None                # None: no target, or too quick a run to tell
    ours_runs: list[float]
    rival_runs: list[float]


def alternate(runners: Mapping[str, Runner], rounds: int, fails: Callable[[str, str], None]) -> dict[str, list[float]]:
    """Every runner in turn, `rounds` times, after one turn that does not count: it fills caches, and compiles what is missing.

    A runner that raises RivalFailed is left out from then on, and `fails` told its name and why.
    """
    left, found = dict(runners), {name: [] for name in runners}
    for turn in range(rounds + 1):
        for name, run in list(left.items()):
            try:
                figure = run()
            except RivalFailed as error:
                fails(name, str(error))
                del left[name], found[name]
                continue
            if turn:
                found[name].append(figure)
    return found


def row(work: str, unit: str, ours: list[float], rival: list[float] | None = None, rival_name: str | None = None,
        target: Target | None = None, judged: bool = True) -> Row:
    """A row of the figures of all rounds; of figures "per second" the greater is better, of all others the smaller."""
    if rival is None:
        ratio, each = None, np.array(ours)
    else:
        each = np.array(ours) / rival if unit.endswith("/s") else np.array(rival) / ours
        ratio = float(np.median(each))
    low, middle, high = np.percentile(each, (25, 50, 75))
    met = None
    if target is not None and judged:
        met = ratio >= target.ratio if target.ratio is not None and ratio is not None else None
        met = float(np.median(ours)) <= target.most if target.most is not None else met
    return Row(work, float(np.median(ours)), None if rival is None else float(np.median(rival)), rival_name, unit, ratio,
               float((high - low) / middle), target, met, list(ours), list(rival or ()))


def seconds_of(work: Callable[[], object]) -> float:
    """How long one call takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start
