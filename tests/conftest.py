"""What all tests share: the folder of scenes from elsewhere, hypothesis profiles, and a platform for Qt that needs no display."""
import os
import subprocess
import sys
from pathlib import Path

import hypothesis
import pytest

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")   # before Qt is imported; a test of the real window sets its own

hypothesis.settings.register_profile("default", deadline=None)
hypothesis.settings.register_profile("ci", deadline=None, derandomize=True)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "default")


def pytest_addoption(parser):
    parser.addoption("--scenes", metavar="DIR", type=Path, default=None,
                     help="folder of scenes from elsewhere (spd/, spd-small/, meshes/); without it, tests that need them are skipped")


def pytest_collection_finish(session):
    """The whole suite needs every kernel: compiled by as many processes as there are processors, they take half the time."""
    if len(session.items) > 2000 and not session.config.option.collectonly:
        root = Path(__file__).parent.parent
        subprocess.run([sys.executable, "-m", "app", "warm"], cwd=root, stderr=subprocess.DEVNULL, check=True, timeout=280)


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
