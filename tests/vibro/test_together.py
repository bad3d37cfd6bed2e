"""Warnings where coupled constraints are struck together."""

import warnings

import numpy as np
import pytest

from impactfem import ImpactWarning, SceneError, integrate
from impactfem.systems import LinearSystem

METHODS = {"event_driven": {}, "paoli_schatzman": {"dt": 1e-3}, "moreau_jean": {"dt": 1e-3}}


def row_of_balls(masses, **more):
    """Masses on a line above a floor at 0, each one unit above the one below."""
    count = len(masses)
    normals = np.eye(count) - np.eye(count, k=-1)
    return LinearSystem(
        mass=masses, normals=normals, offsets=[0.0] + [-1.0] * (count - 1),
        load=[-9.81 * m for m in masses], **more,
    )  # fmt: skip


@pytest.mark.parametrize(("method", "settings"), METHODS.items())
def test_balls_that_rest_on_each_other_are_no_event(method, settings):
    with warnings.catch_warnings():
        warnings.simplefilter("error", ImpactWarning)
        motion = integrate(
            row_of_balls([1.0, 1e3, 1.0]),
            [0.0, 1.0, 2.0],
            [0.0] * 3,
            0.1,
            method=method,
            **settings,
        )
    assert np.abs(motion.position[-1] - [0.0, 1.0, 2.0]).max() < 1e-9


@pytest.mark.parametrize(("method", "settings"), METHODS.items())
def test_ball_that_falls_on_a_resting_one_is(method, settings):
    with pytest.warns(ImpactWarning, match="0 and 1|1 and 0"):
        motion = integrate(
            row_of_balls([1.0, 1.0]), [0.0, 1.2], [0.0] * 2, 0.3, method=method, **settings
        )
    found = motion.effort.details["together"]
    assert found["time"] == pytest.approx(np.sqrt(0.4 / 9.81), abs=5e-3)
    # M = I, normals (1, 0) and (-1, 1): their corner has 45 degrees.
    assert found["angle"] == pytest.approx(np.pi / 4)


@pytest.mark.parametrize("method", ["paoli_schatzman", "moreau_jean"])
def test_a_step_longer_than_the_motion_is_refused(method):
    with pytest.raises(SceneError, match="dt = 10 exceeds duration = 1"):
        integrate(row_of_balls([1.0]), [1.0], [0.0], 1.0, method=method, dt=10)
