"""Hard cases of several solids: collisions, stacks, friction."""

import numpy as np

from impactfem.errors import ConvergenceError
from impactfem.facade import Result
from impactfem.solving import solve
from impactfem.studies.hard.board import Case, Facts
from impactfem.studies.hard.rows import Row, load


def _solved(method: str, row: Row) -> Result:
    result = solve(row.scene(), method=method)
    if not result.summary["active_set"]["converged"]:
        raise ConvergenceError(result.summary["active_set"]["message"])
    return result


def _energy(result: Result) -> dict[str, float]:
    """Energy as a share of that of the motion at the start, and penetration."""
    history = result.history
    change = history["total_energy"].values - float(history["total_energy"][0])
    start = float(history["kinetic_energy"][0])
    return {
        "growth": max(0.0, float(change.max())) / start,
        "drift": float(np.abs(change).max()) / start,
        "penetration": max(0.0, -float(history["gap"].min())),
    }


def _facts(result: Result) -> dict[str, float]:
    """With the momentum along the approach."""
    momentum = result.history["momentum"].values
    change = float(np.abs(momentum - momentum[0]).max())
    return _energy(result) | {"momentum": change / abs(float(momentum[0]))}


def plain(method: str, row: Row) -> Facts:
    """Bodies collide."""
    return _facts(_solved(method, row))


def swap(method: str, row: Row) -> Facts:
    """Equal blocks with other meshes: they swap their velocities."""
    result = _solved(method, row)
    left, right = (float(result.history[f"{name}.vx"][-1]) for name in ("left", "right"))
    return _facts(result) | {"velocities": max(abs(left), abs(right - 0.1)) / 0.1}


def stack(method: str, row: Row) -> Facts:
    """Three damped blocks put on each other: the floor bears their weight."""
    result = _solved(method, row)
    force = result.history["contact_force"].values[-20:]
    weight = 0.01 * 0.5 * (3 + 2 + 1)  # of floor and both joints
    return {
        "weight": float(np.abs(force - weight).max()) / weight,
        "penetration": max(0.0, -float(result.history["gap"].min())),
    }


def slide(method: str, row: Row) -> Facts:
    """A block that slides on a floor and is braked."""
    result = _solved(method, row)
    history, facts = result.history, _energy(result)
    energy = float(history["total_energy"][-1] - history["total_energy"][0])
    work = float(result.summary["details"]["friction_work"])
    slowed = float(history["block.vx"][0] - history["block.vx"][-1])
    return {
        "growth": facts["growth"],
        "heat": abs(energy - work) / float(history["kinetic_energy"][0]),
        "braking": abs(slowed / (0.4 * 0.01 * 4.0) - 1.0),
        "penetration": facts["penetration"],
    }


CASES: tuple[Case, ...] = load("pairs", (plain, swap, stack, slide))
"""Hard cases of several solids."""
