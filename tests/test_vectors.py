"""The hot kernels are vector code: what the compiler made of them, read as assembly and as its own intermediate code.

A formula written in lanes can still be taken apart into single numbers, by a type that turned double or an index that had to be worked
out; and an array given to a function with branches is counted, atomically. Both halve the speed and change no picture.
"""
import platform
import re

import numpy as np
import pytest
from numba.core.caching import NullCache

from rtcore import Box, Camera, Material, Node, Point, Scene, Sphere, Triangle, eye, film, intersect, render, shading
from rtcore.jit import kernel
from rtcore.lights import point
from rtcore.shapes import sphere, triangle

FAMILY = {"aarch64": "arm", "arm64": "arm", "x86_64": "x86", "AMD64": "x86"}.get(platform.machine())
PACKED = {
    "arm": re.compile(r"^\s+f(?:add|sub|mul|div|mla|mls|maxnm|minnm|max|min|cm\w\w|abs)\s+v\d+\.(?:2d|4s)", re.MULTILINE),
    "x86": re.compile(r"^\s+v?(?:add|sub|mul|div|max|min|cmp\w*|fn?m(?:add|sub)\d+)p[sd]\s", re.MULTILINE)}
SINGLE = {
    "arm": re.compile(r"^\s+f(?:add|sub|mul|div|n?madd|n?msub|maxnm|minnm)\s+[sd]\d+", re.MULTILINE),
    "x86": re.compile(r"^\s+v?(?:add|sub|mul|div|max|min|fn?m(?:add|sub)\d+)s[sd]\s", re.MULTILINE)}
WIDE = re.compile(r"%[yz]mm\d")

#: Packed instructions in a kernel, the walk through the tree among them, are at least so many; about three quarters of what there are.
SHAPES = {Sphere((0, 0, 0), 1): 300, Triangle((0, 0, 0), (1, 0, 0), (0, 1, 0)): 180, Box((0, 0, 0), (1, 1, 1)): 300}
CASES = [pytest.param(shape, least, precision, id=f"{type(shape).__name__}-{precision}")
         for shape, least in SHAPES.items() for precision in ("f32", "f64")]

#: The same of what else a picture goes through, and how many on single numbers there may be: films have a way for pixels apart, spheres
#: one for the angles of texture coordinates.
STAGES = {eye.cast: (80, 24), film.deposit: (16, 24), film.commit: (16, 90), shading.glow: (75, 6), shading.gather: (2, 32),
          shading.bounce: (250, 4), point.shine: (110, 16), sphere.surface: (70, 70), triangle.surface: (240, 16)}


def afresh(cached, precision: str) -> tuple[str, str, str]:
    """The name, the assembly and the intermediate code of a kernel that has run; code from the cache can't be looked at."""
    fresh = kernel(cached.py_func)
    fresh._cache = NullCache()
    fresh.compile(next(types for types in cached.signatures if f"float{precision[1:]}" in str(types[0])))
    name = fresh.overloads[fresh.signatures[0]].fndesc.llvm_func_name
    return name, fresh.inspect_asm(fresh.signatures[0]), fresh.inspect_llvm(fresh.signatures[0])


@pytest.fixture(scope="module")
def compiled():
    """(shape, precision) -> `afresh` of its kernel."""
    found = {}

    def look(shape, precision):
        if (shape, precision) not in found:
            intersect(Scene(objects=(shape,)), np.zeros((8, 3)), np.ones((8, 3)), precision=precision)
            found[shape, precision] = afresh(shape.kind(np.eye(4)).intersect, precision)
        return found[shape, precision]
    return look


@pytest.fixture(scope="module")
def rendered():
    """A picture that needs all of STAGES has been made."""
    glass = Material(reflection=0.5, transmission=0.5)
    things = [Node(shape=Sphere((0, 0, 0), 1), material=glass), Triangle((-2, -1, -2), (2, -1, -2), (0, -1, 2))]
    render(Scene(objects=things, lights=[Point(position=(3, 4, 5))], camera=Camera(lookfrom=(0, 1, 4))), (16, 16))


def own_part(assembly: str, name: str) -> str:
    """The assembly of one function."""
    start = re.search(rf'^_?"?{re.escape(name)}"?:', assembly, re.MULTILINE).end()
    end = re.search(r"^\s*\.(?:cfi_endproc|size)|^\.?Lfunc_end", assembly[start:], re.MULTILINE)
    return assembly[start:start + end.start()]


