"""Mechanisms at rest: what loads leave unbalanced, and what forces do to them.

Places are the ways x of the rates from where joints are given, turns times the size, and the forces
L by which limits, friction and what drives them hold joints, as ways that count for nothing. With
the forces f of gravity and motors (t = 0, v = 0)

    f(x) + L + J^T F = 0,    x = clip(S(x - L / s), lower, upper),

S what is left of a way about 0 where friction takes f / s off: it holds where the joint is given,
if it can. Newton's method, where the energy is not convex along its curvature turned round, and no
farther than by a radian or the size of the mechanism in a pass: that goes downhill, to the nearest
equilibrium.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from impactfem.arrays import Booleans, Floats
from impactfem.marching.few_start import extent
from impactfem.system.tree import cross

if TYPE_CHECKING:
    from impactfem.marching.mechanism import MechanismMidpoint
    from impactfem.system.tree import Tree

_STEP = 1e-6  # of ways in differences [rad], and of those that slide by the size
_ROUNDS = 16.0 * float(np.finfo(float).eps)  # of forces that cancel
_NOTHING = 1e-9  # times the ways by which joints would give way, as which their forces are told
_LOOSE = 1e-6  # share of the hardest motion below which nothing holds one
_LEAST = 1e-9  # share of the hardest motion by which one that nothing holds is held


class MechanismAtRest:
    """A mechanism; see `impactfem.marching.resting.Resting`."""

    patience = 40  # what swings has a long way until it hangs

    def __init__(self, march: "MechanismMidpoint") -> None:
        """Take it where it is."""
        bodies, self._march, self._q = march.bodies, march, march.coordinates.copy()
        tree, joints, self.name = bodies.tree, bodies.joints, bodies.names[0]
        count, every = tree.rates, sorted(set(tree.links().values()) - {0})
        self.start, self._offset, self.mass = np.zeros(2 * count), bodies.following, tree.mass
        _, origins = tree.poses(self._q, every)
        places = np.vstack([origins, bodies.places(self._q)])
        self.size = extent(places, bodies.radius)
        slides = ~tree.jacobians(self._q, every)[:, 3:].any(axis=(0, 1))
        self._units = np.where(slides, self.size, 1.0)  # of ways: m or rad
        self._lever = self.size / self._units  # places by ways
        self._mass = tree.inertia(self._q)
        angle = bodies.angles_at_start
        self._lower, self._upper = joints.lower - angle, joints.upper - angle
        self._lower[list(joints.driven)] = self._upper[list(joints.driven)] = 0.0
        self._scale = np.ones(count)
        stiff = self._stiffness(self.start)
        level = np.abs(stiff).sum(axis=1) + self._sized(self.start) / self._units
        self._scale = np.where(level > 0.0, level, 1.0)
        sprung = self._slopes(self.start) > 0.0
        held = sprung | (self._lower == self._upper)
        self.modes = JointModes(_moves(tree, slides), self._mass, held, self._lever)
        self._eased = 1.0

    def _ways(self, place: Floats) -> tuple[Floats, Floats]:
        """Ways of the rates, and forces that hold joints, (v,) each."""
        ways, held = place.reshape(2, -1) / self._lever
        return ways, held * self._scale / _NOTHING

    def _acting(self, forces: Floats) -> tuple[Floats, Floats]:
        """Forces on the rates, and what laws of joints miss as such, (v,) each."""
        acting, missed = forces.reshape(2, -1) * self._lever
        return acting, missed

    def _at(self, place: Floats) -> Floats:
        """Coordinates."""
        return self._march.bodies.tree.integrate(self._q, self._ways(place)[0])

    def _motors(self, way: Floats) -> Floats:
        """Their moments and forces at t = 0, at rest, (v,)."""
        bodies = self._march.bodies
        return bodies.joints.drive(0.0, 0.0, bodies.angles_at_start + way, np.zeros_like(way))

    def _slopes(self, place: Floats) -> Floats:
        """Stiffnesses of the motors, (v,)."""
        way, step = self._ways(place)[0], _STEP * self._units
        if not self._march.bodies.joints.motors:
            return np.zeros_like(way)
        return (self._motors(way - step) - self._motors(way + step)) / (2.0 * step)

    def _weights(self, place: Floats) -> Floats:
        """Forces of gravity on the rates, (v,)."""
        tree, pull = self._march.bodies.tree, self._march.gravity(0.0, 0.0)
        return np.asarray(tree.mass * (pull @ tree.centre_jacobian(self._at(place))))

    def _sized(self, place: Floats) -> Floats:
        """How large the forces are that act, (v,)."""
        tree, pull = self._march.bodies.tree, self._march.gravity(0.0, 0.0)
        arms = np.linalg.norm(tree.centre_jacobian(self._at(place)), axis=0)
        way, held = self._ways(place)
        weight = tree.mass * float(np.linalg.norm(pull)) * arms
        return np.asarray(weight + np.abs(self._motors(way)) + np.abs(held))

    def _stiffness(self, place: Floats) -> Floats:
        """Of gravity and motors, (v, v)."""
        found = np.zeros_like(self._mass)
        for k, step in enumerate(_STEP * self._units):
            way = np.zeros_like(place)
            way[k] = step * self._lever[k]
            found[:, k] = (self._weights(place - way) - self._weights(place + way)) / (2.0 * step)
        return 0.5 * (found + found.T) + np.diag(self._slopes(place))

    def _holds(self, place: Floats) -> tuple[Floats, Booleans]:
        """What ways miss of what the laws of joints leave [m, rad], and which are held, (v,)."""
        way, held = self._ways(place)
        rubs = self._march.bodies.joints.friction / self._scale
        wanted = way - held / self._scale
        slid = np.sign(wanted) * np.maximum(np.abs(wanted) - rubs, 0.0)
        given = np.clip(slid, self._lower, self._upper)
        return way - given, (given != slid) | (np.abs(wanted) < rubs) | (self._lower == self._upper)

    def residual(self, place: Floats) -> Floats:
        """Loads at t = 0 with what holds joints; what their laws miss, as forces."""
        way, held = self._ways(place)
        force = self._weights(place) + self._motors(way) + held
        force[np.abs(force) <= _ROUNDS * self._sized(place)] = 0.0
        missing = self._scale * self._holds(place)[0]
        return np.concatenate([force, -missing]) / np.tile(self._lever, 2)

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:
        """What forces do, downhill."""
        stiffness, count = self._stiffness(place), len(self._mass)
        (missed, held), force = self._holds(place), self._acting(self.residual(place))[0]
        free, scale = ~held, self._scale
        force = force + stiffness[:, held] @ missed[held]
        own = np.ix_(free, free)
        yielding = np.zeros_like(stiffness)
        yielding[own] = self._downhill(stiffness[own], self._mass[own], force[free],
                                       self._units[free])  # fmt: skip

        def solve(forces: Floats) -> Floats:
            acting, wrong = self._acting(forces)
            way, change = np.zeros(count), np.zeros(count)
            way[held], change[free] = wrong[held] / scale[held], wrong[free]
            way = way + yielding @ (acting + change - stiffness @ way)
            change[held] = (stiffness @ way - acting)[held]
            change = change / scale * _NOTHING
            return np.concatenate([way, change]) * np.tile(self._lever, 2)

        return solve

    def _downhill(self, stiffness: Floats, mass: Floats, force: Floats, units: Floats) -> Floats:
        """Ways by forces: by Newton's method along what is held, by descent along other motions."""
        if not len(mass):
            return mass
        root = np.linalg.inv(np.linalg.cholesky(mass))
        rates, ways = np.linalg.eigh(root @ stiffness @ root.T)
        ways = root.T @ ways
        rates, driven = np.abs(rates), np.abs(ways.T @ force)
        steepest = self._eased * driven * np.abs(ways / units[:, None]).max(axis=0)
        most = max(float(rates.max()), float(steepest.max()))
        loose = rates <= _LOOSE * most  # what touches may press on all of these
        rates = np.maximum(rates, np.where(loose, steepest.max(), steepest))
        rates = np.maximum(rates, _LEAST * most if most else 1.0)
        return np.asarray((ways / rates) @ ways.T)

    def _jacobian(self, place: Floats) -> Floats:
        """Velocities of what touches by the rates, (nodes, 3, v)."""
        bodies, q = self._march.bodies, self._at(place)
        turns, _ = bodies.tree.poses(q, bodies.moving)
        links = bodies.tree.jacobians(q, bodies.moving)[bodies.on]
        arms = np.einsum("kij,kj->ki", turns[bodies.on], bodies.arms) + self._offset
        turning = cross(links[:, 3:].swapaxes(1, 2), arms[:, None, :]).swapaxes(1, 2)
        return np.asarray(links[:, :3] + turning)

    def contact(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, 3)."""
        bodies = self._march.bodies
        return bodies.places(self._at(place)) - bodies.places(bodies.position)

    def touch(self, normals: Floats) -> None:
        """Learn where links that roll touch, by the normals of their nodes (count, 3)."""
        bodies = self._march.bodies
        self._offset = bodies.following - bodies.rolling[:, None] * normals

    def touching(self, place: Floats) -> Floats:
        """Displacements of what touches [m], (count, 3): links roll as far as they turn."""
        bodies = self._march.bodies
        before, _ = bodies.tree.poses(self._q, bodies.moving)
        turns, _ = bodies.tree.poses(self._at(place), bodies.moving)
        turned = Rotation.from_matrix(turns @ before.swapaxes(1, 2)).as_rotvec()
        return np.asarray(self.contact(place) + cross(turned[bodies.on], self._offset))

    def moved(self, place: Floats, change: Floats) -> Floats:
        """How that moves by a small change from a place [m], (count, 3)."""
        return np.asarray(self._jacobian(place) @ self._ways(change)[0])

    def pulled(self, forces: Floats, place: Floats) -> Floats:
        """Forces by those on the contact nodes (count, 3) at a place."""
        found = np.einsum("kiv,ki->v", self._jacobian(place), forces) / self._lever
        return np.concatenate([found, np.zeros_like(found)])

    def ease(self, share: float) -> None:
        """Bound passes by so much of what bounds them at first."""
        self._eased = share

    def steady(self) -> bool:
        """Nothing to change."""
        return False

    def destroy(self) -> None:
        """Nothing to free."""

    def settle(self, place: Floats) -> Floats:
        """Begin at a place; mass times the way there [kg m], (3,)."""
        tree, way = self._march.bodies.tree, self._ways(place)[0]
        before = tree.centre(self._q)
        self._march.put(self._at(place), way)
        return np.asarray(tree.mass * (tree.centre(self._at(place)) - before))

    def linked(self, names: Sequence[str]) -> "LinksAtRest":
        """Links that joints hold, by body and name."""
        links = self._march.bodies.tree.links()
        return LinksAtRest(self, [links[name.partition("/")[2]] for name in names])

    def poses(self, place: Floats, joints: Sequence[int]) -> tuple[Floats, Floats, Floats]:
        """Places, rotations of frames of joints, and their twists by ways, (6 joints, v)."""
        tree, q = self._march.bodies.tree, self._at(place)
        turns, places = tree.poses(q, joints)
        return places, turns, tree.jacobians(q, joints).reshape(-1, tree.rates) / self._lever


class LinksAtRest:
    """Links; see `impactfem.marching.jointed_start.Stationed`."""

    def __init__(self, arm: MechanismAtRest, joints: Sequence[int]) -> None:
        """Take them where they are."""
        self._arm, self._joints, self.ease = arm, joints, arm.ease
        self.frames(arm.start)

    def frames(self, place: Floats) -> tuple[Floats, Floats]:
        """Places and rotations; what is asked later is asked there."""
        places, turns, self._rows = self._arm.poses(place, self._joints)
        return places, turns

    def twists(self, change: Floats) -> Floats:
        """How far they move and turn by a small change."""
        return np.asarray(self._rows @ change[: self._rows.shape[1]])

    def wrung(self, wrenches: Floats) -> Floats:
        """Forces by forces and moments on them."""
        found = wrenches @ self._rows
        return np.concatenate([found, np.zeros_like(found)])


class JointModes:
    """Motions of joints that no spring holds; see `impactfem.marching.resting.FreeModes`."""

    def __init__(
        self, names: Sequence[tuple[str, str]], mass: Floats, held: Booleans, lever: Floats
    ) -> None:
        """Take them.

        Args:
            names: Of the rates: what moves, and the unit of what drives it.
            mass: Of these, (v, v).
            held: Which springs hold, (v,).
            lever: Places by ways, (v,).
        """
        self._names, self._lever, free = names, lever, np.flatnonzero(~held)
        self._mass = mass / np.outer(lever, lever)
        self.count, size = len(free), len(mass)
        self.fields = np.zeros((self.count, 2 * size))
        if self.count:
            root = np.linalg.cholesky(self._mass[np.ix_(free, free)])
            self.fields[:, free] = np.linalg.inv(root)

    def along(self, forces: Floats) -> Floats:
        """Parts of forces that work on each mode."""
        return np.asarray(self.fields @ forces)

    def _pushed(self, along: Floats) -> Floats:
        """Forces along them, (v,)."""
        return np.asarray(self._mass @ (along @ self.fields)[: len(self._mass)])

    def moved(self, displacement: Floats) -> Floats:
        """How far a displacement is one along each mode."""
        size = len(self._mass)
        return np.asarray(self.fields[:, :size] @ (self._mass @ displacement[:size]))

    def forces(self, along: Floats) -> Floats:
        """Forces that accelerate it along them."""
        return np.concatenate([self._pushed(along), np.zeros(len(self._mass))])

    def of_displacement(self, displacement: Floats) -> Floats:
        """Their part of a displacement."""
        return np.asarray(self.moved(displacement) @ self.fields)

    def push(self, along: Floats) -> float:
        """Sum of these forces [N]."""
        return float(np.abs(self._pushed(along)).sum())

    def words(self, along: Floats) -> str:
        """The joint that is driven the most."""
        pushed = self._pushed(along)
        worst = int(np.argmax(np.abs(pushed)))
        (words, unit), size = self._names[worst], abs(pushed[worst]) * self._lever[worst]
        return f"{words}, driven by {size:.4g} {unit}"


def _moves(tree: "Tree", slides: Booleans) -> list[tuple[str, str]]:
    """What each rate moves, and the unit of what drives it."""
    found = []
    for name, straight in zip(tree.rate_names(), slides.tolist(), strict=True):
        joint, _, axis = name.partition(".")
        which = f" ({'xyz'[int(axis) % 3]})" if axis else ""
        kind = "translation" if straight else "turning"
        found.append((f"{kind} in joint {joint}{which}", "N" if straight else "N m"))
    return found
