"""Scene files: YAML, or JSON read by the same code.

The words of the format are those of the records: a shape's, light's or transform's word is the name of its class in lower
case and takes the fields of that class, so that a new one needs nothing here. Each record checks what it is given; this
module adds the path to it, and on an error the line.
"""
import contextlib
import functools
import json
import os
import re
import typing
from typing import Any

import msgspec
import numpy as np

from rtcore.camera import Camera
from rtcore.fields import FieldError, Record, fields_of, number
from rtcore.files._errors import FileError, Said, WriteError, read_text, unknown
from rtcore.files._formats import FORMATS
from rtcore.files._writing import write_file
from rtcore.files._yaml import TextError, line_of, parse
from rtcore.files._yamlout import Block, Lines, dump
from rtcore.lights import LIGHTS
from rtcore.scene import MOST_NESTED, TRANSFORMS, Background, Fog, Material, Node, Scale, Scene
from rtcore.shapes import SHAPE_MODULES, shape_named

VERSION = 1
SUFFIXES = FORMATS["scene"]
MOST_BYTES = 64 * 2**20


def _by_word(classes: tuple[type, ...]) -> dict[str, type]:
    return {cls.__name__.lower(): cls for cls in classes}


LIGHT_WORDS, TRANSFORM_WORDS = _by_word(LIGHTS), _by_word(TRANSFORMS)
SHAPE_WORDS = {name.lower(): name for name in SHAPE_MODULES}
NODE_WORDS = tuple(name for name in fields_of(Node) if name not in ("shape", "children", "use"))
PLACES = (*SHAPE_WORDS, "group", "use")     # a node has exactly one of these
ARRAYS = ("vertices", "faces", "normals")     # of a mesh; its file has them
_NOT_YAML = re.compile("[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff]")
SCENE_WORDS = ("rayscope", *(name for name in fields_of(Scene) if name != "objects"), "scene")


def load(path: str | os.PathLike) -> Scene:
    """The scene in a file; FileError, in one line, if there is none or anything is wrong with it."""
    text = read_text(path, MOST_BYTES)
    try:
        return _Reader(os.path.dirname(os.path.abspath(path))).scene(parse(text))
    except TextError as error:
        raise FileError(path, error.problem, line=error.line) from None
    except FieldError as error:
        raise FileError.of(path, error, line_of(text, error.path) if error.path else None) from None


def save(scene: Scene, path: str | os.PathLike) -> None:
    """Write a scene, as YAML or JSON, so that `load` gives an equal one; the old file is intact until the new one is complete.

    A mesh that is what its file holds is written as that file's name, relative to the scene's folder; any other with all
    its numbers. WriteError if the scene can't be written.
    """
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in SUFFIXES:
        raise WriteError.expected(path, "a name that ends in " + ", ".join(SUFFIXES), suffix or os.path.basename(path))
    plain = _Writer(os.path.dirname(os.path.abspath(path))).scene(scene)
    try:
        data = (_json(plain) if suffix == ".json" else dump(plain)).encode()
    except UnicodeEncodeError as error:
        alone = ord(error.object[error.start])
        raise WriteError.expected(path, "text that UTF-8 can hold", Said(f"the lone surrogate U+{alone:04X}")) from None
    except ValueError as error:
        raise WriteError(path, str(error)) from None
    if len(data) > MOST_BYTES:
        raise WriteError.expected(path, f"a scene of at most {MOST_BYTES >> 20} MiB as text, which is all that is read back",
                                 Said(f"{len(data) >> 20} MiB"))
    write_file(path, data)


def _json(data: dict) -> str:
    """The text of plain data as JSON that is YAML as well: letters that YAML takes for line ends, or not at all, are escaped."""
    text = json.dumps(data, indent=1, ensure_ascii=False)
    return _NOT_YAML.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


@functools.cache
def _records_in(cls: type) -> dict[str, type]:
    """The fields of a record that hold another record (or None)."""
    found = {}
    for name, hint in typing.get_type_hints(cls).items():
        inner = [t for t in typing.get_args(hint) or (hint,) if isinstance(t, type) and issubclass(t, Record)]
        if len(inner) == 1:
            found[name] = inner[0]
    return found


@functools.cache
def _fields(cls: type) -> tuple[msgspec.structs.FieldInfo, ...]:
    """The fields of a record, its own before those of the family it belongs to, as people would write them."""
    family = {name for base in cls.__bases__ if issubclass(base, Record) for name in fields_of(base)}
    return tuple(sorted(msgspec.structs.fields(cls), key=lambda field: field.name in family))


