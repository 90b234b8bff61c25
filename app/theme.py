"""Light and dark: one palette of names each, from which Qt's palette, the style sheet and the icons are made."""
from typing import NamedTuple

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QApplication

import resources


class Theme(NamedTuple):
    """Colours by what they are for."""

    name: str
    window: str         # behind everything
    panel: str          # docks
    field: str          # what can be typed into
    raised: str         # buttons
    hover: str
    line: str
    text: str
    muted: str          # labels, titles
    faint: str          # disabled
    icon: str
    accent: str
    on_accent: str
    soft: str           # the accent as a background: selected rows, pressed buttons
    error: str
    error_soft: str
    stage: str          # around the picture


DARK = Theme("dark", window="#1b1d21", panel="#22252a", field="#17191d", raised="#2e3238", hover="#383d45", line="#363b43", text="#e4e7eb",
             muted="#9ba3ae", faint="#5d646e", icon="#c3c9d2", accent="#f2a33a", on_accent="#1d1404", soft="#4a3a20", error="#ff7b72",
             error_soft="#40211f", stage="#121316")
LIGHT = Theme("light", window="#e9ebee", panel="#f6f7f9", field="#ffffff", raised="#ffffff", hover="#eceef2", line="#cdd2d9",
              text="#1e2228", muted="#5c6570", faint="#a4abb5", icon="#454c56", accent="#b45f06", on_accent="#ffffff", soft="#f8e3c8",
              error="#c3271b", error_soft="#fdeae8", stage="#d5d9de")
CHOICES = ("system", "light", "dark")

