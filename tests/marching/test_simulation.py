"""Scenes taken step by step: equal to a run bit by bit, also after going back; forces."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene, Simulation
from impactfem.errors import SceneError

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
BOX = {"kind": "rigid", "name": "box", "model": "2d", "density": 100.0, "velocity": [1.0, 0.0],
       "shape": {"kind": "block", "size": [0.3, 0.2], "corner": [0.0, 0.05]},
       "angle": 0.1}  # fmt: skip
DISC = {"kind": "solid", "name": "disc", "model": "plane_strain", "density": 1000.0,
        "youngs_modulus": 1e6, "poisson_ratio": 0.3, "mesh_size": 0.02, "velocity": [0.3, -1.0],
        "shape": {"kind": "disc", "radius": 0.05, "center": [0.0, 0.051]}}  # fmt: skip
POINT = {"kind": "point", "name": "ball", "mass": 0.5, "position": [0.0, 0.2], "radius": 0.01,
         "velocity": [1.0, 0.0]}  # fmt: skip


def scene(*bodies, duration=0.05, friction=0.3, solve=(), **more):
    contacts = [{"between": [body["name"], "floor"], "friction_coefficient": friction}
                for body in bodies]  # fmt: skip
    return Scene.from_dict(
        {"title": "steps", "duration": duration, "gravity": [0.0, -9.81], "body": list(bodies),
         "obstacle": [FLOOR], "contact": contacts, "output": {"fields": []},
         "solve": {"estimate": False} | dict(solve)} | more
    )  # fmt: skip


SCENES = {
    "rigid": scene(BOX, duration=0.2, solve={"dt": 1e-3}),
    "solid": scene(DISC, duration=0.02),
    "explicit": scene(DISC, duration=0.005, solve={"method": "explicit"}),
    "frictionless": scene(DISC, duration=0.02, friction=0.0),
    "finite": scene(DISC | {"strain": "finite"}, duration=0.01),
    "points": scene(POINT, POINT | {"name": "other", "position": [0.3, 0.1]}, duration=0.3,
                    solve={"dt": 2e-3}),
    "mixed": scene(DISC, BOX | {"shape": {"kind": "disc", "radius": 0.05, "center": [0.0, 0.16]},
                                "angle": 0.0}, duration=0.02),
}  # fmt: skip


def same(one, other):
    assert set(one) == set(other)
    for name in one:
        assert np.array_equal(one[name].values, other[name].values, equal_nan=True), name


@pytest.mark.parallel([1, 2])
@pytest.mark.parametrize("name", SCENES)
def test_steps_are_those_of_a_run_bit_by_bit_also_after_going_back(name):
    """States are taken before, in and after contact; forces of a detour leave nothing behind."""
    case = SCENES[name]
    solved = impactfem.solve(case)
    sim = Simulation(case)
    layers = round(case.duration / sim.dt)
    states = {}
    while not sim.done:
        if sim._march.layer in {0, layers // 3, layers // 2}:
            states[sim._march.layer] = sim.state
        sim.step()
    assert sim.time == pytest.approx(case.duration)
    first = sim.result()
    same(first.history, solved.history)
    assert first.summary["verdict"] == solved.summary["verdict"]
    for layer in (layers // 3, 0, layers // 2):
        sim.restore(states[layer])
        assert sim.time == layer * sim.dt
        kinds = {body.kind for body in case.bodies} - {"solid"}
        pushed = [body for body in case.bodies if body.kind in kinds]
        sim.step({body.name: [5.0, 0.0] for body in pushed})
        sim.restore(states[layer])
        while not sim.done:
            sim.step()
        same(sim.result().history, solved.history)
    last = {name: float(column.values[-1]) for name, column in solved.history.items()}
    assert sim.columns == pytest.approx(last, nan_ok=True)
    sim.close()
    other = Simulation(case).restore(states[layers // 2])
    while not other.done:
        other.step()
    same(other.result().history, solved.history)


def test_a_force_held_over_steps_does_its_work():
    """A point and a box without contact: exact for constant forces; energies balance."""
    flying = scene(POINT | {"position": [0.0, 9.0]}, BOX | {"angle": 0.0}, duration=0.1,
                   gravity=[0.0, 0.0], solve={"dt": 1e-2})  # fmt: skip
    sim = Simulation(flying)
    mass, inertia = 100.0 * 0.06, 100.0 * 0.06 * (0.3**2 + 0.2**2) / 12.0
    while not sim.done:
        sim.step({"ball": [2.0, 1.0], "box": {"force": [0.0, 60.0], "moment": 0.5}})
    told = sim.columns
    assert told["ball.vx"] == pytest.approx(1.0 + 2.0 / 0.5 * 0.1, rel=1e-12)
    assert told["ball.vy"] == pytest.approx(1.0 / 0.5 * 0.1, rel=1e-12)
    assert told["box.vy"] == pytest.approx(60.0 / mass * 0.1, rel=1e-12)
    assert told["box.spin"] == pytest.approx(0.5 / inertia * 0.1, rel=1e-12)
    assert told["box.angle"] == pytest.approx(0.5 * 0.5 / inertia * 0.01, rel=1e-12)
    result = sim.result()
    energy = result.history["total_energy"].values
    assert np.ptp(energy) < 1e-12 * result.history["kinetic_energy"].values.max()
    work = 2.0 * (told["ball.x"] - 0.0) + 1.0 * (told["ball.y"] - 9.0)
    work += 60.0 * (told["box.y"] - 0.15) + 0.5 * told["box.angle"]
    assert told["potential_energy"] == pytest.approx(-work, rel=1e-12)
    assert "forces from outside" in str(result.summary["verdict"])


def test_columns_of_a_step_stay_its_own_and_cost_no_more_later(monkeypatch):
    sim = Simulation(scene(POINT, BOX, duration=0.1, solve={"dt": 1e-2}))
    start, told, whole = sim.state, sim.step().columns, sim._motion
    monkeypatch.setattr(sim, "_motion", lambda: pytest.fail("all rows were looked at"))
    at = told["box.y"], told["ball.vy"]
    assert sim.step().columns["box.y"] != at[0]
    monkeypatch.setattr(sim, "_motion", whole)
    rows = sim.result().history
    assert (told["box.y"], told["ball.vy"]) == at
    for name in ("box.y", "ball.vy", "box.angle", "potential_energy"):
        assert told[name] == pytest.approx(float(rows[name].values[1]), rel=1e-14), name
    later = sim.step().columns
    sim.restore(start)
    with pytest.raises(SceneError, match="before a state was restored"):
        later["potential_energy"]


def test_a_ball_is_held_by_feedback():
    """PD on a point, semi-discrete: the sampled loop settles where the spring says."""
    held = scene(POINT, duration=2.0, friction=0.1, solve={"dt": 1e-3})
    sim = Simulation(held)
    while not sim.done:
        told = sim.columns
        sim.step(
            {"ball": [0.0, 0.5 * 9.81 - 40.0 * (told["ball.y"] - 0.3) - 6.0 * told["ball.vy"]]}
        )
        if sim._march.layer > 200:
            break
    assert 0.2 < sim.columns["ball.y"] < 0.3
    partial = sim.result()
    assert partial.summary["status"] == "interrupted"
    assert partial.history["time"].values[-1] == pytest.approx(sim.time)


@pytest.mark.parametrize(
    ("forces", "words"),
    [
        ({"bal": [0.0, 1.0]}, "did you mean"),
        ({"disc": [0.0, 1.0]}, "is a solid"),
        ({"ball": [0.0, 1.0, 2.0]}, "no list of 2 numbers"),
        ({"ball": {"moment": 1.0}}, "forces and moments"),
        ({"ball": {"torque": 1.0}}, "give force, moment"),
        ({"ball": [np.nan, 0.0]}, "no list of 2 numbers"),
    ],
)
def test_forces_without_sense_are_refused(forces, words):
    sim = Simulation(scene(DISC, POINT | {"position": [0.5, 0.2]}, duration=0.01))
    with pytest.raises(SceneError, match=words):
        sim.step(forces)
    assert sim.time == 0.0


def test_what_has_no_steps_is_refused():
    bar = {"title": "bar", "duration": 0.1, "body": [{"kind": "bar", "name": "bar", "gap": 0.1,
           "velocity": 1.0, "length": 1.0, "density": 1.0, "youngs_modulus": 1.0}],
           "obstacle": [{"kind": "wall", "name": "wall"}]}  # fmt: skip
    alone = scene(POINT, friction=0.0, solve={"method": "event_driven"})
    for case in (Scene.from_dict(bar), alone):
        with pytest.raises(SceneError, match=r"all of its time at once.*conserving"):
            Simulation(case)
    sim = Simulation(scene(POINT, duration=0.01, solve={"dt": 1e-2}))
    sim.step()
    with pytest.raises(SceneError, match="is the end"):
        sim.step()
    with pytest.raises(SceneError, match=r"give what sim\.state was"):
        sim.restore(3)
    with pytest.raises(SceneError, match="another scene"):
        sim.restore(Simulation(scene(DISC, duration=0.01)).state)
