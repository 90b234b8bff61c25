"""Warming: what is missing is told, what is told is compiled, and nothing else is compiled afterwards."""
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rtcore.warm import ALL, GROUPS, compile_kernels

ROOT = Path(__file__).parent.parent

#: In a fresh process with an empty cache.
COLD = """
import rtcore
from rtcore.settings import Settings
from rtcore.warm import compile_kernels, missing
scene = rtcore.Scene(objects=[rtcore.Plane((0, 0, 0), (0, 1, 0))], lights=[], camera=rtcore.Camera(lookfrom=(0, 1, -5)))
settings = Settings(size=(16, 8), precision="f32", samples=1)
assert missing(scene, settings) == ["core.f32", "glow.f32", "plane.f32"], missing(scene, settings)
steps = []
compile_kernels(missing(scene, settings), lambda *step: steps.append(step))
assert steps == [(0, 3, "core.f32"), (1, 3, "glow.f32"), (2, 3, "plane.f32"), (3, 3, "")], steps
assert missing(scene, settings) == []
assert missing(scene, Settings(precision="f64", samples=1)) == ["core.f64", "glow.f64", "plane.f64"]
print("well")
"""

#: Everything is warmed, then everything is rendered: no kernel may gain a signature, nor compile.
WARM = """
import sys
import numba
import rtcore
from rtcore import *
from rtcore.settings import Settings
from rtcore.shapes import KINDS
from rtcore.warm import ALL, compile_kernels, missing

def kernels():
    found = {}
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] == "rtcore":
            for word, value in vars(module).items():
                if isinstance(value, numba.core.dispatcher.Dispatcher) and not value.targetoptions.get("forceinline"):
                    found[value.py_func.__module__ + "." + value.py_func.__name__] = value
    return found

compile_kernels(ALL)
before = {name: (tuple(k.signatures), sum(k.stats.cache_misses.values())) for name, k in kernels().items()}
assert sum(len(signatures) > 0 for signatures, _ in before.values()) > 20, before     # what only kernels call has none if these are cached

glass = Material(diffuse=0.2, reflection=1, roughness=0.3, transmission=0.8, fresnel=True, checker=Checker())
flat = Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], [(0, 1, 2), (1, 3, 2)] * 6)
smooth = Mesh(flat.vertices, flat.faces, normals=[(0, 0, 1)] * 4)
lights = [Point(position=(0, 9, 0)), Point(position=(1, 9, 0), falloff="constant"), Directional(direction=(1, -1, 0)), Ambient(),
          SphereLight(position=(0, 8, 0)), RectangleLight(position=(0, 7, 0))]
for precision in ("f64", "f32"):
    for fog in (None, Fog(), Fog(kind="linear"), Fog(kind="exponential-squared")):
        for mesh in (flat, smooth):
            nodes = [Node(shape=k.example[0], transform=k.example[1], material=m) for k in KINDS for m in (glass, None)]
            scene = Scene(objects=[*nodes, mesh, *(Sphere((i, 0, 0), 0.2) for i in range(9))], lights=lights, fog=fog,
                          background=Background(top=(1, 1, 1)))
            assert missing(scene, Settings(precision=precision)) == []
            image = rtcore.render(scene, (24, 16), 2, precision=precision, error=1e-9)
            assert image.stats["rays"]["refraction"] > 0
    assert rtcore.render(scene, (24, 16), 12, precision=precision, adaptive=True).stats["samples"]["most"] > 8
    rtcore.render(Scene(objects=[flat], camera=Camera(aperture=0.1)), (24, 16), 2, precision=precision, filter="mitchell")
    for view in ("normal", "depth", "object", "error", "cost", "barycentrics", "shadow"):
        rtcore.render(scene, (24, 16), precision=precision, view=view)
    hits = rtcore.intersect(scene, [(0, 0, -5)] * 20, [(0, 0, 1)] * 20, precision=precision)
    rtcore.occluded(scene, [(0, 0, -5)], [(0, 0, 1)], precision=precision)
rtcore.render(Scene(), (24, 16))
image._repr_png_()
for name, kernel in kernels().items():
    signatures, misses = before[name]
    assert tuple(kernel.signatures) == signatures, ("a signature more", name, kernel.signatures)
    assert sum(kernel.stats.cache_misses.values()) == misses, ("compiled", name)
print("well")
"""


