"""Hard cases of solids: how they are run, what is measured, and what is told of their contact."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from impactfem.errors import ConvergenceError
from impactfem.facade import Result
from impactfem.marching.schemes import SOLID_SCHEMES
from impactfem.scene import Scene
from impactfem.solving import solve
from impactfem.studies.hard.board import Facts
from impactfem.studies.hard.rows import Row


def solved(method: str, scene: Scene) -> Result:
    """The result.

    Raises:
        ConvergenceError: Contact forces were not found.
    """
    result = solve(scene, method=method)
    if result.summary["status"] == "not_converged":
        raise ConvergenceError(f"contact: {result.summary['active_set']['message']}")
    return result


def facts_of(result: Result) -> dict[str, float]:
    """Figures of a run, dimensionless for bodies of size 1."""
    history, scene = result.history, result.scene
    force, gap = history["contact_force"].values, history["gap"].values
    scheme = SOLID_SCHEMES[result.summary["method"]]
    # The first half step of an explicit march has another energy, dt^2 a M a / 8 less: what the
    # layers conserve is that of the middle of the first.
    first = int(scheme.explicit)
    total = history["total_energy"].values[first:]
    inside = history["kinetic_energy"].values + history["elastic_energy"].values
    start, most = max(abs(float(total[0])), float(inside[0])), float(inside.max())
    if start <= 1e-3 * most:  # at rest at the start: then what it comes to
        start = most or 1.0
    dt = float(history["time"].values[1])
    depth = max(0.0, -float(gap.min()))
    facts = {
        "growth": max(0.0, float((total - total[0]).max())) / start,
        "drift": float(np.abs(total - total[0]).max()) / start,
        "loss": float(total[0] - total[-1]) / start + 0.0,
        "penetration": depth,
        "pull": max(0.0, -float(force.min())) / max(float(np.abs(force).max()), 1e-300),
    }
    if scheme.contact == "velocity":
        velocity = np.hypot(history["body.vx"].values, history["body.vy"].values)
        facts["steps sunk"] = depth / max(float(velocity.max()) * dt, 1e-300)
    if [obstacle.plane_normal is not None for obstacle in scene.rigid_obstacles] == [True]:
        facts["impulse"] = _impulse_error(result)
    return facts


def _impulse_error(result: Result) -> float:
    """By how much the momentum changes otherwise than by the impulses of force and gravity."""
    history, scheme = result.history, SOLID_SCHEMES[result.summary["method"]]
    momentum, force = history["momentum"].values, history["contact_force"].values
    dt = float(history["time"].values[1])
    direction = np.asarray(history["momentum"].attrs["direction"])[:2]
    velocity = np.stack([history["body.vx"].values, history["body.vy"].values], axis=1) @ direction
    fastest = int(np.argmax(np.abs(velocity)))
    if velocity[fastest] == 0.0:
        return float(np.abs(force).max())
    mass = float(momentum[fastest] / velocity[fastest])
    weight = mass * float(result.scene.vector_gravity.at(0.0) @ direction)
    if scheme.shares_forces:
        change, acting = np.diff(momentum)[1:], 0.5 * (force[1:-1] + force[2:])
    elif scheme.explicit:  # momentum belongs to the middle of layers, and layers have the mean
        change, acting = 0.5 * (momentum[3:] - momentum[1:-2]), force[2:-1]
    else:
        change, acting = np.diff(momentum), force[1:]
    missing = change - dt * (acting + weight)
    scale = max(float(np.abs(momentum).max()), dt * abs(weight))
    return float(np.abs(missing).max(initial=0.0)) / scale


@lru_cache(maxsize=8)
def _smooth_variation(scene: Scene, step: float) -> float:
    """Total variation of the force on elements and steps half as large."""
    size = 0.5 * (scene.solid.mesh_size or 0.0)
    finer = {"body.body.mesh_size": size, "solve.dt": 0.5 * step, "solve.courant": None}
    history = solved("conserving", scene.with_settings(finer)).history
    return total_variation(history["contact_force"].values)


def total_variation(values: Any) -> float:
    """Sum of all rises and falls."""
    return float(np.abs(np.diff(values)).sum())


def plain(method: str, row: Row) -> Facts:
    """The worst of the scenes; with the variation of the force if it is asked."""

    def facts(scene: Scene) -> Facts:
        result = solved(method, scene)
        found = facts_of(result)
        if "variation" in row.figures:
            step = 0.5 * (scene.solid.mesh_size or 0.0) / scene.solid.p_wave_speed
            rough = total_variation(result.history["contact_force"].values)
            found["variation"] = rough / _smooth_variation(scene, step)
        return found

    return row.worst(facts)


def graze(method: str, row: Row) -> Facts:
    """A throw that hardly reaches the floor: the motion is next to that without one."""

    def facts(scene: Scene) -> Facts:
        result = solved(method, scene)
        time, height = (result.history[name].values for name in ("time", "body.y"))
        gap, speed = float(height[0]) - 0.5, float(result.history["body.vy"].values[0])
        thrown = height[0] + speed * time + 0.5 * scene.vector_gravity.at(0.0)[1] * time**2
        return facts_of(result) | {"displacement": float(np.abs(height - thrown).max()) / gap}

    return row.worst(facts)


def resting(method: str, row: Row) -> Facts:
    """A damped square laid on the floor: it settles, and the floor bears its weight."""

    def facts(scene: Scene) -> Facts:
        result = solved(method, scene)
        weight = -float(scene.vector_gravity.at(0.0)[1]) * (scene.solid.mass or 0.0)
        force = result.history["contact_force"].values
        last = force[-len(force) // 10 :]
        return facts_of(result) | {
            "weight": float(np.abs(last - weight).max()) / weight,
            "jitter": float(np.abs(np.diff(last)).max()) / weight,
        }

    return row.worst(facts)


def untouched(method: str, row: Row) -> Facts:
    """A square on the floor, not pressed: nothing happens."""
    result = solved(method, row.scene())
    return facts_of(result) | {
        "force": float(result.history["contact_force"].values.max()),
        "motion": float(np.abs(result.history["body.y"].values - 0.5).max()),
    }


def face(method: str, row: Row) -> Facts:
    """A block's full face strikes a wall: the force is rho c v A until the wave is back."""
    contact = solved(method, row.scene()).summary["contact"]
    return {"force": abs((contact["max_force"] or np.nan) / (0.1 * 0.2) - 1.0)}


