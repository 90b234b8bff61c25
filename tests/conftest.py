"""What all tests share: the folder of scenes from elsewhere, hypothesis profiles, and a platform for Qt that needs no display."""
import os
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


@pytest.fixture(scope="session")
def scenes(request) -> Path:
    """The folder of ``--scenes``; the test is skipped where the option is not given."""
    folder = request.config.getoption("--scenes")
    if folder is None:
        pytest.skip("needs --scenes DIR, the folder of scenes from elsewhere")
    if not folder.is_dir():
        raise pytest.UsageError(f"--scenes {folder}: expected a folder, got none")
    return folder.resolve()
