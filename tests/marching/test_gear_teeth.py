"""Wheels whose teeth are shapes of rigid bodies keep the ratio of their turns to the backlash."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene

_MODULE, _PLAY = 0.02, 0.1  # pitch diameter by teeth [m]; share of a pitch that teeth are thinner


def wheel(teeth, x, first):
    """Hulls of a toothed wheel about (x, 0), its first tooth at an angle [rad]."""
    pitch = 0.5 * _MODULE * teeth
    half = 0.25 * np.pi * _MODULE * (1.0 - _PLAY)
    radii = pitch + np.array([-0.016, 0.0, 0.012])
    halves = half + np.array([0.003, 0.0, -0.006])
    found = []
    for k in range(teeth):
        angle = first + 2.0 * np.pi * k / teeth
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        side = np.stack([radii, halves], axis=1)
        points = np.vstack([side, side[::-1] * [1.0, -1.0]]) @ turn.T + [x, 0.0]
        found.append({"kind": "hull", "points": points.tolist()})
    return found


@pytest.mark.slow
def test_teeth_roll_on_each_other():
    """Eight teeth drive twelve against a brake for half a turn: N1 q1 + N2 q2 = 0 to the play."""
    few, many = 8, 12
    apart = 0.5 * _MODULE * (few + many)
    bodies = [
        {
            "kind": "rigid",
            "name": name,
            "mass": 1.0,
            "inertia": 1e-3 * size,
            "center_of_mass": [x, 0.0],
            "shapes": wheel(teeth, x, first),
        }
        for name, teeth, x, first, size in (
            ("one", few, 0.0, 0.0, 1.0),
            ("two", many, apart, np.pi * (1.0 + 1.0 / many), 5.0),
        )
    ]
    joint = {"kind": "revolute"}
    scene = {
        "title": "gears",
        "duration": 1.0,
        "body": bodies,
        "joint": [
            joint
            | {
                "name": "a",
                "between": ["ground", "one"],
                "point": [0.0, 0.0],
                "motor": "0.1*(4-v)",
            },
            joint
            | {"name": "b", "between": ["ground", "two"], "point": [apart, 0.0], "damping": 0.02},
        ],
        "contact": [{"between": ["one", "two"]}],
        "solve": {"dt": 2e-3, "estimate": False},
        "output": {"fields": []},
    }
    history = impactfem.solve(Scene.from_dict(scene)).history
    one, two = history["a.q"].values, history["b.q"].values
    assert one[-1] > np.pi
    # Half a play to either side, and straight flanks, which are not conjugate: a tenth of a pitch.
    assert np.abs(few * one + many * two).max() < 2.0 * np.pi * (0.5 * _PLAY + 0.1)
    rates = history["a.v"].values[100:].mean() / history["b.v"].values[100:].mean()
    assert rates == pytest.approx(-many / few, rel=0.02)
