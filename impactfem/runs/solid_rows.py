"""The motion of a solid from the rows that its march has left."""

import numpy as np
from numpy.typing import NDArray

from impactfem.marching.collect import total
from impactfem.marching.model_watch import ModelWatch
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.solid_output import Watch
from impactfem.marching.solids import Rows, SolidMarch
from impactfem.models.solid import SolidModel
from impactfem.planning.model_limits import CODES as MODEL_CODES
from impactfem.planning.model_limits import measured_findings
from impactfem.result.bar_motion import Effort
from impactfem.result.solid_motion import SolidMotion
from impactfem.result.whole import Whole
from impactfem.runs.forces import contact_codes, contact_findings, mesh_window

Floats = NDArray[np.float64]


def solid_motion(
    model: SolidModel,
    scheme: SolidScheme,
    march: SolidMarch,
    watch: Watch,
    limits: ModelWatch,
    limit: float | None,
    whole: Whole,
    size: float,
) -> SolidMotion:
    """Make the motion of the rows of all ranks (collective).

    Args:
        model: The body.
        scheme: What marched it.
        march: At its end, or where it failed.
        watch: What was seen of nodes without contact unknowns.
        limits: What was seen of rotation and strains.
        limit: Stable time step [s] of an explicit scheme.
        whole: What the body is a part of; the motion is that of the whole.
        size: Size of its elements [m].
    """
    dim = model.solid.dim
    sums = total(model.comm, march.rows.sums)
    # After a failure the last rows are empty or not finite.
    bad = ~np.isfinite(sums).all(axis=1)
    done = min(march.layer + 1, int(np.argmax(bad)) if bad.any() else len(sums))
    rows, sums = march.rows.first(done).times(whole.factor), whole.factor * sums[:done]
    momentum, moment = whole.mean(sums[:, 3 : 3 + dim]), sums[:, 3 + dim :]
    times: Floats = march.interior.dt * np.arange(done, dtype=np.float64)
    explicit = scheme.interior == "leapfrog"
    elastic, force = elastic_and_force(scheme, rows, sums[:, 1])
    work = work_done(march, rows, sums, moment, explicit=explicit)
    direction = np.zeros(3)
    first = model.contact.normal[np.argmin(model.contact.gap)] if model.contact.count else None
    direction[:dim] = np.eye(dim)[dim - 1 if dim == 2 else 1] if first is None else first
    mass, centre = whole.factor * model.system.total_mass, model.system.center_of_mass
    position, velocity = np.zeros((len(times), 3)), np.zeros((len(times), 3))
    position[:, :dim] = whole.mean_place(centre + moment / mass)
    velocity[:, :dim] = momentum / mass
    figures = limits.figures()
    changes = np.abs(np.diff(rows.active))
    effort = Effort(
        num_unknowns=model.system.num_dofs + model.contact.count,
        iterations=int(rows.iterations.max()),
        set_changes=(int(changes.max(initial=0)),),
        converged=not march.failure,
        message=march.failure or "every layer settled",
        details={
            "dt": march.interior.dt,
            "layers": march.layers,
            "stable_dt": limit,
            "contact_nodes": model.contact.count,
            "mean_iterations_in_contact": _mean(rows.iterations[rows.iterations > 0]),
            "penetration_elsewhere": watch.depth,
            "watch": watch.message,
            "cells": model.mesh.num_cells,
            "nodes": model.mesh.num_nodes,
            **whole.details(),
        },
        findings=(
            *contact_findings(rows.force, rows.largest, march.interior.dt),
            *measured_findings(figures),
        ),
        measured=(*contact_codes(rows.force), *MODEL_CODES),
        force_window=mesh_window([model.solid], [model.degree], size),
        bodies=figures,
    )
    along: Floats = momentum @ direction[:dim]
    return SolidMotion(
        times=times,
        gap=np.where(np.isfinite(rows.gap), rows.gap, np.nan),
        contact_force=force,
        kinetic=sums[:, 0],
        elastic=elastic,
        potential=whole.factor * _level(model) - work,
        momentum=along,
        direction=direction,
        active=rows.active,
        position=position,
        velocity=velocity,
        effort=effort,
    )


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


def _mean(values: NDArray[np.int64]) -> float:
    return float(values.mean()) if len(values) else 0.0


def work_done(
    march: SolidMarch, rows: Rows, sums: Floats, moment: Floats, *, explicit: bool
) -> Floats:
    """Work of gravity, loads and moved obstacles up to each layer [J], as the scheme does it.

    Args:
        march: At its end.
        rows: As the march has left them, of the whole.
        sums: Of all ranks and bodies, as `Rows.sums` has them, (rows, 3 + 2 dim).
        moment: Mass times displacement [kg m], (rows, dim).
        explicit: Whether energies belong to the middle of layers.
    """
    step = np.diff(moment, axis=0)
    layers = range(len(sums) - 1)
    gravity = np.array([march.interior.gravity(layer) for layer in layers]).reshape(step.shape)
    if explicit:  # energies belong to the middle of layers: half of each neighbouring step
        step = 0.5 * (step + np.vstack([np.zeros_like(step[:1]), step[:-1]]))
    pulled = np.einsum("ij,ij->i", gravity, step)
    done = np.zeros(len(sums))
    done[1:] = np.cumsum(pulled + sums[1:, 2] + rows.obstacle_work[1 : len(sums)])
    return done


def _level(model: SolidModel) -> float:
    """Potential of gravity at t = 0: 0 where the body would begin to touch [J]."""
    if not model.contact.count:
        return 0.0
    nearest = int(np.argmin(model.contact.gap))
    towards = -float(model.gravity.at(0.0) @ model.contact.normal[nearest])
    return model.system.total_mass * max(0.0, towards) * float(model.contact.gap[nearest])
