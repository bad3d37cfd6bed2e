"""The bytes of a file that a scene names."""

import errno
import os
import stat
from pathlib import Path

MAX_BYTES = 512 * 2**20
"""Largest file of a mesh, surface or geometry that is read."""


def read_regular(path: Path, most: int = MAX_BYTES) -> bytes:
    """Read a file, but no device, pipe or folder: these may have no end, or wait for ever.

    Args:
        path: May be a link to a file.
        most: Bytes beyond which nothing is read.

    Raises:
        OSError: It cannot be read, is no regular file, or is larger.
        ValueError: The path cannot be the name of a file.
    """
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY), "rb") as file:  # noqa: PTH123
        known = os.fstat(file.fileno())
        if not stat.S_ISREG(known.st_mode):
            raise OSError(errno.EINVAL, "it is no regular file")
        content = b"" if known.st_size > most else file.read(most + 1)  # it may grow meanwhile
    if (size := max(known.st_size, len(content))) > most:
        raise OSError(errno.EFBIG, f"it has {size} bytes, more than the {most} that are read")
    return content


def reason(error: OSError | ValueError) -> str:
    """Why a file was not read, in words."""
    if isinstance(error, UnicodeDecodeError):
        return f"byte {error.start} is not {error.encoding.upper()}"
    return str(getattr(error, "strerror", None) or error)
