"""What each kind of edit makes the renderer do again. One table, by which it goes.

`python -m rtcore.edits` prints the table.
"""
from typing import NamedTuple

import msgspec

from rtcore.camera import Camera
from rtcore.fields import Record
from rtcore.lights import SHINE, STUDIO
from rtcore.leaves import Leaf, same_place
from rtcore.scene import Light, Scene
from rtcore.settings import Settings

KEPT, ITS, TOUCHED, ANEW = "kept", "its own", "where touched", "anew"
STEPS = (KEPT, ITS, TOUCHED, ANEW)      # from little to much


class Edit(NamedTuple):
    """A kind of edit, and what becomes of that which the samples before it have brought."""

    name: str
    what: str
    hits: str       # what the eyes' rays of the first sample met
    onward: str     # what the reflected and refracted rays that come of them met
    shadows: str    # how far lights reach those hits
    light: str      # the samples


EDITS = (
    Edit("view", "what the picture shows of the samples", KEPT, KEPT, KEPT, KEPT),
    Edit("exposure", "how bright the screen shows them", KEPT, KEPT, KEPT, KEPT),
    Edit("samples", "samples, time, error to stop at; region, threads; names", KEPT, KEPT, KEPT, KEPT),
    Edit("fog", "the fog, its switch", KEPT, KEPT, KEPT, ANEW),
    Edit("background", "the background", KEPT, KEPT, KEPT, ANEW),
    Edit("shadows", "the switch of shadows", KEPT, KEPT, KEPT, ANEW),
    Edit("reflections", "the switch of reflections, the depth", KEPT, KEPT, KEPT, ANEW),
    Edit("light", "colour, strength and switch of a light", KEPT, KEPT, KEPT, ANEW),
    Edit("material", "colours and shares of a material", KEPT, KEPT, KEPT, ANEW),
    Edit("lens", "aperture and focus, the pixel filter", KEPT, KEPT, KEPT, ANEW),
    Edit("move_light", "the place or extent of a light; a light more or less", KEPT, KEPT, ITS, ANEW),
    Edit("opacity", "how much light a material lets through", KEPT, KEPT, ANEW, ANEW),
    Edit("refraction", "a material's index of refraction", KEPT, ANEW, KEPT, ANEW),
    Edit("hide", "a shape hidden or shown", TOUCHED, TOUCHED, TOUCHED, ANEW),
    Edit("shape", "a shape's numbers or its place", TOUCHED, TOUCHED, TOUCHED, ANEW),
    Edit("nodes", "shapes added, deleted or put in another order", ANEW, ANEW, ANEW, ANEW),
    Edit("camera", "the view; size, precision, solver, seed of the picture", ANEW, ANEW, ANEW, ANEW),
)
EDIT = {edit.name: edit for edit in EDITS}

#: Fields of the settings, by the edit that a change of them is.
SETTINGS = {"view": "view", "samples": "samples", "adaptive": "samples", "seconds": "samples", "error": "samples", "threads": "samples",
            "region": "samples", "filter": "lens", "fog": "fog", "shadows": "shadows", "reflections": "reflections",
            "max_depth": "reflections"}


class Change(NamedTuple):
    """How two requests differ."""

    edits: frozenset[str]       # names of EDITS
    leaves: tuple[int, ...]     # leaves that were hidden, shown or changed in shape or place

    def extent(self, step: str) -> str:
        """What becomes of one of Edit's columns, "hits" and so on: the most that any of the edits asks for."""
        return max((getattr(EDIT[name], step) for name in self.edits), key=STEPS.index, default=KEPT)


def change(old: tuple[Scene, Camera, Settings], new: tuple[Scene, Camera, Settings], before: tuple[Leaf, ...], after: tuple[Leaf, ...],
           ) -> Change:
    """How a request (scene, camera, settings) differs from one before; the leaves of both scenes."""
    edits, leaves = set(), []
    for field in Settings.__struct_fields__:
        if getattr(old[2], field) != getattr(new[2], field):
            edits.add(SETTINGS.get(field, "camera"))
    if old[1] != new[1]:
        edits.add("lens" if _pinhole(old[1]) == _pinhole(new[1]) else "camera")
    if old[0] is not new[0]:
        edits |= _scene(old[0], new[0])
        if before is not after and (len(before) != len(after) or any(a is not b and a.path != b.path for a, b in zip(before, after))):
            edits.add("nodes")
        else:
            for index, (a, b) in enumerate(zip(before, after) if before is not after else ()):
                if a is not b and (edit := _leaf(a, b)):
                    edits |= edit
                    if edit & {"hide", "shape"}:
                        leaves.append(index)
    return Change(frozenset(edits), tuple(leaves))


def _pinhole(camera: Camera) -> Camera:
    """The camera without its lens, through the middle of which first samples go."""
    return msgspec.structs.replace(camera, aperture=0.0, focus=0.0)


def shadow_key(light: Light) -> tuple:
    """What the shadows of a light depend on."""
    return type(light).__name__.lower(), light.numbers().tobytes()


def casting(scene: Scene) -> frozenset[tuple]:
    """The `shadow_key` of every light that can cast shadows, switched off or not."""
    return frozenset(shadow_key(light) for light in (STUDIO if scene.lights is None else scene.lights) if type(light) in SHINE)


def _bare(record: Record) -> Record:
    """A record without its name and note, which no picture shows."""
    said = {field: "" for field in ("name", "note") if hasattr(record, field)}
    return msgspec.structs.replace(record, **said) if said else record


def _bare_lights(scene: Scene) -> list[Light]:
    return [_bare(light) for light in (STUDIO if scene.lights is None else scene.lights)]


def _scene(old: Scene, new: Scene) -> set[str]:
    edits = set()
    if old.fog != new.fog:
        edits.add("fog")
    if old.background != new.background:
        edits.add("background")
    if _bare_lights(old) != _bare_lights(new):
        edits.add("light" if casting(old) == casting(new) else "move_light")
    return edits


def _leaf(a: Leaf, b: Leaf) -> set[str]:
    """How a leaf has changed."""
    edits = set()
    if a.visible != b.visible:
        edits.add("hide")
    elif a.visible and (a.shape is not b.shape or not same_place(a, b)):
        edits.add("shape")
    if a.material is not b.material and _bare(a.material) != _bare(b.material):
        edits.add("material")
        if a.material.transmission != b.material.transmission:
            edits.add("opacity")
        if a.material.ior != b.material.ior:
            edits.add("refraction")
    return edits


def table() -> str:
    """EDITS in Markdown."""
    rows = ["| edit | what changes | eye's rays | reflected, refracted rays | shadows | samples |", "| --- | --- | --- | --- | --- | --- |"]
    return "\n".join([*rows, *(f"| {' | '.join(edit)} |" for edit in EDITS)])


if __name__ == "__main__":
    print(table())
