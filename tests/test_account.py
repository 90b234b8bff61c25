"""The account of a picture: shares that add up, sentences that are true, and what is loaded and held is what the plan says."""
import subprocess
import sys
from pathlib import Path

import pytest

from rtcore import Camera, Cylinder, Directional, Plane, Point, Scene, Sphere
from rtcore.account import account, sentences
from rtcore.plan import GLOW, plan
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings
from rtcore.shapes import KINDS

ROOT = Path(__file__).parent.parent
CAMERA = Camera(lookfrom=(0, 1, -6))
LAMPS = [Point(position=(-3, 5, -4), intensity=30), Directional(direction=(0, -1, 1))]
SPHERES = Scene(objects=[Sphere((i, 0, 0), 0.4) for i in range(9)], camera=CAMERA, lights=LAMPS)


def rendered(scene: Scene, **settings):
    renderer = Renderer()
    try:
        *_, last = renderer.frames(RenderRequest(scene, CAMERA, Settings(**{"size": (64, 48), "threads": 1, **settings})), coarse=False)
    finally:
        renderer.close()
    return last


def test_shares_add_up_and_every_stage_and_kernel_has_one():
    frame = rendered(SPHERES, samples=1)
    made = account(frame.plan, frame.seconds, frame.held)
    assert sum(kept.share for kept in made.kept) == pytest.approx(1) and sum(share for _, share in made.kernels) == pytest.approx(1)
    assert [kept.stage for kept in made.kept] == list(frame.plan.stages) and [name for name, _ in made.kernels] == list(frame.plan.kernels)
    assert {kept.stage: kept.within for kept in made.kept if kept.within} == {"tree: sphere": "hits: sphere"}
    assert [kept.stage for kept in made.kept if kept.share == 0] == ["tree: sphere"]
    assert [name for name, share in made.kernels if share == 0] == ["leaf.f64", "tree.f64"]
    assert made.bytes == sum(frame.held.values()) > 0


def test_before_anything_is_traced_there_is_no_share():
    made = account(plan(SPHERES, Settings()), {}, {})
    assert {kept.share for kept in made.kept} == {0} and made.bytes == 0
    assert sentences(made)[0].startswith("It shows spheres and")


def test_sentences():
    scene = Scene(objects=[Sphere((0, 0, 0), 1), Cylinder((2, 0, 0), (2, 1, 0), 0.3), Plane((0, -1, 0), (0, 1, 0))], lights=LAMPS)
    seconds = {("hits: sphere", "sphere"): 3.8, ("shadow rays", "sphere"): 1, ("shadow rays", "plane"): 1.4, (GLOW, "core"): 1.2,
               ("light: point", "light-point"): 0.8, ("light: point", "lit"): 1.0, ("film", "core"): 0.8}
    assert sentences(account(plan(scene, Settings(samples=2)), seconds, {})) == [
        "This picture spends 38 % of its time on finding where rays meet spheres, 24 % on shadow rays and 18 % on point light.",
        f"It shows cones and cylinders, planes and spheres and needs no kernel of the {len(KINDS) - 3} other kinds of shapes.",
        "No tree is built for cones and cylinders (only 1: each is tested), planes (they are unbounded) and spheres (only 1: each is "
        "tested).",
        "Depth of field is left out: the camera is a pinhole.",
        "Pixel filter is left out: with a box, samples lie evenly in their pixel.",
        "Textbook formulas are left out: hits are to be certain.",
        "Smooth normals are left out: no mesh brings normals.",
        "Patterns are left out: no visible material has one.",
        "Fog is left out: the scene has none.",
        "Reflected and refracted rays are left out: no visible material reflects or transmits.",
        "Ray sorting is left out: no reflected or refracted rays are followed.",
        "Glossy reflection is left out: no visible material is rough and reflects or transmits."]
    dark = sentences(account(plan(Scene(lights=[]), Settings()), {}, {}))
    assert dark[0].startswith(f"It shows no shapes and needs no kernel of the {len(KINDS)} kinds")
    assert "Lights are left out: none shines from a place or direction." in dark
    first_hits = sentences(account(plan(scene, Settings(view="depth")), {}, {}))
    assert f"{GLOW.capitalize()} are left out: the view shows first hits only." in first_hits


def test_what_is_left_out_takes_no_memory():
    """Waves, trees and shapes grow with what is kept, and only with that."""
    bare = rendered(SPHERES.__class__(objects=SPHERES.objects[:1], camera=CAMERA, lights=[]))
    lit = rendered(SPHERES.__class__(objects=SPHERES.objects[:1], camera=CAMERA, lights=LAMPS))
    assert bare.held["trees"] == 0 < rendered(SPHERES).held["trees"]
    assert bare.held["waves"] < lit.held["waves"]
    assert rendered(SPHERES, view="normal").held["waves"] == bare.held["waves"]
    assert rendered(SPHERES, max_depth=1).held["waves"] == lit.held["waves"] == rendered(SPHERES).held["waves"]
    assert rendered(SPHERES, shadows=False).held["waves"] <= lit.held["waves"]


#: Renders in a process of its own; prints the modules whose kernels are there.
LOADED = """
import rtcore
from rtcore.account import loaded_kernels
scene = rtcore.Scene(objects=[rtcore.Sphere((i, 0, 0), 0.4) for i in range(9)], camera=rtcore.Camera(lookfrom=(0, 1, -6)), {fields})
rtcore.render(scene, (32, 24), threads=1, {settings})
print(*sorted(loaded_kernels()))
"""


@pytest.mark.parametrize("fields,settings,wanted,unwanted", [
    ("lights=[]", "", {"shapes.sphere.intersect", "eye.cast"}, {"shading.gather", "shading.bounce", "fog.dim", "lights.point.shine"}),
    ("lights=[rtcore.Point(position=(0, 9, 0))], fog=rtcore.Fog()", "fog=False", {"shading.gather", "lights.point.shine"},
     {"fog.dim", "lights.directional.shine"}),
    ("lights=[rtcore.Point(position=(0, 9, 0))], fog=rtcore.Fog()", "view='normal'", {"shapes.sphere.surface"},
     {"shading.gather", "shading.glow", "fog.dim"})])
def test_a_scene_of_spheres_loads_no_kernel_that_it_does_not_need(fields, settings, wanted, unwanted):
    run = subprocess.run([sys.executable, "-c", LOADED.format(fields=fields, settings=settings)], capture_output=True, text=True, cwd=ROOT,
                         timeout=280)
    assert run.returncode == 0, run.stderr
    names = set(run.stdout.split())
    assert {name for name in names if name.startswith("shapes.")} == {"shapes.sphere.intersect", "shapes.sphere.surface"}
    assert wanted <= names and not names & unwanted