def instructions(assembly: str, name: str) -> tuple[int, int]:
    """How many of a kernel's instructions compute with vectors, and how many with single numbers."""
    if FAMILY is None:
        pytest.skip(f"knows the instructions of x86 and ARM, not of {platform.machine()}")
    text = own_part(assembly, name)
    return len(PACKED[FAMILY].findall(text)), len(SINGLE[FAMILY].findall(text))


@pytest.mark.parametrize("shape, least, precision", CASES)
def test_hot_kernels_compute_in_packed_instructions(compiled, shape, least, precision):
    name, assembly, _ = compiled(shape, precision)
    packed, single = instructions(assembly, name)
    assert packed >= least
    assert packed >= 2 * single, f"{single} instructions on single numbers beside {packed} packed ones"
    if FAMILY == "x86" and "ymm" in assembly:
        lines = [line for line in own_part(assembly, name).splitlines() if PACKED["x86"].match(line)]
        assert sum(bool(WIDE.search(line)) for line in lines) > 0.9 * len(lines), "vectors of four numbers only"


@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: f"{stage.py_func.__module__.removeprefix('rtcore.')}.{stage.py_func.__name__}")
def test_other_stages_do_too(rendered, stage):
    name, assembly, code = afresh(stage, "f64")
    packed, single = instructions(assembly, name)
    least, most = STAGES[stage]
    assert packed >= least and single <= most, (packed, single)
    blocks = blocks_of(code, name)
    assert not [label for label in in_loops(blocks) if any("@NRT_incref" in line for line in blocks[label])]


def blocks_of(code: str, name: str) -> dict[str, list[str]]:
    """label -> lines of the basic blocks of one function in LLVM's intermediate code."""
    start = re.search(rf'^define .*@"?{re.escape(name)}"?\(', code, re.MULTILINE).end()
    blocks: dict[str, list[str]] = {"": []}
    for line in code[start:code.index("\n}", start)].splitlines()[1:]:
        label = re.match(r'"?([\w.$-]+)"?:', line)
        if label:
            blocks[label[1]] = []
        else:
            blocks[next(reversed(blocks))].append(line)
    return blocks


def in_loops(blocks: dict[str, list[str]]) -> set[str]:
    """The blocks that control can come back to."""
    after = {label: {name for line in lines for name in re.findall(r'label %"?([\w.$-]+)', line)} for label, lines in blocks.items()}
    found = set()
    for label in blocks:
        seen, todo = set(), [label]
        while todo:
            for name in after[todo.pop()] - seen:
                seen.add(name)
                todo.append(name)
        if label in seen:
            found.add(label)
    return found


@pytest.mark.parametrize("shape, least, precision", CASES)
def test_hot_loops_count_no_references(compiled, shape, least, precision):
    """But on the one slow way out, where arrays are handed to a function out of line."""
    name, _, code = compiled(shape, precision)
    blocks = blocks_of(code, name)
    loops = in_loops(blocks)
    assert len(loops) > 10
    counting = [label for label in loops if any("@NRT_incref" in line for line in blocks[label])]
    assert len(counting) <= 1


def test_code_that_lost_its_vectors_or_counts_references_would_be_seen():
    scalar = "f:\n\tvmulsd\t%xmm0, %xmm1, %xmm2\n\tvfmadd213ps\t%ymm0, %ymm1, %ymm2\n\tret\n.Lfunc_end0:\n\tvaddps\t%ymm0, %ymm1, %ymm2\n"
    text = own_part(scalar, "f")
    assert (len(PACKED["x86"].findall(text)), len(SINGLE["x86"].findall(text))) == (1, 1)
    assert len(PACKED["arm"].findall("\tfmla\tv0.4s, v1.4s, v2.4s\n\tfadd\td0, d1, d2\n")) == 1
    code = ["define i32 @f(i8* %x) {", "entry:", "  br label %a", "a:", "  call void @NRT_incref(i8* %x)",
            "  br i1 %c, label %a, label %b", "b:", "  ret", "}"]
    blocks = blocks_of("\n".join(code), "f")
    assert in_loops(blocks) == {"a"} and "NRT_incref" in blocks["a"][0]
