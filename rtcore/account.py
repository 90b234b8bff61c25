"""What a render costs, and what it is spared: the plan's stages and kernels with their measured shares, the reasons for what was left
out, the bytes held, and all of it in sentences.
"""
from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from rtcore.jit import KERNELS
from rtcore.plan import Plan
from rtcore.shapes import KIND_MODULES

#: Kinds as one speaks of several of them.
PLURALS = {"box": "boxes", "cone": "cones and cylinders", "torus": "tori", "polyhedron": "polyhedra", "open-polyhedron": "open polyhedra",
           "open-quadric": "open quadrics", "implicit": "formulas"}
#: Lights as an adjective.
LIGHT_WORDS = {"spherelight": "spherical", "rectanglelight": "rectangular"}
#: Stages as the end of "it spends a tenth of its time on ...".
WORDS = {"primary rays": "casting the eye's rays", "depth of field": "the lens", "pixel filter": "placing samples by the filter",
         "surface at the hits": "points and normals where they hit",
         "reflected and refracted rays": "sending reflected and refracted rays on",
         "ray sorting": "sorting rays that scatter", "glossy reflection": "scattering them at rough surfaces",
         "film": "adding up the samples"}
TOLD = 3        # stages that a sentence names


class Kept(NamedTuple):
    """A stage of the plan, its share of the time of tracing, 0 to 1, and the stages within which it is done if its time can't be told."""

    stage: str
    share: float
    within: str = ""


class Account(NamedTuple):
    """What a picture costs. Shares add up to 1 once anything was traced."""

    kept: tuple[Kept, ...]
    left_out: tuple[tuple[str, str], ...]       # stage, why
    kernels: tuple[tuple[str, float], ...]      # kernel group such as "sphere.f64", share
    held: tuple[tuple[str, int], ...]           # what, bytes

    @property
    def bytes(self) -> int:
        """Bytes held in all."""
        return sum(size for _, size in self.held)


def account(plan: Plan, seconds: Mapping[tuple[str, str], float], held: Mapping[str, int]) -> Account:
    """The account of a render: its plan, the seconds and the bytes of its frames (`progressive.Frame`)."""
    total = sum(seconds.values()) or 1.0
    stages, groups = Counter(), Counter()
    for (stage, group), taken in seconds.items():
        stages[stage] += taken / total
        groups[group] += taken / total
    kept = tuple(Kept(stage, stages[stage], _within(stage)) for stage in plan.stages)
    return Account(kept, plan.left_out, tuple((name, groups[name.partition(".")[0]]) for name in plan.kernels), tuple(held.items()))


def _within(stage: str) -> str:
    if stage.startswith("tree: "):
        return stage.replace("tree", "hits")
    return {"smooth normals": "surface at the hits", "patterns": "ambient and other light", "further samples": "all stages",
            "textbook formulas": "hits: sphere"}.get(stage, "")


def plural(kind: str) -> str:
    """A kind's name for several of them."""
    return PLURALS.get(kind, f"{kind}s")


def sentences(account: Account) -> list[str]:
    """The account as one would say it."""
    result = []
    costly = sorted((kept for kept in account.kept if kept.share > 0), key=lambda kept: -kept.share)[:TOLD]
    if costly:
        first, *more = [(f"{100 * kept.share:.0f} %", _words(kept.stage)) for kept in costly]
        shares = _series([f"{first[0]} of its time on {first[1]}", *(f"{share} on {words}" for share, words in more)])
        result.append(f"This picture spends {shares}.")
    present = [kept.stage.removeprefix("hits: ") for kept in account.kept if kept.stage.startswith("hits: ")]
    absent = len(KIND_MODULES) - len(present)
    shapes = _series([plural(kind) for kind in present]) if present else "no shapes"
    result.append(f"It shows {shapes} and needs no kernel of the {absent} {'other ' if present else ''}kinds of shapes.")
    reasons = dict(account.left_out)
    bare = [f"{plural(kind)} ({reasons[f'tree: {kind}']})" for kind in present if f"tree: {kind}" in reasons]
    if bare:
        result.append(f"No tree is built for {_series(bare)}.")
    for stage, why in account.left_out:
        if not stage.startswith(("hits: ", "tree: ")):
            plural_stage = stage.endswith(("s", "light"))
            result.append(f"{stage.capitalize()} {'are' if plural_stage else 'is'} left out: {why}.")
    return result


def _words(stage: str) -> str:
    sort, _, name = stage.partition(": ")
    if sort == "hits":
        return f"finding where rays meet {plural(name)}"
    return f"{LIGHT_WORDS.get(name, name)} light" if sort == "light" else WORDS.get(stage, stage)


def _series(words: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def loaded_kernels() -> dict[str, str]:
    """Kernels that are in this process now, such as "shapes.sphere.intersect_spheres", and how they came: "loaded" from the cache or
    "compiled" here."""
    found = {}
    for made in tuple(KERNELS):     # another thread may import more of them meanwhile
        module = made.py_func.__module__
        if made.overloads and module.startswith("rtcore."):
            found[f"{module.removeprefix('rtcore.')}.{made.py_func.__name__}"] = \
                "compiled" if sum(made.stats.cache_misses.values()) else "loaded"
    return found
