"""Masses without those of contact nodes that still have the body's centre and inertia.

Masses that contact nodes give to their neighbours lie further inside: the moment of inertia falls
by some h / R (7 % at h / R = .2). So each is multiplied by a polynomial of degree 2, near 1, such
that mass, centre and second moments are those of the body: M'_ij = M_ij (q_i + q_j) / 2.
"""

from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.fem import MPI
from impactfem.system.elastic import ElasticSystem
from impactfem.system.massless import transferred

Floats = NDArray[np.float64]

LEAST = 0.3
"""Factor below which masses are not trusted."""


def kept_moments(system: ElasticSystem, mass: Any, transfer: Any) -> tuple[Any, Floats, str]:
    """Multiply a mass so that it has the moments of the body (collective).

    Args:
        system: The body.
        mass: PETSc matrix without the mass of contact nodes; taken over.
        transfer: What has moved that; None if nothing has.

    Returns:
        The mass, its row sums [kg], (owned nodes,), and which moments it has: "inertia" (all of
        degree 2), "polar" (their trace), or "mass" where no factors above `LEAST` keep more, as in
        thin bodies. A body that supports hold in every direction cannot turn: it keeps its mass.
    """
    dim = system.dim
    sums = transferred(transfer, np.repeat(system.node_mass, dim)).reshape(-1, dim)
    free = _free_direction(system)
    if free is None:
        return mass, sums.max(axis=1), "mass"
    if transfer is None:
        return mass, system.node_mass, "inertia"
    planes = dict(system.supports.planes) | ({0: 0.0} if system.axisymmetric else {})
    centre = system.center_of_mass
    centre[list(planes)] = list(planes.values())
    places = (system.positions - centre) / system.nodes.size
    linear = [places[:, axis] for axis in range(dim) if axis not in planes]
    one, pairs = np.ones(len(places)), combinations_with_replacement(range(dim), 2)
    # Images of a cut or an axis undo what is odd along its normal.
    second = [(a, b) for a, b in pairs if a == b or not {a, b} & planes.keys()]
    kept = [[(one, x)] for x in (one, *linear)]
    each = [[(places[:, a], places[:, b])] for a, b in second]
    trace = [(places[:, a], places[:, a]) for a in range(dim)]
    for kind, conditions in (("inertia", each), ("polar", [trace])):
        squares = [np.sum([x * y for x, y in parts], axis=0) for parts in conditions]
        basis = np.stack([one, *linear, *squares], axis=1)
        factors = _factors(system, mass, free, basis, [*kept, *conditions])
        if factors is not None:
            mass = _multiplied(mass, np.repeat(factors, dim))
            return mass, _times(mass, one, free, dim), kind
    return mass, sums[:, free], "mass"


def _free_direction(system: ElasticSystem) -> int | None:
    """A direction in which nothing is held, whose masses count for all (collective)."""
    held = system.constrained.reshape(-1, system.dim).any(axis=0)
    held = np.asarray(system.comm.allreduce(held.astype(np.int64), op=MPI.SUM)) > 0
    return None if held.all() else int(np.argmin(held))


def _factors(
    system: ElasticSystem,
    mass: Any,
    free: int,
    basis: Floats,
    conditions: list[list[tuple[Floats, Floats]]],
) -> Floats | None:
    """Factors of the owned nodes; None if some massive node has too small a one (collective).

    Args:
        system: The body.
        mass: Without the mass of contact nodes.
        free: Direction whose masses are taken.
        basis: Functions that the factors are made of, (owned nodes, functions).
        conditions: Pairs (x, y) of nodal values, whose sums of x M y are those of the body's mass.
    """
    comm, dim = system.comm, system.dim

    def times(matrix: Any, values: Floats) -> Floats:
        return _times(matrix, values, free, dim)

    def row(x: Floats, y: Floats) -> Floats:
        answers = x * times(mass, y) + y * times(mass, x)
        return np.append(0.5 * answers @ basis, x @ times(system.mass, y))

    own = np.array([np.sum([row(x, y) for x, y in parts], axis=0) for parts in conditions])
    table = np.asarray(comm.allreduce(own, op=MPI.SUM))
    factors: Floats = basis @ np.linalg.lstsq(table[:, :-1], table[:, -1])[0]
    massive = times(mass, np.ones(len(factors))) > 0.0
    least = comm.allreduce(float(factors[massive].min(initial=np.inf)), op=MPI.MIN)
    return factors if least >= LEAST else None


def _times(matrix: Any, values: Floats, direction: int, dim: int) -> Floats:
    """Product with nodal values in one direction, (owned nodes,) (collective)."""
    source, image = matrix.createVecs()
    full = np.zeros((len(values), dim))
    full[:, direction] = values
    source.setArray(full.ravel())
    matrix.mult(source, image)
    found: Floats = np.array(image.getArray()).reshape(-1, dim)[:, direction]
    source.destroy()
    image.destroy()
    return found


def _multiplied(mass: Any, factors: Floats) -> Any:
    """M_ij (q_i + q_j) / 2, in place."""
    other = mass.copy()
    scale = mass.createVecRight()
    scale.setArray(0.5 * factors)
    mass.diagonalScale(L=scale)
    other.diagonalScale(R=scale)
    mass.axpy(1.0, other)
    scale.destroy()
    other.destroy()
    return mass
