"""Drives the real window under Xvfb by mouse and keyboard, looks at the pixels, and exits with 1 if anything is not as it should be.

    python tests/xvfb/drive.py [-o DIR] [--size WxH] [--theme light|dark] [--scale FACTOR]

Screenshots stay in DIR. Needs Xvfb, openbox, xdotool and ImageMagick's import.
"""
import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2])]

from display import Failed, Hands, differing, display, missing_tools  # noqa: E402

import rtcore  # noqa: E402

SCENE = """rayscope: 1
name: Driven
camera: {lookfrom: [0, 1.5, -8], lookat: [0, 0.5, 0], up: [0, 1, 0], fov: 40}
background: {color: [0.6, 0.7, 0.9], top: [0.2, 0.35, 0.7]}
fog: {kind: exponential, color: [0.7, 0.75, 0.8], density: 0.05}
lights: [{point: {position: [-4, 6, -5], intensity: 60}}, {ambient: {intensity: 0.25}}]
scene:
  - name: floor
    plane: {point: [0, -1, 0], normal: [0, 1, 0]}
    material: {checker: {}}
  - name: middle
    sphere: {center: [0, 0.5, 0], radius: 1.2}
    material: {color: [0.9, 0.15, 0.1], specular: 0.5, reflection: 0.2}
  - name: right
    sphere: {center: [2.6, 0, 1], radius: 0.9}
    material: {color: [0.1, 0.6, 0.2]}
"""
AMBER = (255, 176, 46)


def expect(condition: object, what: str):
    if not condition:
        raise Failed(what)


