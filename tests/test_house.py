"""The rules of the house that a program can check: small files, no trace of one machine, nothing that others wrote."""
import os
import re
import subprocess
import sys
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


def test_the_installed_command_works_from_anywhere(tmp_path):
    command = Path(sys.executable).with_name("rayscope")
    if not command.exists():
        pytest.skip("rayscope is not installed beside this Python")
    ran = subprocess.run([command, "--version"], cwd=tmp_path, capture_output=True, text=True, timeout=120,
                         env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"})
    assert (ran.returncode, ran.stdout.split()[0], ran.stderr) == (0, "rayscope", "")


def test_every_folder_of_modules_is_a_package():
    """A folder without __init__.py would be a namespace, which any other package of that name on the path hides."""
    folders = {path.parent for path in SOURCES if path.relative_to(ROOT).parts[0] != "tests"}
    assert [str(folder.relative_to(ROOT)) for folder in folders if not (folder / "__init__.py").is_file()] == []
