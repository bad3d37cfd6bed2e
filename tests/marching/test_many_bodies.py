"""Answers of bodies apart, kept sparse, are those of the full matrices; obstacles asked at once."""

import numpy as np
import pytest
from moving_scenes import alone, differences, stopping

import impactfem
from impactfem import Scene
from impactfem.contact import pair_responses

BOX = [
    {"kind": "half_space", "name": name, "point": point, "normal": normal}
    for name, point, normal in (
        ("floor", [0.0, 0.0], [0.0, 1.0]), ("left", [0.0, 0.0], [1.0, 0.0]),
        ("right", [0.76, 0.0], [-1.0, 0.0]),
    )
]  # fmt: skip


def grains(count=6, **more):
    places = [[0.12 + 0.22 * (k % 3) + 0.01 * k, 0.101 + 0.23 * (k // 3)] for k in range(count)]
    bodies = [
        {"kind": "rigid", "name": f"grain_{k}", "mass": 1.0 + k, "angular_velocity": 3.0 * k,
         "shape": {"kind": "disc", "radius": 0.1, "center": place}}
        for k, place in enumerate(places)
    ]  # fmt: skip
    data = {
        "title": "grains", "duration": 0.4, "gravity": [0.0, -9.81], "body": bodies,
        "obstacle": BOX, "contact": [{"between": ["*", "*"], "friction_coefficient": 0.4}],
        "solve": {"dt": 2e-3, "estimate": False}, "output": {"fields": []},
    }  # fmt: skip
    return Scene.from_dict(data | more)


def beside_a_solid():
    """Answers of the solid are found once and stay, those of grains that turn are asked anew."""
    plate = {
        "kind": "solid", "name": "plate", "model": "plane_strain", "mesh_size": 0.1, "degree": 1,
        "shape": {"kind": "block", "size": [0.7, 0.2], "corner": [0.03, 0.0]}, "density": 1e3,
        "youngs_modulus": 1e6, "poisson_ratio": 0.3,
        "supports": [{"surface": "bottom", "kind": "fixed"}],
    }  # fmt: skip
    whole = grains(3, duration=0.1).to_dict()
    for body in whole["body"]:
        body["shape"]["center"][1] += 0.2
        body["angular_velocity"] = 0.0
    return Scene.from_dict(whole | {"body": [plate, *whole["body"]], "obstacle": BOX[1:],
                                    "contact": [{"between": ["plate", "grain_*"]},
                                                {"between": ["grain_*", "*"],
                                                 "friction_coefficient": 0.4}]})  # fmt: skip


@pytest.mark.parametrize("made", [grains, beside_a_solid])
def test_sparse_answers_are_the_full_ones(made, monkeypatch):
    full = impactfem.solve(made()).history
    monkeypatch.setattr(pair_responses, "_MANY", 0)
    sparse = impactfem.solve(made()).history
    assert full["contact_force"].values.max() > 10.0
    # A grain wedged between floor and wall has forces that change no motion: these may differ.
    for name in (name for name in full.data_vars if name.startswith(("grain", "total", "plate"))):
        one, two = full[name].values, sparse[name].values
        size = np.nanmax(np.abs(one), initial=1.0)
        np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-9 * size, err_msg=name)


def test_a_restart_with_sparse_answers_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(pair_responses, "_MANY", 0)
    made = grains().with_settings({"output.checkpoint": 50})
    whole = impactfem.solve(made)
    with stopping(monkeypatch, 140):
        impactfem.solve(made, checkpoints=tmp_path)
    again = impactfem.solve(made, checkpoints=tmp_path, restart=tmp_path)
    assert differences(whole, again) == {}


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    monkeypatch.setattr(pair_responses, "_MANY", 0)
    both = impactfem.solve(beside_a_solid())
    with alone(monkeypatch):
        one = impactfem.solve(beside_a_solid())
    found = differences(both, one)
    assert all(apart < 1e-9 for apart in found.values()), found
