"""Imports point one way: app -> rtcore, and inside rtcore down the order of the design. Read with ast, nothing is imported."""
import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MODULES = {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
           for folder in ("rtcore", "app", "resources") for path in sorted((ROOT / folder).rglob("*.py"))}

WINDOW = {"PySide6", "shiboken6", "pyqtgraph", "app"}
DOCUMENT = {"rtcore.fields", "rtcore.camera", "rtcore.leaves", "rtcore.scene"}      # what describes a scene; nothing in it is compiled
COMPILED = {"numba", "llvmlite"}

#: A module may import from its own layer and from those above it. A name stands for all below it.
LAYERS = (
    {"rtcore.fields"},
    {"rtcore.camera"},
    {"rtcore.leaves", "rtcore.scene"},
    {"rtcore.latest"},
    {"rtcore.across", "rtcore.directions", "rtcore.clock", "rtcore.exact", "rtcore.expansions", "rtcore.indices", "rtcore.indirect",
     "rtcore.jit", "rtcore.lanes", "rtcore.memory", "rtcore.neighbours", "rtcore.pairs", "rtcore.powers", "rtcore.rows", "rtcore.todo",
     "rtcore.wave"},
    # shapes walk the tree in their kernels, so it comes before them
    {"rtcore.bvh", "rtcore.pyramid", "rtcore.turns", "rtcore.walk", "rtcore.sampling", "rtcore.roots"},
    {"rtcore.shapes", "rtcore.lights", "rtcore.views"},
    {"rtcore.settings", "rtcore.bounds", "rtcore.framing", "rtcore.eye", "rtcore.lens", "rtcore.shading", "rtcore.fog", "rtcore.film",
     "rtcore.schedule", "rtcore.adaptive", "rtcore.keep", "rtcore.levels", "rtcore.pace", "rtcore.gloss", "rtcore.filters",
     "rtcore.sorting"},
    {"rtcore.files", "rtcore.flatten", "rtcore.plan", "rtcore.edits"},
    {"rtcore.lookup"},
    {"rtcore.stages"},
    {"rtcore.addresses"},
    {"rtcore.scratch"},
    {"rtcore.algebra", "rtcore.recast", "rtcore.trace"},
    {"rtcore.picture"},
    {"rtcore.progressive", "rtcore.warm"},
    {"rtcore.account"},
    {"rtcore.api"},
    {"rtcore.solvers"},       # compared by the reports; the renderer knows its own kernels only
    {"rtcore.reports"},
    {"rtcore"},
)
FAMILIES = ("rtcore.shapes", "rtcore.lights", "rtcore.files", "rtcore.views")
HELPERS = {"rtcore.shapes.kind", "rtcore.views.view"}       # what a family shares, beside modules with a leading underscore


def imports_of(path: Path, module: str) -> set[str]:
    """Full names of the modules that a file imports, at its top or inside a function."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                base = ".".join(filter(None, [*package.split(".")[:len(package.split(".")) - node.level + 1], node.module]))
            found |= {f"{base}.{name.name}" if f"{base}.{name.name}" in MODULES else base for name in node.names}
    return found


IMPORTS = {module: imports_of(path, module) for module, path in MODULES.items()}


def layer(module: str) -> int:
    """Number of the layer that a module of rtcore belongs to."""
    while module:
        for i, names in enumerate(LAYERS):
            if module in names and (module != "rtcore" or names == {"rtcore"}):
                return i
        module = module.rpartition(".")[0]
    raise AssertionError("not a module of rtcore")


def reached(module: str) -> set[str]:
    """All that importing a module brings in, through other modules of ours."""
    seen, todo = set(), [module]
    while todo:
        for name in IMPORTS.get(todo.pop(), ()):
            if name not in seen:
                seen.add(name)
                todo.append(name)
    return seen


def tops(names: set[str]) -> set[str]:
    return {name.partition(".")[0] for name in names}


def test_rtcore_knows_nothing_of_the_window():
    for module, names in IMPORTS.items():
        if module.startswith("rtcore"):
            assert not tops(names) & WINDOW, module


def test_resources_import_nothing_of_ours():
    assert not tops(IMPORTS["resources"]) & {"app", "rtcore"}


def test_the_scene_document_is_free_of_compiled_code():
    for module in DOCUMENT:
        names = reached(module)
        assert not tops(names) & COMPILED, module
        assert {name for name in names if name.startswith("rtcore")} <= DOCUMENT, module


def test_every_module_of_rtcore_has_a_layer():
    unplaced = {module for module in MODULES if module.startswith("rtcore.") and layer(module) == len(LAYERS) - 1}
    assert not unplaced, "name their layer in LAYERS"


@pytest.mark.parametrize("module", [name for name in MODULES if name.startswith("rtcore")])
def test_imports_point_one_way(module):
    wrong = {name for name in IMPORTS[module] if name.partition(".")[0] == "rtcore" and layer(name) > layer(module)}
    assert not wrong


@pytest.mark.parametrize("family", FAMILIES)
def test_members_of_a_family_do_not_import_one_another(family):
    inside = {name for name in MODULES if name.startswith(family + ".")}
    members = {name for name in inside - HELPERS if not name.rpartition(".")[2].startswith("_")}
    assert members
    for module in inside:
        assert not IMPORTS[module] & (members - {module}), module
        assert family not in IMPORTS[module], module


def test_shapes_lights_and_views_do_not_know_of_one_another():
    for family in ("rtcore.shapes", "rtcore.lights", "rtcore.views"):
        others = tuple(set(FAMILIES) - {family})
        for module in MODULES:
            if module.startswith(family):
                assert not [name for name in IMPORTS[module] if name.startswith(others)], module


def test_no_module_imports_itself_in_a_circle():
    for module in MODULES:
        assert module not in reached(module), module
