"""Bodies that joints hold, at rest: one body whose unknowns are theirs and forces in the joints.

A row q of a joint with the force L along it (`impactfem.system.joint_kernels`) obeys

    constraint  q = q0,                       spring and motor  L = -k (q - rest) + f(q),
    limits      0 <= L _|_ q - lower >= 0,    dry friction      L = clip(L - s (q - q0), -f, f),

limits as friction is written, with a scale s. Newton's method takes bodies by their tangents, of
which stations answer to wrenches, with what forces in joints turn about their places as far as it
holds bodies, which brings pendulums to hang; where it does not, mass holds them.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from scipy.linalg import block_diag, null_space
from scipy.spatial.transform import Rotation

from impactfem.arrays import Floats
from impactfem.marching.resting import FreeModes, Resting
from impactfem.scene.means import StepMean
from impactfem.system.joint_kernels import POINT, at_gradients, least, sizes_of
from impactfem.system.joints import Joints
from impactfem.system.stations import Stations

_STEP = 1e-6  # of turns [rad], and ways by the reach of joints, in differences
_PATIENCE = 40  # passes along a free motion: what swings has a long way until it hangs
_LIGHTEST = 1e-6  # share of the mass that holds free motions
_HELD = 1e-9  # share below which a motion does not move rows


class Stationed(Protocol):
    """Stations of a body at rest."""

    def frames(self, place: Floats) -> tuple[Floats, Floats]:
        """Places (stations, 3) and rotations (stations, 3, 3) of the stations (collective)."""

    def twists(self, change: Floats) -> Floats:
        """How far they move and turn by a small change, (6 stations,) (collective)."""

    def wrung(self, wrenches: Floats) -> Floats:
        """Forces on the owned dofs by forces and moments on the stations, (6 stations,)."""

    def ease(self, share: float) -> None:
        """Hold free motions by so much of the mass that holds them at first."""


class ByRows:
    """Of a body whose stations move by rows of what its place tells."""

    def __init__(
        self,
        stations: Stations,
        start: Floats,
        told: Callable[[Floats], Floats],
        pulled: Callable[[Floats], Floats],
        ease: Callable[[float], None],
    ) -> None:
        """Take rows.

        Args:
            stations: At a place.
            start: That place.
            told: What rows are of, by a place or a change of it, (d,) (collective).
            pulled: Forces on the owned dofs by those on it.
            ease: See `Stationed`.
        """
        self._rows = stations.rows.reshape(-1, stations.rows.shape[-1])
        self._at, self._start, self._told, self._pulled = stations, start, told, pulled
        self.ease = ease

    def frames(self, place: Floats) -> tuple[Floats, Floats]:
        """Places and rotations."""
        moved = self.twists(place - self._start).reshape(-1, 6)
        turns = Rotation.from_rotvec(moved[:, 3:]).as_matrix() @ self._at.turns
        return self._at.places + moved[:, :3], turns

    def twists(self, change: Floats) -> Floats:
        """By the rows."""
        return np.asarray(self._rows @ self._told(change))

    def wrung(self, wrenches: Floats) -> Floats:
        """By the transposed rows."""
        return self._pulled(wrenches @ self._rows)


class JointedAtRest:
    """Bodies and their joints; see `impactfem.marching.resting.Resting`.

    Places are those of the bodies, then the forces of the rows [N or N m].
    """

    def __init__(
        self,
        joints: Joints,
        bodies: Sequence[Resting],
        held: Sequence[Stationed],
        counts: Sequence[int],
        dt: float,
    ) -> None:
        """Take bodies where they are (collective).

        Args:
            joints: What holds them.
            bodies: They, in the order of `Joints.parts`; those that are stepped together are one.
            held: Their stations.
            counts: Numbers of their contact nodes.
            dt: Step in whose mean motors act first [s].
        """
        self._joints, self._bodies, self._held, self._dt = joints, bodies, held, dt
        self.name = " and ".join(
            dict.fromkeys(name.partition("/")[0] for name in joints.names[joints.ground.count :])
        )
        self.start = np.concatenate([*(body.start for body in bodies), np.zeros(joints.count)])
        self.patience = _PATIENCE
        ends = np.cumsum([0, *(len(body.start) for body in bodies)])
        self._owns = [slice(*both) for both in pairwise(ends)]
        self._nodes = [slice(*both) for both in pairwise(np.cumsum([0, *counts]))]
        counted = [len(at.frames(body.start)[0]) for at, body in zip(held, bodies, strict=True)]
        sizes = np.cumsum([0, *(6 * count for count in counted)])
        self._stations = [slice(*both) for both in pairwise(sizes)]
        self._motors = {k: StepMean(j.motor) for k, j in enumerate(joints.joints) if j.motor}
        self._reach = float(np.abs(joints.terms.arms).max(initial=0.0)) or 1.0
        self._largest = 0.0  # of what was left unbalanced
        self._known: tuple[object, ...] = ()
        self._answer: Callable[[Floats], Floats] | None = None
        gradient = self._gradient(*self._frames(self.start))
        tangents = [b.tangent(b.start) for b in bodies]
        # Means of nodes that turn nothing push along lines that stay.
        terms, swings = joints.terms, np.zeros(len(joints.places), dtype=bool)
        swings[terms.bodies[(terms.kinds != POINT) | terms.arms.any(axis=(1, 2))]] = True
        self._swings = np.repeat(swings[joints.ground.count :], 6)
        self._acts = gradient.any(axis=0) | self._swings  # what forces in joints push
        self._yielding = self._yields(tangents)
        own = np.diag(gradient @ self._yielding @ gradient.T)
        tiny = _HELD * own.max(initial=0.0)
        self._scale = 1.0 / np.where(own > tiny, own, np.inf)
        self.modes: FreeModes = _Modes(bodies, self._free(gradient), self._owns, joints.count)

    def _free(self, gradient: Floats) -> Floats:
        """Free motions of the bodies that joints leave, by their own ones, (own, free)."""
        joints = self._joints
        firm = np.setdiff1d(np.flatnonzero(joints.holding), joints.taut)  # preloads hold nothing
        springs = [row for j, row in zip(joints.joints, joints.moving, strict=True) if j.stiffness]
        each = zip(self._bodies, self._held, strict=True)
        moved = [[at.twists(field) for field in body.modes.fields] for body, at in each]
        whole = np.zeros((gradient.shape[1], sum(map(len, moved))))
        first = 0
        for own, ways in zip(self._stations, moved, strict=True):
            for k, way in enumerate(ways):
                whole[own, first + k] = way
            first += len(ways)
        rows = gradient[[*firm, *springs]] @ whole
        sizes = np.linalg.norm(rows, axis=1, keepdims=True)
        rows = rows / np.where(sizes > 0.0, sizes, 1.0)
        return null_space(rows, rcond=_HELD) if len(rows) else np.eye(whole.shape[1])

    def split(self, place: Floats) -> list[Floats]:
        """Places of the bodies."""
        return [place[own] for own in self._owns]

    def forces(self, place: Floats) -> Floats:
        """Those of the rows [N or N m], (rows,)."""
        return place[len(place) - self._joints.count :]

    def _frames(self, place: Floats) -> tuple[Floats, Floats]:
        """Of all stations, and the ground."""
        joints = self._joints
        each = [at.frames(own) for at, own in zip(self._held, self.split(place), strict=True)]
        ground = joints.ground.still, joints.ground.turns  # motions begin at 0
        places, turns = zip(ground, *each, strict=True)
        return np.concatenate(places), np.concatenate(turns)

    def _values(self, places: Floats, turns: Floats) -> tuple[Floats, Floats]:
        """Of the terms, and of the rows."""
        joints = self._joints
        known = joints.values_at(joints.places, joints.turns, np.zeros(len(joints.terms.kinds)))
        terms = joints.values_at(places, turns, known)
        return terms, joints.terms.sums(terms, joints.count)

    def _gradient(self, places: Floats, turns: Floats) -> Floats:
        """Rows by twists of the stations but the ground, (rows, 6 stations)."""
        joints, t = self._joints, self._joints.terms
        now = self._values(places, turns)[0]
        each = at_gradients(t.kinds, t.bodies, t.arms, t.axes, places, turns, now)
        found = np.zeros((joints.count, len(places), 6))
        for side in range(2):
            np.add.at(found, (t.rows, t.bodies[:, side]), each[:, side] * t.shares[:, None])
        return found[:, joints.ground.count :].reshape(joints.count, -1)

    def _yields(self, tangents: Sequence[Callable[[Floats], Floats]]) -> Floats:
        """Twists of the stations by unit wrenches on them (collective)."""
        found = np.zeros((self._stations[-1].stop, self._stations[-1].stop))
        each = zip(self._stations, self._held, tangents, strict=True)
        for own, at, solve in each:
            for k, unit in enumerate(np.eye(own.stop - own.start)):
                if not self._acts[own.start + k]:
                    continue
                pulled = at.wrung(unit)
                found[own, own.start + k] = at.twists(solve(pulled))
        return found

    def _laws(self, values: Floats, forces: Floats) -> tuple[Floats, Floats, Floats]:
        """What rows miss [N or N m], and how that changes with them and their forces, (rows,)."""
        joints, scale = self._joints, self._scale
        missing = scale * (values - joints.start)  # of constraints
        by_row, by_force = scale.copy(), np.zeros(joints.count)
        for k, (joint, row) in enumerate(zip(joints.joints, joints.moving, strict=True)):
            if row < 0:
                continue
            force, slope = -joint.stiffness * (values[row] - joints.rest(joint)), joint.stiffness
            if (motor := self._motors.get(k)) is not None:
                q, step = values[row] + joints.shift(joint), _STEP * max(1.0, abs(values[row]))
                sides = [motor(0.0, self._dt, q=q + way, v=0.0) for way in (step, 0.0, -step)]
                force, slope = force + sides[1], slope - (sides[0] - sides[2]) / (2.0 * step)
            missing[row], by_row[row], by_force[row] = forces[row] - force, slope, 1.0
            bounds = []
            if (own := joints.rubbing[k]) >= 0:
                bounds.append((own, joints.start[row], -joint.friction, joint.friction))
            if (own := joints.stopping[k]) >= 0 and joint.limits is not None:
                low, high = (limit - joints.shift(joint) for limit in joint.limits)
                nearer = low if values[row] - low < high - values[row] else high
                lone = (0.0, np.inf) if nearer == low else (-np.inf, 0.0)
                bounds.append((own, nearer, *lone))
            for own, at, least_force, most in bounds:
                wanted = forces[own] - scale[own] * (values[own] - at)
                given = min(max(wanted, least_force), most)
                missing[own] = forces[own] - given
                by_row[own], by_force[own] = (scale[own], 0.0) if given == wanted else (0.0, 1.0)
        for k in np.flatnonzero(joints.taut >= 0).tolist():
            own = joints.taut[k]
            missing[own] = forces[own] + float(joints.joints[k].preload or 0.0)
            by_row[own], by_force[own] = 0.0, 1.0
        return missing, by_row, by_force

    def contact(self, place: Floats) -> Floats:
        """Displacements of the contact nodes of all [m], (count, dim) (collective)."""
        return self._each(lambda body, own: body.contact(own), place)

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch."""
        for body, nodes in zip(self._bodies, self._nodes, strict=True):
            body.touch(normals[nodes])

    def touching(self, place: Floats) -> Floats:
        """Displacements of what touches at them [m], (count, dim) (collective)."""
        return self._each(lambda body, own: body.touching(own), place)

    def _each(self, asked: Callable[[Resting, Floats], Floats], place: Floats) -> Floats:
        each = zip(self._bodies, self.split(place), strict=True)
        return np.concatenate([asked(body, own) for body, own in each])

    def moved(self, place: Floats, change: Floats) -> Floats:
        """How that moves by a small change [m], (count, dim) (collective)."""
        each = zip(self._bodies, self.split(place), self.split(change), strict=True)
        return np.concatenate([body.moved(own, way) for body, own, way in each])

    def pulled(self, forces: Floats, place: Floats) -> Floats:
        """Forces by those on the contact nodes (count, dim) at a place."""
        each = zip(self._bodies, self._nodes, self.split(place), strict=True)
        found = [body.pulled(forces[nodes], own) for body, nodes, own in each]
        return np.concatenate([*found, np.zeros(self._joints.count)])

    def residual(self, place: Floats) -> Floats:
        """Loads less internal forces, with those of joints; what rows miss, as forces."""
        frames, forces = self._frames(place), self.forces(place)
        wrench = self._gradient(*frames).T @ forces
        each = zip(self._bodies, self._held, self._stations, self.split(place), strict=True)
        found = [body.residual(own) + at.wrung(wrench[mine]) for body, at, mine, own in each]
        missing, *_ = self._laws(self._values(*frames)[1], forces)
        return np.concatenate([*found, -missing])

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:
        """What forces do, linearised, with mass that holds free bodies, less near equilibrium."""
        size = float(np.linalg.norm(self.residual(place)))
        self._largest = max(self._largest, size)
        share = max(_LIGHTEST, size / self._largest if self._largest else 1.0)
        for at in self._held:
            at.ease(min(1.0, 10.0 ** (2.0 + np.floor(np.log10(share)))))
        frames, forces = self._frames(place), self.forces(place)
        gradient = self._gradient(*frames)
        _, by_row, by_force = self._laws(self._values(*frames)[1], forces)
        each = zip(self._bodies, self.split(place), strict=True)
        tangents = [body.tangent(own) for body, own in each]
        turning = self._turning(*frames, forces)
        known = *tangents, gradient.tobytes(), by_row.tobytes(), by_force.tobytes()
        known = *known, turning.tobytes()
        if self._answer is None or known != self._known:
            if known[: len(tangents)] != self._known[: len(tangents)]:
                self._yielding = self._yields(tangents)
            self._known = known
            self._answer = self._solving(tangents, gradient, turning, by_row, by_force)
        return self._answer

    def _turning(self, places: Floats, turns: Floats, forces: Floats) -> Floats:
        """Stiffness of the stations by forces in joints that turn, as far as it holds them."""
        first = self._joints.ground.count
        count = 6 * (len(places) - first)
        found, units = np.zeros((count, count)), np.tile([self._reach] * 3 + [1.0] * 3, count // 6)
        if not forces.any():
            return found
        for k in np.flatnonzero(self._swings).tolist():
            sides = []
            for step in (_STEP, -_STEP):
                body, way = first + k // 6, np.zeros(6)
                way[k % 6] = step * units[k]
                there, turned = places.copy(), turns.copy()
                there[body] += way[:3]
                turned[body] = Rotation.from_rotvec(way[3:]).as_matrix() @ turned[body]
                sides.append(self._gradient(there, turned).T @ forces)
            found[:, k] = -(sides[0] - sides[1]) / (2.0 * _STEP) * units
        if not found.any():
            return found
        size, ways = np.linalg.eigh(0.5 * (found + found.T))
        kept = (ways * np.maximum(size, 0.0)) @ ways.T
        return np.asarray(kept / np.outer(units, units))

    def _solving(
        self,
        tangents: Sequence[Callable[[Floats], Floats]],
        gradient: Floats,
        turning: Floats,
        by_row: Floats,
        by_force: Floats,
    ) -> Callable[[Floats], Floats]:
        """Changes of places and forces in joints by forces on both."""
        yielding = self._yielding
        softer, whole = None, yielding
        if turning.any():
            unit = np.eye(len(turning))
            softer = np.linalg.solve(unit + yielding @ turning, unit)
            whole = softer @ yielding
        moving = gradient @ whole @ gradient.T
        matrix = by_row[:, None] * moving + np.diag(by_force)
        scale, redundant = sizes_of(moving), bool(self._joints.redundant)

        def solve(forces: Floats) -> Floats:
            each = zip(tangents, self.split(forces), strict=True)
            free = [answer(own) for answer, own in each]
            ways = [at.twists(way) for at, way in zip(self._held, free, strict=True)]
            first = np.concatenate(ways)
            first = first if softer is None else softer @ first
            wanted = self.forces(forces) - by_row * (gradient @ first)
            found = least(matrix, wanted, scale, redundant=redundant)
            wrench = gradient.T @ found
            if softer is not None:
                wrench = wrench - turning @ (first + whole @ wrench)
            each_held = zip(free, tangents, self._held, self._stations, strict=True)
            moved = [way + answer(at.wrung(wrench[own])) for way, answer, at, own in each_held]
            return np.concatenate([*moved, found])

        return solve

    def steady(self) -> bool:
        """Whether any body then answers otherwise."""
        return any([body.steady() for body in self._bodies])  # noqa: C419  (tell all)

    def destroy(self) -> None:
        """Free what the bodies hold, and let go of the answer, which holds this in turn."""
        self._answer = None
        for body in self._bodies:
            body.destroy()


class _Modes:
    """Free motions of bodies that joints leave; see `impactfem.marching.resting.FreeModes`."""

    def __init__(
        self, bodies: Sequence[Resting], free: Floats, owns: Sequence[slice], rows: int
    ) -> None:
        """Take what of the motions of all is free, (own, free)."""
        self._each, self._free = [body.modes for body in bodies], free
        self._places, self._rows = owns, rows
        ends = np.cumsum([0, *(modes.count for modes in self._each)])
        self._owns = [slice(*both) for both in pairwise(ends)]
        fields = block_diag(*(modes.fields for modes in self._each), np.zeros((0, rows)))
        self.fields, self.count = free.T @ fields, free.shape[1]

    def _gathered(self, found: Sequence[Floats]) -> Floats:
        return np.asarray(np.concatenate(found) @ self._free)

    def _spread(self, along: Floats) -> list[tuple[FreeModes, Floats]]:
        own = self._free @ along
        return [(modes, own[at]) for modes, at in zip(self._each, self._owns, strict=True)]

    def along(self, forces: Floats) -> Floats:
        """Parts of forces that work on each mode (collective)."""
        each = zip(self._each, self._places, strict=True)
        return self._gathered([modes.along(forces[own]) for modes, own in each])

    def moved(self, displacement: Floats) -> Floats:
        """How far a displacement is one along each mode (collective)."""
        each = zip(self._each, self._places, strict=True)
        return self._gathered([modes.moved(displacement[own]) for modes, own in each])

    def forces(self, along: Floats) -> Floats:
        """Forces that accelerate the bodies along them."""
        found = [modes.forces(own) for modes, own in self._spread(along)]
        return np.concatenate([*found, np.zeros(self._rows)])

    def of_displacement(self, displacement: Floats) -> Floats:
        """Their part of a displacement (collective)."""
        return np.asarray(self.moved(displacement) @ self.fields)

    def push(self, along: Floats) -> float:
        """Force that would accelerate all of the bodies as much [N]."""
        return float(np.linalg.norm([modes.push(own) for modes, own in self._spread(along)]))

    def words(self, along: Floats) -> str:
        """The motion of the body that is driven the most."""
        modes, own = max(self._spread(along), key=lambda each: float(np.linalg.norm(each[1])))
        return modes.words(own)
