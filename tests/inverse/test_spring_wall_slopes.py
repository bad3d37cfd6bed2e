"""The stiffness of the wall of a bar: derivatives against OC-6's, and what identifies it."""

import math

import pytest
from scipy.optimize import brentq

import impactfem
from impactfem import Scene, SceneError


def scene(of, kappa=4.0, **more):
    measures = [{"name": f"m{k}", "of": name} for k, name in enumerate(of)]
    return Scene.from_dict({
        "title": "spring wall", "duration": 4.0,
        "body": [{"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
                  "gap": 0.513, "velocity": "-v"}],
        "obstacle": [{"kind": "wall"}],
        "contact": [{"between": ["bar", "wall"], "stiffness": kappa}],
        "parameter": [{"name": "k", "key": "contact.0.stiffness"},
                      {"name": "gap", "key": "body.bar.gap"}, {"name": "v", "start": 1.0}],
        "measure": measures,
        "objective": {"minimise": [{"term": "value", "of": "m0"}]},
        "solve": {"method": "galerkin", "elements": 80},
        "output": {"report": False, "pictures": False, "fields": []}, **more,
    })  # fmt: skip


def lasts(kappa):
    return 2.0 + brentq(
        lambda y: kappa * y - math.log(2 - math.exp(-2 * kappa) + 2 * kappa * y), 1e-3, 3
    )


def rise(kappa):
    most = 1.0 - math.exp(-2.0 * kappa)
    return -0.5 * kappa * most / math.log(1.0 - 0.5 * most)


@pytest.mark.parametrize(("of", "known"), [("duration", lasts), ("force_rise", rise)])
def test_slopes_by_the_stiffness(of, known):
    found = impactfem.gradient(scene([f"{of}.bar.wall"]))
    assert found.objective == pytest.approx(known(4.0), rel=2e-3)
    right = (known(4.0 + 1e-5) - known(4.0 - 1e-5)) / 2e-5
    assert found.gradient["k"] == pytest.approx(right, rel=2e-2)
    assert found.check.rate == pytest.approx(2.0, abs=0.2)


def test_the_rise_at_a_rigid_wall_is_refused():
    data = scene(["force_rise.bar.wall"]).to_dict() | {"contact": []}
    data["parameter"] = data["parameter"][1:]
    with pytest.raises(SceneError, match=r"measure\[0\].*jumps.*stiffness"):
        impactfem.gradient(Scene.from_dict(data))


def test_gap_speed_and_stiffness_are_identified():
    pushed = "impulse.bar.wall"
    data = scene([pushed, pushed, "duration.bar.wall", "force_rise.bar.wall"]).to_dict()
    data["measure"][0]["at"], data["measure"][1]["at"] = 1.2, 2.0
    data["solve"]["elements"] = 40
    known = impactfem.gradient(Scene.from_dict(data)).as_dict()["measures"]
    for entry in data["measure"]:
        entry |= {"value": known[entry["name"]]["values"][0], "sigma": 1e-3}
    del data["objective"]
    data["contact"][0]["stiffness"], data["body"][0]["gap"] = 4.3, 0.5
    data["parameter"][2]["start"] = 0.97
    found = impactfem.identify(Scene.from_dict(data)).as_dict()["parameters"]
    for name, truth in {"k": 4.0, "gap": 0.513, "v": 1.0}.items():
        assert found[name]["value"] == pytest.approx(truth, rel=1e-4), name
    assert found["k"]["sigma"] < 1e-3 / 0.105  # what the duration alone would leave
