"""The plan of a bar: the least model and method that it needs, with the reasons."""

from dataclasses import dataclass

from impactfem.exact import ExactBar
from impactfem.findings import Finding, warning
from impactfem.methods import METHODS
from impactfem.planning.bar_costs import cost_of_bar
from impactfem.planning.card import Foresees
from impactfem.planning.doubts import doubts_of_bar
from impactfem.reference.bar import exact_bar
from impactfem.scene import Scene
from impactfem.sizing import (
    DEFAULT_ELEMENTS,
    Grid,
    choose_grid,
    fitting_pays,
    on_its_own_mesh,
    on_layers,
)

_NEARLY_ONE = 1.0 - 1e-9


@dataclass(frozen=True, repr=False)
class Plan(Foresees):
    """What will be modelled and how.

    Attributes:
        method: Name as in `impactfem methods`.
        model: The model in words.
        elements: Elements along the bar; None if a mesh file decides.
        layers: Time layers; None if a mesh file decides or there are none.
        dt: Time step [s]; None as for the layers.
        courant: c dt / h; None as for the layers.
        window: Layers solved by one active-set loop, or "all".
        degree: Polynomial degree of method dg; None for the others.
        fitted: Whether events and characteristics become mesh lines (dg); None for the others.
        active_set: Solver of the contact conditions.
        gamma: Dimensionless merit constant.
        tolerance: Relative rounding level of the merit.
        max_iterations: Limit of linear solves of one active-set loop.
        contact_pairs: Complementarity pairs; None as for the unknowns, and if there are none.
        unknowns: Number of unknowns; None if only the run decides (accuracy of dg).
        memory_mib: Estimated peak memory [MiB]; None if not known beforehand.
        seconds: Estimated time [s] on a 2-core machine; None if not known beforehand.
        reasons: Why each choice was made, by key.
    """

    method: str
    model: str
    elements: int | None
    layers: int | None
    dt: float | None
    courant: float | None
    window: int | str
    degree: int | None
    fitted: bool | None
    active_set: str
    gamma: float
    tolerance: float
    max_iterations: int
    contact_pairs: int | None
    unknowns: int | None
    memory_mib: float | None
    seconds: float | None
    reasons: dict[str, str]


def plan_bar(scene: Scene) -> Plan:
    """Choose method and numbers for the bar of a scene; nothing is solved but the exact events.

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
    """
    bar, solve = scene.bar, scene.solve
    exact = exact_bar(scene)
    reasons = {
        "model": "one homogeneous bar that moves along its axis: nothing in the scene bends it or "
        "varies across it; one contact point, frictionless",
    }
    if scene.mesh_path is not None:
        from impactfem.fem import MPI, on_root  # noqa: PLC0415  (loads slowly)
        from impactfem.mesh.files import told  # noqa: PLC0415

        path = scene.mesh_path
        reasons["mesh"] = on_root(MPI.COMM_WORLD, lambda: told(path))
    name = _choose_method(scene, exact, reasons)
    method = METHODS[name]
    fitted = fitting_pays(scene, exact) if solve.fitted is None else solve.fitted
    grid = choose_grid(scene, method, exact, reasons)
    window, iterations = _choose_window(scene, name, exact, grid, reasons)
    degree = 1 if solve.degree is None else solve.degree
    cost = cost_of_bar(scene, method, grid, degree, iterations)
    return Plan(
        method=name,
        model=f"elastic bar in 1D, far end {bar.far_end}, rigid wall at its near end",
        elements=grid.elements,
        layers=grid.layers,
        dt=grid.dt,
        courant=grid.courant,
        window=window,
        degree=degree if method.family == "dg" else None,
        fitted=None if method.family != "dg" else fitted,
        active_set="none" if method.family == "exact" else solve.active_set or "pdas",
        gamma=solve.gamma or 1.0,
        tolerance=solve.tolerance or (1e-13 if method.family == "marching" else 1e-10),
        max_iterations=solve.max_iterations or 3 * iterations + 50,
        contact_pairs=cost.contact_pairs,
        unknowns=cost.unknowns,
        memory_mib=cost.memory_mib,
        seconds=cost.seconds,
        reasons=reasons,
        findings=(*_findings(name, grid, exact), *doubts_of_bar(scene, exact)),
    )


