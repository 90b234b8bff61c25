"""The scenes that come with the program, and their thumbnails.

`python -m app.gallery [NAME ...]` renders the thumbnails anew, all or those of the scenes named.
"""
import re
import sys
from pathlib import Path
from typing import NamedTuple

import yaml

import resources

GALLERY = resources.ROOT / "scenes"
THUMBNAILS = resources.ROOT / "thumbnails"
FIRST_SCENE = GALLERY / "whitted.yaml"

SIZE = 480, 300     # of a thumbnail in pixels: sharp at twice the size it is shown at
SAMPLES = 64
QUALITY = 86        # of the JPEG: some 30 kB each

#: The keys at the top of a scene file that say what it is, with all that is indented below them.
HEAD = re.compile(r"(?:(?:rayscope|name|note):.*\n(?:[ \t]+.*\n|[ \t]*\n)*|\s*#.*\n)*")


class Entry(NamedTuple):
    """A scene of the gallery as a menu shows it."""

    title: str
    note: str           # what it shows and what to try: some sentences
    path: Path

    @property
    def thumbnail(self) -> Path:
        """The picture of the scene: a JPEG of `SIZE`."""
        return THUMBNAILS / f"{self.path.stem}.jpg"

    @property
    def line(self) -> str:
        """The first sentence of the note."""
        return re.split(r"(?<=[.!?])\s", self.note, maxsplit=1)[0]


def gallery() -> list[Entry]:
    """Every gallery scene, by title. Only the head of a file is parsed, so that hundreds of spheres cost nothing here."""
    entries = []
    for path in GALLERY.glob("*.yaml"):
        head = yaml.safe_load(HEAD.match(path.read_text(encoding="utf-8"))[0]) or {}
        title = str(head.get("name") or path.stem.replace("-", " ").capitalize())
        entries.append(Entry(title, " ".join(str(head.get("note") or "").split()), path))
    return sorted(entries)


def render_thumbnail(path: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES):
    """The scene of a file as a Pillow image of `size` (width, height)."""
    from PIL import Image

    import rtcore
    from rtcore.film import encode
    pixels = rtcore.render(rtcore.load(path), size=size, spp=samples).pixels
    return Image.fromarray(encode(pixels)[:, :, 2::-1])


def main(names: list[str]) -> int:
    """Render the thumbnails of these scenes, of all if none is named. Returns the exit code."""
    entries = gallery()
    if unknown := sorted(set(names) - {entry.path.stem for entry in entries}):
        print(f"app.gallery: no such scene: {', '.join(unknown)}", file=sys.stderr)
        return 2
    THUMBNAILS.mkdir(exist_ok=True)
    for entry in entries:
        if not names or entry.path.stem in names:
            render_thumbnail(entry.path).save(entry.thumbnail, quality=QUALITY, optimize=True)
            print(entry.thumbnail.name)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
