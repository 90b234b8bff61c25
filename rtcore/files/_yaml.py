"""YAML text to plain data and back: YAML 1.2's core words, in bounded time and memory, with the line of every value on request.

PyYAML's own loader follows YAML 1.1 (``1e-3`` and ``1.`` are strings to it, ``on`` is true, ``010`` is 8), recurses, and lets
aliases expand without end. Here its event stream is read with a stack: nothing recurses, a key given twice is an error, and
the only values are mappings with string keys, lists, strings, numbers, booleans and None. JSON is read by the same code.
"""
import re
from collections.abc import Iterator
from typing import Any

import yaml
from yaml.events import AliasEvent, MappingEndEvent, MappingStartEvent, ScalarEvent, SequenceEndEvent, SequenceStartEvent

from rtcore.fields import shown

MOST_NESTED = 500           # mappings and lists inside one another
MOST_ALIASED = 1_000_000    # values that aliases stand for, in all

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_FLOAT = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
WORDS = {"": None, "~": None, "null": None, "Null": None, "NULL": None,
          "true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False,
          ".nan": float("nan"), ".NaN": float("nan"), ".NAN": float("nan"),
          **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")}}
_SURROGATES = re.compile(r"\\(?:u([dD][89abAB][0-9a-fA-F]{2})\\u([dD][c-fC-F][0-9a-fA-F]{2})|.)", re.DOTALL)


class TextError(ValueError):
    """What is wrong with a YAML text: `problem`, in words, and the `line` it is in, from 1."""

    def __init__(self, problem: str, line: int):
        super().__init__(problem, line)
        self.problem, self.line = problem, line


def parse(text: str) -> Any:
    """The one document of a YAML or JSON text as plain data; TextError if it is none."""
    return _build(text, None)


def line_of(text: str, path: str) -> int | None:
    """The line, from 1, of the value at a path such as ``scene[3].sphere.radius`` in a text that `parse` takes, or else of
    the innermost value around it that is there. It costs a second parse, so it is asked for only when there is an error."""
    lines: dict[int, list[int]] = {}
    value, line = _build(text, lines), None
    while True:
        if isinstance(value, dict):
            steps = [(f".{key}", key, i) for i, key in enumerate(value)] + [(key, key, i) for i, key in enumerate(value)]
        elif isinstance(value, list):
            steps = [(f"[{i}]", i, i) for i in range(len(value))]
        else:
            return line
        steps = [step for step in steps if path.startswith(step[0]) and path[len(step[0]):][:1] in ("", ".", "[")]
        if not path or not steps:
            return line
        text_of_step, key, number = max(steps, key=lambda step: len(step[0]))
        line, value, path = lines[id(value)][number], value[key], path[len(text_of_step):]


def _events(text: str) -> Iterator:
    """PyYAML's events; its errors as TextError, surrogate pairs (JSON's way with letters beyond 16 bits) as the letters."""
    if "\\ud" in text or "\\uD" in text:
        text = _SURROGATES.sub(lambda m: m[0] if m[1] is None else
                               chr(0x10000 + ((int(m[1], 16) - 0xD800) << 10) + int(m[2], 16) - 0xDC00), text)
    loader = _LOADER(text)
    try:
        while loader.check_event():
            yield loader.get_event()
    except yaml.reader.ReaderError as error:
        there = text.encode()[:error.position].decode(errors="ignore")     # it counts bytes
        raise TextError(f"expected printable text, got the character U+{error.character:04X}", there.count("\n") + 1) from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        said = ", ".join(filter(None, (getattr(error, "context", None), getattr(error, "problem", None)))) or str(error)
        raise TextError(f"expected YAML or JSON, but {said}",
                        mark.line + 1 if mark else 1) from None
    finally:
        loader.dispose()


def _scalar(event: ScalarEvent) -> Any:
    """A scalar's value by YAML 1.2's core schema."""
    text = event.value
    if not event.implicit[0]:
        return text             # quoted
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    return WORDS.get(text, text)


def _build(text: str, lines: dict[int, list[int]] | None) -> Any:
    """Data from a text. `lines`, if given, gets by id of each list and mapping the lines of its values in their order."""
    anchors: dict[str, tuple[Any, int]] = {}        # name -> value, and how many values it holds
    stack: list[tuple] = []                         # the open containers around the innermost one
    container, key, anchor, count, aliased = None, None, None, 0, 0
    root: list = []                                 # the document, once there is one
    for event in _events(text):
        kind = event.__class__
        line = event.start_mark.line + 1
        if kind is ScalarEvent or kind is AliasEvent:
            if kind is AliasEvent:
                if event.anchor not in anchors:
                    raise TextError(f"expected an alias of something that is complete by then, got *{event.anchor}", line)
                value, size = anchors[event.anchor]
                aliased += size
                if aliased > MOST_ALIASED:
                    raise TextError(f"expected aliases that stand for at most {MOST_ALIASED:,} values in all, got more", line)
            else:
                if event.tag is not None:
                    raise TextError(f"expected no tags, got {event.tag}", line)
                value, size = _scalar(event), 1
                if event.anchor is not None:
                    anchors[event.anchor] = value, 1
            count += size
        elif kind is SequenceStartEvent or kind is MappingStartEvent:
            if event.tag is not None:
                raise TextError(f"expected no tags, got {event.tag}", line)
            if container.__class__ is dict and key is None:
                raise TextError("expected a word before the colon, got a list or a mapping", line)
            if len(stack) >= MOST_NESTED:
                raise TextError(f"expected at most {MOST_NESTED} mappings and lists inside one another, got more", line)
            stack.append((container, key, anchor, count, line))
            container, key, anchor, count = [] if kind is SequenceStartEvent else {}, None, event.anchor, 1
            if lines is not None:
                lines[id(container)] = []
            continue
        elif kind is SequenceEndEvent or kind is MappingEndEvent:
            value, size = container, count
            if anchor is not None:
                anchors[anchor] = value, size
            container, key, anchor, count, line = stack.pop()
            count += size
        elif kind is yaml.DocumentStartEvent and root:
            raise TextError("expected one document, got a second one", line)
        else:
            continue

        if container.__class__ is list:
            container.append(value)
        elif container.__class__ is dict:
            if key is None:
                key = event.value if kind is ScalarEvent else value
                if not isinstance(key, str):
                    raise TextError(f"expected a word before the colon, got {shown(key)}", line)
                if key in container:
                    raise TextError(f"expected each word once, got {shown(key)} a second time", line)
                continue
            container[key], key = value, None
        else:
            root.append(value)
        if lines is not None and container is not None:
            lines[id(container)].append(line)
    return root[0] if root else None
