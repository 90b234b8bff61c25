"""What the commands share: usage errors in one line, checked arguments, scenes loaded, kernels compiled."""
import argparse
import contextlib
import os
import sys
import time
from typing import Any, NoReturn

from app.commands._progress import Progress

#: Field of `rtcore.settings.Settings` -> the option that sets it, where the names differ.
OPTIONS = {"samples": "spp", "seconds": "time", "max_depth": "max-depth"}


BYTES_A_PIXEL = 140     # of the film, a frame made from it, and the choice of further samples; 100 where one sample is all


class Refused(Exception):
    """The work ends here: a message of one line, and the exit code."""

    def __init__(self, message: object, code: int):
        super().__init__(" ".join(str(message).split()))
        self.code = code


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line."""

    def __init__(self, **words):
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False, **words)

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {' '.join(message.split())} (see {self.prog} --help)\n")


def say(message: str) -> None:
    """One line on stderr."""
    with contextlib.suppress(BrokenPipeError):
        print(f"rayscope: {message}", file=sys.stderr, flush=True)


def whole(text: str) -> int:
    """argparse type: a whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a whole number, got {text!r}") from None


def real(text: str) -> float:
    """argparse type: a number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}") from None


def size(text: str) -> tuple[int, int]:
    """argparse type: ``640x480``."""
    width, mark, height = text.lower().partition("x")
    if not (mark and width.isdecimal() and height.isdecimal() and len(width) < 9 and len(height) < 9):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT such as 640x480, got {text!r}")
    if not (1 <= int(width) <= 16384 and 1 <= int(height) <= 16384):
        raise argparse.ArgumentTypeError(f"expected a width and a height from 1 to 16384, got {text!r}")
    return int(width), int(height)


def settings_from(parser: Parser, **fields: Any):
    """`Settings` from those fields that are not None; what they refuse is a usage error of the option."""
    from rtcore.fields import FieldError
    from rtcore.settings import Settings
    try:
        return Settings(**{name: value for name, value in fields.items() if value is not None})
    except FieldError as error:
        name = error.path.partition("[")[0].partition(".")[0]
        parser.error(f"argument --{OPTIONS.get(name, name)}: {FieldError(error.expected, error.got)}")


def loaded(path: str) -> tuple[Any, float]:
    """The scene in a file and the seconds that took; Refused with exit code 2 if it can't be taken."""
    import rtcore
    start = time.perf_counter()
    try:
        return rtcore.load(path), time.perf_counter() - start
    except rtcore.FileError as error:
        raise Refused(error, 2) from None


@contextlib.contextmanager
def refusing(path: str):
    """What the renderer finds wrong with the scene is the file's fault: Refused with exit code 2."""
    from rtcore.fields import FieldError
    try:
        yield
    except FieldError as error:
        raise Refused(f"{path}: {error}", 2) from None


def writable_or_refused(path: str | None) -> None:
    """Refused with exit code 2 if a result plainly can't be written there; asked before the work begins."""
    from rtcore.files import WriteError, writable
    if path is not None:
        try:
            writable(path)
        except WriteError as error:
            raise Refused(error, 2) from None


def write_json(path: str, data: Any) -> None:
    """Write a result as JSON; the old file is intact until the new one is complete. Refused with exit code 1 if that fails."""
    import json

    from rtcore.files import WriteError, write_file
    try:
        write_file(path, json.dumps(data, indent=1).encode() + b"\n")
    except WriteError as error:
        raise Refused(error, 1) from None


def compile_missing(names: list[str], title: str = "compiling {} kernels, first run only") -> None:
    """Compile these groups of kernels into the cache, with progress, on all cores."""
    if not names:
        return
    from app.compiling import Compiler
    with Progress(title.format(len(names))) as bar:
        complaint = Compiler().compile(names, lambda state: bar.show(state.done / state.total, state.words))
    if complaint:
        from rtcore.warm import compile_kernels
        say(f"helpers could not compile ({complaint}); going on without them")
        compile_kernels(names)


def enough_memory(width: int, height: int) -> None:
    """Refused with exit code 1 if a picture of that size can't be held: the system would end the process without a word."""
    need, there = width * height * BYTES_A_PIXEL, memory()
    if there is not None and need > there:
        need, there = need / 2**30, there / 2**30
        raise Refused(f"a picture of {width} x {height} needs about {need:.1f} GiB of memory, and there are {there:.1f} GiB", 1)


def memory() -> int | None:
    """Bytes that this process may hold at most: the machine's, or what a control group allows; None where neither is told."""
    limits = []
    with contextlib.suppress(AttributeError, ValueError, OSError):
        limits.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    for limit in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        with contextlib.suppress(OSError, ValueError), open(limit) as file:
            limits.append(int(file.read()))
    return min((limit for limit in limits if limit > 0), default=None)


def same_file(a: str | None, b: str | None) -> bool:
    """Whether two names are of one file, there or not."""
    return a is not None and b is not None and os.path.realpath(a) == os.path.realpath(b)
