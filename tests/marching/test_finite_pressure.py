"""Pressures that follow the surface of a body under finite strain."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import impactfem
from impactfem import SceneError
from impactfem.forms.elasticity import ElasticForms
from impactfem.forms.finite_strain import LAWS, FiniteForms

FLOOR = {"name": "floor", "kind": "half_space", "point": [0.0, -9.0], "normal": [0.0, 1.0]}
RUBBER = {
    "name": "ring", "kind": "solid", "model": "plane_strain", "mesh_size": 0.0125,
    "shape": {"kind": "ring", "radius": 0.05, "inner_radius": 0.02},
    "material": "neo_hookean", "density": 1100.0, "youngs_modulus": 1e6, "poisson_ratio": 0.4,
}  # fmt: skip


def scene(duration, dt, body=(), **more):
    return impactfem.Scene.from_dict(
        {
            "title": "pressure", "duration": duration, "body": [RUBBER | dict(body)],
            "obstacle": [FLOOR], "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
        } | more
    )  # fmt: skip


def columns(result, *names):
    return (result.history[name].values for name in names)


def on(surface, value, **more):
    return {"pressures": [{"surface": surface, "value": value} | more]}


@pytest.mark.parametrize(("model", "degree"), [("plane_strain", 2), ("axisymmetric", 1), ("3d", 1)])
def test_the_work_is_the_pressure_times_the_volume(model, degree):
    from dolfinx import fem, mesh
    from mpi4py import MPI

    if model == "3d":
        domain = mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1, mesh.CellType.hexahedron)
    else:
        domain = mesh.create_rectangle(MPI.COMM_SELF, [[0.5, 0.0], [1.5, 1.0]], [2, 2])
    domain.topology.create_connectivity(domain.topology.dim - 1, domain.topology.dim)
    facets = mesh.exterior_facet_indices(domain.topology)
    tags = mesh.meshtags(domain, domain.topology.dim - 1, facets, np.ones_like(facets))
    space = fem.functionspace(domain, ("Lagrange", degree, (domain.geometry.dim,)))
    one = fem.Constant(domain, 1.0)
    elastic = ElasticForms(space, model, model != "3d", one, one, one)
    finite = FiniteForms(elastic, LAWS["neo_hookean"], 0.0, one)
    before, after = fem.Function(space), fem.Function(space)
    random = np.random.default_rng(1)
    for function in (before, after):
        function.x.array[:] = 0.1 * random.standard_normal(len(function.x.array))
    surface = elastic.surface_measure(tags, 1)
    force = fem.assemble_vector(fem.form(finite.pressure(before, after, 3.0 * one, surface))).array

    def volume(function):
        # A polynomial, of a degree beyond the quadrature of the law.
        inside = finite._volume_ratio(function) * elastic.weight * elastic._dx(8)
        return fem.assemble_scalar(fem.form(inside))

    moved = after.x.array - before.x.array
    assert force @ moved == pytest.approx(-3.0 * (volume(after) - volume(before)), rel=1e-12)
    if model != "axisymmetric":
        each = force.reshape(-1, domain.geometry.dim)
        assert np.abs(each.sum(axis=0)).max() <= 1e-14
    if model == "plane_strain":
        x = space.tabulate_dof_coordinates()[:, :2]
        x = x + 0.5 * (before.x.array + after.x.array).reshape(-1, 2)
        assert abs(x[:, 0] @ each[:, 1] - x[:, 1] @ each[:, 0]) <= 1e-14


def inner_wall(pressure, inner, outer, modulus, nu):
    """Where the inner wall of a neo-Hookean tube in plane strain is under a pressure, by an ODE."""
    mu, lame = modulus / (2 + 2 * nu), modulus * nu / ((1 + nu) * (1 - 2 * nu))

    def stress(one, other):
        return mu * (one - 1 / one) + lame * np.log(one * other) / one

    def slopes(radius, state):
        place, stretch = state  # along the radius, place' = stretch
        hoop = place / radius
        difference = (stress(hoop, stretch) - stress(stretch, hoop)) / radius
        by_hoop = lame / (stretch * hoop) * (stretch - hoop) / radius
        by_own = mu * (1 + stretch**-2) + lame * (1 - np.log(stretch * hoop)) / stretch**2
        return [stretch, (difference - by_hoop) / by_own]

    def integrated(hoop):
        free = brentq(lambda own: stress(own, hoop), 0.3, 1.0, xtol=1e-14)
        ends = [outer * hoop, free]
        return solve_ivp(slopes, [outer, inner], ends, rtol=1e-10, atol=1e-12).y[:, -1]

    def left(hoop):
        place, stretch = integrated(hoop)
        return stress(stretch, place / inner) + pressure * place / inner

    return integrated(brentq(left, 1.0, 1.2))[0]


def test_a_tube_under_pressure_opens_as_its_law_says():
    """At rest, degree 2: the inner wall goes out by 62 %; a dead pressure opens it far less."""
    tube = {"degree": 2, "shape": RUBBER["shape"] | {"symmetry": ["x", "y"]}, "mesh_size": 0.01}
    probe = {"name": "wall", "body": "ring", "point": [0.02, 0.0], "quantities": ["displacement"]}

    def opening(**more):
        body = tube | on("inner", 2e5, **more)
        still = scene(2e-3, 1e-3, body, start="static", probe=[probe])
        (moved,) = columns(impactfem.solve(still), "wall.ux")
        assert np.ptp(moved) <= 1e-9 * 0.02  # and it stays there
        return moved[0]

    expected = inner_wall(2e5, 0.02, 0.05, 1e6, 0.4) - 0.02
    assert opening() == pytest.approx(expected, rel=1e-3)
    assert opening(follows=False) < 0.9 * expected


def test_a_body_that_flies_under_pressure_keeps_its_balance_and_momenta():
    thrown = on("outer", 5e4) | {"velocity": [1.0, 3.0], "angular_velocity": 60.0}
    result = impactfem.solve(scene(0.05, 5e-4, thrown))
    names = ("total_energy", "elastic_energy", "angular_momentum", "momentum.x", "momentum.y")
    energy, elastic, spun, x, y = columns(result, *names)
    for values in (energy, spun, x, y):
        assert np.ptp(values) <= 1e-11 * np.abs(values).max()
    assert np.ptp(elastic) > 0.05 * energy[0]  # it breathes


def test_a_pressure_that_follows_needs_finite_strain():
    small = {"strain": "small", "material": "linear"}
    with pytest.raises(SceneError, match=r"pressures\[0\].follows = true"):
        scene(0.1, 0.01, small | on("outer", 1.0, follows=True))
