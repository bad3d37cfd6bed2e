"""Trees of bodies in symbols: M(q) v' = f(t, q, v) from where bodies are at t = 0.

A body's place is a product of exponentials of the motions between it and the ground: each turns
about an axis, or slides along one, as these lie at t = 0 (Brockett 1984). M is the sum of
m J^T J + W^T I W, and the inertial forces are d/dt(M v) - d(v^T M v / 2)/dq.

What turns freely in space has the four numbers of a quaternion q as coordinates, of which q/|q| is
its rotation. An inertia along q, of which that is independent, makes M regular: (|q|^2)'' = 0, so
that q stays as long as it is at the start.

What closes loops holds g(q) = 0 by multipliers: M v' = f + G^T l with G v' = -(G v)_q v, G = dg/dq.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.trajectory.symbols import loaded


@dataclass(frozen=True)
class Freedom:
    """One coordinate of a tree.

    Attributes:
        name: As columns have it.
        rate: Name of its rate.
        turns: Whether it turns about its axis, or slides along it.
        axis: At t = 0, of length 1 (3,).
        point: On the axis at t = 0 (3,).
        start: Coordinate at t = 0 [rad or m].
        entry: Which number of a quaternion it is, w first, that turns about the point; else -1.
            Columns have these of length 1.
    """

    name: str
    rate: str
    turns: bool
    axis: Floats
    point: Floats
    start: float
    entry: int = -1

    @classmethod
    def free(cls, name: str, point: Floats, quaternion: Floats) -> "list[Freedom]":
        """Of what flies: along three axes, then a quaternion, of which all four turn it at once.

        Args:
            name: Of the body.
            point: Of it, where it is at t = 0 (3,).
            quaternion: At t = 0 (4,).
        """
        ways = zip("xyz", np.eye(3), point, strict=True)
        turns = zip("wxyz", quaternion, range(4), strict=True)
        return [
            *(cls(f"{name}.{k}", f"{name}.v{k}", False, axis, np.zeros(3), float(at))
              for k, axis, at in ways),
            *(cls(f"{name}.q{k}", f"{name}.q{k}_rate", False, np.zeros(3), point, float(at), entry)
              for k, at, entry in turns),
        ]  # fmt: skip


@dataclass
class Part:
    """A body of a tree.

    Attributes:
        name: Of it.
        freedoms: Places in the tree's list of those that move it, from the ground on.
        mass: [kg].
        centre: Centre of mass at t = 0 (3,).
        inertia: About it, along axes of the scene at t = 0 (3, 3).
    """

    name: str
    freedoms: Sequence[int]
    mass: float
    centre: Floats
    inertia: Floats


@dataclass(frozen=True)
class Rub:
    """Dry friction in a joint.

    Attributes:
        key: Who says it, for messages.
        rate: Name of the rate against which it acts.
        speed: This, in symbols.
        most: Largest force [N m, N].
    """

    key: str
    rate: str
    speed: Any
    most: float


@dataclass
class Tree:
    """Bodies that move by coordinates, in symbols.

    Attributes:
        freedoms: Coordinates.
        parts: Bodies.
        rotors: Inertia that coordinates have besides (d,); none: 0 each.
        pushes: Generalised forces, added up (d,).
        elastic: Energies of springs.
        falls: Potential energies of gravity.
        loops: What stays 0 where joints close loops, of q: independent of each other.
        rubs: Dry friction that may hold.
        beyond: What of it `event_driven` does not know, for messages; empty: nothing.
    """

    freedoms: list[Freedom]
    parts: dict[str, Part]
    rotors: Sequence[float] = ()
    pushes: list[Any] = field(default_factory=list)
    elastic: list[Any] = field(default_factory=list)
    falls: list[Any] = field(default_factory=list)
    loops: list[Any] = field(default_factory=list)
    rubs: list[Rub] = field(default_factory=list)
    beyond: str = ""

    def __post_init__(self) -> None:
        casadi = loaded()
        self.t = casadi.SX.sym("t")
        self.q = casadi.SX.sym("q", len(self.freedoms))
        self.v = casadi.SX.sym("v", len(self.freedoms))
        self._poses = {name: self._pose(part.freedoms) for name, part in self.parts.items()}

    def _pose(self, moved: Sequence[int]) -> tuple[Any, Any, Any]:
        """Rotation and shift of what was at x at t = 0, and how rates turn it (3, d)."""
        casadi = loaded()
        turn, shift = casadi.SX.eye(3), casadi.SX.zeros(3)
        spins = casadi.SX.zeros(3, len(self.freedoms))
        for k in moved:
            freedom, axis = self.freedoms[k], casadi.DM(self.freedoms[k].axis)
            way = self.q[k] - freedom.start
            if freedom.entry >= 0:
                if freedom.entry == 0:
                    four = slice(k, k + 4)
                    begun = casadi.DM([each.start for each in self.freedoms[four]])
                    spins[:, four] = turn @ turning_of(self.q[four])
                    rotation = _turned(self.q[four]) @ _turned(begun).T
                    point = casadi.DM(freedom.point)
                    shift = shift + turn @ (point - rotation @ point)
                    turn = turn @ rotation
            elif freedom.turns:
                spins[:, k] = turn @ axis
                rotation, point = _rotation(freedom.axis, way), casadi.DM(freedom.point)
                shift = shift + turn @ (point - rotation @ point)
                turn = turn @ rotation
            else:
                shift = shift + turn @ (axis * way)
        return turn, shift, spins

    def place(self, part: str | None, point: Floats) -> Any:
        """Where a material point of a body is that was somewhere at t = 0 (3,); None: ground."""
        casadi = loaded()
        at = casadi.DM(in_space(point))
        if part is None:
            return casadi.SX(at)
        turn, shift, _ = self._poses[part]
        return turn @ at + shift

    def centre(self, part: str) -> Any:
        """Of a body (3,)."""
        return self.place(part, self.parts[part].centre)

    def spin(self, part: str) -> Any:
        """Angular velocity (3,)."""
        return self._poses[part][2] @ self.v

    def rate(self, place: Any) -> Any:
        """How something that follows from q changes."""
        return loaded().jtimes(place, self.q, self.v)

    def turned(self, part: str | None, direction: Floats) -> Any:
        """A direction of a body that was so at t = 0 (3,)."""
        casadi = loaded()
        along = casadi.DM(in_space(direction))
        return casadi.SX(along) if part is None else self._poses[part][0] @ along

    def push(self, place: Any, force: Any) -> None:
        """A force on a place (3,), or on any function of q."""
        self.pushes.append(loaded().jacobian(place, self.q).T @ force)

    def weigh(self, part: str, pull: Floats) -> None:
        """Gravity on a body, its weight (3,)."""
        casadi = loaded()
        centre = self.centre(part)
        self.push(centre, casadi.DM(pull))
        begun = casadi.DM(in_space(self.parts[part].centre))
        self.falls.append(-casadi.dot(casadi.DM(pull), centre - begun))

    def pull(self, way: Any, stiffness: float, damping: float) -> None:
        """A spring and a damper along a function of q, or several."""
        casadi = loaded()
        self.push(way, -stiffness * way - damping * self.rate(way))
        self.elastic.append(0.5 * stiffness * casadi.sumsqr(way))

    def twist(self, part: str, moment: Any) -> None:
        """A moment on a body (3,)."""
        self.pushes.append(self._poses[part][2].T @ moment)

    def mass(self) -> Any:
        """M(q), (d, d)."""
        casadi = loaded()
        count = len(self.freedoms)
        total = casadi.SX(casadi.diag(casadi.DM(list(self.rotors) or [0.0] * count)))
        for name, part in self.parts.items():
            moves = casadi.jacobian(self.centre(name), self.q)
            total += part.mass * (moves.T @ moves)
            if part.inertia.any():
                turn, _, spins = self._poses[name]
                own = turn.T @ spins
                total += own.T @ casadi.DM(part.inertia) @ own
        for four in self.quaternions.values():
            size = sum(self._turned(part, four.start) for part in self.parts.values())
            total[four, four] += size * (self.q[four] @ self.q[four].T)
        return total

    @property
    def quaternions(self) -> dict[str, slice]:
        """Where those stand among the coordinates that turn what has a name."""
        return {
            each.name.rpartition(".")[0]: slice(k, k + 4)
            for k, each in enumerate(self.freedoms) if each.entry == 0
        }  # fmt: skip

    def _turned(self, part: Part, first: int) -> float:
        """About the inertia of a body as a quaternion turns it [kg m^2]."""
        if first not in part.freedoms:
            return 0.0
        arm = part.centre - self.freedoms[first].point
        return float(np.trace(part.inertia) + part.mass * arm @ arm)

    def force(self) -> Any:
        """M v', (d,): what pushes, less inertial forces."""
        casadi = loaded()
        impulse = self.mass() @ self.v
        drift = casadi.jtimes(impulse, self.q, self.v)
        drift -= casadi.gradient(casadi.dot(self.v, impulse) / 2, self.q)
        return sum(self.pushes) - drift

    def solved(self, right: Any) -> Any:
        """What M x = right has for x, (d,), in closed loops with G x = 0."""
        return self._held(right, 0)

    def forward(self) -> Any:
        """V' (d,)."""
        casadi = loaded()
        bends = casadi.jtimes(self.opening(), self.q, self.v) if self.loops else 0
        return self._held(self.force(), -bends)

    def opening(self) -> Any:
        """Rates of what closes loops (l,)."""
        return self.rate(loaded().vertcat(*self.loops))

    def _held(self, right: Any, opens: Any) -> Any:
        """What M x = right + G^T l has for x, with G x = opens."""
        if not self.loops:
            return _solved(self.mass(), right)
        casadi, count = loaded(), right.shape[1]
        rows = casadi.jacobian(casadi.vertcat(*self.loops), self.q)
        both = _solved(self.mass(), casadi.horzcat(right, rows.T))
        free, back = both[:, :count], both[:, count:]
        return free + back @ _solved(rows @ back, opens - rows @ free)


