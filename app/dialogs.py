"""The small dialogs of the window."""
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QIcon, QKeySequence
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QGridLayout, QLabel, QMessageBox, QScrollArea, QVBoxLayout, QWidget

from app.actions import ACTIONS, MOUSE
from app.icons import app_icon

ABOUT = """<h2>Rayscope</h2>
<p>A window in which a scene is explored by ray tracing, live:<br>the picture answers at once and then refines itself.</p>
<p>Version %s</p>"""


def shortcuts_dialog(parent: QWidget) -> QDialog:
    """Every shortcut of the table, and what the mouse does."""
    dialog = QDialog(parent)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.setWindowTitle("Keyboard and mouse")
    body = QWidget()
    grid = QGridLayout(body)
    grid.setContentsMargins(16, 12, 16, 12)
    grid.setHorizontalSpacing(18)
    grid.setVerticalSpacing(7)
    keys = [(QKeySequence(a.shortcut).toString(QKeySequence.SequenceFormat.NativeText), a.tip) for a in ACTIONS if a.shortcut]
    for heading, rows in (("In the picture", [(keys_, does[:1].upper() + does[1:]) for keys_, does in MOUSE]), ("Keyboard", keys)):
        title = QLabel(heading)
        title.setProperty("role", "heading")
        grid.addWidget(title, grid.rowCount(), 0, 1, 2)
        for key, does in rows:
            row = grid.rowCount()
            label = QLabel(key)
            label.setProperty("role", "key")
            grid.addWidget(label, row, 0, Qt.AlignmentFlag.AlignLeft)
            grid.addWidget(QLabel(does), row, 1)
    grid.setColumnStretch(1, 1)
    area = QScrollArea()
    area.setWidgetResizable(True)
    area.setFrameShape(QScrollArea.Shape.NoFrame)
    area.setAutoFillBackground(True)
    area.setWidget(body)
    buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
    buttons.button(QDialogButtonBox.StandardButton.Close).setIcon(QIcon())
    buttons.rejected.connect(dialog.close)
    column = QVBoxLayout(dialog)
    column.addWidget(area)
    column.addWidget(buttons)
    dialog.resize(QSize(body.sizeHint().width() + 60, min(body.sizeHint().height() + 80, 640)))
    return dialog


def about_dialog(parent: QWidget) -> QMessageBox:
    """Name, purpose, version."""
    from importlib.metadata import PackageNotFoundError, version
    try:
        number = version("rayscope")
    except PackageNotFoundError:
        number = "of a checkout that is not installed"
    box = QMessageBox(parent)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    box.setWindowTitle("About Rayscope")
    box.setIconPixmap(app_icon().pixmap(QSize(96, 96)))
    box.setTextFormat(Qt.TextFormat.RichText)
    box.setText(ABOUT % number)
    return box


def ask_unsaved(parent: QWidget, name: str, doing: str) -> QMessageBox.StandardButton:
    """Save, Discard or Cancel, before `doing` ("closing") would lose changes."""
    box = QMessageBox(QMessageBox.Icon.Warning, "Unsaved changes", f"“{name}” has changes that are not saved.", parent=parent)
    box.setInformativeText(f"Save them before {doing}?")
    buttons = QMessageBox.StandardButton
    box.setStandardButtons(buttons.Save | buttons.Discard | buttons.Cancel)
    box.setDefaultButton(buttons.Save)
    return buttons(box.exec())
