"""Gradients of solids by time steps: identities that any right one has, and what is refused."""

import pytest

import impactfem
from impactfem import Scene, SceneError

PLAIN = {"report": False, "pictures": False, "fields": []}
SHAPE = {"kind": "disc", "radius": 0.05, "center": [0.0, 0.052]}
DISC = {
    "kind": "solid",
    "name": "disc",
    "model": "plane_strain",
    "shape": SHAPE,
    "mesh_size": 0.016,
    "density": 1100.0,
    "youngs_modulus": 1.5e6,
    "poisson_ratio": 0.3,
}
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
VARIED = {"v": "body.disc.velocity.1", "E": "body.disc.youngs_modulus", "rho": "body.disc.density"}


def thrown(*names, of="rebound_speed.disc", body=(), solve=(), **more):
    """A disc thrown at a rigid plane, with some of its numbers as parameters."""
    return Scene.from_dict({
        "title": "thrown", "duration": 0.012,
        "body": [DISC | {"velocity": [0.0, -1.003]} | dict(body)], "obstacle": [FLOOR],
        "parameter": [{"name": name, "key": VARIED[name]} for name in names],
        "measure": [{"name": "told", "of": of}],
        "objective": {"minimise": [{"term": "value", "of": "told"}]},
        "solve": {"method": "massless", "dt": 2e-4} | dict(solve), "output": PLAIN,
    } | more)  # fmt: skip


@pytest.mark.parametrize("method", ["massless", "conserving"])
def test_speeds_are_homogeneous_in_those_of_waves_and_of_the_throw(method):
    # Steps know E and density by E/density only; J(a v, a c) = a J but for the length of steps.
    found = impactfem.gradient(thrown("v", "E", "rho", solve={"method": method}))
    slope = found.gradient
    assert found.check.rate == pytest.approx(2.0, abs=0.1)
    assert found.trusted
    by_modulus = 1.5e6 * slope["E"]
    assert 1100.0 * slope["rho"] == pytest.approx(-by_modulus, abs=1e-7)
    euler = 2.0 * by_modulus - 1.003 * slope["v"]
    assert euler == pytest.approx(found.objective, rel=0.04)  # of steps of .2 ms


@pytest.mark.parametrize("method", ["galerkin", "moreau_jean"])
def test_methods_with_mass_on_contact_nodes_have_no_gradient(method):
    with pytest.raises(SceneError, match=r'no derivatives that are right.*"massless"'):
        impactfem.gradient(thrown("v", solve={"method": method, "dt": None}))


def test_shapes_are_not_varied():
    scene = thrown("v")
    data = scene.to_dict()
    data["parameter"] = [{"name": "R", "key": "body.disc.shape.radius"}]
    with pytest.raises(SceneError, match="shape: gradients keep the meshes"):
        impactfem.gradient(Scene.from_dict(data))
