"""The stability report as a page to read: the verdict, the worst rays, the tables."""
import math
from collections.abc import Iterable
from itertools import groupby

from rtcore.reports.rows import Row

MOST_EXAMPLES = 24
ABOUT = """\
## How it was measured

- The truth is mpmath's, at 50 digits, on the very numbers the kernel receives: rays and the shape's numbers rounded to the precision, the
  node's matrix in float64. The oracle's formulas are the textbook's and share no code with the kernels.
- Every ray asks for the first crossing past 0. *Wrong* counts hits reported as misses, misses reported as hits, and hits of another
  crossing than the first (one that is nearer to the answer, where the root's condition does not explain it); a tangent is a hit.
  Errors are in units in the last place (ulp) of the true t, over the rays that both call a hit. *Not finite* counts rays with a root or a
  normal that is NaN or infinite. *ns* is the least of several runs of the kernel alone, per ray, on one core.
- *renderer* is what pictures are made with, the tree included; the other solvers get the ray in the shape's own space, taken there in
  the precision itself, as the lecture does, and write every root they find.
- "k cond u" allows k times the root's condition number times u = 2⁻⁵³ (2⁻²⁴ in float32). The condition is the sum of |x ∂t/∂x| / |t| over
  all numbers x of the ray and the shape. It is infinite at a tangent.
- *edges* aims at edges and vertices, or off them by down to one rounding. There, in *grazing* and on the *surface*, a wrong answer of a
  triangle is counted, but is no missed target; a ray lost between two of them (*shared edges*) is.
- The families without errors need no oracle: *any-hit* compares `occluded` with `intersect`, *leaving* sends rays from hit points as the
  shading does, *gap* puts a plane 64 ulp above the surface, *shared edges* aims at the edges of closed meshes.
"""


#: The plots that `rayscope stability` draws beside the page, of each shape: as named in `stability-SHAPE-PLOT.png`.
PLOTS = ("work-precision", "distance", "scale")


def page(rows: list[Row], misses: list[str], note: str = "") -> str:
    """The page as Markdown. rows: in the order of the tables; misses: a line for each target that is missed."""
    judged = [row for row in rows if row.met is not None]
    parts = ["# Numerical stability\n", _verdict(judged, misses), note and note + "\n", _examples(judged), _solvers(rows)]
    for shape, group in groupby(rows, key=lambda row: row.shape):
        links = " ".join(f"![{shape}: {plot}](stability-{shape}-{plot}.png)" for plot in PLOTS)
        parts.append(f"## {shape.capitalize()}\n\n{links}\n\n" + _table(list(group)))
    return "\n".join(filter(None, (*parts, ABOUT)))


def _verdict(judged: list[Row], misses: list[str]) -> str:
    rays = sum(row.rays for row in judged)
    if not misses:
        return f"**Every target is met**: {len(judged)} of {len(judged)}, over {rays:,} rays.\n"
    lines = "".join(f"- {line}\n" for line in misses)
    return f"**{len(judged) - len(misses)} of {len(judged)} targets are met**, over {rays:,} rays. Missed:\n\n{lines}"


def _examples(judged: list[Row]) -> str:
    """The worst rays of the default solvers, missed targets first."""
    worst = [(row, row.worst[0]) for row in judged if row.worst]
    worst.sort(key=lambda pair: pair[1][:2], reverse=True)
    text = ["## The worst rays\n", "Of the solver that pictures are made with; the missed targets first. To try one:\n",
            "```python\nfrom rtcore import *\nfrom rtcore.reports.meshes import MESHES\n```\n"]
    for row, case in worst[:MOST_EXAMPLES]:
        text.append(f"**{row.shape}, {row.precision}, {row.family}**: {case.what}\n\n```python\n{case.code}\n```\n")
    return "\n".join(text)


def _solvers(rows: list[Row]) -> str:
    """One line a solver: all families together."""
    lines = ["## Solvers\n", "| shape | precision | solver | rays | wrong | median p50 | worst p99 | max ulp | not finite | ns |",
             "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"]
    for (shape, precision, solver), group in groupby(rows, key=lambda row: (row.shape, row.precision, row.solver)):
        found = list(group)
        medians = sorted(row.p50 for row in found if not math.isnan(row.p50))
        cells = (sum(row.rays for row in found), sum(row.wrong for row in found), medians[len(medians) // 2] if medians else math.nan,
                 _most(row.p99 for row in found), _most(row.max_ulp for row in found), sum(row.nonfinite for row in found),
                 _least(row.ns_per_ray for row in found))
        lines.append(f"| {shape} | {precision} | {solver} | " + " | ".join(map(_cell, cells)) + " |")
    return "\n".join(lines) + "\n"


def _table(rows: list[Row]) -> str:
    lines = ["| precision | solver | family | rays | wrong | p50 | p99 | max ulp | not finite | ns | target | met |",
             "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- | --- |"]
    for row in rows:
        cells = map(_cell, (row.rays, row.wrong, row.p50, row.p99, row.max_ulp, row.nonfinite, row.ns_per_ray))
        met = "" if row.met is None else "yes" if row.met else "**no**"
        lines.append(f"| {row.precision} | {row.solver} | {row.family} | " + " | ".join(cells) + f" | {row.target} | {met} |")
    return "\n".join(lines) + "\n"


def _cell(value: float) -> str:
    if isinstance(value, int):
        return f"{value:,}"
    return "" if math.isnan(value) else f"{value:.3g}"


def _most(values: Iterable[float]) -> float:
    return max((value for value in values if not math.isnan(value)), default=math.nan)


def _least(values: Iterable[float]) -> float:
    return min((value for value in values if not math.isnan(value)), default=math.nan)
