"""Solids on structured meshes, and their equilibrium."""

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve
from structured import block

from impactfem.scene.loads import PiecewiseVector
from impactfem.scene.solids import Solid
from impactfem.system.elastic import elastic_system


def system_on(mesh, model="plane_strain", gravity=None, **given):
    """System of a solid with some data by default."""
    data = {"density": 2.0, "youngs_modulus": 10.0, "poisson_ratio": 0.3} | given
    solid = Solid(model=model, mesh="structured.msh", **data)
    if not isinstance(gravity, PiecewiseVector):
        gravity = PiecewiseVector(
            (0.0,), (tuple((0.0,) * solid.dim if gravity is None else gravity),)
        )
    return elastic_system(solid, gravity, mesh)


def system(cell, degree, divisions, place=lambda s: s, **given):
    """System of a block that is put at place(s)."""
    if len(divisions) == 3:
        given.setdefault("model", "3d")
    return system_on(block(cell, degree, divisions, place), **given)


def to_scipy(matrix):
    """A PETSc matrix of one rank."""
    starts, columns, values = matrix.getValuesCSR()
    return csr_matrix((values, columns, starts), shape=matrix.getSize())


def equilibrium(body, t=0.0):
    """Displacement of each node without inertia, shape (nodes, dim)."""
    right = np.array(body.load(t, lumped=True))
    right[body.supports.moved] += body.supports.motion(t)[0]
    return spsolve(to_scipy(body.stiffness).tocsc(), right).reshape(-1, body.dim)


def at(body, place, tolerance=1e-9):
    """Number of the node at a place."""
    distance = np.linalg.norm(body.positions - np.asarray(place), axis=1)
    assert distance.min() <= tolerance
    return int(np.argmin(distance))
