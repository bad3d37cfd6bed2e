"""Faults of painters, which must not cost the result of a long run."""

import errno
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

_MOST = 300  # characters of a fault that are told
_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS}


@dataclass
class Faults:
    """What could not be drawn, a line each: the one place that catches the faults of painters.

    Attributes:
        lines: In the order in which they were met.
    """

    lines: list[str] = field(default_factory=list)

    def guarded[T](self, what: str, make: Callable[[], T], path: Path | None = None) -> T | None:
        """Make something; None, and a line about it, if that fails.

        A fault in a picture must not cost the result of a long run.

        Args:
            what: What is made, in words.
            make: Makes it.
            path: The file that is made: it goes if that fails.

        Raises:
            OSError: There is no room: nothing else could be written either.
            OutputError: The same.
        """
        try:
            return make()
        except Exception as fault:  # (told, and an error in the tests)
            cause = fault.__cause__ or fault
            if isinstance(cause, OSError) and cause.errno in _NO_ROOM:
                raise
            text = " ".join(f"{type(fault).__name__}: {fault}".split())[:_MOST]
            self.lines.append(f"not drawn: {what} ({text})")
            if path is not None:
                path.unlink(missing_ok=True)
            return None
