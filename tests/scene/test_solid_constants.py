"""Constants of the laws of solids."""

import pytest

from impactfem import Scene, SceneError, Solid

MOONEY = {"c10": 1.2e5, "c01": 0.4e5, "bulk_modulus": 2e6}


def solid(**given):
    shape = {"kind": "disc", "radius": 0.5}
    return Solid(model="plane_strain", shape=shape, mesh_size=0.1, density=1.0, **given)


def test_small_strains_follow_from_the_constants_of_rubber():
    rubber = solid(material="mooney_rivlin", **MOONEY)
    assert rubber.shear_modulus == pytest.approx(3.2e5, rel=1e-14)
    assert rubber.lame + 2.0 / 3.0 * rubber.shear_modulus == pytest.approx(2e6, rel=1e-14)
    assert rubber.is_finite


def test_a_scene_holds_the_constants_that_were_given():
    body = {
        "kind": "solid", "model": "plane_strain", "shape": {"kind": "disc", "radius": 0.5},
        "mesh_size": 0.1, "density": 1.0, "material": "mooney_rivlin", **MOONEY,
    }  # fmt: skip
    floor = {"kind": "half_space", "point": [0.0, -1.0], "normal": [0.0, 1.0]}
    scene = Scene.from_dict(
        {"title": "rubber", "duration": 1.0, "body": [body], "obstacle": [floor]}
    )
    assert "youngs_modulus" not in scene.to_dict()["body"][0]
    stiffer = scene.with_settings({"body.0.c10": 2.4e5}).bodies[0]
    assert stiffer.shear_modulus == pytest.approx(5.6e5)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"youngs_modulus": 1.0}, "poisson_ratio is missing"),
        ({"youngs_modulus": 1.0, "poisson_ratio": 0.3, "c10": 1.0}, "c10 = 1.0 belongs to mat"),
        ({"material": "mooney_rivlin", "c10": 1.0, "c01": 0.1}, "bulk_modulus is missing"),
        ({"material": "mooney_rivlin"} | MOONEY | {"c10": 0.0, "c01": 0.0}, "no shear modulus"),
        ({"material": "mooney_rivlin"} | MOONEY | {"bulk_modulus": 3e5}, "must exceed"),
        ({"material": "mooney_rivlin", "poisson_ratio": 0.3} | MOONEY, "contradicts c10"),
        ({"material": "mooney_rivlin", "strain": "small"} | MOONEY, "material"),
    ],
)  # fmt: skip
def test_constants_that_do_not_fit_are_refused(given, words):
    with pytest.raises(SceneError, match=words):
        solid(**given)
