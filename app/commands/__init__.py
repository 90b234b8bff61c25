"""The commands of the command line: one file each. Listed once, here, with a line of help, and imported when one is called.

A command has `arguments(parser)` and `run(args, parser) -> exit code`. None of them imports Qt, but for the plots of the reports where it
is there.
"""
from importlib import import_module
from types import ModuleType

COMMANDS = {
    "render": "render a scene to a picture",
    "plan": "say which stages a scene needs, which are left out, and why",
    "convergence": "measure the error of a scene's picture against run time, by several methods",
    "stability": "measure numerical stability on extreme cases, every shape and solver against a 50-digit oracle",
    "bench": "measure how fast pictures and rays are, beside other ray tracers",
    "check": "say whether a scene file is sound, or where it is not",
    "warm": "compile every kernel into the cache, or only what some scenes need",
}


def command(name: str) -> ModuleType:
    """The module of a command."""
    return import_module(f"app.commands.{name}")
