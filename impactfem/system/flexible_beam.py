"""Elastic beams that turn far, as the march takes them: nodes with mass, and elements between them.

Masses are those of a rule of the fourth order over the nodes (Gregory's end weights 3/8, 7/6,
23/24), which has the mass, centre and moment of inertia of the beam; each node has the rotary
inertia of its share of sections. Nodes are not in the least lumped by that: with nodes whose
answers to forces are exact, frequencies have errors of the fourth order too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.scene.beam_supports import ENDS
from impactfem.scene.beams import Beam
from impactfem.system.beam_kernels import foreseen, looked, standing
from impactfem.system.beam_load import BeamLoad
from impactfem.system.beam_parts import torsion_constant
from impactfem.system.few import FewBodies
from impactfem.system.rigid import in_space
from impactfem.system.stations import Asked, Stations

_OF_BENDING = 5.0  # modes up to about the second are followed like a vibration
_FIBRES = 9  # across each side of a section, where strains are looked at
type Frames = tuple[Floats, Floats]
"""Displacements of the nodes (nodes, 3) and their frames (nodes, 3, 3)."""

_GREGORY = np.array([-5.0 / 8.0, 1.0 / 6.0, -1.0 / 24.0])


def end_weights(count: int) -> Floats:
    """Weights of nodes at equal distances for integrals over a line, by their distance, (count,).

    Exact for cubic polynomials from three nodes on.
    """
    found = np.ones(count)
    if count == 2:
        return 0.5 * found
    for k, more in enumerate(_GREGORY[:count]):
        found[k] += more
        found[-1 - k] += more
    return found


@dataclass(frozen=True, kw_only=True)
class FlexibleBeam(FewBodies):
    """A beam under large rotations.

    Its state are displacements of its nodes and their frames, columns along the axis, the height
    and the width; rates are velocities in space and spins along these columns.

    Attributes:
        beam: It.
        elements: Of its elements, which springs that hold turns of ends come after, chord over h,
            h, stiffness against stretch and shears, and against twist and bending, bows, strains
            without stresses, (elements, 19); see `impactfem.system.beam_kernels`.
        sides: First and last node of each element; node -1 stays as it was, (elements, 2).
        node_mass: [kg], (nodes,).
        inertia: Of the nodes along their columns [kg m^2], (nodes, 3).
        moves: Which of displacements and turns of the nodes are free, (nodes, 6).
        springs: Stiffness against displacement of the nodes [N/m], (nodes,).
        turns: Frames at t = 0, (nodes, 3, 3).
        loads: Along it; None without any.
        ahead: Spins at t = 0 along the columns [rad/s], (nodes, 3), and velocities (nodes, 3).
    """

    beam: Beam
    elements: Floats
    sides: Integers
    node_mass: Floats
    inertia: Floats
    moves: Booleans
    springs: Floats
    turns: Floats
    loads: BeamLoad | None
    ahead: tuple[Floats, Floats]

    @property
    def nodes(self) -> int:
        """How many there are."""
        return len(self.node_mass)

    @cached_property
    def start(self) -> Floats:
        """Places of the nodes at t = 0 in space [m], (nodes, 3)."""
        found = np.zeros((self.nodes, 3))
        found[:, : self.dim] = self.places(self.position)
        return found

    def looked(self, at: Frames) -> tuple[Floats, Floats, float]:
        """Invariants of the elements, their strains, and the energy with that of springs [J].

        Strains are how much longer the axis is, shears, twist and curvatures, (elements, 6).
        """
        states = np.empty((len(self.elements), 8))
        found, energy = looked(self.elements, self.sides, *at, self.turns, states)
        return states, found, energy + 0.5 * float(self.springs @ (at[0] ** 2).sum(axis=1))

    def standing(self, at: Frames, stresses: Floats | None = None) -> tuple[Floats, Floats]:
        """Forces of strains and springs at a place that stays (nodes, 6), and the stiffness.

        That is by displacements and small turns in space, (nodes, 6, nodes, 6), with stresses of
        the elements (elements, 6) if they are foreseen.
        """
        count, own = self.nodes, np.zeros((len(self.elements), 0))
        force, stiffness = np.empty((count, 6)), np.zeros((count, 6, count, 6))
        args = self.elements, self.sides, self.springs, *at, self.turns
        standing(*args, own if stresses is None else stresses, force, stiffness)
        return force, stiffness

    def foreseen(self, at: Frames, change: Floats) -> Floats:
        """Stresses of the elements at a place and by a small change (nodes, 6) there."""
        found = np.empty((len(self.elements), 6))
        foreseen(self.elements, self.sides, *at, self.turns, change, found)
        return found

    def fibres(self, at: Frames) -> tuple[Floats, Floats]:
        """Strains of fibres along it by the means of each element, and their lengths [m]."""
        count = self.nodes - 1
        found, h = self.looked(at)[1][:count], self.elements[:count, 3]
        stretch, bend = found[:, 0], found[:, 4:]
        high = self.beam.height * np.linspace(-0.5, 0.5, _FIBRES)
        wide = self.beam.width * np.linspace(-0.5, 0.5, _FIBRES if self.beam.in_space else 1)
        # Columns are t, n, b = t x n: a turn about b shortens what is at +n, one about n
        # lengthens what is at +b.
        strain = stretch[:, None, None] - bend[:, 1, None, None] * high[:, None]
        strain = strain + bend[:, 0, None, None] * wide
        each = strain[0].size
        return strain.reshape(-1), np.repeat(h / each, each)

    @cached_property
    def about_centre(self) -> Floats:
        """Moment of inertia about the centre at t = 0 [kg m^2], (1, 1) or (3, 3)."""
        arms = self.start - in_space(self.centers[0])
        second = (self.node_mass * arms.T) @ arms
        own = np.einsum("nik,nk,njk->ij", self.turns, self.inertia, self.turns)
        found = np.asarray(np.trace(second) * np.eye(3) - second + own)
        return found if self.dim == 3 else found[2:, 2:]

    def turned(self, at: Frames) -> float:
        """Largest turn of a section from its place at t = 0 [rad], up to pi."""
        trace = np.einsum("nij,nij->n", at[1], self.turns)
        return float(np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0)).max())

    def steepest(self, at: Frames) -> float:
        """Largest turn between the nodes of an element [rad]."""
        u = np.clip(self.looked(at)[0][: self.nodes - 1, 6], 0.0, 1.0)
        return 2.0 * float(np.arcsin(np.sqrt(u)).max())

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """Sections at nodes, which carry places up to half an element away as rigid arms do.

        Rows are of velocities and spins in space of what is free of the nodes.
        """
        of: list[int] = []
        keys: list[tuple[int, tuple[float, ...]]] = []
        for _, wanted, _ in asked:
            node = int(np.linalg.norm(self.start - wanted, axis=1).argmin())
            if (curve := self.beam.curve) is not None:
                arm = in_space(curve.nearest(wanted[: self.dim])[0]) - self.start[node]
            else:
                along = in_space(self.beam.along)
                arm = float((wanted - self.start[node]) @ along) * along
            if np.linalg.norm(arm) <= 1e-9 * self.beam.length:
                arm = np.zeros(3)
            key = node, tuple(arm.tolist())
            if key not in keys:
                keys.append(key)
            of.append(keys.index(key))
        rows, places = np.zeros((len(keys), 6, self.nodes, 6)), []
        for k, (node, held) in enumerate(keys):
            rows[k, :, node] = carried(np.array(held))
            places.append(self.start[node] + np.array(held))
        rows = rows.reshape(len(keys), 6, -1)[..., self.moves.ravel()]
        spins = np.einsum("nij,nj->ni", self.turns, self.ahead[1])
        rates = self.freely(np.hstack([self.ahead[0], spins]))
        answers = np.linalg.solve(self.mass, rows.reshape(-1, rows.shape[-1]).T)
        names = (self.names[0],) * len(keys)
        return Stations.along(tuple(of), names, np.array(places), rows, answers, rates)

    def freely(self, values: Floats) -> Floats:
        """Values of the nodes (..., nodes, 6) at what is free, (..., d)."""
        return np.asarray(values[..., self.moves])

    def spread(self, values: Floats) -> Floats:
        """Values of what is free (d,) at the nodes, (nodes, 6), 0 of what is held."""
        found = np.zeros((self.nodes, 6))
        found[self.moves] = values
        return found

    @cached_property
    def mass(self) -> Floats:
        """Of what is free, turns in space, at t = 0, (d, d)."""
        whole = np.zeros((self.nodes, 6, self.nodes, 6))
        each = zip(self.turns, self.node_mass, self.inertia, strict=True)
        for k, (frame, own, spun) in enumerate(each):
            whole[k, :3, k, :3] = own * np.eye(3)
            whole[k, 3:, k, 3:] = (frame * spun) @ frame.T
        free = np.flatnonzero(self.moves.ravel())
        return whole.reshape(6 * self.nodes, -1)[np.ix_(free, free)]


def carried(arm: Floats) -> Floats:
    """Velocity and spin at an arm (3,) by those where it begins, (6, 6)."""
    found = np.eye(6)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[j, 3 + k], found[k, 3 + j] = -arm[i], arm[i]
    return found


def flexible_beam(beam: Beam) -> FlexibleBeam:
    """Discretise a beam of finite strain by its theory, number of elements and supports."""
    count, dim = beam.elements + 1, beam.dim
    s = np.linspace(-0.5 * beam.length, 0.5 * beam.length, count)
    h, weights = beam.length / beam.elements, end_weights(count)
    start, turns = beam.node_places, beam.node_frames
    sections = beam.density * h * weights
    high, wide = beam.second_moment, beam.height * beam.width**3 / 12.0
    moves, springs = _free(beam)
    elements, sides = _elements(beam, h, (wide, high), start, turns)
    mass = beam.area * sections
    centre = np.asarray(beam.center) if beam.curve is None else mass @ start / mass.sum()
    ahead = _ahead(beam, start - centre, turns, moves)
    ends = np.zeros(count, dtype=bool)
    ends[[0, -1]] = True
    still = [(count - 1) * ENDS.index(support.end) for support in beam.jointed_ends]
    touching = (ends | beam.touches_along) & moves[:, :3].any(axis=1)
    touching[still] = False
    held = "held" if beam.supports else "free"
    return FlexibleBeam(
        names=(beam.name,),
        masses=(beam.mass,),
        centers=np.array([centre], dtype=np.float64),
        speeds=(mass @ ahead[0][:, :dim])[None] / beam.mass,
        inertias=(0.0,),  # sums tell how it turns
        angles=(beam.inclination,),
        position=np.zeros(6 * count),
        velocity=np.zeros(6 * count),
        places=lambda q: np.asarray(start + q.reshape(count, 6)[:, :dim]),
        radius=np.full(count, 0.5 * beam.height),
        shell=np.zeros(count),
        touching=touching,
        body=np.zeros(count, dtype=np.int64),
        lines=np.stack([np.arange(count - 1), np.arange(1, count)], axis=1),
        ends={},
        rate=lambda: _OF_BENDING * beam.first_frequency,
        words=f"a {held} beam of {beam.elements} elements that turns far",
        beam=beam,
        elements=elements,
        sides=sides,
        node_mass=mass,
        # About the axis, the height and the width.
        inertia=sections[:, None] * np.array([high + wide, wide, high]),
        moves=moves,
        springs=springs,
        turns=turns,
        loads=_loads(beam, s, h * weights),
        ahead=ahead,
    )


def _free(beam: Beam) -> tuple[Booleans, Floats]:
    """Which displacements and turns of its nodes are free (nodes, 6), and springs there [N/m]."""
    count, dim = beam.elements + 1, beam.dim
    moves, springs = np.zeros((count, 6), dtype=bool), np.zeros(count)
    moves[:, :dim] = True
    moves[:, 3 if dim == 3 else 5 :] = True  # in the plane the turn about z alone
    for support in beam.supports:
        node = (count - 1) * ENDS.index(support.end)
        springs[node] = support.stiffness
        if support not in beam.jointed_ends:
            stays, keeps = support.holds
            moves[node, :3] &= not stays
            moves[node, 3:] &= not keeps
    return moves, springs


def _elements(
    beam: Beam, h: float, moments: tuple[float, float], start: Floats, turns: Floats
) -> tuple[Floats, Integers]:
    """Its elements, then springs that hold turns of its ends, and their nodes.

    Args:
        beam: It.
        h: Length of an element [m].
        moments: Of area about the height and the width [m^4].
        start: Nodes at t = 0 [m], (nodes, dim).
        turns: Their frames, (nodes, 3, 3).
    """
    modulus, last = beam.youngs_modulus, beam.elements
    shear = 0.5 * modulus / (1.0 + beam.poisson_ratio)
    twist = shear * torsion_constant(beam.height, beam.width)
    stiff, bows = _shears(beam, h)
    bent = modulus * np.array(moments)
    own = np.concatenate([in_space(beam.along), [h], stiff, [twist], bent, bows, np.zeros(6)])
    rows, sides = np.tile(own, (last, 1)), [(k, k + 1) for k in range(last)]
    if beam.curve is not None:
        rows[:, : beam.dim] = np.diff(start, axis=0) / h
        states, still = np.empty((last, 8)), np.zeros((len(start), 3))
        unstrained, _ = looked(rows, np.array(sides), still, turns, turns, states)
        rows[:, 13:16], rows[:, 16:] = unstrained[:, :3], h * unstrained[:, 3:]
    for support in beam.supports:
        if support.rotational_stiffness:
            held = np.zeros(len(own))
            held[3], held[7:10] = 1.0, support.rotational_stiffness
            rows = np.vstack([rows, held])
            sides.append((-1, last * ENDS.index(support.end)))
    return rows, np.array(sides)


def _ahead(beam: Beam, away: Floats, turns: Floats, moves: Booleans) -> tuple[Floats, Floats]:
    """Velocities of its nodes at t = 0, and spins along their axes, (nodes, 3) each.

    Nodes are so far away from its centre, (nodes, dim), with these frames.
    """
    dim, spin = beam.dim, np.zeros(3)
    spin[6 - 2 * dim :] = beam.rates[dim:]
    arms = np.zeros((len(away), 3))
    arms[:, :dim] = away
    speed = in_space(beam.rates[:dim]) + np.cross(spin, arms)
    spins = np.einsum("i,nij->nj", spin, turns)
    for (end, moving), support in zip(beam.end_speeds(), beam.moved_ends, strict=True):
        node = beam.elements * ENDS.index(end)
        speed[node, :dim] = moving
        spins[node] *= not support.holds[1]
    spins[~moves[:, 3:].any(axis=1)] = 0.0
    return speed * moves[:, :3], spins


def _shears(beam: Beam, h: float) -> tuple[Floats, Floats]:
    """Stiffness of an element against stretch, and shear along the height and the width [N].

    Besides, what of these its bow is by; see `impactfem.system.beam_kernels`.
    """
    modulus = beam.youngs_modulus
    soft = 0.0 if beam.theory == "euler_bernoulli" else 1.0 / beam.shear_stiffness
    of_bending = h * h / (modulus * beam.area * np.array([beam.height, beam.width]) ** 2)
    share = of_bending / (soft + of_bending)
    stiff = np.array([modulus * beam.area, *(1.0 / (soft + of_bending))])
    return stiff, np.array([0.0, *(share**2 / 10.0)])


def _loads(beam: Beam, s: Floats, weights: Floats) -> BeamLoad | None:
    """Loads on the nodes, as forces on displacements and moments on turns, (6 nodes,)."""
    loads, pushes = beam.loads, beam.pushes
    if not (loads or pushes):
        return None
    count = len(s)
    nodes, each = np.arange(count), np.eye(6 * count).reshape(count, 6, -1)
    shapes = np.zeros((len(loads), count, 6 * count))
    for own, (along, _) in zip(shapes, loads, strict=True):
        across = np.broadcast_to(along, (count, beam.dim))
        own[:] = np.einsum("nk,nkd->nd", across, each[nodes, : beam.dim])
    ends = tuple((formula, each[(count - 1) * end, row]) for end, row, formula in pushes)
    return BeamLoad(tuple(formula for _, formula in loads), s - s[0], shapes, weights, ends)
