"""Springs and dampers between any two places, held to closed forms."""

import numpy as np
import pytest
from moving_scenes import alone, check_restart

from impactfem import Scene, solve
from impactfem.errors import SceneError
from impactfem.planning import plan

BLOCK = {
    "kind": "solid", "name": "block", "model": "plane_stress", "mesh_size": 0.05, "degree": 1,
    "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [0.0, 0.0]}, "density": 1000.0,
    "youngs_modulus": 1e9, "poisson_ratio": 0.3, "velocity": [0.1, 0.0], "strain": "small",
}  # fmt: skip


def scene(bodies, springs, duration, dt, **more):
    table = {
        "title": "springs", "duration": duration, "gravity": [0.0] * more.pop("dim", 2),
        "body": bodies, "spring": springs, "solve": {"dt": dt, "estimate": False},
        "output": {"fields": []},
    }  # fmt: skip
    return Scene.from_dict(table | more)


def run(*given, **more):
    return solve(scene(*given, **more)).history


def ball(name, x, mass, **more):
    return {"kind": "rigid", "name": name, "mass": mass,
            "shape": {"kind": "disc", "radius": 0.02, "center": [x, 0.0]}} | more  # fmt: skip


def damped(time, rate, share, speed):
    """Displacement of an oscillator that starts with a speed."""
    swung = rate * np.sqrt(1.0 - share**2)
    return speed / swung * np.exp(-share * rate * time) * np.sin(swung * time)


@pytest.mark.parametrize("line", [True, False])
def test_two_masses_and_a_damped_spring(line):
    one, two, k, c = 3.0, 1.0, 120.0, 2.0
    bodies = [ball("a", 0.0, one, velocity=[0.6, 0.3]), ball("b", 0.5, two)]
    spring = {"between": ["a", "b"], "stiffness": k, "damping": c, "name": "s"}
    if line:
        bodies[0]["velocity"] = [0.6, 0.0]
        spring["points"] = [[0.0, 0.0], [0.5, 0.0]]
    history = run(bodies, [spring], 2.0, 1e-3)
    time, middle = history["time"].values, one * two / (one + two)
    rate = np.sqrt(k / middle)
    for way, speed in (("x", 0.6), ("y", 0.3))[: 1 if line else 2]:
        away = history[f"b.{way}"].values - history[f"a.{way}"].values
        want = damped(time, rate, c / (2.0 * middle * rate), -speed)
        # The midpoint rule: rate (rate dt)^2 / 12, over two seconds.
        assert np.abs(away - away[0] - want).max() < 5e-4 * speed
        shown = history["s.q" if line else f"s_{way}.q"].values
        np.testing.assert_allclose(shown, away - (0.0 if line else away[0]), atol=1e-13)
    lost = sum(history[f"s{end}.lost"].values for end in ([""] if line else ["_x", "_y"]))
    energy = history["total_energy"].values
    assert np.abs(energy + lost - energy[0]).max() < 1e-12 * energy[0]
    assert lost[-1] > 0.2 * energy[0]
    assert np.ptp(history["momentum.x"].values) < 1e-13


def test_springs_turn_what_they_pull_aside():
    # A bar on two springs across its ends: it heaves with 2 k / m, and turns with 2 k b^2 / J.
    bar = {"kind": "rigid", "name": "bar", "mass": 2.0, "velocity": [0.0, 1e-3],
           "angular_velocity": 2e-2, "inertia": 0.05,
           "shape": {"kind": "block", "size": [0.4, 0.02], "corner": [-0.2, -0.01]}}  # fmt: skip
    springs = [
        {"name": f"s{k}", "between": ["ground", "bar"], "point": [x, 0.0], "stiffness": [0.0, 50.0]}
        for k, x in enumerate((-0.2, 0.2))
    ]
    history = run([bar], springs, 1.0, 1e-3)
    time, heave, pitch = history["time"].values, np.sqrt(50.0), np.sqrt(100.0 * 0.04 / 0.05)
    want = 1e-3 / heave * np.sin(heave * time)
    np.testing.assert_allclose(history["bar.y"].values, want, atol=1e-4 * 1e-3 / heave)
    want = 2e-2 / pitch * np.sin(pitch * time)
    np.testing.assert_allclose(history["bar.angle"].values, want, atol=1e-4 * 2e-2 / pitch)


