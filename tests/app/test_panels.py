"""The panels, both ways: what they show, what they change, what they refuse."""
import msgspec
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLineEdit

from app.entry import number_text
from app.places import Place, node_at, record_at
from rtcore.camera import orbit


def type_into(qtbot, entry: QLineEdit, text: str, end=Qt.Key.Key_Return):
    entry.setFocus()
    entry.selectAll()
    qtbot.keyClicks(entry, text)
    if end is not None:
        qtbot.keyClick(entry, end)


@pytest.fixture
def camera_form(window):
    return window.panels["Camera"].form


def test_the_camera_panel_follows_the_mouse_and_leads_the_picture(window, session, camera_form, qtbot, settled):
    x = camera_form.editors["lookfrom"].entries[0]
    session.move(orbit(session.camera, 0.5, 0.0))
    assert x.text() == number_text(session.camera.lookfrom[0])
    type_into(qtbot, camera_form.editors["fov"].entries[0], "25")
    assert session.camera.fov == 25.0
    settled(session)
    assert session.shown.job.camera.fov == 25.0
    session.back()
    assert camera_form.editors["fov"].entries[0].text() == "40"


@pytest.mark.parametrize("name, part, text", [("lookat", 2, "-10"), ("fov", 0, "180"), ("fov", 0, "0"), ("fov", 0, "wide"),
                                              ("lookfrom", 0, "nan"), ("lookfrom", 1, "1e999"), ("up", 1, "0")])
def test_a_degenerate_camera_can_not_be_entered(window, session, camera_form, qtbot, name, part, text):
    before, entry = session.camera, camera_form.editors[name].entries[part]
    was = entry.text()
    type_into(qtbot, entry, text)
    assert session.camera == before
    assert entry.property("refused") and "expected" in entry.toolTip() and entry.text() == text
    qtbot.keyClick(entry, Qt.Key.Key_Escape)
    assert entry.text() == was and not entry.property("refused")


def test_only_what_changed_is_shown_anew(window, session, qtbot, monkeypatch):
    shown, form = [], window.panels["Fog"].form
    for name, editor in form.editors.items():
        monkeypatch.setattr(editor, "show_value", lambda value, name=name, show=editor.show_value: shown.append(name) or show(value))
    session.edit(msgspec.structs.replace(session.scene, fog=msgspec.structs.replace(session.scene.fog, density=0.5)), "thicker")
    assert shown == ["density"]
    entry = form.editors["density"].entries[0]
    type_into(qtbot, entry, "-10")      # refused: the model stays as it is, the editor does not
    shown.clear()
    form.refresh()
    assert shown == ["density"] and entry.property("refused")
    entry.clearFocus()
    assert entry.text() == "0.5" and not entry.property("refused")


def test_a_refused_text_goes_when_the_focus_goes(window, session, camera_form, qtbot):
    entry = camera_form.editors["fov"].entries[0]
    type_into(qtbot, entry, "200", end=None)
    assert entry.property("refused")
    entry.clearFocus()
    assert entry.text() == "40" and not entry.property("refused") and session.camera.fov == 40


def test_what_is_being_typed_is_not_overwritten(window, session, camera_form, qtbot):
    entry = camera_form.editors["lookfrom"].entries[0]
    type_into(qtbot, entry, "3.2", end=None)
    session.move(orbit(session.camera, 0.1, 0))
    assert entry.text() == "3.2"
    qtbot.keyClick(entry, Qt.Key.Key_Return)
    assert session.camera.lookfrom[0] == 3.2


def test_digits_that_are_not_shown_are_not_lost(window, session, camera_form, qtbot):
    session.move(session.camera.at(lookfrom=(1.23456789, 0, -10)))
    entry = camera_form.editors["lookfrom"].entries[0]
    type_into(qtbot, entry, entry.text())
    assert session.camera.lookfrom[0] == 1.23456789


def test_arrow_keys_step_a_number(window, session, camera_form, qtbot):
    entry = camera_form.editors["fov"].entries[0]
    entry.setFocus()
    qtbot.keyClick(entry, Qt.Key.Key_Up)
    assert session.camera.fov == 41.0
    qtbot.keyClick(entry, Qt.Key.Key_PageDown)
    assert session.camera.fov == 31.0


