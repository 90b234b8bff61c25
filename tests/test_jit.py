"""The cache of compiled kernels: a file a kernel and signature, read without setting up the compiler, right when two processes write."""
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rtcore.jit import kernel

ROOT = Path(__file__).parent.parent

#: A module with a kernel; in a process of its own, since a dispatcher keeps what it has loaded.
MODULE = """
import sys
import numpy as np
from rtcore.jit import kernel

@kernel
def add(a, b):
    total = a[0]
    for i in range(len(a)):
        total += a[i] * b[i]
    return total
"""
CALL = "import numpy as np, numbers_of_mine as m, sys\nx = m.add(np.arange(4, dtype={dtype}), np.ones(4, {dtype}))\nassert x == 6\n"
SAY = "print(sum(m.add.stats.cache_hits.values()), sum(m.add.stats.cache_misses.values()), 'numba.cpython.unicode' in sys.modules)\n"


@pytest.fixture
def start(tmp_path):
    """Starts Python with the module and an empty cache of its own."""
    (tmp_path / "numbers_of_mine.py").write_text(MODULE)
    env = {**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), str(tmp_path))), "RAYSCOPE_CACHE": str(tmp_path / "cache")}
    return lambda code: subprocess.Popen([sys.executable, "-c", code], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def result(process) -> str:
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out.strip()


def test_what_was_compiled_is_read_without_the_compiler(start):
    code = CALL.format(dtype="np.float64") + SAY
    assert result(start(code)) == "0 1 True"
    assert result(start(code)) == "1 0 False"


def test_processes_that_compile_at_once_lose_nothing(start, tmp_path):
    types = ["np.float32", "np.float64"]
    for process in [start(CALL.format(dtype=dtype)) for dtype in types * 2]:
        result(process)
    assert len(list((tmp_path / "cache").rglob("*.kernel"))) == len(types)
    assert [path for path in (tmp_path / "cache").rglob("*") if path.is_file() and path.suffix != ".kernel"] == []
    for dtype in types:
        assert result(start(CALL.format(dtype=dtype) + SAY)) == "1 0 False"


def test_an_edit_compiles_anew(start, tmp_path):
    result(start(CALL.format(dtype="np.float64")))
    module = tmp_path / "numbers_of_mine.py"
    module.write_text(module.read_text().replace("* b[i]", "+ b[i]"))
    again = start(CALL.format(dtype="np.float64"))
    assert "AssertionError" in again.communicate(timeout=120)[1]


#: A kernel and one that calls it, which makes arrays and can raise.
CALLER = """
from numbers_of_mine import add

@kernel
def twice(a, b):
    if len(a) != len(b):
        raise ValueError(("of", len(a), "and", len(b)))
    return 2 * add(a, b.copy())
"""


def test_a_kernel_from_the_cache_is_linked_into_one_that_is_compiled(start, tmp_path):
    result(start(CALL.format(dtype="np.float64")))      # the cache has `add` alone
    (tmp_path / "callers.py").write_text("from rtcore.jit import kernel\n" + CALLER)
    code = """import callers, numbers_of_mine as m, numpy as np
assert callers.twice(np.arange(4.0), np.ones(4)) == 12
try:
    callers.twice(np.ones(3), np.ones(4))
except ValueError as error:
    print(*error.args[0])
print([(sum(k.stats.cache_hits.values()), sum(k.stats.cache_misses.values())) for k in (m.add, callers.twice)])
assert m.add(np.arange(4.0), np.ones(4)) == 6
"""
    assert result(start(code)).splitlines() == ["of 3 and 4", "[(1, 0), (0, 1)]"]
    assert result(start(code)).splitlines() == ["of 3 and 4", "[(0, 0), (1, 0)]"]       # all that it calls is in it


def test_bitcode_is_parsed_only_where_a_kernel_is_compiled(start):
    code = ("import llvmlite.binding\nllvmlite.binding.parse_bitcode = None\n" + CALL.format(dtype="np.float64")
            + "from numba.core.runtime import rtsys\nprint(rtsys._init)")
    result(start(CALL.format(dtype="np.float64")))
    assert result(start(code)) == "False"


def test_a_folder_that_cannot_be_written_only_costs_time(start, tmp_path):
    (tmp_path / "cache" / "kernels").mkdir(parents=True)
    code = ("import numbers_of_mine as m\nm.add._cache.folder.write_text('in the way')\n"
            + CALL.format(dtype="np.float64"))
    result(start(code))


def test_a_kernel_knows_nothing_around_it():
    outside = 3.0

    def inner(x):
        return x + outside

    with pytest.raises(TypeError, match="depends on variables around it"):
        kernel(inner)
