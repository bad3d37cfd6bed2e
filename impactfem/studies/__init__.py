"""Studies over many runs: errors against time, and the board of hard cases."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from impactfem.result.bar_motion import BarMotion
    from impactfem.result.compare import Comparison, compare
    from impactfem.result.spectrum import Spectrum
    from impactfem.runs.ensemble import solve_ensemble
    from impactfem.studies.hard.cases import Board, hard_cases
    from impactfem.studies.precision import Baseline, work_precision
    from impactfem.studies.study import Study
    from impactfem.studies.sweep_point import Asked
    from impactfem.studies.sweeping import Axis, Sweep, sweep

__all__ = [
    "Asked",
    "Axis",
    "BarMotion",
    "Baseline",
    "Board",
    "Comparison",
    "Spectrum",
    "Study",
    "Sweep",
    "compare",
    "hard_cases",
    "solve_ensemble",
    "sweep",
    "work_precision",
]

# Loaded when first used: hard cases and errors of solids need DOLFINx.
_HOMES = {
    "Asked": "impactfem.studies.sweep_point",
    "Axis": "impactfem.studies.sweeping",
    "BarMotion": "impactfem.result.bar_motion",
    "Baseline": "impactfem.studies.precision",
    "Board": "impactfem.studies.hard.cases",
    "Comparison": "impactfem.result.compare",
    "Spectrum": "impactfem.result.spectrum",
    "Study": "impactfem.studies.study",
    "Sweep": "impactfem.studies.sweeping",
    "compare": "impactfem.result.compare",
    "hard_cases": "impactfem.studies.hard.cases",
    "solve_ensemble": "impactfem.runs.ensemble",
    "sweep": "impactfem.studies.sweeping",
    "work_precision": "impactfem.studies.precision",
}

if not TYPE_CHECKING:  # type checkers shall tell names that do not exist

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name]), name)
