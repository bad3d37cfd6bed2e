"""What one episode of contact did to a falling beam: apparent restitution and micro-impacts.

A beam that hits with one end leaves with vibrations. Its rigid part (momentum and moment of
momentum) tells how it flies on: the apparent restitution is -after/before of the normal velocity
that the contact end has by this part alone. Source: D. Stoianovici, Y. Hurmuzlu, A critical study
of the applicability of rigid-body collision theory, J. Appl. Mech. 63 (1996) 307-316.
"""

import math
from dataclasses import dataclass

import numpy as np

from impactfem.result.trajectory import Trajectory
from impactfem.system.beam import FreeBeam
from impactfem.system.generalized import LinearSystem

PAUSE = 0.02
"""Shares of the first bending period without force that part two micro-impacts."""


@dataclass(frozen=True)
class Episode:
    """One episode of contact of one constraint.

    Attributes:
        constraint: Which one.
        restitution: Apparent one, by the rigid part.
        micro_impacts: Times of contact, pauses below `PAUSE` of the first period left out.
        last_contact: Time of the last force [s]; nan without contact.
        end: Time at which the rigid part was taken [s]: that of the last row before another
            constraint acts.
        duration: Length of the motion [s].
        impulse: Impulse of the constraint until then [N s].
        vibration: Share of the initial energy that is left in vibrations (kinetic and elastic).
        lost: Share of the initial energy that is lost.
        angle: Largest change of the rigid angle until then, neglected by the model [rad].
    """

    constraint: int
    restitution: float
    micro_impacts: int
    last_contact: float
    end: float
    duration: float
    impulse: float
    vibration: float
    lost: float
    angle: float

    @property
    def is_over(self) -> bool:
        """Whether the last fifth of the time until `end` saw no contact."""
        return bool(self.last_contact < 0.8 * self.end)


def contact_episode(body: FreeBeam, system: LinearSystem, motion: Trajectory) -> Episode:
    """Judge the first episode of contact of a beam, without gravity.

    Args:
        body: The beam.
        system: Its system, without tips.
        motion: Motion of the system, or of it with tips (`with_tips`), with rows at a stride that
            is short against the pause.
    """
    pause = PAUSE * 2.0 * math.pi / body.beam.first_frequency  # that parts two micro-impacts
    times, pushed = motion.times, motion.impulse
    touched = np.flatnonzero((pushed > 0.0).any(axis=1))
    first = int(np.argmax(pushed[touched[0]])) if len(touched) else int(np.argmin(motion.gap[0]))
    others = np.flatnonzero(np.delete(pushed, first, axis=1).any(axis=1))
    stop = int(others[0]) - 1 if len(others) else len(times) - 1
    own = slice(None, system.dofs)
    rigid = body.rigid_part(motion.velocity[[0, stop], own])
    before, after = rigid @ (system.normals[first] @ body.rigid_modes)
    acting = np.flatnonzero(pushed[: stop + 1, first] > 0.0)
    ends = times[acting]
    starts = times[np.maximum(acting - 1, 0)]
    kinetic = 0.5 * np.einsum("ij,jk,ik->i", rigid, body.rigid_mass, rigid)
    total = motion.total - motion.potential[0]
    return Episode(
        constraint=first,
        restitution=float(-after / before),
        micro_impacts=int(len(acting) > 0) + int((starts[1:] - ends[:-1] > pause).sum()),
        last_contact=float(ends[-1]) if len(ends) else math.nan,
        end=float(times[stop]),
        duration=float(times[-1]),
        impulse=float(pushed[: stop + 1, first].sum()),
        vibration=float((total[stop] - kinetic[1]) / total[0]),
        lost=float(1.0 - total[stop] / total[0]),
        angle=body.angle(motion.position[: stop + 1, own]),
    )