#: Prints groups whose kernels are in other modules than those by which it is told whether they are in the cache.
WHERE = """
import sys
from numba.core.dispatcher import Dispatcher
from rtcore.jit import Cache
from rtcore.warm import GROUPS, compile_kernels

def loaded():
    return {(value.py_func.__module__, value.py_func.__name__, str(signature)) for name, module in list(sys.modules.items())
            if name.startswith("rtcore.") for value in vars(module).values()
            if isinstance(value, Dispatcher) and isinstance(value._cache, Cache) for signature in value.signatures}

before = set()
for group, (modules, _) in GROUPS.items():
    compile_kernels([f"{group}.f64"])
    now = loaded()
    print(*(f"{group}: {module}.{name}" for module, name, _ in now - before if module not in modules), end=" ")
    before = now
"""


def python(*arguments, cache=None):
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    if cache is not None:
        env["RAYSCOPE_CACHE"] = str(cache)
    return subprocess.run([sys.executable, *arguments], env=env, cwd=ROOT, capture_output=True, text=True, timeout=280)


def test_missing_and_compile(tmp_path):
    run = python("-c", COLD, cache=tmp_path)
    assert run.returncode == 0 and run.stdout == "well\n", run.stderr
    assert any(tmp_path.rglob("*.kernel"))     # it went where it was told
    # a second process finds it
    again = python("-c", COLD, cache=tmp_path)
    assert again.returncode == 1 and "AssertionError: []" in again.stderr


def test_nothing_compiles_once_all_is_warm():
    """With the user's own cache, where most of it is already: what counts is that a render adds nothing."""
    run = python("-W", "error", "-c", WARM)
    assert run.returncode == 0 and run.stdout == "well\n", run.stderr


def test_a_group_is_known_to_be_there_by_the_modules_of_its_kernels():
    run = python("-c", WHERE)
    assert run.returncode == 0, run.stderr
    assert run.stdout.split() == []


def test_helper_process_tells_its_progress(tmp_path):
    run = python("-W", "error", "-m", "rtcore.warm", "fog.f32", "light-directional.f32", cache=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines() == ["0 2 fog.f32", "1 2 light-directional.f32", "2 2 "]
    assert run.stderr == ""


def test_helper_process_refuses_unknown_names(tmp_path):
    run = python("-m", "rtcore.warm", "fog.f32", "fog.f16", "banana", cache=tmp_path)
    assert run.returncode == 2 and run.stdout == ""
    assert [line for line in run.stderr.splitlines() if "banana" in line] == ["rtcore.warm: no kernels are called fog.f16, banana"]
    assert not any(tmp_path.rglob("*.kernel"))     # nothing was compiled before the mistake was found


def test_unknown_name_is_a_key_error():
    with pytest.raises(KeyError):
        compile_kernels(["banana.f64"])


def test_all_is_every_group_in_both_precisions():
    assert {f"{group}.{precision}" for group in GROUPS for precision in ("f32", "f64")} == set(ALL) and len(ALL) == len(set(ALL))


def test_what_is_read_is_in_use(tmp_path):
    """A folder's time is that of its last use; one that is pruned goes with the marks that say what is in it."""
    code = ("import os, rtcore\nfrom rtcore import jit, warm\nwarm.compile_kernels([{names}])\n"
            "folder = jit.cache_folder('rtcore.fog')\n{then}\n")
    first = python("-c", code.format(names="'fog.f32', 'plane.f32'", then="os.utime(folder, (1, 1)); print(folder)"), cache=tmp_path)
    assert first.returncode == 0, first.stderr
    folder = Path(first.stdout.strip())
    assert python("-c", code.format(names="'fog.f32'", then=""), cache=tmp_path).returncode == 0
    assert folder.stat().st_mtime > 1 and list(folder.glob("*.kernel"))
    os.utime(folder, (1, 1))
    assert python("-c", code.format(names="'plane.f64'", then=""), cache=tmp_path).returncode == 0
    assert not folder.exists()


def test_old_folders_of_other_versions_are_pruned(tmp_path):
    old = tmp_path / "kernels" / "fog-0123456789abcdef"
    old.mkdir(parents=True)
    (old / "x.kernel").write_text("")
    os.utime(old, (1, 1))
    fresh = tmp_path / "kernels" / "fog-fedcba9876543210"
    fresh.mkdir()
    assert python("-m", "rtcore.warm", "plane.f32", cache=tmp_path).returncode == 0
    assert fresh.exists() and not old.exists()
