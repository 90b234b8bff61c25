"""The one kernel decorator, and the folder where compiled kernels are kept.

numba's own on-disk cache notices an edit only in the file of the kernel itself, not in the files it calls into; two processes that
compile for one kernel at a time can lose or mix up what they write; and reading it sets up the whole compiler first. So kernels are kept
by `Cache`. Every module gets a folder named by a hash of its own source, of all rtcore sources it imports, and of the compiler and
processor: a kernel can never be stale, and an edit to one shape recompiles that shape alone.

No fast-math flags anywhere: sums are contracted where a kernel says `fma` and nowhere else, so that a formula has the same
bits wherever it is inlined. That is what makes a picture independent of tiles, packets and threads.
"""
import contextlib
import functools
import hashlib
import os
import pickle
import re
import shutil
import sys
import tempfile
import time
from pathlib import Path

import llvmlite
import llvmlite.binding
import numba
import numpy
import platformdirs
from numba import njit, types
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.extending import intrinsic

PACKAGE = Path(__file__).parent
KEEP_DAYS = 30


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return os.access(folder, os.W_OK)
    except OSError:
        return False


@functools.cache
def cache_root() -> Path:
    """Where compiled kernels are kept: $RAYSCOPE_CACHE, the user's cache folder, or a temporary one if that can't be written."""
    wanted = Path(os.environ.get("RAYSCOPE_CACHE") or platformdirs.user_cache_path("rayscope", appauthor=False)) / "kernels"
    return wanted if _writable(wanted) else Path(tempfile.mkdtemp(prefix="rayscope-kernels-"))


@functools.cache
def _source(module: str) -> Path | None:
    if module.split(".")[0] != PACKAGE.name:
        return Path(sys.modules[module].__file__)      # a kernel of a test or of a user's script
    path = PACKAGE.parent.joinpath(*module.split("."))
    return next((p for p in (path.with_suffix(".py"), path / "__init__.py") if p.is_file()), None)


_TYPES: dict = {}       # numba's types of arguments, by `_kind_of`


def _kind_of(value):
    """What the numba type of a kernel's argument depends on."""
    if isinstance(value, numpy.ndarray):
        return value.dtype.char, value.ndim, value.flags.c_contiguous, value.flags.writeable
    return (type(value), *map(_kind_of, value)) if isinstance(value, tuple) else type(value)


def typed(value) -> types.Type:
    """numba's type of a kernel's argument: an array, a number, or a NamedTuple of such. Numba itself takes 0.3 ms for a wave."""
    kind = _kind_of(value)
    if kind not in _TYPES:
        _TYPES[kind] = numba.typeof(value)
    return _TYPES[kind]


@functools.cache
def _imports(module: str) -> frozenset[str]:
    """The rtcore modules that a module's source imports, itself included."""
    found = {module}
    for package, names in re.findall(r"^\s*from (rtcore[\w.]*) import ([^\n]+)", _source(module).read_text("utf-8"), re.M):
        found.add(package)
        found.update(f"{package}.{name}" for name in re.findall(r"\w+", names))
    return frozenset(name for name in found if _source(name))


@functools.cache
def fingerprint(module: str) -> str:
    """A hash that changes whenever a kernel of the module might compile to something else."""
    closure, todo = set(), {module}
    while todo:
        closure |= todo
        todo = {name for m in todo for name in _imports(m)} - closure
    digest = hashlib.sha256(repr((numba.__version__, llvmlite.__version__, numpy.__version__, sys.version_info[:2],
                                  llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten())).encode())
    for name in sorted(closure):
        digest.update(name.encode() + _source(name).read_bytes())
    return digest.hexdigest()[:16]


def cache_folder(module: str) -> Path:
    """The cache folder of one module's kernels."""
    return cache_root() / f"{module.removeprefix('rtcore.')}-{fingerprint(module)}"


def prune() -> None:
    """Remove kernel folders that no process has used for a month."""
    for folder in cache_root().iterdir():
        with contextlib.suppress(OSError):      # another process was quicker
            if time.time() - folder.stat().st_mtime > KEEP_DAYS * 86400:
                shutil.rmtree(folder, ignore_errors=True)


class Cache:
    """Where a dispatcher of numba's looks for compiled code and leaves it: a file a kernel and signature."""

    def __init__(self, function):
        if function.__closure__:
            raise TypeError(f"{function.__qualname__}: a kernel that depends on variables around it can't be told from others on disk")
        self._function = function

    @functools.cached_property
    def folder(self) -> Path:
        """Worked out only once it is asked for: of most kernels a process never asks. It is marked as used, see `prune`."""
        folder = cache_folder(self._function.__module__)
        with contextlib.suppress(OSError):
            os.utime(folder)
        return folder

    @property
    def cache_path(self) -> str:
        """The folder, as numba's statistics name it."""
        return str(self.folder)

    def _file(self, signature) -> Path:
        name = f"{self._function.__name__}-{self._function.__code__.co_firstlineno}"
        return self.folder / f"{name}-{hashlib.sha256(str(signature).encode()).hexdigest()[:16]}.kernel"

    def load_overload(self, signature, target):
        """The compiled code for a signature, or None. The compiler is not set up for it, which would take 0.2 s: `compile` does that."""
        try:
            data = self._file(signature).read_bytes()
        except OSError:
            return None
        rtsys.initialize(target)        # what code calls that counts references
        return CompileResult._rebuild(target, *pickle.loads(data))

    def save_overload(self, signature, compiled) -> None:
        """Keep it, written beside and renamed; a folder that can't be written is no reason not to go on."""
        if compiled.library.has_dynamic_globals:
            raise ValueError(f"{self._function.__qualname__} refers to addresses of this process, so it can't be kept")
        path, data = self._file(signature), dumps(compiled._reduce())
        beside = path.with_suffix(f".{os.getpid()}")
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            beside.write_bytes(data)
            os.replace(beside, path)


def kernel(function):
    """Compile at the first call, keep the machine code on disk, release the GIL while running; division by zero is IEEE's."""
    made = njit(nogil=True, error_model="numpy", forceinline=False)(function)       # or it takes that over from a caller
    made._cache = Cache(function)
    return made


#: For the small functions that kernels are made of: always inlined, never cached on their own. They count no references (`_nrt`): numba
#: would increment and decrement an atomic counter for every array that a function with branches is given, 5 ns each and two thirds of
#: the time of a walk through a tree. So they can't make arrays, nor return any.
inline = njit(nogil=True, error_model="numpy", forceinline=True, _nrt=False)

#: The same for functions that make arrays.
inline_new = njit(nogil=True, error_model="numpy", forceinline=True)


@intrinsic
def out_of_line(typing_context):
    """Called in a kernel: it is never inlined. For slow ways out, whose code in the midst of a hot loop costs it half its speed."""
    def mark(context, builder, signature, arguments):
        builder.function.attributes.add("noinline")
        builder.function.attributes.add("cold")
        return context.get_dummy_value()
    return types.void(), mark
