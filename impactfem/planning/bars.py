"""The plan of a bar: the least model and method that it needs, with the reasons."""

from dataclasses import dataclass
from typing import Any, override

from impactfem.exact import ExactBar
from impactfem.findings import Finding, warning
from impactfem.methods import METHODS, Method
from impactfem.planning.bar_costs import cost_of_bar
from impactfem.planning.bar_errors import (
    EXACT,
    predicted_error,
    rounding_findings,
    rounding_of_galerkin,
)
from impactfem.planning.doubts import doubts_of_bar
from impactfem.planning.plans import Numbers, Plan, cost_rows
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

OFF_LAYERS = "conserving"
"""Method where layers are asked for and events fall between them."""


@dataclass(frozen=True, kw_only=True)
class BarNumbers(Numbers):
    """Numbers of the run of one bar.

    Attributes:
        elements: Elements along the bar; None if a mesh file decides.
        layers: Time steps; None if a mesh file decides or there are none.
        dt: Time step [s]; None as for the time steps.
        courant: c dt / h; None as for the time steps.
        window: Time steps solved by one active-set loop, or "all".
        degree: Polynomial degree of method dg; None for the others.
        fitted: Whether events and characteristics become mesh lines (dg); None for the others.
        active_set: Solver of the contact conditions.
        gamma: Dimensionless merit constant.
        tolerance: Relative rounding level of the merit.
        max_iterations: Limit of linear solves of one active-set loop.
        contact_pairs: Complementarity pairs; None as for the unknowns, and if there are none.
        unknowns: Number of unknowns; None if only the run decides (accuracy of dg).
    """

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

    @override
    def rows(self, plan: Plan[Any]) -> list[tuple[str, str]]:
        found = [
            (name, "from the mesh file" if value is None else str(value))
            for name, value in (("elements", self.elements), ("time steps", self.layers))
        ]
        if self.dt is not None and self.courant is not None:
            found.append(("dt", f"{self.dt:g} s (courant {self.courant:g})"))
        if self.degree is not None:
            fitted = "fitted to" if self.fitted else "not fitted to"
            found.append(("mesh", f"P{self.degree}, {fitted} events"))
        if not METHODS[plan.method].exact:
            numbers = f"gamma {self.gamma:g}, tolerance {self.tolerance:g}"
            limit = f"at most {self.max_iterations} iterations"
            found += [
                ("window", str(self.window)),
                ("active set", f"{self.active_set}, {numbers}, {limit}"),
            ]
            if self.unknowns is not None:
                found.append(("unknowns", f"{self.unknowns} ({self.contact_pairs} contact pairs)"))
        return found + cost_rows(plan)


def plan_bar(scene: Scene) -> Plan[BarNumbers]:
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
    window, iterations = _choose_window(scene, method, exact, grid, reasons)
    degree = 1 if solve.degree is None else solve.degree
    cost = cost_of_bar(scene, method, grid, degree, iterations)
    predicted = predicted_error(scene, exact, name, grid, fitted=fitted)
    own = method.stable == "limited" and on_its_own_mesh(scene, exact) == grid.elements
    by_rounding = predicted is not None and (own or method.exact)
    end = "driven" if bar.is_driven else bar.far_end
    grown = rounding_findings(predicted or 0.0, "will grow") if by_rounding else ()
    return Plan(
        method=name,
        model=f"elastic bar in 1D, far end {end}, rigid wall at its near end",
        numbers=BarNumbers(
            elements=grid.elements,
            layers=grid.layers,
            dt=grid.dt,
            courant=grid.courant,
            window=window,
            degree=None if method.layered else degree,
            fitted=None if method.layered else fitted,
            active_set="none" if method.exact else solve.active_set or "pdas",
            gamma=solve.gamma or 1.0,
            tolerance=solve.tolerance or method.tolerance,
            max_iterations=solve.max_iterations or 3 * iterations + 50,
            contact_pairs=cost.contact_pairs,
            unknowns=cost.unknowns,
        ),
        memory_mib=cost.memory_mib,
        seconds=cost.seconds,
        predicted_error=predicted,
        reasons=reasons,
        findings=(*_findings(name, grid, exact), *grown, *doubts_of_bar(scene, exact)),
    )


