"""An elastic beam at its place at t = 0, free or held, in the plane or in space, for the march.

A section at s of the axis c + (s + a) t + w n + v b, with the height along n = b x t and the width
along b, turns by the vector f t - r_v n + r_w b: a and the twist f are P1, (w, r_w) and (v, r_v)
those of `beam_matrices` for bending in the height and in the width, which do not know of each other
in a rectangle that is symmetric to both. In the plane there are a, w and r_w only. Ends that are
held take coordinates away, springs at ends add to the stiffness; axial coordinates of the second
bending go too.

Saint-Venant's torsion constant of a rectangle: S. Timoshenko, J. N. Goodier, Theory of elasticity
(1970), section 109.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from impactfem.arrays import Floats, Integers
from impactfem.scene.beam_supports import ENDS
from impactfem.scene.beams import Beam
from impactfem.system.beam_matrices import BeamMatrices, beam_matrices, linear_elements

_TERMS = np.arange(1, 40, 2)  # of the series for torsion: 1e-7 of it
_FIBRES = (40, 12)  # across the height and the width


def torsion_constant(height: float, width: float) -> float:
    """J of a rectangle [m^4]."""
    short, long = sorted((height, width))
    series = float((np.tanh(_TERMS * math.pi * long / (2.0 * short)) / _TERMS**5).sum())
    return long * short**3 * (1.0 / 3.0 - 64.0 * short / (math.pi**5 * long) * series)


@dataclass(frozen=True)
class BeamParts:
    """A discretised beam; coordinates are those of both bendings, then the twists.

    Attributes:
        beam: The beam.
        bending: Mass and stiffness with bending in the height, and in space in the width.
        starts: First coordinate of each bending, and of the twists.
        mass, stiffness: Of the coordinates that are not held, (d, d).
        kept: These, among all.
        rigid_modes: Unit motions along the axes of the scene, and turns about the centre, (d, 3),
            in space (d, 6).
        momenta: Momentum along the axes and about the centre by rates, alike.
        inertia: About the centre [kg m^2], (1, 1) or (3, 3).
    """

    beam: Beam
    bending: tuple[BeamMatrices, ...]
    starts: Integers
    mass: Floats
    stiffness: Floats
    kept: Integers
    rigid_modes: Floats
    momenta: Floats
    inertia: Floats

    @property
    def nodes(self) -> Floats:
        """S of the nodes [m]."""
        return self.bending[0].nodes

    def section(self, s: float) -> Floats:
        """Displacement and turn in space of the section at s by the coordinates, (6, d)."""
        frame, dim = self.beam.frame, self.beam.dim
        found = np.zeros((6, self.starts[-1]))
        turns = _axes_of_slopes(self.beam)
        for k, matrices in enumerate(self.bending):
            own = slice(self.starts[k], self.starts[k + 1])
            along, across, slope = matrices.section(s)
            found[:dim, own] = np.outer(frame[0], along) + np.outer(frame[1 + k], across)
            found[3:, own] = np.outer(turns[k], slope)
        if self.beam.in_space:  # twists are P1, as axial displacements
            twist = self.bending[0].section(s)[0, : 3 * len(self.nodes) : 3]
            found[3:, self.starts[-2] :] = np.outer(frame[0], twist)
        return found[:, self.kept]

    @cached_property
    def jacobian(self) -> Floats:
        """Of the places of the nodes, (nodes dim, d)."""
        count, dim, frame = len(self.nodes), self.beam.dim, self.beam.frame
        found = np.zeros((count, dim, self.starts[-1]))
        at = np.arange(count)
        found[at, :, 3 * at] = frame[0]
        for k in range(len(self.bending)):
            found[at, :, self.starts[k] + 3 * at + 1] = frame[1 + k]
        return found.reshape(count * dim, -1)[:, self.kept]

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Which nodes meet obstacles: not where it is held, (nodes,)."""
        count = len(self.nodes)
        found = np.full(count, self.beam.touches_along)
        found[[0, -1]] = True
        found &= np.abs(self.jacobian).reshape(count, -1).max(axis=1) > 0.0
        for support in self.beam.moved_ends:
            found[self._node(support.end)] = False
        return found

    def _node(self, end: str) -> int:
        return (len(self.nodes) - 1) * ENDS.index(end)

    def _nodal(self, q: Floats) -> Floats:
        """Axial displacement, deflection and slope of the nodes in each bending, (k, nodes, 3)."""
        values, size = self._spread(q), 3 * len(self.nodes)
        firsts = self.starts[: len(self.bending)]
        return np.array([values[first : first + size].reshape(-1, 3) for first in firsts])

    def _spread(self, q: Floats) -> Floats:
        """All coordinates, 0 where they are held."""
        found = np.zeros(self.starts[-1])
        found[self.kept] = q
        return found

    def places(self, q: Floats) -> Floats:
        """Of the nodes [m], (nodes, dim)."""
        moved, frame = self._nodal(q), self.beam.frame
        along = (self.nodes + moved[0, :, 0])[:, None] * frame[0]
        return np.asarray(np.asarray(self.beam.center) + along + moved[:, :, 1].T @ frame[1:])

    @property
    def velocity(self) -> Floats:
        """Rates at t = 0, rigid but where ends are held or moved, (d,)."""
        found, frame = self._spread(self.rigid_modes @ self.beam.rates), self.beam.frame
        for (end, speed), support in zip(self.beam.end_speeds(), self.beam.moved_ends, strict=True):
            node = self._node(end)
            firsts = self.starts[: len(self.bending)] + 3 * node
            found[[3 * node, *(firsts + 1)]] = frame @ speed
            if support.holds[1]:
                found[[*(firsts + 2), *(self.starts[len(self.bending) : -1] + node)]] = 0.0
        return found[self.kept]

    @property
    def damping(self) -> Floats:
        """C = alpha M + beta K, (d, d)."""
        alpha, beta = self.beam.rayleigh_damping
        return alpha * self.mass + beta * self.stiffness

    def elastic(self, q: Floats) -> float:
        """Energy of it and its springs [J]."""
        return 0.5 * float(q @ (self.stiffness @ q))

    def turned(self, q: Floats) -> float:
        """How far it turns [rad]: its rigid part; where ends are held, its steepest section.

        Signed in the plane if it is free.
        """
        if self.beam.supports:
            turns = [*self._nodal(q)[:, :, 2]]
            if self.beam.in_space:
                turns.append(self._spread(q)[self.starts[-2] :])
            return float(np.linalg.norm(turns, axis=0).max())
        turn = np.linalg.solve(self.inertia, self.momenta[:, self.beam.dim :].T @ q)
        return float(turn[0]) if len(turn) == 1 else float(np.linalg.norm(turn))

    def fibres(self, q: Floats) -> tuple[Floats, Floats]:
        """Strains of fibres along it, by the means of each element, and their volumes [m].

        A fibre at y along the height and z along the width has a' - y r_w' - z r_v'.
        """
        values, strain = self._spread(q), np.zeros(())
        for k, (matrices, size, count) in enumerate(
            zip(self.bending, (self.beam.height, self.beam.width), _FIBRES, strict=False)
        ):
            stretch, bend = matrices.strains(values[self.starts[k] : self.starts[k + 1]])
            across = size * np.linspace(-0.5, 0.5, count)
            # Of the second bending no stretch is kept.
            fibres = stretch[:, None] - bend[:, None] * across
            strain = fibres if k == 0 else strain[:, :, None] + fibres[:, None, :]
        each = strain[0].size
        return strain.reshape(-1), np.repeat(np.diff(self.nodes) / each, each)

    @cached_property
    def axial_hold(self) -> float:
        """Stiffness against ends that come nearer to each other [N/m]; 0 if one is free."""
        held = {s.end: np.inf if s.holds[0] else s.stiffness for s in self.beam.supports}
        ends = [held.get(end, 0.0) for end in ENDS]
        if not all(ends):
            return 0.0
        own = self.beam.youngs_modulus * self.beam.area / self.beam.length
        return 1.0 / (1.0 / own + sum(1.0 / end for end in ends))

    def stretching(self, q: Floats) -> float:
        """Energy of an axis that had to become longer to deflect so, which is left out [J]."""
        if not (hold := self.axial_hold):
            return 0.0
        across = self._nodal(q)[:, :, 1]
        longer = 0.5 * float((np.diff(across) ** 2 / np.diff(self.nodes)).sum())
        straight = ((across[:, -1] - across[:, 0]) ** 2).sum() / (2.0 * self.beam.length)
        return 0.5 * hold * (longer - float(straight)) ** 2


