"""The motions of solids from the rows that their march has left."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.followed_pair import FAR
from impactfem.findings import Finding, by_limits, percent
from impactfem.marching.collect import total
from impactfem.marching.rows import Rows
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.time_loop import TimeLoop
from impactfem.models.solids import SolidsModel
from impactfem.planning.model_limits import CODES as MODEL_CODES
from impactfem.planning.model_limits import measured_findings
from impactfem.planning.struck_plates import ringing
from impactfem.planning.time_data import DATA_CODES, data_findings, time_data
from impactfem.result.bar_motion import Effort
from impactfem.result.history import LOST, BodyMotion, Columns, PairMotion, make_history
from impactfem.result.table import Series, Table
from impactfem.runs.accelerations import accelerated
from impactfem.runs.forces import contact_codes, contact_findings, mesh_window
from impactfem.runs.line_bodies import few_figures
from impactfem.runs.observed import Observed
from impactfem.runs.samples import Places
from impactfem.runs.scales import opening_findings, rounding_energy
from impactfem.runs.solid_bodies import body_motions, momentum_direction
from impactfem.runs.solid_energies import (
    elastic_energy,
    inertia_findings,
    level_at_start,
    work_done,
)
from impactfem.runs.solid_output import Watch
from impactfem.runs.verdict import PENETRATION_LIMITS
from impactfem.scene.pairing import named_body_pairs, self_meeting


@dataclass(frozen=True)
class SolidsMotion:
    """Motions of solids at their time levels.

    Attributes:
        history: In the columns of the contract.
        effort: How the scheme got there.
        is_finite: Whether forces, energies and motions are finite.
        places: What was kept of the bodies for runs on other elements.
        moved: Displacements there in every row [m], (rows, places, dim), by the same names.
    """

    history: Table
    effort: Effort
    is_finite: bool
    places: Places
    moved: Mapping[str, Floats]


def solids_motion(seen: Observed) -> SolidsMotion:
    """Make the motions of the rows of all ranks, of a march that ended or failed (collective)."""
    model, scheme, march, whole = seen.model, seen.scheme, seen.march, seen.whole
    probes, touching, started = seen.probes, seen.touching, seen.loop.started
    if touching is not None:
        touching.sum_up()
    each = total(model.comm, march.rows.sums)
    # After a failure the last rows are empty or not finite.
    bad = ~np.isfinite(each).all(axis=(1, 2))
    done = min(march.layer + 1, int(np.argmax(bad)) if bad.any() else len(each))
    rows, each = march.rows.first(done).times(whole.factor), whole.factor * each[:done]
    together = each.sum(axis=1)
    elastic = elastic_energy(scheme, rows, together[:, 1], total(model.comm, rows.early))
    work = work_done(march, rows, together, model.scene.vector_gravity, explicit=scheme.staggered)
    attitudes = total(model.comm, rows.attitude)
    placed = [part.system.displacement for part in model.parts]
    level = level_at_start(model)
    if started is not None:
        level -= float(started.fallen(model) @ model.scene.vector_gravity.at(0.0))
        placed = started.of_solids(model)
    momentum, angular, bodies = body_motions(seen, each, attitudes, placed)
    told = probes.columns(total(model.comm, rows.probes))
    moved = {} if probes.kept is None else probes.kept.taken(told)
    times = march.interior.dt * np.arange(done, dtype=np.float64)
    told = accelerated(model.scene.probes, times, told)
    history = make_history(
        Columns(
            time=times,
            gap=_clean(np.where(rows.gap < 0.5 * FAR, rows.gap, np.nan), model, march),
            contact_force=_of_layers(scheme, rows.force) + 0.0,  # no negative zeros
            kinetic_energy=together[:, 0],
            elastic_energy=elastic,
            potential_energy=whole.factor * level - work,
            momentum=momentum,
            direction=momentum_direction(model),
            angular_momentum=angular,
            friction_work=np.cumsum(rows.friction_work),
            active=rows.active,
            bodies=bodies,
            pairs=_pair_motions(seen, rows, bodies),
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
    effort = _effort(seen, rows, bodies, taken)
    missing = getattr(march.interior, "missing", None)
    if missing:
        own = {name: each[:, k, :2] for k, name in enumerate(model.masses)}
        rounding = rounding_energy(model.scene, history, march.layers, effort.bodies)
        found = inertia_findings(missing, effort.bodies, bodies, own, rounding)
        effort = replace(effort, findings=(*effort.findings, *found))
    if model.joints is not None:
        opened = opening_findings(model.scene, history, seen.loop.joined.opened())
        effort = replace(effort, findings=(*effort.findings, *opened))
        if model.scene.ties:
            ties, parted = _ties(seen, told)
            effort = replace(
                effort, details={**effort.details, "ties": ties},
                findings=(*effort.findings, *parted),
            )  # fmt: skip
    if started is not None:
        effort = replace(
            effort,
            details={**effort.details, "start": started.details(model, whole)},
            findings=(*effort.findings, *started.findings()),
        )
    places = {} if probes.kept is None else probes.kept.places
    return SolidsMotion(history, effort, finite, places, moved)


def _ties(
    seen: Observed, told: Mapping[str, Mapping[str, Floats]]
) -> tuple[dict[str, dict[str, float | None]], list[Finding]]:
    """Largest resultants of the ties [N], and when they let go [s]; that they did."""
    figures, found = dict[str, dict[str, float | None]](), list[Finding]()
    parted = seen.loop.joined.parted()
    for tie in seen.model.scene.ties:
        force, time = float(told["force"][tie.name].max()), parted.get(tie.name)
        figures[tie.name] = {"force_max": force, "parted_at": time}
        if time is not None:
            text = f"tie {tie.name} let go at t = {time:.6g} s, at {force:.4g} N; its surfaces do "
            text += "not touch each other from then on"
            found.append(Finding("tie_parted", "note", text, tie.name, value=time))
    return figures, found


def _taken(rows: Rows, told: Mapping[str, Mapping[str, Floats]]) -> dict[str, float]:
    """What has taken energy, by name [J]."""
    joints = [columns[LOST][-1] for columns in told.values() if LOST in columns]
    found = {"impacts": -float(rows.impact_work.sum()), "joints": float(sum(joints))}
    found["adhesion"] = -float(rows.parted_work.sum())
    found["contacts that give way"] = -float(rows.braked_work.sum())
    return {name: energy for name, energy in found.items() if energy}


def _pair_motions(
    seen: Observed, rows: Rows, bodies: Mapping[str, BodyMotion]
) -> dict[str, PairMotion]:
    """What each pair does, by the rows of the whole and the motions of the bodies."""
    model, scheme, march, whole = seen.model, seen.scheme, seen.march, seen.whole
    touching = seen.touching
    if not march.pairs:
        return {}
    # Forces are those on the carrier, columns those on the first body of the pair.
    first = {name: one for name, (one, _), _ in named_body_pairs(model.scene)}
    turned = {pair.label for pair in model.pairs if pair.names[0] != first[pair.label]}
    turned |= {
        met.label for met in model.ball_meetings if met.carrier != first.get(met.label, met.carrier)
    }
    force = _of_layers(scheme, rows.pair_force)
    all_forces = _of_layers(scheme, rows.pair_force + rows.pair_impact / march.interior.dt)
    place, moments = _of_layers(scheme, rows.place), _of_layers(scheme, rows.moment)
    revolved = any(part.system.axisymmetric for part in model.parts)
    open_ = ~(rows.pair_gap < 0.5 * FAR)
    gap = np.where(open_, np.nan, rows.pair_gap)
    found = {}
    for k, name in enumerate(march.pairs):
        tangential = slip = None
        if rows.slip.shape[1]:
            # Images slide the other way along their tangents: in the plane they cancel.
            tangential = _of_layers(scheme, rows.tangential[:, k])
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


def _of_layers(scheme: SolidScheme, forces: Floats) -> Floats:
    """Contact forces of each layer [N], of those that the march has left, (rows, ...)."""
    found = forces.copy()
    if scheme.massless and scheme.staggered:
        # The force found for a layer acts at its start: a layer has the mean of both its ends.
        found[1:-1] = 0.5 * (forces[1:-1] + forces[2:])
    return found


_IMPACTS = "impulses of impacts between bodies without massless nodes during (t_{m-1}, t_m]"
_INDENTED = "what the stiffness of contacts gives way, beyond which gap counts"
_MOVING = ("contact_force", "total_energy")


def _effort(
    seen: Observed, rows: Rows, bodies: Mapping[str, BodyMotion], taken: Mapping[str, float]
) -> Effort:
    """How the march got there, by its rows, the motions, and the energy taken."""
    model, march, watch = seen.model, seen.march, seen.watch
    figures, parts = seen.limits.figures(), model.parts
    small = {body.name for body in model.scene.bodies if body.small_strains}
    iterations = rows.iterations[rows.iterations > 0]
    return Effort(
        num_unknowns=model.unknowns + model.contact_count,
        iterations=int(rows.iterations.max(initial=0)),
        set_changes=(int(np.abs(np.diff(rows.active)).max(initial=0)),),
        converged=not march.failure,
        message=march.failure or "every time step settled",
        details={
            "dt": march.interior.dt,
            "layers": march.layers,
            "stable_dt": seen.limit,
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
            **seen.whole.details(),
            **({} if seen.feedback is None else {"controllers": seen.feedback.figures()}),
            **march.figures(),
        },
        findings=(
            *(contact_findings(rows.force, rows.largest, march.interior.dt) if parts else ()),
            *measured_findings(
                {name: known for name, known in figures.items() if name in small},
                {p.solid.name: p.solid.law for p in parts if p.solid.is_finite},
            ),
            *data_findings(
                time_data(model.scene, [part.system for part in parts], model.few),
                march.interior.dt,
                march.layers,
            ),
            *_overlap_findings(model, watch),
            *march.findings(),
            *watch.axes.findings(),
            *([] if seen.feedback is None else seen.feedback.findings()),
        ),
        measured=(*(contact_codes(rows.force) if parts else ()), *MODEL_CODES, *DATA_CODES),
        force_window=mesh_window(
            [part.foreseen.fastest for part in parts],
            [part.degree for part in parts],
            seen.numbers.mesh_size,
        ),
        least_window=ringing(model),
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
