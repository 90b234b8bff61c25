"""Fields of the scene's records: what each may hold, in one place that the file format, the property editor and the API share.

A record states its fields once, ``radius: Annotated[float, Number(above=0, help="...")]``, and from then on every way in
checks them alike: the constructor in Python, a scene file, an edit in the window. A field that can't be taken raises
`FieldError`, which knows the path to it, what was expected and what was there.
"""
import math
import typing
from dataclasses import dataclass

import msgspec

Vec = tuple[float, float, float]


class FieldError(ValueError):
    """A value that a record can't take: ``path`` to the field, what was ``expected``, what was there (``got``)."""

    def __init__(self, expected: str, got: object, path: str = ""):
        super().__init__(expected, got, path)
        self.expected, self.got, self.path = expected, got, path

    def inside(self, outer: str) -> "FieldError":
        """The same error seen from one level further out: ``radius`` becomes ``sphere.radius``, ``[3]`` ``scene[3]``."""
        joint = "" if not self.path or self.path.startswith("[") else "."
        return FieldError(self.expected, self.got, f"{outer}{joint}{self.path}")

    def __str__(self) -> str:
        return f"{self.path + ': ' if self.path else ''}expected {self.expected}, got {shown(self.got)}"


def shown(value: object) -> str:
    """A value as an error message shows it: on one line and never long."""
    text = "nothing" if value is None else " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def number(value: object) -> float:
    """`value` as a finite float, or TypeError; a bool or a numeric string is no number."""
    if isinstance(value, (bool, str, bytes)) or not hasattr(value, "__float__"):
        raise TypeError
    result = float(value)
    if not math.isfinite(result):
        raise TypeError
    return result


@dataclass(frozen=True, kw_only=True)
class Field:
    """What a field may hold. `take` returns the value in its stored form or raises FieldError."""

    help: str = ""
    unit: str = ""

    def take(self, value):
        return value


@dataclass(frozen=True, kw_only=True)
class Number(Field):
    """A finite float: ``above``/``below`` exclude the limit, ``least``/``most`` include it."""

    above: float | None = None
    least: float | None = None
    below: float | None = None
    most: float | None = None

    def expected(self) -> str:
        low = f"greater than {self.above:g}" if self.above is not None else f"of at least {self.least:g}" if self.least is not None else ""
        high = f"less than {self.below:g}" if self.below is not None else f"of at most {self.most:g}" if self.most is not None else ""
        return " ".join(["a number", *filter(None, [" and ".join(filter(None, [low, high]))])])

    def take(self, value):
        try:
            result = number(value)
        except (TypeError, ValueError, OverflowError):
            raise FieldError("a finite number" if self.expected() == "a number" else self.expected(), value) from None
        if ((self.above is not None and not result > self.above) or (self.least is not None and not result >= self.least)
                or (self.below is not None and not result < self.below) or (self.most is not None and not result <= self.most)):
            raise FieldError(self.expected(), value)
        return result


@dataclass(frozen=True, kw_only=True)
class Vector(Field):
    """Three finite numbers; ``nonzero`` refuses the zero vector."""

    nonzero: bool = False

    def take(self, value):
        try:
            if isinstance(value, (str, bytes, dict)):
                raise TypeError
            result = tuple(number(part) for part in value)
        except (TypeError, ValueError, OverflowError):
            raise FieldError("three finite numbers", value) from None
        if len(result) != 3:
            raise FieldError("three finite numbers", value)
        if self.nonzero and not any(result):
            raise FieldError("a vector that is not zero", value)
        return result


@dataclass(frozen=True, kw_only=True)
class Numbers(Field):
    """``count`` finite numbers."""

    count: int = 1

    def take(self, value):
        expected = f"{self.count} finite numbers"
        try:
            if isinstance(value, (str, bytes, dict)):
                raise TypeError
            result = tuple(number(part) for part in value)
        except (TypeError, ValueError, OverflowError):
            raise FieldError(expected, value) from None
        if len(result) != self.count:
            raise FieldError(expected, value)
        return result


