"""Leaving out changes nothing: every gallery scene has the same bits as under the full pipeline, in which each stage runs and each kind of
shape is asked, needed or not; and what was left out did not run."""
import msgspec
import numpy as np
import pytest

from app.gallery import GALLERY
from rtcore import Directional, Fog, Point, load, progressive, shading, trace
from rtcore.flatten import DTYPES, Geometry, flatten
from rtcore.framing import framed
from rtcore.plan import plan
from rtcore.progressive import Renderer, RenderRequest
from rtcore.scene import Node, Scene, Translate
from rtcore.settings import Settings
from rtcore.shapes import KINDS

SCENES = sorted(GALLERY.glob("*.yaml"))
SIZE = (64, 40)
AWAY = Translate((3e5, 2e5, -1e6))
DARK = (Point(position=(1, 9, 2), intensity=0), Directional(direction=(1, -2, 0.5), intensity=0))


def full_plan(scene, settings, camera=None):
    """Everything runs: lights that bring nothing, their shadow rays, fog, bounces, which are sorted."""
    composed = plan(scene, settings, camera)
    return composed._replace(lights=(*composed.lights, *DARK), shadows=True, fog=True, bounces=True, sorting=True, gloss=True)


def full_geometry(scene, precision="f64", previous=None, give_way=None) -> Geometry:
    """Every kind of shape, those that the scene does not have far from where any ray goes, or with an empty table if they have no end;
    flat meshes with rows for normals."""
    geometry = flatten(scene, precision)
    groups, first = list(geometry.groups), len(geometry.leaf)
    for i, group in enumerate(groups):
        if group.kind.name == "triangle" and len(group.table.extra) == 0:
            groups[i] = group._replace(table=group.table._replace(extra=np.zeros((len(group.table.data), 9), DTYPES[precision])))
    for kind in KINDS:
        if kind not in {group.kind for group in groups}:
            shape, transform = kind.example
            (group,) = flatten(Scene(objects=[Node(shape=shape, transform=(*transform, AWAY))]), precision).groups
            if kind.bounds is None:
                empty = {name: array[:0] for name, array in group.table._asdict().items()}
                group = group._replace(table=group.table._replace(**empty))
            groups.append(group._replace(first=first))
            first += len(group.table.data)
    return geometry._replace(groups=tuple(groups))


def full_look(*arguments):
    """Every material has a checker pattern, of one colour where it had none."""
    look = make_look(*arguments)
    m = look.material
    plain = m[:, shading.CHECKER] == 0
    m[plain, shading.EVEN:shading.EVEN + 3] = m[plain, shading.ODD:shading.ODD + 3] = m[plain, shading.COLOR:shading.COLOR + 3]
    m[plain, shading.PATTERN:shading.PATTERN + 12] = np.eye(4)[:3].ravel()
    m[plain, shading.CHECKER] = m[plain, shading.SIZE] = 1
    return look


make_look = shading.make_look


@pytest.fixture
def all_on(monkeypatch):
    """Switches the full pipeline on; trees stand over any two shapes."""
    def switch():
        monkeypatch.setattr(progressive, "plan", full_plan)
        monkeypatch.setattr(progressive, "flatten", full_geometry)
        monkeypatch.setattr(trace.shading, "make_look", full_look)
        for kind in KINDS:
            object.__setattr__(kind, "leaf_most", 1)
    before = {kind: kind.leaf_most for kind in KINDS}
    yield switch
    for kind, most in before.items():
        object.__setattr__(kind, "leaf_most", most)


def rendered(scene, **settings):
    renderer = Renderer()
    try:
        *_, last = renderer.frames(RenderRequest(scene, framed(scene, SIZE[0] / SIZE[1]), Settings(size=SIZE, samples=2, **settings)),
                                   coarse=False)
        return last
    finally:
        renderer.close()


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_same_bits_as_the_full_pipeline(path, precision, all_on):
    scene = load(path)
    lean = rendered(scene, precision=precision)
    all_on()
    whole = rendered(scene if scene.fog is not None and scene.fog.on else msgspec.structs.replace(scene, fog=Fog(density=0)),
                     precision=precision)
    assert lean.pixels.std() > 0.01
    assert lean.pixels.tobytes() == whole.pixels.tobytes()
    # the first ran what its plan says and counted nothing else; the second ran everything
    assert {stage for stage, _ in lean.seconds} <= set(lean.plan.stages)
    assert {f"{group}.{precision}" for _, group in lean.seconds} <= set(lean.plan.kernels)
    if "shadow rays" not in lean.plan.stages:
        assert lean.rays["shadow"] == lean.rays["shadow_hits"] == 0
    if "reflected and refracted rays" not in lean.plan.stages:
        assert lean.rays["reflection"] == lean.rays["refraction"] == 0
    ran = {stage for stage, _ in whole.seconds}
    assert ran >= {"fog", "shadow rays", "reflected and refracted rays", "light: point", "light: directional",
                   *(f"hits: {kind.name}" for kind in KINDS)}
    assert ("ray sorting" in ran) == (whole.rays["reflection"] + whole.rays["refraction"] > 0)


def test_the_gallery_leaves_out_each_kind_of_thing():
    """Else the test above would prove little."""
    left = [dict(plan(load(path), Settings()).left_out) for path in SCENES]
    for stage in ("fog", "reflected and refracted rays", "ray sorting", "patterns", "smooth normals",
                  *(f"hits: {kind.name}" for kind in KINDS)):
        assert any(stage in out for out in left), stage
