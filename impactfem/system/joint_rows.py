"""Rows of one joint: the terms that hold two stations together, and those of its coordinate."""

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Joint
from impactfem.system.joint_kernels import ANGLE, DISTANCE, DOT, POINT, SLIDE
from impactfem.system.rigid import in_space
from impactfem.system.stations import Tied
from impactfem.system.ties import TiedPlace


class Rows:
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

    def tie(
        self, joint: int, bodies: tuple[int, int], tied: TiedPlace, places: Floats, turns: Floats
    ) -> None:
        """Add those that hold two stations together along axes in space.

        Args:
            joint: The tie.
            bodies: The stations.
            tied: Where it is, and along which axes.
            places: Of all stations [m], (stations, 3).
            turns: Their rotations, (stations, 3, 3).
        """
        arms = np.zeros((2, 3))
        for side, (body, (_, at, what)) in enumerate(zip(bodies, tied.sides, strict=True)):
            if body:
                arm = tied.arms[side] if isinstance(what, Tied) else at - places[body]
                arms[side] = turns[body].T @ arm
        for k in tied.along:
            row, axes = self.add(joint, holds=True), np.tile(np.eye(3)[k], (2, 1))
            self.terms.append((POINT, row, bodies, arms, axes, np.zeros((2, 3)), 1.0))


class JointFrame:
    """Place and axes of a joint along the axes of both its bodies."""

    def __init__(
        self,
        joint: Joint,
        bodies: tuple[int, int],
        places: Floats,
        turns: Floats,
        *,
        swapped: bool,
        basis: Floats,
    ) -> None:
        """Find it at t = 0.

        Args:
            joint: The joint.
            bodies: Stations that it holds.
            places: Of all stations [m], (stations, 3).
            turns: Their rotations, (stations, 3, 3).
            swapped: Whether its directions turn with the second side instead of the first.
            basis: Directions along which places are held, (3, 3) by rows; the last one is its axis
                where it needs none.
        """
        given = joint.places[::-1] if swapped else joint.places
        bodies = bodies[::-1] if swapped else bodies
        self._joint, self._bodies, self._swapped = joint, bodies, swapped
        at = [in_space(np.asarray(point, dtype=float)) for point in given]
        if not len(given[0]):  # it acts on the middle of what it holds, of the ground across it
            at = [places[b or other] for b, other in (bodies, bodies[::-1])]
        each = list(zip(at, bodies, strict=True))
        self._arms = np.array([turns[b].T @ (p - places[b]) for p, b in each])
        axis, self._basis = basis[2], basis
        if joint.axis is not None:
            axis = in_space(np.asarray(joint.axis, dtype=float) / np.abs(joint.axis).max())
        self._axis = axis / np.linalg.norm(axis)
        if joint.dim == 2:
            one = np.cross([0.0, 0.0, 1.0], self._axis)
            one = one if joint.axis is not None else np.array([1.0, 0.0, 0.0])
        elif joint.second_axis is not None:
            one = np.asarray(joint.second_axis, dtype=float) / np.abs(joint.second_axis).max()
        elif joint.axis is None:
            one = basis[0]
        else:
            one = np.cross(self._axis, np.eye(3)[np.argmin(np.abs(self._axis))])
        one = one - (one @ self._axis) * self._axis
        self._one = one / np.linalg.norm(one)
        self._two = np.cross(self._axis, self._one)
        self._turns = turns[list(bodies)]

    def _own(self, direction: Floats) -> Floats:
        """A direction in space along the axes of both bodies, (2, 3)."""
        return np.asarray(np.einsum("bij,i->bj", self._turns, direction))

    def put(self, rows: Rows, row: int, kind: int, first: Floats, second: Floats) -> None:
        """Add a term of directions in space of the first and the second body to a row.

        The direction of a POINT does not turn with a body.
        """
        axes = np.array([self._own(first)[0], self._own(second)[1]])
        if kind == POINT:
            axes[0] = first
        across = self._own(self._one)
        share = -1.0 if self._swapped and kind == SLIDE else 1.0
        rows.terms.append((kind, row, self._bodies, self._arms, axes, across, share))

    def held(self, dim: int, *, turning: bool) -> list[tuple[int, Floats, Floats]]:
        """Kinds of terms and their directions that are constraints.

        Args:
            dim: Number of coordinates.
            turning: Whether both sides turn: else nothing holds turns.
        """
        axis, one, two = self._axis, self._one, self._two
        basis = self._basis if self._joint.preload is None else (axis, one, two)  # that row first
        space = [(POINT, direction, direction) for direction in basis[:dim]]
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
        found["distance"] = [(DISTANCE, axis, axis)]
        own = found[self._joint.kind] if self._joint.holds else []
        return own if turning else [each for each in own if each[0] != DOT]

    @property
    def coordinate(self) -> tuple[int, Floats, Floats]:
        """Kind of the term that is its coordinate, and its directions."""
        kinds = {"revolute": ANGLE, "distance": DISTANCE}
        if not self._joint.leads:
            return POINT, self._axis, self._axis
        return kinds.get(self._joint.kind, SLIDE), self._axis, self._axis
