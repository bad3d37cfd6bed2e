"""Static friction and resistance to rolling of rigid bodies on elastic solids and ends of bars."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError

GROUND = {
    "kind": "solid", "name": "ground", "model": "plane_strain", "density": 1e3, "mesh_size": 0.1,
    "youngs_modulus": 1e10, "poisson_ratio": 0.3, "contact_surfaces": ["top"],
    "shape": {"kind": "block", "size": [1.2, 0.2], "corner": [-0.2, -0.2]},
    "supports": [{"surface": "bottom", "kind": "fixed"}],
}  # fmt: skip
DEEP = GROUND | {
    "model": "3d", "mesh_size": 0.2,
    "shape": {"kind": "block", "size": [0.8, 0.4, 0.2], "corner": [-0.2, -0.2, -0.2]},
    "supports": [{"surface": "back", "kind": "fixed"}], "contact_surfaces": ["front"],
}  # fmt: skip
DISC = {"kind": "rigid", "name": "ball", "mass": 0.5, "velocity": [1.0, 0.0],
        "shape": {"kind": "disc", "radius": 0.1, "center": [0.0, 0.1]},
        "angular_velocity": -10.0}  # fmt: skip


def scene(bodies, law, duration, dt, gravity, **more):
    law = {"between": ["ball", bodies[0]["name"]], "friction_coefficient": 0.3} | law
    return Scene.from_dict(
        {"title": "laws", "duration": duration, "body": bodies, "contact": [law],
         "gravity": gravity, "output": {"fields": []},
         "solve": {"estimate": False, "dt": dt}} | more
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("method", ["conserving", "massless", "moreau_jean"])
def test_a_disc_that_rolls_on_a_solid_is_slowed(method):
    """By 2/3 g r / R; the ground rings, and what it takes is the moment's work."""
    made = scene([GROUND, DISC], {"rolling_resistance": 2e-3}, 0.3, 5e-4, [0.0, -9.81])
    history = impactfem.solve(made.with_settings({"solve.method": method})).history
    lost = 2.0 / 3.0 * 9.81 * 2e-3 / 0.1 * 0.3
    assert 1.0 - history["ball.vx"].values[-1] == pytest.approx(lost, rel=1e-2)
    work = history["friction_work"].values
    assert work[-1] == pytest.approx(-0.75 * 0.5 * (1.0 - (1.0 - lost) ** 2), rel=1e-2)
    assert np.diff(work).max() < 1e-12
    assert np.abs(history["total_energy"].values - work - 0.375).max() < 1e-5 * 0.375


def test_a_sphere_on_a_solid_rolls_and_spins_against_resistance():
    """By 5/7 g r / R along its way, and by 5/2 g s / R^2 about the normal."""
    ball = {"kind": "rigid", "name": "ball", "mass": 0.5, "velocity": [1.0, 0.0, 0.0],
            "shape": {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.0, 0.1]},
            "angular_velocity": [0.0, 10.0, 5.0]}  # fmt: skip
    law = {"rolling_resistance": 2e-3, "spinning_resistance": 1e-3}
    history = impactfem.solve(scene([DEEP, ball], law, 0.1, 5e-4, [0.0, 0.0, -9.81])).history
    assert 1.0 - history["ball.vx"].values[-1] == pytest.approx(5 / 7 * 0.1962 * 0.1, rel=2e-2)
    assert 5.0 - history["ball.wz"].values[-1] == pytest.approx(2.5 * 0.981 * 0.1, rel=2e-2)


PULLED = {"kind": "point", "name": "ball", "mass": 0.5, "position": [0.013, 0.0], "radius": 0.0,
          "force": ["0.5*9.81*0.5*t", "-0.5*9.81*min(1, t/0.3)"]}  # fmt: skip
SOFT = GROUND | {"youngs_modulus": 1e7, "rayleigh_stiffness": 3e-3}


@pytest.mark.parametrize(("static", "starts"), [(None, 0.4), (0.3, 0.6)])
def test_what_sticks_on_a_solid_breaks_away_at_the_larger_coefficient(static, starts):
    """The pull grows by half the weight a second, which comes up slowly, so that nothing rings."""
    law = {"friction_coefficient": 0.2}
    law |= {} if static is None else {"static_friction_coefficient": static}
    history = impactfem.solve(scene([SOFT, PULLED], law, 0.8, 1e-3, [0.0, 0.0])).history
    time, slip = history["time"].values, np.abs(history["slip.ball.ground"].values)
    first = time[np.flatnonzero(slip > 1e-9)[0]]
    assert first == pytest.approx(starts, abs=0.02)
    # From then on 0.2 of the weight holds it.
    gone = 9.81 * (0.25 * (0.64 - first**2) - 0.2 * (0.8 - first))
    assert history["ball.vx"].values[-1] == pytest.approx(gone, rel=0.02)


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    law = {"static_friction_coefficient": 0.4, "rolling_resistance": 2e-3}
    made = scene([GROUND, DISC | {"angular_velocity": 0.0}], law, 0.05, 5e-4, [0.0, -9.81])
    check_restart(made.with_settings({"output.checkpoint": 40}), 90, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    law = {"static_friction_coefficient": 0.4, "rolling_resistance": 2e-3}
    check_ranks(lambda: scene([GROUND, DISC], law, 0.02, 5e-4, [0.0, -9.81]), monkeypatch)


@pytest.mark.parametrize(
    ("law", "says"),
    [
        ({"restitution": 0.5}, "restitution = 0.5: ground rebounds by its own"),
        ({"tangential_restitution": 0.5}, "tangential_restitution = 0.5: ground rebounds"),
    ],
)
def test_what_has_no_sense_without_mass(law, says):
    with pytest.raises(SceneError, match=says):
        scene([GROUND, DISC], law, 1.0, 1e-3, [0.0, -9.81])


def test_elastic_bodies_have_no_such_laws_between_themselves():
    law = {"static_friction_coefficient": 0.5}
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, -1.0], "normal": [0.0, 1.0]}
    laws = [{"between": ["ground", "floor"], "friction_coefficient": 0.3} | law]
    with pytest.raises(SceneError, match="not available on ground: it is for points and rigid"):
        scene([GROUND, DISC], law, 1.0, 1e-3, [0.0, -9.81], contact=laws, obstacle=[floor])
