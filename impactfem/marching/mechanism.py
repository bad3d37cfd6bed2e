"""Layers of a mechanism: an energy-momentum step in minimal coordinates.

With v = (v_a + v_b) / 2, q_b after the way dt v, M_a and M_b at both ends and the rest amid,

    M_b v_b - M_a v_a = dt (C^T v + m J_c^T g + tau + x M_a v) + P,

where x is such that without tau and P the energy stays: then, with c the centre of mass,

    dt v.(C^T v + m J_c^T g + x M_a v) = v_a.(M_b - M_a) v_b / 2 + m g.(c_b - c_a),

for v.(M_b v_b - M_a v_a) is the change of v.M v / 2 plus v_a.(M_b - M_a) v_b / 2. The discrete
gradient of Gonzalez (J. Nonlinear Sci. 6 (1996) 449-467) does the same to Hamilton's equations.
x is of second order in the step, and so are the errors of the motion. The rows of a free base are
the balances of momentum and of angular momentum in space, R_b pi_b - R_a pi_a + dt v x p, whose
power is the same since the base turns about v; x acts in the joints only, so that momenta stay.
The forces of a layer on its contact nodes have the power F.J v, J of the places amid the layer.
"""

from collections.abc import Mapping

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.errors import ConvergenceError
from impactfem.marching.few import FewInterior
from impactfem.marching.held_tree import Chords, HeldTree
from impactfem.marching.iterated import SHARE, by_energy
from impactfem.marching.joint_laws import STICKS, JointLaws
from impactfem.marching.layers import Sums
from impactfem.marching.mechanism_start import MechanismAtRest
from impactfem.marching.meshless import step_length
from impactfem.marching.pictured import Pictured
from impactfem.marching.stations import Held
from impactfem.result.history import LOST
from impactfem.scene import PiecewiseVector
from impactfem.scene.jets import motion_at
from impactfem.system.mechanism import Arm
from impactfem.system.stations import Stations
from impactfem.system.tree import cross

_MOST, _SETTLED = 100, 1e-14  # iterates of a layer, and their change as a share of the rates
_EPSILON = float(np.finfo(float).eps)
_ROUNDS = 8.0  # by which energies round
_LEAST = 1e6  # of these, beside twice the kinetic energy: below it x would be but rounding
_TURNED = 0.03  # share of the kinetic energies of both ends that the mean rates keep in impacts
_SHARE = 1e-6  # of positions and rates by which motors are differentiated


