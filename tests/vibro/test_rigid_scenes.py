"""One rigid body of a scene by methods that do not march: events located, positions projected."""

import numpy as np
import pytest

import impactfem
from impactfem import SceneError
from impactfem.report.space_picture import skin_of

G = 9.81


def dropped(shape, method="event_driven", law=None, **more):
    """A body before a floor, in the plane or in space as its shape is."""
    settings, space = more.pop("solve", {}), shape["kind"] in {"sphere", "cylinder", "capsule"}
    space = space or len(shape.get("size", ())) == 3
    up = [0.0, 0.0, 1.0] if space else [0.0, 1.0]
    body = {"kind": "rigid", "name": "body", "shape": shape, "mass": 2.0} | more
    return impactfem.Scene.from_dict({
        "title": "dropped", "duration": settings.pop("duration", 1.0),
        "gravity": [-G * each for each in up], "body": [body],
        "obstacle": [
            {"kind": "half_space", "name": "floor", "point": [0.0] * len(up), "normal": up}
        ],
        "contact": [{"between": ["body", "floor"], **(law or {})}],
        "solve": {"method": method, "estimate": False} | settings, "output": {"fields": []},
    })  # fmt: skip


def test_spinning_disc_bounces_as_the_series_has_it():
    scene = dropped(
        {"kind": "disc", "radius": 0.1, "center": [0.0, 0.6]}, law={"restitution": 0.5},
        velocity=[1.0, 0.0], angular_velocity=7.0,
    )  # fmt: skip
    result = impactfem.solve(scene)
    fall = np.sqrt(1.0 / G)
    times = fall * (1.0 + 2.0 * np.cumsum(0.5 ** np.arange(1, 9)))
    assert result.impacts.time[:9] == pytest.approx([fall, *times], abs=1e-13)
    assert result.history["body.x"].values[-1] == pytest.approx(1.0, abs=1e-13)
    assert result.history["body.angle"].values[-1] == pytest.approx(7.0, abs=1e-13)
    assert result.history["total_energy"].values[0] == pytest.approx(1.0 + 0.5 * 0.01 * 49.0)


def test_disc_slides_then_rolls_and_friction_takes_the_rest():
    law = {"friction_coefficient": 0.2}
    scene = dropped(
        {"kind": "disc", "radius": 0.1, "center": [0.0, 0.1]}, law=law, velocity=[3.0, 0.0]
    )
    result = impactfem.solve(scene)
    changes = result.summary["details"]["friction_changes"]
    assert [what for _, _, what in changes] == ["slides", "sticks"]
    assert changes[1][0] == pytest.approx(1.0 / (0.2 * G), abs=1e-12)
    history = result.history
    assert history["body.vx"].values[-1] == pytest.approx(2.0, abs=1e-12)
    assert history["body.spin"].values[-1] == pytest.approx(-20.0, abs=1e-11)
    lost = history["total_energy"].values - history["total_energy"].values[0]
    assert history["friction_work"].values == pytest.approx(lost, abs=1e-10)
    assert lost[-1] == pytest.approx(-3.0, abs=1e-11)


def tumbling(method, **solve):
    half = [-0.1, -0.2, 0.7]
    return impactfem.solve(
        dropped(
            {"kind": "block", "size": [0.2, 0.4, 0.6], "corner": half}, method,
            law={"restitution": 0.5}, velocity=[0.3, 0.0, 0.0], angular_velocity=[0.0, 1.0, 3.0],
            orientation={"axis": [1.0, 0.5, 0.0], "angle": 0.4}, solve={"duration": 0.5, **solve},
        )
    )  # fmt: skip


@pytest.mark.slow
def test_tumbling_block_is_that_of_the_march():
    """All coordinates after an impact on a corner, angular momentum before and after it."""
    exact = tumbling("event_driven")
    columns = ["body.z", "body.vz", *(f"body.q{k}" for k in "wxyz"), *(f"body.w{k}" for k in "xyz")]
    end = np.array([exact.history[name].values[-1] for name in columns])
    errors = {}
    for method in ("moreau_jean", "paoli_schatzman"):
        for dt in (2e-3, 5e-4):
            found = tumbling(method, dt=dt)
            last = np.array([found.history[name].values[-1] for name in columns])
            errors[method, dt] = np.abs(last - end).max()
    assert errors["moreau_jean", 5e-4] < 0.02
    assert errors["paoli_schatzman", 5e-4] < 0.3
    assert 2.0 < errors["paoli_schatzman", 2e-3] / errors["paoli_schatzman", 5e-4] < 8.0
    time, history = exact.history["time"].values, exact.history
    strike = exact.impacts.time[0]
    spun = np.stack([history[f"angular_momentum.{k}"].values for k in "xyz"], axis=1)
    weight = -2.0 * G * 0.3 * time**2 / 2.0  # of x = 0.3 t
    spun[:, 1] += weight
    before = time < strike
    assert np.ptp(spun[before], axis=0) == pytest.approx(0.0, abs=1e-8)
    assert np.ptp(spun[~before], axis=0) == pytest.approx(0.0, abs=1e-8)
    energy = history["total_energy"].values
    assert np.ptp(energy[before]) < 1e-8
    assert np.ptp(energy[~before]) < 1e-8


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"method": "paoli_schatzman", "law": {"friction_coefficient": 0.2}},
            r"event_driven in the",
        ),
        ({"law": {"rolling_resistance": 0.1, "friction_coefficient": 1.0}}, "rolling_resistance"),
        ({"law": {"restitution": 0.5, "restitution_law": "poisson"}}, "with Newton's"),
        ({"force": ["1", "0"]}, "under its weight"),
    ],
)
def test_what_they_do_not_know_is_refused(change, message):
    with pytest.raises(SceneError, match=message):
        dropped({"kind": "disc", "radius": 0.1, "center": [0.0, 0.6]}, **change)


def test_rims_and_friction_in_space_are_refused():
    rims = {"kind": "cylinder", "radius": 0.1, "height": 0.3, "center": [0.0, 0.0, 1.0]}
    with pytest.raises(SceneError, match=r"no rims: use solve.method = .moreau_jean"):
        dropped(rims)
    ball = {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.0, 1.0]}
    with pytest.raises(SceneError, match=r"friction_coefficient = 0\.2"):
        dropped(ball, law={"friction_coefficient": 0.2})


def test_pictures_have_no_colours_of_stresses_that_there_are_none_of():
    scene = dropped({"kind": "disc", "radius": 0.1, "center": [0.0, 0.6]}).with_settings(
        {"output.fields": ["vtkhdf"], "duration": 0.1}
    )
    result = impactfem.solve(scene)
    assert not skin_of(result, result.fields).is_stressed.any()
