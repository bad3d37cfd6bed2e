"""Plans and summaries as text tables for a terminal."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from impactfem.report.page.elements import spoken
from impactfem.report.page.numbers import largest, number, plain_quantity

if TYPE_CHECKING:
    from impactfem.models.kinematics import Kinematics
    from impactfem.planning import Plan
    from impactfem.result.compare import Comparison

_NOTHING = 1e-15  # share of the energy at first that is rounding


def table(rows: Sequence[tuple[str, str]], title: str = "") -> str:
    """Two aligned columns under an optional title; long texts are wrapped by the terminal."""
    width = max((len(name) for name, _ in rows), default=0)
    lines = [f"{name:<{width}}  {value}" for name, value in rows]
    return "\n".join(([title, "-" * len(title)] if title else []) + lines)


def plan_table(plan: "Plan[Any]") -> str:
    """The plan with its reasons."""
    rows = [("model", plan.model), ("method", plan.method), *plan.numbers.rows(plan)]
    if plan.drawing_seconds:
        film = ", film" if plan.film else ""
        drawn = f"about {plan.drawing_seconds:.2g} s more for pictures{film} and report"
        rows.append(("drawing", f"{drawn} (output.pictures, film, report)"))
    for key, reason in plan.reasons.items():
        rows.append((key if key.startswith("offer") else f"why {spoken(key)}", reason))
    if plan.predicted_error is not None:
        rows.append(("predicted error", f"{plan.predicted_error:.2g} of the displacement"))
    rows += [(finding.severity, finding.sentence) for finding in plan.findings]
    return table(rows, "Plan")


def kinematics_table(mechanisms: "Sequence[Kinematics]") -> str:
    """Joints, frames and inverse kinematics of mechanisms at t = 0."""
    found = []
    for each in mechanisms:
        rows = [(f"joint {name}", number(value)) for name, value in each.joints.items()]
        for name, frame in each.frames.items():
            rows.append((f"frame {name}", ", ".join(map(number, frame.position.tolist())) + " m"))
        if (inverse := each.inverse) is not None:
            text = f"{inverse.method}, {inverse.iterations} iterations, {number(inverse.residual)}"
            rows.append(("inverse", f"{text} m left"))
        found.append(table(rows, each.name))
    return "\n\n".join(found)


def summary_table(summary: Mapping[str, Any]) -> str:
    """The figures of a run."""
    return table(summary_rows(summary), summary["title"])


def summary_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Names and values of the figures of a run."""
    active, energy, contact = summary["active_set"], summary["energy"], summary["contact"]
    sets = f"{active['iterations']} iterations, changes {_changes(active['set_changes'])}"
    force = f"max {largest(contact, 'max_force', 'N', told=plain_quantity)}{_window(contact)}"
    if "max_impulse" in contact:
        force = f"of lasting contact {force}; of impacts max "
        force += largest(contact, "max_impulse", "N s")
    acting = [pair for pair in contact.get("pairs") or () if pair["impulse"]]
    together = f" of {len(acting)} pairs together" if len(acting) > 1 else ""
    force += f", impulse {number(contact['impulse'])} N s{together}, "
    force += f"max penetration {number(contact['max_penetration'])} m"
    first, last = energy["initial"], energy["final"]
    if first and last and abs(last) < _NOTHING * abs(first):
        last = 0.0
    energies = f"{number(first)} J -> {number(last)} J, "
    if taken := energy.get("taken"):
        energies += ", ".join(f"{name} took {number(work)} J" for name, work in taken.items())
        energies += f", otherwise changed by {number(energy['unexplained'])} of the largest"
    else:
        energies += f"largest relative drift {number(energy['max_relative_drift'])}"
    if energy["grows"]:
        energies += f"; IT GROWS by {number(energy['max_relative_growth'])}"
    ranks = f"{summary['ranks']} rank{'s' if summary['ranks'] != 1 else ''}"
    if energy.get("driven"):
        energies += " (loads or moving obstacles do work)"
    took = f"{summary['wall_time']:.2f} s"
    if compiling := summary.get("compile_time"):
        took += f" and, this once, {compiling:.1f} s to compile code"
    rows = [
        ("status", summary["status"]),
        ("method", summary["method"]),
        ("unknowns", f"{summary['num_dofs']} in {summary['num_steps']} time steps"),
        ("active set", f"{sets} ({active['message']})"),
        ("contact", _intervals(contact["intervals"])),
        ("force", force),
        ("energy", energies),
        ("error", _error(summary["error"]) + beyond_model(summary) * bool(summary["error"])),
        ("cost", f"{took}, {summary['peak_memory_mib']:.0f} MiB on {ranks}"),
    ]
    for pair in contact.get("pairs", ()):
        text = f"{_intervals(pair['intervals'])}, max {number(pair['max_force'])} N"
        rows.insert(-3, (" and ".join(pair["between"]), text))
    if "impact_law" in summary["plan"]:
        rows[3] = ("impacts", _impacts(summary))
    if episode := summary["details"].get("episode"):
        text = f"apparent restitution {episode['restitution']:.4g}, {episode['micro_impacts']} "
        text += f"micro-impacts, {episode['vibration']:.2%} of the energy left in vibrations"
        rows.insert(4, ("rebound", text))
    found = summary["verdict"]["findings"]
    rows += [(finding["severity"], sentence(finding)) for finding in found]
    return [*rows, ("verdict", summary["verdict"]["level"].replace("_", " "))]


