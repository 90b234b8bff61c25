"""Which stages a scene under its settings needs, which are left out, and why. The tracer runs exactly what the plan says."""
from collections import Counter
from typing import NamedTuple

import numpy as np

from rtcore.camera import Camera
from rtcore.lights import SHINE, STUDIO, Ambient
from rtcore.latest import Each, Latest, leaves_of
from rtcore.leaves import Leaf
from rtcore.scene import Light, Material, Scene
from rtcore.settings import Settings
from rtcore.shapes import KIND_MODULES
from rtcore.shapes.kind import Kind
from rtcore.sorting import WORTH
from rtcore.views import VIEWS

VIEW = {view.name: view for view in VIEWS}
NO_LIGHT = "the view shows first hits only"
FIRST_SAMPLE = "a pixel's first sample goes through the middle of the lens"
CENTRE = "a pixel's first sample is its centre"
NO_BOUNCES = "no reflected or refracted rays are followed"
FEW_SHAPES = f"there are fewer than {WORTH} of each shape, or so many that rays that scatter are walked singly"
SMOOTH = "no visible material is rough and reflects or transmits"
GLOW = "background and ambient light"


class Plan(NamedTuple):
    """Stages in the order they run, what was left out as (stage, why), and the kernels needed, named as `rtcore.warm` names them."""

    stages: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]
    kernels: tuple[str, ...]
    kinds: tuple[Kind, ...]         # kinds of primitives present, by name
    lights: tuple[Light, ...]       # lights that cast light from somewhere
    ambient: np.ndarray             # (3,) the sum of those that are everywhere
    shadows: bool
    bounces: bool
    sorting: bool
    fog: bool
    lens: bool
    gloss: bool
    filter: bool            # other than a box
    smooth: bool            # normals that a mesh brings
    textbook: bool          # formulas where there is a kernel of them
    samples: int                    # per pixel


@Latest
def _contents(leaves: tuple[Leaf, ...]) -> tuple[dict[Kind, int], tuple[Material, ...], bool]:
    """Of what is visible: the number of primitives of each kind, the materials, whether there are smooth normals."""
    counts: dict[Kind, int] = {}
    told = Counter(_told(leaves))
    for (kind, count, _), times in told.items():
        if kind is not None:
            counts[kind] = counts.get(kind, 0) + count * times
    return (counts, tuple({id(leaf.material): leaf.material for leaf in leaves if leaf.visible}.values()),
            any(smooth for _, _, smooth in told))


@Each
def _told(leaf: Leaf) -> tuple[Kind | None, int, bool]:
    """Of what sort a leaf's primitives are, how many that is, and whether they bring normals; none of a hidden one."""
    if not leaf.visible:
        return None, 0, False
    return leaf.shape.kind(leaf.matrix), leaf.shape.count(), getattr(leaf.shape, "normals", None) is not None


