"""The gallery: what it lists, its thumbnails, and opening a scene by mouse and keyboard."""
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QImage

from app.gallery import GALLERY, SIZE, gallery, main
from app.theme import DARK, LIGHT


@pytest.fixture
def dialog(window, qtbot):
    """The gallery, open and filled."""
    window.actions_by_id["gallery"].trigger()
    qtbot.waitUntil(lambda: window.gallery.model.rowCount() > 0, timeout=5000)
    yield window.gallery
    window.gallery.close()


def entry_of(index):
    return index.data(Qt.ItemDataRole.UserRole)[0]


def test_it_lists_every_scene_with_title_and_note():
    entries = gallery()
    assert {entry.path for entry in entries} == set(GALLERY.glob("*.yaml"))
    assert [entry.title for entry in entries] == sorted(entry.title for entry in entries)
    assert all(20 < len(entry.line) < len(entry.note) and "\n" not in entry.note for entry in entries)
    tori = next(entry for entry in entries if entry.path.stem == "tori")
    assert tori.title == "Tori, from a ring to a spindle"
    assert tori.line == "A torus is a circle of radius r carried around a circle of radius R."


def test_the_thumbnails_are_of_one_size_and_belong_to_a_scene():
    assert {path.stem for path in (GALLERY.parent / "thumbnails").iterdir()} == {entry.path.stem for entry in gallery()}
    for entry in gallery():
        image = QImage(str(entry.thumbnail))
        assert (image.width(), image.height()) == SIZE


def test_a_scene_that_does_not_exist_has_no_thumbnail(capsys):
    assert main(["whitted", "nowhere"]) == 2
    assert capsys.readouterr().err == "app.gallery: no such scene: nowhere\n"


def test_keys_walk_through_it_and_enter_opens(dialog, window, session, qtbot):
    view = dialog.view
    assert view.hasFocus() or not dialog.isActiveWindow()
    first = view.currentIndex()
    assert first.row() == 0 and dialog.note.text() == entry_of(first).note
    qtbot.keyClick(view, Qt.Key.Key_Right)
    second = view.currentIndex()
    assert second.row() == 1 and dialog.note.text() == entry_of(second).note
    for key in "tori":
        qtbot.keyClick(view, key)
    assert entry_of(view.currentIndex()).path.stem == "tori"
    with qtbot.waitSignal(window.filing.opened, timeout=5000):
        qtbot.keyClick(view, Qt.Key.Key_Return)
    assert not dialog.isVisible() and session.document.path == GALLERY / "tori.yaml" and window.preferences.recent == []
    dialog.open()
    assert entry_of(view.currentIndex()).path.stem == "tori"       # where one left it


def test_a_click_opens(dialog, session, window, qtbot):
    index = dialog.model.index(1)
    chosen = entry_of(index).path
    with qtbot.waitSignal(window.filing.opened, timeout=5000):
        qtbot.mouseClick(dialog.view.viewport(), Qt.MouseButton.LeftButton, pos=dialog.view.visualRect(index).center())
    assert not dialog.isVisible() and session.document.path == chosen


def test_escape_leaves_everything_as_it_was(dialog, session, qtbot):
    scene = session.scene
    qtbot.keyClick(dialog.view, Qt.Key.Key_Escape)
    assert not dialog.isVisible() and session.scene is scene


def test_every_picture_is_named_for_those_who_cannot_see_it(dialog):
    roles = Qt.ItemDataRole
    for row in range(dialog.model.rowCount()):
        index = dialog.model.index(row)
        entry = entry_of(index)
        assert (index.data(roles.AccessibleTextRole), index.data(roles.AccessibleDescriptionRole)) == (entry.title, entry.note)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=lambda theme: theme.name)
def test_the_cards_wear_the_theme_and_show_the_thumbnails(dialog, window, theme, qtbot):
    window.choose_theme(theme.name)
    seen = dialog.view.viewport().grab().toImage()
    corner = dialog.view.visualRect(dialog.model.index(0)).topLeft()
    assert seen.pixelColor(corner + QPoint(100, 4)).name() == theme.soft        # the current card
    thumbnail = QImage(str(entry_of(dialog.model.index(0)).thumbnail)).scaled(240, 150)
    for x, y in ((60, 40), (120, 100), (200, 130)):
        shown, meant = seen.pixelColor(corner + QPoint(8 + x, 8 + y)), thumbnail.pixelColor(x, y)
        assert max(abs(shown.red() - meant.red()), abs(shown.green() - meant.green()), abs(shown.blue() - meant.blue())) < 40
