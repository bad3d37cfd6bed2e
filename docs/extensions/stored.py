"""Stored results of the benchmarks as parts of pages: each with date, machine and versions."""

import csv
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gallery_runs import ROOT
from md_tables import table

RESULTS = ROOT / "benchmarks" / "results"
# The sentence that studies end with; the stamp says the same and more.
MEASURED = re.compile(r" ?Measured on \d{4}-\d\d-\d\d on \d+ cores with .*?\.(?= |\n|$)")
EXPONENT = re.compile(r"(?<![\w.])-?\d[\d.]*e[+-]?\d+\b")
NAMES = {"python": "Python", "dolfinx": "DOLFINx", "numpy": "NumPy", "numba": "Numba"}


def rows(name: str) -> list[dict[str, str]]:
    """The rows of a stored CSV file."""
    with (RESULTS / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def text(name: str) -> str:
    """A stored Markdown file."""
    return (RESULTS / f"{name}.md").read_text(encoding="utf-8")


def stamp(name: str) -> dict[str, Any]:
    """Where, when and with what a result was measured.

    Raises:
        FileNotFoundError: The result has no stamp; `python benchmarks/stamp.py NAME` writes it.
    """
    read: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    return read


def measured(facts: Mapping[str, Any]) -> str:
    """A stamp as a sentence."""
    words = [f"on {facts['date']}", f"{facts['cores']} cores of {facts['cpu']}"]
    if "load_before" in facts:
        words.append(f"load before {facts['load_before']:g}")
    words.append(f"impactfem {facts['impactfem']}")
    words += [f"{name} {facts[key]}" for key, name in NAMES.items() if key in facts]
    note = f"; {facts['note']}" if "note" in facts else ""
    return f"Measured {', '.join(words)}{note}."


def unbroken(table_text: str) -> str:
    """Tables whose numbers browsers do not break at the sign of an exponent."""
    lines = table_text.splitlines()
    marked = (EXPONENT.sub(r'<span class="number">\g<0></span>', line) for line in lines)
    return "\n".join(
        new if line.startswith("|") else line for line, new in zip(lines, marked, strict=True)
    )


def part(name: str) -> str:
    """A stored table with its stamp."""
    kept = re.sub(r"\A# .*\n+", "", MEASURED.sub("", text(name)))
    return f"{unbroken(kept.strip())}\n\n*{measured(stamp(name))}*\n"


def vibrating_table() -> dict[str, str]:
    """The tables of the page on the vibrating table."""
    found = {row["quantity"]: row for row in rows("vibrating_table")}

    def value(quantity: str, column: str = "measured") -> float:
        return float(found[quantity][column])

    sentence = f"\n*{measured(stamp('vibrating_table'))}*\n"
    error = value("its standard error")
    tangent = value("exponent per impact at 4.51, tangent map")
    exponents = [("4.51, tangent map", f"{tangent:.4f} ± {error:.4f}")]
    exponents += [("4.51, two neighbouring orbits", f"{value('exponent from two orbits'):.4f}")]
    for name, row in found.items():
        case = re.fullmatch(r"exponent per impact at (\S+), (first \d+ impacts)", name)
        if case:
            exponents.append((f"{case[1]}, the {case[2]}", f"{float(row['measured']):.2f}"))
    distances = []
    for name, row in found.items():
        case = re.fullmatch(r"distance of histograms at (\S+), .* with (\S+)", name)
        if case:
            apart = found[name.replace("distance of histograms", "impacts until 0.1 rad apart")]
            chance = float(row["closed form or chance"])
            distance = f"{float(row['measured']):.3f}"
            distances.append((case[1], case[2], distance, f"{chance:.3f}", apart["measured"]))
    distances.sort(key=lambda row: -float(row[0]))
    head = [r"$\gamma$", "step", "distance of the two methods", "by chance"]
    return {
        "table_exponents": table([head[0], "largest exponent per impact"], exponents) + sentence,
        "table_distances": table([*head, "impacts until 0.1 rad apart"], distances) + sentence,
    }


def parts() -> dict[str, str]:
    """The parts of all stored results, by name."""
    found = {name: part(name) for name in sorted(names())}
    overview, heading, rest = found.pop("hard_cases").partition("\n## ")
    overview = overview.replace("| FAIL ", '| <span class="fail">FAIL</span> ')
    said = f"\n\n*{measured(stamp('hard_cases'))}*\n"
    found["hard_cases_board"] = overview.rstrip() + said
    found["hard_cases_figures"] = heading.lstrip("\n") + rest
    return found | vibrating_table()


def names() -> set[str]:
    """All stored results that have a table."""
    return {Path(path).stem for path in RESULTS.glob("*.md")}
