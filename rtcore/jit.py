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
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import llvmlite
import llvmlite.binding
import numba
import numpy
import platformdirs
from numba import njit, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult, compile_result
from numba.core.runtime import _nrt_python
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
def _files() -> dict[str, str]:
    """The file of every module of rtcore."""
    found = {}
    for folder, _, names in os.walk(PACKAGE):
        package = ".".join((PACKAGE.name, *Path(folder).relative_to(PACKAGE).parts))
        for name in names:
            if name.endswith(".py"):
                found[package if name == "__init__.py" else f"{package}.{name[:-3]}"] = os.path.join(folder, name)
    return found


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


_IMPORT = re.compile(r"^[ \t]*from (rtcore[\w.]*) import ([^\n]+)", re.M)


@functools.cache
def _source(module: str) -> tuple[bytes, frozenset[str]]:
    """A hash of a module's source, and the modules of rtcore that it imports."""
    # a module of another package has kernels of a test or of a user's script
    with open(_files().get(module) or sys.modules[module].__file__, "rb") as file:
        source = file.read()
    found = set()
    for package, names in _IMPORT.findall(source.decode()):
        found.add(package)
        found.update(f"{package}.{name}" for name in re.findall(r"\w+", names))
    return hashlib.sha256(source).digest(), frozenset(found & _files().keys())


@functools.cache
def _compiler() -> bytes:
    """What makes kernels of sources: versions, and the processor."""
    return repr((numba.__version__, llvmlite.__version__, numpy.__version__, sys.version_info[:2],
                 llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten())).encode()


@functools.cache
def fingerprint(module: str) -> str:
    """A hash that changes whenever a kernel of the module might compile to something else."""
    closure, todo = set(), {module}
    while todo:
        closure |= todo
        todo = {name for m in todo for name in _source(m)[1]} - closure
    digest = hashlib.sha256(_compiler())
    for name in sorted(closure):
        digest.update(name.encode() + _source(name)[0])
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


@functools.cache
def _name_runtime() -> None:
    """Tell LLVM where the functions of numba's runtime are that kernels call. `rtsys.initialize` does that too, but takes 25 ms to compile
    what only kernels that are being compiled need; then numba calls it."""
    for name, address in _nrt_python.c_helpers.items():
        llvmlite.binding.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


class Library(JITCodeLibrary):
    """A kernel's machine code, from the cache. Its bitcode is parsed only when a kernel that is being compiled calls it: that takes longer
    than all the rest, 3 ms of a kernel's 5."""

    def __init__(self, codegen, name: str, code: bytes, bitcode: bytes):
        super().__init__(codegen, name)
        self._bitcode = bitcode
        self.enable_object_caching()
        self._set_compiled_object(code)
        self._finalize_final_module()

    def get_pointer_to_function(self, name: str) -> int:
        """The address of one of its functions. Numba would look it up among those in the bitcode first."""
        return self.codegen._engine.get_function_address(name)

    def _get_module_for_linking(self):
        if self._shared_module is None:
            self._shared_module = llvmlite.binding.parse_bitcode(self._bitcode)
        return self._shared_module


class Stored(NamedTuple):
    """What the file of a kernel and signature holds."""

    name: str
    code: bytes
    bitcode: bytes              # for kernels that call it
    descriptor: object
    signature: object
    environment: object
    environments: tuple         # of functions inlined into it, as far as its code asks for them
    initial: tuple              # functions to be called before it is

    @classmethod
    def of(cls, compiled: CompileResult) -> "Stored":
        """From what numba has compiled. It would keep the environments of all functions that were inlined, up to a hundred, for which it
        takes as long as for all the rest; but code asks for them only to make Python's objects."""
        (name, _, (code, bitcode)), descriptor, environment, signature, _, _, _, initial, environments = compiled._reduce()
        named = Counter(re.findall(r'@"?(_ZN08NumbaEnv[\w.$]+)', compiled.library.get_llvm_str()))
        used = tuple(other for other in environments if named[other.env_name] > 1)      # where it is defined, and elsewhere
        return cls(name, code, bitcode, descriptor, signature, environment, used, initial)

    def loaded(self, target) -> CompileResult:
        """Ready to be called."""
        _name_runtime()
        for function in self.initial:
            function()
        library = Library(target.codegen(), self.name, self.code, self.bitcode)
        entry_point = target.get_executable(library, self.descriptor, self.environment)
        for other in self.environments:
            target.codegen().set_env(other.env_name, other)
        return compile_result(target_context=target, typing_context=target.typing_context, library=library, fndesc=self.descriptor,
                              signature=self.signature, entry_point=entry_point, environment=self.environment,
                              referenced_envs=self.environments, reload_init=self.initial, objectmode=False, lifted=(), type_annotation="")


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
        return Stored(*pickle.loads(data)).loaded(target)

    def save_overload(self, signature, compiled) -> None:
        """Keep it, written beside and renamed; a folder that can't be written is no reason not to go on."""
        if compiled.library.has_dynamic_globals:
            raise ValueError(f"{self._function.__qualname__} refers to addresses of this process, so it can't be kept")
        path, data = self._file(signature), dumps(tuple(Stored.of(compiled)))
        beside = path.with_suffix(f".{os.getpid()}")
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            beside.write_bytes(data)
            os.replace(beside, path)


KERNELS: list = []      # of this process


def kernel(function):
    """Compile at the first call, keep the machine code on disk, release the GIL while running; division by zero is IEEE's."""
    return kept(njit(nogil=True, error_model="numpy", forceinline=False)(function), function)       # or it takes that over from a caller


def kept(made, function):
    """What numba has made of a function, known as a kernel, its machine code to be kept on disk."""
    made._cache = Cache(function)
    KERNELS.append(made)
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
