"""Motions by formula: jumps are refused at any scale of time, changes of velocity are found."""

import numpy as np
import pytest

from impactfem.errors import SceneError
from impactfem.scene import Formula, Scene
from impactfem.scene.breaks import check_motion
from impactfem.scene.signal import Signal


def motion(text):
    return Formula(text, ("t",))


def scene(text, body="point"):
    point = {"kind": "point", "name": "ball", "mass": 2.0, "position": [0, 0], "radius": 0.0}
    solid = {
        "kind": "solid", "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0, 0.01]},
        "mesh_size": 0.05, "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
        "model": "plane_strain",
    }  # fmt: skip
    floor = {"kind": "half_space", "name": "floor", "point": [0, 0], "normal": [0, 1]}
    return Scene.from_dict({
        "title": "moving floor",
        "duration": 1.0,
        "gravity": [0.0, -9.81],
        "body": [point if body == "point" else solid],
        "obstacle": [floor | {"motion": ["0", text]}],
    })  # fmt: skip


@pytest.mark.parametrize("body", ["point", "solid"])
def test_an_obstacle_that_jumps_is_refused_with_key_time_and_remedy(body):
    with pytest.raises(SceneError) as caught:
        scene("where(t<0.3,0,2.0)", body)
    for part in ("obstacle[0].motion", '"where(t<0.3,0,2.0)"', "jumps from 0 to 2 m",
                 "t = 0.3 s", "finite time", "2*max(0, min(1, (t - 0.3)/0.01))"):  # fmt: skip
        assert part in str(caught.value)
    scene("2.0*max(0, min(1, (t - 0.3)/0.01))", body)


def test_a_support_that_jumps_is_refused():
    moved = {"surface": "top", "kind": "motion", "value": ["", "where(t < 0.2, 0, 1e-3)"]}
    data = scene("0").to_dict() | {"body": [scene("0", "solid").to_dict()["body"][0]]}
    data["body"][0]["supports"] = [moved]
    with pytest.raises(SceneError, match=r"body\[0\].supports\[0\].value.* jumps .* t = 0.2 s"):
        Scene.from_dict(data)


@pytest.mark.parametrize(
    ("text", "end", "when"),
    [
        ("where(t < 3e-9, 0, 1e-9)", 1.0, "3e-09"),  # far shorter than any sampling
        ("where(0.5 < t < 0.5 + 1e-12, 1, 0)", 1.0, "0.5"),
        ("where(t < 3e5, 0, 1)", 1e6, "300000"),
        ("where(t <= 0, 0, 1)", 1.0, "0"),
        ("5 + where(t < 1, 0, 1e-5)", 2.0, "1"),
        ("where(t < 0.3333, 3*t, 1)", 1.0, "0.3333"),
        ("where(sin(31.4*t) < 0, 0.1, 0)", 1.0, "0.100051"),
        ("2**where(t < 0.5, 1, 2)", 1.0, "0.5"),
        ("atan(1/(t - 0.31))", 1.0, "0.31"),
        ("abs(t - 0.3137)/(t - 0.3137)", 1.0, "0.3137"),
    ],
)
def test_jumps_are_found_at_every_scale(text, end, when):
    with pytest.raises(SceneError, match=f"jumps from .* t = {when} s"):
        check_motion("obstacle[0]", "motion", [motion(text)], end)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("sqrt(t)", "no finite velocity at t = 0 s"),
        ("where(t < 0.3, 0, sqrt(t - 0.3))", "no finite velocity at t = 0.3 s"),
        ("1/(t - 0.37001)**2", "no finite velocity at t = 0.37001 s"),
        ("1/(t - 0.37)", "no finite value at t = 0.37"),
        ("where(sin(2e6*t) < 0, 0, t)", "compare t with numbers"),
    ],
)
def test_other_motions_without_velocity_are_refused(text, why):
    with pytest.raises(SceneError) as caught:
        check_motion("obstacle[0]", "motion", [motion(text)], 1.0)
    assert why in str(caught.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("where(t < 0.3, 0, 2*(t - 0.3))", [(0.3, 0.0, 2.0)]),
        ("max(0, min(0.001, 0.01*(t - 0.3)))", [(0.3, 0.0, 0.01), (0.4, 0.01, 0.0)]),
        ("where(t < 0.1, t, where(t < 0.2, 0.1, 0.3 - t))", [(0.1, 1.0, 0.0), (0.2, 0.0, -1.0)]),
        ("abs(where(t < 0.3, 0, t - 0.3))", [(0.3, 0.0, 1.0)]),
        ("where(t <= 0, 0, 2*t)", [(0.0, 0.0, 2.0)]),
        ("0.01*abs(sin(pi*(t + 0.25)))", [(0.75, -0.01 * np.pi, 0.01 * np.pi)]),
        ("where(t < 0.333, 3*t, 0.999)", [(0.333, 3.0, 0.0)]),  # equal but for rounding
        ("where(t < 0.3, 0, (t - 0.3)**1.5)", [(0.3, 0.0, 0.0)]),
        ("0.1*sin(50*t) + tanh((t - 0.3)/1e-3)", []),
        ("sin(5e6*t)", []),
        ("where(t < 7, t, 0)", []),  # after the end
    ],
)
def test_changes_of_velocity_are_accepted_and_found(text, expected):
    formula = motion(text)
    check_motion("obstacle[0]", "motion", [formula], 1.0)
    found = Signal(formulas=((1.0, formula),)).kicks(1.0)
    assert len(found) == len(expected)
    for (at, before, after), (when, slow, fast) in zip(found, expected, strict=True):
        assert at.before < at.after
        assert at.before - 1e-15 <= when <= at.after + 1e-15
        assert at.after - at.before <= 1e-13 * max(when, 1e-13)
        assert (before, after) == pytest.approx((slow, fast), abs=1e-7)
