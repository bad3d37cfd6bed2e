"""A load along a beam by formula, as forces on its coordinates.

The load p(t, x, u) [N/m] acts across the axis, positive towards its normal n (the axis turned by 90
degrees), and may go by the deflection u there. Forces are those of the same virtual work, by
Gauss's rule in each element: F = sum_g w_g p(t, x_g, N_g q) N_g.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.scene.beams import Beam
from impactfem.scene.breaks import Break
from impactfem.scene.formula import Formula
from impactfem.scene.means import mean_of, stops_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.beam_matrices import BeamMatrices

_GAUSS = np.polynomial.legendre.leggauss(4)  # in an element: exact of cubic deflections squared


@dataclass(frozen=True)
class BeamLoad:
    """The load of a beam.

    Attributes:
        formula: In t, x (from the first end) and u.
        places: X of Gauss's points [m], (points,).
        shapes: Deflections there by the coordinates, (points, d).
        weights: [m], (points,).
    """

    formula: Formula
    places: Floats
    shapes: Floats
    weights: Floats

    @classmethod
    def of(cls, beam: Beam, matrices: BeamMatrices, kept: NDArray[np.int64]) -> Self | None:
        """That of a beam with these coordinates among all; None if it has none."""
        if beam.load is None:
            return None
        nodes = matrices.nodes
        halves, middles = 0.5 * np.diff(nodes), 0.5 * (nodes[1:] + nodes[:-1])
        places = (middles[:, None] + halves[:, None] * _GAUSS[0]).ravel()
        shapes = np.array([matrices.section(s)[1, kept] for s in places])
        weights = (halves[:, None] * _GAUSS[1]).ravel()
        return cls(beam.load, places - nodes[0], shapes, weights)

    @property
    def is_dead(self) -> bool:
        """Whether it stays in time, and as the beam bends."""
        return not self.formula.used & {"t", "u"}

    def mean(self, start: float, end: float, q: Floats, _: Floats | None = None) -> Floats:
        """Mean forces from one time to another at a deflection, (d,).

        Raises:
            KeyedError: The load has no finite value there.
        """
        bent = self.shapes @ q
        load = self._mean(start, end, bent)
        if not np.isfinite(load).all():
            bad = np.flatnonzero(~np.isfinite(load))
            where = f"x = {self.places[bad[0]]:.6g} m, t = {start:.6g} s, u = {bent[bad[0]]:.6g} m"
            text = f" = {show(self.formula.text)} has no finite value at {where}: give one that is "
            text += "finite wherever the beam may be, or an obstacle that stops it before"
            raise KeyedError("beam", "load", f"{text}.")
        return np.asarray((self.weights * load) @ self.shapes)

    def _mean(self, start: float, end: float, bent: Floats) -> Floats:
        """[N/m], (points,)."""
        with np.errstate(all="ignore"):
            if end > start:
                load = mean_of(self.formula, start, end, x=self.places, u=bent)
            else:
                known: dict[str, Any] = {"t": start, "x": self.places, "u": bent}
                load = self.formula.of_arrays(known)
        return load if np.shape(load) == bent.shape else np.broadcast_to(load, bent.shape)


@dataclass(frozen=True)
class BeamForces:
    """All forces on a beam with a load: those of the load, of its stiffness, and what is steady.

    Attributes:
        load: That by formula.
        stiffness, damping: Of the beam, (d, d).
        steady: (d,).
    """

    load: BeamLoad
    stiffness: Floats
    damping: Floats
    steady: Floats

    def __call__(self, t: float, q: Floats, v: Floats) -> Floats:
        """Those at a time, (d,)."""
        return self.mean(t, t, q, v)

    def mean(self, start: float, end: float, q: Floats, v: Floats) -> Floats:
        """Their means from one time to another, (d,)."""
        return self.steady - self.stiffness @ q - self.damping @ v + self.load.mean(start, end, q)

    def stops(self, end: float) -> list[Break]:
        """Where they change, up to an end [s]."""
        middle = float(self.load.places[len(self.load.places) // 2])
        return stops_of(self.load.formula.fixed(x=middle, u=0.0), end)

    @property
    def tangent(self) -> tuple[Floats, Floats]:
        """Stiffness and damping (d, d) of what steps are solved with; the load is iterated."""
        return self.stiffness, self.damping
