"""The Standard Procedural Databases: the published ray counts, and pictures laid over those of POV-Ray and of the author."""
import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

import rtcore
from rtcore.progressive import Renderer, RenderRequest
from rtcore.settings import Settings

# Eye rays that hit, reflected, refracted, and the least and most shadow rays published; 513 x 513, depth 5.
PUBLISHED = {
    "balls": (263_169, 175_095, 0, 954_368, 959_244),
    "mount": (173_685, 354_769, 354_769, 361_037, 412_922),
    "tetra": (49_950, 0, 0, 46_112, 46_262),
    "tree": (169_908, 0, 0, 1_097_419, 1_110_323),
}
SMALL = ("balls2", "gears1", "mount3", "rings2", "shells2", "teapot2", "tetra3", "tree4")
SIDE = 512
#: Background through glass looks like background, so what is nothing but background can be told from the picture of these only.
WITHOUT_GLASS = ("tetra", "tree")


@pytest.fixture(scope="module")
def empty(scenes):
    """name -> (512, 512) bool: where nothing is hit, with the angle from edge to edge as POV-Ray and the author's pictures have it."""
    def where(name):
        scene = rtcore.load(scenes / "spd" / f"{name}.nff")
        renderer = Renderer()
        try:
            request = RenderRequest(scene, scene.camera.at(span="edges"), Settings(size=(SIDE, SIDE), samples=1, view="object"))
            *_, last = renderer.frames(request, coarse=False)
        finally:
            renderer.close()
        return last.node < 0
    return {name: where(name) for name in WITHOUT_GLASS}


def background(path) -> np.ndarray:
    """Where a picture shows the colour of its top left corner, which all four pictures have sky in."""
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    return (np.abs(pixels - pixels[0, 0]) <= 2).all(axis=2)


def brightness(pixels) -> np.ndarray:
    return np.asarray(pixels, float)[..., :3].mean(axis=2).ravel()


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", PUBLISHED)
def test_counts_are_the_published_ones(scenes, name, precision):
    stats = rtcore.render(rtcore.load(scenes / "spd" / f"{name}.nff"), size=(513, 513), spp=1, max_depth=5, precision=precision).stats
    hits, reflected, refracted, fewest, most = PUBLISHED[name]
    rays = stats["rays"]
    assert rays["primary"] == 513 * 513
    assert abs(rays["primary_hits"] - hits) <= 5
    assert rays["reflection"] == pytest.approx(reflected, rel=0.1)
    assert rays["refraction"] == pytest.approx(refracted, rel=0.1)
    assert 0.9 * fewest <= rays["shadow"] <= 1.1 * most
    assert 0 < rays["shadow_hits"] < rays["shadow"]
    assert stats["nonfinite_pixels"] == 0


@pytest.mark.parametrize("name", SMALL)
def test_the_small_ones_render(scenes, name):
    image = rtcore.render(rtcore.load(scenes / "spd-small" / f"{name}.nff"), size=(96, 96), spp=2, max_depth=5)
    assert image.stats["nonfinite_pixels"] == 0 and np.isfinite(image.pixels).all()
    assert 0.02 < image.stats["rays"]["primary_hits"] / (2 * 96 * 96) <= 1
    assert image.pixels.std() > 0.01


@pytest.mark.parametrize("name", WITHOUT_GLASS)
def test_outlines_are_those_of_pov_ray(scenes, empty, name, tmp_path):
    if not shutil.which("povray"):
        pytest.skip("needs povray")
    picture = tmp_path / "pov.png"
    subprocess.run(["povray", f"+I{scenes / 'spd-pov' / name}.pov", f"+O{picture}", f"+W{SIDE}", f"+H{SIDE}", "-D", "-A", "+WT2"],
                   cwd=tmp_path, check=True, capture_output=True, timeout=120)
    assert np.count_nonzero(empty[name] != background(picture)) <= 20


@pytest.mark.parametrize("name", WITHOUT_GLASS)
def test_outlines_are_those_of_the_authors_pictures(scenes, empty, name):
    """His pictures are smoothed: pixels on an outline belong to neither side. But for the thinnest twigs all others agree."""
    theirs, ours = background(scenes / "spd-reference" / f"{name}.png"), empty[name]
    inner = np.ones_like(ours)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            inner &= np.roll(ours, (dy, dx), (0, 1)) == ours
    assert np.count_nonzero((theirs != ours) & inner) <= 0.001 * ours.size


@pytest.mark.parametrize("name", PUBLISHED)
def test_light_and_shadow_fall_as_in_the_authors_pictures(scenes, name, tmp_path):
    """His were shaded in display values, ours in linear light: the tones differ, but not what is brighter than what."""
    scene = rtcore.load(scenes / "spd" / f"{name}.nff")
    rtcore.render(scene, size=(SIDE, SIDE), spp=1, max_depth=5).save(tmp_path / "ours.png")
    pictures = tmp_path / "ours.png", scenes / "spd-reference" / f"{name}.png"
    ours, theirs = (brightness(Image.open(path).convert("RGB")) for path in pictures)
    assert np.corrcoef(ours, theirs)[0, 1] > 0.7
