"""Mesh files through trimesh: their parts as arrays, checked, with what there is of names, materials and places.

trimesh is imported when a mesh is read. It gets no chance to fetch anything: files that a mesh names are read from its own
folder and below, and from nowhere else.
"""
import io
import logging
import os
import warnings
import weakref
from typing import Any, NamedTuple

import msgspec
import numpy as np

from rtcore.fields import FieldError
from rtcore.files._errors import FileError, Said, read_bytes, reason
from rtcore.files._formats import FORMATS
from rtcore.files._looks import look_of
from rtcore.files._sound import sound
from rtcore.scene import Material
from rtcore.shapes import Mesh

SUFFIXES = FORMATS["mesh"]
MOST_BYTES = 1 << 30
MOST_FACES = 10_000_000
MOST_BESIDE = 256 << 20     # of a material, texture or buffer that a mesh names

_FLAT = 1e-14               # a triangle with less area than this share of its longest edge squared has none


class Part(NamedTuple):
    """One mesh of a file where it stands."""

    name: str
    vertices: np.ndarray            # (V, 3) float64
    faces: np.ndarray               # (F, 3) int32
    normals: np.ndarray | None      # (V, 3), only if the file has them
    matrix: np.ndarray | None       # 4 x 4, to the world; None where it is the identity
    look: tuple[str, Material] | None   # name of its material, and that
    dropped: int                    # degenerate triangles that were left out


class Parts(NamedTuple):
    """All of a file."""

    parts: tuple[Part, ...]
    missing: tuple[str, ...]        # files it names that are not there
    empty: int                      # parts without an extent that were left out


def read_parts(path: str | os.PathLike) -> Parts:
    """The meshes in a file; FileError if there are none or anything is wrong with one."""
    suffix = os.path.splitext(path)[1].lower()
    data = sound(path, suffix, read_bytes(path, MOST_BYTES), MOST_FACES)
    loaded, missing = _through_trimesh(path, suffix, data)
    parts, empty, seen = [], 0, {}
    for name, matrix, mesh in loaded:
        if matrix is not None and not np.linalg.det(matrix[:3, :3] / max(np.abs(matrix[:3, :3]).max(), 1e-300)):
            empty += 1
            continue
        if id(mesh) in seen:        # the same mesh in another place shares its arrays
            parts.append(seen[id(mesh)]._replace(name=name, matrix=matrix))
            continue
        if len(mesh.faces) > MOST_FACES:
            raise FileError.expected(path, f"at most {MOST_FACES:,} faces", Said(f"{len(mesh.faces):,}"))
        vertices, faces = np.array(mesh.vertices, np.float64), np.array(mesh.faces)
        given = "vertex_normals" in mesh._cache     # asking for the property would make some up
        normals = np.array(mesh.vertex_normals, np.float64) if given else None
        for array in (vertices, normals):
            if array is not None:
                array.flags.writeable = False       # so that a Mesh takes it as it is
        _check_numbers(path, vertices, faces, normals, name if len(loaded) > 1 else "")
        keep = _with_area(vertices, faces)
        if keep.any():
            faces = faces[keep].astype(np.int32)
            faces.flags.writeable = False
            seen[id(mesh)] = Part(name, vertices, faces, normals, matrix, look_of(mesh, suffix), int((~keep).sum()))
            parts.append(seen[id(mesh)])
        else:
            empty += 1
    if not parts:
        raise FileError.expected(path, "at least one face", Said("none" if not empty else "only faces without an area"))
    return Parts(tuple(parts), tuple(missing), empty)


def _through_trimesh(path, suffix: str, data: bytes) -> tuple[list[tuple[str, np.ndarray | None, Any]], list[str]]:
    """(name, matrix or None, trimesh.Trimesh) of every mesh where it stands, and the names of files that are missing."""
    logging.getLogger("trimesh").setLevel(logging.CRITICAL + 1)
    import trimesh

    class Beside(trimesh.resolvers.FilePathResolver):
        """Files of the mesh's own folder and below."""

        missing: list[str] = []

        def get(self, name: str) -> bytes:
            folder = os.path.realpath(self.parent)
            for candidate in (name.strip(), os.path.basename(name.strip().replace("\\", "/"))):
                found = os.path.realpath(os.path.join(folder, candidate))
                if os.path.isfile(found) and os.path.commonpath([found, folder]) == folder:
                    return read_bytes(found, MOST_BESIDE)
            self.missing.append(" ".join(name.split())[:80])
            raise FileNotFoundError(f"there is no file {self.missing[-1]!r} beside it")

    resolver = Beside(os.path.abspath(path))
    resolver.missing = []
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], resolver=resolver, process=False)
            loaded = []
            for node in scene.graph.nodes_geometry:
                matrix, name = scene.graph[node]
                mesh = scene.geometry[name]
                if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
                    matrix = np.array(matrix, np.float64)
                    loaded.append((str(node), None if np.array_equal(matrix, np.eye(4)) else matrix, mesh))
    except Exception as error:      # whatever it stumbles over in a broken file: KeyError, IndexError, struct.error ...
        said = " ".join(str(error).split())[:120] or type(error).__name__
        raise FileError.expected(path, f"a sound {suffix} file", Said(f"one that can't be read: {said}")) from None
    return loaded[::-1] if suffix == ".obj" else loaded, resolver.missing      # trimesh takes an OBJ's parts from the last to the first


