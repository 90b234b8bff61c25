"""Plain data to YAML text that people like to read: short things on one line, numbers in the fewest digits that give them back.

The text is YAML 1.2 and, but for numbers such as ``1e-3``, YAML 1.1 as well. `rtcore.files._yaml` reads it back exactly.
"""
import re
from typing import Any

from rtcore.files._yaml import WORDS

WIDTH = 118     # what fits on a line stays on one

_PLAIN = re.compile(r"[A-Za-z_][\w./+()-]*(?: [\w./+()-]+)*", re.ASCII)
_YAML_1_1 = {"y", "n", "yes", "no", "on", "off"}    # booleans to other programs
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}
_LONGEST_KEY = 200      # beyond 1024 a key needs the long form


class Block(dict):
    """A mapping that is written a line a word, however short it is."""


class Lines(list):
    """A list that is written a line an item, however short it is."""


def dump(data: dict) -> str:
    """The text of a mapping with string keys that holds mappings, lists, tuples, strings, numbers, booleans and None.

    ValueError if a string can't be written in UTF-8, because it holds half of a surrogate pair.
    """
    out: list[str] = []
    _block(data, 0, out)
    return "\n".join(out) + "\n"


def scalar(value: Any) -> str:
    """One value that is neither mapping nor list."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, int):
        return str(value)
    text = repr(float(value))
    return text[:-2] if text.endswith(".0") and text != "-0.0" else text


def _string(text: str) -> str:
    """A string, quoted where it could be taken for something else."""
    if _PLAIN.fullmatch(text) and text not in WORDS and text.lower() not in _YAML_1_1:
        return text
    return '"' + "".join(_ESCAPES.get(c) or (c if c.isprintable() else _escaped(c)) for c in text) + '"'


def _escaped(char: str) -> str:
    code = ord(char)
    if 0xD800 <= code <= 0xDFFF:
        raise ValueError(f"expected text that UTF-8 can hold, got the lone surrogate U+{code:04X}")
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _line(value: Any, room: int) -> str | None:
    """A value on one line of at most `room` letters, or None if it does not fit there."""
    if isinstance(value, dict):
        if isinstance(value, Block):
            return None
        items, ends = [], "{}"
        for key, item in value.items():
            text = _line(item, room - 2)
            if text is None or len(key) > _LONGEST_KEY:
                return None
            items.append(f"{_string(key)}: {text}")
            room -= len(items[-1]) + 2
    elif isinstance(value, (list, tuple)):
        if isinstance(value, Lines) and value:
            return None
        items, ends = [], "[]"
        for item in value:
            text = _line(item, room - 2)
            if text is None:
                return None
            items.append(text)
            room -= len(text) + 2
    else:
        text = scalar(value)
        return text if len(text) <= room else None
    return ends[0] + ", ".join(items) + ends[1] if room >= 0 else None


def _literal(text: Any, indent: str) -> list[str] | None:
    """A text of several lines as YAML's literal block, or None if that would change it."""
    if not isinstance(text, str) or "\n" not in text.rstrip("\n") or "\\u" in text or text.endswith("\n\n"):
        return None
    lines = text.removesuffix("\n").split("\n")
    if not all(line.isprintable() and line == line.rstrip() for line in lines) or not lines[0] or lines[0][0].isspace():
        return None
    return ["|" if text.endswith("\n") else "|-", *(indent + line if line else "" for line in lines)]


def _block(data: Any, depth: int, out: list[str]) -> None:
    """Append the lines of a mapping or a list, a line or more an item."""
    indent = "  " * depth
    if isinstance(data, dict):
        for key, value in data.items():
            word = _string(key)
            if len(key) > _LONGEST_KEY:
                out.append(f"{indent}? {word}")
                word = ""
            _item(f"{indent}{word}:", value, depth + 1, out)
    else:
        for value in data:
            if isinstance(value, dict) and value and _line(value, WIDTH - len(indent)) is None:
                start = len(out)        # a mapping's first word stands beside the dash
                _block(value, depth + 1, out)
                out[start] = f"{indent}- {out[start][len(indent) + 2:]}"
            else:
                _item(f"{indent}-", value, depth + 1, out)


def _item(lead: str, value: Any, depth: int, out: list[str]) -> None:
    """Append `lead` and a value: on the same line if it fits there or has to stand there, else on the lines below."""
    text = _line(value, WIDTH - len(lead) - 1)
    lines = _literal(value, "  " * depth)
    if lines:
        out.append(f"{lead} {lines[0]}")
        out += lines[1:]
    elif text is not None:
        out.append(f"{lead} {text}")
    elif isinstance(value, (dict, list, tuple)) and value:
        out.append(lead)
        _block(value, depth, out)
    else:
        out.append(f"{lead} " + ("{}" if isinstance(value, dict) else scalar(value)))
