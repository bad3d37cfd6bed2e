"""A march backwards, with the gaps that pressed: derivatives of its numbers by all it was given.

In a layer from a to b, gap_b = g + C Lambda + D lambda_b with Lambda = (1 - theta) lambda_a +
theta lambda_b, the gaps that press are shut and the others have no force; theta is 1/2, or the root
of (`impactfem.contact.layer_law`)

    N = (1 - theta) lambda_a . gap_b - theta lambda_b . gap_a - (theta - 1/2) delta . D delta,

delta = lambda_b - lambda_a. These are as many equations as unknowns lambda_b and theta, J their
matrix: of a number with derivatives b by both, J^T (eta, zeta) = b are those by the equations, from
which its derivatives by gap_a, lambda_a and g follow.

A material that varies changes what K and M are multiplied with: the forces of a layer by dM a and
-dK u, whose derivatives are those by loads, and the equilibrium of massless nodes,
K_c du_c = -(dK u)_c, with u true; of N above it changes D.

What terms that relax remember follows the way of a layer by a linear recursion
(`impactfem.system.relaxation`), whose transpose goes back beside the layers. There displacements of
massless nodes count, too, with what presses them.
"""

import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.layer_law import uncoupled
from impactfem.marching.layers import Ends
from impactfem.marching.rows import Level
from impactfem.marching.solids import SolidMarch
from impactfem.system.relaxation import Relaxation

if TYPE_CHECKING:
    from impactfem.marching.layers import MaterialSums, Reversible

_WEAK = 1e-9  # share of the largest force, or gap, that is none
_FORGETFUL = Relaxation.of(())
_HALF = 1e-9  # within which theta is 1/2, as where the same gaps press at both ends
_IN_MEMORY = 2**28  # bytes of states; what is more goes to a file


class States:
    """Displacements and velocities of all levels, in memory or in a file.

    Args:
        levels: How many.
        size: Of each vector.
    """

    def __init__(self, levels: int, size: int) -> None:
        """Foresee their room."""
        self._size, self._file = size, None
        room = 16 * levels * size
        if room > _IN_MEMORY:
            self._file = tempfile.TemporaryFile()  # noqa: SIM115  (closed with its last reference)
        else:
            self._rows = np.empty((levels, 2, size))

    @staticmethod
    def fit(levels: int, size: int) -> bool:
        """Whether there is room for them."""
        room = 16 * levels * size
        return room <= _IN_MEMORY or room < shutil.disk_usage(tempfile.gettempdir()).free

    def put(self, level: int, place: Floats, velocity: Floats) -> None:
        """Keep a level."""
        if self._file is None:
            self._rows[level] = place, velocity
            return
        self._file.seek(16 * level * self._size)
        self._file.write(np.concatenate([place, velocity]).tobytes())

    def at(self, level: int) -> tuple[Floats, Floats]:
        """Those of a level, (size,) each."""
        if self._file is None:
            place, velocity = self._rows[level]
        else:
            self._file.seek(16 * level * self._size)
            both = np.frombuffer(self._file.read(16 * self._size))
            place, velocity = both[: self._size], both[self._size :]
        return place, velocity


@dataclass
class Trail:
    """What a march keeps for its way back; an observer.

    Attributes:
        march: The march.
        force: In the layer before each level [N], (levels, gaps).
        multiplier: At each level [N], (levels, gaps).
        gap: True gaps there [m], (levels, gaps).
        states: Of all levels, where the material varies.
    """

    march: SolidMarch
    force: Floats
    multiplier: Floats
    gap: Floats
    states: States | None = None

    @classmethod
    def of(cls, march: SolidMarch, *, whole: bool = False) -> "Trail":
        """An empty one.

        Args:
            march: The march.
            whole: Whether states are kept, as the material varies, if there is room for them.
        """
        levels = march.layers + 1
        size = cast("Reversible", march.interior).dofs
        states = States(levels, size) if whole and States.fit(levels, size) else None
        force, multiplier, gap = np.zeros((3, levels, len(march.contact.gap)))
        return cls(march, force, multiplier, gap, states)

    def __call__(self, level: Level) -> None:
        """Keep a level."""
        state = self.march.contact
        self.force[level.layer] = level.force
        self.multiplier[level.layer], self.gap[level.layer] = state.multiplier, state.gap

    def state(self, level: int) -> tuple[Floats, Floats]:
        """Displacements and velocities of a level, if all are kept."""
        if self.states is None:
            raise ValueError("no states are kept")
        return self.states.at(level)

    @property
    def weak(self) -> bool:
        """Whether a gap shuts or opens at a level, so that its sets are those of one side."""
        force, gap = self.multiplier[1:], self.gap[1:]
        little = _WEAK * np.abs(gap[np.isfinite(gap)]).max(initial=0.0)
        slight = (force > 0.0) & (force <= _WEAK * force.max(initial=0.0))
        return bool((slight | ((force == 0.0) & (gap <= little))).any())