def beam_parts(beam: Beam) -> BeamParts:
    """Discretise a beam by its theory, number of elements and supports."""
    bending = [beam_matrices(beam)]
    if beam.in_space:
        bending.append(beam_matrices(_on_its_side(beam)))
    count = len(bending[0].nodes)
    blocks = [(matrices.mass, matrices.stiffness) for matrices in bending]
    if beam.in_space:
        blocks.append(_torsion(beam, count))
    mass, stiffness = (np.asarray(block_diag(*each)) for each in zip(*blocks, strict=True))
    starts = np.cumsum([0, *(len(own) for own, _ in blocks)])
    kept = np.ones(len(mass), dtype=bool)
    for first in starts[1 : len(bending)]:
        kept[first : first + 3 * count : 3] = False
    for support in beam.supports:
        node = (count - 1) * (support.end == ENDS[1])
        firsts = starts[: len(bending)] + 3 * node
        moves, turns = np.array([3 * node, *(firsts + 1)]), firsts + 2
        twists = starts[len(bending) : -1] + node
        stays, keeps = support.fixes
        kept[[*moves, *twists]] &= not stays
        kept[turns] &= not keeps
        stiffness[moves, moves] += support.stiffness
        held = np.array([*turns, *twists])
        stiffness[held, held] += support.rotational_stiffness
    own = np.flatnonzero(kept)
    modes = _rigid_modes(beam, bending, starts)
    momenta = mass @ modes
    return BeamParts(
        beam, tuple(bending), starts, mass[np.ix_(own, own)], stiffness[np.ix_(own, own)], own,
        modes[own], momenta[own], (modes.T @ momenta)[beam.dim :, beam.dim :],
    )  # fmt: skip