@functools.cache
def _required(cls: type) -> tuple[str, ...]:
    return tuple(f.name for f in _fields(cls) if f.required)


def _mapping(data: Any, expected: str) -> dict:
    if not isinstance(data, dict):
        raise FieldError(expected, data)
    return data


def _list(data: Any, expected: str) -> list:
    if not isinstance(data, list):
        raise FieldError(expected, data)
    return data


def _refuse_unknown(words, known) -> None:
    for word in words:
        if word not in known:
            raise FieldError(*unknown(word, known), word)


def _within(place: str, read, *args):
    """`read(*args)`, with errors that say it was in `place`."""
    try:
        return read(*args)
    except FieldError as error:
        raise error.inside(place) from None


class _Beside:
    """What reads or writes a scene in a folder, where the files of its meshes are."""

    def __init__(self, folder: str):
        self._folder = folder

    @functools.cached_property
    def _meshes(self):
        from rtcore.files._meshes import MeshFiles      # here, for most scenes name no file
        return MeshFiles(self._folder)


class _Reader(_Beside):
    """Plain data to records. Paths inside errors are relative to the value at hand; callers put their own step before them."""

    def scene(self, data: Any) -> Scene:
        data = _mapping(data, f"a mapping that begins with rayscope: {VERSION}")
        version = data.get("rayscope")
        if version != VERSION or isinstance(version, bool):
            raise FieldError(f"version {VERSION} of the format", version, "rayscope")
        _refuse_unknown(data, SCENE_WORDS)
        if "scene" not in data:
            raise FieldError("a list of nodes", None, "scene")
        found = {name: data[name] for name in ("name", "note") if name in data}
        for name, cls in (("camera", Camera), ("fog", Fog), ("background", Background)):
            if data.get(name) is not None:
                found[name] = _within(name, self.record, cls, data[name])
        if data.get("lights") is not None:
            found["lights"] = self.each("lights", data["lights"], "a list of lights", self.light)
        for name, kind, read in (("materials", "materials", functools.partial(self.record, Material)), ("definitions", "nodes", self.node)):
            if data.get(name) is not None:
                named = _within(name, _mapping, data[name], f"a mapping of names to {kind}")
                found[name] = {key: _within(name, _within, key, read, value) for key, value in named.items()}
        found["objects"] = self.each("scene", data["scene"], "a list of nodes", self.node)
        return Scene(**found)

    def each(self, place: str, data: Any, expected: str, read, *args) -> tuple:
        """A tuple of what `read` makes of each item of a list."""
        result = []
        for i, item in enumerate(_within(place, _list, data, expected)):
            try:
                result.append(read(item, *args))
            except FieldError as error:
                raise error.inside(f"[{i}]").inside(place) from None
        return tuple(result)

    def record(self, cls: type, data: Any) -> Any:
        """A record from a mapping of its fields."""
        known = fields_of(cls)
        data = _mapping(data, "a mapping of " + ", ".join(known))
        _refuse_unknown(data, known)
        for name in _required(cls):
            if name not in data:
                _within(name, known[name].take, None)       # says what it expects, if it does not take nothing
                raise FieldError("a value", None, name)
        inner = {name: _within(name, self.record, sub, data[name]) for name, sub in _records_in(cls).items() if data.get(name) is not None}
        return cls(**{**data, **inner} if inner else data)

    def node(self, data: Any, depth: int = 0) -> Node:
        data = _mapping(data, "a node: a mapping with one of " + ", ".join(PLACES))
        if depth >= MOST_NESTED:
            raise FieldError(f"at most {MOST_NESTED} groups inside one another", Said("more"))
        found, places = {}, []
        for word, value in data.items():
            if word in PLACES:
                places.append(word)
            elif word == "transform":
                found[word] = () if value is None else self.each(word, value, "a list of transforms", self.transform)
            elif word == "material" and isinstance(value, dict):
                found[word] = _within(word, self.record, Material, value)
            elif word in NODE_WORDS:
                found[word] = value
            else:
                raise FieldError(*unknown(word, (*PLACES, *NODE_WORDS)), word)
        if len(places) != 1:
            raise FieldError("exactly one of " + ", ".join(PLACES), Said(" and ".join(places) or "none of them"))
        word, = places
        if word == "group":
            found["children"] = self.each(word, data[word], "a list of nodes", self.node, depth + 1)
        elif word == "use":
            found["use"] = _within(word, _name, data[word])
        else:
            found["shape"] = _within(word, self.shape, shape_named(SHAPE_WORDS[word]), data[word])
        return Node(**found)

    def shape(self, cls: type, data: Any):
        if "file" in fields_of(cls) and isinstance(data, dict) and "file" in data and "vertices" not in data:
            _refuse_unknown(data, [name for name in fields_of(cls) if name not in ARRAYS])
            mesh = _within("file", self._meshes.mesh, data["file"])
            return mesh if set(data) == {"file"} else msgspec.structs.replace(mesh, **{**data, "file": mesh.file})
        return self.record(cls, data)

    def light(self, data: Any):
        return self.one_word(data, "a light", LIGHT_WORDS)

    def transform(self, data: Any):
        if isinstance(data, dict) and data.keys() == {"scale"}:
            with contextlib.suppress(TypeError, OverflowError):     # then it is three numbers, or an error with its usual words
                data = {"scale": [number(data["scale"])] * 3}
        return self.one_word(data, "a transform", TRANSFORM_WORDS)

    def one_word(self, data: Any, what: str, words: dict[str, type]):
        """A record from a mapping of its one word to its fields, or to the value of its only field."""
        data = _mapping(data, f"{what}: a mapping with one of " + ", ".join(words))
        _refuse_unknown(data, words)
        if len(data) != 1:
            raise FieldError(f"{what} with exactly one of " + ", ".join(words), Said(" and ".join(data) or "none of them"))
        (word, value), = data.items()
        only = _fields(words[word])[0].name if len(_fields(words[word])) == 1 else None
        if only is None or isinstance(value, dict):
            return _within(word, self.record, words[word], value)
        try:
            return words[word](value)
        except FieldError as error:
            raise FieldError(error.expected, error.got, word + error.path.removeprefix(only)) from None


