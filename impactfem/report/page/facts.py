"""Facts of a run, section by section: model, error, checks, contact, cost, versions, files."""

from collections.abc import Mapping, Sequence
from typing import Any

from impactfem.methods import METHODS
from impactfem.report.page.checks import checks
from impactfem.report.page.elements import (
    bullets,
    code,
    link,
    paragraph,
    section,
    spoken,
    table,
    terms,
)
from impactfem.report.page.numbers import counted, largest, number, percent, quantity, span
from impactfem.report.page.omissions import omissions
from impactfem.report.panel import is_exact
from impactfem.result import Record
from impactfem.result.record import FIELD_FILES, IMPACTS

_MOST = 12  # contact intervals that are listed


def model(result: Record) -> str:
    """What was modelled, how, and what was left out, with the reasons of the plan."""
    plan = result.summary["plan"]
    method = result.summary["method"]
    known = METHODS.get(method)
    reasons = {k: v for k, v in plan["reasons"].items() if not k.startswith("offer")}
    offers = [v for k, v in plan["reasons"].items() if k.startswith("offer")]
    rows = [("Model", plan["model"]), ("Method", f"{method}: {known.text}" if known else method)]
    foreseen = [finding["text"] for finding in plan["findings"]]
    heading = "<h3>{}</h3>".format
    return section(
        "model",
        "What was modelled, and why",
        terms(rows),
        heading("Choices and their reasons"),
        terms((spoken(name).replace("_", " "), reason) for name, reason in reasons.items()),
        heading("Left out"),
        bullets(omissions(result.scene)),
        heading("Cheaper models of the same motion") + bullets(offers) if offers else "",
        heading("Foreseen by the plan") + bullets(foreseen) if foreseen else "",
    )


def error(result: Record) -> str:
    """The error with its reference, and what the figures mean."""
    found, note = result.summary["error"], _note(result)
    if found is None:
        why = "This is the exact solution: its error is rounding."
        if not is_exact(result.summary):
            why = "No error was measured: there is neither an exact solution nor a second run."
            reason = result.summary["plan"]["reasons"].get("estimate")
            why += f" {reason[:1].upper()}{reason[1:]}." if reason else ""
        why += f" {note}." if note else ""
        return section("error", "Error", paragraph(why))
    exact = found["measured"]
    how = "measured against the" if exact else "estimated:"
    lines = [paragraph(f"Relative errors, {how} {found['reference']}.")]
    if note and note not in found["reference"]:
        lines.append(paragraph(f"{note[:1].upper()}{note[1:]}."))
    rows = [
        ("Displacement, largest", percent(found["displacement_max"]),
         "largest difference at any time and place, over the largest displacement"),
        ("Displacement, mean", percent(found["displacement_l2"]),
         "root of the mean square of the difference, over that of the displacement"),
        ("Contact force, mean", percent(found["force_l1"]),
         "mean of the absolute difference (of impulses, where these are compared), over the force"),
    ]  # fmt: skip
    rows += [
        (f"Probe {name}", "not known" if value is None else percent(value),
         "root of the mean square of the difference, over that of the value (of a velocity: of how "
         "far it leaves its mean)" if value is not None else "further runs do not come near it")
        for name, value in found["probes"].items()
    ]  # fmt: skip
    lines.append(table(rows, ("figure", "value", "meaning")))
    lines.append(paragraph(_limits(exact=exact)))
    return section("error", "Error", *lines)


def _note(result: Record) -> str:
    """What the method says of its estimate: a text, or a message with what the second run took."""
    note = result.summary["details"].get("error_estimate", "")
    if isinstance(note, str):
        return note
    took = f", which took {span(note['seconds'])}" if "seconds" in note else ""
    return f"{note['message']}{took}"


def _limits(*, exact: bool) -> str:
    if exact:
        return (
            "This is the error of the computation against the exact solution of the same model. "
            "What the model leaves out, above, is not in it."
        )
    return (
        "This is an estimate from other runs: the true error may be twice as large, or a tenth. "
        "Small shifts of an impact in time show as large differences of the force; judge long runs "
        "by their first contacts. What the model leaves out, above, is not in it."
    )


def obeyed(result: Record) -> str:
    """Checks that every run must pass."""
    rows = [(check.name, check.answer, check.found) for check in checks(result)]
    return section("checks", "Checks", table(rows, ("what must hold", "holds", "found")))


