"""The scenes that come with the program."""
import re
from pathlib import Path

import resources

GALLERY = resources.ROOT / "scenes"
FIRST_SCENE = GALLERY / "whitted.yaml"


def gallery() -> list[tuple[str, Path]]:
    """Title and file of every gallery scene, by title. Only the `name:` line is read, so that a menu costs no parse."""
    scenes = []
    for path in GALLERY.glob("*.yaml"):
        match = re.search(r"^name:\s*(.+?)\s*$", path.read_text(encoding="utf-8", errors="replace"), re.MULTILINE)
        scenes.append((match.group(1).strip("\"'") if match else path.stem.replace("-", " ").capitalize(), path))
    return sorted(scenes)
