"""The editor of a formula."""
from PySide6.QtGui import QFontDatabase
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from app.editors import TextEdit


class FormulaEdit(TextEdit):
    """A formula, in letters of one width; what is wrong with it stands below it as it is typed."""

    def __init__(self, parent: QWidget | None = None):
        super().__init__(parent)
        self._entry.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self._reason = QLabel(self)
        self._reason.setWordWrap(True)
        self._reason.setProperty("role", "label")
        self._reason.hide()
        self._row.removeWidget(self._entry)
        column = QVBoxLayout()
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addWidget(self._entry)
        column.addWidget(self._reason)
        self._row.addLayout(column)

    @property
    def reason(self) -> QLabel:
        return self._reason

    def refuse(self, reason):
        super().refuse(reason)
        self._reason.setText(reason or "")
        self._reason.setVisible(reason is not None)
