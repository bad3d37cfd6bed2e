"""Estimates of points and beams: the same whoever watches them, and about as large as the error."""

import copy
import tomllib
from dataclasses import replace

import pytest
from units import Units

from impactfem import Scene, plan, solve
from impactfem.models.vibro import vibro_model
from impactfem.runs.tracks import difference
from impactfem.runs.vibro import _integrate, _track
from impactfem.shipped import shipped_scenes

CASES = {
    "dropped_beam": {},
    "bouncing_ball": {"method": "moreau_jean", "dt": 0.01},
    "corner": {"method": "moreau_jean", "dt": 0.003},
}


def data(name, **solve):
    text = shipped_scenes()[name].read_text(encoding="utf-8")
    found = Scene.from_dict(tomllib.loads(text)).to_dict() | {"output": {"fields": []}}
    return found | {"solve": found.get("solve", {}) | solve | {"estimate": True}}


def seen(data, shift=0.0, boost=0.0):
    """The same from elsewhere, by someone who moves."""
    data = copy.deepcopy(data)
    for body in data["body"]:
        place = "position" if "position" in body else "center"
        body[place] = [x + shift for x in body[place]]
        body["velocity"] = [v + boost for v in body.get("velocity", [0.0] * len(body[place]))]
    for obstacle in data.get("obstacle", []):
        obstacle["point"] = [x + shift for x in obstacle["point"]]
        if boost:
            obstacle["motion"] = [f"{boost!r}*t" for _ in obstacle["point"]]
    return data


def claim(data):
    error = solve(Scene.from_dict(data)).summary["error"]
    return [error[name] for name in ("displacement_max", "displacement_l2", "force_l1")]


@pytest.mark.parametrize("name", [*CASES, "exact bouncing_ball"])
def test_nobody_sees_another_error(name):
    solve = CASES.get(name, {"method": "event_driven"})
    given = data(name.split()[-1], **solve)
    expected = claim(given)
    others = [Units(2.0**3, 2.0**-9, 2.0**5).scene(given), seen(given, shift=3.0)]
    if "beam" not in name:  # a moving obstacle takes another method
        others.append(seen(given, boost=1.0))
    rounding = 1e-2 if "exact" in name else 1e-6  # there the error is rounding itself
    for other in others:
        assert claim(other) == pytest.approx(expected, rel=rounding)


@pytest.mark.parametrize("name", CASES)
def test_the_estimate_is_about_the_error(name):
    scene = Scene.from_dict(data(name, **CASES[name]))
    chosen, model = plan(scene), vibro_model(scene)
    told = claim(scene.to_dict())[0]
    dt, steps = chosen.numbers.dt / 8, 8 * chosen.numbers.steps
    finer = replace(chosen, numbers=replace(chosen.numbers, dt=dt, steps=steps))
    ours, fine = (_integrate(scene, each, model) for each in (chosen, finer))
    true = difference(_track(scene, model, fine), _track(scene, model, ours), "").displacement_max
    assert 0.5 <= told / true <= 10.0