@dataclass
class Reading:
    """Derivatives of a number by what a march has at a level, to which parts are added.

    Attributes:
        place, rate: As of `Backward`, (dofs,).
        contact: By the places of contact nodes without what presses them, (count, dim).
        static: By what presses them out of these, (count, dim).
        multiplier, gap: By these, (gaps,).
        force: By the force of the layer before, (gaps,).
        memory: By what bodies remember, as of `Backward`, (terms, dofs).
        early: By the energy of the half step that explicit layers begin with.
    """

    place: Floats
    rate: Floats
    contact: Floats
    static: Floats
    multiplier: Floats
    gap: Floats
    force: Floats
    memory: Floats
    early: float = 0.0

    @classmethod
    def at(
        cls, place: Floats, rate: Floats, nodes: Floats, multiplier: Floats, gap: Floats,
        memory: Floats,
    ) -> "Reading":  # fmt: skip
        """Of what later levels have told; of contact nodes by where they truly are."""
        force = np.zeros(len(gap))
        return cls(place, rate, nodes.copy(), nodes.copy(), multiplier, gap, force, memory)


class Given(NamedTuple):
    """Derivatives of a number by what a march was given.

    Attributes:
        place, rate: As of `Backward`, at t = 0, (dofs,).
        loads: By forces on owned dofs in each layer, (layers, dofs).
        gap: By what gaps are at each level without displacements, (levels, gaps).
    """

    place: Floats
    rate: Floats
    loads: Floats
    gap: Floats


def shares_of(interior: Any) -> Floats:
    """Shares of the stiffness with which bodies pull back what they remember, (terms, dofs)."""
    parts = getattr(interior, "parts", (interior,))
    relaxing = [getattr(part, "relaxation", _FORGETFUL) for part in parts]
    found = np.zeros((max(len(each.shares) for each in relaxing), interior.dofs))
    first = 0
    for part, each in zip(parts, relaxing, strict=True):
        found[: len(each.shares), first : first + part.dofs] = each.shares[:, None]
        first += part.dofs
    return found


