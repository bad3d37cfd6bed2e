"""The motions of several solids from the rows that their march has left."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.marching.collect import total
from impactfem.marching.composite import Composite
from impactfem.marching.model_watch import ModelWatch
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.solids import SolidMarch
from impactfem.models.bodies import BodiesModel
from impactfem.planning.model_limits import CODES as MODEL_CODES
from impactfem.planning.model_limits import measured_findings
from impactfem.result.bar_motion import Effort
from impactfem.result.history import BodyMotion, Columns, make_history
from impactfem.result.table import Table
from impactfem.result.whole import Whole
from impactfem.runs.forces import contact_codes, contact_findings, mesh_window
from impactfem.runs.solid_rows import elastic_and_force, work_done

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class BodiesMotion:
    """Motions of several solids at their time levels.

    Attributes:
        history: In the columns of the contract.
        effort: How the scheme got there.
        is_finite: Whether forces, energies and motions are finite.
    """

    history: Table
    effort: Effort
    is_finite: bool


def bodies_motion(
    model: BodiesModel,
    scheme: SolidScheme,
    march: SolidMarch,
    interior: Composite,
    limits: ModelWatch,
    limit: float | None,
    whole: Whole,
    size: float,
) -> BodiesMotion:
    """Make the motions of the rows of all ranks (collective).

    Args:
        model: The solids.
        scheme: What marched them.
        march: At its end, or where it failed.
        interior: Of the solids, with the sums of each.
        limits: What was seen of rotations and strains.
        limit: Least stable time step [s] of an explicit scheme.
        whole: What the solids are parts of; the motions are those of the whole.
        size: Size of the elements of those that do not say it [m].
    """
    dim = model.parts[0].solid.dim
    each = total(model.comm, interior.rows)
    bad = ~np.isfinite(each).all(axis=(0, 2))
    done = min(march.layer + 1, int(np.argmax(bad)) if bad.any() else each.shape[1])
    rows, each = march.rows.first(done).times(whole.factor), whole.factor * each[:, :done]
    sums = each.sum(axis=0)
    times: Floats = march.interior.dt * np.arange(done, dtype=np.float64)
    explicit = scheme.interior == "leapfrog"
    elastic, force = elastic_and_force(scheme, rows, sums[:, 1])
    bodies = {}
    for k, part in enumerate(model.parts):
        mass, centre = whole.factor * part.system.total_mass, part.system.center_of_mass
        position, velocity = np.zeros((done, 3)), np.zeros((done, 3))
        position[:, :dim] = whole.mean_place(centre + each[k, :, 3 + dim :] / mass)
        velocity[:, :dim] = whole.mean(each[k, :, 3 : 3 + dim]) / mass
        bodies[part.solid.name] = BodyMotion(position, velocity)
    direction = _direction(model)
    history = make_history(
        Columns(
            time=times,
            gap=np.where(np.isfinite(rows.gap), rows.gap, np.nan),
            contact_force=force + 0.0,
            kinetic_energy=sums[:, 0],
            elastic_energy=elastic,
            potential_energy=-work_done(march, rows, sums, sums[:, 3 + dim :], explicit=explicit),
            momentum=whole.mean(sums[:, 3 : 3 + dim]) @ direction[:dim],
            active=rows.active,
            bodies=bodies,
        )
    )
    history["momentum"].attrs["direction"] = direction
    history["momentum"].attrs["long_name"] = (
        f"linear momentum of all bodies along ({', '.join(f'{c:.6g}' for c in direction)})"
    )
    history["contact_force"].attrs["comment"] = (
        "sum of the normal forces of all contacts during (t_{m-1}, t_m]"
    )
    history["potential_energy"].attrs["comment"] = "minus the work of gravity and other loads"
    figures = limits.figures()
    changes = np.abs(np.diff(rows.active))
    effort = Effort(
        num_unknowns=model.unknowns + model.contact_count,
        iterations=int(rows.iterations.max(initial=0)),
        set_changes=(int(changes.max(initial=0)),),
        converged=not march.failure,
        message=march.failure or "every layer settled",
        details={
            "dt": march.interior.dt,
            "layers": march.layers,
            "stable_dt": limit,
            "contact_pairs": model.contact_count,
            "contact_nodes": sum(len(numbers) for numbers in model.numbers),
            "carriers": {" and ".join(p.names): p.names[0] for p in model.pairs},
            "friction_work": float(rows.friction_work.sum()),
            "cells": sum(part.mesh.num_cells for part in model.parts),
            "nodes": sum(part.mesh.num_nodes for part in model.parts),
            **whole.details(),
        },
        findings=(
            *contact_findings(rows.force, rows.largest, march.interior.dt),
            *measured_findings(figures),
        ),
        measured=(*contact_codes(rows.force), *MODEL_CODES),
        force_window=mesh_window(
            [part.solid for part in model.parts], [part.degree for part in model.parts], size
        ),
        bodies=figures,
    )
    finite = bool(np.isfinite(sums).all() and np.isfinite(force).all())
    return BodiesMotion(history, effort, finite)


def _direction(model: BodiesModel) -> Floats:
    """Unit vector along which momentum is told: its largest component is positive.

    That of the first body's approach to the second; of gravity, if they start alike; else the line
    of their centres. Upwards for one body.
    """
    dim = model.parts[0].solid.dim
    if len(model.parts) == 1:
        return np.array([0.0, 1.0, 0.0])
    one, two = model.parts[:2]
    speeds = [part.system.mean(part.system.velocity) for part in (one, two)]
    approach = speeds[0] - speeds[1]
    if np.linalg.norm(approach) <= 1e-12 * np.abs(speeds).max():
        approach = np.zeros(dim)  # rounding
    way = np.zeros(3)
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
