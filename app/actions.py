"""Everything the window can be told to do, in one table; menus, toolbar, shortcuts and the shortcuts' dialog are made from it."""
from collections.abc import Callable
from typing import NamedTuple


class Action(NamedTuple):
    """`do` is called with the window, and for a switch with its new state as well. Tips are a sentence without its full stop."""

    id: str
    title: str
    icon: str
    shortcut: str
    tip: str
    do: Callable
    switch: bool = False


ACTIONS = (
    Action("open", "&Open…", "open", "Ctrl+O", "Open a scene, an NFF file or a mesh", lambda w: w.ask_open()),
    Action("gallery", "&Gallery…", "gallery", "Ctrl+G", "The scenes that come along, with pictures and notes", lambda w: w.gallery.open()),
    Action("reload", "&Reload", "reload", "F5", "Read the file again and keep the view", lambda w: w.reload()),
    Action("save", "&Save", "save", "Ctrl+S", "Save the scene with the camera as it is now", lambda w: w.save()),
    Action("save_as", "Save &as…", "", "Ctrl+Shift+S", "Save the scene under another name", lambda w: w.save_as()),
    Action("save_picture", "Save &picture…", "picture", "Ctrl+E", "Save the picture as PNG, or as EXR in linear light",
           lambda w: w.save_picture()),
    Action("quit", "&Quit", "", "Ctrl+Q", "Close the window", lambda w: w.close()),

    Action("undo", "&Undo", "undo", "Ctrl+Z", "Take back the last change of the scene", lambda w: w.session.document.undo()),
    Action("redo", "&Redo", "redo", "Ctrl+Shift+Z", "Do again what was taken back", lambda w: w.session.document.redo()),

    Action("back", "View &back", "back", "Alt+Left", "The view before this one", lambda w: w.session.back()),
    Action("forward", "View for&ward", "forward", "Alt+Right", "The view that Back left", lambda w: w.session.forward()),
    Action("frame_selection", "Frame &selection", "frame", "F", "Draw back until the selected node fills the picture",
           lambda w: w.session.frame_selection()),
    Action("frame_all", "Frame &all", "home", "Home", "Draw back until everything is in the picture", lambda w: w.session.frame_all()),
    Action("reset_view", "&Reset view", "reset", "Ctrl+Home", "The camera that the file came with", lambda w: w.session.reset_view()),
    Action("shadows", "S&hadows", "shadows", "1", "Let things stand in one another's light",
           lambda w, on: w.session.switch("shadows", on), True),
    Action("fog", "&Fog", "fog", "2", "Show the scene's fog", lambda w, on: w.switch_fog(on), True),
    Action("reflections", "R&eflections", "reflections", "3", "Follow mirrored and refracted light",
           lambda w, on: w.session.switch("reflections", on), True),
    Action("pause", "&Pause", "pause", "P", "Stop refining the picture, and go on from there; what changes meanwhile is shown with one "
           "sample per pixel", lambda w, on: w.session.pause(on), True),
    Action("region", "&Region of interest", "region", "R", "Draw a rectangle in the picture that is refined first; press again to drop it",
           lambda w, on: w.viewport.ask_region(on), True),
    Action("brighter", "&Brighter", "", ".", "Show the picture half a stop brighter", lambda w: w.session.brighten(0.5)),
    Action("darker", "&Darker", "", ",", "Show the picture half a stop darker", lambda w: w.session.brighten(-0.5)),
    Action("unexposed", "As &bright as it is", "", "0", "Show the light as it is, white at 1",
           lambda w: w.session.brighten(-w.session.options.exposure)),
    Action("panels", "&Panels", "panels", "Ctrl+.", "Show the panels, or only the picture", lambda w, on: w.show_panels(on), True),
    Action("fullscreen", "F&ull screen", "fullscreen", "F11", "Fill the screen with the picture, for the projector",
           lambda w, on: w.fill_screen(on), True),
    Action("arrange", "Reset the &layout", "", "", "Put the panels where they were in the beginning", lambda w: w.arrange()),

    Action("shortcuts", "&Keyboard and mouse", "keyboard", "F1", "What keys and mouse do", lambda w: w.show_shortcuts()),
    Action("about", "&About Rayscope", "about", "", "What this is", lambda w: w.show_about()),
)

#: Menus by title; None is a line, a name in <> a submenu that the window fills.
MENUS = (
    ("&File", ("open", "<recent>", "gallery", "reload", None, "save", "save_as", "save_picture", None, "quit")),
    ("&Edit", ("undo", "redo")),
    ("&View", ("back", "forward", None, "frame_selection", "frame_all", "reset_view", None, "shadows", "fog", "reflections", None,
               "pause", "region", "brighter", "darker", "unexposed", None, "<panels>", "<theme>", "panels", "fullscreen", "arrange")),
    ("&Help", ("shortcuts", "about")),
)

TOOLBAR = ("open", "gallery", "save", "save_picture", "reload", None, "undo", "redo", None, "back", "forward", "frame_selection",
           "frame_all", "reset_view", None, "shadows", "fog", "reflections", None, "pause", "region", "<space>", "panels",
           "fullscreen", "shortcuts")

#: Shown with their names in the toolbar, because a symbol alone would not tell.
WORDED = ("gallery", "shadows", "fog", "reflections")

#: What the mouse and the fly keys do in the picture, for the shortcuts' dialog.
MOUSE = (("Drag", "orbit around the point looked at"), ("Shift + drag, middle drag", "pan"),
         ("Wheel, right drag", "nearer or farther; the wheel toward the cursor"), ("Click", "select what is seen there"),
         ("Ctrl + click", "focus on what is seen there, if the camera has an aperture"),
         ("Ctrl + drag", "draw a region that is refined first"),
         ("W A S D, Q E", "fly; with Shift faster"), ("Esc", "drop the region; select nothing; leave the full screen"),
         ("Up, Down in a number", "step it; Page Up and Page Down by ten"))
