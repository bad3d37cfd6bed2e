"""Sizes of a computation: elements, layers, memory and time, before anything is solved."""

import math
import os
from dataclasses import dataclass

import numpy as np

from impactfem.errors import SceneError
from impactfem.exact import ExactBar
from impactfem.methods import METHODS, Method
from impactfem.scene import Scene

DEFAULT_ELEMENTS = 80
_ALIGNED = range(40, 161)  # sizes tried to put impacts and releases on layers
_ON_LAYER = 1e-6  # share of a layer within which an event counts as on it
_FITTED_CONTACTS = 10  # 50 random scenes with 2 to 10: error at most 8e-12, energy 2e-10
_FITTED_ELEMENTS = 20  # between the lines the fields are linear: few triangles do
_STABLE = 1.0 + 1e-9
_MAX_ELEMENTS = 200_000

# Costs on a 2-core machine. Monolithic: fitted to runs with 2e4 to 5e5 unknowns.
_MONOLITHIC_SECONDS, _MONOLITHIC_PER_ITERATION, _MONOLITHIC_KIB = 11e-6, 3e-6, 2.9
# Discontinuous: fitted to runs with 2e3 to 1.2e5 triangles, fitted meshes among them.
_TRIANGLE_SECONDS, _DISCONTINUOUS_KIB = 1.2e-4, 0.6  # of a triangle, of an unknown
_SWEEP_SECONDS = 8e-9  # of a node in a layer
_LOADING_SECONDS = 0.5  # of Numba and its cached loops
_BASE_MIB, _DOLFINX_MIB = 220.0, 260.0  # of the process with Numba, and with DOLFINx too


@dataclass(frozen=True)
class Grid:
    """Elements and layers; all None if a mesh file decides, layers None without layers."""

    elements: int | None = None
    layers: int | None = None
    dt: float | None = None
    courant: float | None = None


def choose_grid(scene: Scene, method: Method, exact: ExactBar, reasons: dict[str, str]) -> Grid:
    """Choose elements and time step, with the reasons.

    Raises:
        SceneError: The time step is beyond the method's stability limit.
    """
    bar, solve = scene.bar, scene.solve
    if solve.mesh is not None:
        reasons["elements"] = f"the mesh file {solve.mesh} decides"
        return Grid()
    elements = _choose_elements(scene, method, exact, reasons)
    if not method.layered:
        reasons["dt"] = "triangles have no layers"
        return Grid(elements)
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
    if courant > _STABLE and method.stable == "limited":
        # Largest eigenvalue of M^-1 K for equal lumped elements: 4 c^2 / h^2.
        raise SceneError(
            f"solve: courant = {courant:g} is beyond the stability limit 1 of P1 right triangles "
            f"(dt <= 2 / omega_max = h / c = {h / bar.wave_speed:g} s); use courant <= 1, or "
            'method = "conserving", "dg" or "exact"'
        )
    layers = max(1, math.ceil(scene.duration / dt - 1e-9))
    if layers * dt > scene.duration * (1 + 1e-9):
        reasons["layers"] = (
            f"the last layer ends at {layers * dt:g} s, the first end past the duration"
        )
    return Grid(elements, layers, dt, courant)


def _choose_elements(scene: Scene, method: Method, exact: ExactBar, reasons: dict[str, str]) -> int:
    """As asked, else by the accuracy asked for, else such that events fall on layers."""
    solve = scene.solve
    if solve.elements is not None:
        reasons["elements"] = "as asked"
        return solve.elements
    if solve.accuracy is not None and method.layered and not method.exact:
        aligned = _aligned_elements(exact)
        if aligned is not None and method.stable == "limited":
            reasons["elements"] = f"{aligned}: its layers hold all events, where nodes are exact"
            return aligned
        constant, rate = method.error
        contacts = max(1, len(exact.contacts))
        reasons["elements"] = (
            f"error at most {constant:g} x contacts / elements^{rate:.2g} in the standing studies"
        )
        wanted = math.ceil((constant * contacts / solve.accuracy) ** (1.0 / rate))
        if wanted > _MAX_ELEMENTS:
            raise SceneError(
                f"solve.accuracy = {solve.accuracy:g}: needs {wanted:.3g} elements for {contacts} "
                f'contacts; use method = "exact" or "dg" with fitted = true, or less accuracy'
            )
        return max(int(wanted), 40)
    aligned = _aligned_elements(exact)
    if not method.layered:
        reasons["elements"] = "between the lines of a fitted mesh few triangles do"
        return _FITTED_ELEMENTS if fitting_pays(scene, exact) else DEFAULT_ELEMENTS
    reasons["elements"] = (
        "the least number from 40 on whose layers hold all impacts and releases"
        if aligned is not None
        else f"the default; no number up to {_ALIGNED[-1]} puts all events on layers"
    )
    return aligned or DEFAULT_ELEMENTS