class ReversedMarch:
    """A march that has ended, backwards (collective).

    Args:
        trail: What it has kept.
    """

    def __init__(self, trail: Trail) -> None:
        march = trail.march
        self._trail, self._march, self._gaps = trail, march, march.gaps
        self._interior, self._normals = cast("Reversible", march.interior), march.normals
        self._static = march.interior.static

    def given(
        self, last: int, read: Callable[[int, Reading], None],
        into: "Sequence[MaterialSums] | None" = None,
    ) -> Given:  # fmt: skip
        """Derivatives of a number.

        Args:
            last: Level after which nothing counts.
            read: Adds what the number reads at a level.
            into: Of each body, to which those by its material are added; None: it stays.
        """
        trail, interior = self._trail, self._interior
        size, count = interior.dofs, trail.gap.shape[1]
        nodes = np.zeros_like(self._march.interior.surface_displacement)
        memory = np.zeros_like(shares_of(interior))
        multipliers, gaps = np.zeros((2, last + 1, count))
        early, (place, rate) = 0.0, np.zeros((2, size))
        loads, skips = np.zeros((self._march.layers, size)), self._march.skips
        for layer in range(last - 1, -1, -1):
            level, begin = layer + 1, max(layer - 1, 0) if skips else layer
            found = Reading.at(place, rate, nodes, multipliers[level], gaps[level], memory)
            read(level, found)
            way, kept = self._recalled(found)
            early += found.early
            begun = self._begun(early, into) if layer == 0 and skips else 0.0
            rate += begun
            contact = found.contact + self._on_nodes(found.gap)
            back = interior.backward(place, rate, contact, first=layer == 0)
            if trail.multiplier[[begin, level]].any():
                acting = found.force + self._along(back.forces)
                shut, older, gap = self._contact(layer, begin, acting, found, into)
                rows = np.flatnonzero(shut)
                parts = self._march.answers.parts(rows, shut[rows, None] * self._normals[rows])
                more = interior.backward(
                    np.zeros(size),
                    np.zeros(size),
                    self._on_nodes(shut),
                    first=layer == 0,
                    parts=parts,
                )
                back = type(back)(*(one + two for one, two in zip(back, more, strict=True)))
                acting = found.force + self._along(back.forces)
                multipliers[begin] += older(acting)
                gaps[begin] += gap
                gaps[level] += shut
            if into is not None:
                self._vary(into, layer, back.loads, found)
            place, rate, loads[layer] = back.place - way, back.rate - begun, back.loads
            memory = kept + back.memory
            nodes = self._on_touching(place) if len(memory) else nodes
        found = Reading.at(place, rate, nodes, multipliers[0], gaps[0], memory)
        read(0, found)
        if into is not None:
            self._settle(into, 0, found)
        place = interior.settled(place, found.contact + self._on_nodes(gaps[0]))
        return Given(place, rate, loads, gaps)

    def _recalled(self, found: Reading) -> tuple[Floats, Floats]:
        """Follow what is remembered at the end of a layer; what moved there remembers.

        Returns:
            Derivatives by the way of the layer, (dofs,), which those by its end are given, and by
            what was remembered before it, (terms, dofs).
        """
        way, kept = np.zeros(len(found.place)), found.memory.copy()
        for part, own, _ in self._parts() if len(kept) else ():
            terms = part.relaxation
            each = slice(len(terms.shares)), own
            way[own], kept[each] = terms.after_by(kept[each], self._march.interior.dt)
        if len(kept):
            found.place += way
            moved = self._on_touching(way)
            found.contact += moved
            found.static += moved
        return way, kept

    def _on_touching(self, values: Floats) -> Floats:
        """Values of owned dofs on the contact nodes, (count, dim) (collective)."""
        each = [part.of_contact(values[own]) for part, own, _ in self._parts()]
        return np.concatenate(each)

    def _begun(self, weight: float, into: "Sequence[MaterialSums] | None") -> Floats:
        """Derivatives of the energy of the first half step by the rate that it ends with, (dofs,).

        Those by the rate that it begins with are the same with their sign turned.
        """
        found = np.zeros(self._interior.dofs)
        for k, (part, own, _) in enumerate(self._parts()):
            _, momentum = part.energies_by(np.zeros_like(part.begun), part.begun)
            found[own] = weight / self._march.interior.dt * momentum
            if into is not None:
                part.vary_product(into[k], 0.5 * weight * part.begun, part.begun)
        return found

    def _parts(self) -> Iterator[tuple[Any, slice, slice]]:
        """The interior of each body, its dofs and its contact nodes."""
        whole: Any = self._march.interior
        parts = getattr(whole, "parts", None)
        if parts is None:
            yield whole, slice(None), slice(None)
            return
        cuts = np.cumsum([0, *(len(part.velocity) for part in parts)]).tolist()
        for k, (part, ends) in enumerate(zip(parts, pairwise(cuts), strict=True)):
            yield part, slice(*ends), whole.own(k)

    def _vary(
        self, into: "Sequence[MaterialSums]", layer: int, loads: Floats, found: Reading
    ) -> None:
        """Add derivatives by the material that a layer and its end make."""
        before, after = (self._trail.state(each) for each in (layer, layer + 1))
        dt = self._march.interior.dt
        forces = self._on_nodes(self._trail.force[layer + 1])
        for to, (part, own, nodes) in zip(into, self._parts(), strict=True):
            ends = Ends(
                before[0][own], before[1][own], after[0][own], after[1][own], forces[nodes],
                layer * dt, (layer + 1) * dt,
            )  # fmt: skip
            part.vary(to, loads[own], ends)
        self._settle(into, layer + 1, found)

    def _settle(self, into: "Sequence[MaterialSums]", level: int, found: Reading) -> None:
        """Add those that the equilibrium of massless nodes at a level makes."""
        by_gap = self._on_nodes(found.gap)
        free, pressed = found.contact + by_gap, found.static + by_gap
        forces, place = self._on_nodes(self._trail.multiplier[level]), self._trail.state(level)[0]
        for to, (part, own, nodes) in zip(into, self._parts(), strict=True):
            moved = part.eased(found.place[own], free[nodes])
            held = part.eased(found.place[own], pressed[nodes])
            if moved is None and held is None:
                continue
            still = part.eased(0.0, forces[nodes])
            if moved is not None:
                to.stiff(-moved, place[own] if still is None else place[own] - still)
            if held is not None and still is not None:
                to.stiff(-held, still)

    def _on_nodes(self, forces: Floats) -> Floats:
        """Along the normals of gaps (gaps,), on the contact nodes (count, dim)."""
        return self._gaps.spread(forces[:, None] * self._normals)

    def _along(self, values: Floats) -> Floats:
        """Of the contact nodes (count, dim) what makes gaps, (gaps,)."""
        found: Floats = np.einsum("ij,ij->i", self._normals, self._gaps.relative(values))
        return found

    def _contact(
        self, layer: int, begin: int, acting: Floats, found: Reading,
        into: "Sequence[MaterialSums] | None",
    ) -> tuple[Floats, Callable[[Floats], Floats], Floats]:  # fmt: skip
        """What the law of a layer does backwards.

        Args:
            layer: Whose.
            begin: Level with which its end is paired.
            acting: Derivatives by its forces, (gaps,).
            found: By its end.
            into: See `given`.

        Returns:
            What the law adds to derivatives by the gaps of its end, (gaps,); how those by the
            multipliers of its begin follow from those by its forces; those by gaps of its begin.
        """
        trail, level = self._trail, layer + 1
        count = len(acting)
        shut, of_gap, keeps, direct = np.zeros((4, count))
        old, new = trail.multiplier[begin], trail.multiplier[level]
        pressed = self._along(self._static(self._on_nodes(found.gap) + found.static))
        rows = np.flatnonzero((old > 0.0) | (new > 0.0))
        response, static = self._march.answers.matrices(rows, self._normals[rows])
        response = response * (0.5 if self._march.skips and layer == 0 else 1.0)
        for own in uncoupled(response, static) or (np.arange(len(rows)),):
            at = rows[own]
            law = _Law(
                response[np.ix_(own, own)], static[np.ix_(own, own)], old[at], new[at],
                trail.gap[begin][at], trail.gap[level][at], trail.force[level][at],
            )  # fmt: skip
            closed, zeta = law.equations(
                acting[at], found.multiplier[at] + pressed[at], free=self._march.keeps_energy
            )
            theta = law.theta
            shut[at], of_gap[at] = closed - zeta * (1.0 - theta) * law.old, zeta * theta * law.new
            keeps[at] = 1.0 - theta
            direct[at] = -zeta * ((1.0 - theta) * law.gap + (2.0 * theta - 1.0) * law.strained)
            if into is not None and zeta * (theta - 0.5) != 0.0:
                change = np.zeros(count)
                change[at] = law.change
                forces = self._on_nodes(change)
                for to, (part, _, nodes) in zip(into, self._parts(), strict=True):
                    if (moved := part.eased(0.0, forces[nodes])) is not None:
                        to.stiff(-zeta * (theta - 0.5) * moved, moved)
        return shut, lambda by_force: keeps * by_force + direct, of_gap


