"""The window: docks, menus and toolbar made from PANELS and ACTIONS, and the questions that it asks."""
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QSize, Qt, QTimer, Slot
from PySide6.QtGui import QAction, QActionGroup, QGuiApplication, QKeySequence
from PySide6.QtWidgets import (QApplication, QDockWidget, QFileDialog, QMainWindow, QMenu, QMessageBox, QSizePolicy, QTabWidget,
                               QWidget)

from app import dialogs, theme
from app.actions import ACTIONS, MENUS, TOOLBAR, WORDED, Action
from app.filing import Filing
from app.gallery import GALLERY
from app.gallery_dialog import Gallery
from app.icons import app_icon, icon
from app.notices import Busy, Notice
from app.panels import PANELS
from app.session import Session
from app.settings import Preferences
from app.status import Status
from app.viewport import Viewport

AREAS = {"left": Qt.DockWidgetArea.LeftDockWidgetArea, "right": Qt.DockWidgetArea.RightDockWidgetArea,
         "bottom": Qt.DockWidgetArea.BottomDockWidgetArea}
SCENES = "Scenes and meshes (*.yaml *.yml *.json *.nff *.obj *.ply *.stl *.glb *.gltf *.off);;All files (*)"
UPPER = 300     # pixels of height for the panels above them
TALL = 900      # pixels of a screen from which on the properties stand below the other panels and not behind them


