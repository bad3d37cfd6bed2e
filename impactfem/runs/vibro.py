"""Run points, rods and beams as the plan says: motion, history, error."""

import time
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.findings import ROTATION_LIMITS, Finding, by_limits, warning
from impactfem.log import Progress
from impactfem.methods import METHODS
from impactfem.models.vibro import VibroModel, vibro_model
from impactfem.planning import Plan, VibroNumbers
from impactfem.planning.model_limits import CODES, strain_findings
from impactfem.reference.bar import Errors, relative
from impactfem.result.history import Columns, PairMotion, make_history
from impactfem.result.shapes import as_vectors
from impactfem.result.snapshots import KeptSnapshots
from impactfem.result.table import Series, Table
from impactfem.result.trajectory import Trajectory
from impactfem.runs.line_bodies import beam_figures, body_figures
from impactfem.runs.line_probes import vibro_probes
from impactfem.runs.run import Checkpointing, Cost, Run
from impactfem.runs.tracks import Part, Track, difference, grounds, largest_way
from impactfem.runs.vibro_contact import contact_figures, impact_loss
from impactfem.scene import Scene
from impactfem.scene.rigid_keys import rotation
from impactfem.system.episode import contact_episode
from impactfem.system.generalized import LinearSystem
from impactfem.system.joined import advanced
from impactfem.vibro.integrating import INTEGRATORS
from impactfem.vibro.together import find_together

_SHIFT = 1e-9  # change of the start whose growth tells how sensitive the motion is
_ROUNDING, _RTOL = 7e-16, 1e-10  # precision of exact flights, and of an integrator's
_LOST = 1e-2  # difference from which two motions count as different
_TRACE = 1e-9  # share of the impulse of a row that is none
_LAYERS, _VALUES = 2000, 1_000_000  # layers of the fields at most; layers times nodes
_TINY = 1e-100
_PARTED = (
    "this motion stays at rest, others may leave from the same start",
    "the motion forgets its start, single trajectories mean nothing after a while",
)
_EVENTS = 200_000  # impacts up to which a reference run is made


def run(scene: Scene, chosen: Plan[VibroNumbers], progress: Progress, saved: Checkpointing) -> Run:
    """Integrate the motion of points, a rod or a beam.

    Raises:
        SceneError: The start or the settings cannot work.
        ConvergenceError: A step or an event could not be solved.
    """
    start = time.perf_counter()
    saved.refuse(scene)
    progress.step("building the system")
    model = vibro_model(scene)
    probes = vibro_probes(scene, model)
    progress.step("integrating")
    settings = settings_of(scene, chosen)
    motion = _integrate(scene, chosen, model)
    cost = Cost.since(start)
    findings: list[Finding] = []
    names = model.bodies(motion.position[:1], motion.velocity[:1])
    known = {"inertia": model.turning} if model.inertia.any() else {}
    bodies = {n: body_figures(mass, **known) for n, mass in zip(names, model.masses, strict=True)}
    together = find_together(model.system, motion, settings.resolution(scene.duration))
    if together is not None:
        findings.append(warning("impact_law", together.text(model.labels)))
    if model.beam is not None:
        turned = float(model.beam.angle(motion.position))
        text = f"the beam turns by {turned:.2g} rad, but rotations are linearised about the start"
        remedy = 'give the beam strain = "finite", or shorten the duration to the contact'
        name = model.beam.beam.name
        findings += by_limits("model_rotation", turned, ROTATION_LIMITS, text, name, remedy)
        bodies[name] = beam_figures(model.beam, motion.position, turned)
        findings += strain_findings(name, bodies[name]["strain_99"] or 0.0)
    if told := motion.effort.details.get("overconstrained"):
        text = (
            f"forces of {told['contacts']} contacts are not determined by the motion from t = "
            f"{told['time']:.6g} s on, in {told['dimension']} dimensions; the motion is"
        )
        size, remedy = float(told["dimension"]), "compare sums of forces only"
        findings.append(Finding("overconstrained", "note", text, value=size, remedy=remedy))
    errors, note, reference = None, "", None
    if chosen.numbers.estimate and motion.is_finite:
        progress.step("estimating the error by a second run")
        errors, note, reference = _estimate(scene, chosen, model, motion)
    details = dict(motion.effort.details) | {"constraints": list(model.labels)}
    if note:
        details["error_estimate"] = note
    if together is not None:
        details["together"] = {
            "count": together.count,
            "first_time": together.time,
            "constraints": [model.labels[k] for k in together.constraints],
            "angle": together.angle,
        }
    details |= _episode(scene, model, motion)
    if motion.impacts is not None and model.conservative:
        details["energy_taken"] = {"impacts": impact_loss(motion)}
    contact, found = contact_figures(motion, reference)
    findings += found
    effort = replace(
        motion.effort,
        num_unknowns=model.system.dofs,
        details=details,
        findings=tuple(findings),
        measured=("impact_law", "overconstrained", *CODES, "force_peak"),
        bodies=bodies,
    )
    for finding in findings:
        progress.message(f"{finding.severity}: {finding.sentence}")
    return Run(
        used=_as_used(scene, chosen),
        history=vibro_history(motion, model, probes(motion)),
        effort=effort,
        errors=errors,
        cost=cost,
        fields=vibro_fields(motion, model) if scene.output.fields else None,
        impacts=motion.impacts,
        contact=contact,
        conservative=model.conservative,
    )


