"""What all tests share: the folder of scenes from elsewhere, hypothesis profiles, a platform for Qt that needs no display, and turns: the
whole suite runs on all processors, tests marked `alone` while no other does."""
import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

try:
    import fcntl
except ImportError:     # Windows, where the suite runs in one process
    fcntl = None

ROOT = Path(__file__).parent.parent
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")   # before Qt is imported; a test of the real window sets its own

hypothesis.settings.register_profile("default", deadline=None)
hypothesis.settings.register_profile("ci", deadline=None, derandomize=True)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "default")


def pytest_addoption(parser):
    parser.addoption("--scenes", metavar="DIR", type=Path, default=None,
                     help="folder of scenes from elsewhere (spd/, spd-small/, meshes/); without it, tests that need them are skipped")


def pytest_configure(config):
    config.addinivalue_line("markers", "alone: measures time or drives a real window, so nothing else may run meanwhile")


def pytest_xdist_auto_num_workers(config) -> int:
    """One process for each processor, eight at most, if it is the whole suite; who names tests sees them run in this process."""
    if config.args_source is not pytest.Config.ArgsSource.TESTPATHS or fcntl is None:
        return 0
    return min(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1, 8)


@contextlib.contextmanager
def turn(alone: bool) -> Iterator[None]:
    """While this lasts no other process that tests this checkout has a turn alone; with `alone` none has any."""
    if fcntl is None:
        yield
        return
    with open(__file__) as line, open(ROOT / "pyproject.toml") as floor:        # only to be locked
        fcntl.flock(line, fcntl.LOCK_EX)        # in the order of asking: who waits to be alone is not passed by
        fcntl.flock(floor, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        fcntl.flock(line, fcntl.LOCK_UN)
        yield


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    with turn(item.get_closest_marker("alone") is not None):
        return (yield)


def pytest_collection_finish(session):
    """The whole suite needs every kernel: compiled by as many processes as there are processors, they take half the time."""
    if len(session.items) > 2000 and not session.config.option.collectonly:
        with turn(alone=True):
            subprocess.run([sys.executable, "-m", "app", "warm"], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                           check=True, timeout=400)


@pytest.fixture(scope="session")
def scenes(request) -> Path:
    """The folder of ``--scenes``; the test is skipped where the option is not given."""
    folder = request.config.getoption("--scenes")
    if folder is None:
        pytest.skip("needs --scenes DIR, the folder of scenes from elsewhere")
    if not folder.is_dir():
        raise pytest.UsageError(f"--scenes {folder}: expected a folder, got none")
    return folder.resolve()


@pytest.fixture
def scene(tmp_path, monkeypatch) -> Path:
    """A small scene in the current folder."""
    from commandline import ball_in
    monkeypatch.chdir(tmp_path)
    return ball_in(tmp_path)


@pytest.fixture
def run(capsys):
    """Runs a command line in this process: exit code, stdout, stderr."""
    from commandline import run_here
    return lambda *words: run_here(capsys, words)
