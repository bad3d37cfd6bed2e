"""What is drawn into the folder of a result, when its data are already there."""

import errno
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from impactfem.errors import OutputError
from impactfem.findings import Finding
from impactfem.result.store import replaced, write_summary

if TYPE_CHECKING:
    from impactfem.result import Result
    from impactfem.scene import Output

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


def add_pictures(
    result: "Result", folder: Path, wanted: "Output | None" = None
) -> tuple[list[str], list[str]]:
    """Draw into the folder of a result, and note in its summary what could not be drawn.

    Args:
        result: What to draw.
        folder: Holds the result.
        wanted: What to draw; what scene and plan ask for if None.

    Returns:
        Names of the files that were drawn, and what could not be drawn, a line each: no fault of a
        painter and no full disk is raised.
    """
    faults, wanted, names = Faults(), wanted or _planned(result), list[str]()
    if not (wanted.pictures or wanted.film or wanted.report):
        return [], []
    try:
        with replaced(folder) as stage:
            made = faults.guarded("all pictures", lambda: _draw(result, stage, faults, wanted))
            write_summary(_noted(result.summary, faults.lines), stage)
            names = made or []
    except OutputError as error:
        faults.lines.append(f"not drawn: {error}, then draw with: impactfem plot {folder}")
    return names, faults.lines


def _planned(result: "Result") -> "Output":
    """What the scene asks for, with a film if its plan says so."""
    return replace(result.scene.output, film=result.summary["plan"].get("film", True))


def _draw(result: "Result", stage: Path, faults: Faults, wanted: "Output") -> list[str]:
    from impactfem.report.page.page import write_report  # noqa: PLC0415  (may itself be broken)

    return [path.name for path in write_report(result, stage, faults, wanted)]


def _noted(summary: Mapping[str, Any], lines: Sequence[str]) -> dict[str, Any]:
    """A summary whose verdict notes what could not be drawn this time."""
    verdict = summary.get("verdict", {"level": "trust", "findings": []})
    others = [finding for finding in verdict["findings"] if finding["code"] != "drawing"]
    remedy = "draw it again with: impactfem plot"
    notes = [Finding("drawing", "note", line, remedy=remedy).as_dict() for line in lines]
    return {**summary, "verdict": verdict | {"findings": [*others, *notes]}}
