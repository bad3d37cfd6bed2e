"""Contact patch test: two blocks pressed together on meshes that do not match carry one stress.

The linear displacements of uniaxial stress and multipliers of one pressure have to satisfy every
equation of the discrete problem: no forces inside, those of the contact on the interface, no gap.
With supports that hold the blocks the solution is unique, so that it is this one.
"""

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from solid_pairs import block, scene

from impactfem.models.solids import solids_model

PRESSURE, NU = 0.01, 0.3


def turned(name, corner, size, mesh_size, angle, **more):
    """A block turned about the origin, which lies on the interface (in space about z)."""
    center = np.asarray(corner[:2]) + np.asarray(size[:2]) / 2
    c, s = np.cos(angle), np.sin(angle)
    moved = np.array([[c, -s], [s, c]]) @ center - np.asarray(size[:2]) / 2
    table = block(name, [*moved.tolist(), *corner[2:]], size, mesh_size, **more)
    table["shape"]["angle"] = angle
    return table


def blocks(dim, angle, degree, cells):
    """Two blocks that touch, and the normal of the interface."""
    more = {"poisson_ratio": NU, "degree": degree, "cells": cells}
    more["model"] = "3d" if dim == 3 else "plane_strain"
    depth, zero = [0.7] * (dim - 2), [0.0] * (dim - 2)
    fine, coarse = (0.17, 0.23) if dim == 2 else (0.24, 0.37)
    bodies = [
        turned("low", [0, -0.6, *zero], [1, 0.6, *depth], coarse, angle, **more),
        turned("high", [0, 0, *zero], [1, 0.8, *depth], fine, angle, **more),
    ]
    return bodies, np.array([-np.sin(angle), np.cos(angle), *zero])


def sparse(matrix):
    indptr, indices, data = matrix.getValuesCSR()
    return csr_matrix((data, indices, indptr), shape=matrix.getSize())


def strain(normal, *, plane):
    """Strain of the uniaxial stress -p along a normal, for E = 1."""
    along = np.outer(normal, normal)
    across = np.eye(len(normal)) - along
    if plane:  # no strain out of the plane
        return -PRESSURE * ((1 - NU**2) * along - NU * (1 + NU) * across)
    return -PRESSURE * (along - NU * across)


def misfits(bodies, normal):
    """Largest force that is left on a node inside or on the interface, and gap, both relative."""
    degree = bodies[0]["degree"]
    model = solids_model(scene(bodies, duration=1.0), [degree, degree], updated=False)
    (pair,) = model.pairs
    met = pair.met([side.surface.points for side in pair.sides])
    sides = met.forces(PRESSURE * met.area)
    wrong, opened = 0.0, np.zeros(met.count)
    tensor = strain(normal, plane=len(normal) == 2)
    for side, (body, forces) in enumerate(zip(pair.bodies, sides, strict=True)):
        part = model.parts[body]
        system, dim = part.system, len(normal)
        moved = system.positions @ tensor.T
        left = (sparse(system.stiffness) @ moved.ravel()).reshape(-1, dim)
        own = np.argsort(system.numbers)  # one rank: place of each canonical number
        nodes = own[part.outside.numbers[pair.nodes[side]]]
        left[nodes] -= forces
        depth = np.abs(system.positions @ normal)
        outer = np.abs(depth - depth.max()) < 1e-9
        wrong = max(wrong, np.abs(left[~outer]).max())
        way = moved[nodes] if side == 0 else -moved[nodes]
        weights = (met.carrier_weights, met.other_weights)[side]
        opened += np.einsum("ij,ij->i", met.normal, weights @ way)
    force = PRESSURE * met.area.max()
    return wrong / force, np.abs(met.gap + opened).max()


@pytest.mark.parametrize("angle", [0.0, 0.4])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cells", ["simplex", "hexahedron"])
@pytest.mark.parametrize("dim", [2, 3])
def test_one_stress_on_flat_and_inclined_interfaces(dim, cells, degree, angle):
    force, gap = misfits(*blocks(dim, angle, degree, cells))
    assert force <= 1e-10
    assert gap <= 1e-12