def _as_used(scene: Scene, chosen: Plan[VibroNumbers]) -> Scene:
    """The scene with the plan's choices filled in."""
    names = ("dt", "impact_law", "estimate")
    known = {name: getattr(chosen.numbers, name) for name in names}
    return replace(scene, solve=replace(scene.solve, method=chosen.method, **known))


def vibro_fields(motion: Trajectory, model: VibroModel) -> KeptSnapshots:
    """Displacement and velocity of all nodes at some rows of the history, evenly chosen."""
    count, nodes = len(motion.times), sum(len(np.asarray(shape.points)) for shape in model.shapes)
    most = int(np.clip(_VALUES // nodes, 2, _LAYERS))
    rows = np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
    position, velocity = motion.position[rows], motion.velocity[rows]
    at_rest = np.concatenate([np.asarray(shape.points) for shape in model.shapes])
    speed = np.array([_speeds(model, u, v) for u, v in zip(position, velocity, strict=True)])
    values = {"displacement": model.places(position) - at_rest, "velocity": speed}
    shown = {name: as_vectors(given) for name, given in values.items()}
    return KeptSnapshots(motion.times[rows], model.shapes, shown)


def _speeds(model: VibroModel, u: Floats, v: Floats) -> Floats:
    """Velocities of the nodes of the shapes (nodes, dim), from position and velocity (d,)."""
    # The derivative along the motion by a step that is imaginary: exact to rounding.
    rates = model.system.coordinate_rates(u, v)
    return np.asarray(model.places(u + 1j * _TINY * rates).imag / _TINY)


def _episode(scene: Scene, model: VibroModel, motion: Trajectory) -> dict[str, Any]:
    """Apparent restitution and micro-impacts of a beam that falls freely without gravity."""
    touched = bool((motion.impulse > 0.0).any())
    if model.beam is None or not isinstance(model.system, LinearSystem) or not touched:
        return {}
    beam = model.beam.beam
    if beam.supports or beam.is_loaded or any(scene.vector_gravity.values[0]):
        return {}
    found = contact_episode(model.beam, model.system, motion)
    return {"episode": asdict(found) | {"is_over": found.is_over}}


def settings_of(scene: Scene, chosen: Plan[VibroNumbers]) -> Any:
    """Settings of the method as the plan says."""
    numbers = chosen.numbers
    tolerance, every = scene.solve.tolerance, scene.output.stride
    offered = {
        "dt": numbers.dt,
        "every": every,
        "rows": max(1, numbers.steps // every),
        "stick_speed": numbers.stick_speed,
        "impact_law": numbers.impact_law,
        "rtol": tolerance,
        "atol": None if tolerance is None else 1e-2 * tolerance,
    }
    settings = INTEGRATORS[chosen.method].settings
    known = (field.name for field in fields(settings))
    return settings(**{name: offered[name] for name in known if offered.get(name) is not None})


def _integrate(
    scene: Scene, chosen: Plan[VibroNumbers], model: VibroModel, start: Floats | None = None
) -> Trajectory:
    entry = INTEGRATORS[chosen.method]
    begin = model.position if start is None else start
    motion: Trajectory = entry.integrate(
        model.system, begin, model.velocity, scene.duration, settings_of(scene, chosen)
    )
    return motion


def _estimate(
    scene: Scene, chosen: Plan[VibroNumbers], model: VibroModel, motion: Trajectory
) -> tuple[Errors | None, str, Trajectory | None]:
    """Errors against a second run, what it says in words, and that run if its step is another."""
    if METHODS[chosen.method].locates:
        errors, note, _ = _sensitivity(scene, chosen, model, motion)
        return errors, note, None
    numbers = chosen.numbers
    located = replace(numbers, impact_law="simultaneous")
    other = replace(chosen, method="event_driven", numbers=located)
    reference, name = None, "event-driven method"
    if model.beam is None:
        try:
            reference = _integrate(scene, other, model)
        except ConvergenceError:
            reference = None
    if reference is None:
        halved = replace(numbers, dt=0.5 * numbers.dt, steps=2 * numbers.steps)
        other, name = replace(chosen, numbers=halved), "same with dt/2"
        fine = replace(scene, output=replace(scene.output, every=2 * scene.output.stride))
        reference = _integrate(fine, other, model)
        # e(dt) is the difference over 1 - 2^-p: told as for order 1, that of steps with impacts.
        found = compare(scene, model, motion, reference, f"twice the difference to the {name}")
        return found.times(2.0, 2.0), f"against the {name}", reference
    if _rests_at_first(model):  # all methods take the same one of several motions
        _, note, lost = _sensitivity(scene, other, model, reference)
        if lost:
            return None, note, reference
    return compare(scene, model, motion, reference, name), f"against the {name}", reference


def _sensitivity(
    scene: Scene, chosen: Plan[VibroNumbers], model: VibroModel, motion: Trajectory
) -> tuple[Errors | None, str, bool]:
    """Precision of the flights times the growth of a small change of the start; whether it is lost.

    The change is away from what is closed, and so finds motions that leave where this one rests.
    """
    if int(motion.effort.details.get("impacts", 0)) > _EVENTS:
        return None, f"left out: more than {_EVENTS} impacts", False
    track = _track(scene, model, motion)
    size, at = largest_way(track), model.position
    # Away from closed constraints, so that the start stays allowed.
    gradient = model.system.jacobian(at).sum(axis=0)
    way = np.linalg.solve(model.system.mass(at), gradient)
    way = way if way.any() else np.eye(model.system.dofs)[0]
    way = way / np.linalg.norm(_speeds(model, at, way), axis=1).max()
    try:
        moved = advanced(model.system, model.position, _SHIFT * size * way)
        other = _integrate(scene, chosen, model, moved)
    except (ConvergenceError, SceneError) as error:
        return None, f"left out: {error}", False
    # What hardly moves is not told by its way, which the change alone makes up.
    found = compare(scene, model, motion, other, "", least=1e3 * _SHIFT * size)
    times = motion.times[: len(other.times)]
    apart = float(np.abs(track.way(times) - _track(scene, model, other).way(times)).max())
    precision = _ROUNDING if model.is_exact else max(_ROUNDING, scene.solve.tolerance or _RTOL)
    share = precision / _SHIFT
    growth = apart / (_SHIFT * size)
    note = f"a change of the start by {_SHIFT:g} of the motion's size grows {growth:.3g}-fold"
    if found.displacement_max > _LOST:  # nor does it tell by how much rounding grows
        moves = bool(np.ptp(motion.position, axis=0).any())
        return None, f"{note}: {_PARTED[moves]}", True
    errors = Errors(
        f"own precision {precision:g} of flights, grown like a change of the start by {_SHIFT:g}",
        min(1.0, share * found.displacement_max),
        min(1.0, share * found.displacement_l2),
        min(1.0, share * found.force_l1),
    )
    return errors, note, False


def _rests_at_first(model: VibroModel) -> bool:
    """Whether something touches at the start and neither leaves nor comes."""
    gap = model.system.gap(0.0, model.position)
    rate = model.system.gap_rate(0.0, model.position, model.velocity)
    return bool(((gap == 0.0) & (rate == 0.0)).any())


def compare(
    scene: Scene, model: VibroModel, motion: Trajectory, reference: Trajectory, name: str,
    least: float = 0.0,
) -> Errors:  # fmt: skip
    """Differences of two motions with the same rows, over the way but at least over ``least`` [m].

    The force is compared by its impulse up to each time, since an impact that falls into the next
    row is no error of the force.
    """
    fine, coarse = (_track(scene, model, each) for each in (reference, motion))
    count = min(len(motion.times), len(reference.times))
    impulse, other = (np.cumsum(m.impulse[1:count], axis=0) for m in (motion, reference))
    wrong = relative(np.abs(impulse - other).sum(), np.abs(other).sum())
    name = f"{name}; force by its impulse up to each time"
    return replace(difference(fine, coarse, name, least), force_l1=wrong)


def _track(scene: Scene, model: VibroModel, motion: Trajectory) -> Track:
    """Of the nodes of the bodies, without forces: impacts are instants."""
    places = model.places(motion.position)
    speeds = _speeds(model, motion.position[0], motion.velocity[0])
    ends = np.cumsum([len(np.asarray(shape.points)) for shape in model.shapes])[:-1]
    parts, dim = [], places.shape[2]
    for shape, place, speed in zip(
        model.shapes, np.split(places, ends, axis=1), np.split(speeds, ends), strict=True
    ):
        share = 1.0 / np.sqrt(place.shape[1])
        way = share * (place - place[0]).reshape(len(place), -1)
        carried = np.zeros((3, way.shape[1]))
        carried[:dim] = share * np.tile(np.eye(dim), place.shape[1])
        first = np.pad(speed.mean(axis=0), (0, 3 - dim))
        extent = float(np.abs(place).max() + np.abs(way).max())
        parts.append(Part(shape.name, way, carried, first, extent))
    return Track(motion.times, tuple(parts), np.zeros(len(motion.times)), grounds(scene))


def vibro_history(
    motion: Trajectory, model: VibroModel, probes: Mapping[str, Mapping[str, Floats]]
) -> Table:
    """History of a motion, in the columns of the contract."""
    elastic = np.array([model.elastic(u) for u in motion.position])
    bodies = model.bodies(motion.position, motion.velocity)
    momentum, angular = np.zeros((2, len(motion.times), 3))
    for mass, body in zip(model.masses, bodies.values(), strict=True):
        momentum += mass * body.velocity
        angular += np.cross(body.position, mass * body.velocity)
        if body.spin is not None and body.turn is not None:
            angular += spun(model.inertia, body.turn, body.spin)
    struck = motion.impulse.copy()
    struck[1:] -= motion.contact_force[1:] * np.diff(motion.times)[:, None]
    struck[struck < _TRACE * motion.impulse] = 0.0
    touches = motion.gap.shape[1] > 0
    history = make_history(
        Columns(
            time=motion.times,
            gap=motion.gap.min(axis=1) if touches else np.full(len(motion.times), np.nan),
            contact_force=motion.contact_force.sum(axis=1) + 0.0,
            kinetic_energy=motion.kinetic,
            elastic_energy=elastic,
            potential_energy=motion.potential - elastic,
            momentum=momentum,
            direction=_direction(model),
            angular_momentum=angular if model.dim == 3 else angular[:, 2:],
            active=np.count_nonzero(motion.impulse > 0.0, axis=1),
            friction_work=motion.friction_work,
            bodies=bodies,
            pairs=_pairs(motion, model, struck),
            probes=probes,
        )
    )
    history["contact_impulse"] = Series(
        ("time",), struck.sum(axis=1), {"units": "N s", "long_name": "impulse of all impacts"}
    )
    history["contact_force"].attrs["comment"] = (
        "sum of the mean normal forces of lasting contact during (t_{m-1}, t_m], without impacts"
    )
    history["contact_impulse"].attrs["comment"] = "impulses of impacts during (t_{m-1}, t_m]"
    history["potential_energy"].attrs["comment"] = "potential energy of gravity and forces"
    return history


def spun(inertia: Floats, turn: Floats, spin: Floats) -> Floats:
    """Angular momentum about the centre (rows, 3) of a body with inertia (3, 3) along its axes."""
    if turn.shape[1] == 1:
        return np.pad(inertia[2, 2] * spin, ((0, 0), (2, 0)))
    turns = (rotation(q) for q in turn)
    return np.array([r @ inertia @ r.T @ w for r, w in zip(turns, spin, strict=True)])


def _pairs(motion: Trajectory, model: VibroModel, struck: Floats) -> dict[str, PairMotion]:
    """What each pair does: its constraints together."""
    found = {}
    for k, name in enumerate(model.pairs):
        own = model.pair_of == k
        found[name] = PairMotion(
            motion.contact_force[:, own].sum(axis=1), motion.gap[:, own].min(axis=1),
            impulse=struck[:, own].sum(axis=1),
        )  # fmt: skip
    return found


def _direction(model: VibroModel) -> Floats:
    """Unit vector of the first constraint on the first body, in space."""
    if not model.system.num_constraints:
        return np.array([1.0, 0.0, 0.0])
    unit = model.system.jacobian(model.position)[:1]
    body = next(iter(model.bodies(model.position[None], unit).values()))
    vector = np.asarray(body.velocity[0])
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
