"""Bodies that fall alike and never meet are told of, by the times at which their boxes overlap."""

import numpy as np
import pytest

from impactfem import Scene
from impactfem.models.solids import solids_model
from impactfem.planning.doubts import MEETS_NOTHING, doubts
from impactfem.planning.flights import flyer


def thrown(*flights, duration=1.0):
    balls = [
        {"kind": "rigid", "name": f"ball_{k}", "mass": 1.0, "velocity": list(velocity),
         "shape": {"kind": "disc", "radius": 0.1, "center": list(center)}}
        for k, (center, velocity) in enumerate(flights)
    ]  # fmt: skip
    law = {"between": ["*", "*"], "restitution": 0.5}
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, -50.0], "normal": [0.0, 1.0]}
    data = {"title": "thrown", "duration": duration, "gravity": [1.0, -9.81], "body": balls,
            "contact": [law], "obstacle": [floor]}  # fmt: skip
    return Scene.from_dict(data)


def told(scene):
    return MEETS_NOTHING in {found.code for found in doubts(scene)}


BESIDE = ((5.0, 9.0), (0.0, 0.0))


@pytest.mark.parametrize(
    ("first", "second", "duration", "lonely"),
    [
        (((0.0, 0.0), (1.0, 0.0)), ((1.0, 0.0), (-1.0, 0.0)), 1.0, False),
        (((0.0, 0.0), (1.0, 0.0)), ((1.0, 0.0), (-1.0, 0.0)), 0.399, True),  # 0.8 m at 2 m/s
        (((0.0, 0.0), (1.0, 0.0)), ((1.0, 0.0), (-1.0, 0.0)), 0.401, False),
        (((0.0, 0.0), (1.0, 0.0)), ((1.0, 0.21), (-1.0, 0.0)), 1.0, True),  # beside each other
        (((0.0, 0.0), (1.0, 0.0)), ((1.0, 1.0), (-1.0, -2.0)), 1.0, False),  # across
        (((0.0, 0.0), (1.0, 0.0)), ((1.0, 1.0), (-1.0, -9.0)), 1.0, True),  # one is past before
        (((0.0, 0.0), (-1.0, 0.0)), ((1.0, 0.0), (1.0, 0.0)), 1.0, True),  # apart
        (((0.0, 0.0), (3.0, 1.0)), ((0.2, 0.0), (3.0, 1.0)), 1.0, False),  # they touch and stay so
    ],
)
def test_flights_that_meet_are_those_of_boxes(first, second, duration, lonely):
    for order in ((BESIDE, first, second), (second, BESIDE, first)):
        assert told(thrown(*order, duration=duration)) == lonely


def test_what_may_not_meet_is_not_asked():
    scene = thrown(((0.0, 0.0), (1.0, 0.0)), ((1.0, 0.0), (-1.0, 0.0)))
    data = scene.to_dict()
    data["contact"] = [{"between": ["ball_0", "floor"]}, {"between": ["ball_1", "floor"]}]
    assert told(Scene.from_dict(data))
    assert not told(scene)


def test_random_flights_meet_where_samples_do():
    rng = np.random.default_rng(0)
    times = np.linspace(0.0, 1.0, 4001)[:, None]
    seen = []
    for _ in range(40):
        places, speeds = rng.uniform(-1.0, 1.0, (2, 2)), rng.uniform(-2.0, 2.0, (2, 2))
        apart = np.abs(places[1] - places[0] + times * (speeds[1] - speeds[0])).max(axis=1).min()
        if abs(apart - 0.2) > 1e-3:
            seen.append(apart < 0.2)
            scene = thrown(*zip(places.tolist(), speeds.tolist(), strict=True))
            assert told(scene) != seen[-1]
    assert len(set(seen)) == 2


def test_a_blow_between_samples_is_in_the_flight():
    """Its impulse moves the body, however short it is: samples saw none of it."""
    pulse = {"surface": "left", "value": ["where(abs(t - 0.2501) < 1e-5, 1e5, 0)", "0"]}
    block = {
        "kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.5,
        "shape": {"kind": "block", "size": [1.0, 1.0], "corner": [0.0, 0.0]}, "density": 1.0,
        "youngs_modulus": 1e6, "poisson_ratio": 0.3, "tractions": [pulse],
    }  # fmt: skip
    wall = {"kind": "half_space", "name": "wall", "point": [9.0, 0.0], "normal": [-1.0, 0.0]}
    data = {"title": "blow", "duration": 1.0, "body": [block], "obstacle": [wall]}
    scene = Scene.from_dict(data)
    part = solids_model(scene, [1]).parts[0]
    drives = flyer(scene, part.solid, part.system, part.outside).drives
    assert drives.known
    # 2e-5 s of 1e5 N give 1 kg a speed of 2 m/s.
    np.testing.assert_allclose(drives.at(1.0), [2.0 * 0.7499, 0.0, 0.0], rtol=2e-3, atol=1e-9)