def plan(scene: Scene, settings: Settings, camera: Camera | None = None) -> Plan:
    """The plan for a scene, from its own camera if none is given."""
    counts, materials, smooth = _contents(leaves_of(scene))
    lit, camera = VIEW[settings.view].needs_light, camera or scene.camera or Camera()
    stages, out = ["primary rays"], []
    lens = _keep(stages, out, "depth of field", [
        (lit, NO_LIGHT), (camera.aperture > 0, "the camera is a pinhole"), (settings.samples > 1, FIRST_SAMPLE)])
    shaped = _keep(stages, out, "pixel filter", [
        (lit, NO_LIGHT), (settings.filter != "box", "with a box, samples lie evenly in their pixel"), (settings.samples > 1, CENTRE)])
    present = {kind.name: kind for kind in counts}
    for name in sorted(KIND_MODULES):
        if name not in present:
            out.append((f"hits: {name}", f"no visible {name} in the scene"))
            continue
        stages.append(f"hits: {name}")
        kind, count = present[name], counts[present[name]]
        if kind.bounds is None:
            out.append((f"tree: {name}", "they are unbounded"))
        elif count <= kind.leaf_most:
            out.append((f"tree: {name}", f"only {count}: each is tested"))
        else:
            stages.append(f"tree: {name}")
    if counts:
        stages.append("surface at the hits")
    plain = [kind.name for kind in counts if kind.textbook is not None]
    textbook = _keep(stages, out, "textbook formulas", [
        (settings.solver == "textbook", "hits are to be certain"), (plain, "no visible shape is solved by one")])

    given = STUDIO if scene.lights is None else scene.lights
    shining = [light for light in given if light.on and light.intensity > 0 and any(light.color)]
    everywhere = [np.multiply(light.color, light.intensity) for light in shining if isinstance(light, Ambient)]
    ambient = np.sum(everywhere or [np.zeros(3)], axis=0)
    answers = any(m.diffuse > 0 or m.specular > 0 for m in materials)
    lights = tuple(light for light in shining if not isinstance(light, Ambient)) if answers else ()
    lights = lights if lit else ()
    _keep(stages, out, GLOW, [(lit, NO_LIGHT)])
    if lights:
        stages += sorted({f"light: {type(light).__name__.lower()}" for light in lights})
    else:
        why = "none shines from a place or direction" if answers or not materials else "no visible material answers light"
        out.append(("lights", why if lit else NO_LIGHT))
    shadows = _keep(stages, out, "shadow rays", [(lit, NO_LIGHT), (settings.shadows, "switched off"), (lights, "no light to cast them")])
    smooth = _keep(stages, out, "smooth normals", [(smooth, "no mesh brings normals")])
    _keep(stages, out, "patterns", [(any(m.checker for m in materials), "no visible material has one")])
    fog = _keep(stages, out, "fog", [
        (lit, NO_LIGHT), (scene.fog is not None, "the scene has none"),
        (scene.fog is not None and scene.fog.on and settings.fog, "switched off")])
    bounces = _keep(stages, out, "reflected and refracted rays", [
        (lit, NO_LIGHT), (settings.reflections, "switched off"), (settings.max_depth > 1, "the depth is 1: eye rays only"),
        (any(m.reflection > 0 or m.transmission > 0 for m in materials), "no visible material reflects or transmits")])
    sorting = _keep(stages, out, "ray sorting", [
        (bounces, NO_BOUNCES),
        (any(WORTH <= count < kind.singly and kind.bounds is not None for kind, count in counts.items()), FEW_SHAPES)])
    gloss = _keep(stages, out, "glossy reflection", [
        (lit, NO_LIGHT), (any(m.roughness > 0 and (m.reflection > 0 or m.transmission > 0) for m in materials), SMOOTH),
        (bounces, NO_BOUNCES), (settings.samples > 1, "a pixel's first sample takes the smooth way")])
    _keep(stages, out, "further samples", [(lit, NO_LIGHT), (settings.samples > 1, "one sample per pixel was asked for")])
    stages.append("film")
    kinds = tuple(sorted(counts, key=lambda k: k.name))
    casting = sorted({type(light).__name__.lower() for light in lights})
    wanted = {"core": True, "glow": lit, "lens": lens, "samples": "further samples" in stages,
              "doubt": any(kind.doubtful for kind in kinds),
              "leaf": any(kind.bounds is not None for kind in kinds), "tree": any(stage.startswith("tree: ") for stage in stages),
              **{kind.name: True for kind in kinds}, **{f"textbook-{name}": textbook for name in plain},
              **{f"light-{word}": True for word in casting}, "lit": lights, "fog": fog, "bounce": bounces, "sorting": sorting,
              "gloss": gloss, "filter": shaped,
              "adaptive": "further samples" in stages and (settings.adaptive or "adaptive" in VIEW[settings.view].kernels),
              "recast": "recast" in VIEW[settings.view].kernels}
    names = [name for name, needed in wanted.items() if needed]
    assert all(type(light) in SHINE for light in lights)
    kernels = tuple(f"{name}.{settings.precision}" for name in names)
    samples = settings.samples if lit else 1
    return Plan(tuple(stages), tuple(out), kernels, kinds, lights, ambient, shadows, bounces, sorting, fog, lens, gloss, shaped, smooth,
                textbook, samples)


def _keep(stages: list, out: list, stage: str, needs: list) -> bool:
    """Keep a stage if every (condition, why not) holds; note it on the right list."""
    why = next((why for holds, why in needs if not holds), None)
    if why is None:
        stages.append(stage)
    else:
        out.append((stage, why))
    return why is None