def beyond_model(summary: Mapping[str, Any]) -> str:
    """What to say beside an error if the model itself does not hold; empty if it does.

    Errors are those of elements and steps: the same model on a finer mesh is as far from the truth.
    """
    codes = {f["code"] for f in summary["verdict"]["findings"] if f["severity"] == "fault"}
    outside = codes & {"model_rotation", "model_strain"}
    return "; it says nothing of the model, which does not hold here" if outside else ""


def sentence(finding: Mapping[str, Any]) -> str:
    """The text of a finding with its remedy."""
    return f"{finding['text']}; {finding['remedy']}" if finding["remedy"] else finding["text"]


def comparison_table(found: "Comparison") -> str:
    """Columns of two histories that differ, the worst first, and what is in one alone."""
    rows = []
    for column in found.columns:
        if column.absolute > 0.0:
            text = f"{column.absolute:.3g} {column.unit} at {column.time:.6g} s, "
            text += f"{column.relative:.3g} of {column.scale:.4g} {column.unit}"
            rows.append((column.name, text))
    equal = len(found.columns) - len(rows)
    rows.append((f"{equal} other columns" if rows else f"all {equal} columns", "equal"))
    for names, which in ((found.only_first, "first"), (found.only_second, "second")):
        if names:
            rows.append((f"only in the {which}", ", ".join(names)))
    if found.interpolated:
        rows.append(("times", "differ: interpolated at those of the one with fewer rows"))
    if not found.same_end:
        rows.append(("end", f"differs: compared until {found.until:.6g} s"))
    return table(rows)


def _window(contact: Mapping[str, Any]) -> str:
    """Over which time the largest force is a mean, and that of a single step."""
    if not contact.get("force_window") or contact["max_force"] is None:
        return ""
    raw = f"in one step {number(contact['max_force_raw'])} N"
    return f" as a mean over {number(contact['force_window'])} s ({raw})"


def _impacts(summary: Mapping[str, Any]) -> str:
    details = summary["details"]
    text = str(details["impacts"]) if "impacts" in details else "not located one by one"
    spells = details.get("sticking", [])
    if spells:
        text += f", then lasting contact {len(spells)} times, first from {spells[0][0]:.6g} s"
    return text


def _changes(changes: Sequence[int]) -> str:
    shown = ", ".join(str(c) for c in changes[:6])
    return f"[{shown}{', ...' if len(changes) > 6 else ''}]"


def _intervals(intervals: Sequence[Sequence[float]]) -> str:
    if not intervals:
        return "none"
    shown = ", ".join(f"{a:.6g} to {b:.6g} s" for a, b in intervals[:4])
    more = f" and {len(intervals) - 4} more" if len(intervals) > 4 else ""
    return f"{shown}{more}"


def _error(error: Mapping[str, Any] | None) -> str:
    if error is None:
        return "none measured (exact, not finite, or no estimate)"
    return (
        f"displacement max {number(error['displacement_max'])}, L2 "
        f"{number(error['displacement_l2'])}, force L1 {number(error['force_l1'])} "
        f"(relative, against the {error['reference']}){_of_probes(error['probes'])}"
    )


def _of_probes(errors: Mapping[str, float | None]) -> str:
    """The largest error of what probes tell, and how many are not known."""
    known = [(value, name) for name, value in errors.items() if value is not None]
    missing = [name for name, value in errors.items() if value is None]
    found = f"; of probes {number(max(known)[0])} at most ({max(known)[1]})" if known else ""
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        found += f"; of {missing[0]}{more} none is told: further runs do not come near it"
    return found