def on_its_own_mesh(scene: Scene, exact: ExactBar) -> int | None:
    """Elements with which galerkin is exact at the nodes but for rounding; None: there are none.

    Courant 1, contacts and changes of gravity on layers, one initial velocity and strain.
    """
    bar, solve = scene.bar, scene.solve
    elements = solve.elements or _aligned_elements(exact)
    speeds = [bar.initial_velocity(x=0.0), bar.initial_velocity(x=bar.length)]
    if elements is None or exact.sampled or np.ptp(speeds) > 0.0:  # it weights speeds with hats
        return None
    h = bar.length / elements
    courant = bar.wave_speed * solve.dt / h if solve.dt else solve.courant or 1.0
    fits = abs(courant - 1.0) <= _ON_LAYER and on_layers(exact, elements)
    return elements if fits else None


def fitting_pays(scene: Scene, exact: ExactBar) -> bool:
    """Whether a fitted mesh gives rounding errors at little cost, and nothing asks for layers.

    With many contacts the lines of the mesh grow and so does the cost. Initial states that are not
    piecewise linear do not lie between a few lines.
    """
    solve = scene.solve
    if solve.mesh is not None:
        return False
    asked = (solve.elements, solve.courant, solve.dt, solve.window, solve.accuracy)
    layered = solve.method is None or METHODS[solve.method].layered
    layers = layered and any(key is not None for key in asked)
    return not layers and 1 <= len(exact.contacts) <= _FITTED_CONTACTS and not exact.sampled


def on_layers(exact: ExactBar, elements: int) -> bool:
    """Whether every contact event and change of gravity falls on a layer at courant 1."""
    ends = np.array(exact.contacts).ravel()
    events = np.concatenate([ends[ends < exact.duration], exact.load_switches])
    layer = events * elements / exact.transit_time
    return bool(np.all(np.abs(layer - np.rint(layer)) < _ON_LAYER))


def _aligned_elements(exact: ExactBar) -> int | None:
    """The least size whose layers hold all events; None if there is none."""
    return next((n for n in _ALIGNED if on_layers(exact, n)), None)


def monolithic_cost(unknowns: int, iterations: int) -> tuple[float, float]:
    """Memory [MiB] and time [s] of the monolithic space-time system.

    Raises:
        SceneError: The machine has less memory.
    """
    memory = _DOLFINX_MIB + _MONOLITHIC_KIB * unknowns / 1024
    _check_memory(memory, f"{unknowns:.3g} space-time unknowns")
    return memory, unknowns * (_MONOLITHIC_SECONDS + _MONOLITHIC_PER_ITERATION * iterations)


def discontinuous_cost(triangles: int, unknowns: int) -> tuple[float, float]:
    """Memory [MiB] and time [s] of method dg on one mesh.

    Raises:
        SceneError: The machine has less memory.
    """
    memory = _BASE_MIB + _DOLFINX_MIB / 2 + _DISCONTINUOUS_KIB * unknowns / 1024
    _check_memory(memory, f"{unknowns:.3g} unknowns of space-time triangles")
    return memory, _LOADING_SECONDS + triangles * _TRIANGLE_SECONDS


def marching_cost(grid: Grid, every: int, passes: int) -> tuple[float, float]:
    """Memory [MiB] and time [s] of a march that keeps every so many layers.

    Raises:
        SceneError: The machine has less memory.
    """
    nodes, layers = (grid.elements or 0) + 1, grid.layers or 0
    kept = layers // every + 2
    memory = _BASE_MIB + (2 * kept * nodes + 12 * layers) * 8 / 2**20
    _check_memory(memory, f"{kept:.3g} kept layers of {nodes:.3g} nodes")
    return memory, _LOADING_SECONDS + nodes * layers * passes * _SWEEP_SECONDS


def physical_mib() -> float:
    """Memory of the machine [MiB]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**20


def _check_memory(memory_mib: float, what: str) -> None:
    """Refuse what cannot fit."""
    physical = physical_mib()
    if memory_mib > physical:
        raise SceneError(
            f"solve.elements: {what} need about {memory_mib / 1024:.3g} GiB, this machine has "
            f"{physical / 1024:.3g}; use fewer elements or a larger output.every"
        )
