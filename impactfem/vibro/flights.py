"""Exact flights of linear systems, free or along closed constraints, as Taylor series.

The state z = (u, v, 1, t, cos w_k t, sin w_k t) obeys z' = A z, where loads and motions of walls
are read off the last entries. With the constraints S closed, lambda = -W^-1 (G_S a - b_S'') is
linear in z, with W = G_S M^-1 G_S^T and the acceleration a without contact.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_solve
from scipy.linalg.lapack import dgebal

from impactfem.arrays import Floats, Integers
from impactfem.errors import SceneError
from impactfem.scene.signal import Signal
from impactfem.system.generalized import LinearSystem, factor_mass
from impactfem.vibro.event_choice import Onset
from impactfem.vibro.event_constrained import constrained

TERMS = 21
"""Terms of the series: with |A| h <= 1 the first one left out is 1/21! = 2e-20."""

_DOUBT = 1e-13  # share of what a coefficient adds up to that counts as its rounding


@dataclass(frozen=True)
class Flight:
    """Polynomials of one substep with given closed constraints.

    Attributes:
        step: Length h of a substep [s].
        powers: T_k = (A h)^k / k!, shape (TERMS, n, n); fewer where A is nilpotent.
        whole: First rows of their sum, shape (2d, n).
        gaps: Rows of the gaps times T_k, shape (TERMS, J, n).
        forces: Rows of the contact forces times T_k, shape (TERMS, S, n).
        gap_doubts: Rows of the rounding of the coefficients of the gaps, for |z|, (TERMS, J, n).
        force_doubts: The same of the contact forces, shape (TERMS, S, n).
        doubt: Their sum over the terms: rounding of the forces in the whole substep, (S, n).
        closed: Closed constraints, shape (S,).
    """

    step: float
    powers: Floats
    whole: Floats
    gaps: Floats
    forces: Floats
    gap_doubts: Floats
    force_doubts: Floats
    doubt: Floats
    closed: Integers

    def onset(self, z: Floats) -> Onset:
        """How gaps and contact forces begin from a state z (n,) in which S is closed."""
        size = np.abs(z)
        return Onset(
            self.gaps[2:] @ z, self.gap_doubts[2:] @ size, self.forces @ z, self.force_doubts @ size
        )


@dataclass
class Flights:
    """The flights of a linear system whose loads and motions are exact signals.

    Args:
        system: `LinearSystem` with ``is_exact``.
        longest: Longest substep [s], for motions that are polynomials in time.
    """

    system: LinearSystem
    longest: float
    _kept: dict[tuple[int, ...], Flight] = field(default_factory=dict)

    def __post_init__(self) -> None:
        system = self.system
        if not system.is_exact:
            raise SceneError("exact flights: a load or a motion is no sum of known functions")
        d = system.dofs
        self.dofs = d
        self.factor = factor_mass(system, np.zeros(d))
        signals = (*system.load, *system.motion)
        self.waves: Floats = np.array(sorted({w for one in signals for w, _, _ in one.harmonics}))
        self.size = 2 * d + 2 + 2 * len(self.waves)
        loads = np.array([self.row(one) for one in system.load])
        inner = np.zeros((d, self.size))
        inner[:, :d], inner[:, d : 2 * d] = -system.stiffness, -system.damping
        self._applied: Floats = inner + loads
        self._acceleration: Floats = cho_solve((self.factor, True), self._applied)
        self._inverse: Floats = np.abs(cho_solve((self.factor, True), np.eye(d)))
        self.answers: Floats = cho_solve((self.factor, True), system.normals.T)
        self.response: Floats = np.einsum("ji,ij->j", system.normals, self.answers)
        matrix = np.zeros((self.size, self.size))
        matrix[:d, d : 2 * d] = np.eye(d)
        matrix[2 * d + 1, 2 * d] = 1.0
        for k, w in enumerate(self.waves):
            i = 2 * d + 2 + 2 * k
            matrix[i, i + 1], matrix[i + 1, i] = -w, w
        self._frame = matrix
        self.gap_rows: Floats = -np.array([self.row(one) for one in system.motion])
        self.gap_rows[:, :d] += system.normals
        self.gap_rows[:, 2 * d] += system.offsets
        self.rate_rows: Floats = self.gap_rows @ matrix  # v stands in the rows of u of any A

    def row(self, signal: Signal) -> Floats:
        """Row r with r . z = the signal, shape (n,)."""
        values = np.zeros(self.size)
        d = self.dofs
        values[2 * d], values[2 * d + 1] = signal.constant, signal.slope
        for w, a, b in signal.harmonics:
            i = 2 * d + 2 + 2 * int(np.searchsorted(self.waves, w))
            values[i : i + 2] = a, b
        return values

    def flight(self, closed: tuple[int, ...]) -> Flight:
        """The flight along linearly independent closed constraints."""
        if closed not in self._kept:
            self._kept[closed] = self._build(closed)
        return self._kept[closed]

    def _build(self, closed: tuple[int, ...]) -> Flight:
        system, d, rows = self.system, self.dofs, list(closed)
        matrix = self._frame.copy()
        matrix[d : 2 * d] = self._acceleration
        force = force_size = np.zeros((len(rows), self.size))
        # What is added up where accelerations are: K u of a body that is not strained cancels.
        size = np.abs(matrix)
        size[d : 2 * d] = self._inverse @ np.abs(self._applied)
        if rows:
            normals, mass = system.normals[rows], system.mass(np.zeros(d))
            matrix[d : 2 * d] = 0.0
            rest = self.rate_rows[rows] @ matrix  # -b''
            matrix[d : 2 * d], force = constrained(mass, normals, self._applied, rest)
            answers = self.answers[:, rows]
            sizes = np.abs(normals) @ size[d : 2 * d] + np.abs(rest)
            force_size = np.abs(np.linalg.inv(normals @ answers)) @ sizes
            size[d : 2 * d] += np.abs(answers) @ force_size
        step = substep(matrix, self.longest)
        powers = np.empty((TERMS, self.size, self.size))
        powers[0] = np.eye(self.size)
        for k in range(1, TERMS):
            powers[k] = powers[k - 1] @ (matrix * (step / k))
        used = max(5, 1 + int(np.flatnonzero(np.abs(powers).any(axis=(1, 2)))[-1]))
        powers = powers[:used].copy()  # free fall needs three terms
        force_doubts = _doubts(force_size, matrix, np.abs(matrix), step, used)
        return Flight(
            step,
            powers,
            np.ascontiguousarray(powers[::-1].sum(axis=0)[: 2 * d]),
            np.ascontiguousarray(np.einsum("ji,kim->kjm", self.gap_rows, powers)),
            np.ascontiguousarray(np.einsum("ji,kim->kjm", force, powers)),
            _doubts(np.abs(self.gap_rows), matrix, size, step, used),
            force_doubts,
            force_doubts.sum(axis=0),
            np.array(rows, dtype=np.int64),
        )


def _doubts(rows: Floats, matrix: Floats, size: Floats, step: float, terms: int) -> Floats:
    """Rounding of rows times T_k, for |z|: what is added up in them, shape (terms, rows, n).

    Args:
        rows: What is added up in the rows (rows, n).
        matrix: A (n, n).
        size: What is added up in A z, which may cancel in A (n, n).
        step: h [s].
        terms: Number of k.
    """
    found = np.empty((terms, *rows.shape))
    left = found[0] = _DOUBT * rows
    for k in range(1, terms):
        found[k] = left @ (size * (step / k))
        left = left @ (np.abs(matrix) * (step / k))
    return found


def substep(matrix: Floats, longest: float) -> float:
    """Substep h with |A^k|^(1/k) h <= 1 for the first powers that the series leaves out [s].

    The norm is that of the balanced matrix, which does not depend on units. Nilpotent motions,
    such as free fall, have no limit but ``longest``.
    """
    balanced = dgebal(matrix, scale=True, permute=False)[0]
    size = float(np.abs(balanced).sum(axis=0).max())
    if size == 0.0:
        return longest
    power = np.linalg.matrix_power(balanced / size, TERMS)
    growth = 0.0
    for k in (TERMS, TERMS + 1):
        norm = float(np.abs(power).sum(axis=0).max())
        growth = max(growth, size * norm ** (1.0 / k))
        power = power @ (balanced / size)
    return min(longest, 1.0 / growth) if growth > 0.0 else longest