def _choose_method(scene: Scene, exact: ExactBar, reasons: dict[str, str]) -> str:
    """As asked, else the first whose condition holds."""
    solve = scene.solve
    sampling = f" and the sampling of the initial state on {exact.pieces} pieces" * exact.sampled
    choices = (
        (solve.method is not None, solve.method or "", "as asked"),
        (
            solve.active_set == "snes_vi",
            "monolithic",
            "SNES VI needs the assembled space-time system",
        ),
        (
            solve.degree is not None or bool(solve.fitted),
            "dg",
            "solve.degree and solve.fitted belong to it",
        ),
        (solve.mesh is not None, "dg", "works on any triangles; galerkin needs layers"),
        (
            solve.accuracy is not None and exact.exact_until >= scene.duration,
            "exact",
            (
                "a homogeneous bar: in the standing studies no discretisation is as accurate at "
                f"any cost, its error is rounding{sampling}"
            ),
        ),
        (
            on_its_own_mesh(scene, exact),
            "galerkin",
            "exact at the nodes: courant 1 and all events on layers",
        ),
        (
            fitting_pays(scene, exact),
            "dg",
            (
                "events fall between layers: on a mesh fitted to them and their characteristics "
                "the error is rounding (150 random scenes with up to ten contacts: 8e-12)"
            ),
        ),
        (
            True,
            "conserving",
            (
                "events fall between layers or courant is not 1: there galerkin rings or loses "
                "energy; this one keeps it to rounding, with a quarter of the error"
            ),
        ),
    )
    name, reasons["method"] = next((name, why) for holds, name, why in choices if holds)
    return name


def _choose_window(
    scene: Scene, name: str, exact: ExactBar, grid: Grid, reasons: dict[str, str]
) -> tuple[int | str, int]:
    """Window of the active-set loop, and the number of linear solves to expect."""
    impacts = len(exact.contacts)
    family = METHODS[name].family
    # In one loop over several impacts their layers settle one impact after the other.
    several = impacts * (grid.elements or DEFAULT_ELEMENTS)
    everything = 3 if impacts <= 1 else several
    if family == "monolithic":
        reasons["active_set"] = (
            f"one loop for {impacts} contact interval{'s' if impacts != 1 else ''}: about "
            + ("3 linear solves" if impacts <= 1 else f"{several // impacts} to {2 * several}")
        )
        return "all", everything
    if name not in {"galerkin", "dg"}:
        return 1, 1
    window = scene.solve.window or 1
    if window == 1:
        what = "edge of the wall" if family == "dg" else "layer"
        reasons["window"] = f"1: each {what} is a scalar complementarity problem, no iteration"
        return 1, 1
    reasons["window"] = "as asked"
    return window, everything if window == "all" else 3


def _findings(name: str, grid: Grid, exact: ExactBar) -> tuple[Finding, ...]:
    """What the user should know before trusting the answer."""
    if name == "newmark":
        text = "newmark is a negative control: its energy grows at every impact"
        return (warning("control_method", text),)
    if name not in {"galerkin", "monolithic"} or grid.courant is None or grid.elements is None:
        return ()
    if grid.courant < _NEARLY_ONE:
        ringing = "the contact force of this method rings (overshoot up to 4 times)"
        text = f"courant = {grid.courant:g} < 1: {ringing}"
        return (warning("ringing", text, remedy='method = "conserving" does not'),)
    if not on_layers(exact, grid.elements):
        text = "an impact or release lies between layers: errors of first order in h"
        return (Finding("error_large", "note", text),)
    return ()
