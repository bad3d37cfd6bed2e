"""Plans and summaries as text tables for a terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from impactfem.planning import Plan


def table(rows: Sequence[tuple[str, str]], title: str = "") -> str:
    """Two aligned columns under an optional title; long texts are wrapped by the terminal."""
    width = max((len(name) for name, _ in rows), default=0)
    lines = [f"{name:<{width}}  {value}" for name, value in rows]
    return "\n".join(([title, "-" * len(title)] if title else []) + lines)


def plan_table(plan: Plan) -> str:
    """The plan with its reasons."""
    rows = [("model", plan.model), ("method", plan.method)]
    for name in ("elements", "layers"):
        value = getattr(plan, name)
        rows.append((name, "from the mesh file" if value is None else str(value)))
    if plan.dt is not None and plan.courant is not None:
        rows.append(("dt", f"{plan.dt:g} s (courant {plan.courant:g})"))
    if plan.degree is not None:
        rows.append(
            ("mesh", f"P{plan.degree}, {'fitted to' if plan.fitted else 'not fitted to'} events")
        )
    if plan.method != "exact":
        numbers = f"gamma {plan.gamma:g}, tolerance {plan.tolerance:g}"
        limit = f"at most {plan.max_iterations} iterations"
        rows += [
            ("window", str(plan.window)),
            ("active set", f"{plan.active_set}, {numbers}, {limit}"),
        ]
        if plan.unknowns is not None:
            rows.append(("unknowns", f"{plan.unknowns} ({plan.contact_pairs} contact pairs)"))
    if plan.memory_mib is not None and plan.seconds is not None:
        rows += [
            ("memory", f"about {plan.memory_mib:.0f} MiB"),
            ("time", f"about {plan.seconds:.2g} s on two cores"),
        ]
    rows += [(f"why {key}", reason) for key, reason in plan.reasons.items()]
    rows += [("warning", warning) for warning in plan.warnings]
    return table(rows, "Plan")


def summary_table(summary: Mapping[str, Any]) -> str:
    """The figures of a run."""
    active, energy, contact = summary["active_set"], summary["energy"], summary["contact"]
    sets = f"{active['iterations']} iterations, changes {_changes(active['set_changes'])}"
    force = (
        f"max {_number(contact['max_force'])} N, impulse {_number(contact['impulse'])} N s, "
        f"max penetration {_number(contact['max_penetration'])} m"
    )
    energies = (
        f"{_number(energy['initial'])} J -> {_number(energy['final'])} J, "
        f"largest relative drift {_number(energy['max_relative_drift'])}"
    )
    if energy["grows"]:
        energies += f"; IT GROWS by {_number(energy['max_relative_growth'])}: do not trust this run"
    ranks = f"{summary['ranks']} rank{'s' if summary['ranks'] != 1 else ''}"
    rows = [
        ("status", summary["status"]),
        ("method", summary["method"]),
        ("unknowns", f"{summary['num_dofs']} in {summary['num_steps']} layers"),
        ("active set", f"{sets} ({active['message']})"),
        ("contact", _intervals(contact["intervals"])),
        ("force", force),
        ("energy", energies),
        ("error", _error(summary["error"])),
        ("cost", f"{summary['wall_time']:.2f} s, {summary['peak_memory_mib']:.0f} MiB on {ranks}"),
    ]
    return table(rows, summary["title"])


def _number(value: float | None) -> str:
    return "not finite" if value is None else f"{value:.6g}"


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
        return "none measured (exact or not finite)"
    return (
        f"displacement max {_number(error['displacement_max'])}, L2 "
        f"{_number(error['displacement_l2'])}, force L1 {_number(error['force_l1'])} "
        f"(relative, against the {error['reference']})"
    )