def _check_numbers(path, vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray | None, part: str) -> None:
    """FileError if a number is not finite or an index out of range."""
    place = f"{part}." if part else ""
    for name, array in (("vertices", vertices), ("normals", normals)):
        bad = np.flatnonzero(~np.isfinite(array).all(axis=1)) if array is not None else ()
        if len(bad):
            raise FileError.expected(path, "three finite numbers", array[bad[0]].tolist(), place=f"{place}{name}[{bad[0]}]")
    bad = np.flatnonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))
    if len(bad):
        raise FileError.expected(path, f"indices from 0 to less than the number of vertices, {len(vertices):,}", faces[bad[0]].tolist(),
                                 place=f"{place}faces[{bad[0]}]")


def _with_area(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) whether each triangle has an area."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    with np.errstate(all="ignore"):
        ab, ac, bc = b - a, c - a, c - b
        longest = np.maximum(np.maximum(np.abs(ab).max(axis=1), np.abs(ac).max(axis=1)), np.abs(bc).max(axis=1))
        scale = np.where(longest > 0, longest, 1.0)[:, None]
        area = np.linalg.norm(np.cross(ab / scale, ac / scale), axis=1)
    return (longest > 0) & (area > _FLAT)


def joined(parts: tuple[Part, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Vertices, faces and normals of all parts as one mesh, each part where it stands."""
    if len(parts) == 1 and parts[0].matrix is None:
        return parts[0][1:4]
    vertices, faces, normals, count = [], [], [], 0
    for part in parts:
        linear, shift = (np.eye(3), np.zeros(3)) if part.matrix is None else (part.matrix[:3, :3], part.matrix[:3, 3])
        vertices.append(part.vertices @ linear.T + shift)
        faces.append((part.faces if np.linalg.det(linear) > 0 else part.faces[:, ::-1]) + np.int32(count))
        if part.normals is not None:
            turned = part.normals @ np.linalg.inv(linear)
            length = np.linalg.norm(turned, axis=1, keepdims=True)
            normals.append(turned / np.where(length > 0, length, 1.0))
        count += len(part.vertices)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(normals) if len(normals) == len(parts) else None


_origins: dict[str, tuple[tuple, list]] = {}    # Mesh.file -> stamp of the file when read; weak references to its three arrays


def _stamp(path: str) -> tuple:
    status = os.stat(path)
    return status.st_mtime_ns, status.st_size, status.st_ino


def made(file: str, vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray | None) -> Mesh:
    """A Mesh that remembers the file (and the part of it) that these arrays were just read from."""
    mesh = Mesh(vertices=vertices, faces=faces, normals=normals, file=file)
    _origins[file] = _stamp(_split(file)[0]), [a if a is None else weakref.ref(a) for a in (mesh.vertices, mesh.faces, mesh.normals)]
    return mesh


def _untouched(mesh: Mesh) -> bool:
    """Whether the mesh holds the very arrays that were read from its file, and the file is as it was then."""
    stamp, arrays = _origins.get(mesh.file, (None, []))
    own = (mesh.vertices, mesh.faces, mesh.normals)
    return stamp == _stamp(_split(mesh.file)[0]) and all((a and a()) is b for a, b in zip(arrays, own))


def _split(file: str) -> tuple[str, int | None]:
    """Path and part number of ``scene.glb#2``; no number, or a name that is really a file's: all of the file."""
    path, mark, part = file.rpartition("#")
    if mark and part.isdecimal() and part.isascii() and not os.path.exists(file):
        return path, int(part)
    return file, None


class MeshFiles:
    """The mesh files that one scene names, relative to its `folder` (absolute). Each is read once."""

    def __init__(self, folder: str):
        self._folder = folder
        self._parts: dict[str, Parts] = {}
        self._meshes: dict[str, Mesh] = {}

    def mesh(self, name: Any) -> Mesh:
        """The mesh of a file, or the part of it that ``#2`` at the end of the name says; FieldError if that can't be had."""
        if not isinstance(name, str) or not name:
            raise FieldError("the name of a mesh file", name)
        file = os.path.normpath(os.path.join(self._folder, name))
        if file not in self._meshes:
            try:
                self._meshes[file] = made(file, *self._arrays(file))
            except FileError as error:
                raise FieldError("a mesh file", Said(str(error))) from None
            except OSError as error:
                raise FieldError("a mesh file", Said(f"{name}: {reason(error)}")) from None
        return self._meshes[file]

    def _arrays(self, file: str):
        path, part = _split(file)
        suffix = os.path.splitext(path)[1].lower()
        if suffix not in SUFFIXES:
            raise FileError.expected(path, "a name that ends in " + ", ".join(SUFFIXES), suffix)
        if path not in self._parts:
            self._parts[path] = read_parts(path)
        parts = self._parts[path].parts
        if part is None:
            return joined(parts)
        if part >= len(parts):
            raise FileError.expected(path, f"a part from #0 to #{len(parts) - 1}", Said(f"#{part}"))
        return parts[part][1:4]

    def name_of(self, mesh: Mesh) -> str | None:
        """What to write in place of the mesh's numbers: the name of its file, if that holds the same numbers now."""
        try:
            name = os.path.relpath(mesh.file, self._folder)
        except ValueError:
            name = mesh.file        # on another drive
        name = name.replace(os.sep, "/")
        if not os.path.isabs(mesh.file) or os.path.normpath(os.path.join(self._folder, name)) != mesh.file:
            return None
        try:
            if _untouched(mesh):
                return name
            return name if msgspec.structs.replace(self.mesh(name), sides=mesh.sides) == mesh else None
        except (FieldError, OSError, ValueError):
            return None
