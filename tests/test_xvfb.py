"""The real window, driven by mouse and keyboard on a display of its own."""
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent / "xvfb"
sys.path.insert(0, str(HERE))

from display import missing_tools  # noqa: E402


@pytest.mark.alone
@pytest.mark.skipif(bool(missing_tools()), reason=f"not installed: {', '.join(missing_tools())}")
@pytest.mark.timeout(900)
def test_the_window_is_driven_for_real(tmp_path):
    done = subprocess.run([sys.executable, str(HERE / "drive.py"), "-o", str(tmp_path)], capture_output=True, text=True, timeout=880)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.alone
@pytest.mark.skipif(bool(missing_tools()), reason=f"not installed: {', '.join(missing_tools())}")
@pytest.mark.timeout(900)
def test_a_picture_of_the_new_view_is_on_the_screen_in_time(tmp_path):
    command = [sys.executable, str(HERE / "deadlines.py"), "-o", str(tmp_path), "--allow", "150"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=880)
    assert done.returncode == 0, done.stdout + done.stderr
