"""Sizes of a computation: elements, layers, memory and time, before anything is solved."""

import math
import os
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.exact import ExactBar
from impactfem.methods import METHODS, Method
from impactfem.scene import Scene

DEFAULT_ELEMENTS = 80
ALIGNED = range(40, 161)
"""Numbers of elements tried to put impacts and releases on layers, or jumps on nodes."""
ON_LAYER = 1e-6
"""Share of a layer within which an event counts as on it."""
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
# Measured with up to 4.5e7 kept values and 8e6 layers. Of a node in a kept layer: displacement and
# velocity, those of the exact solution beside them. Of a layer: what the history has, its columns.
_KEPT_BYTES, _LAYER_BYTES = 32.0, 400.0


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
    solve = scene.solve
    if solve.mesh is not None:
        reasons["elements"] = f"the mesh file {solve.mesh} decides"
        return Grid()
    elements = _choose_elements(scene, method, exact, reasons)
    if not method.layered:
        reasons["dt"] = "triangles have no time steps"
        return Grid(elements)
    return layers_of(scene, method, elements, reasons)


def layers_of(scene: Scene, method: Method, elements: int, reasons: dict[str, str]) -> Grid:
    """Choose the time step on so many elements of equal travel times, with the reasons.

    Raises:
        SceneError: The time step is beyond the method's stability limit.
    """
    bar, solve = scene.bar, scene.solve
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
            f"the last time step ends at {layers * dt:g} s, the first end past the duration"
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
            reasons["elements"] = (
                f"{aligned}: its time levels hold all events, where nodes are exact"
            )
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
        "the least number from 40 on whose time levels hold all impacts and releases"
        if aligned is not None
        else f"the default; no number up to {ALIGNED[-1]} puts all events on time levels"
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
    fits = abs(courant - 1.0) <= ON_LAYER and on_layers(exact, elements)
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
    return bool(np.all(np.abs(layer - np.rint(layer)) < ON_LAYER))


def _aligned_elements(exact: ExactBar) -> int | None:
    """The least size whose layers hold all events; None if there is none."""
    return next((n for n in ALIGNED if on_layers(exact, n)), None)


def monolithic_cost(unknowns: int, iterations: int) -> tuple[float, float]:
    """Memory [MiB] and time [s] of the monolithic space-time system.

    Raises:
        SceneError: The machine has less memory.
    """
    memory = _DOLFINX_MIB + _MONOLITHIC_KIB * unknowns / 1024
    check_memory(
        memory,
        "solve.elements",
        f"{unknowns:.3g} space-time unknowns",
        'method = "galerkin", which solves the same equations step by step, or fewer elements',
    )
    return memory, unknowns * (_MONOLITHIC_SECONDS + _MONOLITHIC_PER_ITERATION * iterations)


def discontinuous_cost(triangles: int, unknowns: int) -> tuple[float, float]:
    """Memory [MiB] and time [s] of method dg on one mesh.

    Raises:
        SceneError: The machine has less memory.
    """
    memory = _BASE_MIB + _DOLFINX_MIB / 2 + _DISCONTINUOUS_KIB * unknowns / 1024
    check_memory(
        memory,
        "solve.elements",
        f"{unknowns:.3g} unknowns of space-time triangles",
        'method = "conserving" or "exact", which step in time, or fewer elements',
    )
    return memory, _LOADING_SECONDS + triangles * _TRIANGLE_SECONDS


def marching_cost(grid: Grid, every: int, passes: int) -> tuple[float, float]:
    """Memory [MiB] and time [s] of a march that keeps every so many layers.

    Raises:
        SceneError: The machine has less memory.
    """
    nodes, layers = (grid.elements or 0) + 1, grid.layers or 0
    kept = layers // every + 2
    memory = _BASE_MIB + (_KEPT_BYTES * kept * nodes + _LAYER_BYTES * layers) / 2**20
    check_memory(
        memory,
        "solve.elements",
        f"{kept:.3g} kept time levels of {nodes:.3g} nodes, of {layers:.3g} time steps,",
        f"a larger output.every ({every} now), fewer elements, or a shorter duration",
    )
    return memory, _LOADING_SECONDS + nodes * layers * passes * _SWEEP_SECONDS


def free_mib() -> float:
    """Memory that this machine has free for a run [MiB]; less if a control group allows less.

    Of several ranks that of the first one (collective): all have to plan, or refuse, alike.
    """
    page = os.sysconf("SC_PAGE_SIZE")
    found = [float(page * os.sysconf("SC_PHYS_PAGES"))]
    with suppress(OSError, ValueError, IndexError):
        text = Path("/proc/meminfo").read_text(encoding="ascii")
        found.append(1024.0 * float(text.split("MemAvailable:")[1].split()[0]))
    with suppress(OSError, ValueError):
        for line in Path("/proc/self/cgroup").read_text(encoding="utf-8").splitlines():
            _, kinds, group = line.split(":", 2)
            if kinds in {"", "memory"}:
                top = Path("/sys/fs/cgroup", kinds)
                own = top / group.lstrip("/")
                folders = (own, *own.parents)
                found += [left_in(each) for each in folders if each.is_relative_to(top)]
    free = min(found) / 2**20
    if "mpi4py.MPI" not in sys.modules:
        return free
    from impactfem.fem import MPI  # noqa: PLC0415  (loaded already)

    return float(MPI.COMM_WORLD.bcast(free))


def left_in(group: Path) -> float:
    """Bytes that a control group may take yet, by its folder; infinite if it says nothing.

    Pages of files that it holds are given back when they are needed.
    """
    for limit, used, cached in (
        ("memory.max", "memory.current", "inactive_file"),
        ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    ):
        with suppress(OSError, ValueError, IndexError):  # "max": no limit
            most, now = (
                float((group / name).read_text(encoding="ascii")) for name in (limit, used)
            )
            text = (group / "memory.stat").read_text(encoding="ascii")
            return most - now + float(text.split(f"\n{cached} ")[1].split()[0])
    return math.inf


def check_memory(needed_mib: float, key: str, what: str, remedy: str) -> None:
    """Refuse what this machine cannot hold now, before it is begun.

    Args:
        needed_mib: Memory of the run [MiB].
        key: Of the scene that decides.
        what: What needs it.
        remedy: What to give instead.

    Raises:
        SceneError: It has not so much free.
    """
    free = free_mib()
    if not needed_mib <= free:
        raise SceneError(
            f"{key}: {what} need about {needed_mib / 1024:.3g} GiB, this machine has "
            f"{free / 1024:.3g} free; use {remedy}"
        )


def off_nodes(places: NDArray[np.float64], elements: int) -> float:
    """How far places, as shares of the length, lie off nodes [lengths of elements], at most."""
    return float(np.abs(elements * places - np.round(elements * places)).max(initial=0.0))
