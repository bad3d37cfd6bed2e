"""The motions of solids from the rows that their march has left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.followed_pair import FAR
from impactfem.findings import Finding, by_limits, percent
from impactfem.marching.collect import total
from impactfem.marching.model_watch import ModelWatch
from impactfem.marching.rows import Rows
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.time_loop import TimeLoop
from impactfem.marching.turning import Turning
from impactfem.models.solids import SolidPart, SolidsModel
from impactfem.planning.model_limits import CODES as MODEL_CODES
from impactfem.planning.model_limits import measured_findings
from impactfem.result.attitude import attitude
from impactfem.result.bar_motion import Effort
from impactfem.result.history import LOST, BodyMotion, Columns, PairMotion, make_history
from impactfem.result.table import Series, Table
from impactfem.result.whole import Whole
from impactfem.runs.contact_places import ContactPlaces
from impactfem.runs.forces import contact_codes, contact_findings, mesh_window
from impactfem.runs.line_bodies import few_figures
from impactfem.runs.solid_output import Watch
from impactfem.runs.solid_probes import SolidProbes
from impactfem.runs.static_start import Started
from impactfem.runs.verdict import PENETRATION_LIMITS
from impactfem.scene.pairing import named_body_pairs, self_meeting

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SolidsMotion:
    """Motions of solids at their time levels.

    Attributes:
        history: In the columns of the contract.
        effort: How the scheme got there.
        is_finite: Whether forces, energies and motions are finite.
    """

    history: Table
    effort: Effort
    is_finite: bool


def solids_motion(
    model: SolidsModel,
    scheme: SolidScheme,
    march: TimeLoop[Any],
    watch: Watch,
    limits: ModelWatch,
    limit: float | None,
    whole: Whole,
    size: float,
    probes: SolidProbes,
    touching: ContactPlaces | None,
    started: Started | None = None,
) -> SolidsMotion:
    """Make the motions of the rows of all ranks (collective).

    Args:
        model: The solids.
        scheme: What marched them.
        march: At its end, or where it failed.
        watch: What was seen of nodes without contact unknowns.
        limits: What was seen of rotations and strains.
        limit: Least stable time step [s] of an explicit scheme.
        whole: What the solids are parts of; the motions are those of the whole.
        size: Size of the elements of those that do not say it [m].
        probes: What has looked at places.
        started: How bodies that start at rest came there.
        touching: What has looked at contact forces.
    """
    if touching is not None:
        touching.sum_up()
    each = total(model.comm, march.rows.sums)
    # After a failure the last rows are empty or not finite.
    bad = ~np.isfinite(each).all(axis=(1, 2))
    done = min(march.layer + 1, int(np.argmax(bad)) if bad.any() else len(each))
    rows, each = march.rows.first(done).times(whole.factor), whole.factor * each[:done]
    together = each.sum(axis=1)
    elastic = elastic_energy(scheme, rows, together[:, 1])
    explicit = scheme.staggered
    work = work_done(march, rows, together, model.dim, explicit=explicit)
    attitudes = total(model.comm, rows.attitude)
    placed = [part.system.displacement for part in model.parts]
    level = _level(model)
    if started is not None:
        level -= float(started.fallen(model) @ model.scene.vector_gravity.at(0.0))
        placed = started.of_solids(model)
    momentum, angular, bodies = body_motions(
        model, march, each, attitudes, whole, placed, explicit=explicit
    )
    told = probes.columns(total(model.comm, rows.probes))
    history = make_history(
        Columns(
            time=march.interior.dt * np.arange(done, dtype=np.float64),
            gap=_clean(np.where(rows.gap < 0.5 * FAR, rows.gap, np.nan), model, march),
            contact_force=of_layers(scheme, rows.force) + 0.0,  # no negative zeros
            kinetic_energy=together[:, 0],
            elastic_energy=elastic,
            potential_energy=whole.factor * level - work,
            momentum=momentum,
            direction=_direction(model),
            angular_momentum=angular,
            friction_work=np.cumsum(rows.friction_work),
            active=rows.active,
            bodies=bodies,
            pairs=pair_motions(model, scheme, march, rows, whole, touching, bodies),
            probes=told,
        )
    )
    if model.few:
        history["contact_impulse"] = Series(
            ("time",), rows.impact,
            {"units": "N s", "long_name": "impulse of impacts", "comment": _IMPACTS},
        )  # fmt: skip
    if march.springs:
        history["indentation"] = Series(
            ("time",), rows.indentation,
            {"units": "m", "long_name": "largest indentation", "comment": _INDENTED},
        )  # fmt: skip
    history["potential_energy"].attrs["comment"] = "minus the work of gravity and other loads"
    finite = all(bool(np.isfinite(history[name].values).all()) for name in _MOVING) and bool(
        np.isfinite(together).all()
    )
    taken = _taken(rows, told)
    effort = _effort(model, march, rows, watch, limits, limit, whole, size, bodies, taken)
    if started is not None:
        effort = replace(
            effort,
            details={**effort.details, "start": started.details(model, whole)},
            findings=(*effort.findings, *started.findings()),
        )
    return SolidsMotion(history, effort, finite)


def _taken(rows: Rows, told: Mapping[str, Mapping[str, Floats]]) -> dict[str, float]:
    """What has taken energy, by name [J]."""
    joints = [columns[LOST][-1] for columns in told.values() if LOST in columns]
    found = {"impacts": -float(rows.impact_work.sum()), "joints": float(sum(joints))}
    return {name: energy for name, energy in found.items() if energy}


_IMPACTS = "impulses of impacts between bodies without massless nodes during (t_{m-1}, t_m]"
_INDENTED = "what the stiffness of contacts gives way, beyond which gap counts"
_MOVING = ("contact_force", "total_energy")


def _effort(
    model: SolidsModel,
    march: TimeLoop[Any],
    rows: Rows,
    watch: Watch,
    limits: ModelWatch,
    limit: float | None,
    whole: Whole,
    size: float,
    bodies: Mapping[str, BodyMotion],
    taken: Mapping[str, float],
) -> Effort:
    """How the march got there; arguments as of `solids_motion`, motions, and energy taken."""
    figures, parts = limits.figures(), model.parts
    iterations = rows.iterations[rows.iterations > 0]
    return Effort(
        num_unknowns=model.unknowns + model.contact_count,
        iterations=int(rows.iterations.max(initial=0)),
        set_changes=(int(np.abs(np.diff(rows.active)).max(initial=0)),),
        converged=not march.failure,
        message=march.failure or "every layer settled",
        details={
            "dt": march.interior.dt,
            "layers": march.layers,
            "stable_dt": limit,
            "contact_pairs": model.contact_count,
            "contact_nodes": sum(len(numbers) for numbers in model.numbers),
            "mean_iterations_in_contact": float(iterations.mean()) if len(iterations) else 0.0,
            "carriers": {" and ".join(p.names): p.names[0] for p in model.pairs},
            "friction_work": float(rows.friction_work.sum()),
            "energy_taken": taken,
            "penetration_elsewhere": watch.depth,
            "watch": watch.message,
            "overlap": watch.overlap,
            "cells": sum(part.mesh.num_cells for part in parts),
            "nodes": sum(part.mesh.num_nodes for part in parts),
            **whole.details(),
            **march.figures(),
        },
        findings=(
            *(contact_findings(rows.force, rows.largest, march.interior.dt) if parts else ()),
            *measured_findings(
                figures, {p.solid.name: p.solid.material for p in parts if p.solid.is_finite}
            ),
            *_overlap_findings(model, watch),
            *march.findings(),
            *watch.axes.findings(),
        ),
        measured=(*(contact_codes(rows.force) if parts else ()), *MODEL_CODES),
        force_window=mesh_window(
            [part.solid for part in parts], [part.degree for part in parts], size
        ),
        bodies=figures
        | {
            name: few_figures(few, body, bodies[name].turn)
            for few in model.few
            for body, name in enumerate(few.names)
            if name not in figures
        },
    )


def _clean(gap: Floats, model: SolidsModel, march: TimeLoop[Any]) -> Floats:
    """Gaps without what is but rounding of the coordinates of bodies without meshes."""
    if not model.few:
        return gap
    return np.where(np.abs(gap) <= march.tolerance, 0.0, gap)


def _overlap_findings(model: SolidsModel, watch: Watch) -> tuple[Finding, ...]:
    """Whether bodies lay in each other, though their mean gaps did not close, or in themselves."""
    share = watch.overlap / min((part.system.nodes.size for part in model.parts), default=1.0)
    text = f"bodies lie up to {watch.overlap:.2g} m in each other, {percent(share)} of the smaller"
    text += " one: gaps between bodies are means over faces"
    remedy = "take smaller elements where they meet"
    found = by_limits("penetration", share, PENETRATION_LIMITS, text, remedy=remedy)
    for name, where in watch.folds.items():
        text = f"{name} lies in itself {where}: contact of a body with itself was not asked for"
        remedy = f'give [[contact]] between = ["{name}", "{name}"]'
        if name in self_meeting(model.scene):
            text = f"{name} lies in itself {where}, by more than half a face"
            remedy = "take smaller elements where it does, and smaller steps"
        found += (Finding("penetration", "fault", text, name, remedy=remedy),)
    return found


def body_motions(
    model: SolidsModel,
    march: TimeLoop[Any],
    each: Floats,
    attitudes: Floats,
    whole: Whole,
    placed: Sequence[Floats],
    *,
    explicit: bool,
) -> tuple[Floats, Floats | None, dict[str, BodyMotion]]:
    """Momentum (rows, 3), angular momentum (rows, 1 or 3) and the motion of each body (collective).

    On a line nothing turns.

    Args:
        model: The solids.
        march: At its end.
        each: Sums of all ranks, of the whole: see `Rows.sums`, (rows, bodies, ...).
        attitudes: The same of `Rows.attitude`.
        whole: What the solids are parts of.
        placed: Displacements of the owned dofs of the solids at t = 0 [m].
        explicit: Whether velocities belong to the middle of layers.
    """
    rows, dim = len(each), model.dim
    turns = dim * (dim - 1) // 2
    momentum, angular, bodies = np.zeros((rows, 3)), np.zeros((rows, 3)), {}
    few = [(few, body) for few in model.few for body in range(len(few.names))]
    for k, ((name, (part_mass, centre)), inertia) in enumerate(
        zip(model.masses.items(), march.interior.inertia(), strict=True)
    ):
        part = model.parts[k] if k < len(model.parts) else None
        mass = whole.factor * part_mass
        own, position, spun = np.zeros((3, rows, 3))
        position[:, :dim] = whole.mean_place(centre + each[:, k, 3 + dim : 3 + 2 * dim] / mass)
        own[:, :dim] = whole.mean(each[:, k, 3 : 3 + dim])
        if part is not None and part.system.axisymmetric:
            position[:, 0] = own[:, 0] = 0.0  # what goes out on one side goes out on the other, too
        spun[:, 3 - turns :] = each[:, k, 3 + 2 * dim :]
        spun = whole.mean_turn(spun)
        momentum += own
        angular += np.cross(position, own) + spun
        turn = spin = None
        if inertia.any() and (part is None or _turns_freely(part, whole)):
            # What is cut is symmetric: it has no products of inertia.
            moment = whole.factor * (np.diag(np.diag(inertia)) if whole.planes else inertia)
            spin = np.linalg.solve(moment, spun[:, 3 - turns :].T).T
            each_layer = spin[1:] if explicit else 0.5 * (spin[1:] + spin[:-1])
            if part is None:
                bodies_of, body = few[k - len(model.parts)]
                start = np.full(turns, bodies_of.angles[body])
            else:
                start = _turned_at_start(part, placed[k])
            turn = _rotation(np.vstack([start, march.interior.dt * each_layer]))
        elif attitudes[:, k].any() and (part is None or _turns_freely(part, whole)):
            turn, spin = attitude(attitudes[:, k], spun[:, 3 - turns :], whole)
            if part is None and turns == 1:  # counted from the angle at t = 0 on
                bodies_of, body = few[k - len(model.parts)]
                whole_turns = np.round((bodies_of.angles[body] - turn[0]) / (2.0 * np.pi))
                turn = turn + 2.0 * np.pi * whole_turns
        bodies[name] = BodyMotion(position, own / mass, turn, spin)
    told = angular[:, 3 - turns :] if turns else None
    return momentum, told, {b.name: bodies[b.name] for b in model.scene.bodies}


def _turns_freely(part: SolidPart, whole: Whole) -> bool:
    """Whether nothing holds a body but planes that cut it from a whole; an axis does."""
    planes = part.system.supports.planes
    cuts = {axis for axis, _ in planes} <= set(whole.levels)
    return cuts and len(part.solid.all_supports) == len(planes) and not part.solid.is_axisymmetric


def _turned_at_start(part: SolidPart, placed: Floats) -> Floats:
    """Rotation of a solid at t = 0 since the undeformed body, (1,) or (3,) (collective).

    It is the one that fits the displacements best, by mass and for small angles, and so is its sum
    with the spins: a scheme's displacements are the sums of its velocities.
    """
    system = part.system
    mass = np.repeat(system.node_mass, system.dim)
    turning = Turning.of(system, lambda velocity: mass * velocity)
    moved = total(system.comm, turning.rows @ (mass * placed))
    return np.asarray(np.linalg.solve(turning.inertia, moved))


def _rotation(steps: Floats) -> Floats:
    """Rotations as `BodyMotion` has them, of the first one and its changes, (rows, 1 or 3)."""
    angle = np.cumsum(steps, axis=0)
    if angle.shape[1] == 1:
        return np.asarray(angle)
    size = np.linalg.norm(angle, axis=1, keepdims=True)
    # sin(a/2)/a by way of sinc, which knows a = 0.
    return np.hstack([np.cos(0.5 * size), 0.5 * np.sinc(0.5 * size / np.pi) * angle])


def pair_motions(
    model: SolidsModel,
    scheme: SolidScheme,
    march: TimeLoop[Any],
    rows: Rows,
    whole: Whole,
    touching: ContactPlaces | None,
    bodies: Mapping[str, BodyMotion],
) -> dict[str, PairMotion]:
    """What each pair does; arguments as of `solids_motion`, and the motions of the bodies."""
    if not march.pairs:
        return {}
    # Forces are those on the carrier, columns those on the first body of the pair.
    first = {name: one for name, (one, _), _ in named_body_pairs(model.scene)}
    turned = {pair.label for pair in model.pairs if pair.names[0] != first[pair.label]}
    turned |= {
        met.label for met in model.ball_meetings if met.carrier != first.get(met.label, met.carrier)
    }
    force = of_layers(scheme, rows.pair_force)
    all_forces = of_layers(scheme, rows.pair_force + rows.pair_impact / march.interior.dt)
    place, moments = of_layers(scheme, rows.place), of_layers(scheme, rows.moment)
    revolved = any(part.system.axisymmetric for part in model.parts)
    open_ = ~(rows.pair_gap < 0.5 * FAR)
    gap = np.where(open_, np.nan, rows.pair_gap)
    found = {}
    for k, name in enumerate(march.pairs):
        tangential = slip = None
        if rows.slip.shape[1]:
            # Images slide the other way along their tangents: in the plane they cancel.
            tangential = of_layers(scheme, rows.tangential[:, k])
            slip = np.cumsum(rows.slip[:, k])
            if tangential.shape[1] > 1:
                tangential = whole.mean(-tangential if name in turned else tangential)
            elif whole.planes:
                tangential, slip = np.zeros_like(tangential), np.zeros_like(slip)
        impulse = rows.pair_impact[:, k] if model.few else None
        center = moment = None
        if touching is not None:
            body = bodies[model.names[touching.first[k]]].position[:, : model.dim]
            center = touching.course(k, all_forces[:, k], place[:, k], whole, body)
            center[:, :1] *= not revolved  # what acts on one side acts on the other, too
            padding = 3 - moments.shape[2]
            moment = np.pad(moments[:, k], ((0, 0), (padding, 0)))
            moment = whole.mean_turn(moment)[:, padding:]
        found[name] = PairMotion(force[:, k], gap[:, k], tangential, slip, impulse, center, moment)
    return found


def elastic_energy(scheme: SolidScheme, rows: Rows, elastic: Floats) -> Floats:
    """Elastic energy of each layer [J], (rows,).

    Args:
        scheme: What has marched.
        rows: As the march has left them.
        elastic: Sums of the elastic energy [J], without that of contact for explicit schemes.
    """
    energy = elastic + rows.spring_energy
    if scheme.massless and scheme.staggered:
        contact = rows.contact_energy
        energy[1:] += 0.5 * (contact[1:] + contact[:-1])
        energy[0] += contact[0]
    return energy


def of_layers(scheme: SolidScheme, forces: Floats) -> Floats:
    """Contact forces of each layer [N], of those that the march has left, (rows, ...)."""
    found = forces.copy()
    if scheme.massless and scheme.staggered:
        # The force found for a layer acts at its start: a layer has the mean of both its ends.
        found[1:-1] = 0.5 * (forces[1:-1] + forces[2:])
    return found


def work_done(
    march: TimeLoop[Any], rows: Rows, sums: Floats, dim: int, *, explicit: bool
) -> Floats:
    """Work of gravity, loads and moved obstacles up to each layer [J], as the scheme does it.

    Args:
        march: At its end.
        rows: As the march has left them, of the whole.
        sums: Of all ranks and bodies, as `Rows.sums` has them, (rows, ...).
        dim: Number of directions.
        explicit: Whether energies belong to the middle of layers.
    """
    step = np.diff(sums[:, 3 + dim : 3 + 2 * dim], axis=0)  # mass times way
    layers = range(len(sums) - 1)
    gravity = np.array([march.interior.gravity(layer) for layer in layers]).reshape(step.shape)
    if explicit:  # energies belong to the middle of layers: half of each neighbouring step
        step = 0.5 * (step + np.vstack([np.zeros_like(step[:1]), step[:-1]]))
    pulled = np.einsum("ij,ij->i", gravity, step)
    done = np.zeros(len(sums))
    done[1:] = np.cumsum(pulled + sums[1:, 2] + rows.obstacle_work[1 : len(sums)])
    return done


def _level(model: SolidsModel) -> float:
    """Potential of gravity at t = 0: 0 where bodies would begin to touch their obstacles [J]."""
    level, gravity = 0.0, model.scene.vector_gravity.at(0.0)
    for part in model.parts:
        if part.contact is not None and part.contact.count:
            nearest = int(np.argmin(part.contact.gap))
            towards = -float(gravity @ part.contact.normal[nearest])
            height = float(part.contact.gap[nearest])
            level += part.system.total_mass * max(0.0, towards) * height
    return level


def _direction(model: SolidsModel) -> Floats:
    """Unit vector along which momentum is told: its largest component is positive.

    Of one body the normal of the obstacle that is nearest to it, whatever its sign. Of several that
    of the first one's approach to the second; of gravity, if they start alike; else the line of
    their centres.
    """
    dim, way = model.dim, np.zeros(3)
    if len(model.names) == len(model.parts) == 1:
        contact = model.parts[0].contact
        if contact is None or not contact.count:
            return np.array([0.0, 1.0, 0.0])
        way[:dim] = contact.normal[int(np.argmin(contact.gap))]
        return way
    speeds, (_, places) = model.speeds, zip(*model.masses.values(), strict=True)
    approach = speeds[0] - (speeds[1] if len(speeds) > 1 else 0.0)
    if np.linalg.norm(approach) <= 1e-12 * np.abs(speeds).max():
        approach = np.zeros(dim)  # rounding
    for candidate in (
        approach,
        np.asarray(model.scene.vector_gravity.at(0.0)),
        places[0] - places[-1],
    ):
        way[:dim] = candidate[:dim]
        length = float(np.linalg.norm(way))
        if length > 0.0:
            way /= length
            way[np.abs(way) < 1e-9] = 0.0
            way *= np.sign(way[np.argmax(np.abs(way))])
            return way + 0.0
    return np.array([1.0, 0.0, 0.0])
