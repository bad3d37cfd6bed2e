"""An elastic beam at its place at t = 0, free or held, in the plane or in space, for the march.

A section at s of the axis c + (s + a) t + w n + v b, with the height along n = b x t and the width
along b, turns by the vector f t - r_v n + r_w b: a and the twist f are P1, (w, r_w) and (v, r_v)
those of `beam_matrices` for bending in the height and in the width, which do not know of each other
in a rectangle that is symmetric to both. In the plane there are a, w and r_w only. Ends that are
held take coordinates away, springs at ends add to the stiffness.

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

from impactfem.scene.beam_supports import ENDS
from impactfem.scene.beams import Beam
from impactfem.system.beam_matrices import BeamMatrices, beam_matrices

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_TERMS = np.arange(1, 40, 2)  # of the series for torsion: 1e-7 of it
_FIBRES = 12  # across the height and the width


def torsion_constant(height: float, width: float) -> float:
    """J of a rectangle [m^4]."""
    short, long = sorted((height, width))
    series = float((np.tanh(_TERMS * math.pi * long / (2.0 * short)) / _TERMS**5).sum())
    return long * short**3 * (1.0 / 3.0 - 64.0 * short / (math.pi**5 * long) * series)


@dataclass(frozen=True)
class BeamParts:
    """A discretised beam; coordinates are (a, w, r_w), then (v, r_v), then the twists.

    Attributes:
        beam: The beam.
        bending: Mass and stiffness with bending in the height, and in space in the width.
        mass, stiffness: Of the coordinates that are not held, (d, d).
        kept: These, among all.
        rigid_modes: All coordinates of unit motions along the axes of the scene, and turns about
            the centre: (all, 3), in space (all, 6).
        whole: Mass of all coordinates, (all, all).
    """

    beam: Beam
    bending: tuple[BeamMatrices, ...]
    mass: Floats
    stiffness: Floats
    kept: Integers
    rigid_modes: Floats
    whole: Floats

    @property
    def nodes(self) -> Floats:
        """S of the nodes [m]."""
        return self.bending[0].nodes

    @cached_property
    def _sections(self) -> tuple[Floats, ...]:
        """Sections at the nodes by the coordinates, (nodes, 6, d)."""
        return tuple(self.section(s) for s in self.nodes.tolist())

    def section(self, s: float) -> Floats:
        """Displacement and turn in space of the section at s by the coordinates, (6, d)."""
        frame, dim = self.beam.frame, self.beam.dim
        found = np.zeros((6, len(self.whole)))
        first = 0
        for k, matrices in enumerate(self.bending):
            rows = matrices.section(s)
            taken = _own(matrices, k)
            own = first + np.arange(len(taken))
            rows = rows[:, taken]
            if k == 0:
                found[:dim, own] += np.outer(frame[0], rows[0])
            found[:dim, own] += np.outer(frame[1 + k], rows[1])
            # Slopes in the height turn about the width, and slopes in the width against the height.
            axis = frame[2] if dim == 3 and k == 0 else -frame[1]
            found[3:, own] += np.outer(axis if dim == 3 else [0.0, 0.0, 1.0], rows[2])
            first += len(own)
        if dim == 3:
            found[3:, first:] = np.outer(frame[0], _linear(self.nodes, s))
        return found[:, self.kept]

    @cached_property
    def jacobian(self) -> Floats:
        """Of the places of the nodes, (nodes dim, d)."""
        return np.concatenate([rows[: self.beam.dim] for rows in self._sections])

    def places(self, q: Floats) -> Floats:
        """Of the nodes [m], (nodes, dim)."""
        start = np.asarray(self.beam.center) + np.outer(self.nodes, self.beam.frame[0])
        return np.asarray(start + (self.jacobian @ q).reshape(start.shape))

    @cached_property
    def momenta(self) -> Floats:
        """Momentum along the axes and about the centre by rates, (d, 3), in space (d, 6)."""
        return np.asarray((self.whole @ self.rigid_modes)[self.kept])

    @property
    def inertia(self) -> Floats:
        """About the centre [kg m^2], (1, 1) or (3, 3)."""
        dim = self.beam.dim
        return np.asarray((self.rigid_modes.T @ self.whole @ self.rigid_modes)[dim:, dim:])

    @property
    def velocity(self) -> Floats:
        """Rates at t = 0, rigid but where ends are held, (d,)."""
        return np.asarray((self.rigid_modes @ self.beam.rates)[self.kept])

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
            turns = np.array([rows[3:] @ q for rows in self._sections])
            return float(np.linalg.norm(turns, axis=1).max())
        turn = np.linalg.solve(self.inertia, self.momenta[:, self.beam.dim :].T @ q)
        return float(turn[0]) if len(turn) == 1 else float(np.linalg.norm(turn))

    def fibres(self, q: Floats) -> tuple[Floats, Floats]:
        """Strains of fibres along it, by the means of each element, and their volumes [m].

        A fibre at y along the height and z along the width has a' - y r_w' - z r_v'.
        """
        values = np.zeros(len(self.whole))
        values[self.kept] = q
        h, first = np.diff(self.nodes), 0
        across = np.linspace(-0.5, 0.5, _FIBRES)
        strain = np.zeros((len(h), _FIBRES, _FIBRES if self.beam.in_space else 1))
        for k, matrices in enumerate(self.bending):
            own, taken = np.zeros(len(matrices.mass)), _own(matrices, k)
            own[taken] = values[first : first + len(taken)]
            first += len(taken)
            at = 3 * np.arange(len(self.nodes))
            if k == 0:
                strain += (np.diff(own[at]) / h)[:, None, None]
            bend = (np.diff(own[at + 2]) / h)[:, None, None]
            size = (self.beam.height, self.beam.width)[k]
            strain = strain - size * bend * (across[:, None] if k == 0 else across)
        each = strain[0].size
        return strain.reshape(-1), np.repeat(h / each, each)

    @property
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
        moved = (self.jacobian @ q).reshape(len(self.nodes), -1)
        across = moved @ self.beam.frame[1:].T
        longer = 0.5 * float((np.diff(across, axis=0) ** 2 / np.diff(self.nodes)[:, None]).sum())
        straight = np.sum((across[-1] - across[0]) ** 2) / (2.0 * self.beam.length)
        return 0.5 * hold * (longer - float(straight)) ** 2


def beam_parts(beam: Beam) -> BeamParts:
    """Discretise a beam by its theory, number of elements and supports."""
    bending = [beam_matrices(beam)]
    if beam.in_space:
        bending.append(beam_matrices(_on_its_side(beam)))
    nodes = bending[0].nodes
    blocks = [
        tuple(part[np.ix_(own, own)] for part in (matrices.mass, matrices.stiffness))
        for k, matrices in enumerate(bending)
        for own in [_own(matrices, k)]
    ]
    if beam.in_space:
        blocks.append(_torsion(beam, nodes))
    mass, stiffness = (np.asarray(block_diag(*(block[i] for block in blocks))) for i in range(2))
    starts = np.cumsum([0, *(len(block[0]) for block in blocks)])
    kept = np.ones(len(mass), dtype=bool)
    for support in beam.supports:
        node = (len(nodes) - 1) * (support.end == ENDS[1])
        moves = [3 * node, 3 * node + 1]
        turns = [3 * node + 2]
        twists = []
        if beam.in_space:
            moves.append(starts[1] + 2 * node)
            turns.append(starts[1] + 2 * node + 1)
            twists.append(starts[2] + node)
        stays, keeps = support.holds
        kept[moves + twists] &= not stays
        kept[turns] &= not keeps
        stiffness[moves, moves] += support.stiffness
        stiffness[turns + twists, turns + twists] += support.rotational_stiffness
    own = np.flatnonzero(kept)
    return BeamParts(
        beam, tuple(bending), mass[np.ix_(own, own)], stiffness[np.ix_(own, own)], own,
        _rigid_modes(beam, bending, len(mass)), mass,
    )  # fmt: skip


def _on_its_side(beam: Beam) -> Beam:
    """The same with height and width exchanged."""
    return replace(beam, height=beam.width, width=beam.height)


def _own(matrices: BeamMatrices, k: int) -> Integers:
    """Which coordinates of `BeamMatrices` are taken: axial ones of the first only."""
    taken = np.ones(len(matrices.mass), dtype=bool)
    taken[: 3 * len(matrices.nodes) : 3] = k == 0
    return np.flatnonzero(taken)


def _linear(nodes: Floats, s: float) -> Floats:
    """Values at s of the piecewise linear functions of the nodes, (nodes,)."""
    return np.array([np.interp(s, nodes, unit) for unit in np.eye(len(nodes))])


def _torsion(beam: Beam, nodes: Floats) -> tuple[Floats, Floats]:
    """Mass and stiffness of the twists, P1: rho I_p and G J."""
    h, count = beam.length / beam.elements, len(nodes)
    height, width = beam.height, beam.width
    shear = 0.5 * beam.youngs_modulus / (1.0 + beam.poisson_ratio)
    polar = beam.density * height * width * (height**2 + width**2) / 12.0
    mass, stiffness = np.zeros((count, count)), np.zeros((count, count))
    for k in range(beam.elements):
        own = slice(k, k + 2)
        mass[own, own] += polar * h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        stiff = shear * torsion_constant(height, width) / h
        stiffness[own, own] += stiff * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return mass, stiffness


def _rigid_modes(beam: Beam, bending: Sequence[BeamMatrices], size: int) -> Floats:
    """See `BeamParts.rigid_modes`: a turn e moves the place s of the axis by s e x t."""
    dim, frame = beam.dim, beam.frame
    found = np.zeros((size, 3 * (dim - 1)))
    nodes, first = bending[0].nodes, 0
    turns = np.eye(3) if dim == 3 else np.array([[0.0, 0.0, 1.0]])
    axes = frame if dim == 3 else np.array([[*frame[0], 0.0], [*frame[1], 0.0], [0.0, 0.0, 1.0]])
    for k, matrices in enumerate(bending):
        modes = np.zeros((len(matrices.mass), 3 * (dim - 1)))
        if k == 0:
            modes[3 * np.arange(len(nodes)), :dim] = frame[0]
        modes[matrices.deflections, :dim] = frame[1 + k]
        # Slope in the height: e . b; in the width: -e . n.
        slope = turns @ (axes[2] if k == 0 else -axes[1])
        modes[matrices.deflections, dim:] = np.outer(matrices.places, slope)
        modes[matrices.rotations, dim:] = slope
        own = _own(matrices, k)
        found[first : first + len(own)] = modes[own]
        first += len(own)
    if dim == 3:
        found[first:, dim:] = turns @ frame[0]
    return found