class Window(QMainWindow):
    """Puts things together and holds no state of its own: the session has it all."""

    def __init__(self, session: Session, preferences: Preferences):
        theme.set_size(QApplication.instance())
        super().__init__()
        self.session, self.preferences = session, preferences
        self.filing = Filing(session)
        self.actions_by_id: dict[str, QAction] = {}
        self.panels: dict[str, QWidget] = {}
        self.docks: dict[str, QDockWidget] = {}
        self._submenus: dict[str, QMenu] = {}
        self._hidden: list[QDockWidget] = []
        self._sure = False
        self.setWindowIcon(app_icon())
        self.setAcceptDrops(True)
        options = QMainWindow.DockOption
        self.setDockOptions(options.AnimatedDocks | options.AllowTabbedDocks | options.AllowNestedDocks | options.GroupedDragging)
        self.setTabPosition(Qt.DockWidgetArea.AllDockWidgetAreas, QTabWidget.TabPosition.North)
        self.viewport = Viewport(session, self)
        self.setCentralWidget(self.viewport)
        self.notice = Notice(session, self.viewport)
        self.busy = Busy(session, self.filing, self.viewport)
        self.gallery = Gallery(session, self)
        self.setStatusBar(Status(session, self))
        self._make_docks()
        self._make_actions()
        self._make_menus()
        self._make_toolbar()
        session.document.changed.connect(self._refresh)
        session.camera_changed.connect(self._refresh)
        session.options_changed.connect(self._refresh)
        session.paused_changed.connect(self._refresh)
        self.viewport.asking_changed.connect(self._refresh)
        self.filing.opened.connect(self._remember)
        self.gallery.chosen.connect(self.open)
        QGuiApplication.styleHints().colorSchemeChanged.connect(self._scheme_changed)
        self.dress()
        self._restore()
        self._refresh()

    # building

    def _make_docks(self):
        for panel in PANELS:
            widget = panel(self.session)
            dock = QDockWidget(panel.title, self)
            dock.setObjectName(f"dock-{panel.title.lower()}")
            dock.setWidget(widget)
            dock.setFeatures(QDockWidget.DockWidgetFeature.DockWidgetMovable | QDockWidget.DockWidgetFeature.DockWidgetFloatable
                             | QDockWidget.DockWidgetFeature.DockWidgetClosable)
            dock.setAccessibleName(panel.title)
            dock.toggleViewAction().setToolTip(panel.tip)
            dock.visibilityChanged.connect(self._title_docks)
            self.panels[panel.title], self.docks[panel.title] = widget, dock

    @Slot()
    def _title_docks(self):
        """A dock among tabs has its title there and needs no second one below."""
        for dock in self.docks.values():
            among_tabs = bool(self.tabifiedDockWidgets(dock)) and not dock.isFloating()
            if among_tabs and dock.titleBarWidget() is None:
                dock.setTitleBarWidget(QWidget(dock))
            elif not among_tabs and dock.titleBarWidget() is not None:
                dock.setTitleBarWidget(None)

    def arrange(self):
        """The built-in arrangement: the tree left; right the rest in tabs, on a tall screen the properties below them; what belongs to the
        bottom is in tabs there, and hidden until it is asked for."""
        height = self.screen().availableGeometry().height()
        right: list[QDockWidget] = []
        bottom: list[QDockWidget] = []
        for panel in PANELS:
            dock = self.docks[panel.title]
            self.removeDockWidget(dock)
            self.addDockWidget(AREAS[panel.area], dock)
            dock.setFloating(False)
            dock.setVisible(panel.area != "bottom")
            if panel.area == "right":
                right.append(dock)
            elif panel.area == "bottom":
                bottom.append(dock)
        for dock in bottom[1:]:
            self.tabifyDockWidget(bottom[0], dock)
        last = self.docks["Properties"]
        tabs = [dock for dock in right if dock is not last or height < TALL]
        for dock in tabs[1:]:
            self.tabifyDockWidget(tabs[0], dock)
        tabs[0].raise_()
        self.resizeDocks([self.docks["Scene"], tabs[0]], [230, 320], Qt.Orientation.Horizontal)
        if last not in tabs:
            self.resizeDocks([tabs[0], last], [UPPER, max(UPPER, self.height() - UPPER - 140)], Qt.Orientation.Vertical)

    def _make_actions(self):
        for entry in ACTIONS:
            action = QAction(entry.title, self)
            action.setShortcut(QKeySequence(entry.shortcut))
            action.setCheckable(entry.switch)
            keys = f" ({QKeySequence(entry.shortcut).toString(QKeySequence.SequenceFormat.NativeText)})" if entry.shortcut else ""
            action.setToolTip(entry.tip + keys)
            action.setStatusTip("")
            action.triggered.connect(self._doing(entry))
            self.addAction(action)      # so that shortcuts work while the menu bar is hidden
            self.actions_by_id[entry.id] = action
        self.actions_by_id["panels"].setChecked(True)

    def _doing(self, entry: Action) -> Callable:
        return (lambda on: entry.do(self, on)) if entry.switch else (lambda _=False: entry.do(self))

    def _make_menus(self):
        fillers = {"<recent>": ("Open &recent", self._fill_recent), "<panels>": ("Pa&nel", self._fill_panels),
                   "<theme>": ("&Theme", self._fill_theme)}
        for name, (title, fill) in fillers.items():
            menu = QMenu(title, self)
            menu.setToolTipsVisible(True)
            menu.aboutToShow.connect(fill)
            self._submenus[name] = menu
            fill()
        for title, names in MENUS:
            menu = self.menuBar().addMenu(title)
            menu.setToolTipsVisible(True)
            for name in names:
                if name is None:
                    menu.addSeparator()
                elif name in self._submenus:
                    menu.addMenu(self._submenus[name])
                else:
                    menu.addAction(self.actions_by_id[name])

    def _make_toolbar(self):
        bar = self.toolbar = self.addToolBar("Toolbar")
        bar.setObjectName("toolbar")
        bar.setMovable(False)
        bar.setIconSize(QSize(20, 20))
        bar.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        for name in TOOLBAR:
            if name is None:
                bar.addSeparator()
            elif name == "<space>":
                space = QWidget()
                space.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
                bar.addWidget(space)
            else:
                bar.addAction(self.actions_by_id[name])
                button = bar.widgetForAction(self.actions_by_id[name])
                button.setAccessibleName(self.actions_by_id[name].text().replace("&", "").removesuffix("…"))
                if name in WORDED:
                    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)

    def _fill_recent(self):
        menu = self._submenus["<recent>"]
        menu.clear()
        for path in self.preferences.recent:
            menu.addAction(path.name, lambda path=path: self.open(path)).setToolTip(str(path))
        menu.setEnabled(not menu.isEmpty())
        if not menu.isEmpty():
            menu.addSeparator()
            menu.addAction("Forget these", self.preferences.forget_recent).setToolTip("Empty this list; the files stay")

    def _fill_panels(self):
        menu = self._submenus["<panels>"]
        menu.clear()
        for dock in self.docks.values():
            menu.addAction(dock.toggleViewAction())

    def _fill_theme(self):
        menu = self._submenus["<theme>"]
        if menu.isEmpty():
            group = QActionGroup(menu)
            titles = {"system": "Like the &desktop", "light": "&Light", "dark": "&Dark"}
            for choice in theme.CHOICES:
                action = menu.addAction(titles[choice], lambda choice=choice: self.choose_theme(choice))
                action.setCheckable(True)
                action.setChecked(choice == self.preferences.theme)
                action.setToolTip("Follow the desktop" if choice == "system" else f"The {choice} palette")
                group.addAction(action)

    # looks

    def choose_theme(self, choice: str):
        """Use and remember a theme."""
        self.preferences.theme = choice
        self.dress()

    def dress(self):
        """Put on the theme of the preferences."""
        chosen = theme.wanted(self.preferences.theme)
        theme.apply(QApplication.instance(), chosen)
        for entry in ACTIONS:
            if entry.icon:
                self.actions_by_id[entry.id].setIcon(icon(entry.icon, chosen))
        for widget in (self.viewport, self.notice, self.gallery, *self.panels.values()):
            if hasattr(widget, "dress"):
                widget.dress(chosen)

    @Slot()
    def _scheme_changed(self):
        if self.preferences.theme == "system":
            self.dress()

    def _restore(self):
        layout = self.preferences.layout
        room = self.screen().availableGeometry().size()
        self.resize(min(1500, round(room.width() * 0.9)), min(950, round(room.height() * 0.9)))
        self.arrange()
        if layout is not None and not (self.restoreGeometry(layout[0]) and self.restoreState(layout[1])):
            self.arrange()

    @Slot()
    def _refresh(self):
        document, views = self.session.document, self.session.views
        name = document.path.name if document.path else document.scene.name or "Untitled"
        self.setWindowTitle(f"{name}[*] - Rayscope")
        self.setWindowModified(document.modified)
        for which, label in (("undo", document.undo_label), ("redo", document.redo_label)):
            action = self.actions_by_id[which]
            action.setEnabled(label is not None)
            action.setText(f"&{which.capitalize()}" + (f" {label}" if label else ""))
        self.actions_by_id["back"].setEnabled(views.can_back)
        self.actions_by_id["forward"].setEnabled(views.can_forward)
        for which in ("shadows", "fog", "reflections"):
            self.actions_by_id[which].setChecked(getattr(self.session.options, which))
        self.actions_by_id["region"].setChecked(self.viewport.asking or self.session.options.region is not None)
        self.actions_by_id["pause"].setChecked(self.session.paused)
        self.actions_by_id["unexposed"].setEnabled(self.session.options.exposure != 0)

    # what actions ask for

    def open(self, path: Path):
        """Open a file, after asking about unsaved changes."""
        self._unless_unsaved("opening another file", lambda: self.filing.open(path))

    def ask_open(self):
        """Let a file be chosen, and open it."""
        here = self.session.document.path
        name, _ = QFileDialog.getOpenFileName(self, "Open a scene", str(here.parent if here else Path.cwd()), SCENES)
        if name:
            self.open(Path(name))

    def reload(self):
        """Read the file again; the view stays."""
        if self.session.document.path is not None:
            self._unless_unsaved("reading the file again", self.filing.reload)

    def save(self, then: Callable[[], None] = lambda: None):
        """Save where the scene came from, or ask where."""
        path = self.filing.in_place
        if path is None:
            self.save_as(then)
        else:
            self.filing.save(path, then)

    def save_as(self, then: Callable[[], None] = lambda: None):
        """Ask for a name and save there."""
        start = self.filing.in_place or self._suggested("scene.yaml")
        name, _ = QFileDialog.getSaveFileName(self, "Save the scene", str(start), "Scenes (*.yaml)")
        if name:
            self.filing.save(Path(name) if Path(name).suffix else Path(name).with_suffix(".yaml"), then)

    def _suggested(self, name: str) -> Path:
        """A name for a new file: the open one's beside it, or in the current folder where that is a gallery scene; else `name`."""
        here = self.session.document.path
        if here is None:
            return Path.cwd() / name
        folder = Path.cwd() if here.parent == GALLERY else here.parent
        return folder / here.with_suffix(Path(name).suffix).name

    def save_picture(self):
        """Ask for a name and save what is on the screen."""
        start = self._suggested("rayscope.png")
        name, _ = QFileDialog.getSaveFileName(self, "Save the picture", str(start), "Pictures (*.png *.exr)")
        if name:
            self.filing.save_picture(Path(name) if Path(name).suffix else Path(name).with_suffix(".png"))

    def switch_fog(self, on: bool):
        """Show the fog or leave it out; where there is none, say where it is to be had."""
        self.session.switch("fog", on)
        fog = self.session.scene.fog
        if on and (fog is None or not fog.on):
            self.session.said.emit("info", "This scene has no fog of its own: switch it on in the Fog panel.")

    def show_panels(self, on: bool):
        """Show the docks that were there, or only the picture."""
        if on:
            for dock in self._hidden or [self.docks[panel.title] for panel in PANELS if panel.area != "bottom"]:
                dock.show()
        else:
            self._hidden = [dock for dock in self.docks.values() if not dock.isHidden()]
            for dock in self._hidden:
                dock.hide()
        self.actions_by_id["panels"].setChecked(on)

    def fill_screen(self, on: bool):
        """Nothing but the picture on the whole screen, and back."""
        self.actions_by_id["fullscreen"].setChecked(on)
        for bar in (self.menuBar(), self.toolbar, self.statusBar()):
            bar.setVisible(not on)
        self.show_panels(not on)
        full, state = Qt.WindowState.WindowFullScreen, self.windowState()
        self.setWindowState(state | full if on else state & ~full)

    def show_shortcuts(self):
        """The dialog of keys and mouse."""
        dialogs.shortcuts_dialog(self).show()

    def show_about(self):
        """The dialog that says what this is."""
        dialogs.about_dialog(self).open()

    # files dropped, window closed

    def keyPressEvent(self, event):
        if event.key() == Qt.Key.Key_Escape and self.isFullScreen():
            self.fill_screen(False)
        else:
            super().keyPressEvent(event)

    def dragEnterEvent(self, event):
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event):
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        if paths:
            event.acceptProposedAction()
            self.open(paths[0])

    def closeEvent(self, event):
        if self.session.document.modified and not self._sure:
            event.ignore()
            self._unless_unsaved("closing", self._close_for_sure)
            return
        if self.isFullScreen():
            self.fill_screen(False)
        if not self.actions_by_id["panels"].isChecked():
            self.show_panels(True)
        self.preferences.layout = self.saveGeometry(), self.saveState()
        for panel in self.panels.values():
            if hasattr(panel, "close_down"):
                panel.close_down()
        self.session.close()
        event.accept()

    def _close_for_sure(self):
        self._sure = True
        QTimer.singleShot(0, self.close)        # not from within closeEvent, where a close is ignored

    def _unless_unsaved(self, doing: str, then: Callable[[], None]):
        """Do it at once if all is saved; else ask, and do it after the save or the discard."""
        if not self.session.document.modified:
            return then()
        path = self.session.document.path
        answer = dialogs.ask_unsaved(self, path.name if path else "Untitled", doing)
        if answer == QMessageBox.StandardButton.Save:
            self.save(then)
        elif answer == QMessageBox.StandardButton.Discard:
            then()

    @Slot(object)
    def _remember(self, path: Path):
        if path.parent != GALLERY:
            self.preferences.remember(path)
            self._fill_recent()
