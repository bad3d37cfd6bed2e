"""From a plan to a motion, its error and its figures, one runner for each entry of `RUNNERS`."""

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from impactfem.runs.run import Runner


class _Entry(NamedTuple):
    module: str
    stages: int


RUNNERS: Mapping[str, _Entry] = {
    "bar": _Entry("impactfem.runs.bars", 4),
    "bar_row": _Entry("impactfem.runs.bar_rows", 4),
    "march": _Entry("impactfem.runs.marched", 5),
    "vibro": _Entry("impactfem.runs.vibro", 4),
}
"""Module whose ``run`` solves what `Scene.solver` names, loaded when it is needed, and the stages
that a command shows, writing included."""


def runner(solver: str) -> "Runner":
    """The runner of a solver."""
    found: Runner = import_module(RUNNERS[solver].module).run
    return found
