"""Kernels compiled ahead in helper processes, one per core, so that the window goes on answering while LLVM works."""
import contextlib
import itertools
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import rtcore

HELPER = (sys.executable, "-u", "-m", "rtcore.warm", "-")


class Compiling(NamedTuple):
    """How far the helpers are: `done` of `total` kernels, and those that they compile now."""

    done: int
    total: int
    names: tuple[str, ...]

    @property
    def words(self) -> str:
        """What is being compiled: "sphere, torus"."""
        return ", ".join(dict.fromkeys(name.partition(".")[0] for name in self.names))      # without the float type

    def __str__(self) -> str:
        return f"Compiling {min(self.done + 1, self.total)} of {self.total}: {self.words} (first run only)"


class Compiler:
    """Runs the helpers and follows them. `compile` blocks its thread, `kill` from another thread ends them at once."""

    def __init__(self, helper: tuple[str, ...] = HELPER, processes: int | None = None):
        self._helper, self._count = helper, processes
        self._processes: list[subprocess.Popen] = []
        self._killed = False

    def compile(self, names: list[str], progress: Callable[[Compiling], None]) -> str:
        """Compile these kernels into the cache, each helper taking the next one as soon as it is free, from one end of the queue or the
        other. `progress` is called by one thread at a time. Returns an empty string, or in one line why a helper failed."""
        from rtcore.progressive import cores
        from rtcore.warm import queue, worth_sharing
        todo, working, lock = deque(queue(names)), [], threading.Lock()

        def follow(process: subprocess.Popen, front: bool) -> str:
            """Give a helper one kernel after another; why it failed, if it did."""
            name = None
            while True:
                with lock:
                    if name is not None:
                        working.remove(name)
                    name = None
                    if todo and (front or worth_sharing(todo)):
                        name = todo.popleft() if front else todo.pop()
                    if name is not None:
                        working.append(name)
                    if working:
                        progress(Compiling(len(names) - len(todo) - len(working), len(names), tuple(working)))
                if name is None:
                    return ""
                if complaint := ask(process, name):
                    todo.clear()
                    return complaint

        self._killed = False
        try:
            self._processes = [self._start() for _ in range(min(self._count or cores(), len(names)))]
            with ThreadPoolExecutor(len(self._processes), "compiling") as pool:
                complaints = list(pool.map(follow, self._processes, itertools.cycle((True, False))))
        except OSError as error:
            complaints = [str(error)]
        finally:
            for process in self._processes:
                process.kill()      # it has nothing left to do, or the work was broken off
                with process:       # waits for it, closes the pipes
                    pass
            self._processes = []
        return "" if self._killed else "; ".join(dict.fromkeys(filter(None, complaints)))

    def _start(self) -> subprocess.Popen:
        places = [str(Path(rtcore.__file__).parent.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
        return subprocess.Popen(self._helper, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                env={**os.environ, "PYTHONPATH": os.pathsep.join(places)})

    def kill(self):
        """End the helpers if they run; `compile` then returns."""
        self._killed = True
        for process in self._processes:
            process.kill()


def ask(process: subprocess.Popen, name: str) -> str:
    """Have a helper compile a kernel; an empty string, or why it could not."""
    with contextlib.suppress(OSError):      # if it has ended, its last words are still to be read
        process.stdin.write(f"{name}\n")
        process.stdin.flush()
    last = ""
    for line in map(str.strip, process.stdout):
        if line == name:
            return ""
        last = line or last     # the last line of a traceback says the most
    return last or f"exit code {process.wait()}"
