"""Kernels compiled ahead in a helper process, so that the window goes on answering while LLVM works."""
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import rtcore

HELPER = (sys.executable, "-u", "-m", "rtcore.warm")


class Compiling(NamedTuple):
    """How far the helper is: `done` of `total` kernels, and the one it compiles now."""

    done: int
    total: int
    name: str

    def __str__(self) -> str:
        name = self.name.partition(".")[0]      # without the float type
        return f"Compiling {min(self.done + 1, self.total)} of {self.total}: {name} (first run only)"


class Compiler:
    """Runs the helper and follows it. `compile` blocks its thread, `kill` from another thread ends it at once."""

    def __init__(self, helper: tuple[str, ...] = HELPER):
        self._helper = helper
        self._process: subprocess.Popen | None = None

    def compile(self, names: list[str], progress: Callable[[Compiling], None]) -> str:
        """Compile these kernels into the cache. Returns an empty string, or in one line why the helper failed."""
        places = [str(Path(rtcore.__file__).parent.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
        progress(Compiling(0, len(names), names[0]))
        try:
            process = subprocess.Popen([*self._helper, *names], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                       text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(places)})
        except OSError as error:
            return str(error)
        self._process, complaint = process, ""
        with process:
            for line in process.stdout:
                done, total, name = (line.split(maxsplit=2) + ["", "", ""])[:3]
                if done.isdigit() and total.isdigit():
                    progress(Compiling(int(done), int(total), name.strip() or names[0]))
                elif line.strip():
                    complaint = line.strip()    # the last line of a traceback says the most
        self._process = None
        if process.returncode > 0:
            return complaint or f"exit code {process.returncode}"
        return ""

    def kill(self):
        """End the helper if it runs; `compile` then returns."""
        process = self._process
        if process is not None:
            process.kill()
