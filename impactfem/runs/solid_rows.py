"""The motions of solids from the rows that their march has left."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.findings import Finding, by_limits, percent
from impactfem.marching.collect import total
from impactfem.marching.model_watch import ModelWatch
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.solids import Rows, SolidMarch
from impactfem.models.solids import SolidsModel
from impactfem.planning.model_limits import CODES as MODEL_CODES
from impactfem.planning.model_limits import measured_findings
from impactfem.result.bar_motion import Effort
from impactfem.result.history import BodyMotion, Columns, make_history
from impactfem.result.table import Table
from impactfem.result.whole import Whole
from impactfem.runs.forces import contact_codes, contact_findings, mesh_window
from impactfem.runs.solid_output import Watch
from impactfem.runs.verdict import PENETRATION_LIMITS

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
    march: SolidMarch,
    watch: Watch,
    limits: ModelWatch,
    limit: float | None,
    whole: Whole,
    size: float,
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
    """
    dim = model.parts[0].solid.dim
    each = total(model.comm, march.rows.sums)
    # After a failure the last rows are empty or not finite.
    bad = ~np.isfinite(each).all(axis=(1, 2))
    done = min(march.layer + 1, int(np.argmax(bad)) if bad.any() else len(each))
    rows, each = march.rows.first(done).times(whole.factor), whole.factor * each[:done]
    sums = each.sum(axis=1)
    elastic, force = elastic_and_force(scheme, rows, sums[:, 1])
    work = work_done(march, rows, sums, explicit=scheme.interior == "leapfrog")
    bodies = {}
    for k, part in enumerate(model.parts):
        mass, centre = whole.factor * part.system.total_mass, part.system.center_of_mass
        position, velocity = np.zeros((done, 3)), np.zeros((done, 3))
        position[:, :dim] = whole.mean_place(centre + each[:, k, 3 + dim :] / mass)
        velocity[:, :dim] = whole.mean(each[:, k, 3 : 3 + dim]) / mass
        bodies[part.solid.name] = BodyMotion(position, velocity)
    direction = _direction(model)
    history = make_history(
        Columns(
            time=march.interior.dt * np.arange(done, dtype=np.float64),
            gap=np.where(np.isfinite(rows.gap), rows.gap, np.nan),
            contact_force=force + 0.0,  # no negative zeros
            kinetic_energy=sums[:, 0],
            elastic_energy=elastic,
            potential_energy=whole.factor * _level(model) - work,
            momentum=whole.mean(sums[:, 3 : 3 + dim]) @ direction[:dim],
            active=rows.active,
            bodies=bodies,
        )
    )
    along = ", ".join(f"{component:.6g}" for component in direction)
    history["momentum"].attrs["direction"] = direction
    history["momentum"].attrs["long_name"] = f"linear momentum along ({along})"
    history["contact_force"].attrs["comment"] = (
        "sum of the normal forces of all contacts during (t_{m-1}, t_m]"
    )
    history["potential_energy"].attrs["comment"] = "minus the work of gravity and other loads"
    finite = all(bool(np.isfinite(history[name].values).all()) for name in _MOVING) and bool(
        np.isfinite(sums).all()
    )
    effort = _effort(model, march, rows, watch, limits, limit, whole, size)
    return SolidsMotion(history, effort, finite)


_MOVING = ("contact_force", "total_energy")


def _effort(
    model: SolidsModel,
    march: SolidMarch,
    rows: Rows,
    watch: Watch,
    limits: ModelWatch,
    limit: float | None,
    whole: Whole,
    size: float,
) -> Effort:
    """How the march got there; arguments as of `solids_motion`."""
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
            "penetration_elsewhere": watch.depth,
            "watch": watch.message,
            "overlap": watch.overlap,
            "cells": sum(part.mesh.num_cells for part in parts),
            "nodes": sum(part.mesh.num_nodes for part in parts),
            **whole.details(),
        },
        findings=(
            *contact_findings(rows.force, rows.largest, march.interior.dt),
            *measured_findings(figures),
            *_overlap_findings(model, watch),
        ),
        measured=(*contact_codes(rows.force), *MODEL_CODES),
        force_window=mesh_window(
            [part.solid for part in parts], [part.degree for part in parts], size
        ),
        bodies=figures,
    )


def _overlap_findings(model: SolidsModel, watch: Watch) -> tuple[Finding, ...]:
    """Whether bodies lay in each other, though their gaps, means over faces, did not close."""
    share = watch.overlap / min(part.system.nodes.size for part in model.parts)
    text = f"bodies lie up to {watch.overlap:.2g} m in each other, {percent(share)} of the smaller"
    text += " one: gaps between bodies are means over faces"
    remedy = "take smaller elements where they meet"
    return by_limits("penetration", share, PENETRATION_LIMITS, text, remedy=remedy)


def elastic_and_force(scheme: SolidScheme, rows: Rows, elastic: Floats) -> tuple[Floats, Floats]:
    """Elastic energy [J] and contact force [N] of each layer, (rows,) each.

    Args:
        scheme: What has marched.
        rows: As the march has left them.
        elastic: Sums of the elastic energy [J], without that of contact for explicit schemes.
    """
    energy, force = elastic.copy(), rows.force.copy()
    if scheme.massless and scheme.interior == "leapfrog":
        contact = rows.contact_energy
        energy[1:] += 0.5 * (contact[1:] + contact[:-1])
        energy[0] += contact[0]
        # The force found for a layer acts at its start: a layer has the mean of both its ends.
        force[1:-1] = 0.5 * (rows.force[1:-1] + rows.force[2:])
    return energy, force


def work_done(march: SolidMarch, rows: Rows, sums: Floats, *, explicit: bool) -> Floats:
    """Work of gravity, loads and moved obstacles up to each layer [J], as the scheme does it.

    Args:
        march: At its end.
        rows: As the march has left them, of the whole.
        sums: Of all ranks and bodies, as `Rows.sums` has them, (rows, 3 + 2 dim).
        explicit: Whether energies belong to the middle of layers.
    """
    dim = (sums.shape[1] - 3) // 2
    step = np.diff(sums[:, 3 + dim :], axis=0)  # mass times way
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
    dim, way = model.parts[0].solid.dim, np.zeros(3)
    if len(model.parts) == 1:
        contact = model.parts[0].contact
        if contact is None or not contact.count:
            return np.array([0.0, 1.0, 0.0])
        way[:dim] = contact.normal[int(np.argmin(contact.gap))]
        return way
    one, two = model.parts[:2]
    speeds = [part.system.mean(part.system.velocity) for part in (one, two)]
    approach = speeds[0] - speeds[1]
    if np.linalg.norm(approach) <= 1e-12 * np.abs(speeds).max():
        approach = np.zeros(dim)  # rounding
    for candidate in (
        approach,
        np.asarray(model.scene.vector_gravity.at(0.0)),
        one.system.center_of_mass - two.system.center_of_mass,
    ):
        way[:dim] = candidate[:dim]
        length = float(np.linalg.norm(way))
        if length > 0.0:
            way /= length
            way[np.abs(way) < 1e-9] = 0.0
            way *= np.sign(way[np.argmax(np.abs(way))])
            return way + 0.0
    return np.array([1.0, 0.0, 0.0])