def _on_its_side(beam: Beam) -> Beam:
    """The same with height and width exchanged."""
    return replace(beam, height=beam.width, width=beam.height)


def _axes_of_slopes(beam: Beam) -> Floats:
    """About what slopes in the height and in the width turn: b, and -n; (2, 3) or (1, 3)."""
    if not beam.in_space:
        return np.array([[0.0, 0.0, 1.0]])
    _, high, wide = beam.frame
    return np.array([wide, -high])


def _torsion(beam: Beam, count: int) -> tuple[Floats, Floats]:
    """Mass and stiffness of the twists, P1: rho I_p and G J."""
    height, width = beam.height, beam.width
    shear = 0.5 * beam.youngs_modulus / (1.0 + beam.poisson_ratio)
    polar = beam.density * height * width * (height**2 + width**2) / 12.0
    return linear_elements(beam, polar, shear * torsion_constant(height, width), count)


def _rigid_modes(beam: Beam, bending: Sequence[BeamMatrices], starts: Integers) -> Floats:
    """Of all coordinates; see `BeamParts`: a turn e moves the place s of the axis by s e x t."""
    dim, frame = beam.dim, beam.frame
    found = np.zeros((starts[-1], 3 * (dim - 1)))
    found[3 * np.arange(len(bending[0].nodes)), :dim] = frame[0]
    turns = 2 * dim - 3  # about z alone in the plane
    for k, (matrices, axis) in enumerate(zip(bending, _axes_of_slopes(beam), strict=True)):
        slope = axis[-turns:]
        deflections = starts[k] + matrices.deflections
        found[deflections, :dim] = frame[1 + k]
        found[deflections, dim:] = np.outer(matrices.places, slope)
        found[starts[k] + matrices.rotations, dim:] = slope
    if beam.in_space:
        found[starts[-2] :, dim:] = frame[0]
    return found
