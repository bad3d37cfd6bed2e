"""Rows of joints that act along lines which stay, on bodies whose answers do, as ties of solids.

With R the ways of rows by those of stations, A the answers of stations in a layer, and g what rows
would be at its end, impulses L obey

    a (g + S L) + b L + c = 0,    S = dt / 2 R A R^T,

whose matrix a S + b is factored once for all layers of one length.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from impactfem.arrays import Floats
from impactfem.system.joints import Joints

_REFINED = 2  # solutions, of which the last takes off what rounding has left of the first


class SteadyRows:
    """Rows with a factor that is kept as long as all it is made of stays."""

    def __init__(
        self, joints: Joints, gradient: Floats, span: float, flats: Sequence[Floats]
    ) -> None:
        """Take what stays.

        Args:
            joints: What holds bodies.
            gradient: Of the terms, (terms, 2, 6).
            span: Of the layer [s].
            flats: How stations of each body answer to impulses in it, (6 own, 6 own).
        """
        terms, count = joints.terms, joints.count
        ways = np.zeros((count, len(joints.names), 6))
        weighed = gradient * terms.shares[:, None, None]
        for side in range(2):
            np.add.at(ways, (terms.rows, terms.bodies[:, side]), weighed[:, side])
        self._ways, self.span, self.flats = ways.reshape(count, -1), span, tuple(flats)
        first = 6 * joints.ground.count
        self.moved = np.zeros((count, count))
        for flat in flats:
            own = self._ways[:, first : first + len(flat)]
            self.moved += own @ flat @ own.T
            first += len(flat)
        self.moved *= 0.5 * span
        self._laws, self._factor = np.zeros((0, 2)), (self.moved, np.zeros(0))

    def stays(self, span: float, flats: Sequence[Floats]) -> bool:
        """Whether it is of this layer too."""
        alike = zip(self.flats, flats, strict=True)
        return span == self.span and all(np.shares_memory(*both) for both in alike)

    def rates(self, speeds: Floats) -> Floats:
        """Of the rows by velocities and spins of all stations in space, (stations, 6)."""
        return np.asarray(self._ways @ speeds.ravel())

    def solve(self, free: Floats, laws: Floats) -> Floats:
        """Impulses of the rows, (rows,).

        Args:
            free: Rows at the end of the layer without them, less what is wanted, (rows,).
            laws: a, b, c of the rows, (rows, 3).

        Raises:
            LinAlgError: Some rows follow from others.
        """
        if not np.array_equal(laws[:, :2], self._laws):
            matrix = laws[:, :1] * self.moved + np.diag(laws[:, 1])
            size = np.sqrt(np.abs(np.diag(self.moved)))
            self._scale = 1.0 / np.where(size > 0.0, size, 1.0)
            self._matrix = matrix
            self._factor = lu_factor(self._scale[:, None] * matrix * self._scale)
            pivots = np.abs(np.diag(self._factor[0]))
            if pivots.min(initial=np.inf) <= _SINGULAR * pivots.max(initial=0.0):
                raise np.linalg.LinAlgError
            self._laws = laws[:, :2].copy()
        given, found = laws[:, 0] * free + laws[:, 2], np.zeros(len(free))
        for _ in range(_REFINED):
            left = given + self._matrix @ found
            found = found - self._scale * lu_solve(self._factor, self._scale * left)
        return found


_SINGULAR = 1e-13  # least pivot by the largest from which rows are taken to be independent
