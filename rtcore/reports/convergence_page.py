"""The words and figures of `convergence.md`: MSE x time per method, how fast the error falls, and whether the estimate can be believed."""
import math

import numpy as np

AT = 64     # uniform samples: the error to which methods are timed

EXPLAINED = (
    """MSE x time: the median over the later half of the passes; at a slope of -0.5 it would not change with time, and it falls where
    the samples are stratified. Slope: the power of time with which rmse falls, about -0.75 for edges. Estimate / rmse: the geometric
    mean over all passes, 1 for an estimate that neither flatters nor frightens; the worst factor either way beside it.""", "",
    """The estimate compares independent halves of each pixel's samples. It can't see what no sample has met, nor what all have in
    common.""")


def fitted_slope(seconds, errors) -> float | None:
    """The power of time with which the error falls: least squares through the logarithms. None for less than three points."""
    seconds, errors = np.asarray(seconds, float), np.asarray(errors, float)
    good = (seconds > 0) & (errors > 0)
    if good.sum() < 3 or np.ptp(np.log(seconds[good])) == 0:
        return None
    return float(np.polyfit(np.log(seconds[good]), np.log(errors[good]), 1)[0])


def seconds_to(seconds, errors, target: float) -> float | None:
    """When the error first was `target`, between two passes by the straight line of their logarithms; None if it never was."""
    for i, error in enumerate(errors):
        if error <= target:
            if i == 0 or error <= 0:
                return float(seconds[i])
            share = math.log(errors[i - 1] / target) / math.log(errors[i - 1] / error)
            return float(seconds[i - 1] * (seconds[i] / seconds[i - 1]) ** share)
    return None


def calibration(rows) -> tuple[float, float]:
    """Mean of estimate over error (geometric), and the worst factor between them, of rows whose error is not 0."""
    factors = [math.log(row.estimate / row.rmse) for row in rows if row.rmse > 0 and row.estimate > 0]
    if not factors:
        return math.nan, math.nan
    return math.exp(float(np.mean(factors))), math.exp(max(map(abs, factors)))


def page(rows, reference, title: str, note: str = "") -> str:
    """The report in Markdown. rows: `convergence.Row`s; reference: the `convergence.Reference`."""
    lines = [f"# Convergence: {title}", ""]
    if note:
        lines += [note, ""]
    height, width = reference.pixels.shape[:2]
    lines += [f"{width} x {height} pixels. The reference has {reference.samples} samples per pixel in several renders with seeds of their "
              f"own; its estimated error, {reference.error:.2g}, is taken out of every rmse, and rows end where they are as good. Errors "
              "are root mean squares over pixels and channels, in linear light.", ""]
    by_run: dict[tuple[str, int], list] = {}
    for row in rows:
        by_run.setdefault((row.method, row.run), []).append(row)
    methods = list(dict.fromkeys(row.method for row in rows))
    goal = _goal(rows)
    target = goal.rmse if goal else None
    lines += ["| method | runs | samples | seconds | rmse | MSE x time | slope | estimate / rmse | worst factor "
              + (f"| seconds to rmse {target:.3g} |" if target else "|"), "|" + " --- |" * (10 if target else 9)]
    for name in methods:
        runs = [found for (method, _), found in by_run.items() if method == name]
        last = [found[-1] for found in runs]
        slopes = [slope for found in runs if (slope := fitted_slope([r.seconds for r in found], [r.rmse for r in found])) is not None]
        mean, worst = calibration([row for found in runs for row in found])
        cost = [row.rmse ** 2 * row.seconds for found in runs for row in found[len(found) // 2:]]
        means = (f"{np.mean([getattr(row, field) for row in last]):.4g}" for field in ("samples", "seconds", "rmse"))
        cells = [name, str(len(runs)), *means, f"{np.median(cost):.3g}", f"{np.mean(slopes):.2f}" if slopes else "", _number(mean),
                 _number(worst)]
        if target:
            times = [seconds_to([r.seconds for r in found], [r.rmse for r in found], target) for found in runs]
            cells.append(f"{np.mean(times):.3g}" if times and None not in times else "not reached")
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", *(" ".join(part.split()) for part in EXPLAINED)]
    if target:
        lines += ["", f"rmse {target:.3g} is that of {goal.samples:g} uniform samples."]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.2f}"


def _goal(rows):
    """The pass of at most AT uniform samples that has the most; None if there is none with an error."""
    found = [row for row in rows if row.method == "uniform" and row.samples <= AT and row.rmse > 0]
    return max(found, key=lambda row: row.samples, default=None)
