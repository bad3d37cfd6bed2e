"""Hard cases of solids: how their scenes are made, and what is measured and claimed of a run."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from impactfem.errors import ConvergenceError
from impactfem.result import Result
from impactfem.scene import Scene
from impactfem.solving import solve
from impactfem.studies.hard.board import Claim

IMPLICIT = ("massless", "conserving", "moreau_jean")
EXPLICIT = ("explicit", "galerkin")
SOLID = ("massless", "conserving", "explicit", "galerkin", "moreau_jean")
CONTROLLED = (*SOLID, "newmark")

SPEED = 0.1  # of bodies that are thrown; waves have speed 1
FLOOR: dict[str, Any] = {"kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
SQUARE: dict[str, Any] = {"kind": "block", "size": [1.0, 1.0], "corner": [-0.5, 0.02]}
DISC: dict[str, Any] = {"kind": "disc", "radius": 0.5, "center": [0.0, 0.52]}

GROWTH = Claim("growth", 1e-6, "rigid obstacles at rest do no work, so energy never grows")
KEPT = Claim("growth", 1e-9, "theta is such that the contact work is the contact energy's change")
DRIFT = Claim("drift", 1e-9, "energy is kept exactly, to the rounding of theta")
PENETRATION = Claim("penetration", 1e-10, "gap >= 0 at every level, as a share of the size")
SUNK = Claim("steps sunk", 1.0, "velocities are stopped at the end of the step that closes a gap")
PULL = Claim("pull", 1e-12, "lambda >= 0: an obstacle does not pull")
IMPULSE = Claim("impulse", 1e-9, "momentum changes by the impulse of the force and of gravity")
VARIATION = Claim(
    "variation", 1.3, "of the force, as a share of that on elements and steps half as large"
)


def youngs_modulus(poisson_ratio: float) -> float:
    """The modulus at which pressure waves have speed 1 in a plane body of density 1."""
    return (1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio) / (1.0 - poisson_ratio)


def solid_scene(
    duration: float,
    *,
    gravity: Sequence[float] = (0.0, 0.0),
    obstacles: Sequence[Mapping[str, Any]] = (FLOOR,),
    solve: Mapping[str, Any] | None = None,
    **body: Any,
) -> Scene:
    """A disc of radius 1/2 thrown on a floor, with unit data but for what is given."""
    ratio = body.get("poisson_ratio", 0.3)
    data = {
        "kind": "solid", "name": "body", "model": "plane_strain", "mesh_size": 0.125, "degree": 1,
        "density": 1.0, "youngs_modulus": youngs_modulus(ratio), "poisson_ratio": ratio,
        "velocity": [0.0, -SPEED],
    }  # fmt: skip
    if "mesh" not in body:
        data["shape"] = DISC
    else:
        del data["mesh_size"]
    return Scene.from_dict(
        {
            "title": "hard case",
            "duration": duration,
            "gravity": list(gravity),
            "body": [data | body],
            "obstacle": [
                {"name": f"obstacle_{k}", **obstacle} for k, obstacle in enumerate(obstacles, 1)
            ],
            "solve": {"estimate": False, "normals": "fixed", **(solve or {})},
            "output": {"fields": []},
        }
    )


def solved(method: str, scene: Scene, **settings: Any) -> Result:
    """The result.

    Raises:
        ConvergenceError: Contact forces were not found.
    """
    result = solve(scene, method=method, **settings)
    if result.summary["status"] == "not_converged":
        raise ConvergenceError(f"contact: {result.summary['active_set']['message']}")
    return result


def facts_of(result: Result) -> dict[str, float]:
    """Figures of a run, dimensionless for bodies of size 1."""
    history, scene = result.history, result.scene
    force, gap = history["contact_force"].values, history["gap"].values
    # The first half step of an explicit march has another energy, dt^2 a M a / 8 less: what the
    # layers conserve is that of the middle of the first.
    first = 1 if result.summary["method"] in EXPLICIT else 0
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
    if result.summary["method"] == "moreau_jean":
        velocity = np.hypot(history["body.vx"].values, history["body.vy"].values)
        facts["steps sunk"] = depth / max(float(velocity.max()) * dt, 1e-300)
    if len(scene.obstacles) == 1 and scene.obstacles[0].kind == "half_space":
        facts["impulse"] = _impulse_error(result)
    return facts


def _impulse_error(result: Result) -> float:
    """By how much the momentum changes otherwise than by the impulses of force and gravity."""
    history, method = result.history, result.summary["method"]
    momentum, force = history["momentum"].values, history["contact_force"].values
    dt = float(history["time"].values[1])
    direction = np.asarray(history["momentum"].attrs["direction"])[:2]
    velocity = np.stack([history["body.vx"].values, history["body.vy"].values], axis=1) @ direction
    fastest = int(np.argmax(np.abs(velocity)))
    if velocity[fastest] == 0.0:
        return float(np.abs(force).max())
    mass = float(momentum[fastest] / velocity[fastest])
    weight = mass * float(result.scene.vector_gravity.at(0.0) @ direction)
    if method == "explicit":  # momentum belongs to the middle of layers, and layers have the mean
        change, acting = 0.5 * (momentum[3:] - momentum[1:-2]), force[2:-1]
    elif method == "galerkin":
        change, acting = np.diff(momentum)[1:], 0.5 * (force[1:-1] + force[2:])
    else:
        change, acting = np.diff(momentum), force[1:]
    missing = change - dt * (acting + weight)
    scale = max(float(np.abs(momentum).max()), dt * abs(weight))
    return float(np.abs(missing).max(initial=0.0)) / scale


@lru_cache(maxsize=8)
def _smooth_variation(scene: Scene, step: float) -> float:
    """Total variation of the force on elements and steps half as large."""
    finer = scene.with_settings({"body.body.mesh_size": 0.5 * (scene.solid.mesh_size or 0.0)})
    history = solved("conserving", finer, dt=0.5 * step).history
    return total_variation(history["contact_force"].values)


def total_variation(values: Any) -> float:
    """Sum of all rises and falls."""
    return float(np.abs(np.diff(values)).sum())


def run(
    method: str, scene: Scene, settings: Mapping[str, Any] | None = None, *, pulse: bool = True
) -> dict[str, float]:
    """Facts of a scene; ``pulse`` adds the variation of the force."""
    result = solved(method, scene, **(settings or {}))
    facts = facts_of(result)
    if pulse:
        step = 0.5 * (scene.solid.mesh_size or 0.0) / scene.solid.p_wave_speed
        rough = total_variation(result.history["contact_force"].values)
        facts["variation"] = rough / _smooth_variation(scene, step)
    return facts


def claims(method: str, *, pulse: bool = True, lasting: bool = True) -> list[Claim]:
    """What must hold; ``lasting`` where energy can be kept: no damping, fixed normals."""
    keeps = lasting and method in {"conserving", "explicit"}
    found = [KEPT if keeps else GROWTH, PULL]
    if keeps:
        found.append(DRIFT)
    found.append(SUNK if method == "moreau_jean" else PENETRATION)
    return [*found, VARIATION] if pulse else found
