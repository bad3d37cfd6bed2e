"""HDF5 files whose writer was killed: told to be closed, so that they open again."""

import struct
from pathlib import Path

_SIGNATURE, _VERSION = b"\x89HDF\r\n\x1a\n", 3
_SIZE = 48  # of a superblock of this version, with addresses of 8 bytes
_MASK = 0xFFFFFFFF


def mend(path: Path) -> None:
    """Mark a file as closed that was written by one writer for many readers.

    Its content is consistent at any moment; only its first block still says that there is a writer
    and where the file ended when that was last noted. Other files are left alone. Source: "HDF5
    file format specification", version 3.0, sections II.A and VIII.

    Raises:
        OSError: The file cannot be read or written.
    """
    with path.open("r+b") as file:
        block = bytearray(file.read(_SIZE))
        if len(block) < _SIZE or not block.startswith(_SIGNATURE) or block[8] != _VERSION:
            return
        if block[9] != 8 or block[11] == 0:
            return
        block[11] = 0
        struct.pack_into("<Q", block, 28, path.stat().st_size)
        struct.pack_into("<I", block, 44, _checksum(bytes(block[:44])))
        file.seek(0)
        file.write(block)


def _checksum(data: bytes) -> int:
    """Bob Jenkins' hash "lookup3" of 44 bytes, as HDF5 has it in its metadata."""
    a: int = (0xDEADBEEF + len(data)) & _MASK
    b = c = a
    words: tuple[int, ...] = struct.unpack("<11I", data)
    for k in (0, 3, 6):
        a, b, c = (a + words[k]) & _MASK, (b + words[k + 1]) & _MASK, (c + words[k + 2]) & _MASK
        for turn in (4, 6, 8, 16, 19, 4):
            a = ((a - c) & _MASK) ^ _turned(c, turn)
            c = (c + b) & _MASK
            a, b, c = b, c, a
    a, b = (a + words[9]) & _MASK, (b + words[10]) & _MASK
    for turn in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _turned(b, turn)) & _MASK
        a, b, c = b, c, a
    return b


def _turned(value: int, by: int) -> int:
    """A word of 32 bits turned to the left."""
    return ((value << by) | (value >> (32 - by))) & _MASK
