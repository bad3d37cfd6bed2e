"""The plan of bodies without meshes in the march: step, estimate, what their impacts are."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from impactfem.errors import ImpactError, SceneError
from impactfem.findings import Finding, warning
from impactfem.methods import METHODS
from impactfem.planning.doubts import may_reach
from impactfem.planning.estimates import choose_estimate
from impactfem.planning.plans import Plan
from impactfem.planning.solid_costs import count_layers, on_samples
from impactfem.planning.solid_plan import (
    STARTS,
    MarchNumbers,
    few_in_words,
    joined_in_words,
    law_in_words,
)
from impactfem.planning.struck_plates import falling, struck_findings
from impactfem.planning.time_data import Datum, data_findings, parts_following, time_data
from impactfem.result.whole import Whole
from impactfem.scene import Scene
from impactfem.scene.apartness import Apartness
from impactfem.scene.couplings import WHOLE
from impactfem.scene.laws import side_of
from impactfem.scene.pairing import named_body_pairs
from impactfem.sizing import check_memory
from impactfem.system.stations import Tied

if TYPE_CHECKING:
    from impactfem.models.solids import SolidsModel
    from impactfem.system.few import FewBodies

METHOD, OF_PLACES = "moreau_jean", "conserving"
"""Chosen where what touches has mass, and where it has none."""

LOCATING = "event_driven"
"""Offered where it knows what the scene asks for."""

_LAYERS = 2000
_PER_RADIAN = 20.0  # steps of a radian of the fastest vibration
_OF_TRANSIT, _MOST_OF_TRANSIT = 200, 5000  # steps of a wave through a bar that are chosen
_OF_DENT = 100
"""Steps in a contact with a stiffness: forces to 4e-4."""
_BRAKED, _RESOLVED = 0.05, 0.25  # steps by the time in which a bar brakes a body: chosen, told
_MOST = 10_000_000
_SECONDS, _BODY_SECONDS = 6e-4, 1.2e-5  # of a layer, up to 1e-3 with friction; of a body in it
_PAIR_SECONDS = 2e-5  # of a gap, before the first layer; measured with 25 to 600 balls
_GAP_SECONDS, _BALL_SECONDS, _EDGED_SECONDS = 4e-6, 1.5e-4, 2e-4
"""Of a gap in each layer where edges, faces or axes meet, of a ball among others, and of n bodies
that are no balls, by n^(3/2): they are solved together where they touch.