def contact(result: Record) -> str:
    """Contact intervals and figures, of pairs too."""
    found = result.summary["contact"]
    rows = [
        ("Largest force", largest(found, "max_force", "N")),
        *_raw_force(found),
        ("Impulse", quantity(found["impulse"], "N s")),
        ("Largest penetration", quantity(found["max_penetration"], "m", 3)),
    ]
    if "max_impulse" in found:
        rows[0] = ("Largest force of lasting contact", rows[0][1])
        rows.insert(1, ("Largest impulse of an impact", largest(found, "max_impulse", "N s")))
    details = result.summary["details"]
    if "impacts" in details:
        rows.append(("Impacts", str(details["impacts"])))
    if episode := details.get("episode"):
        rows.append(("Apparent restitution", number(episode["restitution"], 4)))
        rows.append(("Micro-impacts", str(episode["micro_impacts"])))
        rows.append(("Energy left in vibrations", percent(episode["vibration"])))
    parts = [table(rows), _intervals(found["intervals"], "contact")]
    for pair in found.get("pairs", ()):
        names = " and ".join(pair["between"])
        parts.append(f"{paragraph(names, 'pair')}{_intervals(pair['intervals'], 'contact')}")
    if not found["intervals"]:
        parts.append(paragraph("There was no contact."))
    return section("contact", "Contact", *parts)


def _raw_force(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the largest force is a mean over, and the largest of a single step."""
    if not found.get("force_window") or found["max_force"] is None:
        return []
    return [
        ("It is the mean over", quantity(found["force_window"], "s", 3)),
        ("Largest force of one step", quantity(found["max_force_raw"], "N")),
    ]


def _intervals(intervals: Sequence[Sequence[float]], name: str) -> str:
    rows = [
        (f"{name} {k}", quantity(a, "s"), quantity(b, "s"), span(b - a) if b > a else "an instant")
        for k, (a, b) in enumerate(intervals[:_MOST], start=1)
    ]
    more = len(intervals) - _MOST
    rest = paragraph(f"{more} more are listed in summary.json.") if more > 0 else ""
    return table(rows, ("", "from", "to", "lasting")) + rest


def cost(result: Record) -> str:
    """What the run took, beside what was planned."""
    summary = result.summary
    plan = summary["plan"]
    seconds, memory = plan.get("seconds"), plan.get("memory_mib")
    steps = plan.get("layers") or plan.get("steps") or ""
    rows = [
        ("Time", span(summary["wall_time"]), "" if seconds is None else f"about {span(seconds)}"),
        (
            "Memory",
            f"{summary['peak_memory_mib']:.0f} MiB",
            "" if memory is None else f"about {memory:.0f} MiB" if memory > 1 else "little",
        ),
        ("Unknowns", str(summary["num_dofs"]), str(plan.get("unknowns") or "")),
        ("Steps in time", str(summary["num_steps"]), str(steps)),
        ("MPI ranks", str(summary["ranks"]), ""),
        ("Contact iterations", str(summary["active_set"]["iterations"]), ""),
    ]
    if compiling := summary.get("compile_time"):
        rows.insert(1, ("Compilation of code, this once", span(compiling), ""))
    if dt := summary["details"].get("dt", plan.get("dt")):
        rows.insert(-2, ("Length of a step", span(dt), ""))
    return section(
        "cost",
        "Cost",
        table(rows, ("", "taken", "planned")),
        paragraph("Time is that of the solution, without pictures and this page; memory is the "
                  "peak of all processes together, Python and its libraries included."),
    )  # fmt: skip


def origin(result: Record) -> str:
    """Command, date, machine and versions."""
    run: dict[str, Any] = result.summary.get("run") or {}
    if not run:
        lost = "This result was written by a version that did not note where it came from."
        return section("origin", "How to repeat it", paragraph(lost))
    machine = run["machine"]
    rows = [("Date", run["date"]), ("System", machine["system"])]
    rows.append(("Processor", f"{machine['processor']}, {counted(machine['cores'], 'core')}"))
    rows += list(run["versions"].items())
    return section(
        "origin",
        "How to repeat it",
        paragraph("The command of this run:"),
        code(run["command"]),
        paragraph("The scene as used, with every default and choice filled in, lies beside this "
                  "page; it repeats the run without the original file:"),
        code("impactfem run scene.toml"),
        table(rows),
        paragraph("Only libraries that the run has used are named."),
    )  # fmt: skip


def files(result: Record, pictures: Sequence[str], faults: Sequence[str]) -> str:
    """The files of the folder, as links.

    Args:
        result: Whose files.
        pictures: Names of the pictures that were written beside the page.
        faults: What could not be drawn, a line each.
    """
    kept = [("scene.toml", "the scene as used"), ("summary.json", "all figures of this page")]
    kept += [("history.csv", "one row per step"), ("history.nc", "the same for xarray, with units")]
    if result.exact_rows is not None:
        kept.append(("exact.nc", "the exact gap and contact force"))
    if result.impacts is not None:
        kept.append((IMPACTS, "impacts one by one"))
    if result.fields is not None:
        formats = result.scene.output.fields
        kept += [(FIELD_FILES[name], "fields, for ParaView and pyvista") for name in formats]
    kept += [(name, "film" if name.endswith(".gif") else "picture") for name in pictures]
    entries = "".join(f"<li>{link(name)}: {words}</li>" for name, words in kept)
    return section("files", "Files of this folder", f"<ul>{entries}</ul>", bullets(faults))