def test_the_fog_panel_edits_the_scene_and_enables_what_applies(window, session, qtbot):
    form = window.panels["Fog"].form
    assert form.editors["density"].isEnabled() and not form.editors["start"].isEnabled()
    combo = form.editors["kind"].combo
    combo.setCurrentIndex(combo.findData("linear"))
    combo.activated.emit(combo.currentIndex())
    assert session.scene.fog.kind == "linear"
    assert not form.editors["density"].isEnabled() and form.editors["end"].isEnabled()
    type_into(qtbot, form.editors["end"].entries[0], "0")
    assert session.scene.fog.end == 50 and form.editors["end"].entries[0].property("refused")
    qtbot.keyClick(form.editors["end"].entries[0], Qt.Key.Key_Escape)
    session.document.undo()
    assert combo.currentData() == "exponential" and form.editors["density"].isEnabled()


def test_a_slider_drag_is_one_step_of_undo(window, session):
    form = window.panels["Fog"].form
    slider = form.editors["density"].slider
    slider.setSliderDown(True)
    for position in (300, 400, 500):
        slider.setValue(position)
    slider.setSliderDown(False)
    assert session.scene.fog.density == pytest.approx(0.001 * 2000 ** 0.5, rel=1e-2)
    slider.setSliderDown(True)
    slider.setValue(600)
    slider.setSliderDown(False)
    session.document.undo()
    session.document.undo()
    assert session.scene.fog.density == 0.02 and not session.document.modified


def test_a_scene_without_fog_gets_some(window, session):
    session.edit(msgspec.structs.replace(session.scene, fog=None), "no fog")
    box = window.panels["Fog"].form.editors["on"].box
    assert not box.isChecked()
    box.click()
    assert session.scene.fog is not None and session.scene.fog.on
    box.click()
    assert not session.scene.fog.on


def test_the_tree_and_the_picture_share_the_selection(window, session, qtbot):
    tree = window.panels["Scene"]
    view = window.viewport
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=view.rect().center())
    assert session.selection == Place("node", (1,))
    assert tree.model.data(tree.view.currentIndex()) == "red ball"
    window.panels["Properties"].complete()
    assert window.panels["Properties"].forms["node"].editors["name"].entry.text() == "red ball"
    tree.view.setCurrentIndex(tree.model.find(Place("node", (3, 0, 1))))
    assert session.selection == Place("node", (3, 0, 1))
    qtbot.waitUntil(lambda: session.shown.outline is not None)


def test_the_tree_hides_renames_and_tells_of_definitions(window, session):
    model = window.panels["Scene"].model
    index = model.find(Place("node", (3, 0, 1)))
    assert "every use" in model.data(index, Qt.ItemDataRole.ToolTipRole)
    assert "every use" not in model.data(model.find(Place("node", (1,))), Qt.ItemDataRole.ToolTipRole)
    assert model.setData(index, Qt.CheckState.Unchecked.value, Qt.ItemDataRole.CheckStateRole)
    assert model.data(model.find(Place("node", (4, 0, 1))), Qt.ItemDataRole.CheckStateRole) == Qt.CheckState.Unchecked
    assert session.document.undo_label == "hide base"
    model.setData(model.find(Place("node", (1,))), "ruby")
    assert node_at(session.scene, (1,)).name == "ruby"
    model.setData(model.find(Place("light", 0)), Qt.CheckState.Unchecked.value, Qt.ItemDataRole.CheckStateRole)
    assert not session.scene.lights[0].on


def test_the_tree_model_is_sound(window, session, qtmodeltester):
    model = window.panels["Scene"].model
    qtmodeltester.check(model)
    session.edit_record(Place("node", (2,)), msgspec.structs.replace(node_at(session.scene, (2,)), name="two"), "rename")
    qtmodeltester.check(model)


def test_properties_edit_shape_material_and_transform(window, session, qtbot):
    panel = window.panels["Properties"]
    session.select(Place("node", (1,)))
    window.panels["Properties"].complete()
    type_into(qtbot, panel.forms["shape"].editors["radius"].entries[0], "1.5")
    assert node_at(session.scene, (1,)).shape.radius == 1.5
    type_into(qtbot, panel.forms["shape"].editors["radius"].entries[0], "-2")
    assert "greater than 0" in panel.forms["shape"].editors["radius"].entries[0].toolTip()
    assert node_at(session.scene, (1,)).shape.radius == 1.5
    type_into(qtbot, panel.forms["material"].editors["color"].entry, "#00ff00")
    assert node_at(session.scene, (1,)).material.color == (0, 1, 0)
    session.select(Place("node", (3,)))
    window.panels["Properties"].complete()
    type_into(qtbot, panel.forms["transform 0"].editors["offset"].entries[1], "0.5")
    assert node_at(session.scene, (3,)).transform[0].offset == (2.5, 0.5, 0)


