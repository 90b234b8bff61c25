"""The rivals: whether each is installed, which version it is, and how it is run.

POV-Ray and Tachyon are programs, asked for the trace time that they report themselves. Embree and Mitsuba are Python packages, used by a
helper process each, which does its work once for every line that it is sent and answers with the seconds.
"""
import contextlib
import importlib.metadata
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from PIL import Image

from rtcore.reports.bench.timing import RivalFailed

PATIENCE = 600      # seconds that one run may take
DEPTH = 5


class Rival(NamedTuple):
    """A program to compare with: its name for people, what to install, its version or None where it is not there."""

    title: str
    install: str
    version: Callable[[], str | None]


def _program(name: str, option: str, pattern: str) -> Callable[[], str | None]:
    """The version that a program tells of itself."""
    def version() -> str | None:
        if shutil.which(name) is None:
            return None
        said = subprocess.run([name, option], capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL)
        found = re.search(pattern, said.stdout + said.stderr)
        return found[1] if found else "of an unknown version"
    return version


def _package(name: str) -> Callable[[], str | None]:
    return lambda: importlib.metadata.version(name) if importlib.util.find_spec(name) else None


RIVALS = {
    "povray": Rival("POV-Ray", "Debian's package povray", _program("povray", "--version", r"POV-Ray (\S+)")),
    "tachyon": Rival("Tachyon", "Debian's package tachyon", _program("tachyon", "-version", r"^([\d.]+)")),
    "embree": Rival("Embree", "pip install embreex", _package("embreex")),
    "mitsuba": Rival("Mitsuba", "pip install mitsuba", _package("mitsuba")),
}


def povray_seconds(scene: Path, size: tuple[int, int], threads: int) -> float:
    """Trace time of POV-Ray for a .pov file, without antialiasing."""
    said = _said(["povray", f"+I{scene}", f"+O{scene}.png", f"+W{size[0]}", f"+H{size[1]}", "-D", "-A", f"+WT{threads}"], scene.parent)
    found = re.findall(r"Trace Time:.*?\(([\d.]+) seconds\)", said)
    if not found:
        raise RivalFailed(f"told no trace time: {_last_line(said)}")
    return float(found[-1])


def tachyon_seconds(scene: Path, size: tuple[int, int], threads: int, folder: Path) -> float:
    """Ray-tracing time of Tachyon for an .nff file."""
    picture = folder / "tachyon.tga"
    said = _said(["tachyon", str(scene), "-res", str(size[0]), str(size[1]), "-raydepth", str(DEPTH), "-numthreads", str(threads),
                  "+V", "-o", str(picture)], folder)
    found = re.findall(r"Ray Tracing Time:\s*([\d.]+) seconds", said)
    if not found:
        raise RivalFailed(f"told no ray-tracing time: {_last_line(said)}")
    with Image.open(picture) as image:
        if all(low == high for low, high in image.convert("RGB").getextrema()):
            raise RivalFailed("it drew nothing, a picture of one colour")       # of gears.nff, for one
    return float(found[-1])


def _said(command: list[str], folder: Path) -> str:
    """What a program writes; RivalFailed if it fails."""
    try:
        ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL,
                             timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        raise RivalFailed(f"took longer than {PATIENCE} s") from None
    if ran.returncode:
        raise RivalFailed(f"ended with code {ran.returncode}: {_last_line(ran.stdout + ran.stderr)}")
    return ran.stdout + ran.stderr


def _last_line(text: str) -> str:
    lines = [line.strip() for line in re.split(r"[\r\n]+", text) if line.strip()]
    return lines[-1][:200] if lines else "it said nothing"


class Helper:
    """A module of ours in a process of its own, which answers each line with a number. A rival that crashes there harms nobody else."""

    def __init__(self, module: str, *words: object):
        self._errors = tempfile.TemporaryFile("w+", errors="replace")  # noqa: SIM115 -- closed by `close`
        self._process = subprocess.Popen([sys.executable, "-P", "-m", module, *map(str, words)], stdin=subprocess.PIPE,
                                         stdout=subprocess.PIPE, stderr=self._errors, text=True, env=environment())

    def ask(self, line: str) -> float:
        """What it answers; RivalFailed, with the last thing it said, if it has ended."""
        try:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
            return float(self._process.stdout.readline())
        except (OSError, ValueError):
            self._process.wait(PATIENCE)
            self._errors.seek(0)
            raise RivalFailed(f"ended with code {self._process.returncode}: {_last_line(self._errors.read())}") from None

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._errors):
            with contextlib.suppress(OSError):
                stream.close()


def environment() -> dict[str, str]:
    """The environment in which a Python of its own finds the same modules as this one."""
    root = str(Path(__file__).parents[3])
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))}
