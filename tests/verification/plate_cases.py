"""Plates with D = rho t = 1 for tests, grids and what they deflect by."""

from pathlib import Path

import numpy as np
from scipy.sparse.linalg import spsolve

import impactfem
from impactfem.system.plate_making import discretised
from impactfem.system.plate_mesh import PlateMesh, plate_mesh
from impactfem.system.plate_tones import frequencies

NU = 0.3
SQUARE = {"kind": "rectangle", "size": [1.0, 1.0]}
SIDES = ("left", "right", "bottom", "top")
DISC = {"kind": "disc", "radius": 1.0}


def plate_of(outline, size, kind=None, edges=SIDES, *, touches=False, mesh=None, shears=False,
             **more):  # fmt: skip
    """A plate with D = rho t = 1 under the pressure 1 from below, unless told otherwise."""
    nu, t = more.get("poisson_ratio", NU), more.get("thickness", 0.01)
    t = t if isinstance(t, float) else 0.01
    keys = {
        "thickness": t, "density": 1.0 / t, "poisson_ratio": NU,
        "youngs_modulus": 12.0 * (1.0 - (NU if nu is None else nu) ** 2) / t**3,
        "supports": [{"edge": edge, "kind": kind} for edge in edges] if kind else [],
        "pressures": [{"face": "bottom", "value": 1.0}],
    }  # fmt: skip
    body = impactfem.Plate(outline=outline, mesh_size=size, **keys | more)
    return discretised(body, mesh or plate_mesh(body, Path()), touches=touches, shears=shears)


def grid(n, shift=0.0):
    """The unit square about the origin as 2 n^2 triangles, its inner vertices moved by shares h."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
    points = np.stack([i.ravel(), j.ravel()], axis=1) / n - 0.5
    inner = (np.abs(points).max(axis=1) < 0.5 - 1e-9) & (np.abs(points).max(axis=1) > 1e-9)
    moves = np.random.default_rng(1).uniform(-shift / n, shift / n, points.shape)
    number = i + j * (n + 1)
    a, b = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    c, d = number[1:, :-1].ravel(), number[1:, 1:].ravel()
    cells = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    line = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    edges = {
        "bottom": line,
        "top": line + n * (n + 1),
        "left": (n + 1) * line,
        "right": (n + 1) * line + n,
    }
    return PlateMesh(points + inner[:, None] * moves, cells, edges)


def deflected(plate):
    """Deflections under the pressure, and where, (vertices,) and (vertices, 2)."""
    forces = plate.basis[::3].T @ (plate.transfer.T @ plate.pressure(0.0, 0.0))
    return plate.deflection(spsolve(plate.stiffness.tocsc(), forces)), plate.mesh.points


def tones(plate, count):
    return frequencies(plate.stiffness, plate.basis[::3].T @ plate.node_mass, count)
