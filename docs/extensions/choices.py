"""Decision tables of methods, each with the figures of stored studies that speak for the choice."""

import re
from collections.abc import Iterable, Sequence

from md_tables import code, table
from stored import measured, rows, stamp, text

type Row = dict[str, str]

NAMES = {
    "event driven": "event_driven", "position level": "paoli_schatzman",
    "velocity level": "moreau_jean", "penalty": "stiff springs",
    "scipy events": "a loop around SciPy",
}  # fmt: skip


def of(study: str, method: str, **where: str) -> list[Row]:
    """Rows of one method of a study; a method that is not there is an error, not a gap."""
    found = [r for r in rows(study) if r["method"] == method and where.items() <= r.items()]
    if not found:
        raise KeyError(f"{study}: no row of {method}")
    return found


def least(found: Iterable[Row], key: str) -> Row:
    """The row with the least error."""
    return min((row for row in found if row[key]), key=lambda row: float(row[key]))


def fastest(found: Iterable[Row], key: str, limit: float, seconds: str) -> Row | None:
    """The fastest row with at most this error."""
    good = [row for row in found if row[key] and float(row[key]) <= limit]
    return min(good, key=lambda row: float(row[seconds])) if good else None


def span(seconds: float) -> str:
    """A time in ms below a second."""
    value, unit = (1e3 * seconds, "ms") if seconds < 1.0 else (seconds, "s")
    digits = -1 if value > 100.0 else 0
    return f"{value:.2g} {unit}" if value < 10.0 else f"{round(value, digits):.0f} {unit}"


def bar_error(study: str, method: str) -> str:
    """Least displacement error of a method in a study of bars, with elements and time."""
    row = least(of(study, method), "displacement_max")
    error, elements = float(row["displacement_max"]), row["elements"]
    if error > 0.5:
        return f"{code(method)}: motion lost"
    return f"{code(method)}: {error:.0e} ({elements} elements, {span(float(row['seconds']))})"


def bar_energy(study: str, method: str) -> str:
    """Largest change of energy of a method over all sizes of a study."""
    worst = max(float(row["drift"]) for row in of(study, method))
    return f"{code(method)}: energy to {worst:.0e}"


def bars() -> str:
    """Homogeneous bars against a wall."""
    fitted = "dg@degree=1,fitted=true"
    one, few, many, none, strain = (
        "doyen_bounces", "k1_off_grid", "doyen_750_bounces", "irregular_bounces",
        "prestretched_rod",
    )  # fmt: skip
    kept = ("conserving", "conserving@courant=0.5", "galerkin", "NumPy leapfrog")
    lines = [
        (
            "impacts and releases fall on time levels (`doyen_bounces`)",
            "`galerkin`, courant 1",
            [bar_error(one, method) for method in ("galerkin", "conserving", "monolithic")],
        ),
        (
            "few contacts between time levels (`bar_impact_between`)",
            "`dg` with `fitted = true`; `galerkin` where 1e-2 will do",
            [bar_error(few, method) for method in (fitted, "galerkin", "conserving")],
        ),
        (
            "contacts without pattern (`irregular_bounces`)",
            "`exact`, or `dg` with `fitted = true`",
            [bar_error(none, method) for method in ("exact", fitted, "galerkin")],
        ),
        (
            "initial strain, contacts on time levels (`prestretched_rod`)",
            "`galerkin`, courant 1",
            [bar_error(strain, method) for method in ("galerkin", fitted, "conserving")],
        ),
        (
            "hundreds of bounces: motion",
            "`exact`",
            [bar_error(many, method) for method in ("exact", "galerkin", "conserving")],
        ),
        (
            "hundreds of bounces: energy; any courant number",
            "`conserving`",
            [bar_energy(many, method) for method in kept],
        ),
    ]
    return decided(lines, (one, few, many, none, strain))


def solid_error(key: str, limit: float, methods: Sequence[str]) -> list[str]:
    """Time of the fastest run of each method with at most this error."""
    found = []
    for method in methods:
        row = fastest(of("disc", method), key, limit, "total")
        reached = f"{span(float(row['total']))}, n = {row['elements']}" if row else "not reached"
        found.append(f"{code(method) if 'SciPy' not in method else method}: {reached}")
    return found


def solid_energy(methods: Sequence[str]) -> list[str]:
    """Largest change of energy of each method over all sizes."""
    changes = [max(float(row["drift"]) for row in of("disc", method)) for method in methods]
    return [f"{code(m)}: {change:.0e}" for m, change in zip(methods, changes, strict=True)]


def solids() -> str:
    """A solid and rigid obstacles."""
    motion, force = "displacement_max", "force_l1"
    implicit = ("massless", "conserving", "moreau_jean")
    quadratic = ("conserving@degree=2", "conserving", "massless")
    lines = [
        (
            "a short impact, elements of one size: motion to 1e-3",
            "`explicit`",
            solid_error(motion, 1e-3, ("explicit", *implicit, "SciPy loop, courant 0.5")),
        ),
        (
            "the mean force in a hundredth of a transit to 1e-2",
            "`explicit`; `moreau_jean` if its impulses and penetration do no harm",
            solid_error(force, 1e-2, ("explicit", *implicit)),
        ),
        (
            "bending, nearly incompressible, few small elements among large; here motion to 1e-3",
            "`conserving` or `massless`, `degree = 2`",
            solid_error(motion, 1e-3, quadratic),
        ),
        (
            "many bounces: energy",
            "`conserving` at any step, `explicit`",
            solid_energy(("conserving", "explicit", "massless", "moreau_jean", "newmark")),
        ),
    ]
    return decided(lines, ("disc",))


def bodies() -> str:
    """Solids that strike each other: what a step costs."""
    found = [
        [cell.strip() for cell in line.strip("|\n ").split("|")]
        for line in text("bodies").splitlines()
        if re.match(r"\| (explicit|massless) \|", line)
    ]
    head = ["unknowns", "`explicit`, fixed pairs", "updated", "`massless`, fixed pairs", "updated"]
    sizes = dict.fromkeys(row[1] for row in found)
    cells = {(row[0], row[1]): (row[4], row[5]) for row in found}
    lines = [
        [size, *(f"{ms} ms" for m in ("explicit", "massless") for ms in cells[m, size])]
        for size in sizes
    ]
    return table(head, lines) + f"\n*Time of a step. {measured(stamp('bodies'))}*\n"


def points() -> str:
    """Points, rods and beams."""
    problems = ("oscillator", "bouncing ball")
    asked = ("least error", "time to 1e-3")
    head = ["method", *(f"{problem}: {what}" for problem in problems for what in asked)]
    lines = []
    for method, name in NAMES.items():
        line = [name if " " in name else code(name)]
        for problem in problems:
            found = of("vibro_work_precision", method, problem=problem)
            quick = fastest(found, "error", 1e-3, "seconds")
            line += [
                f"{float(least(found, 'error')['error']):.0e}",
                span(float(quick["seconds"])) if quick else "not reached",
            ]
        lines.append(line)
    return table(head, lines) + f"\n*{measured(stamp('vibro_work_precision'))}*\n"


def decided(lines: Sequence[tuple[str, str, Sequence[str]]], studies: Sequence[str]) -> str:
    """A decision table: the case, what to take, the figures, where they are from."""
    cells = [(case, choice, "; ".join(figures)) for case, choice, figures in lines]
    sentences = sorted({measured(stamp(study)) for study in studies})
    return table(["what you have", "take", "figures"], cells) + f"\n*{' '.join(sentences)}*\n"


PARTS = {f"choose_{make.__name__}": make for make in (bars, solids, bodies, points)}
