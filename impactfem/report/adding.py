"""What is drawn into the folder of a result, when its data are already there."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from impactfem.errors import OutputError
from impactfem.findings import Finding
from impactfem.report.faults import Faults
from impactfem.result.store import replaced, write_summary

if TYPE_CHECKING:
    from impactfem.result import Record
    from impactfem.scene import Output


def add_pictures(
    result: "Record", folder: Path, wanted: "Output | None" = None
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


def _planned(result: "Record") -> "Output":
    """What the scene asks for, with a film if its plan says so."""
    return replace(result.scene.output, film=result.summary["plan"].get("film", True))


def _draw(result: "Record", stage: Path, faults: Faults, wanted: "Output") -> list[str]:
    from impactfem.report.page.page import write_report  # noqa: PLC0415  (may itself be broken)

    return [path.name for path in write_report(result, stage, faults, wanted)]


def _noted(summary: Mapping[str, Any], lines: Sequence[str]) -> dict[str, Any]:
    """A summary whose verdict notes what could not be drawn this time."""
    verdict = summary.get("verdict", {"level": "trust", "findings": []})
    others = [finding for finding in verdict["findings"] if finding["code"] != "drawing"]
    remedy = "draw it again with: impactfem plot"
    notes = [Finding("drawing", "note", line, remedy=remedy).as_dict() for line in lines]
    return {**summary, "verdict": verdict | {"findings": [*others, *notes]}}
