"""Gaps and normals of contact nodes, by their initial place or by their present one."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.contact.corners import several_gaps
from impactfem.contact.distance import nearest_obstacle, signed_distance
from impactfem.contact.followed_pair import FAR
from impactfem.contact.responses import Columns, Responses
from impactfem.scene.obstacles.rotation import placement


class Touching(Protocol):
    """Contact nodes at t = 0; see `impactfem.contact.surfaces.ContactNodes`."""

    @property
    def positions(self) -> Floats:
        """Places [m], (count, dim)."""

    @property
    def gap(self) -> Floats:
        """Gaps [m], (count,)."""

    @property
    def normal(self) -> Floats:
        """Normals of the obstacle, (count, dim)."""

    @property
    def obstacle(self) -> Integers:
        """Which obstacle, (count,)."""

    @property
    def pressures(self) -> csr_matrix:
        """Matrix from forces [N] to pressures [Pa]."""


@dataclass(frozen=True)
class Started:
    """Gaps at t = 0, each to an obstacle that stays its own, as `Gaps` takes them."""

    positions: Floats
    gap: Floats
    normal: Floats
    obstacle: Integers
    pressures: csr_matrix

    @classmethod
    def of_balls(cls, obstacle: Any, places: Floats, radius: Floats) -> "Started":
        """Of balls at some places [m], (balls, dim), with radii [m], (balls,), without pressure."""
        gap, normal = signed_distance(obstacle, places, 0.0)
        count = len(places)
        none = np.zeros(count, dtype=np.int64)
        return cls(places, gap - radius, normal, none, csr_matrix((count, count)))

    @classmethod
    def to_each(
        cls, contact: Touching, obstacles: Sequence[Any], reach: float
    ) -> tuple[Integers, "Started"]:
        """Of nodes to every obstacle that is within reach [m]; with the node of each gap."""
        fields = [signed_distance(obstacle, contact.positions, 0.0) for obstacle in obstacles]
        own = [np.flatnonzero(gap <= reach) for gap, _ in fields]
        nodes = np.concatenate(own)
        return nodes, cls(
            contact.positions[nodes],
            np.concatenate([gap[some] for (gap, _), some in zip(fields, own, strict=True)]),
            np.concatenate([normal[some] for (_, normal), some in zip(fields, own, strict=True)]),
            np.repeat(np.arange(len(own)), [len(some) for some in own]),
            csr_matrix(block_diag([contact.pressures[some][:, some] for some in own])),
        )


class Gaps:
    """Distances of contact nodes from the obstacles; see `impactfem.contact.distance`.

    Attributes:
        updated: Whether distance and normal follow the nodes.
        pairs: Names of the pairs of the scene, one for each obstacle.
        contact, initial, radius: The nodes at t = 0, their displacement and their radii as balls.
        pressures: Matrix from forces [N] to pressures [Pa]; see `impactfem.contact.pressure`.
    """

    def __init__(
        self,
        obstacles: Sequence[Any],
        contact: Touching,
        initial: Floats,
        *,
        updated: bool,
        pairs: Sequence[str],
        radius: Floats | float = 0.0,
        nodes: Integers | None = None,
    ) -> None:
        """Take the obstacle of each node.

        Args:
            obstacles: Rigid obstacles.
            contact: The contact nodes at t = 0.
            initial: Their initial displacement [m], shape (count, dim).
            updated: Whether distance and normal follow the nodes, which then are held off the
                nearest obstacle; otherwise they are linearised at the place at t = 0.
            pairs: Names of the pairs of the body with the obstacles.
            radius: Of nodes that are balls [m], (count,) or a number.
            nodes: That of each gap, where nodes have a gap to each obstacle that they may reach;
                None: each has one, to the nearest.
        """
        self.pairs, self.radius, self._nodes = tuple(pairs), radius, nodes
        self._obstacles, self.updated = obstacles, updated
        # Whose normals are not everywhere and always the same.
        each = enumerate(obstacles)
        self._bent = [(k, o) for k, o in each if o.plane is None or o.rotation is not None]
        self.contact, self.initial = contact, initial
        self._positions = contact.positions - initial
        self._nearest, self._gap, self._normal = contact.obstacle, contact.gap, contact.normal
        self._carrier = np.arange(len(contact.gap))  # of each gap that which takes its place
        self._size = float(np.linalg.norm(np.ptp(self._positions, axis=0))) if len(initial) else 0.0
        self.pressures = contact.pressures
        self.moves = any(obstacle.moves for obstacle in obstacles)
        # What the nodes are nearest to, on the obstacles at rest.
        self._facing = np.zeros_like(self._normal)
        self._face(contact.positions, contact.gap + radius, self._normal, 0.0)

    @property
    def single(self) -> Any | None:
        """The obstacle, if there is one only and distances follow the nodes."""
        return self._obstacles[0] if self.updated and len(self._obstacles) == 1 else None

    @property
    def plane(self) -> Any | None:
        """Where `single` ends, if it is a plane at rest."""
        one = self.single
        if one is None or one.moves or one.rotation is not None or self._nodes is not None:
            return None
        return one.plane

    @classmethod
    def joined(cls, each: Sequence["Gaps"]) -> "Gaps":
        """Of the nodes of several beside the same `single` obstacle: it is asked once for all."""
        first = each[0]
        if len(each) == 1:
            return first
        initial = np.concatenate([gaps.initial for gaps in each])
        places = np.concatenate([gaps.contact.positions for gaps in each])
        radius = np.concatenate([np.broadcast_to(gaps.radius, len(gaps.initial)) for gaps in each])
        balls = Started.of_balls(first.single, places, radius)
        return cls((first.single,), balls, initial, updated=True, pairs=first.pairs, radius=radius)

    def _moving(self) -> Iterator[tuple[NDArray[np.bool_], Any]]:
        """Which gaps are those of each obstacle that moves, (count,), and the obstacle."""
        for index, obstacle in enumerate(self._obstacles):
            if obstacle.moves:
                yield self._nearest == index, obstacle

    def _face(self, places: Floats, distance: Floats, normal: Floats, time: float) -> None:
        """Keep what nodes at some places are nearest to, on obstacles that turn."""
        for mine, obstacle in self._moving():
            if obstacle.rotation is not None:
                on = places[mine] - distance[mine, None] * normal[mine]
                self._facing[mine] = placement(obstacle, time).back(on)

    @property
    def normals(self) -> Floats | None:
        """Normals that stay, shape (count, dim); None if they follow the nodes."""
        return None if self.updated else self._normal

    @property
    def normals_vary(self) -> bool:
        """Whether they may change with the nodes: not on one plane."""
        return self.updated and (len(self._obstacles) > 1 or bool(self._bent))

    def pair_of(self) -> NDArray[np.int64]:
        """Which of `pairs` each gap belongs to: that of the obstacle that is now its, (count,)."""
        return self._nearest if self._nodes is None else self.contact.obstacle

    @property
    def shares_nodes(self) -> bool:
        """Whether a node may have several gaps."""
        return self._nodes is not None

    def handed(self, values: Floats) -> Floats:
        """What gaps have, (count,) or (count, dim), handed over to those that carry them now."""
        if self._nodes is None:
            return values
        found = np.zeros_like(values)
        np.add.at(found, self._carrier, values)
        return found

    def responses(
        self,
        columns: Columns,
        whole: int | None,
        apart: NDArray[np.int64] | None = None,  # noqa: ARG002  (of several bodies)
    ) -> Responses:
        """How the gaps answer to contact forces.

        Args:
            columns: Answers of the contact nodes.
            whole: For how many nodes answers are worth keeping in full; None: for all.
            apart: None, as it is one body.
        """
        count, dim = self._normal.shape
        return Responses(count, dim, self.normals, columns, whole)

    def relative(self, values: Floats) -> Floats:
        """What values of the contact nodes (count, dim) make for the gaps: here the same."""
        return values

    def spread(self, forces: Floats) -> Floats:
        """Forces on the contact nodes by those in the gaps (count, dim): here the same."""
        return forces

    def units(self, rows: Integers, directions: Floats) -> Floats:
        """Forces on the nodes by unit forces in some gaps, (rows, ways, nodes, dim)."""
        found = np.zeros((*directions.shape[:2], *self._normal.shape))
        found[np.arange(len(rows)), :, rows] = directions
        return found

    def entries(self, rows: Integers) -> tuple[Integers, Integers, Floats]:
        """What some gaps weigh: place of the gap among them, node, weight, (entries,) each."""
        return np.arange(len(rows)), rows, np.ones(len(rows))

    def at(
        self,
        displacement: Floats,
        begin: Floats,
        last: Floats,
        time: float,
        back: float = 0.5,
        span: float = 0.0,
    ) -> tuple[Floats, Floats]:
        """Gaps (count,) and normals (count, dim) for displacements at a time.

        Args:
            displacement: Of the contact nodes without contact forces [m], shape (count, dim).
            begin: The same one layer earlier.
            last: With contact forces, one layer earlier.
            time: [s].
            back: Where on the way the forces act, from its end (0) to its start (1).
            span: How long the way takes [s].
        """
        if not self.updated:
            gap = self._gap + np.einsum("ij,ij->i", self._normal, displacement - self.initial)
            moved = np.einsum("ij,ij->i", self._normal, self.shift(time))
            return gap - moved, self._normal
        # Distances where the node is bound to go, normals where the forces act on the way: amid it,
        # their work is that of the change of distance, but for the cube of the way.
        static = None if last is begin else last - begin
        there = self._positions + displacement
        if static is not None:
            there += static
        if self._nodes is not None:
            static = np.zeros_like(there) if static is None else static
            return self._several(self._nodes, there, static, time)
        self._nearest, gap, normal = nearest_obstacle(self._obstacles, there, time)
        acting, when, near = there, time, gap
        if displacement is not begin:
            acting, when = there - back * (displacement - begin), time - back * span
            near = np.empty_like(gap)
            for index, obstacle in self._bent:
                mine = self._nearest == index
                if mine.any():
                    near[mine], normal[mine] = signed_distance(obstacle, acting[mine], when)
        self._face(acting, near, normal, when)
        gap = gap - self.radius
        return gap if static is None else gap - np.einsum("ij,ij->i", normal, static), normal

    def _several(
        self, nodes: Integers, there: Floats, static: Floats, time: float
    ) -> tuple[Floats, Floats]:
        """`at` where nodes have several gaps: forces act where they are looked at."""
        own = self.contact.obstacle
        by, gap, normal = several_gaps(self._obstacles, own, nodes, there, self._size, time)
        self._carrier, self._nearest, gap, normal = by, own[by], gap[by], normal[by]
        self._face(there, gap, normal, time)
        gap = gap - np.einsum("ij,ij->i", normal, static)
        return np.where(by == np.arange(len(by)), gap, FAR), normal

    def normals_at(
        self,
        displacement: Floats,
        time: float,
        arms: Floats | None = None,  # noqa: ARG002  (of bodies that meet)
    ) -> Floats:
        """Normals where nodes are amid a step, (count, dim)."""
        return self.at(displacement, displacement, displacement, time)[1]

    def only_on(self, nodes: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Whether a gap weighs no other nodes than some: here each has its own."""
        return nodes

    def shift(self, time: float) -> Floats:
        """How far what each node is nearest to has moved with its obstacle since t = 0 [m].

        What that is `at` has found, on the way where forces act; shape (count, dim).
        """
        moved = np.zeros_like(self._normal)
        for mine, obstacle in self._moving():
            now, first = placement(obstacle, time), placement(obstacle, 0.0)
            moved[mine] = now.since(first, self._facing[mine])
        return moved

    def nodal(self, force: Floats, gap: Floats) -> tuple[Floats, Floats, Floats]:
        """Gap [m], pressure [Pa] and whether pressed (1 or 0), of the contact nodes."""
        return gap, self.pressures @ force, (force > 0.0).astype(np.float64)

    def memory(self) -> dict[str, Floats]:
        """Nothing: distances follow from the places."""
        return {}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Nothing."""
