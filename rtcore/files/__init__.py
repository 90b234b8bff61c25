"""Scene files: one file a format. Listed once, in `_formats.py`, and imported when a file of that format is opened."""
import importlib
import os

import numpy as np

from rtcore.files import image
from rtcore.files._errors import FileError, WriteError, unknown
from rtcore.files._formats import FORMATS
from rtcore.files._writing import writable, write_file
from rtcore.files.image import save_image
from rtcore.scene import Scene

LOADABLE = tuple(suffix for suffixes in FORMATS.values() for suffix in suffixes)
PICTURES = image.SUFFIXES

__all__ = ["FORMATS", "LOADABLE", "PICTURES", "FileError", "WriteError", "load", "save", "save_image", "writable", "write_file"]


def load(path: str | os.PathLike) -> Scene:
    """The scene in a file, whose suffix says the format; FileError, in one line, if there is none or anything is wrong."""
    if os.path.isdir(path):
        raise FileError(path, "expected a file, got a folder")
    suffix = os.path.splitext(path)[1].lower()
    for name, suffixes in FORMATS.items():
        if suffix in suffixes:
            with np.errstate(all="ignore"):     # numbers near the end of the float range are for the records to judge
                return importlib.import_module(f"rtcore.files.{name}").load(path)
    expected, got = unknown(suffix or os.path.basename(path), LOADABLE)
    raise FileError.expected(path, "a name that ends in " + expected, got)


def save(scene: Scene, path: str | os.PathLike) -> None:
    """Write a scene as YAML or JSON; see `rtcore.files.scene.save`."""
    importlib.import_module("rtcore.files.scene").save(scene, path)
