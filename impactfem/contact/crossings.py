"""Gaps of a slender body in space, whose axis may cross others between nodes.

Two axes are nearest to each other at a node of one of them, or where they cross, along the way
across both. So nodes are held off the other body, its nodes or corners off the axis, and where they
cross so are places that move along it, found anew in each layer. Such a place lies on a smooth
curve through the nodes (`curves_of`) and weighs them as that does: on chords an axis that slides
would strike every node. A node beside which axes cross nearer to each other is passed, not struck:
its way to the other body leans along the axis, and would catch what slides.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.contact.ball_pairs import BallPair, Target
from impactfem.contact.convex_nodes import CornersOnFaces, NodesOnConvex
from impactfem.contact.convex_pairs import Marked
from impactfem.contact.crossing_kernels import crossed
from impactfem.contact.followed_pair import FAR
from impactfem.contact.meeting import Anew, Meeting, Turning, patch_of, weights_on
from impactfem.contact.sparse_rows import below

_MOST = 2  # places of a line: it enters a face over one edge and leaves it over another one
_LEVEL = 0.02  # sine of the angle below which axes lie along each other
_SAME = 5e-5  # share of the way between two axes by which a place is a node; sine of alike ways


@dataclass(frozen=True)
class AxisPair(Anew):
    """A slender body in space and another one, as `impactfem.contact.pairs` takes them.

    Gaps are those of its nodes, then of the other one's nodes or corners, then of places that move
    along its lines. Forces in all of them act on the slender body.

    Attributes:
        axis: Of the slender body.
        other: What it may cross.
        ends: Its nodes, held off the other one.
        others: Nodes or corners of that, held off its axis.
    """

    axis: Target
    other: Target | Marked
    ends: BallPair | NodesOnConvex
    others: BallPair | CornersOnFaces

    touch = 0.0

    @property
    def nodes(self) -> Integers:
        """Places of all its nodes among all contact nodes."""
        return self.ends.nodes

    @property
    def thickness(self) -> float:
        """Way [m] from which on they could pass through each other."""
        return self.ends.thickness

    @property
    def count(self) -> int:
        """Number of gaps."""
        return self.ends.count + self.others.count + _MOST * len(self.axis.simplices)

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with all contact nodes at some places (nodes, 3).

        Where they cross contact points are those where forces act, and gaps change with their
        material from there on, as in `impactfem.contact.convex_pairs`; at nodes see `BallPair`.
        """
        axis, edges, total = self.axis, self.other.edges(acting), self.ends.total
        own, deep = axis.edges(acting), edges.deep
        line, edge, shares, n, far = crossed(own.curves, edges.curves, edges.normals, deep, _MOST)
        values, nodes = axis.weighed(line, shares[:, 0])
        room = far[:, 0] - edges.radius[edge]
        at = np.einsum("cn,cnd->cd", values, acting[nodes]) - room[:, None] * n
        pushed, others, beyond = self.other.pushed(edge, shares[:, 1], at, n, acting)
        weights = weights_on(np.hstack([values, -pushed]), np.hstack([nodes, others]), total)
        gap = room - own.radius[line] + np.einsum("cd,cd->c", weights @ (places - acting), n)
        chains = isinstance(self.other, Target)
        patch = np.union1d(nodes, others) if chains else others

        def turning() -> Turning:
            return Turning(patch_of(weights, patch), beyond)

        crossings = Meeting(weights, gap, n, np.zeros(len(gap)), turning)
        met = self.ends(places, acting), self.others(places, acting)
        ways = own.curves[line, 1], edges.curves[edge, 1]
        beside = axis.simplices[line], edges.corners[edge]
        # Nodes beside an edge may lie on its faces, and touch too.
        for one, way, nodes, share, flat in zip(
            met, ways, beside, shares.T, (not chains, False), strict=True
        ):
            _pass_by(one, crossings, far, nodes, way, share, flat=flat)
        first = self.ends.count + self.others.count
        second = np.append(False, line[1:] == line[:-1])[: len(line)]
        rows = np.append(np.arange(first), first + _MOST * line + second)
        return _joined([*met, crossings], (1.0, -1.0, 1.0), rows, self.count)


def _pass_by(
    met: Meeting, crossings: Meeting, far: Floats, beside: Integers, way: Floats, share: Floats,
    *, flat: bool,
) -> None:  # fmt: skip
    """Open gaps of nodes beside crossings that stand for them.

    Args:
        met: Of the nodes.
        crossings: Where axes cross.
        far: Ways across both there [m], and sines of their angles, (crossings, 2).
        beside: Which of these gaps are at the ends of what crosses, -1: none, (crossings, 2).
        way: From the first to the second of these ends [m], (crossings, 3).
        share: Of it up to the crossing, (crossings,).
        flat: Whether nodes may touch what crosses beside the crossing too: then those that nearer
            places lie beside are passed.
    """
    at, end = np.nonzero(beside >= 0)
    node, (apart, sine) = beside[at, end], far[at].T
    length = np.linalg.norm(way[at], axis=1)
    out = (2 * end - 1)[:, None] * way[at] / length[:, None]  # from the crossing to the node
    passed = np.where(end, 1.0 - share[at], share[at]) * length * sine <= _SAME * apart
    if flat:
        passed |= np.einsum("nd,nd->n", met.normal[node], out) > _SAME
    else:
        leans = np.linalg.norm(np.cross(met.normal[node], crossings.normal[at]), axis=1) > _SAME
        passed |= (sine > _LEVEL) | (leans & (met.gap[node] > crossings.gap[at]))
    met.gap[node[passed]] = FAR


def _joined(met: Sequence[Meeting], sides: Sequence[float], rows: Integers, count: int) -> Meeting:
    """Several meetings as one whose gaps are some of so many, with forces on the sides that are 1.

    Args:
        met: The meetings.
        sides: 1 or -1 of each.
        rows: Places of all their gaps, in rising order, (rows,).
        count: Number of gaps; others are open.
    """
    signs = np.concatenate([np.full(len(m.gap), s) for m, s in zip(met, sides, strict=True)])
    gap, normal = np.full(count, FAR), np.zeros((count, 3))
    gap[rows], normal[:, 2] = np.concatenate([m.gap for m in met]), 1.0
    normal[rows] = signs[:, None] * np.concatenate([m.normal for m in met])

    def placed(each: Sequence[csr_matrix]) -> csr_matrix:
        whole = below(list(each), each[0].shape[1])
        filled = np.zeros(count + 1, dtype=whole.indptr.dtype)
        filled[rows + 1] = np.diff(whole.indptr)
        ends = np.cumsum(filled)
        return csr_matrix((whole.data, whole.indices, ends), (count, whole.shape[1]))

    weights = placed([m.weights for m in met])
    weights.data *= np.repeat(signs, np.diff(weights.indptr)[rows])

    def turning() -> Turning:
        turns = [_turning(m) for m in met]
        beyond = np.zeros_like(normal)
        beyond[rows] = signs[:, None] * np.concatenate([turn.beyond for turn in turns])
        return Turning(placed([turn.patch for turn in turns]), beyond)

    return Meeting(weights, gap, normal, np.zeros(count), turning)


def _turning(met: Meeting) -> Turning:
    """How directions turn, with all nodes that touch where that is not said."""
    if met.turning is not None:
        return met.turning()
    return Turning(patch_of(met.weights, met.weights.indices), np.zeros_like(met.normal))
