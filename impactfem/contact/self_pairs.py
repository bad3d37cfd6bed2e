"""Which faces of one body may meet each other, and which of two that do carries the multipliers.

Faces that are close in the undeformed body meet in no contact: neighbours along the outside, and
those behind each other across a thin wall, whose distance would read as a penetration. Of a pair
of faces each looks at the other, but a gap must count once. So the faces that see others are
joined into patches along the outside; of two patches that see each other one carries, and goes on
to carry while they do.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.spatial import KDTree

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.boundary import Boundary

_STEPS = 3  # along the outside, from face to face by common nodes: nearer ones do not meet
_ASLANT = (1.0, 0.618, 0.382)  # what two patches are told apart by at first: no plane of symmetry
_WALL = 3.0  # mean widths of two faces up to which one behind the other is of the same wall


@dataclass(frozen=True)
class WithinBody:
    """The faces of a body that may meet other faces of it.

    Attributes:
        beside: Whether two faces share a node, (faces, faces).
        near: Faces within `_STEPS` of each other along the outside: first times the number of faces
            plus second, increasing.
        order: Places of the faces along a direction, (faces,).
        centres: Of the undeformed faces [m], (faces, dim).
        normals: Outward normals of these, (faces, dim).
        widths: Of these [m], (faces,).
        sides: Faces of both sides among those of the outside, (faces of a side,) each.
    """

    beside: csr_array
    near: Integers
    order: Integers
    centres: Floats
    normals: Floats
    widths: Floats
    sides: tuple[Integers, Integers]

    @classmethod
    def of(cls, outside: Boundary, sides: Iterable[Booleans]) -> "WithinBody":
        """Look at the undeformed outside of a body.

        Args:
            outside: The outside.
            sides: Which of its faces are on each side, (faces,) each.
        """
        count, several = outside.faces.shape
        ones = np.ones(outside.faces.size, dtype=np.int64)
        at = np.repeat(np.arange(count), several), outside.faces.ravel()
        touches = csr_array(coo_array((ones, at), shape=(count, len(outside.numbers))))
        beside = csr_array(touches @ touches.T)
        close = beside
        for _ in range(_STEPS - 1):
            close = csr_array(close @ beside)
            close.data[:] = 1
        rows, columns = close.nonzero()
        x = outside.points[outside.faces]
        centres = x.mean(axis=1)
        order = np.empty(count, dtype=np.int64)
        order[np.argsort(centres @ _ASLANT[: centres.shape[1]], kind="stable")] = np.arange(count)
        one, two = (np.flatnonzero(side) for side in sides)
        return cls(
            beside, np.sort(rows * count + columns), order, centres, outside.normals,
            np.linalg.norm(np.ptp(x, axis=1), axis=1), (one, two),
        )  # fmt: skip

    def roles(self) -> Integers:
        """Roles before any contact; see `meeting`."""
        return np.zeros(len(self.order), dtype=np.int64)

    def meeting(self, pairs: Integers, roles: Integers) -> Integers:
        """Those of some pairs of faces of both sides that may meet, once each, (pairs, 2).

        Args:
            pairs: Faces of both sides that see each other, (pairs, 2).
            roles: Of all faces, changed: 1 where it carried last, -1 where the other did.
        """
        f, g = (side[column] for side, column in zip(self.sides, pairs.T, strict=True))
        kept = self._may(f, g)
        if np.array_equal(*self.sides):
            kept[kept] = self._carries(f[kept], g[kept], roles)
        found: Integers = pairs[kept]
        return found

    def close(self, middles: Floats, widths: Floats) -> Integers:
        """Faces that others which they may meet have come close to, (faces,).

        Args:
            middles: Where the faces are [m], (all faces, dim).
            widths: Of the faces [m], (all faces,).
        """
        near = KDTree(middles).query_ball_point(middles, 2.0 * widths)
        f = np.repeat(np.arange(len(middles)), list(map(len, near)))
        g = np.concatenate([np.zeros(0, dtype=np.int64), *near]).astype(np.int64)
        met = self._may(f, g) | self._may(g, f)
        return np.unique(np.concatenate([f[met], g[met]]))

    def _may(self, f: Integers, g: Integers) -> Booleans:
        """Whether faces are far enough from others in the undeformed body to meet them."""
        keys = f * len(self.order) + g
        at = np.searchsorted(self.near, keys)
        apart = self.near[np.minimum(at, len(self.near) - 1)] != keys
        way = self.centres[g] - self.centres[f]
        behind = np.einsum("pd,pd->p", way, self.normals[f]) < 0.0
        close = np.linalg.norm(way, axis=1) < 0.5 * _WALL * (self.widths[f] + self.widths[g])
        return np.asarray(apart & ~(behind & close))

    def _carries(self, f: Integers, g: Integers, roles: Integers) -> Booleans:
        """Whether the first of two faces that see each other carries, (pairs,)."""
        seen = np.unique(np.concatenate([f, g]))
        patches, patch = connected_components(self.beside[seen][:, seen], directed=False)
        one, two = (patch[np.searchsorted(seen, side)] for side in (f, g))
        links = csr_array(coo_array((np.ones(len(one)), (one, two)), shape=(patches, patches)))
        groups, group = connected_components(links, directed=False)
        side = np.ones(patches, dtype=np.int64)  # -1 at odd steps from the first of a group
        for root in np.unique(group, return_index=True)[1]:
            reached, before = breadth_first_order(links, root, directed=False)
            for entry in reached[1:]:
                side[entry] = -side[before[entry]]
        last = np.bincount(group[patch], side[patch] * roles[seen], groups)
        below = np.bincount(group[one], side[one] * np.sign(self.order[g] - self.order[f]), groups)
        leads = np.where(np.where(last == 0.0, below, last) < 0.0, -1, 1)
        # A patch that sees itself: as its faces did, at first by their places.
        alike = side[one] == side[two]
        earlier, places = roles[f] - roles[g], self.order[f] - self.order[g]
        by_face = np.where(earlier == 0, places < 0, earlier > 0)
        carries = np.where(alike, by_face, side[one] == leads[group[one]])
        roles[f[carries]], roles[g[carries]] = 1, -1
        return carries