@pytest.mark.parametrize("place", ["block/left", "block"])
def test_a_spring_on_a_solid_moves_it_as_a_mass(place):
    k, mass = 200.0, 20.0
    spring = {"between": [place, "ground"], "stiffness": k, "name": "s"}
    spring |= {} if "/" in place else {"point": [0.09, 0.05]}
    rate = np.sqrt(k / mass)
    period = 2.0 * np.pi / rate
    made = scene([BLOCK], [spring], period, period / 400)
    history = solve(made).history
    want = 0.1 / rate * np.sin(rate * history["time"].values)
    np.testing.assert_allclose(history["block.x"].values - 0.1, want, atol=2e-4 * 0.1 / rate)
    energy = history["total_energy"].values
    assert np.abs(energy - energy[0]).max() < 1e-9 * energy[0]
    assert "contact_force" in history
    said = {name: text for name, text in plan(made).reasons.items() if name.startswith("joint on")}
    assert len(said) == 1
    assert ("all 3 nodes" if "/" in place else "of its element") in next(iter(said.values()))


def test_a_rest_loads_the_spring_and_a_static_start_relaxes_it():
    spring = {"between": ["ground", "b"], "points": [[0.0, 0.0], [0.5, 0.0]], "name": "s"}
    spring |= {"stiffness": 100.0, "rest": 0.4}
    history = run([ball("b", 0.5, 1.0)], [spring], 0.5, 1e-3)
    assert history["elastic_energy"].values[0] == pytest.approx(0.5 * 100.0 * 0.1**2)
    np.testing.assert_allclose(
        history["s.q"].values, 0.4 + 0.1 * np.cos(10.0 * history["time"].values), atol=1e-4
    )
    spring = {"name": "s", "between": ["ground", "block/bottom"], "stiffness": [1e4, 2e4]}
    still, spring = BLOCK | {"velocity": [0.0, 0.0]}, spring | {"rest": [0.0, 0.01]}
    down = run([still], [spring], 1e-3, 1e-3, gravity=[0.0, -10.0], start="static")
    assert down["s_y.q"].values == pytest.approx(0.01 - 20.0 * 10.0 / 2e4, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"points": [[0.0, 0.0]] * 2}, "points = .* are one place"),
        ({"between": ["b", "b"]}, "is one place twice"),
        ({"between": ["ground"] * 2, "points": [[0.0, 0.0], [1.0, 0.0]]}, "is one place twice"),
        ({"stiffness": 0.0}, "a spring without either does nothing"),
        ({"stiffness": [1.0, 2.0, 3.0]}, "has 3 numbers, the bodies have 2 coordinates"),
        ({"stiffness": -1.0}, "stiffness = -1"),
        ({"between": ["ground", "c"]}, 'no body "c"'),
        ({"between": ["ground", "block"]}, "point is missing: block is a solid"),
        ({"between": ["ground", "block"], "point": [9.0, 0.0]}, "is outside of block"),
        ({"between": ["ground", "block/lft"]}, 'did you mean "left"'),
        ({"point": [0.0, 0.0], "points": [[0.0, 0.0], [1.0, 0.0]]}, "give one of them"),
        ({"name": "b"}, "name of something else"),
    ],
)  # fmt: skip
def test_springs_that_say_nothing_are_refused(change, text):
    given = {"name": "s", "between": ["ground", "b"], "stiffness": 1.0}
    with pytest.raises(SceneError, match=text):
        plan(scene([ball("b", 0.5, 1.0), BLOCK], [given | change], 0.1, 1e-3))


def mixed():
    spring = {"name": "s", "between": ["block/right", "b"], "stiffness": 1e4, "damping": 1.0}
    floor = {"kind": "half_space", "name": "floor", "point": [-0.001, 0.0], "normal": [1.0, 0.0]}
    body = BLOCK | {"velocity": [-0.5, 0.0], "youngs_modulus": 1e6}
    return scene([body, ball("b", 0.3, 1.0)], [spring], 0.03, 5e-4, obstacle=[floor],
                 output={"fields": [], "checkpoint": 10})  # fmt: skip


@pytest.mark.parallel([1, 2])
def test_restart_goes_on_to_the_last_bit(tmp_path, monkeypatch):
    check_restart(mixed(), 35, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    both = solve(mixed())
    with alone(monkeypatch):
        one = solve(mixed())
    for name in one.history.data_vars:
        if name in {"active", "gap"}:
            continue
        values = one.history[name].values
        size = max(1.0, np.nanmax(np.abs(values)))
        np.testing.assert_allclose(both.history[name].values, values, atol=1e-10 * size)
