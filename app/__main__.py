"""The command line: `rayscope [SCENE]` opens the window, `rayscope COMMAND ...` does its work without one.

Exit codes: 0 done, 1 the work failed, 2 wrong use or a bad input file, 130 interrupted.
"""
import atexit
import gc
import os
import sys

from app.commands import COMMANDS, command
from app.commands._shared import Parser, Refused, say

FALLBACK = "rayscope.png"       # what the scene is rendered to where there is no display
NEW_OBJECTS = 20_000            # between two looks for garbage: at Python's 700 they take 50 ms while a command's modules are imported


def main(argv: list[str] | None = None) -> int:
    """Run one command line (`sys.argv` unless given) and return the exit code."""
    argv = sys.argv[1:] if argv is None else argv
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")       # a file's name may be no text
    try:
        code = _run(argv)
        sys.stdout.flush()
        return code
    except SystemExit as error:     # argparse: after --help, or a usage error that it has explained
        return error.code if isinstance(error.code, int) else 2
    except Refused as error:
        say(str(error))
        return error.code
    except MemoryError:
        say("there is not enough memory for this")
        return 1
    except KeyboardInterrupt:
        say("interrupted; nothing was written")
        return 130
    except OSError as error:        # results can't be written to stdout: its reader has gone, or a disk is full
        if not isinstance(error, BrokenPipeError):
            say(f"{error.filename or 'stdout'}: {error.strerror or error}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())      # or Python would try again on exit, and complain
        return 1


def _run(argv: list[str]) -> int:
    if argv and argv[0] in COMMANDS:
        gc.set_threshold(NEW_OBJECTS)
        atexit.register(gc.freeze)      # or Python goes through all objects once more before it ends: 0.2 s
        return _command(argv[0], argv[1:])

    listed = "".join(f"\n  {name:12} {words}" for name, words in COMMANDS.items())
    parser = Parser(prog="rayscope", description="Explore a scene by ray tracing.", usage="rayscope [SCENE] | rayscope COMMAND ...",
                    epilog="commands, each with a --help of its own:" + listed)
    parser.add_argument("scene", metavar="SCENE", nargs="?", help="scene or mesh file to open in the window")
    parser.add_argument("--version", action="version", version=f"rayscope {_version()}")
    scene = parser.parse_args(argv).scene
    if scene is not None and "." not in scene and not os.path.exists(scene):
        from difflib import get_close_matches
        near = "".join(f" (did you mean {word!r}?)" for word in get_close_matches(scene, COMMANDS, 1, 0.6))
        parser.error(f"expected a scene file or one of {', '.join(COMMANDS)}, got {scene!r}{near}")
    return _window(scene)


def _command(name: str, arguments: list[str]) -> int:
    """Do a command's work."""
    module = command(name)
    parser = Parser(prog=f"rayscope {name}", description=COMMANDS[name])
    module.arguments(parser)
    return module.run(parser.parse_args(arguments), parser)


def _window(scene: str | None) -> int:
    """Open the window, or where there is no display say so and render instead."""
    if has_display():
        from app.gui import run
        return run(scene)
    if scene is None:
        from app.gallery import FIRST_SCENE
        scene = str(FIRST_SCENE)
    say(f"there is no display for the window; rendering {scene} to {FALLBACK} instead")
    return _command("render", [f"-o{FALLBACK}", "--", scene])


def has_display() -> bool:
    """Whether a window can be hoped for: always but on Linux and the like, where a display is named by the environment."""
    if sys.platform in ("darwin", "win32"):
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"))


def _version() -> str:
    from importlib import metadata
    try:
        return metadata.version("rayscope")
    except metadata.PackageNotFoundError:       # run from a checkout
        import rtcore
        return rtcore.__version__


if __name__ == "__main__":
    sys.exit(main())
