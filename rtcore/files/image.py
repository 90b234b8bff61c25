"""Pictures out: .png in sRGB with 8 bits a channel, .exr in linear light with 32-bit floats."""
import os
import struct
import zlib

import numpy as np

from rtcore.files._errors import WriteError
from rtcore.files._writing import write_file

SUFFIXES = (".png", ".exr")
UP = 2              # PNG's filter that keeps the difference to the row above
_ROWS = 1 << 20     # pixels that are turned to 8 bits at a time


def save_image(pixels: np.ndarray, path: str | os.PathLike, *, software: str = "Rayscope", text: dict[str, str] | None = None) -> None:
    """Write linear pixels (h, w, 3) as the suffix says; the old file is intact until the new one is complete.

    PNG: clipped to 0 .. 1, what is not a number black, by the sRGB curve to 8 bits. EXR: the numbers as they are, in float32.
    `text` goes along: PNG text chunks, or attributes of the EXR header. WriteError if the picture can't be written.
    """
    pixels = np.asarray(pixels)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or 0 in pixels.shape:
        raise ValueError(f"expected pixels of shape (h, w, 3), got {pixels.shape}")
    check_suffix(path)
    text = {"Software": software, **(text or {})}
    data = _exr(path, pixels, text) if os.fspath(path).lower().endswith(".exr") else _png(pixels, text)
    write_file(path, data)


def check_suffix(path: str | os.PathLike) -> None:
    """WriteError if no picture can be written under that name: its suffix is unknown, or what it needs is not installed."""
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in SUFFIXES:
        raise WriteError.expected(path, "a picture whose name ends in " + " or ".join(SUFFIXES), suffix or os.path.basename(path))
    if suffix == ".exr":
        _openexr(path)


def srgb_bytes(pixels: np.ndarray) -> np.ndarray:
    """8-bit sRGB (h, w, 3) of linear pixels (IEC 61966-2-1), rounded to the nearest."""
    result = np.empty(pixels.shape, np.uint8)
    step = max(_ROWS // pixels.shape[1], 1)
    for row in range(0, len(pixels), step):
        x = np.clip(np.nan_to_num(pixels[row:row + step].astype(np.float32), nan=0.0, posinf=1.0, neginf=0.0), 0, 1)
        curve = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** np.float32(1 / 2.4) - np.float32(0.055))
        result[row:row + step] = curve * 255 + 0.5
    return result


def _png(pixels: np.ndarray, text: dict[str, str]) -> bytes:
    """The file's bytes (PNG, ISO 15948). Written here: an imaging library takes longer to import than a small picture to trace."""
    height, width = pixels.shape[:2]
    rows = srgb_bytes(pixels).reshape(height, -1)
    lines = np.empty((height, 1 + 3 * width), np.uint8)
    lines[:, 0] = UP
    lines[0, 1:] = rows[0]
    np.subtract(rows[1:], rows[:-1], out=lines[1:, 1:])
    words = [key.encode("latin-1") + b"\0\0\0\0\0" + value.replace("\0", "").encode() for key, value in text.items()]
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)     # 8 bits of red, green, blue; deflated, filtered, not interlaced
    chunks = [(b"IHDR", header), (b"sRGB", b"\0"), *((b"iTXt", word) for word in words), (b"IDAT", zlib.compress(lines)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks)


def _openexr(path):
    try:
        import OpenEXR
    except ImportError:
        raise WriteError(path, "an .exr file needs the package OpenEXR: pip install rayscope[exr]") from None
    return OpenEXR


def _exr(path, pixels: np.ndarray, text: dict[str, str]) -> bytes:
    """The file's bytes; OpenEXR writes only to a name, so it gets one of its own."""
    import tempfile

    OpenEXR = _openexr(path)
    header = {key[:1].lower() + key[1:]: value for key, value in text.items()}
    header |= {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        with tempfile.TemporaryDirectory() as folder:
            beside = os.path.join(folder, "picture.exr")
            with OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels, np.float32)}) as file:
                file.write(beside)
            with open(beside, "rb") as written:
                return written.read()
    except OSError as error:
        raise WriteError(path, f"cannot be written: {error.strerror or error}") from None
    except RuntimeError as error:
        raise WriteError(path, f"cannot be written: {error}") from None
