"""The window under random doings with the real renderer, for some seconds; for RAYSCOPE_SOAK seconds where that is set."""
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SECONDS = float(os.environ.get("RAYSCOPE_SOAK", "8"))


@pytest.mark.alone
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads what Linux tells of a thread's time")
@pytest.mark.timeout(SECONDS + 580)
def test_the_window_answers_whatever_is_done(tmp_path):
    short = ["--scene", "whitted", "--allow", "40"] if "RAYSCOPE_SOAK" not in os.environ else []
    command = [sys.executable, str(HERE / "soak.py"), "--seconds", str(SECONDS), "-o", str(tmp_path), *short]
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS + 560)
    assert done.returncode == 0, done.stdout + done.stderr + (tmp_path / "stalls.txt").read_text()
