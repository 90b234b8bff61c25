"""Writing a file so that the old one is intact until the new one is complete."""
import contextlib
import os
import secrets
import stat

from rtcore.files._errors import WriteError, reason


def write_file(path: str | os.PathLike, data: bytes) -> None:
    """Write a new file beside `path`, then put it in the place of the old one at one stroke.

    A link is followed and the old file's permissions are kept. WriteError if that can't be done; the old file is then as it
    was and nothing is left beside it.
    """
    target = writable(path)
    beside = os.path.join(os.path.dirname(target), f".{os.path.basename(target)[:80]}.{secrets.token_hex(4)}.part")
    try:
        with open(beside, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        with contextlib.suppress(FileNotFoundError):
            os.chmod(beside, stat.S_IMODE(os.stat(target).st_mode))
        os.replace(beside, target)
    except OSError as error:
        raise WriteError(path, "cannot be written: " + reason(error)) from None
    finally:
        with contextlib.suppress(OSError):
            os.unlink(beside)


def writable(path: str | os.PathLike) -> str:
    """The absolute path, links followed, that a file written to `path` will have; WriteError if it plainly can't be written."""
    if "\0" in os.fspath(path):
        raise WriteError(repr(os.fspath(path)), "cannot be written: a path holds no zero byte")
    try:
        target = os.path.realpath(path)
        folder = os.path.dirname(target)
        if not os.path.isdir(folder):
            raise WriteError(path, f"cannot be written: there is no folder {os.path.dirname(os.fspath(path)) or folder}")
        if os.path.exists(target) and not os.path.isfile(target):
            raise WriteError(path, "cannot be written: it is " + ("a folder" if os.path.isdir(target) else "not a plain file"))
        if not os.access(folder, os.W_OK | os.X_OK) or (os.path.exists(target) and not os.access(target, os.W_OK)):
            raise WriteError(path, "cannot be written: Permission denied")
    except OSError as error:
        raise WriteError(path, "cannot be written: " + reason(error)) from None
    return target
