"""Maxwell terms of bodies under finite strain: what they remember at points and in cells.

Each term follows Green's strain E with its own, and r is their difference as in
`impactfem.system.relaxation`; it adds g C : r to the second Piola and Kirchhoff stress, with C that
of small strains, so that it turns with the body. A step has r amid it,

    r_m = (r_a + (E_b - E_a) / 2) / (1 + k),   r_b = ((1 - k) r_a + E_b - E_a) / (1 + k),

k = dt / (2 tau), whose work is the change of g r : C : r / 2 and g dt / tau r_m : C : r_m >= 0, to
rounding. Nearly incompressible bodies have the same of the mean dilatation of each cell.
Source: J. C. Simo, T. J. R. Hughes, Computational Inelasticity (Springer, 1998), chapter 10.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.fem import dolfinx_fem
from impactfem.system.element_tables import tabulated
from impactfem.system.materials import constants_of, relaxing_of
from impactfem.system.nodes import Nodes
from impactfem.system.point_kernels import strain_change

if TYPE_CHECKING:
    from impactfem.system.located import Located

REMEMBERED = ("rxx", "ryy", "rzz", "rxy", "ryz", "rzx")


Recalled = Callable[[], Mapping[str, float]]
"""Tells by name what this rank knows of terms at a place, between steps: the sum is of all."""


class TermPlaces:
    """The same of bodies of small strains whose materials creep each in its own way, to be shown.

    Attributes:
        terms: UFL coefficients g of each and functions r.
        values: r of the owned dofs, (terms, dofs).
    """

    def __init__(self, nodes: Nodes, solid: Any) -> None:
        """Begin at rest (collective); see `PointMemory`."""
        shares, made = relaxing_of(nodes, solid)[1], constants_of(nodes, solid)
        self.terms = [(made(share), dolfinx_fem.Function(nodes.space)) for share in shares]
        self.values = np.zeros((len(shares), 0))
        self._nodes, self._shares = nodes, shares

    def follow(self, places: Sequence["Located"]) -> list[Recalled]:
        """What tells the stress by which terms exceed the elastic one at places (collective)."""
        return [self._recalled(here) for here in places]

    def _recalled(self, here: "Located") -> Recalled:
        nodes, owned = self._nodes, self._nodes.owned
        own = np.zeros(len(self._shares)) if here.cell is None else self._shares[:, here.cell]
        shares = nodes.comm.allreduce(own)
        _, places, mine = np.intersect1d(nodes.numbers[:owned], here.numbers, return_indices=True)

        def told() -> dict[str, float]:
            over = np.tensordot(shares, self.values, axes=1).reshape(-1, nodes.dim)[places]
            return {name: float((part[mine] * over).sum()) for name, part in here.stress.items()}

        return told

    def refresh(self) -> None:
        """Set the functions (collective)."""
        for (_, kept), values in zip(self.terms, self.values, strict=True):
            kept.x.array[: len(values)] = values
            kept.x.scatter_forward()


@dataclass
class Watched:
    """A place that is followed besides.

    Attributes:
        here: Its cell, and the slopes there.
        kept: r of each term, (terms, n).
    """

    here: "Located"
    kept: Floats


class PointMemory:
    """The terms of a body, one for each time of relaxation.

    Attributes:
        times: Of relaxation [s], (terms,).
        shares: UFL coefficients g of each.
        cells: g of the owned cells, (terms, cells).
        kept: Functions of points: r at the start of the step, xx, yy, zz, xy, yz, zx or the first
            four, one for each.
        weights: Constants 1 / (1 + k), one for each; 0 before the first step.
        excess: Of the mean dilatation of the owned cells, (terms, cells).
    """

    def __init__(self, nodes: Nodes, solid: Any, degree: int) -> None:
        """Begin at rest (collective).

        Args:
            nodes: Nodes of the body.
            solid: `impactfem.scene.solids.Solid` with Maxwell terms.
            degree: Of the quadrature of the forms.
        """
        mesh, count, made = nodes.space.mesh, 6 if nodes.dim == 3 else 4, constants_of(nodes, solid)
        self._comm, self._dim = nodes.comm, nodes.dim
        self._cells, self._table, self._hoop, _ = tabulated(nodes, solid, degree)
        owned = len(self._cells)
        self._numbers = np.asarray(mesh.topology.original_cell_index[:owned], dtype=np.int64)
        self._total = mesh.topology.index_map(mesh.topology.dim).size_global
        self.times, shares = relaxing_of(nodes, solid)
        self.cells = shares[:, :owned]
        self.shares = [made(share) for share in shares]
        space = fem.point_space(mesh, degree, (count,))
        self.kept = [dolfinx_fem.Function(space) for _ in self.times]
        self.weights = [dolfinx_fem.Constant(mesh, 0.0) for _ in self.times]
        places = space.dofmap.list[:owned]
        self._places, self._shape = places.ravel(), (*places.shape, count)
        self.excess = np.zeros((len(self.times), owned))
        self._watched: list[Watched] = []
        self._steps = np.full(len(self.times), np.inf)

    def forget(self) -> None:
        """Begin anew, at rest."""
        for kept, weight in zip(self.kept, self.weights, strict=True):
            kept.x.array[:] = weight.value = 0.0
        for place in self._watched:
            place.kept = np.zeros_like(place.kept)
        self.excess = np.zeros_like(self.excess)
        self._steps = np.full(len(self.times), np.inf)

    def begin(self, step: float) -> None:
        """Take the length of a step [s]."""
        self._steps = 0.5 * step / self.times
        for weight, k in zip(self.weights, self._steps, strict=True):
            weight.value = 1.0 / (1.0 + float(k))

    def follow(self, places: Sequence["Located"]) -> list[Recalled]:
        """From now on follow these places, and no others, as the points are.

        Returns:
            What tells sums of g r by components, and "rise", that of the mean dilatation.
        """
        at_rest = np.zeros((len(self.times), self._shape[2]))
        self._watched = [Watched(here, at_rest.copy()) for here in places]
        return [self._recalled(place) for place in self._watched]

    def _recalled(self, place: "Watched") -> Recalled:
        names, cell = (*REMEMBERED[: self._shape[2]], "rise"), place.here.cell
        if cell is None:  # another rank tells it
            return lambda: dict.fromkeys(names, 0.0)
        shares = self.cells[:, cell]

        def told() -> dict[str, float]:
            each = [*(shares @ place.kept), shares @ self.excess[:, cell]]
            return dict(zip(names, each, strict=True))

        return told

    def settle(self, before: Any, after: Any, swept: Floats | None) -> None:
        """Go to the end of a step.

        Args:
            before: Displacement at its start, a function whose ghosts are up to date.
            after: The same at its end.
            swept: Change of the mean dilatation of the owned cells; None where it does not count.
        """
        ends = [each.x.array.reshape(-1, self._dim) for each in (before, after)]
        change, steps = np.zeros(self._shape), self._steps[:, None]
        strain_change(*ends, self._cells, self._table, self._hoop, change)
        for place in self._watched:
            law, cell = place.here.law, place.here.cell
            if law is None or cell is None:
                continue
            seen, hoop = np.zeros((1, 1, self._shape[2])), law.hoop[: self._hoop.shape[2]]
            table = np.ascontiguousarray(law.slopes)[None, None], hoop[None, None]
            strain_change(*ends, self._cells[[cell]], *table, seen)
            place.kept = ((1.0 - steps) * place.kept + seen[0]) / (1.0 + steps)
        for kept, k in zip(self.kept, self._steps, strict=True):
            values = kept.x.array.reshape(-1, self._shape[2])
            old = values[self._places]
            values[self._places] = ((1.0 - k) * old + change.reshape(old.shape)) / (1.0 + k)
        if swept is not None:
            self.excess = ((1.0 - steps) * self.excess + swept) / (1.0 + steps)

    def pressures(self, swept: Floats | float) -> Floats:
        """Over the bulk modulus those that a change of the mean dilatation finds amid a step."""
        weights = (1.0 / (1.0 + self._steps))[:, None]
        found: Floats = (self.cells * weights * (self.excess + 0.5 * swept)).sum(axis=0)
        return found

    @property
    def held(self) -> Floats:
        """Over the bulk modulus the pressures between steps, of the owned cells."""
        found: Floats = (self.cells * self.excess).sum(axis=0)
        return found

    @property
    def stiffening(self) -> Floats:
        """Their derivative by that change."""
        found: Floats = (self.cells * (0.5 / (1.0 + self._steps))[:, None]).sum(axis=0)
        return found

    def stored(self, moduli: Floats) -> float:
        """Energy of the mean dilatation by the bulk moduli times the volumes of cells [J]."""
        return 0.5 * float((self.cells * moduli * self.excess**2).sum())

    def memory(self) -> dict[str, Floats]:
        """All of it in the order of the mesh, the same on all ranks (collective)."""
        parts = [kept.x.array.reshape(-1, self._shape[2])[self._places] for kept in self.kept]
        each = [part.reshape(len(self._cells), -1) for part in parts]
        own = np.concatenate([*each, self.excess.T], axis=1)
        found = np.zeros((self._total, own.shape[1]))
        found[fem.gather(self._comm, self._numbers)] = fem.gather(self._comm, own)
        watched = np.array([place.kept for place in self._watched])
        return {"relaxing": found, "watched": self._comm.allreduce(watched)}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        own = memory["relaxing"][self._numbers]
        width = self._shape[1] * self._shape[2]
        for index, kept in enumerate(self.kept):
            part = own[:, index * width : (index + 1) * width]
            kept.x.array.reshape(-1, self._shape[2])[self._places] = part.reshape(
                -1, self._shape[2]
            )
        self.excess = own[:, len(self.kept) * width :].T.copy()
        for place, kept in zip(self._watched, memory["watched"], strict=True):
            place.kept = kept.copy()
