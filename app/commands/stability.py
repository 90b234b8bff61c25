"""`rayscope stability`: how far the kernels are from the truth, as tables and plots."""
import os
import sys
from pathlib import Path

from app.commands._progress import Progress
from app.commands._shared import Parser, Refused, compile_missing, say
from app.commands.render import interruptible


def arguments(parser: Parser) -> None:
    """The options of the command."""
    parser.add_argument("-o", "--output", metavar="DIR", required=True, help="folder for the tables and plots, made if there is none")
    parser.add_argument("--shape", metavar="NAME", help="measure this shape only")
    parser.add_argument("--quick", action="store_true", help="fewer rays: done within a minute")


def run(args, parser: Parser) -> int:
    """Measure, write the report, and say which targets are missed; exit code 1 if any is."""
    from rtcore.files import WriteError, writable
    from rtcore.reports import stability
    if args.shape is not None and args.shape not in stability.SHAPES:
        parser.error(f"argument --shape: expected one of {', '.join(stability.SHAPES)}, got {args.shape!r}")
    folder = Path(args.output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        writable(folder / "stability.md")
    except WriteError as error:
        raise Refused(error, 2) from None
    except OSError as error:
        raise Refused(f"{folder}: cannot be made: {error.strerror}", 2) from None

    if args.shape is None:
        compile_missing(_missing())     # here, once, and not in each of the processes that measure
    rows, stopped = [], False
    with interruptible() as interrupted, Progress("stability") as bar:
        steps = stability.run([args.shape] if args.shape else None, args.quick)
        try:
            for step in steps:
                rows += step.rows
                bar.show(step.done / step.total, step.what)
                stopped = interrupted()
                if stopped:
                    break
        except ModuleNotFoundError as error:
            raise Refused(error, 1) from None
        finally:
            steps.close()
    if stopped and not rows:
        raise Refused("interrupted before there was anything to save", 130)
    try:
        stability.write(rows, folder, "Interrupted: only a part of it was measured." if stopped else "")
    except WriteError as error:
        raise Refused(error, 1) from None
    if stopped:
        say(f"interrupted; {folder} holds what was measured so far")
        return 130
    _draw(folder)
    missed = stability.misses(stability.in_order(rows))
    for line in missed:
        say(f"misses its target: {line}")
    if sys.stderr.isatty():
        say(f"{folder / 'stability.md'}: {sum(row.met is True for row in rows)} targets met, {len(missed)} missed")
    return 1 if missed else 0


def _missing() -> list[str]:
    """The kernels that the cache lacks, of all shapes in both precisions."""
    from rtcore.flatten import DTYPES
    from rtcore.scene import Node, Scene
    from rtcore.settings import Settings
    from rtcore.shapes import KINDS
    from rtcore.warm import missing
    scene = Scene(objects=[Node(shape=kind.example[0], transform=kind.example[1]) for kind in KINDS], lights=())
    return [name for precision in DTYPES for name in missing(scene, Settings(precision=precision))]


def _draw(folder: Path) -> None:
    """The plots beside the tables; one line where Qt or pyqtgraph is missing."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    try:
        from app import plots
    except ImportError as error:
        say(f"no plots, only tables: {error}")
        return
    plots.stability(folder)
