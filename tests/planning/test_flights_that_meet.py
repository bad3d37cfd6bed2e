"""Bodies that fall alike and never meet are told of, by the times at which their boxes overlap."""

import numpy as np
import pytest

from impactfem import Scene
from impactfem.planning.doubts import MEETS_NOTHING, doubts


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
