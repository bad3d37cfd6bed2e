"""Nearly incompressible bodies under finite strain: one ratio of volumes for each cell."""

from pathlib import Path

import numpy as np
import pytest
import ufl

import impactfem
from impactfem import SceneError
from impactfem.forms.elasticity import ElasticForms
from impactfem.forms.finite_strain import LAWS, FiniteForms

COOK = str(Path(__file__).parents[2] / "meshes" / "cook.geo")
RUBBER = {"kind": "solid", "material": "neo_hookean", "density": 1100.0, "poisson_ratio": 0.4999}
QUADS, SIMPLICES = {"cells": "hexahedron"}, {"degree": 2}


def solved(duration, dt, body, floor, **more):
    data = {
        "title": "tight", "duration": duration, "body": [RUBBER | {"name": "body"} | body],
        "obstacle": [{"kind": "half_space", "name": "floor"} | floor],
        "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
    }  # fmt: skip
    return impactfem.solve(impactfem.Scene.from_dict(data | more))


@pytest.mark.parametrize("model", ["plane_strain", "axisymmetric", "3d"])
def test_what_pressures_work_on_is_the_change_of_volume(model):
    """Of each cell, between states far apart."""
    from dolfinx import fem, mesh
    from mpi4py import MPI

    if model == "3d":
        domain = mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1, mesh.CellType.hexahedron)
    else:
        domain = mesh.create_rectangle(MPI.COMM_SELF, [[0.5, 0.0], [1.5, 1.0]], [2, 2])
    space = fem.functionspace(domain, ("Lagrange", 1, (domain.geometry.dim,)))
    cells = fem.functionspace(domain, ("Discontinuous Lagrange", 0))
    one, q = fem.Constant(domain, 1.0), ufl.TestFunction(cells)
    elastic = ElasticForms(space, model, model != "3d", one, one, one)
    finite = FiniteForms(elastic, LAWS["neo_hookean"], 0.0, one)
    before, after = fem.Function(space), fem.Function(space)
    random = np.random.default_rng(1)
    for function in (before, after):
        function.x.array[:] = 0.1 * random.standard_normal(len(function.x.array))

    def of_cells(density):
        return fem.assemble_vector(fem.form(elastic.measured(q * density))).array

    swept = of_cells(finite.swept(before, after, after - before))
    changed = of_cells(finite.dilatation(after)) - of_cells(finite.dilatation(before))
    assert np.abs(changed).max() > 0.01
    assert swept == pytest.approx(changed, abs=1e-14)


def thrown(kind, duration, dt, **more):
    disc = {
        "model": "plane_strain", "youngs_modulus": 1e6, "mesh_size": 0.02,
        "shape": {"kind": "disc", "radius": 0.05, "center": [0.0, 0.0502]},
        "velocity": [1.0, -2.0], "angular_velocity": 40.0,
    }  # fmt: skip
    floor = {"point": [0.0, 0.0], "normal": [0.0, 1.0]}
    return solved(duration, dt, disc | kind, floor, **more)


def columns(result, *names):
    return (result.history[name].values for name in names)


@pytest.mark.parametrize("kind", [QUADS, SIMPLICES])
def test_bounces_keep_the_energy_and_flight_the_momenta(kind):
    result = thrown(kind, 0.02, 2e-4)
    energy, force, spun, up, y, along = columns(
        result, "total_energy", "contact_force", "angular_momentum", "momentum.y", "body.y",
        "momentum.x",
    )  # fmt: skip
    assert np.ptp(energy) <= 1e-10 * energy[0]
    assert force.max() > 3000.0
    assert np.ptp(along) <= 1e-10 * np.abs(up).max()  # no friction
    away = np.flatnonzero(force)[-1] + 2
    assert len(y) > away + 20
    for values in (up[away:], spun[away:]):
        assert np.ptp(values) <= 1e-10 * np.abs(values).max()


def test_damping_is_that_of_small_strains():
    """A column between slippery walls in which a pressure wave dies away."""
    column = {
        "model": "plane_strain", "youngs_modulus": 1e6, "cells": "hexahedron", "mesh_size": 0.05,
        "degree": 1, "shape": {"kind": "block", "size": [0.05, 0.5], "corner": [0.0, 0.0]},
        "velocity": ["0", "1e-4*y"], "rayleigh_stiffness": 2e-5, "contact_surfaces": ["top"],
        "supports": [
            {"surface": side, "kind": "symmetry"} for side in ("left", "right", "bottom")
        ],
    }  # fmt: skip
    below = {"point": [0.0, 9.0], "normal": [0.0, -1.0]}
    method = {"solve": {"dt": 2e-5, "estimate": False, "method": "conserving"}}
    small = {"strain": "small", "material": "linear"}
    one, other = (
        next(columns(solved(2e-3, 2e-5, column | kind, below, **method), "elastic_energy"))
        for kind in ({}, small)
    )
    assert one[-10:].max() < 0.7 * one.max()
    assert np.abs(one - other).max() <= 2e-3 * one.max()