def told(method: str, row: Row) -> Facts:
    """A run whose verdict must have a finding of a code, and a calm one that must not."""
    loud, calm, code = _both(method, row)
    return {"silent": float(code not in loud[2]), "false alarm": float(code in calm[2])}


def beyond(method: str, row: Row) -> Facts:
    """A motion that small strains do not describe, and one a twentieth as fast."""
    loud, calm, code = _both(method, row)
    return {
        "silent": float(code not in loud[2] or loud[0] != "out_of_model"),
        "believed": float(loud[1] != "do_not_trust"),
        "false alarm": float(code in calm[2] or calm[0] != "completed"),
    }


type _Told = tuple[str, str, set[str]]


def _both(method: str, row: Row) -> tuple[_Told, _Told, str]:
    """Status, trust and codes of findings of a run and of its calm one; the code sought."""

    def verdict(more: Mapping[str, Any]) -> _Told:
        summary = solved(method, row.scene(more)).summary
        findings = summary["verdict"]["findings"]
        return summary["status"], summary["verdict"]["level"], {each["code"] for each in findings}

    return verdict({}), verdict(row.given["calm"]), row.given["code"]


def half(method: str, row: Row) -> Facts:
    """Half a disc on a mesh that is half of the whole one."""
    cut, whole = (
        solved(method, row.scene({"body.body.shape.symmetry": symmetry})).history
        for symmetry in (["x"], [])
    )
    return {
        "difference": max(
            float(np.abs(cut[name] - whole[name]).max() / np.abs(whole[name]).max())
            for name in ("contact_force", "total_energy", "momentum")
        )
    }
