"""A result as a card in a notebook: its figures and a small curve of the contact force."""

from impactfem.cards import card, curve
from impactfem.report.page.numbers import largest
from impactfem.report.page.verdict import headline
from impactfem.report.table import summary_rows
from impactfem.result import Record


def result_card(result: Record) -> str:
    """The figures of ``impactfem run``'s table, findings, and the contact force over time."""
    summary, history = result.summary, result.rows
    rows = [(name, text) for name, text in summary_rows(summary) if name != "verdict"]
    times, force = history["time"].values, history["contact_force"].values
    most = largest(summary["contact"], "max_force", "N", 4)
    what = "force of lasting contact" if "max_impulse" in summary["contact"] else "contact force"
    text = f"{what}, at most {most}, from {times[0]:g} to {times[-1]:g} s"
    return card(
        summary["title"],
        rows,
        badge=headline(summary),
        good=summary["verdict"]["level"] == "trust",
        parts=[curve(times, force, text)],
    )
