"""Numbers with units, vectors and formulas as the report prints them."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from impactfem import findings
from impactfem.report.prefixes import prefixed_unit
from impactfem.scene.formula import Formula

NOT_FINITE = "not finite"


def number(value: float | None, digits: int = 6) -> str:
    """A number with few digits; None stands for one that is not finite."""
    return NOT_FINITE if value is None else f"{value:.{digits}g}"


def plain_quantity(value: float | None, unit: str, digits: int = 6) -> str:
    """A number in SI units; "1" stands for none."""
    return f"{number(value, digits)} {unit}" if unit not in {"", "1"} else number(value, digits)


def quantity(value: float | None, unit: str, digits: int = 6) -> str:
    """A number with its unit of SI, which gets the prefix that suits it; "1" stands for none."""
    if value is None:
        return plain_quantity(value, unit)
    shown = prefixed_unit(unit, value)
    return plain_quantity(shown.factor * value, shown.unit, digits)


def listed(values: Iterable[float], unit: str = "", between: str = ", ") -> str:
    """Numbers of one unit, which gets the prefix that suits the largest."""
    given = [float(value) for value in values]
    shown = prefixed_unit(unit, given)
    return f"{between.join(number(shown.factor * value) for value in given)} {shown.unit}".strip()


def largest(
    contact: Mapping[str, Any],
    name: str,
    unit: str,
    digits: int = 6,
    told: Callable[[float | None, str, int], str] = quantity,
) -> str:
    """Largest force or impulse of a summary's contact; says if there is none, or none is known."""
    if contact[name] is None and "unknown" in contact:
        return "not known" if name in contact["unknown"] else "none"
    return told(contact[name], unit, digits)


def percent(share: float | None) -> str:
    """A share as a percentage; tiny ones as they are, huge ones as a multiple."""
    return NOT_FINITE if share is None else findings.percent(share)


def vector(values: Iterable[float], unit: str = "") -> str:
    """Components in brackets, with a unit; a single one as a number."""
    given = [float(value) for value in values]
    shown = prefixed_unit(unit, given)
    return _bracketed([number(shown.factor * value) for value in given], shown.unit)


def formulas(entries: Sequence[Formula | None], unit: str = "") -> str:
    """Formulas as they were given, in brackets; a direction left out is free."""
    texts = ["free" if entry is None else formula(entry) for entry in entries]
    return _bracketed(texts, unit)


def _bracketed(texts: Sequence[str], unit: str) -> str:
    shown = texts[0] if len(texts) == 1 else f"({', '.join(texts)})"
    return f"{shown} {unit}".strip()


def goings(obstacle: Any) -> str:
    """How an obstacle moves and turns, after its name; empty of one at rest."""
    parts = []
    if obstacle.motion is not None:
        parts.append(f"moves by {formulas(obstacle.motion, 'm')}")
    if (turning := obstacle.rotation) is not None:
        along = "" if turning.axis is None else f" along {vector(turning.axis)}"
        about = f"{vector(turning.point, 'm')}{along}"
        parts.append(f"turns by {formulas([turning.angle], 'rad')} about {about}")
    return " and ".join(parts)


def formula(entry: Formula, unit: str = "") -> str:
    """A formula as it was given, with a unit; a plain number is shortened."""
    plain = entry.plain
    return quantity(plain, unit) if isinstance(plain, float) else f"{plain} {unit}".strip()


def constant(entry: Formula) -> float | None:
    """Value of a formula that is just a number; None of others."""
    plain = entry.plain
    return plain if isinstance(plain, float) else None


def is_zero(entries: Sequence[Formula]) -> bool:
    """Whether all formulas are the number 0."""
    return all(constant(entry) == 0.0 for entry in entries)


def counted(count: int, noun: str) -> str:
    """A number with its noun: 1 step, 2 steps."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def round_below(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that is not above a number from 1 on."""
    decade = 10.0 ** math.floor(math.log10(value))
    return max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= value)


def span(seconds: float) -> str:
    """A time with a handy unit."""
    return quantity(seconds, "s", 3) if seconds < 1000.0 else f"{seconds:.0f} s"
