"""What the tests of the command line share: a small scene, and ways to run a command line."""
import os
import subprocess
import sys
from pathlib import Path

from PIL import Image

from app import __main__ as cli

ROOT = Path(__file__).parent.parent
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}
BALL = """\
rayscope: 1
name: a ball
camera: {lookfrom: [0, 0, -5], lookat: [0, 0, 0]}
lights: [{directional: {direction: [0, -1, 1]}}]
scene:
  - sphere: {center: [0, 0, 0], radius: 1}
  - plane: {point: [0, -1, 0], normal: [0, 1, 0]}
"""



def ball_in(folder: Path) -> Path:
    """A small scene in that folder."""
    path = folder / "ball.yaml"
    path.write_text(BALL)
    return path


def run_here(capsys, words) -> tuple[int, str, str]:
    """Run a command line in this process. Returns exit code, stdout and stderr, which holds no traceback."""
    code = cli.main([str(word) for word in words])
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return code, out, err


def process(*words, **options) -> subprocess.Popen:
    """Start a command line in a process of its own."""
    return subprocess.Popen([sys.executable, "-m", "app", *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            env=ENVIRONMENT, **options)


def picture(path) -> Image.Image:
    """A picture with all its pixels and text in memory, its file closed."""
    with Image.open(path) as found:
        found.load()
        return found


def one_line(err: str) -> bool:
    return err.count("\n") == 1 and err.endswith("\n") and err.startswith("rayscope")
