"""Adhesion: pull-off force, the energy it costs, restart, refusals."""

import math

import pytest
from moving_scenes import check_restart

import impactfem
from impactfem import Scene, SceneError

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
FORCE, ENERGY, MASS = 3.0, 2e-3, 0.5
POINT = {"kind": "point", "name": "ball", "mass": MASS, "position": [0.0, 1.01e-3]}
DISC = {"kind": "rigid", "name": "ball", "mass": MASS}
DISC |= {"shape": {"kind": "disc", "radius": 0.1, "center": [0.0, 0.10101]}}


def scene(body, duration, dt, law, **more):
    contact = {"between": ["ball", "floor"], "adhesion": {"force": FORCE, "energy": ENERGY}} | law
    made = {"title": "adhesion", "duration": duration, "body": [body], "obstacle": [FLOOR]}
    made |= {"contact": [contact], "output": {"fields": []}}
    return Scene.from_dict(made | {"solve": {"estimate": False, "dt": dt}} | more)


@pytest.mark.parametrize("body", [POINT, DISC])
@pytest.mark.parametrize(
    "law",
    [
        {"restitution": 1.0},
        {"restitution": 0.5, "friction_coefficient": 0.3},
        {"stiffness": 1e6, "stiffness_exponent": 1.5},
    ],
)
def test_parting_costs_its_energy(body, law):
    lasts = 0.02 if "stiffness" in law else 3e-3
    run = impactfem.solve(scene(body | {"velocity": [0.0, -1.0]}, lasts, 1e-5, law))
    speed = run.history["ball.vy"].values[-1]
    kept = law.get("restitution", 1.0)
    assert speed == pytest.approx(math.sqrt(kept**2 - 2.0 * ENERGY / MASS), rel=1e-9)
    energy = run.summary["energy"]
    assert energy["taken"]["adhesion"] == pytest.approx(ENERGY, rel=1e-9)
    assert abs(energy["unexplained"]) < 1e-12
    assert run.history["contact_force"].values.min() == pytest.approx(-FORCE, rel=1e-12)


def test_a_force_that_grows_slowly():
    """It lifts what adheres once it has reached the pull-off force, and parts it after W / F."""
    body = POINT | {"position": [0.0, 0.0], "force": ["0", "10*t"]}
    run = impactfem.solve(scene(body, 0.4, 1e-4, {}))
    lifted = run.history["ball.y"].values > 1e-12
    at = run.history["time"].values[lifted.argmax()]
    assert at == pytest.approx(FORCE / 10.0, abs=2.1e-4)
    assert run.history["contact_force"].values.min() == pytest.approx(-FORCE, rel=1e-12)
    assert run.summary["energy"]["taken"]["adhesion"] == pytest.approx(ENERGY, rel=1e-9)


def test_restart(tmp_path, monkeypatch):
    body = POINT | {"velocity": [0.0, -1.0]}
    output = {"fields": [], "checkpoint": 1}
    made = scene(body, 3e-3, 1e-5, {"restitution": 1.0}, output=output)
    check_restart(made, 140, tmp_path, monkeypatch)  # amid the bond


def test_bad_input():
    with pytest.raises(SceneError, match=r"adhesion.*force"):
        scene(POINT, 1e-3, 1e-5, {"adhesion": {"force": -1.0, "energy": 1.0}})
    block = DISC | {"shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.0, 0.1]}}
    with pytest.raises(SceneError, match=r"adhesion.*many places"):
        scene(block, 1e-3, 1e-5, {})
    with pytest.raises(SceneError, match=r"event_driven.*adhesion"):
        scene(POINT, 1e-3, 1e-5, {}, solve={"method": "event_driven"})
