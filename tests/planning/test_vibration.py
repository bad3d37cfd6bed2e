"""Steps of solids that nothing strikes: as what vibrates needs them, not as waves do."""

import re

import numpy as np
import pytest

import impactfem

STRIP = {
    "name": "s", "kind": "solid", "model": "plane_strain", "mesh_size": 0.025,
    "shape": {"kind": "block", "size": [1.0, 0.05], "corner": [0.0, 0.0]},
    "density": 1000.0, "youngs_modulus": 1e8, "poisson_ratio": 0.0,
    "supports": [{"surface": "left", "kind": "fixed"}],
}  # fmt: skip
BELOW = {"name": "below", "kind": "half_space", "point": [0.0, -1.0], "normal": [0.0, 1.0]}
SWUNG = {"velocity": ["0", "0.002*x*x"]}
FORESEEN = re.compile(r"([\d.e-]+) of (?:the disp|speeds)")
TIP = {"name": "tip", "body": "s", "point": [1.0, 0.025]}


def scene(body=(), obstacle=(), solve=(), **more):
    data = {
        "title": "vibration", "duration": 1.0, "body": [STRIP | dict(body)], "probe": [TIP],
        "obstacle": [BELOW | dict(obstacle)], "solve": {"estimate": False} | dict(solve),
        "output": {"fields": []},
    }  # fmt: skip
    return impactfem.Scene.from_dict(data | more)


def errs_as_foreseen(coarse, fine, foreseen):
    """The error of second order that half the steps show, 4/3 of the difference."""
    for name, most in zip(("tip.uy", "tip.vy"), foreseen, strict=True):
        one, two = coarse[name].values, fine[name].values[::2]
        error = 4.0 / 3.0 * np.sqrt(np.mean((one - two) ** 2) / np.mean(two**2))
        assert 0.2 * most < error < 1.5 * most


@pytest.mark.slow
def test_a_strip_that_swings_takes_the_steps_of_its_vibration():
    """24 000 steps before; the error that is foreseen is the one that shorter steps show."""
    case = scene(SWUNG)
    plan = impactfem.plan(case)
    numbers, reason = plan.numbers, plan.reasons["dt"]
    assert numbers.layers < impactfem.plan(scene(SWUNG, solve={"courant": 0.5})).numbers.layers / 5
    assert "nothing is struck" in reason
    assert "offer dt" not in plan.reasons
    foreseen = [float(text) for text in FORESEEN.findall(reason)]
    coarse = impactfem.solve(case)
    fine = impactfem.solve(scene(SWUNG, solve={"dt": numbers.dt / 2}))
    errs_as_foreseen(coarse.history, fine.history, foreseen)
    # The first bending frequency of a clamped beam.
    period = float(re.search(r"slowest vibration, of ([\d.e-]+) s", reason)[1])
    expected = 2 * np.pi / (1.8751**2 * np.sqrt(1e8 * 0.05**2 / (12 * 1000.0)))
    assert period == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    "more",
    [
        {"obstacle": {"point": [0.0, -5e-4]}},  # within what it may reach
        {"obstacle": {"motion": ["0", "0.1*t"]}},
        {"body": {"tractions": [{"surface": "right", "value": ["0", "sin(20*t)"]}]}},
        {"body": {"velocity": ["-0.01", "0"]}},  # a shock
        {"body": {"supports": ()}},
        {"gravity": [[0.0, [0.0, 0.0]], [0.1, [0.0, -1.0]]]},
    ],
)
def test_what_may_be_struck_or_is_driven_keeps_the_steps_of_waves(more):
    more = dict(more)
    plan = impactfem.plan(scene(SWUNG | more.pop("body", {}), more.pop("obstacle", ()), **more))
    assert "courant = .5" in plan.reasons["dt"]


def released(**solve):
    """From a pull that ends as the run begins, as `where(t < 1e-9, ...)` says it."""
    pull = {"tractions": [{"surface": "right", "value": ["0", "where(t<1e-9, -20, 0)"]}]}
    pull |= {"shape": STRIP["shape"] | {"size": [1.0, 0.025]}, "mesh_size": 0.0125}
    return scene(pull, start="static", probe=[TIP | {"point": [1.0, 0.0125]}], solve=solve)


def test_loads_that_end_as_the_run_begins_do_not_drive():
    """Steps take means of loads: they see the release when it happens, not half a step later."""
    plan = impactfem.plan(released())
    assert "nothing is struck" in plan.reasons["dt"]
    assert plan.numbers.layers < 2000


@pytest.mark.slow
def test_a_released_strip_errs_as_foreseen():
    plan = impactfem.plan(released())
    foreseen = [float(text) for text in FORESEEN.findall(plan.reasons["dt"])]
    coarse, fine = (impactfem.solve(released(dt=plan.numbers.dt / n)).history for n in (1, 2))
    errs_as_foreseen(coarse, fine, foreseen)


def test_bodies_at_rest_take_few_steps_and_stay():
    floor = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    base = {key: value for key, value in STRIP.items() if key != "supports"}
    base |= {"shape": {"kind": "block", "size": [0.2, 0.1], "corner": [0.0, 0.0]}}
    top = base | {"name": "top", "shape": base["shape"] | {"corner": [0.0, 0.1]}}
    case = impactfem.Scene.from_dict(
        {
            "title": "rest", "duration": 0.5, "gravity": [0.0, -9.81], "start": "static",
            "body": [base, top], "obstacle": [floor], "output": {"fields": []},
            "contact": [{"between": ["s", "top"]}, {"between": ["s", "floor"]}],
            "solve": {"estimate": False},
        }
    )  # fmt: skip
    plan = impactfem.plan(case)
    assert plan.numbers.layers == 200
    assert "nothing changes" in plan.reasons["dt"]
    h = impactfem.solve(case).history
    weight = 2 * 0.2 * 0.1 * 1000.0 * 9.81
    np.testing.assert_allclose(h["force.s.floor"].values, weight, rtol=1e-9)
    assert np.ptp(h["top.y"].values) <= 1e-12


@pytest.mark.parametrize("strain", ["small", "finite"])
def test_a_solid_vibrates_without_an_obstacle(strain):
    """It was refused: the same as one with an obstacle far away."""
    body = STRIP | {"shape": STRIP["shape"] | {"size": [0.2, 0.05]}, "strain": strain}
    body |= {"velocity": ["0", "0.02*x*x"], "material": "neo_hookean"} if strain == "finite" else {}
    far = scene(body | SWUNG, duration=0.02, solve={"dt": 1e-4})
    probe = [TIP | {"point": [0.2, 0.025]}]
    data = far.to_dict() | {"probe": probe}
    alone = {key: value for key, value in data.items() if key != "obstacle"}
    one, two = (impactfem.solve(impactfem.Scene.from_dict(each)) for each in (data, alone))
    scale = np.abs(one.history["tip.uy"].values).max()
    np.testing.assert_allclose(
        two.history["tip.uy"].values, one.history["tip.uy"].values, atol=1e-10 * scale
    )
    assert not any("nothing" in f["text"] for f in two.summary["verdict"]["findings"])


def test_contact_where_none_was_foreseen_is_a_fault(monkeypatch):
    monkeypatch.setattr("impactfem.planning.vibration._FURTHEST", 0.0)
    near = {"point": [0.0, -1e-5]}
    result = impactfem.solve(scene(SWUNG | {"velocity": ["0", "-0.002*x*x"]}, near))
    faults = [f for f in result.summary["verdict"]["findings"] if f["severity"] == "fault"]
    assert any("nothing strikes" in fault["text"] for fault in faults)
