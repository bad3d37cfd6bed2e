"""Damping of a solid by the quality factor of its first mode of vibration."""

import math
from dataclasses import replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from scipy.linalg import eigh

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.fem import MPI, PETSc
from impactfem.scene.damping import rayleigh_of
from impactfem.system.elastic import ElasticSystem
from impactfem.system.linear import LinearSolver
from impactfem.system.rigid_modes import RigidModes

_KEPT = 6  # approximate modes that are iterated together
_SHIFT = 1e-3  # of the square of the frequency, by which the stiffness is made definite
_ACCURACY, _MOST = 1e-8, 200
_DIRECT = {2: 1_000_000, 3: 200_000}  # unknowns up to which a factorisation is cheapest
_NONE = 1e-12  # share of the largest below which a direction is none


def with_quality(system: ElasticSystem, solid: Any) -> ElasticSystem:
    """A body with the damping that its quality factor or ratio asks for (collective).

    By the mass, w / Q, so that all modes lose energy as exp(-w t / Q); a body that may move without
    strain, which that would brake, by the stiffness, 1 / (w Q). By a ratio 2 zeta / w likewise.

    Raises:
        ConvergenceError: Its first mode is not found.
    """
    if not (solid.quality_factor or solid.damping_ratio):
        return system
    rigid = RigidModes.of(system)
    mass, stiffness = rayleigh_of(solid, first_frequency(system, rigid), held=not rigid.count)
    return replace(system, rayleigh_mass=mass, rayleigh_stiffness=stiffness)


def first_frequency(system: ElasticSystem, rigid: RigidModes) -> float:
    """The lowest circular frequency that is not 0 [rad/s] of M x'' + K x = 0 (collective).

    Subspace iteration from polynomials of degree 2, free of rigid motions. Source: K.-J. Bathe,
    Finite Element Procedures (2014), section 11.6.

    Raises:
        ConvergenceError: It does not settle.
    """
    comm, dim = system.comm, system.dim
    source, image = system.stiffness.createVecs()

    def times(matrix: Any, fields: Floats) -> Floats:
        found = np.empty_like(fields)
        for row, field in enumerate(fields):
            source.setArray(field)
            matrix.mult(source, image)
            found[row] = image.getArray()
        return found

    def gram(one: Floats, two: Floats) -> Floats:
        return np.asarray(comm.allreduce(one @ two.T, op=MPI.SUM))

    heavy = times(system.mass, rigid.fields)
    turn = np.linalg.inv(gram(rigid.fields, heavy)) if rigid.count else np.zeros((0, 0))

    def ritz(fields: Floats) -> tuple[Floats, Floats]:
        """Squares of frequencies and best fields of a space."""
        fields = fields - gram(fields, heavy) @ turn @ rigid.fields
        weights = times(system.mass, fields)
        mass = gram(fields, weights)
        sizes, ways = np.linalg.eigh(mass)
        real = sizes > _NONE * sizes[-1]
        fields = (ways[:, real] / np.sqrt(sizes[real])).T @ fields
        stiff = gram(fields, times(system.stiffness, fields))
        squares, best = eigh(0.5 * (stiff + stiff.T))
        return squares[:_KEPT], best[:, :_KEPT].T @ fields

    x = (system.positions - system.center_of_mass) / system.nodes.size
    parts = [*x.T, *(x[:, i] * x[:, j] for i, j in combinations_with_replacement(range(dim), 2))]
    starts = np.array([np.outer(part, way).ravel() for part in parts for way in np.eye(dim)])
    starts[:, system.constrained] = 0.0
    squares, fields = ritz(starts)
    matrix = system.stiffness.copy()
    matrix.axpy(
        _SHIFT * float(squares[0]), system.mass, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
    )
    size = matrix.getSize()[0]
    kind = "mumps" if size <= _DIRECT[dim] else "gamg"
    solver = LinearSolver(matrix, kind, system.stiffness.getNearNullSpace())
    try:
        for _ in range(_MOST):
            found = np.empty_like(fields)
            for row, field in enumerate(times(system.mass, fields)):
                source.setArray(field)
                image.set(0.0)
                solver.solve(source, image)
                found[row] = image.getArray()
            found[:, system.constrained] = 0.0
            known = float(squares[0])
            squares, fields = ritz(found)
            if abs(float(squares[0]) - known) <= _ACCURACY * known:
                return math.sqrt(float(squares[0]))
    finally:
        solver.destroy()
        source.destroy()
        image.destroy()
    raise ConvergenceError(
        "body.quality_factor or damping_ratio: the first mode of vibration is not found; give "
        "damping = { mass, stiffness } instead"
    )
