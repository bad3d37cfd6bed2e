"""The plan of points, rods and beams in the march: step, estimate, what their impacts are."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from impactfem.errors import SceneError
from impactfem.findings import Finding, warning
from impactfem.methods import METHODS
from impactfem.planning.estimates import choose_estimate
from impactfem.planning.plans import Plan
from impactfem.planning.solid_costs import physical_mib
from impactfem.planning.solid_plan import MarchNumbers, law_in_words
from impactfem.result.whole import Whole
from impactfem.scene import Scene

if TYPE_CHECKING:
    from impactfem.models.solids import SolidsModel
    from impactfem.system.few import FewBodies

METHOD = "moreau_jean"
_LAYERS = 2000
_PER_RADIAN = 20.0  # steps of a radian of the fastest vibration
_OF_BENDING = 5.0  # a beam's modes up to about the second are followed like a vibration
_MOST = 10_000_000
_SECONDS = 3e-4  # of a layer
_BASE_MIB = 240.0  # of the process with DOLFINx
_ROW_BYTES = 400.0  # of a layer in the history, and as much of each body; measured with 1 and 4


def plan_few(scene: Scene) -> Plan[MarchNumbers]:
    """Choose the numbers of a march of bodies without meshes.

    Raises:
        SceneError: The settings cannot work.
    """
    from impactfem.models.solids import solids_model  # noqa: PLC0415  (loads DOLFINx)

    solve = scene.solve
    reasons = {"method": f"{scene.why_marched}: impulses on velocities, of any bodies at once"}
    if solve.method is not None:
        reasons["method"] = "as asked"
    model = solids_model(scene, (), updated=True)
    dt = solve.dt or _step(model, reasons)
    layers = max(1, round(scene.duration / dt))
    if layers > _MOST:
        raise SceneError(
            f"solve.dt = {dt:g} s makes {layers:.3g} steps of duration = {scene.duration:g} s, "
            f"more than {_MOST:g}: give a larger dt or a shorter duration"
        )
    seconds = _SECONDS * layers
    estimate, more = choose_estimate(
        scene, (), (), curved=False, cost=lambda factor: seconds / factor, reasons=reasons
    )
    if solve.estimate is None:
        reasons["estimate"] = "by runs with steps twice and four times as long"
    return Plan(
        method=solve.method or METHOD,
        model=f"{few_in_words(model.few)}, {law_in_words(scene)}",
        numbers=MarchNumbers(
            degree=0,
            degrees=(),
            cells="none",
            mesh_size=0.0,
            dt=scene.duration / layers,
            courant=None,
            layers=layers,
            linear_solver="mumps",
            normals="updated",
            active_set=solve.active_set or "pdas",
            tolerance=solve.tolerance or METHODS[METHOD].tolerance,
            max_iterations=solve.max_iterations or 200,
            contact_pairs=model.contact_count,
            unknowns=model.unknowns,
            estimate=estimate,
            whole=Whole(),
        ),
        memory_mib=_memory(scene, layers),
        seconds=seconds + more,
        reasons=reasons,
        findings=tuple(law_findings(scene)),
    )


def _memory(scene: Scene, layers: int) -> float:
    """Estimated peak memory [MiB].

    Raises:
        SceneError: The machine has less.
    """
    needed = _BASE_MIB + layers * _ROW_BYTES * (1 + len(scene.bodies)) / 2**20
    if needed > physical_mib():
        raise SceneError(
            f"solve.dt: the history of {layers:.3g} steps needs about {needed / 1024:.3g} GiB, "
            f"this machine has {physical_mib() / 1024:.3g}; give a larger dt or a shorter duration"
        )
    return needed


def few_in_words(few: Sequence["FewBodies"]) -> str:
    """What the bodies are, in words."""
    return ", ".join(bodies.words for bodies in few)


def few_step(few: Sequence["FewBodies"]) -> float:
    """Step that follows what vibrates in the bodies [s]; infinite if nothing does."""
    from impactfem.vibro.position_start import highest_frequency  # noqa: PLC0415  (SciPy)

    steps = [float("inf")]
    for bodies in few:
        if bodies.beam is None:
            rate = highest_frequency(bodies.system, bodies.position, bodies.velocity)
        else:  # no step has to follow the fastest of a beam
            rate = _OF_BENDING * bodies.beam.beam.first_frequency
        steps += [1.0 / (_PER_RADIAN * rate)] if rate > 0.0 else []
    return min(steps)


def few_findings(model: "SolidsModel", reasons: dict[str, str]) -> list[Finding]:
    """What is said of bodies without meshes beside solids."""
    if not model.few:
        return []
    reasons["contact points"] = (
        "contact nodes of solids are massless, so that elasticity brakes what strikes them; "
        "between bodies without meshes impacts are impulses"
    )
    from impactfem.models.ball_contacts import point_loads  # noqa: PLC0415  (loads SciPy)

    found = law_findings(model.scene)
    for name, solid in sorted(set(point_loads(model))):
        text = (
            f"{name} presses on single places of {solid}, which give way the more the smaller the "
            "elements are (as ln(1/h) in the plane, as 1/h in space)"
        )
        remedy = f"give {name} a radius of several elements, or model it as a solid"
        found.append(warning("contact_single_node", text, f"{name}.{solid}", remedy=remedy))
    return found


def law_findings(scene: Scene) -> list[Finding]:
    """What is not settled of the laws of impact."""
    if scene.contacts or scene.solids:
        lively = any(law.restitution > 0.0 for law in scene.contacts)
        rubs = any(law.friction_coefficient > 0.0 for law in scene.contacts)
        if not (lively and rubs):
            return []
        text = (
            "restitution with friction: no law is settled; Moreau's is taken, restitution on "
            "normal velocities, Coulomb's cone on the impulse with the slip at its end"
        )
        return [warning("impact_law", text)]
    text = "no [[contact]] gives a restitution: 0 is taken, bodies without waves do not rebound"
    remedy = "add [[contact]] with between and restitution"
    return [warning("setting", text, remedy=remedy)]


def _step(model: "SolidsModel", reasons: dict[str, str]) -> float:
    """Time step [s]."""
    even = model.scene.duration / _LAYERS
    reasons["dt"] = (
        f"{_LAYERS} steps, and {_PER_RADIAN:g} in a radian of the fastest vibration; impacts are "
        "not located, so that errors are of the order of the step"
    )
    return min(even, few_step(model.few))