def drive(hands: Hands, folder: Path, scene: Path, other: Path, environment: dict[str, str]):
    """The whole tour. Raises Failed at the first thing that is not as it should be."""
    hands.wait("the window", lambda s: True, timeout=60)
    print(f"window after {time.monotonic() - hands.started:.1f} s")
    state = hands.settled("the first picture", timeout=600)     # with an empty cache the kernels are compiled first
    print(f"first finished picture after {time.monotonic() - hands.started:.1f} s; longest stall of the window {state['stall']:.2f} s")
    expect(state["stall"] < 1.5, f"the window did not answer for {state['stall']:.2f} s")
    start, home = hands.picture("start"), state["camera"]

    x, y, w, h = state["picture"]
    hands.drag((x + w // 2, y + h // 4), (x + w // 2 + 150, y + h // 4 + 40))
    turned = hands.settled("orbit")
    expect(turned["camera"][0] != home[0] and turned["camera"][1] == home[1], "a drag did not orbit")
    expect(differing(start, hands.picture("orbit")) > 0.1, "orbiting did not change the picture")
    hands.key("alt+Left")
    hands.wait("view back", lambda s: s["camera"] == home)
    hands.settled("view back")
    expect(differing(start, hands.picture("back")) < 0.01, "the view before is not the picture before")

    field = hands.widget("Fov")
    hands.click(field, 0.9, times=3)
    hands.type("60")
    hands.key("Return")
    hands.wait("fov typed", lambda s: s["camera"][3] == 60)
    hands.settled("fov typed")
    wide = hands.picture("fov")
    expect(differing(start, wide) > 0.1, "another fov did not change the picture")
    hands.type("200")
    hands.key("Return")
    hands.picture("fov-refused")
    hands.key("Escape")
    expect(hands.wait("a bad fov", lambda s: True)["camera"][3] == 60, "a fov of 200 was taken")

    hands.click(state["picture"], 0.5, 0.03)        # the sky: nothing selected, and the keyboard is the picture's
    for key, name in (("1", "shadows"), ("2", "fog"), ("3", "reflections")):
        hands.key(key)
        hands.wait(f"{name} off", lambda s, name=name: not s["options"][name])
        hands.settled(f"{name} off")
        expect(differing(wide, hands.picture(f"no-{name}")) > 0.005, f"switching {name} off did not change the picture")
        hands.key(key)
        hands.wait(f"{name} on", lambda s, name=name: s["options"][name])
        hands.settled(f"{name} on")
    expect(differing(wide, hands.picture("all-on")) < 0.01, "switching off and on did not come back")

    hands.click(state["picture"], 0.5, 0.5)
    hands.wait("picking", lambda s: s["selection"] == "middle")
    hands.settled("picking")
    time.sleep(0.5)
    picked = hands.picture("picked")
    expect((abs(picked - AMBER).max(axis=-1) < 8).sum() > 200, "the picked object is not outlined")

    row = hands.state()["rows"]["middle"]
    hands.xdo("mousemove", row[0] + row[3] // 2, row[1] + row[3] // 2, "sleep", "0.1", "click", "1")
    hidden = hands.wait("hiding", lambda s: s["hidden"] == [[1]])
    expect(hidden["modified"], "hiding an object did not mark the document as modified")
    hands.settled("hiding")
    expect(differing(picked, hands.picture("hidden")) > 0.05, "hiding an object did not change the picture")
    hands.key("ctrl+z")
    hands.wait("undo", lambda s: not s["hidden"] and not s["modified"])
    hands.key("ctrl+shift+z")
    hands.wait("redo", lambda s: s["hidden"] and s["modified"])
    hands.key("ctrl+s")
    hands.wait("saving", lambda s: not s["modified"])
    saved = rtcore.load(scene)
    expect(saved.camera.fov == 60 and not saved.objects[1].visible, "the saved file lacks the view or the edit")

    source = subprocess.Popen([sys.executable, str(Path(__file__).with_name("drag_source.py")), str(other), str(x + 20), str(y + 20)],
                              env={**environment, "QT_SCALE_FACTOR": "1"})
    try:
        time.sleep(2.0)
        hands.drag((x + 60, y + 40), (x + w // 2, y + h // 2))
        hands.wait("a drop", lambda s: s["path"] == str(other))
    finally:
        source.kill()
        source.wait()
    hands.settled("the dropped scene", timeout=300)
    hands.picture("dropped")

    for path, what in ((scene, "reopening"), (folder / "bad.yaml", "a bad file")):
        hands.key("ctrl+o")
        time.sleep(1.0)
        hands.type(str(path))
        hands.key("Return")
        if what == "reopening":
            hands.wait(what, lambda s: s["path"] == str(scene) and s["camera"][3] == 60 and s["hidden"] == [[1]])
            hands.settled(what)
        else:
            state = hands.wait(what, lambda s: "bad.yaml" in s["notice"])
            expect(state["path"] == str(scene), "a bad file took the scene away")
        hands.picture(what.replace(" ", "-"))

    hands.key("F11")
    hands.wait("full screen", lambda s: s["fullscreen"])
    hands.settled("full screen")
    hands.shot("full-screen")
    hands.key("F11")
    hands.wait("back from full screen", lambda s: not s["fullscreen"])
    expect("Traceback" not in hands.log(), hands.log())
    hands.key("ctrl+q")
    try:
        code = hands.process.wait(5)
    except subprocess.TimeoutExpired:
        raise Failed("the window did not close") from None
    expect(code == 0, f"the window ended with exit code {code}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, help="folder for the screenshots")
    parser.add_argument("--size", default="1280x800", help="of the screen")
    parser.add_argument("--theme", choices=("light", "dark"), default="dark")
    parser.add_argument("--scale", default="1", help="of everything in the window, as on a screen of that many times the pixels")
    options = parser.parse_args()
    if missing := missing_tools():
        print(f"drive.py: not installed: {', '.join(missing)}", file=sys.stderr)
        return 2
    folder = options.output or Path(tempfile.mkdtemp(prefix="rayscope-"))
    folder = folder.absolute()
    config = folder / "config" / "rayscope"
    config.mkdir(parents=True, exist_ok=True)
    (config / "window.ini").write_text(f"[General]\ntheme={options.theme}\n")
    scene, other = folder / "driven.yaml", folder / "other.yaml"
    scene.write_text(SCENE)
    other.write_text(SCENE.replace("Driven", "Other").replace("[0.9, 0.15, 0.1]", "[0.1, 0.2, 0.9]"))
    (folder / "bad.yaml").write_text("rayscope: 1\nscene: [{spere: {}}]\n")
    width, height = map(int, options.size.split("x"))
    with display(width, height, config.parent) as environment:
        environment["QT_SCALE_FACTOR"] = options.scale
        hands = Hands(environment, folder, [str(scene)])
        try:
            drive(hands, folder, scene, other, environment)
        except Failed as failure:
            hands.shot("failed")
            print(f"drive.py: {failure}", file=sys.stderr)
            return 1
        finally:
            hands.end()
    print(f"{len(hands.shots)} screenshots in {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