def _solved(matrix: Any, right: Any) -> Any:
    """Of a symmetric positive definite system, by Cholesky's factors in symbols."""
    casadi = loaded()
    factors, diagonal, order = casadi.ldl(matrix)
    return casadi.ldl_solve(right, factors, diagonal, order)


def _turned(quaternion: Any) -> Any:
    """Rotation by a quaternion of any length, (3, 3)."""
    casadi = loaded()
    w, v = quaternion[0], quaternion[1:]
    across = casadi.skew(v)
    square = casadi.sumsqr(quaternion)
    return casadi.SX.eye(3) + 2 * (w * across + across @ across) / square


def turning_of(quaternion: Any) -> Any:
    """What makes rates of a quaternion an angular velocity along fixed axes, (3, 4)."""
    casadi = loaded()
    quaternion = casadi.SX(quaternion)
    w, v = quaternion[0], quaternion[1:]
    turns = casadi.horzcat(-v, w * casadi.SX.eye(3) + casadi.skew(v))
    return 2 * turns / casadi.sumsqr(quaternion)


def _rotation(axis: Floats, angle: Any) -> Any:
    """Matrix of a turn about an axis of length 1, (3, 3) (Rodrigues)."""
    casadi = loaded()
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    along = np.outer(axis, axis)
    c, s = casadi.cos(angle), casadi.sin(angle)
    return (
        casadi.sparsify(casadi.SX(casadi.DM(along)))
        + c * casadi.sparsify(casadi.DM(np.eye(3) - along))
        + s * casadi.sparsify(casadi.DM(across))
    )


def in_space(values: Any) -> Floats:
    """Three numbers, 0 where fewer are given."""
    found = np.zeros(3)
    found[: len(values)] = values
    return found
