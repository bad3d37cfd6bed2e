"""Loads along a beam by formulas, as forces on its coordinates.

A load p(t, x, u) [N/m] acts along a direction e, across the axis or along an axis of the scene, and
may go by the displacement u of the axis along it. Forces are those of the same virtual work, by
Gauss's rule in each element: F = sum_g w_g p(t, x_g, N_g q) N_g, N_g the displacement along e.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.breaks import Break
from impactfem.scene.formula import Formula
from impactfem.scene.means import StepMean, mean_of, stops_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.beam_parts import BeamParts

_GAUSS = np.polynomial.legendre.leggauss(4)  # in an element: exact of cubic deflections squared


@dataclass(frozen=True)
class BeamLoad:
    """The loads of a beam.

    Attributes:
        formulas: In t, x (from the first end) and u.
        places: X of Gauss's points [m], (points,).
        shapes: Displacements there along each load by the coordinates, (loads, points, d).
        weights: [m], (points,).
        pushes: Forces on ends in t and u, moments in t, and displacements or turns there, (d,).
    """

    formulas: tuple[Formula, ...]
    places: Floats
    shapes: Floats
    weights: Floats
    pushes: tuple[tuple[Formula, Floats], ...] = ()
    _known: dict[str, tuple[float, float, Floats]] = field(default_factory=dict, compare=False)

    @cached_property
    def _means(self) -> tuple[StepMean, ...]:
        """What finds means of `pushes` over a step whose state is iterated."""
        return tuple(StepMean(formula) for formula, _ in self.pushes)

    @classmethod
    def of(cls, parts: BeamParts) -> Self | None:
        """Those of a beam; None if it has none."""
        beam = parts.beam
        loads, pushes = beam.loads, beam.pushes
        if not (loads or pushes):
            return None
        nodes = parts.nodes
        halves, middles = 0.5 * np.diff(nodes), 0.5 * (nodes[1:] + nodes[:-1])
        places = (middles[:, None] + halves[:, None] * _GAUSS[0]).ravel()
        moved = np.array([parts.section(s)[: parts.beam.dim] for s in places])
        shapes = np.array([np.einsum("k,gkd->gd", along, moved) for along, _ in loads])
        shapes = shapes.reshape(len(loads), *moved.shape[::2])
        at_ends = [parts.section(s) for s in (nodes[0], nodes[-1])]
        ends = tuple((formula, at_ends[end][row]) for end, row, formula in pushes)
        weights = (halves[:, None] * _GAUSS[1]).ravel()
        found = tuple(formula for _, formula in loads)
        return cls(found, places - nodes[0], shapes, weights, ends)

    @property
    def is_dead(self) -> bool:
        """Whether they stay in time, and as the beam bends."""
        each = (*self.formulas, *(formula for formula, _ in self.pushes))
        return not any(formula.used & {"t", "u"} for formula in each)

    def mean(self, start: float, end: float, q: Floats, _: Floats | None = None) -> Floats:
        """Mean forces from one time to another at a deflection, (d,).

        Raises:
            KeyedError: A load has no finite value there.
        """
        found = np.zeros_like(q)
        for formula, shapes in zip(self.formulas, self.shapes, strict=True):
            bent = shapes @ q
            load = self._mean(formula, start, end, bent)
            if not np.isfinite(load).all():
                bad = np.flatnonzero(~np.isfinite(load))
                where = f"x = {self.places[bad[0]]:.6g} m, t = {start:.6g} s, u = "
                where += f"{bent[bad[0]]:.6g} m"
                text = f" = {show(formula.text)} has no finite value at {where}: give one that is "
                text += "finite wherever the beam may be, or an obstacle that stops it before"
                raise KeyedError("beam", "load", f"{text}.")
            found += (self.weights * load) @ shapes
        for (formula, moves), mean in zip(self.pushes, self._means, strict=True):
            push = mean(start, end, u=float(moves @ q))
            if not np.isfinite(push):
                text = f" = {show(formula.text)} has no finite value at t = {start:.6g} s, "
                text += f"u = {moves @ q:.6g} m: give one that is finite wherever the end may be."
                raise KeyedError("beam", "end_loads", text)
            found += push * moves
        return found

    def _mean(self, formula: Formula, start: float, end: float, bent: Floats) -> Floats:
        """[N/m], (points,); what does not follow the beam is found once for a step."""
        known = self._known.get(formula.text)
        if known is not None and "u" not in formula.used and known[:2] == (start, end):
            return known[2]
        with np.errstate(all="ignore"):
            if end > start:
                load = mean_of(formula, start, end, x=self.places, u=bent)
            else:
                at: dict[str, Any] = {"t": start, "x": self.places, "u": bent}
                load = formula.of_arrays(at)
        load = np.asarray(np.broadcast_to(load, bent.shape))
        self._known[formula.text] = start, end, load
        return load

    def stops(self, end: float) -> list[Break]:
        """Where they change in time, up to an end [s]."""
        middle = float(self.places[len(self.places) // 2])
        along = [formula.fixed(x=middle, u=0.0) for formula in self.formulas]
        each = (*along, *(formula.fixed(u=0.0) for formula, _ in self.pushes))
        return [s for formula in each for s in stops_of(formula, end)]


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
        return self.load.stops(end)

    @property
    def tangent(self) -> tuple[Floats, Floats]:
        """Stiffness and damping (d, d) of what steps are solved with; the load is iterated."""
        return self.stiffness, self.damping
