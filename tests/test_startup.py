"""Starting: importing compiles nothing and takes little more than numba does, and a render imports and loads only what it needs."""
import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.gallery import FIRST_SCENE
from rtcore import __all__ as names_of_rtcore
from rtcore.scene import Shape
from rtcore.shapes import MODULES, SHAPE_MODULES, TEXTBOOK, kind_named
from rtcore.shapes.kind import Kind

ROOT = Path(__file__).parent.parent

#: Imports every module of rtcore; prints what was compiled or read from the cache meanwhile.
EVERYTHING = """
import importlib, pkgutil, sys
from numba.core import event
from numba.core.dispatcher import Dispatcher
listener = event.RecordingListener()
with event.install_listener("numba:compile", listener):
    import rtcore
    for module in list(pkgutil.walk_packages(rtcore.__path__, "rtcore.")):
        if not module.name.endswith("_process"):    # programs of their own, for rivals that may not be installed
            importlib.import_module(module.name)
kernels = [value for name, module in list(sys.modules.items()) if name.startswith("rtcore.") for value in vars(module).values()
           if isinstance(value, Dispatcher)]
print(len(kernels) > 100, len(listener.buffer), sum(len(kernel.signatures) for kernel in kernels))
"""

#: CPU seconds of importing what rtcore stands on, and then rtcore with all that renders.
SECONDS = "import time; import numpy, numba; a = time.process_time(); import rtcore; rtcore.render; print(a, time.process_time() - a)"

RENDER = """
import sys
from app.__main__ import main
code = main(["render", {scene!r}, "-o", {out!r}, "--size", "32x24", "--spp", "1"])
from rtcore.account import loaded_kernels
print(code, len(loaded_kernels()), *(name for name in {names} if name in sys.modules))
"""

#: What a picture needs none of: other formats, reports, the window, and the setting up of numba's compiler.
UNNEEDED = ("PIL", "trimesh", "rich", "mpmath", "PySide6", "pyqtgraph", "OpenEXR", "difflib", "subprocess", "rtcore.files.nff",
            "rtcore.files._meshes", "rtcore.shapes.implicit", "rtcore.shapes.blob", "rtcore.shapes.cone", "app.commands.bench",
            "rtcore.algebra.crossings", "rtcore.reports", "rtcore.solvers", "numba.cpython.cmathimpl")


def python(code: str, **env: str) -> str:
    run = subprocess.run([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(ROOT), **env}, cwd=ROOT, capture_output=True,
                         text=True, timeout=280)
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_importing_compiles_nothing(tmp_path):
    assert python(EVERYTHING, RAYSCOPE_CACHE=str(tmp_path)).split() == ["True", "0", "0"]
    assert not any(path.is_file() for path in tmp_path.rglob("*"))


def test_importing_takes_little_more_than_numba(tmp_path):
    """As installed: bytecode is there. In parts of what numpy and numba take, 0.3 s where 0.2 s more are allowed."""
    env = {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(tmp_path)}
    python(SECONDS, **env)
    runs = [tuple(map(float, python(SECONDS, **env).split())) for _ in range(3)]
    assert min(ours for _, ours in runs) < 2 / 3 * min(base for base, _ in runs), runs


def test_a_render_imports_and_loads_only_what_it_needs(tmp_path):
    code = RENDER.format(scene=str(FIRST_SCENE), out=str(tmp_path / "a.png"), names=UNNEEDED)
    python(code)        # once, in case kernels have to be compiled
    exit_code, kernels, *imported = python(code).split()
    assert exit_code == "0" and imported == []
    # 5 for any picture, 2 for its light, 2 for lights, 1 for bounces, 1 for trees, 2 for each of two kinds and 1 for their being two
    assert int(kernels) == 16


def test_a_command_ends_without_looking_for_garbage():
    """Python would go through all objects once more; those set aside it leaves alone."""
    code = f"import atexit, gc; from app.__main__ import main; main(['check', {str(FIRST_SCENE)!r}]); atexit._run_exitfuncs()"
    assert python(code + "; print(gc.get_freeze_count() > 0)").split()[-1] == "True"


def test_the_table_of_shapes_says_what_their_modules_have():
    names = {path.stem for path in (ROOT / "rtcore" / "shapes").glob("*.py") if not path.stem.startswith("_")}
    assert set(MODULES) == names - {"kind"}
    textbook = []
    for module, listed in MODULES.items():
        held = vars(importlib.import_module(f"rtcore.shapes.{module}")).values()
        assert {value.__name__ for value in held if isinstance(value, type) and issubclass(value, Shape) and value is not Shape} == set(
            listed.shapes)
        kinds = [value for value in held if isinstance(value, Kind)]
        assert [kind.name for kind in kinds] == list(listed.kinds) and kinds == [kind_named(name) for name in listed.kinds]
        textbook += [kind.name for kind in kinds if kind.textbook is not None]
    assert tuple(textbook) == TEXTBOOK and set(SHAPE_MODULES) <= set(names_of_rtcore)


def test_a_scene_imports_the_shapes_that_it_has(tmp_path):
    (tmp_path / "a.yaml").write_text("rayscope: 1\nscene:\n- torus: {major_radius: 1, minor_radius: 0.25}\n")
    code = (f"import sys, rtcore; from rtcore.plan import plan; from rtcore.settings import Settings\n"
            f"plan(rtcore.load({str(tmp_path / 'a.yaml')!r}), Settings())\n"
            "print(*(n.rpartition('.')[2] for n in sys.modules if n.startswith('rtcore.shapes.')))")
    assert set(MODULES) & set(python(code).split()) == {"torus"}


@pytest.mark.parametrize("name", ["crossings", "render", "Sphere"])
def test_names_of_the_package_are_there_when_asked_for(name):
    assert python(f"import rtcore; print(callable(rtcore.{name}), {name!r} in rtcore.__all__)").split() == ["True", "True"]
    assert python(f"from rtcore import *; print(callable({name}))").split() == ["True"]


def test_a_wrong_name_is_an_attribute_error():
    said = python("import rtcore\ntry:\n rtcore.banana\nexcept AttributeError as e: print(e)")
    assert said.startswith("module 'rtcore' has no attribute")