Measured with 100 and 200 boxes, which have eight gaps a pair (5.6e-6 and 3.6e-6: 100 layers of 200
boxes take 61 s), with 200 and 300 balls (200 layers of 300 balls take 11 s), and with 5, 16, 25 and
49 boxes that fall on one another (2, 16, 34 and 95 ms a layer, on a machine with other work).
"""
_BASE_MIB = 240.0  # of the process with DOLFINx
_PAIR_BYTES = 2500.0  # of a gap between bodies
_ROW_BYTES = 400.0  # of a layer in the history, and as much of each body; measured with 1 and 4


def plan_few(scene: Scene) -> Plan[MarchNumbers]:
    """Choose the numbers of a march of bodies without meshes.

    Raises:
        SceneError: The settings cannot work.
    """
    from impactfem.models.solids import solids_model  # noqa: PLC0415  (loads DOLFINx)
    from impactfem.planning.damping import (  # noqa: PLC0415  (likewise)
        contact_damping_findings,
        mass_damping_findings,
    )

    solve = scene.solve
    model = solids_model(scene, (), updated=True)
    method, reasons = _method(scene, model)
    reasons |= STARTS.get(scene.start, {})
    data = time_data(scene, (), model.few)
    dt, layers = _steps(scene, model.few, data, reasons)
    if layers > _MOST:
        raise SceneError(
            f"solve.dt = {dt:g} s makes {layers:.3g} steps of duration = {scene.duration:g} s, "
            f"more than {_MOST:g}: give a larger dt or a shorter duration"
        )
    each = _SECONDS + _BODY_SECONDS * len(scene.bodies)
    each += _GAP_SECONDS * sum(met.pair.count for met in model.ball_meetings)
    meeting = {name for met in model.ball_meetings if met.single is None for name in met.names}
    each += _EDGED_SECONDS * len(meeting) ** 1.5
    each += _BALL_SECONDS * np.unique(model.crowd.pairs).size
    seconds = (each + sum(bodies.seconds for bodies in model.few)) * layers
    start = _PAIR_SECONDS * model.contact_count
    meshed = scene.meshed
    estimate = choose_estimate(
        scene, meshed, [body.least_width for body in meshed], curved=False,
        cost=lambda factor: start + seconds / factor, reasons=reasons,
    )  # fmt: skip
    if solve.estimate is None and not meshed:
        what = "elements and steps" if scene.resized else "steps"
        reasons["estimate"] = f"by runs with {what} twice and four times as long"
    if solve.method is None and _could_locate(scene):
        reasons["offer method"] = (
            f'solve.method = "{LOCATING}" locates impacts and knows this scene: its error is that '
            "of its flights, not of the order of a step"
        )
    return Plan(
        method=method,
        model=f"{few_in_words(model.few)}, {joined_in_words(model)}{law_in_words(scene)}",
        numbers=MarchNumbers(
            mesh_size=min((body.mesh_size or 0.0 for body in meshed), default=0.0),
            dt=dt,
            layers=layers,
            linear_solver="mumps",
            normals="updated",
            active_set=solve.active_set or "pdas",
            tolerance=solve.tolerance or METHODS[method].tolerance,
            max_iterations=solve.max_iterations or 200,
            contact_pairs=model.contact_count,
            unknowns=model.unknowns,
            estimate=bool(estimate.factors),
            resizing=estimate.factors,
            unresized=estimate.kept,
            whole=Whole(),
        ),
        memory_mib=_memory(scene, layers, model.contact_count),
        seconds=start + seconds + estimate.seconds,
        reasons=reasons,
        findings=(
            *law_findings(scene),
            *bar_findings(model.few, dt),
            *data_findings(data, dt, layers),
            *joint_findings(model),
            *struck_findings(model),
            *(found for body in meshed for found in mass_damping_findings(body, dt)),
            *(found for each in model.few for found in contact_damping_findings(each)),
        ),
    )


def _could_locate(scene: Scene) -> bool:
    """Whether the method that locates impacts takes the scene."""
    try:
        replace(scene, solve=replace(scene.solve, method=LOCATING))
    except ImpactError:
        return False
    return True


def _method(scene: Scene, model: "SolidsModel") -> tuple[str, dict[str, str]]:
    """The method and the reason for it.

    Raises:
        SceneError: The law of the one that is asked for acts on masses that there are not.
    """
    asked, text = scene.solve.method, "impulses on velocities, of any bodies at once"
    light = [name for bodies in model.few if bodies.massless for name in bodies.names]
    if asked == METHOD and light:
        raise SceneError(
            f'solve.method = "{asked}": what touches of {light[0]} has no mass that impulses could '
            f'act on; give "{OF_PLACES}" or "massless", or leave it out'
        )
    if light:
        text = f"what touches of {light[0]} has no mass, and energy is kept to rounding"
    if scene.gives_way and not light:
        text = "what the stiffness of contacts takes it gives back, to rounding"
    if scene.iterated:
        text = f"{scene.iterated}: energy is kept to rounding"
    chosen = ": ".join(filter(None, (scene.why_marched, text)))
    reason = "as asked" if asked is not None else chosen
    of_places = light or scene.gives_way or scene.iterated
    return asked or (OF_PLACES if of_places else METHOD), {"method": reason}


def _memory(scene: Scene, layers: int, pairs: int) -> float:
    """Estimated peak memory [MiB].

    Raises:
        SceneError: The machine has less.
    """
    rows = layers * _ROW_BYTES * (1 + len(scene.bodies))
    needed = _BASE_MIB + (rows + _PAIR_BYTES * pairs) / 2**20
    what = f"the rows of {layers:.3g} steps in the history"
    check_memory(needed, "solve.dt", what, "a larger dt or a shorter duration")
    return needed


def joint_findings(model: "SolidsModel") -> list[Finding]:
    """What joints do not determine, or compare only; what files of mechanisms have in vain."""
    from impactfem.system.mechanism import Arm  # noqa: PLC0415  (loads SciPy)

    joints = model.joints
    found = [
        Finding("robot_file", "note", f"{bodies.names[0]}: {what}", bodies.names[0])
        for bodies in model.few
        if isinstance(bodies, Arm)
        for what in bodies.left_out
    ]
    if joints is None:
        return found
    if joints.redundant:
        held = int(joints.holding.sum())
        text = (
            f"{joints.redundant} of the {held} equations of the joints follow from the others: "
            "forces and moments in joints are not unique, the least ones are reported"
        )
        found.append(Finding("overconstrained", "note", text, value=float(joints.redundant)))
    for joint in joints.joints:
        if joint.soft is not None:
            text = f"joint {joint.name} gives way by erp and cfm, which are of the step, not of it"
            remedy = "remove soft, or give stiffness and damping"
            found.append(warning("control_method", text, joint.name, remedy=remedy))
    return found


def few_step(few: Sequence["FewBodies"]) -> float:
    """Step that follows what vibrates in the bodies [s]; infinite if nothing does."""
    rates = (bodies.rate() for bodies in few)
    return min((1.0 / (_PER_RADIAN * rate) for rate in rates if rate > 0.0), default=float("inf"))


def dent_times(scene: Scene, few: Sequence["FewBodies"]) -> list[float]:
    """How long contacts with a stiffness last, of rigid bodies at their first speeds [s].

    From m d'' = -K d^p with the speed v: T = 2 (d / v) sqrt(pi) G(1 + 1/(p+1)) / G(1/2 + 1/(p+1))
    with the Gamma function G and the largest indentation d = ((p + 1) m v^2 / (2 K))^(1/(p+1)).
    """
    fall = falling(scene)
    known = {
        name: (bodies.masses[k], bodies.speeds[k])
        for bodies in few
        for k, name in enumerate(bodies.names)
    }
    lined = {body.name for body in scene.bodies if body.lined}
    faces = {bodies.names[0]: float(bodies.areas.sum()) for bodies in few}
    found = []
    for law in scene.laws.each if scene.gives_way else ():
        names = [name for name, _ in map(side_of, law.between) if name in known]
        sides, stiffness = [known[name] for name in names], law.stiffness
        if stiffness is None or not sides:
            continue
        if len(names) == 1 and names[0] in lined:  # a layer on its face
            stiffness *= faces[names[0]]
        mass = 1.0 / sum(1.0 / each[0] for each in sides)
        speeds = [each[1] for each in sides]
        speed = fall + float(np.linalg.norm(speeds[0] - (speeds[1] if len(speeds) > 1 else 0.0)))
        power = law.stiffness_exponent + 1.0
        if speed > 0.0:
            dent = (0.5 * power * mass * speed**2 / stiffness) ** (1.0 / power)
            share = math.gamma(1.0 + 1.0 / power) / math.gamma(0.5 + 1.0 / power)
            found.append(2.0 * dent / speed * math.sqrt(math.pi) * share)
    return found


def few_findings(model: "SolidsModel", reasons: dict[str, str]) -> list[Finding]:
    """What is said of bodies without meshes beside solids."""
    for part in model.parts:
        for (side, place, radius), held in part.regions.items():
            if isinstance(radius, Tied):
                continue
            of = "all" if len(held.numbers) == held.every else f"{len(held.numbers)} of"
            at = ", ".join(f"{x:.4g}" for x in place)
            text = f"the mean of {of} {held.every} nodes"
            text += "" if radius == WHOLE else f", those within {held.radius:.3g} m"
            if not held.turns:
                text = f"the displacement there, by the {held.every} nodes of its element"
            more = f": {held.why}, joint.radius gives another" if held.why else ""
            where = "" if radius == WHOLE else f" at ({at})"
            reasons[f"joint on {side}{where}"] = f"{text}{more}; they do not touch"
    tied = model.parts[0].ties.words if model.parts and model.scene.ties else {}
    for tie, words in tied.items():
        reasons[f"tie {tie}"] = words
    if not model.few:
        return joint_findings(model)
    reasons["contact points"] = (
        "contact nodes of solids are massless, so that elasticity brakes what strikes them; "
        "between bodies without meshes impacts are impulses"
    )
    from impactfem.models.ball_contacts import point_loads  # noqa: PLC0415  (loads SciPy)

    found = law_findings(model.scene) + joint_findings(model) + struck_findings(model)
    apart = Apartness.of(model.scene)
    for name, solid in sorted(set(point_loads(model))):
        if not apart.meet(name, solid):
            continue
        text = (
            f"{name} presses on single places of {solid}, which give way the more the smaller the "
            "elements are (as ln(1/h) in the plane, as 1/h in space)"
        )
        remedy = f"give {name} a radius of several elements, or model it as a solid"
        found.append(warning("contact_single_node", text, f"{name}.{solid}", remedy=remedy))
    return found


def law_findings(scene: Scene) -> list[Finding]:
    """What is not settled of the laws of impact."""
    dead = {body.name for body in scene.bodies if not (body.waves or body.attached)}
    if scene.contacts or not (dead and _strikes(scene, dead)):
        rubs = [e for e in scene.contacts if e.friction_coefficient > 0.0]
        both = [e for e in rubs if e.restitution > 0.0 and not e.tangential_restitution]
        if not both:
            return []
        text = (
            "restitution with friction: no law is settled; Moreau's is taken, restitution on "
            "normal velocities, Coulomb's cone on the impulse with the slip at its end"
        )
        return [warning("impact_law", text)]
    text = "no [[contact]] gives a restitution: 0 is taken, bodies without waves do not rebound"
    remedy = "add [[contact]] with between and restitution"
    return [warning("setting", text, remedy=remedy)]


def _strikes(scene: Scene, dead: set[str]) -> bool:
    """Whether bodies without waves may strike each other or obstacles."""
    apart = Apartness.of(scene)
    if any(may_reach(apart, name, o) for name in dead for o in scene.rigid_obstacles):
        return True
    return any(
        {one, two} <= dead and apart.meet(one, two)
        for _, (one, _), (two, _) in named_body_pairs(scene)
    )


def bar_findings(few: Sequence["FewBodies"], dt: float) -> list[Finding]:
    """What steps do not follow of the bodies that bars brake."""
    slowest = min(_braked(few), default=float("inf"))
    if dt <= _RESOLVED * slowest:
        return []
    text = f"a bar brakes the lightest body within {slowest:.2g} s, and steps are {dt:.2g} s: "
    text += "the force of its impact is not resolved"
    remedy = f"use solve.dt below {_BRAKED * slowest:.1g}"
    return [warning("contact_unresolved", text, remedy=remedy)]


def _braked(few: Sequence["FewBodies"]) -> list[float]:
    """Times m / Z in which bars brake bodies without waves [s]."""
    stiffest = max((bodies.impedance for bodies in few), default=0.0)
    masses = [mass for bodies in few if not bodies.impedance for mass in bodies.masses]
    return [mass / stiffest for mass in masses] if stiffest > 0.0 else []


def _steps(
    scene: Scene, few: Sequence["FewBodies"], data: Sequence[Datum], reasons: dict[str, str]
) -> tuple[float, int]:
    """Time step [s] and number of layers.

    Raises:
        SceneError: The step is given twice, or the history does not fit into the memory.
    """
    solve, duration = scene.solve, scene.duration
    shortest = min(bodies.transit for bodies in few)
    if solve.dt is not None and solve.elements is not None:
        raise SceneError(
            f"solve.elements = {solve.elements} makes the step of a wave through the shortest bar, "
            f"and solve.dt = {solve.dt:g} s is given too: remove one"
        )
    if solve.dt is not None or shortest == float("inf"):
        layers = max(1, round(duration / (solve.dt or _step(scene, few, reasons))))
        parts = 1 if solve.dt is not None else parts_following(data, duration, layers, reasons)
        layers = on_samples(scene, parts * layers, reasons)
        return duration / layers, layers
    # Whole layers in a transit keep the shape of waves; the last one may end past the duration.
    wanted = min([few_step(few), *(_BRAKED * time for time in _braked(few))])
    count = min(max(_OF_TRANSIT, math.ceil(shortest / wanted)), _MOST_OF_TRANSIT)
    count = solve.elements or count
    reasons["dt"] = f"{count} steps of a wave through the shortest bar, whose shape then stays"
    if solve.elements is None:
        reasons["dt"] += (
            f": {_OF_TRANSIT}, and {1.0 / _BRAKED:g} of the time in which bars brake other bodies"
        )
    dt = shortest / count
    return dt, count_layers(duration, dt)


def _step(scene: Scene, few: Sequence["FewBodies"], reasons: dict[str, str]) -> float:
    """Time step [s]."""
    even = scene.duration / _LAYERS
    reasons["dt"] = (
        f"{_LAYERS} steps, and {_PER_RADIAN:g} in a radian of the fastest vibration; impacts are "
        "not located, so that errors are of the order of the step"
    )
    lasting = min(dent_times(scene, few), default=float("inf")) / _OF_DENT
    if lasting < min(even, few_step(few)):
        reasons["dt"] = f"{_OF_DENT} steps in the shortest contact that has a stiffness, "
        reasons["dt"] += "as rigid bodies would have it at their first speeds"
    return min(even, few_step(few), lasting)
