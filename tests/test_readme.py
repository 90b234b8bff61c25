"""What the README says is so: its commands, its keys, its example."""
import re
from pathlib import Path

import rtcore
from app.actions import ACTIONS
from app.commands import COMMANDS, command
from app.commands._shared import Parser

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_it_has_one_command_to_start_and_one_to_test():
    lines = [line.strip() for line in README.splitlines() if "python3 -m venv" in line]
    start, test = (line for line in lines if line.startswith("python3"))
    assert start.endswith(".venv/bin/rayscope") and test.endswith(".venv/bin/python -m pytest")
    pattern = re.search(r"grep -E '(.*)' README.md", (ROOT / ".ci" / "run").read_text(encoding="utf-8"))[1]
    assert [line.strip() for line in README.splitlines() if re.search(pattern, line)] == [test]     # and CI runs just that


def test_its_keys_are_those_of_the_window():
    keys = {action.shortcut for action in ACTIONS} - {""}
    table = README[README.index("| do | with |"):README.index("Every number")]
    named = set(re.findall(r"(?:(?:Ctrl|Alt|Shift)\+)+(?:\w+|\.)|\bF\d+\b|\bHome\b", table))
    assert len(named) > 10 and named <= keys


def test_its_commands_and_options_exist():
    section = README[README.index("## The command line"):README.index("As a library")]
    assert set(re.findall(r"^    rayscope (\w+)", section, re.MULTILINE)) == set(COMMANDS)
    offered = set()
    for name in COMMANDS:
        parser = Parser()
        command(name).arguments(parser)
        offered |= set(re.findall(r"--[\w-]+", parser.format_help()))
    assert set(re.findall(r"--[\w-]+", section)) <= offered


def test_its_example_is_a_sound_scene(tmp_path):
    (tmp_path / "example.yaml").write_text(re.search(r"```yaml\n(.*?)```", README, re.DOTALL)[1], encoding="utf-8")
    scene = rtcore.load(tmp_path / "example.yaml")
    assert [type(leaf.shape).__name__ for leaf in scene.leaves()] == ["Plane", "Sphere", "Sphere"]
    assert rtcore.render(scene, size=(32, 24)).stats["rays"]["primary_hits"] > 100


def test_its_links_lead_somewhere():
    targets = set(re.findall(r"\]\(([^)#]+)\)", README))
    assert targets and [target for target in targets if not (ROOT / target).is_file()] == []