def test_a_shared_material_changes_wherever_it_is_named(window, session, qtbot):
    session.select(Place("node", (0,)))
    panel = window.panels["Properties"]
    panel.complete()
    type_into(qtbot, panel.forms["material"].editors["diffuse"].entries[0], "0.5")
    assert session.scene.materials["floor"].diffuse == 0.5 and node_at(session.scene, (0,)).material == "floor"
    panel.forms["material"].editors["checker"].box.click()
    panel.complete()
    assert session.scene.materials["floor"].checker is None and "checker" not in panel.forms
    session.document.undo()
    panel.complete()
    assert "checker" in panel.forms


@pytest.mark.parametrize("place", [Place("light", 0), Place("material", "floor"), Place("background")])
def test_properties_of_what_is_not_a_node(window, session, qtbot, place):
    session.select(place)
    entry = window.panels["Properties"].forms["record"].editors["color"].entry
    type_into(qtbot, entry, "0.5 0.25 0.125")
    assert record_at(session.scene, place).color == (0.5, 0.25, 0.125)
    type_into(qtbot, entry, "#12")
    assert entry.property("refused")


def test_render_panel(window, session, qtbot):
    samples = window.panels["Render"].editors["samples"].findChild(QLineEdit)
    type_into(qtbot, samples, "7")
    assert session.options.samples == 7 and not session.document.modified
    for refused in ("7.5", "0", "1048577"):
        type_into(qtbot, samples, refused)
        assert session.options.samples == 7 and samples.property("refused")
    type_into(qtbot, samples, "1048576")
    assert session.options.samples == 1 << 20


def test_an_edit_leaves_the_tree_open(window, session):
    tree = window.panels["Scene"]
    tree.view.expand(tree.model.find(Place("node", (2,))))
    model_resets = []
    tree.model.modelReset.connect(lambda: model_resets.append(1))
    session.edit_record(Place("node", (2, 0)), msgspec.structs.replace(node_at(session.scene, (2, 0)), visible=False), "hide")
    assert tree.view.isExpanded(tree.model.find(Place("node", (2,)))) and not model_resets
    assert tree.model.data(tree.model.find(Place("node", (2, 0))), Qt.ItemDataRole.CheckStateRole) == Qt.CheckState.Unchecked


def test_when_to_stop_is_asked_of_the_renderer(window, session, double, qtbot, settled):
    panel = window.panels["Render"]
    for name, text in (("seconds", "3.5"), ("error", "0.01")):
        editor = panel.editors[name]
        assert getattr(session.options, name) is None and not editor.box.isChecked()
        qtbot.mouseClick(editor.box, Qt.MouseButton.LeftButton)
        assert getattr(session.options, name) == {"seconds": 10.0, "error": 0.002}[name]
        type_into(qtbot, editor.findChild(QLineEdit), text)
        assert getattr(session.options, name) == float(text)
    type_into(qtbot, panel.editors["error"].findChild(QLineEdit), "0", end=None)
    assert session.options.error == 0.01
    settled(session)
    assert double.jobs[-1].options.settings()["seconds"] == 3.5
    qtbot.mouseClick(panel.editors["seconds"].box, Qt.MouseButton.LeftButton)
    assert session.options.seconds is None
    assert panel.ends.text().startswith("Whichever comes first, or when no error")
    qtbot.mouseClick(panel.editors["error"].box, Qt.MouseButton.LeftButton)
    assert panel.ends.text().startswith("Stops before that if no error")
    qtbot.mouseClick(panel.editors["samples"].box, Qt.MouseButton.LeftButton)
    assert session.options.samples is None and panel.ends.text() == "Goes on until no error is left that could be seen."
    panel.editors["adaptive"].box.click()
    assert panel.ends.text() == "Never stops."
    settled(session)
    assert double.jobs[-1].options.settings()["samples"] == 1 << 20
    qtbot.mouseClick(panel.editors["samples"].box, Qt.MouseButton.LeftButton)
    assert session.options.samples == 16 and panel.ends.isHidden()