def _choose_method(scene: Scene, exact: ExactBar, reasons: dict[str, str]) -> str:
    """As asked, else the first whose condition holds."""
    solve = scene.solve
    fits = on_its_own_mesh(scene, exact) is not None
    rounding = rounding_of_galerkin(exact) if fits else None
    layers_asked = any(key is not None for key in (solve.courant, solve.dt, solve.window))
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
        (solve.mesh is not None, "dg", "works on any triangles; galerkin needs time levels"),
        (
            solve.accuracy is not None,
            "exact",
            (
                "a homogeneous bar: in the standing studies no discretisation is as accurate at "
                "any cost"
            ),
        ),
        (
            rounding is not None and (rounding <= EXACT or solve.window is not None),
            "galerkin",
            (
                "exact at the nodes: courant 1, all contacts and changes of gravity on time "
                f"levels; rounding, grown from contact to contact, stays near {rounding or 0.0:.0e}"
            ),
        ),
        (
            rounding is not None,
            "exact",
            (
                "all events are on time levels, but from contact to contact galerkin's rounding "
                f"would grow to {rounding or 0.0:.0e}; the characteristics of a homogeneous bar do "
                "not have that"
            ),
        ),
        (
            solve.elements is None and not layers_asked,
            "exact",
            (
                "a homogeneous bar whose events fall between time levels or whose initial state is "
                "curved: the characteristics follow its motion to rounding, no mesh does for less"
            ),
        ),
        (
            True,
            OFF_LAYERS,
            (
                "elements, courant, dt or window ask for time steps, and events fall inside them "
                "or courant is not 1: there galerkin rings or loses energy; this one keeps it to "
                "rounding, with a quarter of the error"
            ),
        ),
    )
    name, reasons["method"] = next((name, why) for holds, name, why in choices if holds)
    return name


def _choose_window(
    scene: Scene, method: Method, exact: ExactBar, grid: Grid, reasons: dict[str, str]
) -> tuple[int | str, int]:
    """Window of the active-set loop, and the number of linear solves to expect."""
    impacts = len(exact.contacts)
    # In one loop over several impacts their layers settle one impact after the other.
    several = impacts * (grid.elements or DEFAULT_ELEMENTS)
    everything = 3 if impacts <= 1 else several
    if method.assembled:
        reasons["active_set"] = (
            f"one loop for {impacts} contact interval{'s' if impacts != 1 else ''}: about "
            + ("3 linear solves" if impacts <= 1 else f"{several // impacts} to {2 * several}")
        )
        return "all", everything
    if not method.windowed:
        return 1, 1
    window = scene.solve.window or 1
    if window == 1:
        what = "time step" if method.layered else "edge of the wall"
        reasons["window"] = f"1: each {what} is a scalar complementarity problem, no iteration"
        return 1, 1
    reasons["window"] = "as asked"
    return window, everything if window == "all" else 3


def _findings(name: str, grid: Grid, exact: ExactBar) -> tuple[Finding, ...]:
    """What the user should know before trusting the answer."""
    method = METHODS[name]
    if method.grows:
        text = f"{name} is a negative control: its energy grows at every impact"
        return (warning("control_method", text),)
    if method.stable != "limited" or grid.courant is None or grid.elements is None:
        return ()
    if found := ringing(grid, 'method = "conserving" does not'):
        return found
    if not on_layers(exact, grid.elements):
        text = (
            "an impact, a release or a change of gravity lies between time levels: errors of first "
        )
        text += "order in h"
        return (Finding("error_large", "note", text),)
    return ()


def ringing(grid: Grid, remedy: str) -> tuple[Finding, ...]:
    """That contact forces of galerkin ring below courant 1."""
    if grid.courant is None or grid.courant >= _NEARLY_ONE:
        return ()
    text = "the contact force of this method rings (overshoot up to 4 times)"
    return (warning("ringing", f"courant = {grid.courant:g} < 1: {text}", remedy=remedy),)
