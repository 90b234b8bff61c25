"""What can be wrong with a file, in one line; and reading one with the checks that every format needs."""
import os
from collections.abc import Iterable

from rtcore.fields import FieldError, shown


class FileError(ValueError):
    """A file that can't be read or written. `str()` is one line: the file, the place in it where there is one, what was
    expected and what was there."""

    def __init__(self, path: str | os.PathLike, problem: str, *, line: int | None = None, place: str = ""):
        super().__init__(os.fspath(path), problem, line, place)
        self.path, self.problem, self.line, self.place = os.fspath(path), problem, line, place

    def __str__(self) -> str:
        place = self.place if len(self.place) <= 120 else f"{self.place[:60]} ... {self.place[-55:]}"
        parts = [self.path, f"line {self.line}" if self.line else "", place, self.problem]
        return " ".join(": ".join(filter(None, parts)).split())

    @classmethod
    def expected(cls, path, expected: str, got: object, *, line: int | None = None, place: str = "") -> "FileError":
        """The usual sentence; `got` is shown as a value, or as it is if it is `Said`."""
        return cls(path, f"expected {expected}, got {got if isinstance(got, Said) else shown(got)}", line=line, place=place)

    @classmethod
    def of(cls, path, error: FieldError, line: int | None = None) -> "FileError":
        """What is wrong with a field, as a file's error."""
        return cls.expected(path, error.expected, error.got, line=line, place=error.path)


class WriteError(FileError):
    """A file that can't be written; whatever stood there before still does."""


class Said(str):
    """Something in words, to be shown in a message without the quotes of a value."""


def unknown(word: str, words: Iterable[str]) -> tuple[str, Said]:
    """What was expected in place of an unknown word, and what was there, with the nearest known word suggested."""
    from difflib import get_close_matches
    words = list(words)
    near = get_close_matches(word.lower(), words, 1, 0.6)
    return "one of " + ", ".join(words), Said(shown(word) + (f" (did you mean {near[0]!r}?)" if near else ""))


def read_bytes(path: str | os.PathLike, most: int) -> bytes:
    """The whole of a regular file of 1 to `most` bytes; FileError for anything else, before a byte of it is read."""
    try:
        with open(path, "rb", opener=_open_at_once) as file:
            status = os.fstat(file.fileno())
            if not os.path.isfile(path):
                raise FileError.expected(path, "a file", Said("a folder" if os.path.isdir(path) else "a device or a pipe"))
            if status.st_size > most:
                raise FileError.expected(path, f"a file of at most {mebibytes(most)}", Said(mebibytes(status.st_size)))
            data = file.read(most + 1)
    except OSError as error:
        raise FileError(path, "cannot be read: " + reason(error)) from None
    except ValueError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(repr(os.fspath(path)), "cannot be read: a path holds no zero byte") from None
    if len(data) > most:
        raise FileError.expected(path, f"a file of at most {mebibytes(most)}", Said("a longer one"))
    if not data:
        raise FileError.expected(path, "a scene", Said("an empty file"))
    return data


def read_text(path: str | os.PathLike, most: int) -> str:
    """The whole of a UTF-8 text file, without a byte order mark; FileError if it is something else."""
    data = read_bytes(path, most)
    zero = data.find(b"\0", 0, 1 << 16)
    if zero >= 0:
        raise FileError.expected(path, "a text file", Said(f"a binary one (a zero byte at offset {zero})"))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError.expected(path, "text in UTF-8", Said(f"the byte 0x{data[error.start]:02x}"),
                                 line=data.count(b"\n", 0, error.start) + 1) from None
    if not text.strip():
        raise FileError.expected(path, "a scene", Said("an empty file"))
    return text


def reason(error: OSError) -> str:
    """Why the system refused, in its words."""
    return error.strerror or type(error).__name__


def mebibytes(count: int) -> str:
    """A size for people."""
    return f"{count / 2**20:.3g} MiB"


def _open_at_once(path: str, flags: int) -> int:
    """Open without waiting: a pipe that nobody writes to would block for ever."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
