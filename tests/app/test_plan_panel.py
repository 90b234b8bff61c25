"""The plan panel: out of the way at first, follows the picture, says what was left out."""
import msgspec
from PySide6.QtCore import Qt

from app.panels.plan import Bars, PlanPanel, grouped, in_bytes, percent
from app.theme import LIGHT
from rtcore.account import account
from rtcore.plan import plan
from rtcore.settings import Settings
from rtcore.shapes import KINDS


def shown(session, qtbot, settled) -> PlanPanel:
    panel = PlanPanel(session)
    panel.dress(LIGHT)
    panel.resize(1000, 400)
    qtbot.addWidget(panel)
    panel.show()
    settled(session)
    qtbot.waitUntil(lambda: bool(panel.kept.rows), timeout=5000)
    return panel


def test_it_is_hidden_until_asked_for(window, qtbot):
    dock = window.docks["Plan"]
    assert dock.isHidden() and window.dockWidgetArea(dock) == Qt.DockWidgetArea.BottomDockWidgetArea
    assert window.panels["Plan"].kept.rows == []        # nothing is worked out before it is seen
    dock.toggleViewAction().trigger()
    qtbot.waitUntil(lambda: bool(window.panels["Plan"].kept.rows), timeout=5000)
    assert window.docks["Stability"].isHidden()


def test_it_says_what_the_picture_spends_its_time_on(session, qtbot, settled):
    panel = shown(session, qtbot, settled)
    assert panel.saying.text().startswith("This picture spends 75 % of its time on finding where rays meet spheres and 25 % on casting")
    rows = {name: words for name, _, words in panel.kept.rows}
    assert rows["hits: sphere"] == "75 %" and rows["fog"] == "0 %" and rows["patterns"].startswith("within ")
    assert panel.kernels.rows[0] == ("core.f64", 0.25, "25 %")
    assert "smooth normals" in panel.left_out.text() and "no mesh brings normals" in panel.left_out.text()
    assert "compiled in this process" in panel.held.text() and "1.0 KiB held: shapes 1.0 KiB" in panel.held.text()
    assert "hits: sphere: 75 %" in panel.kept.accessibleDescription()


def test_it_follows_toggles_and_scene(session, qtbot, settled):
    panel = shown(session, qtbot, settled)
    assert "switched off" not in panel.left_out.text()
    session.switch("shadows", False)
    qtbot.waitUntil(lambda: "shadow rays<br><span" in panel.left_out.text() and "switched off" in panel.left_out.text(), timeout=5000)
    assert "shadow rays" not in {name for name, *_ in panel.kept.rows}
    session.edit(msgspec.structs.replace(session.scene, fog=None), "no fog")
    qtbot.waitUntil(lambda: "the scene has none" in panel.left_out.text(), timeout=5000)


def test_a_hidden_panel_works_nothing_out(session, qtbot, settled):
    panel = PlanPanel(session)
    panel.dress(LIGHT)
    qtbot.addWidget(panel)
    settled(session)
    panel.refresh()
    assert panel.kept.rows == [] and not panel._timer.isActive()


def test_kinds_that_are_not_there_are_told_together(scene):
    made = account(plan(scene, Settings(fog=False)), {}, {})
    *others, (kinds, why) = grouped(made)
    assert ("fog", "switched off") in others and not [stage for stage, _ in others if stage.startswith("hits: ")]
    assert len(kinds.split(", ")) == len(KINDS) - 2 and "tori" in kinds and why == "none is visible in the scene"


def test_bars_are_drawn_to_scale(qtbot):
    bars = Bars("bars")
    qtbot.addWidget(bars)
    bars.dress(LIGHT)
    bars.show_rows([("a", 0.5, "50 %"), ("b", 0.25, "25 %"), ("c", 0.0, "within a")])
    bars.resize(bars.sizeHint())
    image = bars.grab().toImage()

    def length(row: int) -> int:
        y = round((row + 0.5) * Bars.ROW)
        return sum(image.pixelColor(x, y).name() == LIGHT.accent for x in range(image.width()))
    assert abs(length(0) - 2 * length(1)) <= 3 and length(1) > 20 and length(2) == 0


def test_numbers_in_words():
    assert [percent(share) for share in (0, 0.004, 0.014, 0.5)] == ["0 %", "< 1 %", "1 %", "50 %"]
    sizes = {0: "0 B", 1023: "1023 B", 1024: "1.0 KiB", 20 << 10: "20 KiB", 3 << 20: "3.0 MiB", 5 << 40: "5120 GiB"}
    assert [in_bytes(size) for size in sizes] == list(sizes.values())
