"""Files of a motion that was found: its table, what really follows, the figures, a picture."""

import csv
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import OutputError
from impactfem.report.sheet import Sheet, write_png
from impactfem.report.table import table
from impactfem.trajectory.running import Ran
from impactfem.trajectory.scenes import Planned


def trajectory_table(planned: Planned, ran: Ran) -> str:
    """A motion for a terminal, and the run of the scene with its controls."""
    found = planned.found
    asked = "as asked" if found.problem.duration[0] == found.problem.duration[1] else "searched"
    missed = f"misses the end by {found.resimulated_end_error:.2g} (allowed {found.allowed:.2g})"
    rows = [
        ("status", found.status),
        ("cost", f"{found.cost:.9g} ({found.resimulated_cost:.9g} of what really follows)"),
        ("duration", f"{found.duration:.9g} s, {asked}"),
        ("transcription", f"{found.transcription}, intervals {_several(found.rounds)}"),
        ("defect", f"{found.defect_max:.2g} of how far a state moves, from node to node"),
        ("what follows", f"{found.resimulated_distance:.2g} away at most, {missed}"),
        ("a run of it", _run_in_words(ran)),
        *([("contacts", _phases(found.more))] if "modes" in found.more else []),
        ("optimality", f"{found.kkt_residual:.2g}"),
        ("cost of it", f"{found.iterations} iterations, {found.seconds:.3g} s"),
    ]  # fmt: skip
    doubts = *found.doubts, *ran.doubts(found.allowed)
    return table([*rows, *(("doubt", each) for each in doubts), *_notes(planned, ran)])


def _phases(more: Mapping[str, Any]) -> str:
    """Contacts in their order, with how long they last."""
    both = zip(more["modes"], more["lasts"], strict=True)
    return " > ".join(f"{name} {time:.4g} s" if time else name for name, time in both)


def _run_in_words(ran: Ran) -> str:
    if ran.result is None:
        return f"none: {ran.why}"
    by = ran.method if not ran.dt else f"{ran.method}, steps of {ran.dt:.3g} s"
    unsure = f", of which steps may make {ran.unsure:.1g}" if ran.unsure > 0.0 else ""
    return f"{by}: {ran.distance:.2g} away at most{unsure}, misses the end by {ran.end_error:.2g}"


def _notes(planned: Planned, ran: Ran) -> list[tuple[str, str]]:
    found = [
        ("note", f"the run meets {name} at t = {time:.4g} s")
        for name, time in (ran.touched or {}).items()
    ]
    if planned.found.status == "converged" and " " in planned.found.message:  # not Ipopt's word
        found.append(("note", planned.found.message))
    if planned.rests:
        told = ", ".join(planned.rests)
        found.append(("note", f'ends at rest, since nothing else is said: {told}; or say "free"'))
    if planned.unseen:
        told = ", ".join(planned.unseen)
        found.append(("note", f"contact of {told} is no part of this motion: run the scene"))
    return found


def _several(rounds: tuple[int, ...]) -> str:
    return ", then ".join(map(str, rounds))


def write_trajectory(planned: Planned, ran: Ran, folder: Path, run: Mapping[str, Any]) -> None:
    """Write trajectory.csv, followed.csv, resimulated/, summary.json and trajectory.png.

    Args:
        planned: What was found.
        ran: The run of the scene with its controls; without one what follows stands for it.
        folder: Where.
        run: Date, versions, machine and command.

    Raises:
        OutputError: They cannot be written.
    """
    found = planned.found
    summary = found.summary | {
        "ends_at_rest": list(planned.rests), "unseen_contacts": list(planned.unseen),
        "doubts": [*found.doubts, *ran.doubts(found.allowed)], "resimulated_by": found.follower,
        "run": dict(run),
        "followed_distance": found.resimulated_distance,
        "followed_end_error": found.resimulated_end_error,
    } | ran.summary  # fmt: skip
    fine = followed_table(planned)
    texts = {
        "trajectory.csv": _csv(planned.table(found.times, found.at_nodes)),
        "followed.csv": _csv(fine),
        "summary.json": json.dumps(_finite(summary), indent=1) + "\n",
        "scene.toml": planned.scene.to_toml(folder=folder),
    }
    if ran.result is None:
        texts["resimulated/history.csv"] = texts["followed.csv"]
    else:
        ran.result.write_data(folder / "resimulated")
    try:
        for name, text in texts.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        write_png(trajectory_picture(planned, fine), folder / "trajectory.png")
    except OSError as error:
        why = f"{folder}: cannot be written ({error.strerror}); choose another folder (--out)"
        raise OutputError(why) from None


def followed_table(planned: Planned) -> dict[str, Floats]:
    """What really follows, at places between nodes too."""
    return planned.table(*planned.fine)


def trajectory_picture(planned: Planned, fine: Mapping[str, Floats]) -> Any:
    """Coordinates and controls over time: nodes as dots, what follows as lines."""
    found = planned.found
    count = len(found.problem.states) // 2
    sheet = Sheet(7.0, 5.5)
    for part, names in ((0, list(found.states)[:count]), (1, list(found.controls))):
        axes = sheet.add_subplot(2, 1, 1 + part)
        nodes = found.states | found.controls
        for name in names:
            (line,) = axes.plot(fine["time"], fine[name], label=name)
            axes.plot(found.times, nodes[name], ".", color=line.get_color())
        axes.legend()
        axes.set_xlabel("t [s]")
    return sheet


def _csv(columns: Mapping[str, Floats]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(
        [[repr(float(value)) for value in row] for row in zip(*columns.values(), strict=True)]
    )
    return out.getvalue()


def _finite(value: Any) -> Any:
    """As JSON has it: no infinite numbers."""
    if isinstance(value, Mapping):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
