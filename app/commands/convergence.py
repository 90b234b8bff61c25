"""`rayscope convergence`: the error of a scene's picture against run time, by several methods, as tables and a plot."""
import os
import sys
from pathlib import Path

from app.commands._progress import Progress
from app.commands._shared import (Parser, Refused, compile_missing, enough_memory, loaded, real, refusing, say, settings_from, size,
                                  whole)
from app.commands.render import interruptible

SIZE, REFERENCE, BUDGET, DEFAULT = (256, 192), 1024, 10.0, "uniform,adaptive,f32"


def arguments(parser: Parser) -> None:
    """The options of the command."""
    parser.add_argument("scene", metavar="SCENE", help="scene or mesh file")
    parser.add_argument("-o", "--output", metavar="DIR", required=True, help="folder for the tables and the plot, made if there is none")
    parser.add_argument("--size", metavar="WxH", type=size, default=SIZE, help=f"width and height in pixels (default {SIZE[0]}x{SIZE[1]})")
    parser.add_argument("--reference-spp", metavar="N", type=whole, default=REFERENCE,
                        help=f"samples per pixel of the reference (default {REFERENCE})")
    parser.add_argument("--methods", metavar="NAME,...", default=DEFAULT,
                        help=f"of uniform, adaptive, f32 and f64, joined by + where several hold (default {DEFAULT})")
    parser.add_argument("--budget", metavar="SECONDS", type=real, default=BUDGET, help=f"time for each method (default {BUDGET:g})")
    parser.add_argument("--threads", metavar="N", type=whole, help="render threads (default: one per core)")


def run(args, parser: Parser) -> int:
    """Measure and write the report; what there is of it if interrupted."""
    from rtcore.files import WriteError, writable
    from rtcore.framing import framed
    from rtcore.reports import convergence
    methods = [name for name in dict.fromkeys(args.methods.split(",")) if name]
    for name in methods or [""]:
        if convergence.method(name) is None:
            parser.error(f"argument --methods: expected some of {', '.join(convergence.METHODS)}, got {name!r}")
    if not 8 <= args.reference_spp <= 1 << 20:
        parser.error(f"argument --reference-spp: expected a whole number from 8 to {1 << 20}, got {args.reference_spp}")
    if not 0 < args.budget < float("inf"):
        parser.error(f"argument --budget: expected a number greater than 0, got {args.budget}")
    settings = settings_from(parser, size=args.size, threads=args.threads)
    folder = Path(args.output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        writable(folder / "convergence.md")
    except WriteError as error:
        raise Refused(error, 2) from None
    except OSError as error:
        raise Refused(f"{folder}: cannot be made: {error.strerror}", 2) from None
    enough_memory(*settings.size)

    scene, _ = loaded(args.scene)
    rows, reference = [], None
    with refusing(args.scene):
        compile_missing(_missing(scene, settings, methods))
        with interruptible() as interrupted, Progress("convergence") as bar:
            for step in convergence.run(scene, framed(scene, settings.size[0] / settings.size[1]), settings, methods, args.reference_spp,
                                        args.budget, interrupted):
                rows += step.rows
                reference = step.reference or reference
                bar.show(step.share, step.what)
    if not rows:
        if interrupted():
            raise Refused("interrupted before there was anything to save", 130)
        raise Refused("no pass could be compared: give a larger --budget or --reference-spp, or the picture is free of error", 1)
    try:
        convergence.write(rows, reference, Path(args.scene).name, folder, "Interrupted: only a part was measured." if interrupted() else "")
    except WriteError as error:
        raise Refused(error, 1) from None
    _draw(folder)
    if interrupted():
        say(f"interrupted; {folder} holds what was measured so far")
        return 130
    if sys.stderr.isatty():
        say(f"{folder / 'convergence.md'}: {len(rows)} passes compared")
    return 0


def _missing(scene, settings, methods: list[str]) -> list[str]:
    """The kernels that the methods need and the cache lacks."""
    import msgspec

    from rtcore.reports.convergence import method
    from rtcore.warm import missing
    chosen = [settings, *(msgspec.structs.replace(settings, **method(name)) for name in methods)]
    return list(dict.fromkeys(name for one in chosen for name in missing(scene, one)))


def _draw(folder: Path) -> None:
    """The plot beside the tables; one line where Qt or pyqtgraph is missing."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    try:
        from app import curves
    except ImportError as error:
        say(f"no plot, only tables: {error}")
        return
    curves.draw(folder)
