"""A short film of a motion, of any body, with a curve beside it."""

from pathlib import Path

from matplotlib.animation import FuncAnimation

from impactfem.errors import OutputError
from impactfem.report.axis_film import axis_reel, moves_little
from impactfem.report.body_film import body_reel
from impactfem.report.film import Film, Reel, check_ending, write_film
from impactfem.report.line_film import line_reel
from impactfem.result import Record


def animate(
    result: Record, path: str | Path | None = None, frames: int | None = None
) -> Path | FuncAnimation:
    """Film a motion; see `Result.animate`."""
    if path is not None:
        check_ending(Path(path))
    reel = _reel(result, frames, "" if path is None else f"{path}: ")
    return Film(reel, result) if path is None else write_film(reel, Path(path))


def film_if_any(result: Record, path: Path) -> Path | None:
    """Write a film if there is something to film."""
    try:
        reel = _reel(result, None, "")
    except OutputError:
        return None
    return write_film(reel, path)


def _reel(result: Record, frames: int | None, what: str) -> Reel:
    fields = result.fields
    if fields is None:
        raise OutputError(f'{what}no fields to show; run it again with output.fields = ["vtkhdf"]')
    reel: Reel | None
    if result.scene.dim == 1:
        reel = line_reel(result, fields, frames)
    elif moves_little(result, fields):
        reel = axis_reel(result, fields, frames)
    else:
        reel = body_reel(result, fields, frames)
    if reel is None:
        raise OutputError(f"{what}nothing to film: no frame is finite")
    return reel
