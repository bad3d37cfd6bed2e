"""One vocabulary of damping: the table says what the keys of each kind do."""

import pytest

import impactfem
from impactfem.errors import SceneError
from impactfem.models.solids import solids_model

BLOCK = {"kind": "solid", "name": "b", "model": "plane_strain", "density": 1000.0,
         "youngs_modulus": 1e6, "poisson_ratio": 0.3, "mesh_size": 0.5,
         "shape": {"kind": "block", "size": [1.0, 0.5]}}  # fmt: skip
BEAM = {"kind": "beam", "name": "b", "length": 1.0, "height": 0.05, "width": 0.05,
        "density": 1000.0, "youngs_modulus": 1e7, "center": [0.0, 1.0]}  # fmt: skip
PLATE = {"kind": "plate", "name": "b", "thickness": 0.01, "density": 1000.0,
         "youngs_modulus": 1e7, "poisson_ratio": 0.3, "mesh_size": 0.5,
         "outline": {"kind": "rectangle", "size": [1.0, 1.0]}}  # fmt: skip
KINDS = pytest.mark.parametrize("body", [BLOCK, BEAM, PLATE])


def made(body, **given):
    dim = 3 if body is PLATE else 2
    table = {"title": "damped", "duration": 0.1, "gravity": [0.0] * dim,
             "body": [body | given], "solve": {"dt": 1e-3}}  # fmt: skip
    return impactfem.Scene.from_dict(table)


@KINDS
def test_the_table_says_what_keys_do(body):
    """And scene files keep the table alone, so that its entries can be set anew."""
    by = {"mass": 2.0, "stiffness": 1e-3}
    one, other = made(body, damping=by), made(body, rayleigh_mass=2.0, rayleigh_stiffness=1e-3)
    for name in ("rayleigh_mass", "rayleigh_stiffness"):
        assert getattr(one.bodies[0], name) == getattr(other.bodies[0], name)
    again = impactfem.Scene.from_dict(one.to_dict())
    assert again.to_dict() == one.to_dict()
    assert again.with_settings({"body.b.damping.mass": 5.0}).bodies[0].rayleigh_mass == 5.0
    ratios = made(body, damping={"ratio": 0.1}).bodies[0].damping_ratio
    assert ratios == made(body, damping_ratio=0.1).bodies[0].damping_ratio


@KINDS
def test_damping_that_is_said_twice_is_refused(body):
    """With the key to remove."""
    with pytest.raises(SceneError, match=r"rayleigh_mass = 3.0 contradicts damping.mass"):
        made(body, damping={"mass": 2.0}, rayleigh_mass=3.0)
    with pytest.raises(SceneError, match="rayleigh_mass = 2 contradicts quality_factor"):
        made(body, damping={"mass": 2.0}, quality_factor=9.0)
    with pytest.raises(SceneError, match=r"damping.mass is missing, and so are stiffness"):
        made(body, damping={})


def test_a_beam_takes_the_table_as_its_old_key():
    """Alpha and beta in a list."""
    by = {"mass": 2.0, "stiffness": 1e-3}
    assert made(BEAM, damping=by).bodies[0].rayleigh_damping == (2.0, 1e-3)
    assert made(BEAM, rayleigh=[2.0, 1e-3]).bodies[0].rayleigh_damping == (2.0, 1e-3)
    with pytest.raises(SceneError, match=r"rayleigh = \[2.0, 0.001\] contradicts rayleigh_mass"):
        made(BEAM, rayleigh=[2.0, 1e-3], damping=by)


def test_a_ratio_of_a_solid_is_that_of_its_quality():
    """Of a free body both damp by the stiffness: zeta = 1 / (2 Q)."""
    given = {"damping": {"ratio": 0.05}}, {"quality_factor": 10.0}
    one, other = (
        solids_model(made(BLOCK, **damped), [1]).parts[0].system.rayleigh_stiffness
        for damped in given
    )
    assert one == pytest.approx(other, rel=1e-9)
    assert one > 0.0
