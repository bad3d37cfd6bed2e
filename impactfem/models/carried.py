"""Masses that bodies carry: they set out as the body does at their place."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.masses import Attached
from impactfem.system.few import FewBodies
from impactfem.system.rigid import in_space

if TYPE_CHECKING:
    from impactfem.models.solids import SolidsModel
    from impactfem.system.stations import HasStations


def set_out(model: "SolidsModel", masses: Sequence[Attached]) -> None:
    """Give the points of masses the velocities of their bodies at t = 0 (collective).

    Raises:
        KeyedError: A surface is unknown, or a place is outside of its body.
    """
    every: list[HasStations] = [*model.tips, *model.few]
    points = next(few for few in model.few if masses[0].name in few.names)
    for mass in masses:
        (joint,) = mass.own_joints
        place = in_space(np.asarray(mass.position))
        body = mass.side.partition("/")[0]
        carrier = next(bodies for bodies in every if body in bodies.names)
        found = carrier.stations([(mass.side, place, joint.radius)])
        at = found.of[0]
        spin = found.turns[at] @ found.spins[at]
        speed = found.speeds[at] + np.cross(spin, place - found.places[at])
        _start(points, points.names.index(mass.name), speed[: model.dim])


def _start(points: FewBodies, body: int, speed: Floats) -> None:
    """Let a point set out with a velocity (dim,)."""
    dim = len(speed)
    points.velocity[body * dim : (body + 1) * dim] = speed
    points.speeds[body] = speed
