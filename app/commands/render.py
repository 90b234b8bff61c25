"""`rayscope render`: a picture of a scene, without a window."""
import argparse
import contextlib
import math
import signal
import sys
import time
from collections.abc import Iterator

from app.commands._progress import Progress, time_in_words
from app.commands._shared import (
    Parser,
    Refused,
    compile_missing,
    enough_memory,
    loaded,
    real,
    refusing,
    same_file,
    say,
    settings_from,
    size,
    whole,
    writable_or_refused,
    write_json,
)
from app.forecast import Forecast

SAMPLES = 16            # unless something else is asked for
NO_END = 1 << 16        # samples that a limit of time or error cuts short
SECONDS = ("load", "prepare", "compile", "trace", "total")


def arguments(parser: Parser) -> None:
    """The options of the command."""
    parser.add_argument("scene", metavar="SCENE", help="scene or mesh file")
    parser.add_argument("-o", "--output", metavar="OUT", required=True, help="the picture: .png in sRGB or .exr in linear light")
    parser.add_argument("--size", metavar="WxH", type=size, help="width and height in pixels (default 640x480)")
    end = parser.add_mutually_exclusive_group()
    end.add_argument("--spp", metavar="N", type=whole, help=f"samples per pixel (default {SAMPLES})")
    end.add_argument("--time", metavar="SECONDS", type=real, help="trace for this long; every pixel gets its first sample in any case")
    end.add_argument("--error", metavar="E", type=real, help="trace until the estimated root mean square error is this")
    parser.add_argument("--adaptive", action=argparse.BooleanOptionalAction,
                        help="put the samples where the error is (default: with --time and --error); --spp is then their mean")
    parser.add_argument("--filter", metavar="NAME", help="pixel filter: box (the default), gaussian or mitchell")
    parser.add_argument("--precision", metavar="f32|f64", help="float type of the geometry (default f64)")
    parser.add_argument("--solver", metavar="NAME", help="how hits are found: certain (the default) or textbook: spheres by b² - 4ac")
    parser.add_argument("--threads", metavar="N", type=whole, help="render threads (default: one per core)")
    parser.add_argument("--max-depth", metavar="N", type=whole, help="longest chain of rays, the eye's included (default 5)")
    parser.add_argument("--no-shadows", action="store_true", help="trace no shadow rays")
    parser.add_argument("--no-fog", action="store_true", help="leave the scene's fog out")
    parser.add_argument("--no-reflections", action="store_true", help="follow no reflected and refracted rays")
    parser.add_argument("--view", metavar="NAME", help="what the picture shows (default beauty)")
    parser.add_argument("--seed", metavar="N", type=whole, help="start of the samples' scatter (default 0)")
    parser.add_argument("--stats", metavar="FILE.json", help="write counts and times there")


def run(args, parser: Parser) -> int:
    """Render, save the picture and the stats; what there is of them if interrupted."""
    start = time.perf_counter()
    samples = args.spp if args.spp is not None else SAMPLES if args.time is None and args.error is None else NO_END
    adaptive = args.adaptive if args.adaptive is not None else args.time is not None or args.error is not None
    settings = settings_from(
        parser, size=args.size, samples=samples, adaptive=adaptive, seconds=args.time, error=args.error, filter=args.filter,
        precision=args.precision, solver=args.solver, threads=args.threads, max_depth=args.max_depth, shadows=not args.no_shadows,
        fog=not args.no_fog, reflections=not args.no_reflections, view=args.view, seed=args.seed)
    _check_outputs(args)
    enough_memory(*settings.size)

    from rtcore.framing import framed
    from rtcore.warm import missing
    with Progress(f"loading {args.scene}"):
        scene, load_time = loaded(args.scene)
    width, height = settings.size
    with compile_time() as compiling, refusing(args.scene):
        compile_missing(missing(scene, settings))
        with interruptible() as interrupted:
            pixels, stats = trace(scene, framed(scene, width / height), settings, interrupted)
            if pixels is None:
                raise Refused("interrupted before there was anything to save", 130)
            _save(args.output, pixels, scene, stats)
            if args.stats:
                seconds = {"load": load_time, **stats["seconds"], "compile": compiling(), "total": time.perf_counter() - start}
                write_json(args.stats, {"scene": args.scene, **stats, "seconds": {key: seconds[key] for key in SECONDS}})
    if interrupted():
        say(f"interrupted; {args.output} shows what was rendered so far, {stats['samples_per_pixel']} samples per pixel")
        return 130
    if sys.stderr.isatty():
        took = time_in_words(time.perf_counter() - start)
        say(f"{args.output}: {width} x {height}, {stats['samples_per_pixel']} samples per pixel, {took}")
    return 0


def _check_outputs(args) -> None:
    """Refuse, before the work begins, names that no result can be written to."""
    from rtcore.files import WriteError
    from rtcore.files.image import check_suffix
    try:
        check_suffix(args.output)
    except WriteError as error:
        raise Refused(error, 2) from None
    for path in (args.output, args.stats):
        writable_or_refused(path)
        if same_file(path, args.scene):
            raise Refused(f"{path}: expected another file than the scene itself", 2)
    if same_file(args.output, args.stats):
        raise Refused(f"{args.stats}: expected another file for the stats than for the picture", 2)


def trace(scene, camera, settings, interrupted):
    """Render with progress until it is done or interrupted. Returns the pixels, None if there are none yet, and the stats."""
    from rtcore.progressive import Renderer, RenderRequest
    renderer, frame, forecast = Renderer(), None, Forecast()
    start = time.monotonic()
    try:
        aim = f" of {settings.samples} samples" if settings.error is None else f" samples, until the error is {settings.error:g}"
        with Progress("rendering") as bar:
            for frame in renderer.frames(RenderRequest(scene, camera, settings, hits=False), interrupted, coarse=False):
                used = time.monotonic() - start
                if settings.seconds is not None:
                    bar.show(min(used / settings.seconds, 1.0), f"{frame.mean:.4g} samples", max(settings.seconds - used, 0.0))
                elif settings.error is None:
                    bar.show(renderer.progress, f"{frame.mean:.4g}{aim}")
                else:
                    forecast.note(frame.elapsed, frame.mean, frame.error)
                    ends = forecast.left(settings.samples, None, settings.error) if frame.error else None
                    left = 0.0 if frame.done else sum(ends) / 2 if ends else math.inf
                    bar.show(used / (used + left), f"{frame.mean:.4g}{aim}", left if left < math.inf else None)
        if frame is None:
            return None, {}
        return frame.pixels if frame.done else renderer.picture(), renderer.stats()
    finally:
        renderer.close()


@contextlib.contextmanager
def interruptible() -> Iterator:
    """A context in which Ctrl-C only makes the yielded function true; a second one ends the process at once."""
    pressed = []

    def note(signum, frame):
        pressed.append(signum)
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def compile_time() -> Iterator:
    """A context that yields a function: seconds that numba has compiled within it."""
    from numba.core import event
    timer = event.TimingListener()
    with event.install_listener("numba:compile", timer):
        yield lambda: timer.duration if timer.done else 0.0


def _save(path: str, pixels, scene, stats: dict) -> None:
    from rtcore.files import FileError, save_image
    try:
        save_image(pixels, path, text={"Title": scene.name or "Rayscope", "Samples": str(stats["samples_per_pixel"])})
    except FileError as error:
        raise Refused(error, 1) from None
