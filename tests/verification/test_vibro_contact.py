"""Points: impacts have impulses, lasting contact has forces, walls with a kick strike."""

import math

import numpy as np
import pytest

from impactfem import Scene, solve
from impactfem.report.table import summary_rows

G, MASS = 9.81, 2.0
STEPPED = ("paoli_schatzman", "moreau_jean")


def ball(method, dt, *, e=0.5, g=G, height=1.0, speed=0.0, motion="0", duration=2.0, **settings):
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    point = {"kind": "point", "name": "ball", "mass": MASS, "position": [0.0, height]}
    return solve(Scene.from_dict({
        "title": "ball", "duration": duration, "gravity": [0.0, -g],
        "body": [point | {"velocity": [0.0, speed]}],
        "obstacle": [floor | {"motion": ["0", motion]}],
        "contact": [{"between": ["ball", "floor"], "restitution": e}],
        "solve": {"method": method, "dt": dt, **settings},
    }))  # fmt: skip


@pytest.mark.parametrize("dt", [1e-2, 1e-3])
def test_force_and_impulse_of_a_bouncing_ball_do_not_depend_on_the_rows(dt):
    result = ball("event_driven", dt)
    contact, history = result.summary["contact"], result.history
    strike = 1.5 * MASS * math.sqrt(2.0 * G)
    assert contact["max_force"] == pytest.approx(MASS * G, rel=1e-12)
    assert contact["max_impulse"] == pytest.approx(strike, rel=1e-12)
    assert contact["impulse"] == pytest.approx(MASS * G * 2.0, rel=1e-12)
    assert contact["force_window"] == 0.0
    assert float(history["contact_force"].max()) == pytest.approx(MASS * G, rel=1e-12)
    assert float(history["contact_impulse"].max()) == pytest.approx(strike, rel=1e-12)
    both = float(history["contact_force"].sum() * dt + history["contact_impulse"].sum())
    assert both == pytest.approx(contact["impulse"], rel=1e-12)


def test_energy_that_ends_at_nothing_is_told_as_what_impacts_took():
    result = ball("event_driven", 1e-2)
    energy = result.summary["energy"]
    assert energy["taken"]["impacts"] == pytest.approx(MASS * G, rel=1e-12)
    assert abs(energy["unexplained"]) < 1e-12
    assert (
        "impacts took 19.62 J, otherwise changed by" in dict(summary_rows(result.summary))["energy"]
    )


def test_a_ball_that_only_bounces_has_no_force():
    contact = ball("event_driven", 1e-2, e=1.0, g=0.0, speed=-1.0).summary["contact"]
    assert contact["max_force"] is None
    assert contact["unknown"] == []
    assert contact["max_impulse"] == pytest.approx(2.0 * MASS)


@pytest.mark.parametrize("dt", [0.2, 1e-2])
def test_the_largest_force_is_that_of_an_instant(dt):
    # The table presses most at its lowest point, between rows.
    result = ball("event_driven", dt, e=0.0, height=0.0, speed=0.3, motion="0.1*sin(3*t)")
    assert result.summary["contact"]["max_force"] == pytest.approx(MASS * (G + 0.9), rel=1e-6)


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("dt", [4e-3, 1e-3])
def test_steps_tell_impacts_from_lasting_contact(method, dt):
    result = ball(method, dt, e=0.0, duration=1.0)
    contact = result.summary["contact"]
    assert contact["max_force"] == pytest.approx(MASS * G, rel=1e-6)
    assert contact["max_impulse"] == pytest.approx(MASS * math.sqrt(2.0 * G), rel=2e-2)
    assert contact["impulse"] == pytest.approx(MASS * G, rel=1e-3)
    assert float(result.history["contact_force"].max()) <= MASS * G * (1.0 + 1e-6)


def test_figures_that_depend_on_the_step_are_null_with_the_reason():
    result = ball("moreau_jean", 1e-3)  # the end of its bounces
    contact = result.summary["contact"]
    notes = [f for f in result.summary["verdict"]["findings"] if f["code"] == "force_peak"]
    assert contact["max_force"] is None
    assert contact["unknown"] == ["max_force"] == [note["subject"] for note in notes]
    assert "depends on the step" in notes[0]["text"]
    alone = ball("moreau_jean", 1e-2, e=0.0, estimate=False).summary["contact"]
    assert (alone["max_force"], alone["max_impulse"]) == (None, None)


@pytest.mark.parametrize("method", ["event_driven", *STEPPED])
@pytest.mark.parametrize("dt", [1e-3, 0.7e-3])  # the kick at the end of a step, and inside one
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_wall_that_starts_at_once_strikes_what_lies_on_it(method, dt, e):
    kick = "where(t < 0.3, 0, 2*(t - 0.3))"
    result = ball(method, dt, e=e, g=0.0, height=0.0, motion=kick, duration=0.4, estimate=False)
    exact = 2.0 * (1.0 + e)
    assert float(result.history["ball.vy"][-1]) == pytest.approx(exact, rel=1e-8)
    assert float(result.history["ball.y"][-1]) == pytest.approx(0.1 * exact, abs=3.0 * exact * dt)
    assert result.impacts.before[0] == pytest.approx(-2.0, rel=1e-8)
    assert result.impacts.impulse[0] == pytest.approx(MASS * exact, rel=1e-8)
    located = 1e-12 if method == "event_driven" else dt
    assert result.impacts.time[0] == pytest.approx(0.3, abs=located)


def test_positions_know_when_within_a_step_a_wall_starts():
    """The scheme's delay of two steps is all that the motion after it is late by."""
    dt, e, c = 1e-3, 0.5, 2.0
    for begins in (0.3001, 0.3002, 0.3003):
        kick = f"where(t < {begins}, 0, {c}*(t - {begins}))"
        result = ball("paoli_schatzman", dt, e=e, g=0.0, height=0.0, motion=kick, duration=0.4,
                      estimate=False)  # fmt: skip
        late = c * (0.4 - begins) + e * c * (0.4 - begins - 2.0 * dt)
        assert float(result.history["ball.y"][-1]) == pytest.approx(late, abs=1e-12)


@pytest.mark.parametrize("method", ["event_driven", "paoli_schatzman", "moreau_jean"])
def test_a_wall_that_leaves_at_once_lets_go(method):
    gone = "where(t < 0.2, 0, -2*(t - 0.2))"
    result = ball(method, 1e-3, height=0.0, motion=gone, duration=0.3, estimate=False)
    assert float(result.history["ball.vy"][-1]) == pytest.approx(-0.1 * G, rel=2e-2)
    assert len(result.impacts) == 0


def test_a_wall_that_jumps_far_away_is_met_at_the_right_time():
    # It turns round at t = 0.25 in the air, and is met on its way up.
    result = ball("event_driven", 1e-2, e=1.0, g=0.0, height=0.3, motion="abs(t - 0.25) - 0.25",
                  duration=1.0)  # fmt: skip
    assert result.impacts.time == pytest.approx([0.8], abs=1e-12)
    assert float(result.history["ball.vy"][-1]) == pytest.approx(2.0)
    assert np.isfinite(result.history["ball.y"]).all()
