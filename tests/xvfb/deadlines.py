"""Drags the camera of the real window and measures, from what is on the screen, how soon a picture of the new view is there.

    python tests/xvfb/deadlines.py [--scene NAME ...] [--size WxH] [--allow MS] [-o DIR]

A marker in the scene tells which view a picture is of: where its middle must be on the screen follows from the camera. After a move from
rest it has to be there within 100 ms; while dragging, each step of 60 a second within that too, and pictures follow one another within
33 ms. Exits with 1 if the 95th percentile of any is beyond its deadline by more than `--allow`. Needs what drive.py needs.
"""
import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2])]

import msgspec  # noqa: E402
import numpy as np  # noqa: E402
from display import Eyes, Failed, Fingers, Hands, display, missing_tools  # noqa: E402

import rtcore  # noqa: E402
from app.gallery import GALLERY  # noqa: E402
from rtcore.camera import orbit  # noqa: E402
from rtcore.framing import framed  # noqa: E402
from rtcore.scene import Material, Node, Scene  # noqa: E402
from rtcore.shapes import Sphere  # noqa: E402

ANSWER, MOTION = 100, 33.4      # ms
LOOK = 0.001                    # s between two looks at the screen
COPIED = 0.005                  # s that the server may take to copy a picture
NEAR = 12                       # pixels by which the marker's middle may be off: the first lattice is coarse
STEP, RATE = 8, 60              # pixels a step of the drag, steps a second
JUMP = 60                       # pixels of a move from rest
NONE = float("nan")


def marked(scene: Scene, aspect: float) -> tuple[Scene, tuple[float, float, float]]:
    """The scene with a magenta ball that shines by itself, a third of the way from what is looked at to the eye; and its middle."""
    camera = framed(scene, aspect)
    eye, at = np.array(camera.lookfrom), np.array(camera.lookat)
    middle = at + (eye - at) / 3
    radius = 0.06 * float(np.linalg.norm(eye - middle)) * np.tan(np.radians(camera.fov) / 2)
    ball = Node(name="marker", shape=Sphere(tuple(middle.tolist()), float(radius)), material=Material(
        color=(0, 0, 0), emission=(1, 0, 1), ambient=0, diffuse=0))
    fog = scene.fog and msgspec.structs.replace(scene.fog, on=False)
    return msgspec.structs.replace(scene, objects=(*scene.objects, ball), camera=camera, fog=fog), tuple(middle.tolist())


