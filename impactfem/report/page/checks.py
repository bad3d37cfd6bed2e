"""What a run must obey whatever the scene, checked in its history and summary."""

from dataclasses import dataclass

import numpy as np

from impactfem.report.page.numbers import counted, number, percent, quantity
from impactfem.result import Record
from impactfem.runs.scales import size_of
from impactfem.runs.verdict import GROWTH_LIMITS, PENETRATION_LIMITS

_ROUNDING = 1e-9  # share of the largest value that counts as rounding
_COMPLEMENTARY = 1e-6  # share of the largest gap times the largest force that counts as none


@dataclass(frozen=True)
class Check:
    """One check.

    Attributes:
        name: What must hold.
        found: What was found.
        holds: Whether it does; None if this run cannot say.
    """

    name: str
    found: str
    holds: bool | None

    @property
    def answer(self) -> str:
        """The outcome in a word."""
        return "not applicable" if self.holds is None else "yes" if self.holds else "NO"


def checks(result: Record) -> list[Check]:
    """All checks of a run, in the order of the report."""
    return [
        _settled(result),
        _energy(result),
        _penetration(result),
        _pull(result),
        complementarity(result),
    ]


def _settled(result: Record) -> Check:
    active = result.summary["active_set"]
    changes = active["set_changes"]
    found = active["message"] or f"{counted(active['iterations'], 'iteration')} or events"
    if changes:
        shown = ", ".join(str(change) for change in changes[:8])
        more = ", ..." if len(changes) > 8 else ""
        found += f"; {counted(active['iterations'], 'iteration')}, changes {shown}{more}"
    return Check("The active set settled", found, bool(active["converged"]))


def _energy(result: Record) -> Check:
    energy, name = result.summary["energy"], "Energy does not grow"
    growth = energy["max_relative_growth"]
    if energy.get("driven"):
        return Check(name, "loads or moving obstacles do work, which is not in the history", None)
    drift = percent(energy["final_relative_drift"])
    found = f"largest relative growth {percent(growth)}, change at the end {drift}"
    return Check(name, found, growth is not None and growth <= GROWTH_LIMITS[0])


def _penetration(result: Record) -> Check:
    deep, size = result.summary["contact"]["max_penetration"], size_of(result.scene, result.rows)
    name = "Bodies do not penetrate"
    if deep is None:
        return Check(name, "not finite", holds=False)
    found = f"at most {quantity(deep, 'm', 3)}"
    if size:
        found += f", {percent(deep / size)} of the size of a body"
    return Check(name, found, deep <= PENETRATION_LIMITS[0] * size if size else deep == 0.0)


def _pull(result: Record) -> Check:
    force = result.rows["contact_force"].values
    name = "Obstacles push, never pull"
    if not np.isfinite(force).all():
        return Check(name, "the force is not finite", holds=False)
    least, most = float(force.min()), float(force.max())
    found = f"least force {quantity(least, 'N', 3)}, largest {quantity(most, 'N', 3)}"
    return Check(name, found, least >= -_ROUNDING * max(most, abs(least)))


def complementarity(result: Record) -> Check:
    """Gap or force is zero: in each step the force times the smaller gap at its two ends.

    Impacts inside a step leave both ends open, so motions with impacts cannot be judged this way.
    """
    name = "Where there is a gap there is no force"
    if "contact_impulse" in result.rows:
        return Check(name, "impulses act at instants inside steps", None)
    force, gap = result.rows["contact_force"].values[1:], result.rows["gap"].values
    scale = float(np.abs(force).max(initial=0.0) * np.abs(gap).max(initial=0.0))
    if not np.isfinite(scale):
        return Check(name, "not finite", holds=False)
    nearest = np.minimum(np.abs(gap[1:]), np.abs(gap[:-1]))
    worst = float(np.max(np.abs(force) * nearest, initial=0.0))
    share = worst / scale if scale else 0.0
    found = f"gap times force at most {number(share, 3)} of largest gap times largest force"
    return Check(name, found, share <= _COMPLEMENTARY)