POINTS = 9.5        # of all texts that are not headings or the like
SHEET = """
QMainWindow, QDialog { background: %(window)s; }
QMainWindow::separator { background: %(window)s; width: 5px; height: 5px; }
QMainWindow::separator:hover { background: %(accent)s; }
QToolTip { background: %(raised)s; color: %(text)s; border: 1px solid %(line)s; padding: 4px 6px; }

QMenuBar { background: %(window)s; padding: 2px 4px; }
QMenuBar::item { padding: 4px 9px; border-radius: 4px; background: transparent; }
QMenuBar::item:selected { background: %(hover)s; }
QMenu { background: %(panel)s; border: 1px solid %(line)s; padding: 4px; }
QMenu::item { padding: 5px 26px 5px 8px; border-radius: 4px; }
QMenu::item:selected { background: %(soft)s; color: %(text)s; }
QMenu::item:disabled { color: %(faint)s; }
QMenu::separator { height: 1px; background: %(line)s; margin: 4px 6px; }
QMenu::icon { padding-left: 6px; }

QToolBar { background: %(window)s; border: none; spacing: 2px; padding: 3px 6px; }
QToolBar::separator { background: %(line)s; width: 1px; margin: 5px 6px; }
QToolButton { border: 1px solid transparent; border-radius: 5px; padding: 4px; color: %(text)s; }
QToolButton:hover { background: %(hover)s; }
QToolButton:pressed, QToolButton:checked { background: %(soft)s; }
QToolButton:checked { border-color: %(accent)s; }
QToolButton:focus { border-color: %(accent)s; }
QToolButton::menu-indicator { image: none; }

QDockWidget { color: %(muted)s; font-weight: 600; titlebar-close-icon: url(%(icons)s/dock-close.svg);
    titlebar-normal-icon: url(%(icons)s/dock-float.svg); }
QDockWidget::title { background: %(panel)s; padding: 7px 10px; border-bottom: 1px solid %(line)s; text-align: left; }
QDockWidget::close-button, QDockWidget::float-button { border: none; border-radius: 4px; padding: 0; icon-size: 14px;
    subcontrol-position: top right; subcontrol-origin: margin; position: absolute; top: 6px; width: 16px; height: 16px; }
QDockWidget::close-button { right: 6px; }
QDockWidget::float-button { right: 26px; }
QDockWidget::close-button:hover, QDockWidget::float-button:hover { background: %(hover)s; }
QTabBar { background: %(window)s; }
QTabBar::tab { background: transparent; color: %(muted)s; padding: 6px 11px; border: none; border-bottom: 2px solid transparent; }
QTabBar::tab:hover { color: %(text)s; }
QTabBar::tab:selected { color: %(text)s; border-bottom: 2px solid %(accent)s; }

QScrollBar:vertical { background: transparent; width: 10px; margin: 1px; }
QScrollBar:horizontal { background: transparent; height: 10px; margin: 1px; }
QScrollBar::handle { background: %(line)s; border-radius: 4px; min-height: 28px; min-width: 28px; }
QScrollBar::handle:hover { background: %(faint)s; }
QScrollBar::add-line, QScrollBar::sub-line { width: 0; height: 0; }
QScrollBar::add-page, QScrollBar::sub-page { background: transparent; }

QTreeView { background: %(panel)s; border: none; outline: none; padding: 4px 2px; show-decoration-selected: 0;
    selection-background-color: transparent; }
QTreeView::branch:selected { background: transparent; }
QTreeView::item { min-height: 23px; border-radius: 4px; color: %(text)s; padding-left: 1px; }
QTreeView::item:hover { background: %(hover)s; }
QTreeView::item:selected { background: %(soft)s; color: %(text)s; }
QTreeView::branch { background: transparent; }
QTreeView::branch:has-children:closed { image: url(%(icons)s/chevron-right.svg); }
QTreeView::branch:has-children:open { image: url(%(icons)s/chevron-down.svg); }

QTableView { background: %(panel)s; border: none; outline: none; selection-background-color: %(soft)s; selection-color: %(text)s; }
QTableView::item { padding: 0 8px; }
QHeaderView { background: %(panel)s; }
QHeaderView::section { background: %(panel)s; color: %(muted)s; border: none; border-bottom: 1px solid %(line)s; padding: 4px 8px;
    font-weight: 600; }

QLineEdit, QComboBox { background: %(field)s; border: 1px solid %(line)s; border-radius: 4px; padding: 3px 5px; color: %(text)s;
    selection-background-color: %(accent)s; selection-color: %(on_accent)s; min-height: 17px; }
QLineEdit:hover, QComboBox:hover { border-color: %(faint)s; }
QLineEdit:focus, QComboBox:focus { border-color: %(accent)s; }
QLineEdit:disabled, QComboBox:disabled { color: %(faint)s; background: %(panel)s; }
QLineEdit:read-only { background: %(panel)s; color: %(muted)s; }
QLineEdit[refused="true"] { border-color: %(error)s; background: %(error_soft)s; color: %(error)s; }
QComboBox::drop-down { border: none; width: 20px; }
QComboBox::down-arrow { image: url(%(icons)s/chevron-down.svg); width: 16px; height: 16px; }
QComboBox QAbstractItemView { background: %(panel)s; border: 1px solid %(line)s; selection-background-color: %(soft)s;
    selection-color: %(text)s; outline: none; padding: 3px; }
QPushButton { background: %(raised)s; border: 1px solid %(line)s; border-radius: 5px; padding: 4px 10px; color: %(text)s;
    min-height: 18px; }
QPushButton:hover { background: %(hover)s; }
QPushButton:pressed { background: %(soft)s; }
QPushButton:focus, QPushButton:default { border-color: %(accent)s; }
QPushButton:disabled { color: %(faint)s; background: %(panel)s; }
QCheckBox { spacing: 7px; }
QCheckBox::indicator, QTreeView::indicator { width: 13px; height: 13px; border: 1px solid %(faint)s; border-radius: 3px;
    background: %(field)s; }
QCheckBox::indicator:hover, QTreeView::indicator:hover, QCheckBox::indicator:focus { border-color: %(accent)s; }
QCheckBox::indicator:checked, QTreeView::indicator:checked { background: %(accent)s; border-color: %(accent)s;
    image: url(%(icons)s/check-%(name)s.svg); }
QCheckBox::indicator:checked:focus { border-color: %(text)s; }
QCheckBox::indicator:disabled { border-color: %(line)s; background: %(panel)s; }
QCheckBox::indicator:checked:disabled { background: %(faint)s; }
QCheckBox:disabled, QLabel:disabled { color: %(faint)s; }
QSlider { min-height: 20px; }
QSlider::groove:horizontal { height: 4px; border-radius: 2px; background: %(line)s; }
QSlider::sub-page:horizontal { height: 4px; border-radius: 2px; background: %(accent)s; }
QSlider::sub-page:horizontal:disabled { background: %(faint)s; }
QSlider::handle:horizontal { background: %(raised)s; border: 1px solid %(faint)s; width: 12px; margin: -5px 0; border-radius: 6px; }
QSlider::handle:horizontal:hover, QSlider::handle:horizontal:focus { border: 2px solid %(accent)s; width: 10px; }

QStatusBar { background: %(window)s; color: %(muted)s; }
QStatusBar::item { border: none; }
Figure { color: %(muted)s; }

QLabel[role="label"] { color: %(muted)s; }
QLabel[role="hint"] { color: %(muted)s; }
QLabel[role="heading"] { color: %(text)s; font-weight: 600; padding-top: 4px; }
QLabel[role="key"] { background: %(field)s; border: 1px solid %(line)s; border-radius: 4px; padding: 2px 7px; color: %(text)s; }
QToolButton[role="section"] { color: %(text)s; font-weight: 600; padding: 3px 2px; text-align: left; border: none; }
QToolButton[role="section"]:checked, QToolButton[role="section"]:hover { background: transparent; color: %(text)s; border: none; }
QToolButton[role="section"]:focus { color: %(accent)s; }
QFrame[role="rule"] { background: %(line)s; border: none; max-height: 1px; }
QFrame#notice { background: %(raised)s; border: 1px solid %(line)s; border-radius: 6px; }
QFrame#notice[level="error"] { background: %(error_soft)s; border-color: %(error)s; }
QFrame#notice[level="error"] QLabel { color: %(error)s; }
QFrame#busy { background: %(raised)s; border: 1px solid %(line)s; border-radius: 8px; }
QProgressBar { background: %(line)s; border: none; border-radius: 2px; max-height: 4px; }
QProgressBar::chunk { background: %(accent)s; border-radius: 2px; }
"""


