"""Ensembles go member by member as single runs do."""

import numpy as np
import pytest

from impactfem.errors import SceneError
from impactfem.scene.signal import Signal
from impactfem.system.generalized import LinearSystem
from impactfem.vibro.ensemble import integrate_ensemble
from impactfem.vibro.position_level import PositionSettings, integrate_positions
from impactfem.vibro.velocity_level import VelocitySettings, integrate_velocities

METHODS = [
    (integrate_positions, PositionSettings(0.01)),
    (integrate_positions, PositionSettings(0.01, implicit=True)),
    (integrate_velocities, VelocitySettings(0.01, theta=0.6)),
]


def corner():
    return LinearSystem(
        mass=[[1.0, 0.2], [0.2, 2.0]], stiffness=[[3.0, 0.1], [0.1, 5.0]], damping=[0.1, 0.2],
        load=[Signal(harmonics=((3.0, 1.0, 0.5),)), -1.0], normals=[[0.0, 1.0], [0.87, -0.5]],
        offsets=[0.0, 0.0], restitution=[0.5, 0.7],
        motion=[Signal(harmonics=((2.0, 0.0, 0.05),)), Signal()],
    )  # fmt: skip


@pytest.mark.parametrize(("single", "choice"), METHODS)
def test_members_are_single_runs(single, choice):
    rng = np.random.default_rng(1)
    system, n = corner(), 12
    u, v = np.stack([2.0 + rng.random(n), rng.random(n)], axis=1), rng.normal(size=(n, 2))
    u[3, 1] = 0.0  # one that starts in contact
    found = integrate_ensemble(system, u, v, 4.0, choice, every=7)
    assert found.details["handed_back"] > 0 or single is integrate_velocities
    for i in range(n):
        one = single(system, u[i], v[i], 4.0, choice)
        rows = np.append(np.arange(0, 400, 7), 400)
        assert found.times == pytest.approx(one.times[rows])
        assert found.position[i] == pytest.approx(one.position[rows], abs=1e-11)
        assert found.velocity[i] == pytest.approx(one.velocity[rows], abs=1e-9)
        assert found.gap[i] == pytest.approx(one.gap[rows], abs=1e-11)
        deepest = one.effort.details["max_penetration"]
        assert found.max_penetration[i] == pytest.approx(deepest, abs=1e-11)


def test_final_states_alone_are_kept_by_default():
    found = integrate_ensemble(corner(), [[2.0, 1.0]], [[0.0, 0.0]], 1.0, PositionSettings(0.01))
    assert found.times == pytest.approx([0.0, 1.0])
    assert found.position.shape == (1, 2, 2)


def test_balls_leave_with_e_times_their_speed():
    system = LinearSystem(mass=1.0, normals=[[1.0]], offsets=[0.0], restitution=0.3)
    speeds = np.linspace(0.5, 2.0, 200)[:, None]
    heights = np.full((200, 1), 0.4)
    found = integrate_ensemble(system, heights, -speeds, 1.0, PositionSettings(1e-3))
    assert found.velocity[:, -1] == pytest.approx(0.3 * speeds)
    assert found.impulse[:, -1] == pytest.approx(1.3 * speeds)


def test_bad_members_are_named():
    with pytest.raises(SceneError, match=r"member 1: .*outside constraint 0"):
        integrate_ensemble(
            corner(), [[2.0, 1.0], [2.0, -1.0]], np.zeros((2, 2)), 1.0, PositionSettings(0.01)
        )
    with pytest.raises(SceneError, match=r"give both as \(n, 2\)"):
        integrate_ensemble(corner(), [[2.0, 1.0]], [[0.0]], 1.0, PositionSettings(0.01))