def _name(value: Any) -> str:
    if not isinstance(value, str):
        raise FieldError("the name of a definition", value)
    return value


class _Writer(_Beside):
    """Records to plain data: what `_Reader` reads. Fields that have their default are left out."""

    def scene(self, scene: Scene) -> dict:
        data: dict[str, Any] = Block(rayscope=VERSION)
        data.update({name: text for name, text in (("name", scene.name), ("note", scene.note)) if text})
        background = None if scene.background == Background() else scene.background
        for name, value in (("camera", scene.camera), ("background", background), ("fog", scene.fog)):
            if value is not None:
                data[name] = self.record(value)
        if scene.lights is not None:
            data["lights"] = Lines(self.one_word(light) for light in scene.lights)
        if scene.materials:
            data["materials"] = Block({name: self.record(material) for name, material in scene.materials.items()})
        if scene.definitions:
            data["definitions"] = Block({name: self.node(node) for name, node in scene.definitions.items()})
        data["scene"] = [self.node(node) for node in scene.objects]
        return data

    def node(self, node: Node) -> dict:
        data: dict[str, Any] = Block()
        if node.name:
            data["name"] = node.name
        if node.use is not None:
            data["use"] = node.use
        elif node.shape is not None:
            data[type(node.shape).__name__.lower()] = self.shape(node.shape)
        if node.material is not None:
            data["material"] = node.material if isinstance(node.material, str) else self.record(node.material)
        if node.transform:
            data["transform"] = [self.one_word(t) for t in node.transform]
        if not node.visible:
            data["visible"] = False
        if node.note:
            data["note"] = node.note
        if node.children is not None:       # last, so that a group's own words are not found far below
            data["group"] = [self.node(child) for child in node.children]
        return data

    def shape(self, shape) -> dict:
        name = self._meshes.name_of(shape) if getattr(shape, "file", None) else None
        return self.record(shape) if name is None else {"file": name, **self.record(shape, without=(*ARRAYS, "file"))}

    def one_word(self, record: Record) -> dict:
        """A light or a transform: its word with its fields, or with the value of its only field."""
        word, fields = type(record).__name__.lower(), _fields(type(record))
        if isinstance(record, Scale) and len(set(map(repr, record.factors))) == 1:
            return {word: record.factors[0]}
        return {word: _plain(getattr(record, fields[0].name)) if len(fields) == 1 else self.record(record)}

    def record(self, record: Record, without: tuple[str, ...] = ()) -> dict:
        data = {}
        for field in _fields(type(record)):
            if field.name in without:
                continue
            value = getattr(record, field.name)
            if value is None and field.default is None:
                continue
            if not isinstance(value, (Record, np.ndarray)) and value == field.default and repr(value) == repr(field.default):
                continue
            data[field.name] = self.record(value) if isinstance(value, Record) else _plain(value)
        return data


def _plain(value: Any) -> Any:
    """A field's value with arrays as lists."""
    return value.tolist() if isinstance(value, np.ndarray) else value
