"""Masses without those of contact nodes that still have the body's centre and inertia.

Masses that contact nodes give to their neighbours lie further inside: the moment of inertia falls
by some h / R (7 % at h / R = .2). So each is multiplied by a polynomial of degree 2, near 1, such
that mass, centre and second moments are those of the body: M'_ij = M_ij (q_i + q_j) / 2. Where a
factor would be too small, as in thin bodies, all go as far from 1 as they may.
"""

from collections.abc import Callable
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.system.elastic import ElasticSystem
from impactfem.system.massless import lumped_mass, transferred
from impactfem.system.surface import SurfaceNodes

LEAST = 0.3
"""Smallest factor."""


def kept_moments(system: ElasticSystem, mass: Any, transfer: Any) -> tuple[Any, Floats, float]:
    """Multiply a mass so that it has the moments of the body (collective).

    Args:
        system: The body.
        mass: PETSc matrix without the mass of contact nodes; taken over.
        transfer: What has moved that; None if nothing has.

    Returns:
        The mass, its row sums [kg], (owned nodes,), and the share of the body's second moment that
        it has not; 0 for bodies that supports hold in every direction, which cannot turn.
    """
    dim = system.dim
    sums = transferred(transfer, np.repeat(system.node_mass, dim)).reshape(-1, dim)
    free = _free_direction(system)
    if free is None or transfer is None:
        return mass, sums.max(axis=1), 0.0
    factors, missing = _factors(system, lambda y: _times(mass, y, free, dim), free)
    mass = _multiplied(mass, np.repeat(factors, dim))
    return mass, _times(mass, np.ones(len(factors)), free, dim), missing


def lumped_moments(
    system: ElasticSystem, transfer: Any, surface: SurfaceNodes
) -> tuple[Floats, Floats, float]:
    """Lumped mass that has the moments of the body (collective).

    Returns:
        As `lumped_mass` gives it, its inverse, and the share of the second moment that it misses.

    Raises:
        SceneError: The elements have no lumped mass.
    """
    mass, inverse = lumped_mass(system, transfer, surface)
    free = _free_direction(system)
    if free is None or transfer is None:
        return mass, inverse, 0.0
    along = mass.reshape(-1, system.dim)[:, free].copy()
    factors, missing = _factors(system, lambda y: along * y, free)
    each = np.repeat(factors, system.dim)
    return mass * each, inverse / each, missing


def _free_direction(system: ElasticSystem) -> int | None:
    """A direction in which nothing is held, whose masses count for all (collective)."""
    held = system.constrained.reshape(-1, system.dim).any(axis=0)
    held = np.asarray(system.comm.allreduce(held.astype(np.int64), op=MPI.SUM)) > 0
    return None if held.all() else int(np.argmin(held))


def _factors(
    system: ElasticSystem, times: Callable[[Floats], Floats], free: int
) -> tuple[Floats, float]:
    """Factors of the owned nodes, and the share of the second moment that they miss (collective).

    Args:
        system: The body.
        times: Product of the mass without that of contact nodes with nodal values, (nodes,).
        free: Direction whose masses are taken.
    """
    comm, dim = system.comm, system.dim
    planes = dict(system.supports.planes) | ({0: 0.0} if system.axisymmetric else {})
    centre = system.center_of_mass
    centre[list(planes)] = list(planes.values())
    places = system.positions - centre
    far = float(np.linalg.norm(places, axis=1).max(initial=0.0))
    places = places / (2.0 * comm.allreduce(far, op=MPI.MAX))
    one, pairs = np.ones(len(places)), combinations_with_replacement(range(dim), 2)
    # Images of a cut or an axis undo what is odd along its normal.
    linear = [(one, places[:, axis]) for axis in range(dim) if axis not in planes]
    mixed = [(a, b) for a, b in pairs if a == b or not {a, b} & planes.keys()]
    # Pairs (x, y) whose sums x M y shall be those of the body's mass; of their products the factors
    # are made, and the squares make the second moment.
    # With these weights least squares do not change if body and axes turn together.
    products = ((places[:, a] * (1.0 if a == b else np.sqrt(2.0)), places[:, b]) for a, b in mixed)
    conditions = [(one, one), *linear, *products]
    squares = np.array([False] * (1 + len(linear)) + [a == b for a, b in mixed])
    basis = np.stack([x * y for x, y in conditions], axis=1)

    def row(x: Floats, y: Floats) -> Floats:
        answers = x * times(y) + y * times(x)
        return np.append(0.5 * answers @ basis, x @ _times(system.mass, y, free, dim))

    table = np.asarray(comm.allreduce(np.array([row(*pair) for pair in conditions]), op=MPI.SUM))
    change: Floats = basis @ np.linalg.lstsq(table[:, :-1], table[:, -1])[0] - 1.0
    massive = times(one) > 0.0
    least = comm.allreduce(float(change[massive].min(initial=np.inf)), op=MPI.MIN)
    share = min(1.0, (1.0 - LEAST) / max(-least, 1e-300))
    goal, start = table[squares, -1].sum(), table[squares, 0].sum()
    return 1.0 + share * change, (1.0 - share) * abs(1.0 - start / goal)


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
