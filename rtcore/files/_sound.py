"""What is looked at in a mesh file before trimesh reads it: what trimesh would take without a word or answer with a riddle."""
import json
import re

from rtcore.files._errors import FileError, Said
from rtcore.files._obj import ObjError, plain

_PLY_ELEMENT = re.compile(rb"^element[ \t]+(\w+)[ \t]+(\d+)", re.MULTILINE)


def sound(path, suffix: str, data: bytes, most_faces: int) -> bytes:
    """The bytes that trimesh shall read; FileError if a file of that suffix can't be so, is cut short, or has more faces."""
    if suffix in (".obj", ".off", ".gltf") and b"\0" in data[:1 << 16]:
        raise FileError.expected(path, "a text file", Said(f"a binary one (a zero byte at offset {data.index(0)})"))
    check = {".stl": _stl, ".ply": _ply, ".off": _off, ".glb": _glb, ".gltf": _gltf}.get(suffix)
    if check is not None:
        count = check(path, data)
        if count > most_faces:
            raise FileError.expected(path, f"at most {most_faces:,} faces", Said(f"{count:,}"))
    if suffix == ".obj":
        try:
            return plain(data.decode("utf-8", "replace").removeprefix("\ufeff"), most_faces).encode()
        except ObjError as error:
            raise FileError(path, error.problem, line=error.line) from None
    return data


def _stl(path, data: bytes) -> int:
    """Number of triangles. A binary STL is as long as its header says, a text one ends with ``endsolid``."""
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:
        return count
    if b"\0" in data[:512] or data[:512].lstrip()[:5].lower() != b"solid":
        raise FileError.expected(path, f"a text STL, or a binary one of 84 + 50 x {count:,} bytes as its header says",
                                 Said(f"{len(data):,} bytes"))
    if b"endsolid" not in data[-4096:].lower():
        raise FileError.expected(path, "endsolid", Said("the end of the file"), line=data.count(b"\n") + 1)
    return data.count(b"endfacet")


def _ply(path, data: bytes) -> int:
    """Number of faces that the header promises; a text PLY has a line for each element."""
    header, end, body = data[:1 << 20].partition(b"end_header")
    if data[:3] != b"ply" or not end:
        raise FileError.expected(path, "a PLY header from ply to end_header", Said("none"))
    counts = {name: int(number[:15]) for name, number in _PLY_ELEMENT.findall(header)}
    if re.search(rb"^format[ \t]+ascii", header, re.MULTILINE):
        lines = sum(1 for line in data[len(header) + len(end):].splitlines() if line.strip())
        if lines < sum(counts.values()):
            raise FileError.expected(path, f"{sum(counts.values()):,} lines after the header, which says so", Said(f"{lines:,} of them"))
    return counts.get(b"face", 0)


def _off(path, data: bytes) -> int:
    """Number of faces that the header promises; there is a line for each vertex and each face."""
    lines = [line for line in (raw.partition(b"#")[0].strip() for raw in data.splitlines()) if line]
    if not lines or not lines[0].upper().startswith((b"OFF", b"COFF")):
        raise FileError.expected(path, "OFF at the beginning", Said("something else"))
    first = lines[0].upper().partition(b"OFF")[2].split()
    numbers = first or (lines[1].split() if len(lines) > 1 else [])
    if len(numbers) < 2 or not all(number.isdigit() and len(number) < 15 for number in numbers[:2]):
        raise FileError.expected(path, "the numbers of vertices and faces after OFF", Said("something else"))
    vertices, faces = map(int, numbers[:2])
    there = len(lines) - (1 if first else 2)
    if there < vertices + faces:
        raise FileError.expected(path, f"{vertices:,} lines of vertices and {faces:,} of faces, as its header says",
                                 Said(f"{there:,} of them"))
    return faces


def _glb(path, data: bytes) -> int:
    """Nothing is known of a GLB's faces before it is read; it is as long as its header says."""
    length = int.from_bytes(data[8:12], "little")
    if data[:4] != b"glTF" or len(data) < 20:
        raise FileError.expected(path, "a GLB header", Said("something else"))
    if length != len(data):
        raise FileError.expected(path, f"a GLB of {length:,} bytes as its header says", Said(f"{len(data):,} bytes"))
    return 0


def _gltf(path, data: bytes) -> int:
    """Nothing is known of a glTF's faces before it is read; it is a JSON object that says what it is."""
    try:
        found = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise FileError.expected(path, "JSON", Said(f"something else ({' '.join(str(error).split())[:80]})"),
                                 line=getattr(error, "lineno", None)) from None
    if not isinstance(found, dict) or not isinstance(found.get("asset"), dict):
        raise FileError.expected(path, "a glTF object with an asset", found)
    return 0
