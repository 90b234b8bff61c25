"""What is checked in a Wavefront OBJ text before trimesh reads it, which counts on sound and plainly written files.

trimesh takes index 0 for the first vertex, relative (negative) indices as counted from the end of the file, and leaves out
lines that begin with a blank. Here such lines are put into the plain form, and what is wrong is said with its line.
"""
import math
import re

from rtcore.fields import shown

_ODD = re.compile(r"^[ \v\f]+|\t|\r|\\\n", re.MULTILINE)


class ObjError(ValueError):
    """What is wrong with an OBJ text: `problem`, in words, and its `line`, from 1."""

    def __init__(self, problem: str, line: int):
        super().__init__(problem, line)
        self.problem, self.line = problem, line


def plain(text: str, most_faces: int) -> str:
    """The text with every face's indices absolute and in range, every vertex three finite numbers; ObjError if they are not.

    `most_faces`: how many lines of faces there may be.
    """
    if _ODD.search(text):
        text = "\n".join(line.strip() for line in text.replace("\t", " ").replace("\\\n", " ").split("\n"))
    counts = {"v": 0, "vt": 0, "vn": 0}
    ahead: list[tuple[int, str, str, int]] = []     # references to what is not there yet: index, kind, as written, line
    lines, faces, rewritten = text.split("\n"), 0, False
    for i, line in enumerate(lines):
        word, _, rest = line.partition(" ")
        if word == "f":
            faces += 1
            corners = rest.partition("#")[0].split()
            if len(corners) < 3:
                raise ObjError(f"expected a face of at least three vertices, got {shown(line)}", i + 1)
            lowest = 1
            for corner in corners:
                for kind, index in zip(counts, corner.split("/")):
                    if not index and kind != "v":
                        continue
                    try:
                        number = int(index)
                    except ValueError:
                        raise ObjError(f"expected a vertex index, got {shown(corner)}", i + 1) from None
                    if number > counts[kind]:
                        ahead.append((number, kind, corner, i + 1))
                    elif number == 0 or number < -counts[kind]:
                        raise _out_of_range(kind, counts[kind], corner, i + 1)
                    lowest = min(lowest, number)
            if lowest < 0:
                lines[i] = "f " + " ".join(_absolute(corner, counts) for corner in corners)
                rewritten = True
        elif word in counts:
            counts[word] += 1
            if word != "vt" and not _three_finite(rest):
                raise ObjError(f"expected three finite numbers, got {shown(rest)}", i + 1)
    if not faces:
        raise ObjError("expected at least one face (a line that begins with f), got none", len(lines))
    if faces > most_faces:
        raise ObjError(f"expected at most {most_faces:,} faces, got {faces:,}", len(lines))
    for number, kind, corner, line in ahead:
        if number > counts[kind]:
            raise _out_of_range(kind, counts[kind], corner, line)
    return "\n".join(lines) if rewritten else text


def _three_finite(numbers: str) -> bool:
    try:
        x, y, z = map(float, numbers.split()[:3])
    except ValueError:
        return False
    return math.isfinite(x) and math.isfinite(y) and math.isfinite(z)


def _absolute(corner: str, counts: dict[str, int]) -> str:
    """A corner such as ``-1//-1`` with indices from the start of the file."""
    indices = zip(counts.values(), corner.split("/"))
    return "/".join(str(count + 1 + int(index)) if index.startswith("-") else index for count, index in indices)


def _out_of_range(kind: str, count: int, corner: str, line: int) -> ObjError:
    what = {"v": "vertices", "vt": "texture coordinates", "vn": "normals"}[kind]
    return ObjError(f"expected an index from 1 to the number of {what}, {count:,}, got {shown(corner)}", line)
