"""Whether the estimate can be believed and adaptive sampling pays, a line a scene: `python -m rtcore.reports.calibration SCENE ...`.

Tells the estimate over the true error at 16 uniform samples, and in what share of the time of 64 uniform samples, and with how many of its
own, adaptive sampling comes to their error. The two take turns, RUNS times.
"""
import argparse
import sys
from pathlib import Path

import numpy as np

from rtcore.camera import Camera
from rtcore.files import FileError, load
from rtcore.framing import framed
from rtcore.progressive import Renderer, RenderRequest
from rtcore.reports.convergence import RUNS, Reference, Row, compare, refer
from rtcore.reports.convergence_page import AT, seconds_to
from rtcore.scene import Scene
from rtcore.settings import Settings

EARLY = 16      # samples at which the estimate is judged


def passes(renderer: Renderer, scene: Scene, camera: Camera, settings: Settings, reference: Reference) -> list[Row]:
    """The whole passes of one render."""
    rows = {}
    for frame in renderer.frames(RenderRequest(scene, camera, settings), coarse=False):
        if (row := compare("", 0, frame, reference)) is not None:
            rows[frame.number] = row
    return list(rows.values())


def calibrated(scene: Scene, size: tuple[int, int], reference_samples: int) -> tuple[float, float, float, float]:
    """Error of AT uniform samples, estimate over error at EARLY, and of adaptive sampling the share of time and the samples to that error
    (NaN if it is not reached); means over RUNS seeds."""
    camera, renderer, found = framed(scene, size[0] / size[1]), Renderer(), []
    try:
        *_, step = refer(renderer, scene, camera, Settings(size=size), reference_samples)
        for adaptive in (True, False):      # kernels and arrays at hand
            passes(renderer, scene, camera, Settings(size=size, samples=2 * EARLY, adaptive=adaptive, seed=RUNS), step.reference)
        for seed in range(RUNS):
            uniform, chosen = (passes(renderer, scene, camera, Settings(size=size, samples=AT, adaptive=adaptive, seed=seed),
                                      step.reference) for adaptive in (False, True))
            early = next(row for row in uniform if row.samples == EARLY)
            errors, target = [row.rmse for row in chosen], uniform[-1].rmse
            seconds, samples = (seconds_to([getattr(row, name) for row in chosen], errors, target) for name in ("seconds", "samples"))
            reached = seconds is not None
            found.append((target, early.estimate / early.rmse if early.rmse else np.nan,
                          seconds / uniform[-1].seconds if reached else np.nan, samples if reached else np.nan))
    finally:
        renderer.close()
    return tuple(np.mean(found, axis=0).tolist())


def main(argv: list[str] | None = None) -> int:
    """Print the table, a line as soon as it is known."""
    parser = argparse.ArgumentParser(prog="python -m rtcore.reports.calibration", allow_abbrev=False)
    parser.add_argument("scenes", metavar="SCENE", nargs="+")
    parser.add_argument("--size", metavar="W H", nargs=2, type=int, default=(256, 192))
    parser.add_argument("--reference-spp", metavar="N", type=int, default=512)
    args = parser.parse_args(argv)
    print(f"| scene | rmse of {AT} uniform | estimate / rmse at {EARLY} | adaptive to the same: time | samples |")
    print("| --- | --- | --- | --- | --- |")
    for path in args.scenes:
        try:
            target, ratio, share, samples = calibrated(load(path), tuple(args.size), args.reference_spp)
        except FileError as error:
            print(f"rtcore.reports.calibration: {error}", file=sys.stderr)
            return 2
        print(f"| {Path(path).stem} | {target:.2g} | {ratio:.2f} | x {share:.2f} | {samples:.1f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
