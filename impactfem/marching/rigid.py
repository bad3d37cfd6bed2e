"""Layers of a rigid body: the midpoint rule for its centre, `turn_kernels` for its rotation.

The force F of a layer on a contact node acts where the body touches amid the layer, with the arm a
from its centre: it gives the impulse dt F and the impulse of its moment dt a x F.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ConvergenceError
from impactfem.marching.layers import Sums
from impactfem.marching.pictured import Pictured
from impactfem.marching.stations import Held, HeldRigid
from impactfem.marching.turn_kernels import turn
from impactfem.scene import PiecewiseVector
from impactfem.system.rigid import Rigid, frame, in_space
from impactfem.system.stations import Stations

Floats = NDArray[np.float64]

_MOST, _SETTLED = 50, 1e-13  # iterates of forces by formula, and their change


class RigidMidpoint(Pictured):
    """Interior of a rigid body; see `impactfem.marching.layers.Interior`."""

    bodies: Rigid

    def __init__(self, bodies: Rigid, gravity: PiecewiseVector, dt: float, *, counts: bool) -> None:
        """Begin at t = 0; see `FewInterior`."""
        super().__init__(bodies, gravity, dt, counts=counts)
        self._dim, count, self._cells = bodies.dim, len(self._start), bodies.picture[1]
        self._mass, self._inverse = bodies.masses[0], np.linalg.inv(bodies.inertia)
        self._radius = math.sqrt(np.trace(bodies.inertia) / self._mass)  # of gyration
        self.massive = self.volatile = np.ones(count, dtype=bool)
        self._following = bodies.followers
        self.rolling = bool(bodies.rolling.any() or self._following.any()) or (
            bodies.rims is not None
        )
        self._offset = self._following  # from nodes to where they touch
        self._ahead, self._half = self._v.copy(), np.zeros(3)
        self._loads = _NOTHING, _NOTHING
        self._begin()
        self._end = self._middle = self._turn
        self._freedom = self._turn @ self._inverse @ self._turn.T  # of the spin in space
        # Of what rims touch, and where on them.
        self._normals, self._lowest = bodies.normals, bodies.lowest
        self._acting = self._arms(self._turn)
        self._begun = self._around(self._turn)

    def _arms(self, turn: Floats) -> Floats:
        """From the centre to the contact nodes [m], (nodes, 3)."""
        return np.asarray(self.bodies.arms @ turn.T + self._around(turn))

    def _around(self, turn: Floats) -> Floats:
        """The part of them along the rims."""
        rims = self.bodies.rims
        return _NOWHERE if rims is None else rims.arms(turn, self._normals, self._lowest)

    def _begin(self) -> None:
        """What the next layer starts from."""
        self._centre, self._turn = frame(self._q)
        self._pushed, self._turned = np.zeros(3), np.zeros(3)
        self._leaving: Floats | None = None

    def memory(self) -> dict[str, Floats]:
        """Coordinates, their rates, and what rims touch."""
        rims = {"normals": self._normals.copy(), "lowest": self._lowest.copy()}
        return super().memory() | rims

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        self._normals, self._lowest = memory["normals"].copy(), memory["lowest"].copy()
        self._ahead = self._v.copy()
        self._begin()

    def _split(self, rates: Floats) -> tuple[Floats, Floats]:
        """Velocity and spin along the axes of the body, (3,) each."""
        if self._dim == 3:
            return rates[:3], rates[3:]
        return np.array([rates[0], rates[1], 0.0]), np.array([0.0, 0.0, rates[2]])

    def _velocities(self, turn: Floats, rates: Floats, offset: Floats) -> Floats:
        """Of places of the body with the arms of the contact nodes and more [m/s], (nodes, dim)."""
        speed, spin = self._split(rates)
        arms = self._arms(turn) + offset
        return np.asarray((speed + arms @ _skew(turn @ spin).T)[:, : self._dim])

    @property
    def surface_velocity(self) -> Floats:
        """Of the contact nodes [m/s], (count, dim)."""
        return self._velocities(self._turn, self._v, _NOWHERE)

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes since t = 0 [m], (count, dim)."""
        return self._places(self._centre, self._turn) - self._start

    def _places(self, centre: Floats, turn: Floats) -> Floats:
        return np.asarray((centre + self._arms(turn))[:, : self._dim])

    def predict(self, layer: int) -> Floats:
        """Solve the layer without contact forces."""
        self.prepare(layer)
        self._settle()
        return self.foreseen()

    def prepare(self, layer: int) -> None:
        """Begin a layer."""
        self._time, pull = (layer + 0.5) * self.dt, self.gravity(layer)
        self._weight = self._mass * in_space(pull)

    def foreseen(self) -> Floats:
        """Displacements of the contact nodes at the end of the layer, as it is solved now."""
        if (rims := self.bodies.rims) is not None:
            self._begun = self._around(self._turn)
            self._lowest = rims.lowest(self._end, self._normals, self._lowest, -1.0)
        self._acting = self._arms(self._middle) + self._offset
        speed = 0.5 * self.dt * (self._split(self._v)[0] + self._split(self._ahead)[0])
        return self._places(self._centre + speed, self._end) - self._start

    def _settle(self) -> None:
        """Rates at the end of the layer, with what has pushed so far."""
        (speed, spin), bodies = self._split(self._v), self.bodies
        for _ in range(_MOST):
            pushed, kick = self.impulses()
            found = turn(bodies.inertia, self._inverse, self._turn, spin, kick, self.dt)
            if not found[-1]:
                raise ConvergenceError(
                    f"{bodies.names[0]} turns too far in a step at t = {self._time:.6g} s: use a "
                    "smaller solve.dt"
                )
            if self.take(speed + pushed / self._mass, *found[:-1]):
                break
        else:
            raise ConvergenceError(
                f"the forces on {bodies.names[0]} did not settle at t = {self._time:.6g} s; use a "
                "smaller solve.dt"
            )

    def impulses(self) -> tuple[Floats, Floats]:
        """Of forces and moments in the layer without those of joints [N s], [N m s], (3,) each."""
        bodies, dt = self.bodies, self.dt
        if bodies.loads is not None:
            (speed, spin), ahead = self._split(self._v), self._split(self._ahead)
            mean = 0.5 * (speed + ahead[0])
            whirl = self._turn @ (0.5 * (spin + ahead[1]))
            self._loads = bodies.loads(self._time, self._centre + 0.5 * dt * mean, mean, whirl)
        force, moment = self._loads
        return dt * (force + self._weight) + self._pushed, dt * moment + self._turned

    def take(
        self, speed: Floats, spin: Floats, half: Floats, end: Floats, middle: Floats,
        freedom: Floats,
    ) -> bool:  # fmt: skip
        """Take a solution of the layer; whether loads would be the same again.

        Velocity and spin at its end, along the axes of the body, (3,) each; the others are those
        of `impactfem.marching.turn_kernels.turn`.
        """
        last, self._half, self._end, self._middle = self._ahead, half, end, middle
        self._freedom = freedom
        self._ahead = self._joined(speed, spin)
        return self.bodies.loads is None or self._settled(last)

    def _settled(self, last: Floats) -> bool:
        """Whether an iterate is the last one but for rounding, of velocity and spin together.

        One of them may be but rounding of the other, which never settles alone.
        """
        sizes = np.full(len(last), self._radius)
        sizes[: self._dim] = 1.0
        allowed = _SETTLED * np.abs(sizes * self._ahead).max() + np.finfo(float).tiny
        return bool(np.abs(sizes * (self._ahead - last)).max() <= allowed)

    def _joined(self, speed: Floats, spin: Floats) -> Floats:
        return np.concatenate([speed[: self._dim], spin[2 * (3 - self._dim) :]])

    def leave(self, speed: Floats, spin: Floats) -> None:
        """Let the next layer start with other rates than this one ends with, (3,) each."""
        self._leaving = self._joined(speed, spin)

    def held(self, stations: Stations) -> Held:
        """It as joints hold it."""
        return HeldRigid(self, stations)

    @property
    def frame(self) -> tuple[Floats, Floats]:
        """Centre (3,) and rotation (3, 3) at the start of the layer."""
        return self._centre, self._turn

    @property
    def rates(self) -> tuple[Floats, Floats]:
        """Velocity, and spin along the axes of the body, at the start of the layer, (3,) each."""
        return self._split(self._v)

    @property
    def rates_ahead(self) -> tuple[Floats, Floats]:
        """The same at its end, as it is solved now."""
        return self._split(self._ahead)

    @property
    def end(self) -> Floats:
        """Rotation at its end, as it is solved now, (3, 3)."""
        return self._end

    @property
    def freedom(self) -> Floats:
        """Inverse moments of inertia in space amid the layer, (3, 3)."""
        return self._freedom

    def wrenches(self, forces: Floats) -> Floats:
        """Force and moment about its centre of contact forces (..., nodes, dim), (..., 6)."""
        acting = in_space(forces)
        return np.concatenate([acting.sum(axis=-2), _moments(self._acting, acting)], axis=-1)

    def carried(self, moved: Floats) -> Floats:
        """Displacements of the contact nodes by those of the centre and turns, (several, 6)."""
        turned = self._acting @ _skew(moved[:, 3:]).swapaxes(1, 2)
        return np.asarray((moved[:, None, :3] + turned)[..., : self._dim])

    def touched(self, normals: Floats) -> Floats:
        """Learn where nodes touch; ways that their surface goes in the layer besides [m].

        Args:
            normals: Of the gaps of nodes, towards them, (count, dim).
        """
        towards = in_space(normals)
        self._offset = self._following - self.bodies.rolling[:, None] * towards
        self._acting = self._arms(self._middle) + self._offset
        spin = self._turn @ (0.5 * (self._split(self._v)[1] + self._split(self._ahead)[1]))
        beyond = self._around(self._middle) + self._offset
        moved = self._around(self._end) - self._begun
        ways = self.dt * beyond @ _skew(spin).T - moved
        self._normals = towards if self.bodies.rims else self._normals
        return np.asarray(ways[:, : self._dim])

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002  (of others)
        """Velocities where nodes touch at both ends of the layer without contact forces."""
        before = self._velocities(self._turn, self._v, self._offset)
        return before, self._velocities(self._end, self._ahead, self._offset)

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Displacements of the contact nodes by several forces; nothing is massless."""
        wrench = self.wrenches(forces)
        moved = np.hstack([wrench[:, :3] / self._mass, wrench[:, 3:] @ self._freedom])
        return 0.5 * self.dt**2 * self.carried(moved), np.zeros_like(forces)

    answers = columns

    def spins(self) -> Floats:
        """Velocities where nodes touch by unit spins in the layer [m], (turns, count, dim)."""
        axes = np.eye(3)[2 * (3 - self._dim) :]
        return np.asarray(self._acting @ _skew(axes).swapaxes(1, 2))[..., : self._dim]

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:  # noqa: ARG002
        """Add the layer's contact forces (count, dim)."""
        self.strike(forces)
        self._settle()

    def strike(self, forces: Floats) -> None:
        """Add the impulses of contact forces (count, dim), to be solved for."""
        wrench = self.dt * self.wrenches(forces)
        self._pushed, self._turned = self._pushed + wrench[:3], self._turned + wrench[3:]

    def turning(self) -> tuple[Floats, Floats]:
        """Spins at both ends of the layer without contact forces [rad/s], (turns,) each."""
        first = 2 * (3 - self._dim)
        before, after = self._split(self._v)[1], self._split(self._ahead)[1]
        return (self._turn @ before)[first:], (self._end @ after)[first:]

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """Displacements of the contact nodes and turns by several moments; see `Rolling`."""
        first = 2 * (3 - self._dim)
        turns = 0.5 * self.dt**2 * moments @ self._freedom[first:]
        moved = self._acting @ _skew(turns).swapaxes(1, 2)
        return moved[..., : self._dim], turns[:, first:]

    def twist(self, moment: Floats) -> None:
        """Add a moment of the layer."""
        self.whirl(moment)
        self._settle()

    def whirl(self, moment: Floats) -> None:
        """Add the impulse of a moment (turns,), to be solved for."""
        self._turned = self._turned + self.dt * np.pad(moment, (3 - len(moment), 0))

    def finish(self, layer: int, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface)
        """End the layer and sum up."""
        work, mean = 0.0, 0.5 * (self._v + self._ahead)
        if self.bodies.loads is not None:
            (force, moment), (speed, spin) = self._loads, self._split(mean)
            work = self.dt * float(force @ speed + moment @ (self._turn @ spin))
        moved, dim = self._q[: self._dim] + self.dt * mean[: self._dim], self._dim
        angle = self._q[2:] + 2.0 * np.arctan(self._half[2:])
        turned = angle if dim == 2 else _turned(self._q[3:], self._half)
        self._q = np.concatenate([moved, turned])
        self._v = self._ahead = self._ahead if self._leaving is None else self._leaving
        self._begin()
        return self._summed(work)

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """Sums of the initial state."""
        return self._summed(0.0)

    def inertia(self) -> list[Floats]:
        """0: its attitude is summed up, which steps do not turn by just its mean spin."""
        turns = self._dim * (self._dim - 1) // 2
        return [np.zeros((turns, turns))]

    def _summed(self, work: float) -> list[Sums]:
        dim, bodies, mass = self._dim, self.bodies, self._mass
        none, turns = np.zeros(dim), dim * (dim - 1) // 2
        if not self.counts:
            return [Sums(0.0, 0.0, 0.0, none, none, np.zeros(turns), np.zeros(2 * dim**2))]
        speed, spin = self._split(self._v)
        own = bodies.inertia @ spin
        kinetic = 0.5 * (mass * float(speed @ speed) + float(spin @ own))
        moved = mass * (self._q[:dim] - bodies.position[:dim])
        rotated = self._turn
        own = rotated @ own
        if dim == 2:
            size, rotated = bodies.inertia[2, 2], rotated[:2, :2]
            second = 0.5 * size * np.eye(2)
        else:
            size = np.trace(bodies.inertia)
            second = 0.5 * size * np.eye(3) - rotated @ bodies.inertia @ rotated.T
        # Its polar factor is asked for only: of a rod the moments of mass would not have one.
        attitude = np.concatenate([(size * rotated).ravel(), second.ravel()])
        return [Sums(kinetic, 0.0, work, mass * speed[:dim], moved, own[3 - turns :], attitude)]

    def motion(self, body: int) -> dict[str, Floats]:  # noqa: ARG002  (it is one)
        """Fields at these places now: displacement [m], velocity [m/s], (nodes, dim)."""
        places, rest = self._pictured(self._q), self._pictured(self.bodies.position)
        speed, spin = self._split(self._v)
        centre, turn = frame(self._q)
        velocity = speed + (in_space(places) - centre) @ _skew(turn @ spin).T
        return {"displacement": places - rest, "velocity": velocity[:, : self._dim]}

    def _pictured(self, q: Floats) -> Floats:
        """Places [m] of contact nodes, then of the points of the picture, (nodes, dim)."""
        centre, turn = frame(q)
        arms = np.vstack([self.bodies.arms, self.bodies.picture[0]])
        return np.asarray((centre + arms @ turn.T)[:, : self._dim])

    def acting(self, body: int, forces: Floats) -> Floats:  # noqa: ARG002  (it is one)
        """Contact forces [N] at these places by those on the contact nodes, (nodes, dim) each.

        What acts on nodes that stand for the whole body is shown as its resultant, at the point of
        the picture where that comes in.
        """
        own, (points, _) = self.bodies.markers, self.bodies.picture
        shown, others = forces, np.zeros((len(points), self._dim))
        if len(own) and forces[own].any():
            shown = forces.copy()
            shown[own] = 0.0
            each = in_space(forces[own])
            force, moment = each.sum(axis=0), _moments(self._acting[own], each)
            if (size := float(np.linalg.norm(force))) > 0.0:
                way = force / size
                beside = points @ self._turn.T - np.cross(way, moment) / size
                along = beside @ way
                off = np.linalg.norm(beside - along[:, None] * way, axis=1)
                others[np.argmin(off + np.maximum(along, 0.0))] = force[: self._dim]
        return np.vstack([shown, others])


_NOTHING, _NOWHERE = np.zeros(3), np.zeros((1, 3))


def _skew(vectors: Floats) -> Floats:
    """Matrices that make cross products with vectors on the left, (..., 3, 3)."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.asarray(np.moveaxis(np.array(rows), (0, 1), (-2, -1)))


def _moments(arms: Floats, forces: Floats) -> Floats:
    """Sum of the moments of forces (..., nodes, 3), (..., 3)."""
    each = arms.T @ forces
    parts = [each[..., i, j] - each[..., j, i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack(parts, axis=-1)


def _turned(quaternion: Floats, half: Floats) -> Floats:
    """A unit quaternion turned further, about an axis of the body by 2 atan |half|."""
    (w, x, y, z), (a, b, c) = quaternion.tolist(), half.tolist()
    found = [
        w - x * a - y * b - z * c,
        w * a + x + y * c - z * b,
        w * b + y + z * a - x * c,
        w * c + z + x * b - y * a,
    ]
    return np.array(found) / math.hypot(*found)
