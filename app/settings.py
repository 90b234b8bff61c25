"""Preferences: what the window remembers from one time to the next. An unreadable or outdated value is as good as none."""
from pathlib import Path

from PySide6.QtCore import QByteArray, QSettings

from app.theme import CHOICES

VERSION = 1         # of the stored layout; another version's geometry is not restored
MOST_RECENT = 10


class Preferences:
    """Typed access to a QSettings. Nothing read from it is trusted."""

    def __init__(self, store: QSettings | None = None):
        self._store = store or QSettings(QSettings.Format.IniFormat, QSettings.Scope.UserScope, "rayscope", "window")

    @property
    def theme(self) -> str:
        """One of `app.theme.CHOICES`."""
        value = self._get("theme")
        return value if value in CHOICES else "system"

    @theme.setter
    def theme(self, choice: str):
        self._store.setValue("theme", choice)

    @property
    def recent(self) -> list[Path]:
        """Files opened lately that still exist, the newest first."""
        value = self._get("recent")
        names = [value] if isinstance(value, str) else value if isinstance(value, list) else []
        paths = [Path(name) for name in names if isinstance(name, str) and name and "\0" not in name]
        return [path for path in dict.fromkeys(paths) if path.is_absolute() and path.is_file()][:MOST_RECENT]

    def remember(self, path: Path):
        """Put a file at the head of the recent ones."""
        self._store.setValue("recent", [str(path), *(str(old) for old in self.recent if old != path)][:MOST_RECENT])

    def forget_recent(self):
        self._store.remove("recent")

    @property
    def layout(self) -> tuple[QByteArray, QByteArray] | None:
        """The window's geometry and the state of its docks, or None."""
        geometry, state = self._get("geometry"), self._get("docks")
        if str(self._get("version")) != str(VERSION) or not isinstance(geometry, QByteArray) or not isinstance(state, QByteArray):
            return None
        return geometry, state

    @layout.setter
    def layout(self, parts: tuple[QByteArray, QByteArray]):
        self._store.setValue("version", VERSION)
        self._store.setValue("geometry", parts[0])
        self._store.setValue("docks", parts[1])
        self._store.sync()

    def forget_layout(self):
        """Start with the built-in arrangement the next time."""
        for key in ("version", "geometry", "docks"):
            self._store.remove(key)

    def _get(self, key: str) -> object:
        try:
            return self._store.value(key)
        except (RuntimeError, ValueError, TypeError, SystemError, EOFError):     # what PySide raises on a mangled @Variant
            return None
