"""Preferences that nothing can spoil, the table of actions, and small functions around them."""
from pathlib import Path

import pytest
from PySide6.QtCore import QByteArray, QSettings

from app.actions import ACTIONS, MENUS, TOOLBAR
from app.entry import number_text, parsed, step_of
from app.gui import missing_packages
from app.panels import PANELS
from app.settings import Preferences
from app.status import elapsed_text
from app.window import Window


def test_the_tables_agree():
    ids = [action.id for action in ACTIONS]
    assert len(set(ids)) == len(ids)
    assert len({a.shortcut for a in ACTIONS if a.shortcut}) == sum(bool(a.shortcut) for a in ACTIONS)
    named = {name for _, names in MENUS for name in names} | set(TOOLBAR)
    assert {name for name in named if name and not name.startswith("<")} <= set(ids)
    assert set(ids) <= named
    icons = Path(__file__).parents[2] / "resources" / "icons"
    assert all((icons / f"{a.icon}.svg").exists() for a in ACTIONS if a.icon)
    fixed = {"rayscope", "check-dark", "check-light", "chevron-down", "chevron-right", "dock-close", "dock-float"}
    assert all(path.stem in fixed or "currentColor" in path.read_text() for path in icons.glob("*.svg"))


@pytest.mark.parametrize("content", [
    b"", b"\0\xff\xfe garbage", b"[General]\nversion=99\ngeometry=@ByteArray(x)\ndocks=@ByteArray(y)\n",
    b"[General]\nversion=1\ngeometry=@Variant(\\0\\0\\0)\ndocks=7\nrecent=@Invalid()\ntheme=purple\n"])
def test_preferences_survive_corruption(tmp_path, content):
    path = tmp_path / "window.ini"
    path.write_bytes(content)
    preferences = Preferences(QSettings(str(path), QSettings.Format.IniFormat))
    assert preferences.theme == "system" and preferences.recent == [] and preferences.layout is None
    preferences.theme = "dark"
    assert preferences.theme == "dark"


def test_a_layout_that_is_no_layout_does_not_matter(qtbot, session, preferences):
    preferences.layout = QByteArray(b"not a geometry"), QByteArray(b"nor a state")
    window = Window(session, preferences)
    window.show()
    assert [name for name, dock in window.docks.items() if dock.isHidden()] == [panel.title for panel in PANELS if panel.area == "bottom"]
    window.close()
    window.deleteLater()


def test_a_layout_from_before_a_panel_was_there_leaves_it_hidden(window, session, preferences):
    state = window.saveState()
    dock = window.docks["Stability"]
    dock.setObjectName("not yet there")
    old = window.saveState()
    assert old != state
    preferences.layout = window.saveGeometry(), old
    later = Window(session, preferences)
    later.show()
    assert later.docks["Stability"].isHidden() and not later.docks["Scene"].isHidden()
    later.close()
    later.deleteLater()


def test_recent_files_are_the_last_ten_that_exist(preferences, tmp_path):
    paths = [tmp_path / f"{i}.yaml" for i in range(12)]
    for path in paths:
        path.touch()
        preferences.remember(path)
    preferences.remember(paths[5])
    assert preferences.recent[:2] == [paths[5], paths[11]] and len(preferences.recent) == 10
    paths[5].unlink()
    assert preferences.recent[0] == paths[11]


def test_numbers_as_text():
    texts = [number_text(x) for x in (1.0, -0.5, 1e-9, 123456.0, 2147483647.0, 1 / 3)]
    assert texts == ["1", "-0.5", "1e-09", "123456", "2147483647", "0.333333"]
    assert parsed(" 1,5 ") == 1.5 and parsed("abc") == "abc"
    assert [step_of(x) for x in (0.2, 1.5, 40, 0)] == [0.01, 0.1, 1, 0.1]
    assert [elapsed_text(x) for x in (4.2, 187.5, 3723.4)] == ["4.2 s", "3:07.5", "1:02:03.4"]


def test_missing_libraries_are_named_by_their_package():
    assert missing_packages({"libc.so.6": "libc6", "libnone-of-that-name.so.9": "libnone9"}) == ["libnone9"]
