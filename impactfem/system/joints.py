"""Joints of a scene as rows: what they hold, along what their springs, motors and limits act."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.scene import Joint, Scene
from impactfem.scene.joints import GROUND
from impactfem.system.few import FewBodies
from impactfem.system.joint_kernels import (
    ANGLE,
    DISTANCE,
    DOT,
    POINT,
    SLIDE,
    at_gradients,
    delassus,
    values,
)
from impactfem.system.rigid import Rigid, frame, in_space

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_RANK = 1e-9  # share of the largest eigenvalue below which a row follows from others
_MOVING = 1e-9  # share of the largest speed with which bodies may part in a joint at t = 0


@dataclass(frozen=True)
class Terms:
    """Terms of rows, as `impactfem.system.joint_kernels.values` takes them.

    Attributes:
        kinds: (terms,).
        rows: The row of each, (terms,).
        bodies: Both sides, 0 is the ground, (terms, 2).
        arms, axes, across: Along the axes of the bodies, (terms, 2, 3).
        shares: Factors in the rows, (terms,).
    """

    kinds: Integers
    rows: Integers
    bodies: Integers
    arms: Floats
    axes: Floats
    across: Floats
    shares: Floats

    def sums(self, values: Floats, count: int) -> Floats:
        """Rows of values of the terms, (count,)."""
        return np.asarray(np.bincount(self.rows, self.shares * values, count))


@dataclass(frozen=True)
class Joints:
    """Joints between rigid bodies.

    Attributes:
        joints: As the scene has them.
        names: Of the bodies; the first is the ground.
        places, turns: Of these at t = 0, (bodies, 3), (bodies, 3, 3).
        speeds, spins: Of these, spins along their axes, (bodies, 3) each.
        masses: Inverse masses (bodies,), moments of inertia and their inverses (bodies, 3, 3).
        terms: Of all rows.
        owner: Joint of each row, (rows,).
        holding: Rows that are constraints, (rows,).
        moving: Row of the coordinate of each joint, -1 where it has none, (joints,).
        rubbing, stopping: Rows of its friction and its limits, likewise.
        start: Values of the rows at t = 0, (rows,).
    """

    joints: tuple[Joint, ...]
    names: tuple[str, ...]
    places: Floats
    turns: Floats
    speeds: Floats
    spins: Floats
    masses: tuple[Floats, Floats, Floats]
    terms: Terms
    owner: Integers
    holding: NDArray[np.bool_]
    moving: Integers
    rubbing: Integers
    stopping: Integers
    start: Floats

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.owner)

    @cached_property
    def gradient(self) -> Floats:
        """Of the terms at t = 0, (terms, 2, 6)."""
        t = self.terms
        first = self.values_at(self.places, self.turns, np.zeros(len(t.kinds)))
        return np.asarray(
            at_gradients(t.kinds, t.bodies, t.arms, t.axes, self.places, self.turns, first)
        )

    def values_at(self, places: Floats, turns: Floats, before: Floats) -> Floats:
        """Values of the terms, (terms,); see `impactfem.system.joint_kernels.values`."""
        t = self.terms
        return np.asarray(
            values(t.kinds, t.bodies, t.arms, t.axes, t.across, places, turns, before)
        )

    def response(self) -> Floats:
        """How constraints move by unit impulses in them at t = 0, (constraints, constraints)."""
        t, (light, _, inverse) = self.terms, self.masses
        scaled = self.gradient * t.shares[:, None, None]
        free = self.turns @ inverse @ self.turns.swapaxes(1, 2)
        found = delassus(t.rows, t.bodies, scaled, scaled, self.count, light, free)
        return np.asarray(found[np.ix_(self.holding, self.holding)])

    @cached_property
    def redundant(self) -> int:
        """How many constraints follow from others at t = 0."""
        found = self.response()
        scale = np.sqrt(np.maximum(np.diag(found), np.finfo(float).tiny))
        own = np.linalg.eigvalsh(found / np.outer(scale, scale)) if len(found) else np.ones(1)
        return int((own < _RANK * own[-1]).sum())

    @property
    def mobility(self) -> int:
        """Number of degrees of freedom that the joints leave to the bodies at t = 0."""
        each = 3 if self.joints[0].dim == 2 else 6
        return each * (len(self.names) - 1) - int(self.holding.sum()) + self.redundant

    def rates(self, speeds: Floats, whirls: Floats) -> Floats:
        """Rates of the rows at t = 0 by velocities and spins in space, (rows,)."""
        twists = np.hstack([speeds, whirls])[self.terms.bodies]
        each = np.einsum("tsk,tsk->t", self.gradient, twists)
        return self.terms.sums(each, self.count)

    def rates_now(self) -> Floats:
        """The same with those of t = 0."""
        return self.rates(self.speeds, np.einsum("bij,bj->bi", self.turns, self.spins))

    @property
    def hard(self) -> NDArray[np.bool_]:
        """Rows that are constraints and do not give way, (rows,)."""
        soft = np.array([joint.soft is not None for joint in self.joints])
        return np.asarray(self.holding & ~soft[self.owner])

    def shift(self, joint: Joint) -> float:
        """What the coordinate of a joint is more than its row [rad or m]."""
        return 0.0 if joint.points is not None else joint.position

    def rest(self, joint: Joint) -> float:
        """Row at which its spring is not strained [rad or m]."""
        return (joint.start if joint.rest is None else joint.rest) - self.shift(joint)

    def check_start(self) -> None:
        """Refuse velocities at t = 0 with which bodies part in their joints.

        Raises:
            SceneError: naming the joint, and velocities that fit.
        """
        whirls = np.einsum("bij,bj->bi", self.turns, self.spins)
        apart = np.where(self.holding, self.rates_now(), 0.0)
        worst = int(np.argmax(np.abs(apart)))
        largest = max(np.abs(self.speeds).max(), np.abs(whirls).max())
        if abs(apart[worst]) <= _MOVING * largest:
            return
        acting = np.zeros(self.count)
        acting[self.holding] = -np.linalg.pinv(self.response(), _RANK) @ apart[self.holding]
        impulse = acting[self.terms.rows] * self.terms.shares
        pushes = np.zeros((len(self.names), 6))
        np.add.at(pushes, self.terms.bodies, impulse[:, None, None] * self.gradient)
        light, _, inverse = self.masses
        free = self.turns @ inverse @ self.turns.swapaxes(1, 2)
        speeds = self.speeds + light[:, None] * pushes[:, :3]
        turning = whirls + np.einsum("bij,bj->bi", free, pushes[:, 3:])
        joint = self.joints[self.owner[worst]]
        dim = joint.dim or 3
        fitting = "; ".join(
            f"{name}: velocity = {_shown(speed[:dim])}, angular_velocity = "
            f"{_shown(spin) if dim == 3 else _shown(spin[2:])[1:-1]}"
            for name, speed, spin in zip(self.names[1:], speeds[1:], turning[1:], strict=True)
        )
        raise SceneError(
            f"joint {joint.name}: its bodies part with {abs(apart[worst]):.4g} (m/s, or rad/s) at "
            f"t = 0; give velocities that it allows, the nearest by energy are {fitting}"
        )


def _shown(values: Floats) -> str:
    return "[" + ", ".join(f"{round(value, 12) + 0.0:.9g}" for value in values.tolist()) + "]"


class _Rows:
    """Terms and rows as they are found."""

    def __init__(self) -> None:
        self.terms: list[tuple[int, int, tuple[int, int], Floats, Floats, Floats, float]] = []
        self.owner: list[int] = []
        self.holding: list[bool] = []

    def add(self, joint: int, *, holds: bool) -> int:
        """A row."""
        self.owner.append(joint)
        self.holding.append(holds)
        return len(self.owner) - 1


def joints_of(scene: Scene, few: Sequence[FewBodies]) -> Joints | None:
    """The joints of a scene; None without any.

    Args:
        scene: The scene.
        few: Its bodies without meshes.

    Raises:
        SceneError: Bodies part in a joint at t = 0.
    """
    if not scene.joints:
        return None
    rigid = [cast("Rigid", few[k]) for k in held_parts(scene, few)]
    names = (GROUND, *(body.names[0] for body in rigid))
    frames = [(np.zeros(3), np.eye(3)), *(frame(body.position) for body in rigid)]
    places, turns = (np.array(each) for each in zip(*frames, strict=True))
    dim = scene.dim
    none = np.zeros(3)
    speeds = np.array([none, *(in_space(body.velocity[:dim]) for body in rigid)])
    spins = np.array(
        [none, *(np.pad(b.velocity[dim:], (3 - len(b.velocity[dim:]), 0)) for b in rigid)]
    )
    inertia = np.array([np.eye(3), *(body.inertia for body in rigid)])
    inverse = np.array([np.zeros((3, 3)), *(np.linalg.inv(body.inertia) for body in rigid)])
    light = np.array([0.0, *(1.0 / body.masses[0] for body in rigid)])
    rows = _Rows()
    moving, rubbing, stopping = (np.full(len(scene.joints), -1) for _ in range(3))
    coordinates: dict[str, int] = {}
    for k, joint in enumerate(scene.joints):
        if joint.between is None:
            continue
        one, two = (names.index(name) for name in joint.between)
        made = _Frame(joint, (one, two), places, turns)
        for kind, first, second in made.held(dim):
            made.put(rows, rows.add(k, holds=True), kind, first, second)
        coordinates[joint.name] = len(rows.terms)
        wanted = joint.moves, joint.friction > 0.0, joint.limits is not None
        for target, asked in zip((moving, rubbing, stopping), wanted, strict=True):
            if asked:
                target[k] = rows.add(k, holds=False)
                made.put(rows, int(target[k]), *made.coordinate)
    for k, joint in enumerate(scene.joints):
        if joint.joints is None:
            continue
        row = rows.add(k, holds=True)
        for name, share in zip(joint.joints, (-float(joint.ratio or 0.0), 1.0), strict=True):
            kind, _, both, arms, axes, across, _ = rows.terms[coordinates[name]]
            rows.terms.append((kind, row, both, arms, axes, across, share))
    kinds, of, bodies, all_arms, all_axes, all_across, shares = zip(*rows.terms, strict=True)
    terms = Terms(
        np.array(kinds), np.array(of), np.array(bodies), np.array(all_arms), np.array(all_axes),
        np.array(all_across), np.array(shares, dtype=float),
    )  # fmt: skip
    first = values(
        terms.kinds, terms.bodies, terms.arms, terms.axes, terms.across, places, turns,
        np.zeros(len(kinds)),
    )  # fmt: skip
    found = Joints(
        scene.joints, names, places, turns, speeds, spins, (light, inertia, inverse), terms,
        np.array(rows.owner), np.array(rows.holding), moving, rubbing,
        stopping, terms.sums(first, len(rows.owner)),
    )  # fmt: skip
    found.check_start()
    return found


def held_parts(scene: Scene, few: Sequence[FewBodies]) -> list[int]:
    """Places of the systems that joints may hold among the bodies without meshes of a scene."""
    able = {body.name for body in scene.bodies if body.takes_joints}
    return [k for k, body in enumerate(few) if body.names[0] in able]


class _Frame:
    """Place and axes of a joint along the axes of both its bodies."""

    def __init__(
        self, joint: Joint, bodies: tuple[int, int], places: Floats, turns: Floats
    ) -> None:
        self._joint, self._bodies = joint, bodies
        given = joint.points or (joint.point, joint.point)
        at = [in_space(np.asarray(point, dtype=float)) for point in given]
        each = list(zip(at, bodies, strict=True))
        self._arms = np.array([turns[b].T @ (p - places[b]) for p, b in each])
        axis = np.array([0.0, 0.0, 1.0])
        if joint.axis is not None:
            axis = in_space(np.asarray(joint.axis, dtype=float) / np.abs(joint.axis).max())
        self._axis = axis / np.linalg.norm(axis)
        if len(given[0] or ()) == 2:
            one = np.cross([0.0, 0.0, 1.0], self._axis)
            one = one if joint.axis is not None else np.array([1.0, 0.0, 0.0])
        elif joint.second_axis is not None:
            one = np.asarray(joint.second_axis, dtype=float) / np.abs(joint.second_axis).max()
        else:
            one = np.cross(self._axis, np.eye(3)[np.argmin(np.abs(self._axis))])
        one = one - (one @ self._axis) * self._axis
        self._one = one / np.linalg.norm(one)
        self._two = np.cross(self._axis, self._one)
        self._turns = turns[list(bodies)]

    def _own(self, direction: Floats) -> Floats:
        """A direction in space along the axes of both bodies, (2, 3)."""
        return np.asarray(np.einsum("bij,i->bj", self._turns, direction))

    def put(self, rows: _Rows, row: int, kind: int, first: Floats, second: Floats) -> None:
        """Add a term of directions in space of the first and the second body to a row.

        The direction of a POINT does not turn with a body.
        """
        axes = np.array([self._own(first)[0], self._own(second)[1]])
        if kind == POINT:
            axes[0] = first
        across = self._own(self._one)
        rows.terms.append((kind, row, self._bodies, self._arms, axes, across, 1.0))

    def held(self, dim: int) -> list[tuple[int, Floats, Floats]]:
        """Kinds of terms and their directions that are constraints."""
        axis, one, two = self._axis, self._one, self._two
        space = [(POINT, direction, direction) for direction in np.eye(3)[:dim]]
        across = [(SLIDE, one, one), (SLIDE, two, two)]
        lean = [(DOT, one, axis), (DOT, two, axis)]
        twist = [(DOT, one, two)]
        if dim == 2:
            flat = np.eye(3)
            plane = [(DOT, flat[0], flat[1])]
            found = {
                "fixed": space + plane,
                "revolute": space,
                "prismatic": [(SLIDE, one, one), *plane],
            }
        else:
            found = {
                "fixed": space + lean + twist,
                "revolute": space + lean,
                "prismatic": across + lean + twist,
                "universal": [*space, (DOT, axis, one)],
                "ball": space,
                "planar": [(SLIDE, axis, axis), *lean],
                "cylindrical": across + lean,
            }
        found["distance"] = [(DISTANCE, axis, axis)] if self._joint.holds else []
        return found[self._joint.kind]

    @property
    def coordinate(self) -> tuple[int, Floats, Floats]:
        """Kind of the term that is its coordinate, and its directions."""
        kinds = {"revolute": ANGLE, "distance": DISTANCE}
        return kinds.get(self._joint.kind, SLIDE), self._axis, self._axis