class MechanismMidpoint(FewInterior):
    """Interior of a mechanism; see `impactfem.marching.layers.Interior`.

    Attributes:
        span: Of the step [s].
    """

    bodies: Arm

    def __init__(
        self, bodies: Arm, gravity: PiecewiseVector, dt: float, *, counts: bool, exact: bool = False
    ) -> None:
        """Begin at t = 0; see `FewInterior`.

        Args:
            bodies: The mechanism.
            gravity: [m/s^2].
            dt: Time step [s].
            counts: Whether this rank sums it up.
            exact: Whether contact forces act by the discrete Jacobian D of `held_tree`: what
                touches at a link goes by D v dt, exactly as the tree has it at both ends of a step,
                and forces do their work on these ways. Joints are then solved for with every force.
        """
        super().__init__(bodies, gravity, dt, counts=counts)
        self.shown = Pictured(self, bodies.picture[2])
        self._angle = bodies.angles_at_start.copy()
        self._lost = np.zeros_like(self._angle)  # what dampers, friction and limits took [J]
        self.span, count = dt, len(self._start)
        self.massive = self.volatile = np.ones(count, dtype=bool)
        self._rolls = bool(bodies.rolling.any() or bodies.following.any())
        self._laws = JointLaws.at_rest(bodies.joints)
        self._leans = False  # whether contact forces acted in the last layer
        self._offset = bodies.following  # from nodes to where they touch
        # Whether a free base turns by Cayley's rotation, as joints and exact ways need it.
        self._exact, self._chords = exact, exact and bodies.tree.free
        self._begin()
        self._inverse = np.linalg.inv(self._inertia)
        self._acting = self._start - self._centre  # where nodes touch amid the layer, (nodes, 3)
        self._jacobian = np.zeros((3 * count, bodies.tree.rates))

    @property
    def rolling(self) -> bool:
        """Whether it touches at places that change."""
        return self._rolls

    def _begin(self) -> None:
        """What the next layer starts from."""
        tree = self.bodies.tree
        self._inertia, self._centre = tree.inertia(self._q), tree.centre(self._q)
        self._placed = self.bodies.places(self._q)
        self._momentum, self._pushed = self._inertia @ self._v, np.zeros(tree.rates)
        self._joined, self._kick, self._jumps = *np.zeros((2, tree.rates)), False
        # The joints give what energy lacks: the momenta of a free base stay.
        self._inner = slice(6 * (tree.free and tree.rates > 6), None)
        self._balance = self._inertia[self._inner, self._inner]
        self._whole = float(self._v[self._inner] @ self._balance @ self._v[self._inner])

    def memory(self) -> dict[str, Floats]:
        """Coordinates, rates, positions counted over turns, what joints took, their states."""
        states = np.append(self._laws.states, self._leans).astype(float)
        own = {"angles": self._angle.copy(), "lost": self._lost.copy(), "states": states}
        return super().memory() | own

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        self._angle, self._lost = memory["angles"].copy(), memory["lost"].copy()
        states = memory["states"].astype(int)
        self._laws.states, self._leans = states[:-1], bool(states[-1])
        self._ahead = self._v.copy()
        self._begin()

    def at_rest(self) -> MechanismAtRest:
        """It as the search for equilibrium asks it."""
        return MechanismAtRest(self)

    def put(self, q: Floats, way: Floats) -> None:
        """Begin at some coordinates, to which the rates have gone a way (v,)."""
        self._q, self._angle = q, self._angle + way
        self._ahead = self._v.copy()
        self._begin()

    @property
    def surface_velocity(self) -> Floats:
        """Of the contact nodes [m/s], (count, dim)."""
        return self._velocities(self._q, self._v, 0.0 * self._offset)

    def _velocities(self, q: Floats, v: Floats, offset: Floats) -> Floats:
        """Of places at some offsets from the contact nodes [m/s], (nodes, 3)."""
        bodies = self.bodies
        turns, _ = bodies.tree.poses(q, bodies.moving)
        moving = (bodies.tree.jacobians(q, bodies.moving) @ v)[bodies.on]
        arms = np.einsum("kij,kj->ki", turns[bodies.on], bodies.arms) + offset
        return np.asarray(moving[:, :3] + cross(moving[:, 3:], arms))

    def begin(self, start: float, end: float) -> None:
        """Solve the step without contact forces.

        Where these acted in the last one, joints stay as they were then: forces are asked so.
        """
        self.set_out(start, end)
        self.look()

    def set_out(self, start: float, end: float) -> None:
        """Take up a step between two times, without contact forces."""
        self.span, self._time = step_length(start, end, self.dt), 0.5 * (start + end)
        self._pull = self.gravity(start, end)
        self._pushed, self._joined = np.zeros((2, len(self._v)))
        if self._exact:
            turns, places = self.bodies.tree.poses(self._q, self.bodies.moving)
            self._begun, self._leans, self._jumps = (places, turns), False, False
        self._laws.lead(*self._ends_of_time, self._angle, self._v)
        self._prepare()
        self._settle(settled=self._leans)
        self._frozen, self._leans = self._leans, False

    @property
    def surface_iterate(self) -> Floats:
        """Displacement of the contact nodes at its end, when it was looked at last [m]."""
        return self._iterated

    def look(self) -> None:
        """See where contact nodes are as the step is solved now, and how forces act on them."""
        middle, end = self.way(0.5), self.way(1.0)
        bodies, tree = self.bodies, self.bodies.tree
        if self._exact:
            chords = Chords.of(self, bodies.moving, self._begun)
            self._links = chords.rows.reshape(len(bodies.moving), 6, -1)
            there = 0.5 * (self._begun[0] + chords.ends[0])
        else:
            _, there = tree.poses(middle, bodies.moving)
            self._links = tree.jacobians(middle, bodies.moving)
            self._offset = bodies.following
        if tree.free:
            self._base = middle[:3] - self._q[:3], tree.base(middle)
        ended, origins = bodies.places(end), there[bodies.on]
        # Forces act at means of both ends, where gaps have them: all moments stay.
        self._spans = 0.5 * (self._placed + ended) - origins
        self._amid = origins - tree.centre(middle)
        self._renew_answer()
        self._iterated = np.asarray(ended - self._start)

    def way(self, share: float) -> Floats:
        """Coordinates after a share of the layer."""
        way = 0.5 * self.span * (self._v + self._ahead)
        if self._chords:
            half = 0.5 * float(np.linalg.norm(way[3:6]))
            way[3:6] *= np.arctan(half) / half if half else 1.0
        return self.bodies.tree.integrate(self._q, share * way)

    def _prepare(self) -> None:
        """Invert M + dt D / 2 + dt^2 K / 4, with K and D of the motors and dampers."""
        level = self.bodies.tree.mass * float(np.abs(self._pull) @ np.abs(self._centre))
        self._rounding = _EPSILON * (level + 0.5 * float(self._v @ self._inertia @ self._v))
        self._least = _LEAST * self._rounding + np.finfo(float).tiny
        self._ahead = self._v.copy()
        joints, dt = self.bodies.joints, self.span
        damping, stiffness = joints.damping.copy(), np.zeros_like(joints.damping)
        for sides, found in ((1.0, stiffness), (0.0, damping)) if joints.motors else ():
            step = _SHARE * np.maximum(1.0, np.abs(self._angle if sides else self._v))
            one, two = (
                joints.drive(*self._ends_of_time, self._angle + way * sides * step,
                             self._v + way * (1.0 - sides) * step)
                for way in (-1.0, 1.0)
            )  # fmt: skip
            found[:] += (one - two) / (2.0 * step)
        tangent = self._inertia + np.diag(0.5 * dt * damping + 0.25 * dt**2 * stiffness)
        self._inverse = np.linalg.inv(tangent)
        self._spread = np.abs(self._inverse)  # of what rounds

    def _renew_answer(self) -> None:
        """Ways of the contact nodes by forces on them: limits and friction hold what they do."""
        bodies = self.bodies
        arms = self._spans + self._offset
        links = self._links[bodies.on]
        turning = cross(links[:, 3:].swapaxes(1, 2), arms[:, None, :]).swapaxes(1, 2)
        self._jacobian = (links[:, :3] + turning).reshape(-1, bodies.tree.rates)
        self._acting = self._amid + arms
        self._compliance = 0.5 * self.span**2 * self._jacobian @ self.reach @ self._jacobian.T

    @property
    def reach(self) -> Floats:
        """Rates by unit impulses in the layer, (v, v)."""
        return self._holding(self._inverse)

    @property
    def reach_ahead(self) -> Floats:
        """Rates by unit impulses at its end, which leave no time for motors, (v, v)."""
        return self._holding(np.linalg.inv(self.bodies.tree.inertia(self.way(1.0))))

    def _holding(self, inverse: Floats) -> Floats:
        """Answers with limits and friction that hold what they do, (v, v)."""
        if not len(held := self._laws.held(self._v)[0]):
            return inverse
        rows = inverse[held]
        return np.asarray(inverse - rows.T @ np.linalg.solve(rows[:, held], rows))

    @property
    def rates(self) -> Floats:
        """Of the coordinates at the start of the layer, (v,)."""
        return self._v

    @property
    def rates_ahead(self) -> Floats:
        """At its end, (v,)."""
        return self._ahead

    def held(self, stations: Stations) -> Held:
        """Its links."""
        self._chords = self.bodies.tree.free
        return HeldTree(self, stations)

    def exact(self, rows: Floats, ways: Floats, rounding: Floats) -> Floats:
        """Rows of rates (rows, v) that with the mean ones give `ways` (rows,), but for rounding."""
        along = self._along(mean := 0.5 * (self._v + self._ahead))
        share, missing = 1.0 / (float(along @ mean) + self._least), ways - rows @ mean
        missing[np.abs(missing) <= rounding] = 0.0
        return np.asarray(rows + np.outer(missing, share * along))

    def _along(self, rates: Floats) -> Floats:
        """Momenta of the joints of the tree alone, (v,): those of a free base stay."""
        found = np.zeros_like(rates)
        found[self._inner] = self._balance @ rates[self._inner]
        return found

    def impel(self, impulse: Floats, *, jumps: bool) -> None:
        """Solve the layer with an impulse (v,) of joints with others; whether it turns rates."""
        self._joined, self._jumps = impulse, jumps
        self._settle()

    def strike(self, forces: Floats) -> None:
        """Add the impulses of contact forces (count, dim), to be solved for."""
        self._impel(self.span * (self._jacobian.T @ forces.ravel()))

    def _impel(self, pushed: Floats) -> None:
        """Add impulses (v,) of contact."""
        if self.bodies.tree.free:  # moments about where the base is at the start, in space
            way, turn = self._base
            pushed[3:6] = turn @ pushed[3:6] + cross(way, pushed[:3])
        self._pushed = self._pushed + pushed
        if not self._exact:
            self._leans, self._frozen = True, False

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (count, dim), to be solved for."""
        self._pushed = np.zeros_like(self._v)
        self.strike(forces)

    def settle(self) -> None:
        """Solve for the rates at the end of the step, with what has pushed so far.

        To the end of a step with exact ways the energy stays; where that is too much to ask, as
        rates turn round, it is to the order of the step.
        """
        try:
            self._settle()
        except ConvergenceError:
            if not self._exact:
                raise
            self._leans, self._ahead = True, self._v.copy()
            self._settle()

    def changed(self, ahead: Floats) -> tuple[float, float, float]:
        """By how much rates have changed since, what changes them in the step, and rounding."""
        mean, inertia = 0.5 * (self._v + self._ahead), self._inertia
        acting = self._pushed, self.span * self._drive, inertia @ (self._ahead - self._v)
        causes = *(self._inverse @ one for one in acting), SHARE * mean, SHARE * self._v
        return *by_energy(inertia, self._ahead - ahead, causes), self._allowed

    def reached(self, forces: Floats) -> Floats:
        """Rates by contact forces (several, count, dim) [1/s], (several, v)."""
        return np.asarray(forces.reshape(len(forces), -1) @ self._jacobian @ self.reach)

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses (several, v), (several, count, dim)."""
        return np.asarray((impulses @ self.reach @ self._jacobian.T).reshape(len(impulses), -1, 3))

    @property
    def stopped(self) -> bool:
        """Whether joints are at limits in the layer."""
        return self._laws.stopped

    def kick(self, impulse: Floats) -> None:
        """Let the next layer start with rates that an impulse (v,) has changed."""
        self._kick = self.reach_ahead @ impulse

    def _settle(self, *, settled: bool = False) -> None:
        """Rates at the end of the layer; with the states of its joints unless they are settled."""
        turn, self._impulses = 0, self._iterate()
        while not settled and self._laws.renew(
            self._v, self._ahead, self._ends(), self._impulses, self.span, turn
        ):
            turn, self._impulses = turn + 1, self._iterate()

    @property
    def _ends_of_time(self) -> tuple[float, float]:
        """Of the layer [s]."""
        return self._time - 0.5 * self.span, self._time + 0.5 * self.span

    def _ends(self) -> Floats:
        """Positions of single joints at the end of the layer, counted over turns, (v,)."""
        return np.asarray(self._angle + 0.5 * self.span * (self._v + self._ahead))

    def _iterate(self) -> Floats:
        """Solve for the rates with given states of the joints; impulses of what is held, (v,)."""
        bodies, dt, v = self.bodies, self.span, self._v
        tree, joints = bodies.tree, bodies.joints
        held, rates = self._laws.held(v)
        given = self._joined + self._laws.rubbing(dt) + self._momentum
        impulses, hold = np.zeros(len(v)), self._inverse[np.ix_(held, held)]
        struck = self._leans or self._jumps or self._laws.stopped
        for _ in range(_MOST):
            mean = 0.5 * (v + self._ahead)
            middle, end = self.way(0.5), self.way(1.0)
            inertia, centre = tree.inertia(end), tree.centre(end)
            force = tree.whirl(middle, mean)
            force += tree.mass * (self._pull @ tree.centre_jacobian(middle))
            momentum, turned, pushed = inertia @ self._ahead, np.zeros(len(v)), self._pushed
            if tree.free:
                amid, ends = tree.base(middle), tree.base(end)
                whole = 0.5 * (self._momentum[:3] + momentum[:3])
                force[3:6] -= amid.T @ cross(mean[:3], whole)
                moment = pushed[3:6] - cross(middle[:3] - self._q[:3], pushed[:3])
                pushed = np.concatenate([pushed[:3], amid.T @ moment, pushed[6:]])
                half = amid.T @ ends
                turned[3:6] = half.T @ self._momentum[3:6] - self._momentum[3:6]
                turned[3:6] -= half @ momentum[3:6] - momentum[3:6]
            along = self._along(mean)
            gained = 0.5 * float(v @ (inertia - self._inertia) @ self._ahead)
            gained += tree.mass * float(self._pull @ (centre - self._centre))
            twice = float(along @ mean)
            share = 1.0 / (twice + self._least)
            inner = self._ahead[self._inner]
            kept = _TURNED * (self._whole + float(inner @ self._balance @ inner))
            if struck and kept > self._least:  # what turns round has no mean to make x of
                share *= -np.expm1(-((twice / kept) ** 2))
            force += (gained / dt - float(force @ mean)) * share * along
            self._drive = joints.drive(*self._ends_of_time, self._angle + 0.5 * dt * mean, mean)
            force += self._drive - joints.damping * mean
            missing = dt * force + given + pushed + turned - momentum
            change = self._inverse @ missing
            if len(held):
                needed = np.linalg.solve(hold, rates - self._ahead[held] - change[held])
                change = change + self._inverse[:, held] @ needed
                impulses[held] = needed
            self._ahead = self._ahead + change
            if not np.isfinite(self._ahead).all():
                break
            allowed = _SETTLED * np.abs(self._ahead).max() + np.finfo(float).tiny
            allowed += _ROUNDS * self._rounding * share * np.abs(mean).max()
            # At rest what holds, pushes and pulls cancels to rounding of each.
            parts = dt * force, dt * self._drive, momentum, given, pushed, impulses
            allowed += _ROUNDS * _EPSILON * float((self._spread @ sum(map(np.abs, parts))).max())
            self._allowed = allowed
            if np.abs(change).max() <= allowed:
                return impulses
        raise ConvergenceError(
            f"the motion of {bodies.names[0]} did not settle at t = {self._time:.6g} s; use a "
            "smaller solve.dt"
        )

    @property
    def touching_velocity(self) -> Floats:
        """Of what touches, at the start of the step [m/s], (count, dim)."""
        return self._velocities(self._q, self._v, self._offset)

    @property
    def surface_way(self) -> Floats:
        """How far what touches moves in the step, as it is solved now [m], (count, dim)."""
        way = 0.5 * self.span * (self._v + self._ahead)
        return np.asarray((self._jacobian @ way).reshape(-1, 3))

    @property
    def velocity_ahead(self) -> Floats:
        """Of the contact nodes at the end of the step, as it is solved now [m/s], (count, dim)."""
        return self._velocities(self.way(1.0), self._ahead, 0.0 * self._offset)

    def jolt(self, impulses: Floats) -> None:
        """Change the rates now by impulses on what touches [N s], (count, 3)."""
        bodies, tree = self.bodies, self.bodies.tree
        turns, _ = tree.poses(self._q, bodies.moving)
        links = tree.jacobians(self._q, bodies.moving)[bodies.on]
        arms = np.einsum("kij,kj->ki", turns[bodies.on], bodies.arms) + self._offset
        acting = np.einsum("kiv,ki->v", links[:, :3], impulses)
        acting += np.einsum("kiv,ki->v", links[:, 3:], cross(arms, impulses))
        inverse, led = np.linalg.inv(self._inertia), self._laws.driven
        jumped = inverse @ acting
        if len(led):
            held = np.linalg.solve(inverse[np.ix_(led, led)], jumped[led])
            jumped = jumped - inverse[:, led] @ held
        self._v = self._v + jumped
        self._ahead = self._v.copy()
        self._begin()

    def drift(self, span: float) -> None:
        """Go on for a time [s] at the rates now, without forces."""
        self._q = self.bodies.tree.integrate(self._q, span * self._v)
        self._angle = self._angle + span * self._v
        self._begin()

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        there = self.bodies.tree.integrate(self._q, (end - start) * self._v)
        return self.bodies.places(there) - self._start

    def touch(self, normals: Floats) -> None:
        """Learn where links that roll touch, by the normals of their nodes (count, dim)."""
        self._offset = self.bodies.following - self.bodies.rolling[:, None] * normals
        self._renew_answer()

    def touched(self, normals: Floats) -> Floats:
        """Learn where nodes touch; ways that their surface goes in the layer besides [m].

        Args:
            normals: Of the gaps of nodes, towards them, (count, dim).
        """
        self.touch(normals)
        spins = (self._links[:, 3:] @ (0.5 * (self._v + self._ahead)))[self.bodies.on]
        return np.asarray(self.span * cross(spins, self._offset))

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002  (of others)
        """Velocities where nodes touch at both ends of the layer without contact forces."""
        before = self._velocities(self._q, self._v, self._offset)
        return before, self._velocities(self.way(1.0), self._ahead, self._offset)

    def turning(self) -> tuple[Floats, Floats]:
        """Spins of the links of nodes at both ends of the layer, as it is solved now [rad/s]."""
        tree, moving, on = self.bodies.tree, self.bodies.moving, self.bodies.on
        ends = (self._q, self._v), (self.way(1.0), self._ahead)
        before, after = (np.asarray(tree.jacobians(q, moving)[:, 3:] @ v)[on] for q, v in ends)
        return before, after

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """Displacements and turns of nodes by several moments on them; see `Rolling`."""
        spins = self._links[self.bodies.on][:, 3:].reshape(-1, self.bodies.tree.rates)
        ways = 0.5 * self.span**2 * (moments.reshape(len(moments), -1) @ spins @ self.reach)
        moved, turned = (np.asarray(ways @ rows.T) for rows in (self._jacobian, spins))
        return moved.reshape(moments.shape), turned.reshape(moments.shape)

    def twist(self, moments: Floats) -> None:
        """Add the layer's moments on nodes (count, turns)."""
        spins = self._links[self.bodies.on][:, 3:].reshape(-1, self.bodies.tree.rates)
        self._impel(self.span * (spins.T @ moments.ravel()))
        self.settle()

    def spins(self) -> Floats:
        """Velocities where nodes touch by unit spins in the layer [m], (turns, count, dim)."""
        return cross(np.eye(3)[:, None, :], self._acting)

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:  # noqa: ARG002
        """Add the layer's contact forces (count, dim)."""
        self.strike(forces)
        self.settle()

    def finish(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """End the layer and sum up."""
        if self._frozen:  # no contact forces this time
            self._settle()
        return self.summed(self.advance())

    def advance(self) -> float:
        """Take the coordinates and rates that were found; the work of motors [J]."""
        mean, led = 0.5 * (self._v + self._ahead), self._laws.driven
        work = self.span * float(self._drive @ mean) + float(self._impulses[led] @ mean[led])
        pushed = self._impulses + self._laws.rubbing(self.span)
        pushed[led] = 0.0
        self._lost += (self.span * self.bodies.joints.damping * mean - pushed) * mean
        self._angle, end = self._ends(), self.way(1.0)
        self._q, self._v = end, self._ahead + self._kick
        work += self._lead() if len(led) else 0.0
        self._begin()
        return work

    def _lead(self) -> float:
        """Give driven joints their rates at the end of the layer; the work of that [J].

        In the layer they go where they have to be, with rates of which the mean is right.
        """
        laws, end = self._laws, self._ends_of_time[1]
        joints = laws.joints.driven
        rates = np.array([motion_at(joints[at], end).rate for at in laws.driven])
        held = np.concatenate([laws.driven, np.flatnonzero(laws.states == STICKS)])
        inverse, missing = np.linalg.inv(self.bodies.tree.inertia(self._q)), np.zeros(len(held))
        missing[: len(rates)] = rates - self._v[laws.driven]
        impulse = np.linalg.solve(inverse[np.ix_(held, held)], missing)
        before, self._v = self._v, self._v + inverse[:, held] @ impulse
        return float(impulse @ (0.5 * (before + self._v))[held])

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """Sums of the initial state."""
        return self.summed(0.0)

    def summed(self, work: float) -> list[Sums]:
        """Sums now, with the work of motors since the last ones [J]."""
        if not self.counts:
            return [Sums(0.0, 0.0, 0.0, *np.zeros((3, 3)))]
        tree = self.bodies.tree
        moved = tree.mass * (self._centre - self.bodies.centers[0])
        kinetic = 0.5 * float(self._v @ self._inertia @ self._v)
        momentum, angular = tree.momenta(self._q, self._v)
        return [Sums(kinetic, 0.0, work, momentum, moved, angular)]

    # ---- what is seen of it --------------------------------------------------------------------

    def told(self) -> dict[str, dict[str, float]]:
        """Positions, rates and losses of joints, by the first parts of their columns."""
        name, tree = self.bodies.names[0], self.bodies.tree
        found = {
            f"{name}.{joint}": {
                "q": float(self._angle[at]),
                "v": float(self._v[at]),
                LOST: float(self._lost[at]),
            }
            for joint, at in tree.single.items()
        }
        for joint, (of, ratio, offset) in tree.followers.items():
            q, v = (found[f"{name}.{of}"][key] for key in ("q", "v"))
            found[f"{name}.{joint}"] = {"q": ratio * q + offset, "v": ratio * v, LOST: 0.0}
        if tree.free:
            turned = self._q[[6, 3, 4, 5]]
            spin = tree.base(self._q) @ self._v[3:6]
            found[f"{name}.{tree.root}"] = {
                **dict(zip("xyz", self._q[:3].tolist(), strict=True)),
                **dict(zip(("vx", "vy", "vz"), self._v[:3].tolist(), strict=True)),
                **dict(zip(("qw", "qx", "qy", "qz"), turned.tolist(), strict=True)),
                **dict(zip(("wx", "wy", "wz"), spin.tolist(), strict=True)),
            }
        return found

    def pictured(self, q: Floats) -> Floats:
        """Places [m] of contact nodes, then of the points of the picture, (nodes, dim)."""
        bodies = self.bodies
        turns, origins = bodies.tree.poses(q, bodies.moving)
        on = np.concatenate([bodies.on, bodies.picture[0]])
        arms = np.vstack([bodies.arms, bodies.picture[1]])
        return np.asarray(origins[on] + np.einsum("kij,kj->ki", turns[on], arms))

    def pictured_speeds(self, places: Floats) -> Floats:
        """Velocities of what is at the places of these now [m/s], (nodes, dim)."""
        bodies, tree = self.bodies, self.bodies.tree
        _, origins = tree.poses(self._q, bodies.moving)
        on = np.concatenate([bodies.on, bodies.picture[0]])
        moving = (tree.jacobians(self._q, bodies.moving) @ self._v)[on]
        return np.asarray(moving[:, :3] + cross(moving[:, 3:], places - origins[on]))

    def leaning(self, nodes: Integers) -> tuple[Floats, Integers, Floats]:
        """Where markers of a carrier were in the last layer [m], (nodes, 3), from some place.

        And which points of the picture move with them, (points,), and are where from there [m].
        """
        points = np.flatnonzero(self.bodies.picture[0] == self.bodies.on[nodes[0]])
        places = self.pictured(self._q)[len(self._start) + points]
        return self._acting[nodes], points, places - self.bodies.tree.centre(self._q)
