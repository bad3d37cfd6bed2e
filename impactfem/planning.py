"""The plan: the least model and method that a scene needs, with the reasons, before solving."""

import math
import os
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from impactfem.errors import SceneError
from impactfem.exact import ExactBar
from impactfem.reference import exact_bar
from impactfem.scene import Scene

DEFAULT_ELEMENTS = 80
_ALIGNED = range(40, 161)  # sizes tried to put impacts and releases on layers
_ON_LAYER = 1e-6  # share of a layer within which an event counts as on it
_STABLE = 1.0 + 1e-9

# Cost of the monolithic solution, fitted to runs with 2e4 to 5e5 unknowns on a 2-core machine.
_SECONDS_ONCE, _SECONDS_PER_ITERATION, _KIB_PER_UNKNOWN, _MIB_BASE = 11e-6, 3e-6, 2.9, 170.0


@dataclass(frozen=True)
class Plan:
    """What will be modelled and how.

    Attributes:
        method: Name as in `impactfem methods`.
        model: The model in words.
        elements: Elements along the bar; None if a mesh file decides.
        layers: Time layers; None if a mesh file decides.
        dt: Time step [s]; None if a mesh file decides.
        courant: c dt / h; None if a mesh file decides.
        window: Layers solved by one active-set loop.
        active_set: Solver of the contact conditions.
        gamma: Dimensionless merit constant.
        tolerance: Relative rounding level of the merit.
        max_iterations: Limit of linear solves.
        contact_pairs: Complementarity pairs; None if a mesh file decides.
        unknowns: Size of the linear system; None if a mesh file decides.
        memory_mib: Estimated peak memory [MiB]; None if a mesh file decides.
        seconds: Estimated time [s] on a 2-core machine; None if a mesh file decides.
        reasons: Why each choice was made, by key.
        warnings: What the user should know before trusting the answer.
    """

    method: str
    model: str
    elements: int | None
    layers: int | None
    dt: float | None
    courant: float | None
    window: str
    active_set: str
    gamma: float
    tolerance: float
    max_iterations: int
    contact_pairs: int | None
    unknowns: int | None
    memory_mib: float | None
    seconds: float | None
    reasons: dict[str, str]
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain data for ``summary.json``."""
        return asdict(self) | {"warnings": list(self.warnings)}


def plan(scene: Scene) -> Plan:
    """Choose model, method and numbers for a scene; nothing is solved but the exact events.

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
    """
    bar, solve = scene.bodies[0], scene.solve
    exact = exact_bar(scene)
    method = solve.method or "galerkin"
    reasons = {
        "model": "one homogeneous bar that moves along its axis: nothing in the scene bends it or "
        "varies across it; one contact point, frictionless",
        "method": "as asked" if solve.method else _why_galerkin(solve.mesh),
    }
    warnings: list[str] = []
    elements, layers, dt, courant = _grid(scene, exact, reasons, warnings)
    pairs = layers if method != "exact" else None
    unknowns = (
        None if elements is None or layers is None else (layers + 1) * (elements + 1) + layers
    )
    impacts = len(exact.contacts)
    # Each impact shifts the next ones: their layers settle one impact after the other.
    iterations = 3 if impacts <= 1 else impacts * (elements or DEFAULT_ELEMENTS)
    solves = "about 3" if impacts <= 1 else f"{iterations // impacts} to {2 * iterations}"
    reasons["active_set"] = (
        f"{impacts} contact interval{'s' if impacts != 1 else ''} expected from the exact events: "
        f"{solves} linear solves"
    )
    memory: float | None = None
    seconds: float | None = None
    if method == "exact":
        unknowns, memory, seconds = 0, 100.0, 0.1
        reasons["active_set"] = "none: events are roots of linear and quadratic functions"
    elif unknowns is not None:
        memory = _MIB_BASE + _KIB_PER_UNKNOWN * unknowns / 1024
        seconds = unknowns * (_SECONDS_ONCE + _SECONDS_PER_ITERATION * iterations)
        _check_memory(memory, unknowns)
    return Plan(
        method=method,
        model=f"elastic bar in 1D, far end {bar.far_end}, rigid wall at its near end",
        elements=elements,
        layers=layers,
        dt=dt,
        courant=courant,
        window="all",
        active_set="none" if method == "exact" else solve.active_set or "pdas",
        gamma=solve.gamma or 1.0,
        tolerance=solve.tolerance or 1e-10,
        max_iterations=solve.max_iterations or 3 * iterations + 50,
        contact_pairs=pairs,
        unknowns=unknowns,
        memory_mib=memory,
        seconds=seconds,
        reasons=reasons,
        warnings=tuple(warnings),
    )


def _why_galerkin(mesh: str | None) -> str:
    if mesh is not None:
        return "the method that works on a given space-time mesh"
    return "exact at the nodes for a homogeneous bar at courant 1 when events fall on layers"


def _grid(
    scene: Scene, exact: ExactBar, reasons: dict[str, str], warnings: list[str]
) -> tuple[int | None, int | None, float | None, float | None]:
    """Elements, layers, time step and courant number."""
    bar, solve = scene.bodies[0], scene.solve
    if solve.mesh is not None:
        reasons["elements"] = f"the mesh file {solve.mesh} decides"
        return None, None, None, None
    if solve.elements is not None:
        elements = solve.elements
        reasons["elements"] = "as asked"
    else:
        elements = _aligned_elements(exact) or DEFAULT_ELEMENTS
        reasons["elements"] = (
            "the least number from 40 on whose layers hold all impacts and releases"
            if _on_layers(exact, elements)
            else f"the default; no number up to {_ALIGNED[-1]} puts all events on layers"
        )
    h = bar.length / elements
    if solve.dt is not None:
        dt = solve.dt
        reasons["dt"] = "as asked"
    else:
        dt = (solve.courant or 1.0) * h / bar.wave_speed
        reasons["dt"] = (
            "courant as asked" if solve.courant else "courant = 1: waves run from node to node"
        )
    courant = bar.wave_speed * dt / h
    if courant > _STABLE and solve.method != "exact":
        # Largest eigenvalue of M^-1 K for lumped linear elements: 4 c^2 / h^2; leapfrog is stable
        # for dt^2 times it <= 4.
        raise SceneError(
            f"solve: courant = {courant:g} is beyond the stability limit 1 of P1 right triangles "
            f'(dt <= h/c = {h / bar.wave_speed:g} s); use courant <= 1 or method = "exact"'
        )
    layers = max(1, math.ceil(scene.duration / dt - 1e-9))
    if layers * dt > scene.duration * (1 + 1e-9):
        reasons["layers"] = (
            f"the last layer ends at {layers * dt:g} s, the first end past the duration"
        )
    if solve.method != "exact":
        if courant < 1.0 / _STABLE:
            warnings.append(
                f"courant = {courant:g} < 1: the contact force of this method rings (overshoot "
                "2 to 4 times, not shrinking with h) and the sets may not settle"
            )
        elif not _on_layers(exact, elements):
            warnings.append("an impact or release lies between layers: errors of first order in h")
    return elements, layers, dt, courant


def _on_layers(exact: ExactBar, elements: int) -> bool:
    """Whether every contact event falls on a layer at courant 1."""
    ends = np.array(exact.contacts).ravel()
    layer = ends[ends < exact.duration] * elements / exact.transit_time
    return bool(np.all(np.abs(layer - np.rint(layer)) < _ON_LAYER))


def _aligned_elements(exact: ExactBar) -> int | None:
    """The least size whose layers hold all events; None if there is none."""
    return next((n for n in _ALIGNED if _on_layers(exact, n)), None)


def _check_memory(memory_mib: float, unknowns: int) -> None:
    """Refuse what cannot fit."""
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**20
    if memory_mib > physical:
        raise SceneError(
            f"solve.elements: {unknowns} space-time unknowns need about {memory_mib / 1024:.1f} "
            f'GiB, this machine has {physical / 1024:.1f}; use fewer elements or method = "exact"'
        )
