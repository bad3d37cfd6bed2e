"""The verdict of a run in words: its headline, what was found, and what holds."""

from collections.abc import Iterator, Mapping
from typing import Any

from impactfem.report.page.numbers import percent
from impactfem.report.panel import is_exact
from impactfem.report.table import beyond_model, sentence

HEADLINES = {
    "trust": "Trust this run",
    "care": "Trust this run with care",
    "do_not_trust": "Do not trust this run",
}

_KNOWN = 0.05  # share of a loss of energy that may be due to something else


def headline(summary: Mapping[str, Any]) -> str:
    """The verdict in a few words."""
    return HEADLINES[summary["verdict"]["level"]]


def reasons(summary: Mapping[str, Any]) -> list[str]:
    """Why, the worst first; then what holds."""
    found = summary["verdict"]["findings"]
    told = [_sentence(finding) for finding in found]
    codes = {finding["code"] for finding in found if finding["severity"] != "note"}
    return [*told, *_holds(summary, codes)]


def _sentence(finding: Mapping[str, Any]) -> str:
    text = sentence(finding)
    return f"{text[:1].upper()}{text[1:]}."


def _holds(summary: Mapping[str, Any], codes: set[str]) -> Iterator[str]:
    """What speaks for the run."""
    if not codes & {"not_converged", "not_finite"}:
        yield "It completed, and the contact conditions were solved in every step."
    energy, error = summary["energy"], summary["error"]
    if energy["driven"]:
        yield "Loads or moving obstacles do work, so the energy is no check here."
    elif "energy_growth" not in codes and energy["final_relative_drift"] is not None:
        lost = energy["final_relative_drift"]
        gone = f"; {percent(-lost)} of it is gone at the end" if lost < -1e-6 else ""
        if gone and energy.get("taken") and abs(energy["unexplained"]) < _KNOWN * -lost:
            gone += f", taken by {' and '.join(energy['taken'])}"
        yield f"Energy never grows{gone}."
    if is_exact(summary):
        yield "It is the exact solution, to rounding."
    elif error is not None and "error_large" not in codes:
        how = "Measured error" if error["measured"] else "Estimated error"
        text = f"{how}: displacement {percent(error['displacement_max'])}, "
        text += f"force {percent(error['force_l1'])}"
        yield f"{text}."
    if error is not None and (told := beyond_model(summary)):
        yield f"The error is that of elements and steps{told}."
