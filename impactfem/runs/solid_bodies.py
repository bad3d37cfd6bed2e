"""How bodies of a march moved, from the sums that it has left."""

from collections.abc import Sequence

import numpy as np

from impactfem.arrays import Floats
from impactfem.marching.collect import total
from impactfem.marching.turning import Turning
from impactfem.models.solids import SolidPart, SolidsModel
from impactfem.result.attitude import attitude
from impactfem.result.history import BodyMotion
from impactfem.result.whole import Whole
from impactfem.runs.observed import Observed


def body_motions(
    seen: Observed, each: Floats, attitudes: Floats, placed: Sequence[Floats]
) -> tuple[Floats, Floats | None, dict[str, BodyMotion]]:
    """Momentum (rows, 3), angular momentum (rows, 1 or 3) and the motion of each body (collective).

    On a line nothing turns.

    Args:
        seen: A march at its end.
        each: Sums of all ranks, of the whole: see `Rows.sums`, (rows, bodies, ...).
        attitudes: The same of `Rows.attitude`.
        placed: Displacements of the owned dofs of the solids at t = 0 [m].
    """
    model, march, whole = seen.model, seen.march, seen.whole
    explicit = seen.scheme.staggered  # velocities belong to the middle of layers
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
                if seen.loop.started is not None:
                    start = start + seen.loop.started.turned.get(name, 0.0)
            else:
                start = np.zeros(3)
                start[3 - turns :] = _turned_at_start(part, placed[k])
                start = whole.mean_turn(start)[3 - turns :]
            turn = _rotation(np.vstack([start, march.interior.dt * each_layer]))
        elif attitudes[:, k].any() and (part is None or _turns_freely(part, whole)):
            dt = march.interior.dt  # bodies beside explicit solids are summed up amid layers
            told_by = attitudes[:, k], spun[:, 3 - turns :], whole, dt
            turn, spin = attitude(*told_by, ahead=0.5 * dt if explicit else 0.0)
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


def momentum_direction(model: SolidsModel) -> Floats:
    """Unit vector along which momentum is told: its largest component is positive.

    Of one body, whatever it carries, the normal of the obstacle that is nearest to it, whatever its
    sign. Of several that of the first one's approach to the second; of gravity, if they start
    alike; else the line of their centres.
    """
    dim, way = model.dim, np.zeros(3)
    if len(model.parts) == 1 and all(b.attached for b in model.scene.bodies[1:]):
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