@dataclass(frozen=True, kw_only=True)
class Color(Field):
    """Linear red, green, blue, none negative. A string ``"#rrggbb"`` is read as sRGB and stored linear."""

    most: float = math.inf

    def take(self, value):
        if isinstance(value, str):
            digits = value.removeprefix("#")
            if len(digits) != 6 or len(value) != 7 or any(c not in "0123456789abcdefABCDEF" for c in digits):
                raise FieldError('a colour: three numbers or "#rrggbb"', value)
            return tuple(linear_from_srgb(int(digits[i:i + 2], 16) / 255) for i in (0, 2, 4))
        try:
            result = Vector().take(value)
        except FieldError:
            raise FieldError('a colour: three numbers or "#rrggbb"', value) from None
        if min(result) < 0 or max(result) > self.most:
            limit = "" if self.most == math.inf else f" and at most {self.most:g}"
            raise FieldError(f"a colour whose parts are at least 0{limit}", value)
        return result


@dataclass(frozen=True, kw_only=True)
class Choice(Field):
    """One word of a few."""

    words: tuple[str, ...] = ()

    def take(self, value):
        if value not in self.words:
            raise FieldError("one of " + ", ".join(self.words), value)
        return value


@dataclass(frozen=True, kw_only=True)
class Flag(Field):
    """True or false."""

    def take(self, value):
        if not isinstance(value, bool):
            raise FieldError("true or false", value)
        return value


@dataclass(frozen=True, kw_only=True)
class Text(Field):
    """A string."""

    def take(self, value):
        if not isinstance(value, str):
            raise FieldError("a text", value)
        return value


@dataclass(frozen=True, kw_only=True)
class Formula(Text):
    """A formula, as a person types it; the shape that has one says what may stand in it."""


@dataclass(frozen=True, kw_only=True)
class Vectors(Field):
    """At least ``least`` points, each of three finite numbers."""

    least: int = 0

    def take(self, value):
        if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__iter__"):
            raise FieldError(f"a list of at least {self.least} points", value)
        result = []
        for i, point in enumerate(value):
            try:
                result.append(Vector().take(point))
            except FieldError as error:
                raise error.inside(f"[{i}]") from None
        if len(result) < self.least:
            raise FieldError(f"a list of at least {self.least} points", value)
        return tuple(result)


@dataclass(frozen=True, kw_only=True)
class Maybe(Field):
    """The inner field, or nothing."""

    inner: Field = Field()

    def take(self, value):
        return None if value is None else self.inner.take(value)


class Record(msgspec.Struct, frozen=True):
    """A frozen struct that checks and normalises its fields when it is made, whoever makes it."""

    def __post_init__(self):
        for name, field in fields_of(type(self)).items():
            before = getattr(self, name)
            try:
                after = field.take(before)
            except FieldError as error:
                raise error.inside(name) from None
            if after is not before:
                msgspec.structs.force_setattr(self, name, after)
        self.check()

    def check(self):
        """What no single field can tell; raises FieldError."""


_FIELDS: dict[type, dict[str, Field]] = {}


def fields_of(record: type) -> dict[str, Field]:
    """Name to `Field` of a record type, in the order of its definition."""
    if record not in _FIELDS:
        hints = typing.get_type_hints(record, include_extras=True)
        _FIELDS[record] = {f.name: next((m for m in getattr(hints[f.name], "__metadata__", ()) if isinstance(m, Field)), Field())
                           for f in msgspec.structs.fields(record)}
    return _FIELDS[record]


def linear_from_srgb(value: float) -> float:
    """One channel, 0 to 1, from sRGB's curve to linear light (IEC 61966-2-1)."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def srgb_from_linear(value: float) -> float:
    """One channel from linear light to sRGB's curve, clipped to 0 .. 1 (IEC 61966-2-1)."""
    value = min(max(value, 0.0), 1.0)
    return 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055