@dataclass
class _Law:
    """The law of a layer for gaps that answer to each other; names as in the module's formulas.

    Attributes:
        response, static: C and D [m/N].
        old, new: lambda_a and lambda_b [N].
        old_gap, gap: gap_a and gap_b [m].
        force: Lambda [N].
    """

    response: Floats
    static: Floats
    old: Floats
    new: Floats
    old_gap: Floats
    gap: Floats
    force: Floats

    @property
    def change(self) -> Floats:
        """Delta."""
        return self.new - self.old

    @property
    def strained(self) -> Floats:
        """D delta."""
        return np.asarray(self.static @ self.change)

    @property
    def theta(self) -> float:
        """The weight that the layer had."""
        change = self.change
        square = float(change @ change)
        found = float((self.force - self.old) @ change) / square if square else 0.5
        return found if abs(found - 0.5) > _HALF else 0.5

    def equations(self, acting: Floats, multiplier: Floats, *, free: bool) -> tuple[Floats, float]:
        """Derivatives by shut gaps, with their sign turned (gaps,), and zeta.

        Args:
            acting: By Lambda.
            multiplier: By lambda_b besides.
            free: Whether theta may be less than 1/2.
        """
        theta, change = self.theta, self.change
        matrix = theta * self.response + self.static
        shut: Integers = np.flatnonzero(self.new > 0.0)
        right = (theta * acting + multiplier)[shut]
        own = matrix[np.ix_(shut, shut)]
        closed = np.zeros(len(self.new))
        same = np.array_equal(self.old > 0.0, self.new > 0.0)
        moved = self.response @ change
        by_theta = -float(self.old @ self.gap + self.new @ self.old_gap + change @ self.strained)
        by_theta += (1.0 - theta) * float(self.old @ moved)
        if same or by_theta == 0.0 or (not free and theta == 0.5):
            closed[shut] = -np.linalg.solve(own.T, right)
            return closed, 0.0
        by_new = (1.0 - theta) * (matrix @ self.old) - theta * self.old_gap
        by_new = by_new - (2.0 * theta - 1.0) * self.strained
        size = len(shut)
        both = np.empty((size + 1, size + 1))
        both[:size, :size], both[:size, size] = own, moved[shut]
        both[size, :size], both[size, size] = by_new[shut], by_theta
        # Of unlike units: each equation in its own.
        scale = np.append(np.full(size, np.abs(own).max(initial=0.0)), np.abs(by_theta))
        unit = np.append(np.ones(size), scale[0] / max(np.abs(moved).max(), 1e-300))
        scale[-1] = max(np.abs(both[size] * unit).max(), 1e-300)
        scaled = both * unit / scale[:, None]
        right = np.append(right, float(acting @ change)) * unit
        found = np.linalg.solve(scaled.T, right) / scale
        closed[shut] = -found[:size]
        return closed, float(found[size])
