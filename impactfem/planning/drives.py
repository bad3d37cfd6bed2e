"""What moves a body as a rigid one: gravity and its loads, or its supports."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.result.shapes import as_vectors
from impactfem.scene import Scene, Solid
from impactfem.system.elastic import ElasticSystem

_SAMPLES = 513


@dataclass(frozen=True)
class Drives:
    """Way and turn of a body by its start and all that drives it, but without contact.

    Attributes:
        times: From 0 to the end [s], shape (samples,).
        way: Of the centre of mass [m], shape (samples, 3).
        turn: Integral of the angular velocity [rad], shape (samples, 3).
        loaded: Whether tractions or pressures act.
        known: Whether all of this is known.
    """

    times: Floats
    way: Floats
    turn: Floats
    loaded: bool
    known: bool

    def at(self, t: float) -> Floats:
        """Way of the centre of mass up to a time [m], shape (3,)."""
        return np.array([np.interp(t, self.times, column) for column in self.way.T])

    def turned(self, t: float) -> Floats:
        """Turn up to a time [rad], shape (3,)."""
        return np.array([np.interp(t, self.times, column) for column in self.turn.T])


def flown(
    scene: Scene, solid: Solid, system: ElasticSystem, inverse: Floats, start: tuple[Floats, Floats]
) -> Drives:
    """Flight of a body that nothing holds: its momentum and spin by gravity and loads (collective).

    Loads keep direction and place, as small strains have it; pressures that follow are not known.

    Args:
        scene: With gravity and the duration.
        solid: The body.
        system: Its matrices.
        inverse: Inverse inertia [1/(kg m^2)], shape (3, 3).
        start: Velocity [m/s] and spin [rad/s] at t = 0, shape (3,) each.
    """
    times = np.linspace(0.0, scene.duration, _SAMPLES)
    spans = list(pairwise(times.tolist()))
    pull = as_vectors(np.array([system.loads.mean_gravity(*span) for span in spans]))
    loaded = bool(solid.tractions or solid.pressures)
    spinning = np.zeros_like(pull)
    if loaded:
        force, moment = _resultants(system, spans)
        pull, spinning = pull + force / system.total_mass, moment @ inverse
    way, turn = (
        _moved(times, first, rate, solid.rayleigh_mass)
        for first, rate in zip(start, (pull, spinning), strict=True)
    )
    return Drives(times, way, turn, loaded, not solid.following)


def _resultants(
    system: ElasticSystem, spans: Sequence[tuple[float, float]]
) -> tuple[Floats, Floats]:
    """Mean force [N] and moment about the centre of mass [N m] of all loads, (spans, 3) each."""
    arm = as_vectors(system.positions - system.center_of_mass)
    forces, none = np.zeros(len(system.constrained)), np.zeros(system.dim)
    found = np.zeros((len(spans), 6))
    for k, span in enumerate(spans):
        if k and system.loads.is_steady:
            found[k] = found[0]
            continue
        each = as_vectors(system.loads.mean(*span, forces, none).reshape(-1, system.dim))
        found[k, :3], found[k, 3:] = each.sum(axis=0), np.cross(arm, each).sum(axis=0)
    system.comm.Allreduce(MPI.IN_PLACE, found)
    return found[:, :3], found[:, 3:]


def _moved(times: Floats, speed: Floats, rate: Floats, damping: float) -> Floats:
    """Integrate v' = rate - damping v twice from a speed, (times, 3), by means between times."""
    step = times[1]
    kept = math.exp(-damping * step)
    share = (1.0 - kept) / damping if damping * step > 1e-9 else step
    speeds = np.empty((len(times), 3))
    speeds[0] = speed
    for k, mean in enumerate(rate):
        speeds[k + 1] = kept * speeds[k] + share * mean
    moved: Floats = np.cumsum(
        np.vstack([np.zeros(3), 0.5 * step * (speeds[1:] + speeds[:-1])]), axis=0
    )
    return moved


def carried(scene: Scene, system: ElasticSystem, *, known: bool) -> Drives:
    """The rigid motion that comes nearest to what supports do to the nodes they hold (collective).

    What supports leave free does not count: a body that swings on one of them is not known, nor,
    where ``known`` is false, one that they let go.
    """
    times = np.linspace(0.0, scene.duration, _SAMPLES)
    supports, size = system.supports, system.nodes.size
    arm = as_vectors(system.positions - system.center_of_mass) / size
    # Columns: the three translations [m], and three rotations times the size of the body [m].
    rows = np.zeros((len(arm), system.dim, 6))
    for k, unit in enumerate(np.eye(3)):
        rows[:, :, k] = unit[: system.dim]
        rows[:, :, 3 + k] = np.cross(unit, arm)[:, : system.dim]
    flat = rows.reshape(-1, 6)
    weights = np.repeat(system.node_mass, system.dim)
    held = supports.constrained
    normal = flat[held].T @ (weights[held, None] * flat[held])
    right = np.zeros((len(supports.formulas), 6))
    np.add.at(right, supports.which, weights[supports.moved, None] * flat[supports.moved])
    normal, right = (
        np.asarray(system.comm.allreduce(part, op=MPI.SUM)) for part in (normal, right)
    )
    values = np.array(
        [np.broadcast_to(formula(t=times), times.shape) for formula in supports.formulas]
    ).reshape(-1, len(times))
    known = known and bool(np.isfinite(values).all())
    motion = np.nan_to_num(values).T @ right @ np.linalg.pinv(normal, rcond=1e-9, hermitian=True)
    return Drives(times, motion[:, :3], motion[:, 3:] / size, loaded=False, known=known)
