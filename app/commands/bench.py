"""`rayscope bench`: how fast pictures and rays are, beside the rivals that are installed."""
import sys
from pathlib import Path

from app.commands._progress import Progress
from app.commands._shared import Parser, Refused, same_file, say, writable_or_refused, write_json
from app.commands.render import interruptible

WIDTH = 150     # of the table where it goes to no terminal


def arguments(parser: Parser) -> None:
    """The options of the command."""
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="scene or mesh files; without any, scenes of our own and the gallery")
    parser.add_argument("-o", "--output", metavar="FILE.json", help="write the figures there as well")
    parser.add_argument("--against", metavar="NAMES", default="", help="rivals, such as povray,tachyon,embree,mitsuba")
    parser.add_argument("--latency", action="store_true", help="how soon the live picture answers each kind of edit, at 1280 x 720")
    parser.add_argument("--quick", action="store_true", help="tiny pictures, one round: whether all of it works, not how fast it is")


def run(args, parser: Parser) -> int:
    """Measure, print the table, and write the figures; what there is of them if interrupted."""
    from rtcore.files import FileError
    from rtcore.reports.bench import report
    from rtcore.reports.bench.jobs import WorkFailed
    from rtcore.reports.bench.rivals import RIVALS
    against = [name.strip() for name in args.against.split(",") if name.strip()]
    for name in against:
        if name not in RIVALS:
            parser.error(f"argument --against: expected some of {', '.join(RIVALS)}, got {name!r}")
    writable_or_refused(args.output)
    for scene in args.scenes:
        if same_file(scene, args.output):
            raise Refused(f"{args.output}: expected another file than the scene itself", 2)

    import resources
    from app.gallery import GALLERY
    if args.latency:
        return _latency([Path(scene) for scene in args.scenes] or sorted(GALLERY.glob("*.yaml")), args)
    ours = sorted((resources.ROOT / "meshes").glob("*.ply"))
    machine, step = report.machine(against), None
    command = [sys.executable, "-P", "-m", "app"]       # -P: not what happens to be called app in this folder
    with interruptible() as interrupted, Progress("measuring") as bar:
        steps = report.run(args.scenes, against, command, sorted(GALLERY.glob("*.yaml")), ours, args.quick)
        try:
            for step in steps:
                bar.show(step.share, step.what)
                if interrupted():
                    break
        except FileError as error:
            raise Refused(error, 2) from None
        except WorkFailed as error:
            if not interrupted():
                raise Refused(error, 1) from None
        finally:
            steps.close()
    if interrupted() and (step is None or not step.rows):
        raise Refused("interrupted before there was anything to tell", 130)
    _show(step.rows, machine)
    for note in step.notes:
        say(note)
    if args.output is not None:
        write_json(args.output, report.as_data(step.rows, step.notes, machine))
    if interrupted():
        say("interrupted; the table holds what was measured so far")
        return 130
    return 0


def _latency(scenes: list[Path], args) -> int:
    """Measure the live loop."""
    from rtcore.files import FileError
    from rtcore.reports.bench import latency, report
    told, machine = [], report.machine([])
    with interruptible() as interrupted, Progress("measuring") as bar:
        steps = latency.run(scenes, (160, 90) if args.quick else latency.SIZE, 2 if args.quick else 20)
        try:
            for step in steps:
                if isinstance(step, latency.Told):
                    told.append(step)
                else:
                    bar.show(len(told) / len(scenes), step)
                if interrupted():
                    break
        except FileError as error:
            raise Refused(error, 2) from None
        finally:
            steps.close()
    if not told:
        raise Refused("interrupted before there was anything to tell", 130)
    _show_latency(told, machine, latency.KINDS)
    if args.output is not None:
        write_json(args.output, latency.as_data(told, machine))
    if interrupted():
        say("interrupted; the table holds what was measured so far")
        return 130
    return 0


def _show_latency(told, machine: dict, kinds) -> None:
    """Middle and 95th percentile in milliseconds, and the eye's rays traced where there are any."""
    from rich.console import Console
    from rich.table import Table
    table = Table(title="milliseconds, p50 / p95; eye's rays traced", caption_justify="left",
                  caption=", ".join(f"{name} {value}" for name, value in machine.items()))
    for title in ("scene", "first frame", "drag", "stale", *kinds):
        table.add_column(title.replace("_", " "), justify="left" if title == "scene" else "right")

    def cell(figures, rays=0) -> str:
        return f"{figures.p50:.0f} / {figures.p95:.0f}" + (f"\n{rays:,}" if rays else "")
    for one in told:
        table.add_row(one.name, cell(one.first_frame), cell(one.drag), cell(one.stale),
                      *(cell(*one.edits[kind]) if kind in one.edits else "" for kind in kinds))
    Console(width=None if sys.stdout.isatty() else WIDTH + 40, markup=False, highlight=False).print(table)


def _show(rows, machine: dict) -> None:
    """The table and the machine, on stdout."""
    from rich.console import Console
    from rich.table import Table
    table = Table(caption=", ".join(f"{name} {value}" for name, value in machine.items()), caption_justify="left")
    for title, justify in (("work", "left"), ("ours", "right"), ("rival", "right"), ("", "left"), ("ratio", "right"), ("spread", "right"),
                           ("target", "right"), ("met", "left")):
        table.add_column(title, justify=justify, overflow="fold")
    for row in rows:
        rival = "" if row.rival is None else f"{row.rival:.3g} {row.unit}"
        ratio = "" if row.ratio is None else f"{row.ratio:.2f}"
        met = "" if row.met is None else "yes" if row.met else "no"
        table.add_row(row.work, f"{row.ours:.3g} {row.unit}", rival, row.rival_name or "", ratio, f"{row.spread:.0%}",
                      row.target.words(row.unit) if row.target else "", met)
    Console(width=None if sys.stdout.isatty() else WIDTH, markup=False, highlight=False).print(table)