def wanted(choice: str) -> Theme:
    """The theme for a choice; ``system`` follows the desktop."""
    if choice == "system":
        return DARK if QApplication.styleHints().colorScheme() != Qt.ColorScheme.Light else LIGHT
    return LIGHT if choice == "light" else DARK


def palette(theme: Theme) -> QPalette:
    """Qt's palette of a theme."""
    result = QPalette()
    roles = QPalette.ColorRole
    for role, color in ((roles.Window, theme.panel), (roles.WindowText, theme.text), (roles.Base, theme.field),
                        (roles.AlternateBase, theme.panel), (roles.Text, theme.text), (roles.Button, theme.raised),
                        (roles.ButtonText, theme.text), (roles.BrightText, theme.error), (roles.ToolTipBase, theme.raised),
                        (roles.ToolTipText, theme.text), (roles.PlaceholderText, theme.faint), (roles.Highlight, theme.accent),
                        (roles.HighlightedText, theme.on_accent), (roles.Link, theme.accent), (roles.Accent, theme.accent),
                        (roles.Light, theme.hover), (roles.Midlight, theme.raised), (roles.Mid, theme.line), (roles.Dark, theme.line),
                        (roles.Shadow, theme.stage)):
        result.setColor(role, QColor(color))
    for role in (roles.WindowText, roles.Text, roles.ButtonText):
        result.setColor(QPalette.ColorGroup.Disabled, role, QColor(theme.faint))
    return result


def set_size(app: QApplication):
    """Texts of our size, in all widgets that are made from now on."""
    font = app.font()
    font.setPointSizeF(POINTS)
    app.setFont(font)


def apply(app: QApplication, theme: Theme):
    """Dress the whole application in a theme."""
    app.setStyle("Fusion")
    app.setPalette(palette(theme))
    app.setStyleSheet(SHEET % {**theme._asdict(), "icons": (resources.ROOT / "icons").as_posix()})
