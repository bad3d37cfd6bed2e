"""Layers of rigid bodies: the midpoint rule for their centres, `turn_kernels` for their rotations.

The force F of a layer on a contact node acts where the body touches amid the layer, with the arm a
from its centre: it gives the impulse dt F and the impulse of its moment dt a x F.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.spatial.transform import Rotation

from impactfem.arrays import Floats, Integers
from impactfem.contact.pair_responses import Roots
from impactfem.errors import ConvergenceError
from impactfem.marching.iterated import SHARE
from impactfem.marching.layers import SumsTable
from impactfem.marching.meshless import Meshless, step_length
from impactfem.marching.rigid_kernels import (
    around,
    arrived,
    carried,
    flown,
    frames,
    gathered,
    looked_at,
    placed,
    rolled_to,
    root_entries,
    settled,
    spun,
    struck,
    summed,
    touched_at,
    turned_further,
    velocities_of,
    whirls,
)
from impactfem.marching.rigid_start import RigidAtRest
from impactfem.marching.rigid_sums import about_axes, applied, on_bodies
from impactfem.marching.turn_kernels import LARGEST
from impactfem.scene import PiecewiseVector
from impactfem.system.rigid import Rigid, in_space

_REMEMBERED = ("centre", "angles", "speed", "spin", "normals", "lowest")
_ROUNDS = 16.0  # by which impulses round
_WHOLE = 1.0  # largest tan of a quarter turn that is foretold
_MOST, _SETTLED = 50, 1e-13  # iterates of forces by formula, and their change


class RigidBodies(Meshless):
    """Interior of rigid bodies that move each by itself; see `impactfem.marching.layers.Interior`.

    Everything is kept in space, (bodies, 3): a body in the plane turns about z only.

    Attributes:
        apart: Body of each contact node.
        owns: Contact nodes of each body.
        acting: From the centres to where nodes touch amid the layer [m], (nodes, 3).
        end: Rotations at the end of the layer, as it is solved now, (bodies, 3, 3).
        freedom: Inverse moments of inertia in space amid it, (bodies, 3, 3).
    """

    def __init__(
        self, bodies: Sequence[Rigid], gravity: PiecewiseVector, dt: float, *, counts: bool,
        exact: bool = False,
    ) -> None:  # fmt: skip
        """Begin at t = 0; see `impactfem.marching.few.FewInterior`.

        Args:
            bodies: What moves.
            gravity: [m/s^2].
            dt: Time step [s].
            counts: Whether this rank sums the bodies up.
            exact: Whether what touches moves by T x (its mean arm) in a step, T straight, so that
                forces amid it do exactly their work (`impactfem.marching.turn_kernels.turn`).
        """
        super().__init__(gravity, dt, counts=counts)
        self._span, self._straight = dt, exact  # of the step
        self._bodies, self._dim = tuple(bodies), bodies[0].dim
        dim, sizes = self._dim, [len(each.arms) for each in bodies]
        ends = np.cumsum([0, *sizes])
        self.owns = [slice(*both) for both in pairwise(ends.tolist())]
        self.apart: Integers = np.repeat(np.arange(len(bodies)), sizes)
        self._free = np.array([each.free for each in bodies])
        self._turns_freely = bool(self._free.any())
        self._mass = np.array([each.masses[0] for each in bodies])[:, None]
        self._inertia = np.array([each.inertia for each in bodies])
        self._inverse = np.linalg.inv(self._inertia)
        self._given = self._mass, self._inertia, self._inverse, self._free
        self._all = np.arange(len(bodies))
        self._gyration = np.sqrt(np.trace(self._inertia, axis1=1, axis2=2)[:, None] / self._mass)
        self._arms = np.concatenate([each.arms for each in bodies])
        self._following = np.concatenate([each.followers for each in bodies])
        self._roll = np.concatenate([each.rolling for each in bodies])[:, None]
        self._straight_on = np.zeros_like(self._arms)  # from nodes to what touches with none
        self._circles, self._rimmed = _rims_of(bodies), any(b.rims is not None for b in bodies)
        self._undriven = np.array([each.loads is None for each in bodies])
        self._driven = [(k, each.loads) for k, each in enumerate(bodies) if each.loads is not None]
        self.massive = self.volatile = np.ones(ends[-1], dtype=bool)
        self.radiating = ~self.massive
        self._root_ends = np.arange(dim * ends[-1] + 1) * (1 + dim * (dim - 1) // 2)
        self._roots: csr_matrix | None = None
        self._rolls = bool(self._roll.any() or self._following.any() or self._rimmed)
        self._offset = self._following  # from nodes to where they touch
        self._loads = np.zeros((2, len(bodies), 3))
        self._applied: Floats | None = None  # forces and moments from outside, (2, bodies, 3)
        self._weight = self._mass * in_space(self.gravity(0.0, 0.0))
        q, v = (np.array([getattr(e, name) for e in bodies]) for name in ("position", "velocity"))
        self._centre, self._angles = in_space(q[:, :dim]), q[:, dim:].copy()
        self._speed, self._spin = in_space(v[:, :dim]), about_axes(v[:, dim:])
        self._first = self._centre.copy()
        # Of what rims touch, and where on them.
        self._normals = np.concatenate([each.normals for each in bodies])
        self._lowest = np.concatenate([each.lowest for each in bodies])
        self._start = np.zeros((len(self._arms), dim))
        self._begin()
        self._start = self.surface_displacement
        self._begin()
        self.end: Floats = self._turn
        self.freedom: Floats = self._turn @ self._inverse @ self._turn.swapaxes(1, 2)
        self.acting: Floats = self._bare + self._around(self._turn)
        self._begun = self._around(self._turn)

    @property
    def rolling(self) -> bool:
        """Whether it touches at places that change."""
        return self._rolls

    def _around(self, rotations: Floats) -> Floats:
        """The part of the arms of nodes in space that is along rims [m], (nodes, 3)."""
        return np.asarray(around(rotations, self.apart, *self._rims))

    @property
    def _rims(self) -> tuple[tuple[Floats, Floats], Floats, Floats]:
        """Rims, what they touch and where on them."""
        return self._circles, self._normals, self._lowest

    def _begin(self) -> None:
        """What the next layer starts from."""
        self._turn = frames(self._angles)
        self._bare, self._displacement = self._places(self._centre, self._turn)
        self._forget()

    def _forget(self) -> None:
        """Begin a layer without what was solved in the one before."""
        self._pushed, self._turned = np.zeros((2, *self._speed.shape))
        self._speed_ahead, self._spin_ahead = self._speed, self._spin
        self._leaving: tuple[Floats, Floats] | None = None

    def memory(self) -> dict[str, Floats]:
        """Coordinates, their rates, and what rims touch."""
        return {name: getattr(self, f"_{name}").copy() for name in _REMEMBERED}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        for name in _REMEMBERED:
            setattr(self, f"_{name}", memory[name].copy())
        self._begin()

    def coordinates(self, body: int) -> Floats:
        """Centre and angles of a body, as `impactfem.system.rigid` has them."""
        return np.concatenate([self._centre[body, : self._dim], self._angles[body]])

    def _velocities(self, *, ahead: bool, beyond: Floats) -> Floats:
        """Of places with more than the arms of nodes in space (nodes, 3) [m/s], (nodes, dim).

        At the start of the step or at its end.
        """
        turn, arms = (self.end, self._ended) if ahead else (self._turn, self._bare)
        rates = self.rates_ahead if ahead else self.rates
        along = arms, self._rims, beyond
        return np.asarray(velocities_of(turn, rates, self.apart, *along, self._dim))

    @property
    def surface_velocity(self) -> Floats:
        """Of the contact nodes [m/s], (count, dim)."""
        return self._velocities(ahead=False, beyond=self._straight_on)

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes since t = 0 [m], (count, dim)."""
        return self._displacement

    def _places(self, centres: Floats, rotations: Floats) -> tuple[Floats, Floats]:
        """Arms in space but for rims (nodes, 3), and displacements of the nodes [m]."""
        more = self._arms, self._around(rotations), self._start
        bare, found = placed(rotations, centres, self.apart, *more)
        return bare, found

    def begin(self, start: float, end: float) -> None:
        """Solve the step without contact forces."""
        if self._driven:
            self.set_out(start, end)
            self.settle()
            self.look()
            return
        self._take_up(start, end)
        force, moment = self._loads if self._applied is None else self._applied
        given = self._turn, self._centre, self._speed, self._spin, force + self._weight, moment
        places = self.apart, self._arms, self._rims, self._offset, self._start
        found = flown(self._given, *given, self._span, self._straight, places)
        lost, ahead, self._pushed, self._turned, looks = found
        if lost >= 0:
            raise self._too_far(lost)
        self._speed_ahead, self._spin_ahead, self._half, *turns = ahead
        self.end, self._middle, self.freedom = turns
        self._amid, self._ended, self.acting, self._iterate, self._begun, self._lowest = looks

    def _take_up(self, start: float, end: float) -> None:
        self._span, self._time = step_length(start, end, self.dt), 0.5 * (start + end)
        if not self._gravity.is_constant:
            self._weight = self._mass * in_space(self.gravity(start, end))

    def set_out(self, start: float, end: float) -> None:
        """Take up a step between two times."""
        self._take_up(start, end)
        self._pushed, self._turned, self._half = np.zeros((3, *self._speed.shape))
        self.end, self._middle, self.freedom = np.empty((3, *self._turn.shape))
        self._speed_ahead, self._spin_ahead = self._speed.copy(), self._spin.copy()

    @property
    def surface_iterate(self) -> Floats:
        """The same at the end of the step, when it was looked at last."""
        return np.asarray(self._iterate)

    def look(self) -> None:
        """See where contact nodes are as the step is solved now, and how forces act on them."""
        turns, rates = (self._turn, self._middle, self.end), (self._speed, self._speed_ahead)
        places = self.apart, self._arms, self._rims, self._offset, self._start
        found = looked_at(turns, self._centre, rates, 0.5 * self._span, *places)
        self._amid, self._ended, self.acting, self._iterate, self._begun, self._lowest = found

    def settle(self) -> None:
        """Solve for the rates at the end of the step, with what has pushed so far."""
        self._settle(self._all)

    def _settle(self, chosen: Integers) -> None:
        """The same of some bodies."""
        rates = self._speed_ahead, self._spin_ahead
        ahead = *rates, self._half, self.end, self._middle, self.freedom
        for _ in range(_MOST):
            known = (self._speed_ahead.copy(), self._spin_ahead.copy()) if self._driven else None
            lost = settled(
                self._given, self._turn, self._speed, self._spin, self.impulses(), self._span,
                chosen, self._straight, ahead,
            )  # fmt: skip
            if lost >= 0:
                raise self._too_far(lost)
            if known is None:
                break
            chosen = chosen[~self._same(known)[chosen]]
            if not len(chosen):
                break
        else:
            raise ConvergenceError(
                f"the forces on {self._bodies[chosen[0]].names[0]} did not settle at t = "
                f"{self._time:.6g} s; use a smaller solve.dt"
            )

    def _too_far(self, body: int) -> ConvergenceError:
        return ConvergenceError(
            f"{self._bodies[body].names[0]} turns too far in a step at t = {self._time:.6g} s: "
            "use a smaller solve.dt"
        )

    def impulses(self) -> tuple[Floats, Floats]:
        """Of forces and moments in the layer without those of joints [N s], [N m s]."""
        dt = self._span
        for k, loads in self._driven:
            mean = 0.5 * (self._speed[k] + self._speed_ahead[k])
            place = self._centre[k] + 0.5 * dt * mean
            ends = self._time - 0.5 * dt, self._time + 0.5 * dt
            self._loads[:, k] = loads(*ends, place, mean, self._whirl(k))
        if self._applied is None and not self._driven:
            return dt * self._weight + self._pushed, self._turned
        force, moment = self._loads if self._applied is None else self._loads + self._applied
        return dt * (force + self._weight) + self._pushed, dt * moment + self._turned

    def apply(self, body: int, force: Floats, moment: Floats) -> None:
        """Hold a force and a moment about its centre on a body until it is given others.

        Args:
            body: Its index.
            force: [N], (dim,).
            moment: [N m], (1,) in the plane, (3,) in space.
        """
        if self._applied is None:
            self._applied = np.zeros_like(self._loads)
        self._applied[:, body] = in_space(force), about_axes(moment)

    @property
    def _far(self) -> float:
        """Spin from which on steps are of many turns [rad/s]."""
        return LARGEST / self._span if self._turns_freely else np.inf

    def _whirl(self, body: int | slice = slice(None)) -> Floats:
        """Mean spins of the layer in space, (3,) or (bodies, 3)."""
        found = whirls(self._turn, self._spin, self.end, self._spin_ahead, self._far)
        return np.asarray(found[body])

    def take(
        self, speeds: Floats, spins: Floats, halves: Floats, ends: Floats, middles: Floats,
        freedoms: Floats, noise: float,
    ) -> bool:  # fmt: skip
        """Take a solution of the layer; whether loads would be the same again.

        Velocities and spins at its end, along the axes of the bodies; the others are those of
        `impactfem.marching.rigid_kernels.turn_all`, and the rounding of velocities [m/s].
        """
        known = self._speed_ahead, self._spin_ahead
        self._speed_ahead, self._spin_ahead, self._half = speeds, spins, halves
        self.end, self._middle, self.freedom = ends, middles, freedoms
        return bool(self._same(known, noise).all())

    def _same(
        self, known: tuple[Floats, Floats], noise: float = float(np.finfo(float).tiny)
    ) -> NDArray[np.bool_]:
        """Whether rates at the end are those known but for rounding, of each body.

        Velocity and spin are looked at together: one of them may be but rounding of the other.
        """
        found = self._undriven.copy()
        if self._driven:
            speeds, spins = self.rates_ahead
            change = np.abs(speeds - known[0]).max(axis=1)
            turn = np.abs(spins - known[1]).max(axis=1)
            radius = self._gyration[:, 0]
            size = np.maximum(np.abs(speeds).max(axis=1), radius * np.abs(spins).max(axis=1))
            found |= np.maximum(change, radius * turn) <= _SETTLED * size + noise
        return found

    @property
    def masses(self) -> Floats:
        """Of the bodies [kg], (bodies,)."""
        return self._mass[:, 0]

    @property
    def inertias(self) -> Floats:
        """Along the axes of the bodies [kg m^2], (bodies, 3, 3)."""
        return self._inertia

    @property
    def shapes(self) -> tuple[Rigid, ...]:
        """The bodies."""
        return self._bodies

    def at_rest(self) -> RigidAtRest:
        """It as the search for equilibrium asks it."""
        return RigidAtRest(self)

    def elsewhere(self, ways: Floats, turns: Floats) -> tuple[Floats, Floats]:
        """Displacements of contact nodes, and their arms in space but for rims [m], (nodes, 3).

        Args:
            ways: Of the centres from where they are [m], (bodies, 3).
            turns: Rotation vectors in space from how they are turned [rad], (bodies, 3).
        """
        rotations = Rotation.from_rotvec(turns).as_matrix() @ self._turn
        bare, found = self._places(self._centre + ways, rotations)
        return found, bare + self._around(rotations)

    def loads_at_rest(self, ways: Floats, turns: Floats) -> Floats:
        """Forces and moments at t = 0 without contact, moved and turned so, (bodies, 6)."""
        rotations = Rotation.from_rotvec(turns).as_matrix() @ self._turn
        found, none = np.zeros((len(ways), 6)), np.zeros(3)
        found[:, :3] = self._mass * in_space(self.gravity(0.0, 0.0))
        for k, loads in self._driven:
            place = self._centre[k] + ways[k]
            found[k] += np.concatenate(loads(0.0, self.dt, place, none, rotations[k] @ none))
        return found

    def put(self, ways: Floats, turns: Floats) -> None:
        """Begin elsewhere; see `elsewhere`."""
        own = np.einsum("bji,bj->bi", self._turn, turns)
        size = np.linalg.norm(own, axis=1, keepdims=True)
        halves = np.tan(0.5 * size) / np.maximum(size, np.finfo(float).tiny) * own
        self._centre = self._centre + ways
        self._angles = turned_further(self._angles, halves, own)
        self._begin()

    def leave(self, speeds: Floats, spins: Floats) -> None:
        """Let the next layer start with other rates than this one ends with."""
        self._leaving = speeds, spins

    @property
    def span(self) -> float:
        """Of the step [s]."""
        return self._span

    @property
    def frame(self) -> tuple[Floats, Floats]:
        """Centres (bodies, 3) and rotations (bodies, 3, 3) at the start of the layer."""
        return self._centre, self._turn

    @property
    def rates(self) -> tuple[Floats, Floats]:
        """Velocities, and spins along the axes of the bodies, at its start, (bodies, 3) each."""
        return self._speed, self._spin

    @property
    def rates_ahead(self) -> tuple[Floats, Floats]:
        """The same at its end, as it is solved now."""
        return self._speed_ahead, self._spin_ahead

    def wrenches(self, forces: Floats) -> Floats:
        """Forces and moments about the centres of contact forces (several, nodes, dim).

        Of shape (several, bodies, 6).
        """
        return np.asarray(gathered(forces, self.apart, self.acting, len(self._mass)))

    def carried(self, moved: Floats) -> Floats:
        """Displacements of the contact nodes by those of bodies, (several, bodies, 6)."""
        each = np.ascontiguousarray(moved[..., :3]), np.ascontiguousarray(moved[..., 3:])
        return np.asarray(carried(*each, self.apart, self.acting, self._dim))

    def touched(self, normals: Floats) -> Floats:
        """Learn where nodes touch; ways that their surface goes in the layer besides [m].

        Args:
            normals: Of the gaps of nodes, towards them, (count, dim).
        """
        turns, spins = (self._turn, self._middle, self.end), (self._spin, self._spin_ahead)
        law = self.apart, self._rims, normals, self._begun, self._amid, self._roll, self._following
        found = touched_at(turns, spins, self._span, self._far, *law, self._dim)
        self._offset, self.acting, ways, self._normals = found
        return np.asarray(ways)

    @property
    def touching_velocity(self) -> Floats:
        """Of what touches, at the start of the step [m/s], (count, dim)."""
        return self._velocities(ahead=False, beyond=self._offset)

    @property
    def surface_way(self) -> Floats:
        """How far what touches moves in the step, as it is solved now [m], (count, dim)."""
        way = 0.5 * self._span * (self._speed + self._speed_ahead)
        turn = 2.0 * applied(self._turn, self._half)
        return np.asarray(carried(way[None], turn[None], self.apart, self.acting, self._dim)[0])

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        span = end - start
        angle = np.linalg.norm(self._spin, axis=1, keepdims=True)
        tangent = np.minimum(np.tan(np.minimum(0.5 * span * angle, 1.5)), _WHOLE)
        half = self._spin * tangent / np.maximum(angle, np.finfo(float).tiny)
        rotations = frames(turned_further(self._angles, half, 2.0 * np.arctan(half)))
        return self._places(self._centre + span * self._speed, rotations)[1]

    def known(self) -> tuple[Floats, Floats]:
        """Rates at the end of the step as it is solved now, to compare others with."""
        speeds, spins = self.rates_ahead
        return speeds.copy(), spins.copy()

    def changed(self, ahead: tuple[Floats, Floats]) -> tuple[float, float, float]:
        """By how much rates have changed since, what changes them in the step, and rounding.

        All as speeds [m/s], those of spins at the radii of gyration.
        """
        left, scale = 0.0, 0.0
        sizes = 1.0, self._gyration
        for new, old, begun, size in zip(self.rates_ahead, ahead, self.rates, sizes, strict=True):
            left = max(left, float((size * np.abs(new - old)).max()))
            change, moving = np.abs(new - begun), SHARE * np.abs(begun)
            scale = max(scale, float((size * np.maximum(change, moving)).max()))
        # What rests is pushed and pulled, and does not move: forces and their moments round.
        acting = np.abs(self._pushed) + self._span * np.abs(self._weight)
        reach = np.zeros(len(self._mass))
        np.maximum.at(reach, self.apart, np.linalg.norm(self.acting, axis=1))
        round_off = acting.max(axis=1) / self._mass[:, 0] * (1.0 + reach / self._gyration[:, 0])
        return left, scale, _ROUNDS * float(np.finfo(float).eps) * float(round_off.max())

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (count, dim), to be solved for."""
        wrench = self._span * self.wrenches(forces[None])[0]
        self._pushed, self._turned = wrench[:, :3].copy(), wrench[:, 3:].copy()

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch, by the normals of their nodes (count, dim)."""
        self._normals = in_space(normals) if self._rimmed else self._normals
        self._roll_on(normals)

    def offsets(self, normals: Floats) -> Floats:
        """From nodes to where they touch, by their normals (count, dim) [m], (count, 3)."""
        return np.asarray(self._following - self._roll * in_space(normals))

    def _roll_on(self, normals: Floats) -> None:
        """Forces act where bodies that roll touch, by the normals of their nodes (count, dim)."""
        more = self._amid, self._around(self._middle)
        self._offset, self.acting = rolled_to(normals, self._roll, self._following, *more)

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002  (of others)
        """Velocities where nodes touch at both ends of the layer without contact forces."""
        before, after = (self._velocities(ahead=e, beyond=self._offset) for e in (False, True))
        return before, after

    @property
    def velocity_ahead(self) -> Floats:
        """Of the contact nodes at the end of the step, as it is solved now [m/s], (count, dim)."""
        return self._velocities(ahead=True, beyond=self._straight_on)

    def jolt(self, impulses: Floats) -> None:
        """Change the rates now by impulses on what touches [N s], (count, dim)."""
        arms = self._bare + self._around(self._turn) + self._offset
        wrench = gathered(impulses[None], self.apart, arms, len(self._mass))[0]
        spun = np.einsum("bij,bkj,bk->bi", self._inverse, self._turn, wrench[:, 3:])
        self._speed = self._speed + wrench[:, :3] / self._mass
        self._spin = self._spin + spun
        self._speed_ahead, self._spin_ahead = self._speed, self._spin

    def drift(self, span: float) -> None:
        """Go on for a time [s] at the rates now, without forces."""
        ways = span * self._spin
        turn = np.linalg.norm(ways, axis=1, keepdims=True)
        halves = np.tan(0.5 * turn) / np.maximum(turn, np.finfo(float).tiny) * ways
        self._centre = self._centre + span * self._speed
        self._angles = turned_further(self._angles, halves, ways)
        self._begin()

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Displacements of the contact nodes by several forces; nothing is massless."""
        wrench = self.wrenches(forces)
        whirl = applied(self.freedom, wrench[..., 3:])
        speeds = wrench[..., :3] / self._mass
        moved = carried(speeds, whirl, self.apart, self.acting, self._dim)
        return 0.5 * self._span**2 * moved, np.zeros_like(forces)

    answers = columns

    def roots(self) -> Roots:
        """Answers of all nodes: of a body they have the rank of its freedom."""
        way, count, dim = np.sqrt(0.5) * self._span, len(self._mass), self._dim
        light = 1.0 / np.sqrt(self._mass[:, 0])
        entries = root_entries(self.apart, self.acting, way * light, way**2 * self.freedom, dim)
        if self._roots is None:
            shape = len(self.apart) * dim, count * dim * (dim + 1) // 2
            self._roots = csr_matrix((*entries, self._root_ends), shape=shape)
        self._roots.data = entries[0]  # in the same places
        return self.massive, self._roots

    def spins(self) -> Floats:
        """Velocities where nodes touch by unit spins in the layer [m], (turns, count, dim)."""
        return np.asarray(spun(self.acting, self._dim))

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:  # noqa: ARG002
        """Add the layer's contact forces (count, dim)."""
        self._settle(self.strike(forces))

    def strike(self, forces: Floats) -> Integers:
        """Add the impulses of contact forces (count, dim), to be solved for; on which bodies."""
        own = self._span, self._pushed, self._turned
        return np.asarray(struck(forces, self.apart, self.acting, *own))

    def turning(self) -> tuple[Floats, Floats]:
        """Spins of nodes at both ends of the layer without contact forces [rad/s]."""
        first, ends = 2 * (3 - self._dim), (self.end, self._spin_ahead)
        before, after = (applied(*each)[:, first:] for each in ((self._turn, self._spin), ends))
        return before[self.apart], after[self.apart]

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """Displacements and turns of nodes by several moments on them; see `Rolling`."""
        whole, first = (
            about_axes(on_bodies(moments, self.apart, len(self._mass))),
            2 * (3 - self._dim),
        )
        turns = 0.5 * self._span**2 * applied(self.freedom, whole)
        moved = carried(np.zeros_like(turns), turns, self.apart, self.acting, self._dim)
        return moved, turns[:, self.apart, first:]

    def twist(self, moments: Floats) -> None:
        """Add moments of the layer on nodes (count, turns)."""
        self._settle(self.whirl(on_bodies(moments[None], self.apart, len(self._mass))[0]))

    def whirl(self, moments: Floats) -> Integers:
        """Add the impulses of moments (bodies, turns), to be solved for; on which bodies."""
        self._turned = self._turned + self._span * about_axes(moments)
        return np.flatnonzero(moments.any(axis=1))

    def finish(self, static: Floats) -> SumsTable:  # noqa: ARG002  (as the interface has it)
        """End the layer and sum up."""
        return self.summed(self.advance())

    def advance(self) -> Floats:
        """Take the rates, places and turns that were found; the work of loads [J], (bodies,)."""
        work, mean = np.zeros(len(self._mass)), np.zeros(0)
        if self._driven or self._applied is not None:
            mean = 0.5 * (self._speed + self._speed_ahead)
        for k, _ in self._driven:
            force, moment = self._loads[:, k]
            work[k] = self._span * float(force @ mean[k] + moment @ self._whirl(k))
        if self._applied is not None:
            force, moment = self._applied
            done = np.einsum("bi,bi->b", force, mean) + np.einsum("bi,bi->b", moment, self._whirl())
            work += self._span * done
        rates = (self._speed, self._speed_ahead), (self._spin, self._spin_ahead)
        now = self._centre, self._angles
        places = self.apart, self._arms, self._rims, self._start
        found = arrived(*now, *rates, self._half, self._span, *places)
        self._centre, self._angles, self._turn, self._bare, self._displacement = found
        self._speed, self._spin = self._leaving or self.rates_ahead
        self._forget()
        return work

    def initial(self, static: Floats) -> SumsTable:  # noqa: ARG002  (as the interface has it)
        """Sums of the initial state."""
        return self.summed(np.zeros(len(self._mass)))

    def inertia(self) -> list[Floats]:
        """0: their attitude is summed up, which steps do not turn by just their mean spin."""
        turns = self._dim * (self._dim - 1) // 2
        return [np.zeros((turns, turns)) for _ in self._bodies]

    def summed(self, work: Floats) -> SumsTable:
        """Sums now, with the work of loads (bodies,) since the last ones [J]."""
        ways = self._centre - self._first, self._speed, self._spin, self._turn
        found = SumsTable(*summed(self._mass, self._inertia, *ways, work, self._dim))
        return found if self.counts else found.none()


def _rims_of(bodies: Sequence[Rigid]) -> tuple[Floats, Floats]:
    """Axes (nodes, 3) and shares (nodes, 2) of the rims of all nodes, 0 of those with none."""
    if all(body.rims is None for body in bodies):
        return np.zeros((0, 3)), np.zeros((0, 2))
    each = [
        (np.zeros((len(b.arms), 3)), np.zeros((len(b.arms), 2)))
        if b.rims is None
        else (b.rims.axis, b.rims.shares)
        for b in bodies
    ]
    axes, shares = zip(*each, strict=True)
    return np.concatenate(axes), np.concatenate(shares)
