"""Hard cases of several solids: collisions, stacks, friction; what must hold in them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from impactfem.errors import ConvergenceError
from impactfem.result import Result
from impactfem.scene import Scene
from impactfem.solving import solve
from impactfem.studies.hard.board import Case, Claim, Facts

METHODS = ("massless", "conserving", "explicit", "moreau_jean", "newmark")
RUBBING = ("massless", "conserving", "explicit", "moreau_jean")

_FLOOR: dict[str, Any] = {
    "kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0],
}  # fmt: skip

GROWTH = Claim("growth", 1e-6, "without outer forces nothing does work")
KEPT = Claim("drift", 1e-9, "theta is such that the contact work is the contact energy's change")
MOMENTUM = Claim("momentum", 1e-10, "forces of a pair are equal and opposite")
PENETRATION = Claim("penetration", 1e-10, "weighted gaps >= 0 at every level")
HEAT = Claim("heat", 1e-8, "energy falls by the frictional work, no more and no less")


def _solid(name: str, shape: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    data: dict[str, Any] = {
        "kind": "solid", "name": name, "model": "plane_strain", "shape": dict(shape),
        "mesh_size": 0.125, "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.0,
    }  # fmt: skip
    return data | more


def _block(name: str, corner: Sequence[float], **more: Any) -> dict[str, Any]:
    size = more.pop("size", [1.0, 0.5])
    return _solid(name, {"kind": "block", "size": size, "corner": list(corner)}, **more)


def _solved(
    method: str, bodies: Sequence[Mapping[str, Any]], duration: float, **more: Any
) -> Result:
    settings = {"method": method, **more.pop("solve", {})}
    data = {
        "title": "a hard case", "duration": duration, "body": list(bodies), "solve": settings,
        "output": {"fields": []}, **more,
    }  # fmt: skip
    result = solve(Scene.from_dict(data))
    if not result.summary["active_set"]["converged"]:
        raise ConvergenceError(result.summary["active_set"]["message"])
    return result


def _facts(result: Result) -> dict[str, float]:
    """Energy, momentum along the approach, and penetration of a run."""
    history = result.history
    total = history["total_energy"].values
    start = float(history["kinetic_energy"][0]) or float(np.abs(total).max())
    momentum = history["momentum"].values
    return {
        "growth": max(0.0, float((total - total[0]).max())) / start,
        "drift": float(np.abs(total - total[0]).max()) / start,
        "momentum": float(np.abs(momentum - momentum[0]).max() / abs(momentum[0])),
        "penetration": max(0.0, -float(history["gap"].min())),
    }


def _swap(method: str) -> Facts:
    """Equal blocks with other meshes: they swap their velocities."""
    bodies = [
        _block("left", [0.0, 0.0], velocity=[0.1, 0.0]),
        _block("right", [1.02, 0.0], mesh_size=0.08),
    ]
    result = _solved(method, bodies, 3.0)
    left, right = (float(result.history[f"{name}.vx"][-1]) for name in ("left", "right"))
    return _facts(result) | {"velocities": max(abs(left), abs(right - 0.1)) / 0.1}


def _oblique(method: str, normals: str) -> Facts:
    """Discs that strike each other aside of their centres."""
    disc = {"kind": "disc", "radius": 0.5}
    bodies = [
        _solid("one", disc | {"center": [0.0, 0.0]}, velocity=[0.1, 0.0], poisson_ratio=0.3),
        _solid("two", disc | {"center": [0.95, 0.4]}, mesh_size=0.1, poisson_ratio=0.3),
    ]
    return _facts(_solved(method, bodies, 8.0, solve={"normals": normals}))


def _stack(method: str) -> Facts:
    """Three damped blocks put on each other: the floor bears their weight."""
    gravity = 0.01
    bodies = [
        _block(f"b{k}", [0.0, 0.5 * k], mesh_size=0.2, rayleigh_mass=0.5, rayleigh_stiffness=0.2)
        for k in range(3)
    ]
    result = _solved(
        method, bodies, 60.0, gravity=[0.0, -gravity], obstacle=[_FLOOR], solve={"dt": 0.1}
    )
    force = result.history["contact_force"].values[-20:]
    weight = gravity * 0.5 * (3 + 2 + 1)  # of floor and both joints
    return {
        "weight": float(np.abs(force - weight).max()) / weight,
        "penetration": max(0.0, -float(result.history["gap"].values.min())),
    }


def _slide(method: str) -> Facts:
    """A block that slides to rest."""
    gravity, speed, mu = 0.01, 0.02, 0.4
    bodies = [
        _block("block", [0.0, 0.0], velocity=[speed, 0.0], poisson_ratio=0.3, rayleigh_mass=0.0)
    ]
    contact = [{"between": ["block", "floor"], "friction_coefficient": mu}]
    result = _solved(
        method, bodies, 4.0, gravity=[0.0, -gravity], obstacle=[_FLOOR], contact=contact
    )
    history, summary = result.history, result.summary
    total = history["total_energy"].values
    work = float(summary["details"]["friction_work"])
    start = float(history["kinetic_energy"][0])
    slowed = float(history["block.vx"][0] - history["block.vx"][-1])
    return {
        "growth": max(0.0, float((total - total[0]).max())) / start,
        "heat": abs(float(total[-1] - total[0]) - work) / start,
        "braking": abs(slowed / (mu * gravity * 4.0) - 1.0),
        "penetration": max(0.0, -float(history["gap"].min())),
    }


def _claims(method: str) -> list[Claim]:
    found = [MOMENTUM]
    if method in {"conserving", "explicit"}:
        found.append(KEPT)
    else:
        found.append(GROWTH)
    if method != "moreau_jean":
        found.append(PENETRATION)
    return found


def _braking(method: str) -> list[Claim]:
    found = [Claim("braking", 0.1, "mu g t, but for the swing of the block on the floor")]
    if method == "conserving":
        found.append(HEAT)
    if method in {"massless", "conserving", "moreau_jean"}:
        found.append(Claim("growth", 1e-6, "friction and contact only take energy"))
    return found


def _following(method: str) -> list[Claim]:
    found = [
        MOMENTUM,
        Claim("growth", 0.01, "weights and normals turn between layers: first order"),
    ]
    return found if method == "moreau_jean" else [*found, PENETRATION]


_SWAPPED = Claim(
    "velocities", 0.04, "equal bars swap velocities; 8 and 12 elements smear the pulse"
)
_WEIGHT = Claim("weight", 1e-6, "what rests is borne")

CASES: tuple[Case, ...] = (
    Case("two equal blocks, other meshes", _swap, lambda m: [*_claims(m), _SWAPPED], METHODS,
         frozenset(), True, "solid"),
    Case("discs collide aside of their centres", lambda m: _oblique(m, "fixed"), _claims, METHODS,
         frozenset(), True, "solid"),
    Case("discs collide, pairs follow them", lambda m: _oblique(m, "updated"), _following, METHODS,
         frozenset(), True, "solid"),
    Case("stack of three blocks", _stack, lambda _: [_WEIGHT], ("massless", "conserving"),
         frozenset(), True, "solid"),
    Case("block slides with friction", _slide, _braking, RUBBING, frozenset(), True, "solid"),
)  # fmt: skip
"""Hard cases of several solids."""
