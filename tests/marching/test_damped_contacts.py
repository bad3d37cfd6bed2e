"""Contacts with a stiffness and a damping: rebound by an own integration, energy, refusals."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart
from scipy.integrate import solve_ivp

import impactfem
from impactfem import Scene, SceneError

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
LAWS = [
    ("kelvin_voigt", 1.0, 200.0),
    ("kelvin_voigt", 1.5, 50.0),
    ("hunt_crossley", 1.0, 2.0),
    ("hunt_crossley", 1.5, 0.3),
]
K, MASS = 1e6, 0.5


def rebound(law, p, c):
    """How long a mass thrown at 1 m/s is pressed, and its speed then."""

    def force(d, w):
        drawn = K * max(d, 0.0) ** p
        return drawn * (1.0 + c * w) if law == "hunt_crossley" else drawn + c * w

    def ends(t, y):
        return min(force(*y), y[0] + 1e-13) if t > 0.0 else 1.0

    ends.terminal = True
    found = solve_ivp(
        lambda _, y: [y[1], -force(*y) / MASS], (0.0, 1.0), [0.0, 1.0], events=ends,
        rtol=1e-13, atol=1e-17, method="DOP853",
    )  # fmt: skip
    return found.t[-1], -found.y[1, -1]


def scene(law, p, c, duration, dt, body=None, obstacles=(FLOOR,), **more):
    ball = {"kind": "point", "name": "ball", "mass": MASS, "velocity": [0.0, -1.0]}
    ball |= {"position": [0.0, 1.3e-6]}
    contact = {"between": ["ball", "floor"], "stiffness": K, "stiffness_exponent": p}
    contact |= {"damping": c, "damping_law": law}
    return Scene.from_dict(
        {"title": "damped", "duration": duration, "body": [body or ball], "output": {"fields": []},
         "obstacle": list(obstacles), "contact": [contact | more.pop("contact", {})],
         "solve": {"estimate": False} | ({"dt": dt} if dt else {}) | more.pop("solve", {})} | more
    )  # fmt: skip


@pytest.mark.parametrize(("law", "p", "c"), LAWS)
def test_rebound_of_a_damped_contact(law, p, c):
    """Second order, so that two runs tell the speed to 1e-8; energy lost is told to rounding."""
    lasts, speed = rebound(law, p, c)
    ends = []
    for steps in (600, 1200):
        run = impactfem.solve(scene(law, p, c, 1.2 * lasts, lasts / steps))
        ends.append(run.history["ball.vy"].values[-1] - speed)
        lost = run.history["dissipated_energy"].values
        told = run.summary["energy"]["taken"]["contacts that give way"]
        assert told == pytest.approx(lost[-1], rel=1e-10)
        assert lost[-1] == pytest.approx(0.5 * MASS * (1.0 - (speed + ends[-1]) ** 2), rel=1e-10)
        assert np.diff(lost).min() > -1e-13
        assert run.history["contact_force"].values.min() >= 0.0
        assert abs(ends[-1]) < 1.0 / steps**2
    if law == "hunt_crossley":  # no kink where it ends: the error is smooth in the step
        assert abs((4.0 * ends[1] - ends[0]) / 3.0) < 1e-8


def test_rubbing_and_moving_bodies():
    """With friction: its force stays below mu times the whole normal force; two bodies alike."""
    ball = {"kind": "rigid", "name": "ball", "mass": MASS, "velocity": [0.7, -1.0]}
    ball |= {"shape": {"kind": "disc", "radius": 0.1, "center": [0.0, 0.1 + 1.3e-6]}}
    lasts, speed = rebound("kelvin_voigt", 1.0, 200.0)
    run = impactfem.solve(
        scene("kelvin_voigt", 1.0, 200.0, 1.2 * lasts, lasts / 500, ball,
              contact={"friction_coefficient": 0.1})
    )  # fmt: skip
    vx, vy, spin = (run.history[f"ball.{name}"].values[-1] for name in ("vx", "vy", "spin"))
    assert vy == pytest.approx(speed, abs=4e-6)
    assert 0.7 - vx == pytest.approx(0.1 * (1.0 + vy), rel=1e-9)  # it slips all the time
    assert -spin * 0.1**2 / 2.0 == pytest.approx(0.1 * (0.7 - vx), rel=1e-9)
    energy = run.summary["energy"]
    assert abs(energy["unexplained"]) < 1e-12
    one, two = ball | {"velocity": [0.0, -1.0]}, ball | {"name": "other", "velocity": [0.0, 0.0]}
    two = two | {"shape": two["shape"] | {"center": [0.0, -0.1]}}
    contact = {"between": ["ball", "other"], "stiffness": 0.5 * K, "damping": 100.0}
    made = {"title": "two", "duration": 1.2 * lasts, "body": [one, two], "contact": [contact]}
    made |= {"solve": {"estimate": False, "dt": lasts / 500}, "output": {"fields": []}}
    pair = impactfem.solve(Scene.from_dict(made))
    history = pair.history
    apart = history["ball.vy"].values[-1] - history["other.vy"].values[-1]
    assert apart == pytest.approx(speed, abs=4e-6)
    assert np.ptp(history["momentum.y"].values) < 1e-14


@pytest.mark.parametrize(("law", "p", "c"), LAWS[::3])
def test_steps_that_are_iterated(law, p, c):
    """Beside a plate that stretches, steps are Newton's: the same rebound, energy to rounding."""
    lasts, speed = rebound(law, p, c)
    plate = {"kind": "plate", "name": "plate", "outline": {"kind": "rectangle", "size": [0.2, 0.2]}}
    plate |= {"thickness": 0.01, "center": [0.0, 1.0, 0.0], "normal": [0.0, 1.0, 0.0]}
    plate |= {"mesh_size": 0.1, "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3}
    plate |= {"membrane": "von_karman", "supports": [{"edge": "left", "kind": "clamped"}]}
    ball = {"kind": "point", "name": "ball", "mass": MASS, "velocity": [0.0, -1.0, 0.0]}
    ball |= {"position": [0.0, 1.3e-6, 0.0]}
    floor = FLOOR | {"point": [0.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]}
    contact = {"between": ["ball", "floor"], "stiffness": K, "stiffness_exponent": p}
    contact |= {"damping": c, "damping_law": law}
    plain = {"between": ["plate", "floor"], "stiffness": 1e9}
    plain_too = {"between": ["plate", "ball"], "stiffness": 1e6}
    made = {"title": "iterated", "duration": 1.2 * lasts, "body": [plate, ball]}
    made |= {"obstacle": [floor], "contact": [contact, plain, plain_too]}
    made |= {"solve": {"estimate": False, "dt": lasts / 100}, "output": {"fields": []}}
    run = impactfem.solve(Scene.from_dict(made))
    assert run.history["ball.vy"].values[-1] == pytest.approx(speed, abs=2e-4)
    lost = run.history["dissipated_energy"].values[-1]
    told = run.summary["energy"]["taken"]["contacts that give way"]
    assert told == pytest.approx(lost, rel=1e-9)


def test_restart_and_ranks(tmp_path, monkeypatch):
    lasts, _ = rebound("kelvin_voigt", 1.5, 50.0)

    def made():
        output = {"fields": [], "checkpoint": 1}
        return scene("kelvin_voigt", 1.5, 50.0, 1.2 * lasts, lasts / 40, output=output)

    check_restart(made(), 20, tmp_path, monkeypatch)
    check_ranks(made, monkeypatch)


@pytest.mark.parametrize(
    ("contact", "message"),
    [
        ({"stiffness": None, "stiffness_exponent": 1.0}, "damping = 50.*stiffness"),
        ({"damping": 0.0, "damping_law": "hunt_crossley"}, "damping_law"),
        ({"damping": -1.0}, "damping = -1"),
        ({"damping_law": "maxwell"}, "damping_law.*kelvin_voigt"),
        ({"restitution": 0.5}, "restitution.*damping"),
    ],
)
def test_bad_input(contact, message):
    with pytest.raises(SceneError, match=message):
        scene("kelvin_voigt", 1.0, 50.0, 1e-2, None, contact=contact)
