"""Gaps of several bodies: each to its obstacles, and between surfaces of two of them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.contact.ball_kernels import plane_gaps
from impactfem.contact.faces import Faces
from impactfem.contact.gaps import Gaps
from impactfem.contact.meeting import Led, Lent, Meet, Meeting, Turning
from impactfem.contact.pair_responses import PairResponses, Weights, ranges
from impactfem.contact.responses import Columns, Responses
from impactfem.contact.sparse_rows import across, below, times
from impactfem.contact.turning_gaps import TurningGaps

_ENTRIES = 4096  # of weights that are kept as an array


class PairGaps:
    """Gaps of contact nodes to obstacles and to other bodies, as `SolidMarch` takes them.

    The order: the obstacle gaps of every body, then the weighted gaps between surfaces. Small
    sliding keeps weights and normals of t = 0; large sliding finds them anew in each layer, with a
    fixed number of gaps: those without a partner are open by `FAR`.

    Attributes:
        pairs: Names of the pairs of the scene: those of each body's obstacles, then of surfaces.
    """

    def __init__(
        self,
        places: Floats,
        initial: Floats,
        obstacles: Sequence[tuple[slice, Integers, Gaps]],
        meetings: Sequence[Meet],
        names: Sequence[str],
        faces: Faces | None = None,
    ) -> None:
        """Find the gaps of t = 0.

        Args:
            places: Undeformed places of all contact nodes [m], (nodes, dim).
            initial: Their displacement at t = 0 [m], (nodes, dim).
            obstacles: For each body the places of its nodes, those of them (counted from the first
                of the body) that can touch an obstacle, and their gaps.
            meetings: Pairs of surfaces.
            names: Of the pair of each gap between surfaces; of gaps that are lent of each pair.
            faces: Nodes that touch on faces; None without any.
        """
        before = [name for _, _, gaps in obstacles for name in gaps.pairs]
        listed = (*before, *names)
        self.pairs = tuple(dict.fromkeys(listed))  # gaps of a pair may have several sources
        place = {name: k for k, name in enumerate(self.pairs)}
        self._listed = np.array([place[name] for name in listed], dtype=np.int64)
        self._places, self._initial = places, initial
        self._obstacles, self._meetings = tuple(obstacles), tuple(meetings)
        self._beside = _by_obstacle(self._obstacles)
        flat = [each for each in self._beside if each[2].plane is not None]
        self._flat = _flat(flat) if flat else None
        self._bent = [each for each in self._beside if each[2].plane is None]
        # Found once: what asks of protocols costs as much as a gap does.
        self._led = {k: meet for k, meet in enumerate(self._meetings) if isinstance(meet, Led)}
        self._lent = {k: meet for k, meet in enumerate(self._meetings) if isinstance(meet, Lent)}
        self._moving = any(meet.follows for meet in self._meetings)
        self.updated = self._moving or any(gaps.updated for _, _, gaps in self._obstacles)
        nodes = len(places)
        rows = [own.start + chosen for own, chosen, _ in obstacles]
        chosen = np.concatenate([*rows, np.zeros(0, dtype=np.int64)]).astype(np.int64)
        self._bound = csr_matrix(
            (np.ones(len(chosen)), (np.arange(len(chosen)), chosen)), shape=(len(chosen), nodes)
        )
        # Of few gaps and nodes arrays are far cheaper than what SciPy does for sparse matrices.
        self._few = _ENTRIES // max(1, nodes)
        self._dense = self._bound.toarray() if len(chosen) <= self._few else np.zeros((0, nodes))
        self._faces = faces
        self._responses: PairResponses | None = None
        there = places + initial
        self._first = [meet(there, there) for meet in self._meetings]
        self._weigh(self._first)
        self._area = np.concatenate([*(entry.area for entry in self._first), np.zeros(0)])
        self._met: Sequence[Meeting] = self._first
        self._turns: list[Turning | None] | None = None  # of what has met
        self._turning: TurningGaps | None = None
        self._pair: Integers | None = None  # of each gap, where that stays

    def _weigh(self, met: Sequence[Meeting]) -> None:
        """Keep the weights of all gaps, of what touches on faces between the middles."""
        if self._bound.shape[0] + sum(len(entry.gap) for entry in met) <= self._few:
            each = [entry.weights.toarray() for entry in met]
            self._middle: Weights = np.concatenate([self._dense, *each])
        else:
            weights = [self._bound, *(entry.weights for entry in met)]
            self._middle = below(weights, len(self._places))
        self._weights = self._middle

    def _reach(self, normals: Floats) -> None:
        """Take the weights to the faces, by the normals of all gaps (pairs, dim)."""
        if self._faces is not None:
            self._weights = self._faces.reached(self._middle, normals)
            if self._responses is not None:
                self._responses.follow(self._weights)

    def pair_of(self) -> Integers:
        """Which of `pairs` each gap belongs to now, (gaps,)."""
        if self._pair is not None:
            return self._pair
        found, first = [], 0
        for _, _, gaps in self._obstacles:
            found.append(first + gaps.pair_of())
            first += len(gaps.pairs)
        for k, entry in enumerate(self._first):
            lent = self._lent.get(k)
            own = np.arange(len(entry.gap)) if lent is None else np.maximum(lent.held, 0)
            found.append(first + own)
            first += len(entry.gap) if lent is None else lent.pairs
        pair: Integers = self._listed[np.concatenate([np.zeros(0, dtype=np.int64), *found])]
        if self._lent:
            return pair
        if all(len(gaps.pairs) == 1 for _, _, gaps in self._obstacles):
            self._pair = pair  # none can change
        return pair

    def responses(
        self, columns: Columns, whole: int | None, apart: Integers | None = None
    ) -> Responses | PairResponses:
        """How the gaps answer to contact forces along their normals; see `ContactGaps`.

        With weights and normals that stay, a gap answers as a node does that has a gap of its own.
        """
        if self.updated:
            return self.directed(columns, apart)
        _, normals = self.at(self._initial, self._initial, self._initial, 0.0)
        count, dim = normals.shape
        return Responses(count, dim, normals, columns, whole, self)

    def directed(self, columns: Columns, apart: Integers | None = None) -> PairResponses:
        """How they answer to forces in any direction."""
        nodes, dim = self._places.shape
        self._responses = PairResponses(dim, nodes, columns, apart)
        self._responses.follow(self._weights)
        return self._responses

    def relative(self, values: Floats) -> Floats:
        """Values of nodes (nodes, dim) as differences in the gaps, (pairs, dim)."""
        found = times(self._weights, values)
        return found if self._turning is None else found - self._turning.relative(values)

    def spread(self, forces: Floats) -> Floats:
        """Forces on the nodes (nodes, dim) by those in the gaps (pairs, dim)."""
        found = across(self._weights, forces)
        return found if self._turning is None else found - self._turning.spread(forces)

    def units(self, rows: Integers, directions: Floats) -> Floats:
        """Forces on the nodes by unit forces in some gaps, (rows, ways, nodes, dim).

        Args:
            rows: Some gaps.
            directions: Of the forces, (rows, ways, dim).
        """
        some = self._weights[rows]
        weights = some if isinstance(some, np.ndarray) else some.toarray()
        found: Floats = weights[:, None, :, None] * directions[:, :, None, :]
        return found if self._turning is None else found - self._turning.units(rows, directions)

    def normals_at(self, displacement: Floats, time: float, arms: Floats | None = None) -> Floats:
        """Normals where nodes are amid a step, (pairs, dim); who meets whom stays as found.

        Forces along the way between both sides have no moment; elsewhere, to the next `at`,
        directions turn with one side (`impactfem.contact.turning_gaps`).

        Args:
            displacement: Of the contact nodes [m], (nodes, dim).
            time: [s].
            arms: Displacements that moments go by [m], (nodes, dim); None: the same.
        """
        normals = [np.zeros((0, displacement.shape[1]))]
        for own, chosen, obstacle in self._obstacles:
            part = displacement[own][chosen]
            normals.append(obstacle.normals_at(part, time))
        there = self._places + (displacement if arms is None else arms)
        ways = self._middle @ there
        if self._turns is None:
            self._turns = [entry.turning() if entry.turning else None for entry in self._met]
        patches, first = [], self._bound.shape[0]
        for meet, entry, turning in zip(self._meetings, self._met, self._turns, strict=True):
            end, normal = first + len(entry.gap), entry.normal
            if turning is not None and turning.patch is not None:
                patches.append((first, turning.patch))
                ways[first:end] += turning.beyond
            elif turning is None and meet.follows:
                normal = _along(ways[first:end], normal)
            normals.append(normal)
            first = end
        found = np.concatenate(normals)
        self._reach(found)
        if self._faces is not None:
            ways += (self._weights - self._middle) @ there
        self._turning = TurningGaps.of(patches, there, ways)
        return found

    def entries(self, rows: Integers) -> tuple[Integers, Integers, Floats]:
        """What some gaps weigh: place of the gap among them, node, weight, (entries,) each."""
        if isinstance(self._weights, np.ndarray):
            found = self._weights[rows]
            gap, node = np.nonzero(found)
            return gap, node, found[gap, node]
        ends = self._weights.indptr
        counts = ends[rows + 1] - ends[rows]
        gap = np.repeat(np.arange(len(rows)), counts)
        at = ranges(ends[rows], counts)
        return gap, self._weights.indices[at], self._weights.data[at]

    def at(
        self,
        displacement: Floats,
        begin: Floats,
        last: Floats,
        time: float,
        back: float = 0.5,
        span: float = 0.0,
    ) -> tuple[Floats, Floats]:
        """Gaps (pairs,) and normals (pairs, dim); see `Gaps.at`."""
        self._turning = None
        found = self._at_obstacles(displacement, begin, last, (time, back, span))
        if not self._meetings:
            self._reach(found[1])
            return found
        gaps, normals = [found[0]], [found[1]]
        met = self._first
        if self._moving:
            for led in self._led.values():
                led.tell(time, time if displacement is begin else time - back * span)
            there = self._places + displacement
            if last is not begin:
                there += last - begin
            acting = there - back * (displacement - begin)
            met = [
                meet(there, acting) if meet.follows else first
                for meet, first in zip(self._meetings, self._first, strict=True)
            ]
            self._weigh(met)
            self._met, self._turns = met, None
            self._area = np.concatenate([entry.area for entry in met])
            if self._responses is not None:
                self._responses.follow(self._weights)
        for meet, entry in zip(self._meetings, met, strict=True):
            gap = entry.gap
            if last is not begin or not meet.follows:
                moved = begin - last if meet.follows else displacement - self._initial
                gap = gap + np.einsum("ij,ij->i", entry.normal, times(entry.weights, moved))
            gaps.append(gap)
            normals.append(entry.normal)
        directions = np.concatenate(normals)
        self._reach(directions)
        return np.concatenate(gaps), directions

    def _at_obstacles(
        self, displacement: Floats, begin: Floats, last: Floats, times: tuple[float, float, float]
    ) -> tuple[Floats, Floats]:
        """The same of gaps to obstacles; times are those that `at` takes."""
        count = self._bound.shape[0]
        found, beside = (np.zeros(count), np.zeros((count, displacement.shape[1]))), self._beside
        if self._flat is not None and last is begin:
            plane_gaps(*self._flat, self._places, displacement, *found)
            beside = self._bent
        for nodes, rows, obstacle in beside:
            before = begin[nodes]
            after = before if last is begin else last[nodes]
            parts = before if displacement is begin else displacement[nodes], before, after
            found[0][rows], found[1][rows] = obstacle.at(*parts, *times)
        return found

    @property
    def normals_vary(self) -> bool:
        """Whether some may change with the nodes."""
        return self._moving or any(gaps.normals_vary for _, _, gaps in self._obstacles)

    @property
    def moves(self) -> bool:
        """Whether what some nodes face moves by itself, as obstacles may."""
        return bool(self._led) or any(gaps.moves for _, _, gaps in self._beside)

    def only_on(self, nodes: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Whether a gap weighs no other nodes than some, (pairs,)."""
        if nodes.all():
            return np.ones(self._weights.shape[0], dtype=bool)
        found: NDArray[np.bool_] = abs(self._weights) @ (~nodes).astype(float) == 0.0
        return found

    def shift(self, time: float) -> Floats:
        """Displacement of what nodes face on obstacles since t = 0 [m], (pairs, dim)."""
        moved = np.zeros((self._weights.shape[0], self._places.shape[1]))
        for _, rows, gaps in self._beside:
            if gaps.moves:
                moved[rows] = gaps.shift(time)
        if not self._led:
            return moved
        ends = self._bound.shape[0] + np.cumsum([0, *(len(entry.gap) for entry in self._first)])
        for k, led in self._led.items():
            moved[ends[k] : ends[k + 1]] = led.shift(time)
        return moved

    def nodal(self, force: Floats, gap: Floats) -> tuple[Floats, Floats, Floats]:
        """Gap [m], pressure [Pa] and whether pressed (1 or 0), of the contact nodes, (nodes,) each.

        Pressures of obstacles and other bodies add up. A gap is the smaller one of that to the
        obstacle and the mean of those to other bodies by their weights; NaN and 0 without any.
        """
        nodes, first = len(self._places), 0
        place, pressure, pressed = np.full(nodes, np.nan), np.zeros(nodes), np.zeros(nodes)
        bound = self._bound.shape[0]
        share = csr_matrix(abs(self._middle[bound:]).T)
        area = share @ self._area
        seen = area > 0.0
        open_ = np.where(np.isfinite(gap[bound:]), self._area, 0.0)
        place[seen] = (share @ (self._area * gap[bound:]))[seen] / (share @ open_)[seen]
        pressure[seen] = (share @ force[bound:])[seen] / area[seen]
        pressed[share @ (force[bound:] > 0.0) > 0.0] = 1.0
        for own, chosen, obstacle in self._obstacles:
            where, mine = own.start + chosen, slice(first, first + len(chosen))
            found = obstacle.nodal(force[mine], gap[mine])
            # A node may have several of these gaps.
            np.fmin.at(place, where, found[0])
            np.add.at(pressure, where, found[1])
            np.maximum.at(pressed, where, found[2])
            first = mine.stop
        return place, pressure, pressed

    @property
    def shares_nodes(self) -> bool:
        """Whether a node may have gaps to several obstacles."""
        return any(gaps.shares_nodes for _, _, gaps in self._beside)

    def handed(self, values: Floats) -> Floats:
        """What gaps have, (pairs,) or (pairs, dim), by which carry it now; see `Gaps.handed`."""
        found = values
        for _, rows, gaps in self._beside:
            if gaps.shares_nodes:
                found = values.copy() if found is values else found
                found[rows] = gaps.handed(values[rows])
        return found

    def memory(self) -> dict[str, Floats]:
        """What the answers of pairs depend on besides places."""
        return {"met": np.concatenate([np.zeros(0), *(meet.memory for meet in self._meetings)])}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what pairs went by."""
        first = 0
        for meet in self._meetings:
            last = first + len(meet.memory)
            meet.recall(memory["met"][first:last])
            first = last


def _by_obstacle(
    obstacles: Sequence[tuple[slice, Integers, Gaps]],
) -> list[tuple[Integers, Integers, Gaps]]:
    """Nodes and rows of gaps, those of many bodies beside the same obstacle together."""
    groups: dict[int, list[tuple[Integers, Integers, Gaps]]] = {}
    first = 0
    for own, chosen, gaps in obstacles:
        rows = np.arange(first, first + len(chosen))
        first += len(chosen)
        same = id(gaps if gaps.single is None else gaps.single)
        groups.setdefault(same, []).append((own.start + chosen, rows, gaps))
    return [
        (np.concatenate(nodes), np.concatenate(rows), Gaps.joined(gaps))
        for nodes, rows, gaps in (zip(*group, strict=True) for group in groups.values())
    ]


def _flat(groups: Sequence[tuple[Integers, Integers, Gaps]]) -> tuple[Any, ...]:
    """Gaps to planes at rest, as `plane_gaps` takes them."""
    nodes, rows, gaps = zip(*groups, strict=True)
    sizes = [len(each) for each in rows]
    planes = [(each.plane.point, each.plane.normal) for each in gaps]
    points, normals = (
        np.repeat(np.array(e, dtype=float), sizes, axis=0) for e in zip(*planes, strict=True)
    )
    radius = [np.broadcast_to(e.radius, n) for e, n in zip(gaps, sizes, strict=True)]
    return *map(np.concatenate, (nodes, rows)), points, normals, np.concatenate(radius)


def _along(ways: Floats, normals: Floats) -> Floats:
    """Directions of ways (pairs, dim) on the side of normals; these where there is no way."""
    side = np.sign(np.einsum("ij,ij->i", ways, normals))
    length = np.linalg.norm(ways, axis=1)
    known = side * length != 0.0
    found = normals.copy()
    found[known] = (side / np.where(known, length, 1.0))[known, None] * ways[known]
    return found