def cook(size, kind):
    """Tip of Cook's membrane, mu = 80.1938, force 100, at rest: the corner's way up.

    Taylor and Hood's elements with pressures as unknowns, written apart from this package, give
    6.773, 6.861, 6.898, 6.915 with 8, 16, 32 and 64 elements a side: 6.930 +- .005.
    """
    body = {
        "model": "plane_strain", "mesh": COOK, "mesh_size": size, "density": 1.0,
        "youngs_modulus": 2.0 * 80.1938 * 1.4999, "contact_surfaces": ["top"],
        "supports": [{"surface": "left", "kind": "fixed"}],
        "tractions": [{"surface": "right", "value": [0.0, 6.25]}],
    }  # fmt: skip
    ceiling = {"point": [0.0, 200.0], "normal": [0.0, -1.0]}
    probe = {"name": "tip", "body": "body", "point": [48.0, 60.0]}
    result = solved(1e-2, 1e-2, body | kind, ceiling, start="static", probe=[probe])
    return result.history["tip.uy"].values[0]


def test_cooks_membrane_does_not_lock():
    assert cook(2.0, SIMPLICES) == pytest.approx(6.930, rel=4e-3)  # from above
    coarse, fine = cook(4.0, QUADS), cook(2.0, QUADS)
    assert coarse < fine
    assert fine == pytest.approx(6.930, rel=0.01)
    assert cook(2.0, QUADS | {"element": "standard"}) < 0.6 * 6.930


@pytest.mark.parametrize("model", ["3d", "axisymmetric"])
def test_a_rod_has_the_stress_of_its_law(model):
    """Homogeneous: the mean is the value at each point."""
    axial = model == "axisymmetric"
    dim = 2 if axial else 3
    held = ["bottom"] if axial else ["left", "bottom", "back"]
    block = {
        "model": model, "youngs_modulus": 1e6, "mesh_size": 0.5, "cells": "hexahedron",
        "shape": {"kind": "block", "size": [1.0] * dim, "corner": [0.0] * dim},
        "supports": [{"surface": side, "kind": "symmetry"} for side in held],
        "tractions": [{"surface": "top", "value": [0.0, 5e5, 0.0][:dim]}],
    }  # fmt: skip
    probe = {
        "name": "p", "body": "body", "point": [0.7] * dim, "quantities": ["displacement", "stress"],
    }  # fmt: skip
    floor = {"point": [0.0, -9.0, 0.0][:dim], "normal": [0.0, 1.0, 0.0][:dim]}
    more = {"start": "static", "probe": [probe], "output": {}}
    result = solved(1e-4, 1e-4, block, floor, **more)
    up, side, true, across = (
        result.history[f"p.{name}"].values[0] for name in ("uy", "ux", "syy", "sxx")
    )
    stretch, lateral = 1.0 + up / 0.7, 1.0 + side / 0.7
    mu, lame = 1e6 / 2.9998, 1e6 * 0.4999 / (1.4999 * 0.0002)
    log = np.log(stretch * lateral**2)
    assert true == pytest.approx(5e5 / lateral**2, rel=1e-8)
    assert mu * (stretch - 1.0 / stretch) + lame * log / stretch == pytest.approx(5e5, rel=1e-7)
    assert abs(across) <= 1e-6 * true
    stress = result.fields.read(0, "cauchy_stress")["cauchy_stress"][:, 4]
    assert stress == pytest.approx(true, rel=1e-8)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"degree": 1}, r"degree = 1: linear triangles"),
        ({"material": "linear", "strain": "finite"}, "poisson_ratio = 0.4999"),
        ({"model": "plane_stress", "material": "linear", "element": "mean_dilatation"}, "element"),
    ],
)
def test_what_would_lock_is_refused(body, words):
    with pytest.raises(SceneError, match=words):
        thrown(body, 0.1, 1e-3)


def test_explicit_steps_are_refused():
    with pytest.raises(SceneError, match="explicit"):
        thrown(QUADS, 0.1, 1e-3, solve={"method": "explicit"})