class Watch:
    """Sees where the marker is, and remembers each place with the time."""

    def __init__(self, eyes: Eyes, fingers: Fingers, rect: list[int]):
        self._eyes, self.fingers, (self.x, self.y, self.width, self.height) = eyes, fingers, rect
        self.seen: list[tuple[float, float]] = []       # time, pixels from the picture's left edge; only when it is another place

    def look(self):
        band = self._eyes.pixels[self.y + self.height // 3:self.y + 2 * self.height // 3:2, self.x:self.x + self.width]
        now = time.perf_counter()
        blue, green, red = (band[..., k].astype(np.int16) for k in range(3))
        columns = np.flatnonzero(((red > 150) & (blue > 150) & (green < 90)).any(axis=0))
        place = float(columns.mean()) if len(columns) else NONE
        if not self.seen or place != self.seen[-1][1]:
            self.seen.append((now, place))

    def until(self, when: float):
        while time.perf_counter() < when:
            self.look()
            time.sleep(LOOK)

    def views(self, since: float, until: float) -> list[float]:
        """When another view came: not only a finer picture of the same, nor one that the server had copied in part."""
        times, last = [], NONE
        for (when, x), (after, _) in zip(self.seen, [*self.seen[1:], (np.inf, NONE)]):
            if after - when > COPIED and not abs(x - last) < STEP:
                last = x
                times += [when] if since <= when <= until else []
        return times

    def reached(self, place: float, since: float, side: int) -> float:
        """When the marker was first at a place, or beyond it in the direction of the drag, in ms; inf if never."""
        return next((1000 * (when - since) for when, x in self.seen if when >= since and side * (x - place) >= -NEAR), np.inf)


def measure(hands: Hands, eyes: Eyes, fingers: Fingers, scene: Scene, middle) -> dict[str, np.ndarray]:
    """Milliseconds of moves from rest, of steps of a drag, and between pictures of it."""
    state = hands.state()
    watch = Watch(eyes, fingers, state["picture"])
    height, width = watch.height, watch.width
    start = watch.x + width // 2, watch.y + height * 9 // 10

    def place(pixels: float) -> float:
        return orbit(scene.camera, np.pi * pixels / height, 0.0).project(middle, width, height)[0]
    watch.look()
    if not abs(watch.seen[-1][1] - place(0)) < NEAR:
        raise Failed(f"the marker is at {watch.seen[-1][1]:.0f} and not at {place(0):.0f}")
    side = 1 if place(JUMP) > place(0) else -1
    rest, steps, between = [], [], []
    for turn in range(10):
        fingers.move(*start)
        watch.until(time.perf_counter() + 0.2)
        there, back = (0, JUMP) if turn % 2 == 0 else (JUMP, 0)
        fingers.press(True)
        watch.until(time.perf_counter() + 0.1)
        moved = time.perf_counter()
        fingers.move(start[0] + back - there, start[1])
        watch.until(moved + 0.8)
        fingers.press(False)
        rest.append(watch.reached(place(back), moved, side * (1 if back else -1)))
    count = int(min(0.25 * height, 0.4 * width) / STEP)
    for turn in range(4):
        onward = 1 if turn % 2 == 0 else -1
        total = 0 if onward > 0 else count * STEP
        fingers.move(*start)
        watch.until(time.perf_counter() + 0.6)
        fingers.press(True)
        watch.until(time.perf_counter() + 0.1)
        began, moves = time.perf_counter(), []
        for i in range(1, count + 1):
            watch.until(began + i / RATE)
            moves.append((time.perf_counter(), total + onward * i * STEP))
            fingers.move(start[0] + onward * i * STEP, start[1])
        watch.until(time.perf_counter() + 0.6)
        fingers.press(False)
        steps += [watch.reached(place(pixels), moved, side * onward) for moved, pixels in moves]
        between += (1000 * np.diff(watch.views(moves[0][0], moves[-1][0]))).tolist()
    return {"move from rest": np.array(rest), "step of a drag": np.array(steps), "between pictures": np.array(between)}


def check(path: Path, size: tuple[int, int], folder: Path, allow: float) -> bool:
    """Measure with one scene, print what came of it; whether the deadlines are met."""
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / "config" / "rayscope"
    config.mkdir(parents=True, exist_ok=True)
    (config / "window.ini").write_text("[General]\ntheme=dark\n")
    scene, middle = marked(rtcore.load(path), size[0] / size[1])
    rtcore.save(scene, folder / path.name)
    with display(*size, config.parent, folder) as environment:
        hands = Hands(environment, folder, [str(folder / path.name)])
        try:
            hands.wait("the window", lambda s: True, timeout=60)
            hands.settled("the first picture", timeout=600)
            hands.key("F11")
            hands.wait("full screen", lambda s: s["fullscreen"])
            state = hands.settled("full screen", timeout=300)
            fingers = Fingers(environment)
            found = measure(hands, Eyes(folder), fingers, scene, middle)
            fingers.close()
        finally:
            hands.end()
    x, y, w, h = state["picture"]
    print(f"{path.stem} at {w} x {h}")
    met = True
    for (name, values), deadline in zip(found.items(), (ANSWER, ANSWER, MOTION)):
        p50, p95 = np.percentile(values, (50, 95))
        late = p95 > deadline + allow
        met &= not late
        print(f"  {name:16} p50 {p50:6.1f} ms, p95 {p95:6.1f} ms, longest {values.max():6.1f} ms of {len(values)}; deadline {deadline:g} ms"
              f"{', MISSED' if late else ''}", flush=True)
    return met


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, help="folder for what is written on the way")
    parser.add_argument("--size", default="1280x720", help="of the screen, and so of the picture")
    parser.add_argument("--scene", action="append", help="of the gallery, by name (default whitted)")
    parser.add_argument("--allow", type=float, default=30.0, help="ms beyond a deadline that are forgiven (default 30)")
    options = parser.parse_args()
    if missing := missing_tools():
        print(f"deadlines.py: not installed: {', '.join(missing)}", file=sys.stderr)
        return 2
    folder = (options.output or Path(tempfile.mkdtemp(prefix="rayscope-"))).absolute()
    size = tuple(map(int, options.size.split("x")))
    met = True
    for name in options.scene or ["whitted"]:
        try:
            met &= check(GALLERY / f"{name}.yaml", size, folder / name, options.allow)
        except Failed as failure:
            print(f"deadlines.py: {failure}", file=sys.stderr)
            met = False
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
