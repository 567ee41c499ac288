"""The bytes of a file from outside, within the memory that is free. Raises OSError, as reading does."""

import errno
import io
import os
import stat
from pathlib import Path

from exactarm.errors import InputError
from exactarm.files.free_memory import GIGABYTE, SHARE, free_bytes


def path_of(path: object, expected: str) -> Path:
    """The path that is given; what names no file is refused, as a table in memory."""
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"a {type(path).__name__} is no file; expected {expected}")
    return Path(path)


def real_path(path: str | Path) -> Path:
    """Without links; those in a circle stay (`Path.resolve` raises RuntimeError on them)."""
    return Path(os.path.realpath(path))


def file_bytes(path: str | Path) -> bytes:
    """All of a file or pipe. A device has no end, and a file may be larger than the memory."""
    kind = os.stat(path).st_mode
    if stat.S_ISCHR(kind) or stat.S_ISBLK(kind) or stat.S_ISSOCK(kind):
        raise OSError(errno.ENODEV, "a device, not a file")
    free = free_bytes()
    with open(path, "rb") as stream:
        if free is None:
            return stream.read()
        most = int(SHARE * free)
        if stat.S_ISREG(kind) and os.fstat(stream.fileno()).st_size > most:
            raise _too_large(free)
        content = stream.read() if stat.S_ISREG(kind) else stream.read(most + 1)
    if len(content) > most:
        raise _too_large(free)
    return content


def file_text(path: str | Path) -> str:
    """The same as text in UTF-8, with ends of lines as Python has them."""
    return io.TextIOWrapper(io.BytesIO(file_bytes(path)), encoding="utf-8").read()


def _too_large(free: float) -> OSError:
    return OSError(errno.EFBIG, f"larger than the memory that is free, {free / GIGABYTE:.3g} GB")
