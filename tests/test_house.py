"""The rules of the house that a program can check: small files, no trace of one machine, nothing that others wrote."""
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = sorted(path for folder in ("rtcore", "app", "resources", "tests") for path in (ROOT / folder).rglob("*.py"))
MOST_LINES, WIDEST = 400, 140

# Spelt in pieces, so that this file does not hold what it looks for.
FOLDERS = "|".join(["ho" + "me", "ro" + "ot", "wo" + "rk", "op" + "t", "Us" + "ers", "mn" + "t", "sr" + "v"])
OF_A_MACHINE = re.compile(rf"(?<![\w.~/-])/(?:{FOLDERS})/[\w.-]")
TOP_LEVEL = {".ci", ".gitignore", "CHANGELOG.md", "LICENSE", "README.md", "app", "pyproject.toml", "resources", "rtcore", "tests"}


def tracked() -> list[Path]:
    """Files that git tracks; the test is skipped outside a checkout."""
    try:
        listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listing.split("\0") if name and (ROOT / name).is_file()]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_are_small_and_lines_short(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= MOST_LINES
    assert [i for i, line in enumerate(lines, 1) if len(line) > WIDEST] == []


def test_no_file_names_a_place_on_one_machine():
    found = []
    for path in tracked():
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue    # a picture or the like
        found += [f"{path.relative_to(ROOT)}:{i}" for i, line in enumerate(text.splitlines(), 1) if OF_A_MACHINE.search(line)]
    assert not found


def test_the_top_level_holds_what_the_design_says():
    assert {path.relative_to(ROOT).parts[0] for path in tracked()} <= TOP_LEVEL


def test_scenes_and_meshes_are_all_our_own(scenes):
    theirs = {path.read_bytes() for path in scenes.rglob("*") if path.is_file() and path.stat().st_size}
    assert [str(path.relative_to(ROOT)) for path in tracked() if path.read_bytes() in theirs] == []


def test_a_line_that_names_a_machine_would_be_found():
    assert OF_A_MACHINE.search('open("/' + 'home/someone/scene.yaml")')
    assert not OF_A_MACHINE.search("https://example.org/" + "home/page and scenes/" + "work/x")
