"""Energies of a march, from the rows that it has left, and what they say of missing inertia."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.findings import Finding, by_limits, percent
from impactfem.marching.rows import Rows
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.time_loop import TimeLoop
from impactfem.models.solids import SolidsModel
from impactfem.result.history import BodyMotion
from impactfem.scene.loads import PiecewiseVector

INERTIA_LIMITS = (0.01, 0.1)
"""Shares of the energy of a body that its masses miss as it turns."""


def elastic_energy(scheme: SolidScheme, rows: Rows, elastic: Floats, early: Floats) -> Floats:
    """Elastic energy of each layer [J], (rows,).

    Args:
        scheme: What has marched.
        rows: As the march has left them.
        elastic: Sums of the elastic energy [J], without that of contact for explicit schemes.
        early: Of all ranks, as `Rows` has it [J], (rows,).
    """
    elastic = elastic + np.cumsum(early)
    if not scheme.staggered:
        return elastic + rows.spring_energy + rows.held_energy
    energy, held = elastic, rows.spring_energy.copy()
    if scheme.massless:
        held += rows.contact_energy
    energy[1:] += 0.5 * (held[1:] + held[:-1])  # amid layers, as all else
    energy[0] += held[0]
    return energy


def work_done(
    march: TimeLoop[Any], rows: Rows, sums: Floats, gravity: PiecewiseVector, *, explicit: bool
) -> Floats:
    """Work of gravity, loads and moved obstacles up to each layer [J], as the scheme does it.

    Args:
        march: At its end.
        rows: As the march has left them, of the whole.
        sums: Of all ranks and bodies, as `Rows.sums` has them, (rows, ...).
        gravity: Of the scene.
        explicit: Whether energies belong to the middle of layers.
    """
    dim = gravity.dim
    step = np.diff(sums[:, 3 + dim : 3 + 2 * dim], axis=0)  # mass times way
    if gravity.is_constant:  # which an interior would say of each of many layers
        pulls = np.broadcast_to(np.array(gravity.values[0]), step.shape)
    else:
        interior, times = march.interior, march.interior.dt * np.arange(len(sums))
        each = [interior.gravity(*ends) for ends in pairwise(times.tolist())]
        pulls = np.array(each).reshape(step.shape)
    early = np.zeros(dim)
    if explicit:  # energies belong to the middle of layers: half of each neighbouring step
        # What stands amid the first layer has gone but half a step there: less than half way.
        early = 0.5 * (step[:1] - march.interior.dt * sums[1:2, 3 : 3 + dim]).sum(axis=0)
        step = 0.5 * (step + np.vstack([np.zeros_like(step[:1]), step[:-1]]))
    pulled = np.einsum("ij,ij->i", pulls, step)
    done = np.zeros(len(sums))
    done[1:] = np.cumsum(pulled + sums[1:, 2] + rows.obstacle_work[1 : len(sums)])
    done[1:2] += pulls[:1] @ early
    return done


def level_at_start(model: SolidsModel) -> float:
    """Potential of gravity at t = 0: 0 where bodies would begin to touch their obstacles [J]."""
    level, gravity = 0.0, model.scene.vector_gravity.at(0.0)
    for part in model.parts:
        if part.contact is not None and part.contact.count:
            nearest = int(np.argmin(part.contact.gap))
            towards = -float(gravity @ part.contact.normal[nearest])
            height = float(part.contact.gap[nearest])
            level += part.system.total_mass * max(0.0, towards) * height
    return level


def inertia_findings(
    missing: Mapping[str, float],
    figures: Mapping[str, Mapping[str, Any]],
    motions: Mapping[str, BodyMotion],
    energies: Mapping[str, Floats],
    rounding: float,
) -> Iterator[Finding]:
    """Bodies whose masses miss inertia that they need: what hardly turns needs none.

    The share that is missing counts by the energy of turning, as a share of that which the body has
    besides its flight: in the frame of its first velocity, less the elastic energy at the start.

    Args:
        missing: Shares of the moments of inertia that their masses have not, by name.
        figures: Mass and inertia of each, as ``summary.json`` has them.
        motions: Of each.
        energies: Kinetic and elastic energy of each [J], (rows, 2).
        rounding: Energy that is none [J].
    """
    for name, share in missing.items():
        spin = motions[name].spin
        if not share or spin is None:
            continue
        mass, velocity = figures[name]["mass"], motions[name].velocity
        inertia = float(np.linalg.norm(np.atleast_2d(figures[name]["inertia"]), 2))
        turning = 0.5 * inertia * (spin**2).sum(axis=1)
        kinetic, elastic = energies[name].T
        flown = ((velocity - velocity[0]) ** 2).sum(axis=1) - (velocity**2).sum(axis=1)
        own = kinetic + 0.5 * mass * flown + np.abs(elastic - elastic[0])
        most = float(turning.max())
        part = most / max(float(own.max()), most) if most > rounding else 0.0
        text = f"the masses inside {name} have {percent(share)} too little moment of inertia, and "
        text += f"{percent(part)} of its energy turns: nodes that may touch carry none, and it is "
        text += "few elements thick"
        remedy = "take smaller elements, or name the surfaces that may touch (contact_surfaces)"
        yield from by_limits("setting", share * part, INERTIA_LIMITS, text, name, remedy)
