"""What the plan chooses, and that it says why."""

import copy
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

import impactfem
from impactfem.planning import PLANNERS
from impactfem.runs import RUNNERS, runner
from impactfem.shipped import shipped_scenes

MESH = str(Path(__file__).parents[2] / "meshes" / "bar_spacetime.geo")


def scene(duration=5.0, gravity=0.0, solve=None, **bar):
    keys = {"length": 1.0, "density": 1.0, "youngs_modulus": 1.0, "gap": 0.5, "velocity": -0.5}
    return impactfem.Scene(
        title="plan",
        duration=duration,
        gravity=gravity,
        bodies=[impactfem.Bar(**{**keys, **bar})],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(**(solve or {})),
    )


@pytest.mark.parametrize(
    ("case", "method"),
    [
        (scene(), "galerkin"),  # events on layers
        (scene(solve={"elements": 40}), "galerkin"),
        (scene(gap=0.5123), "exact"),  # events between layers
        (scene(gap=0.5123, solve={"elements": 30}), "conserving"),  # layers are asked for
        (scene(solve={"courant": 0.5}), "conserving"),
        (scene(duration=80.0, gravity=1.0, gap=0.4321), "exact"),  # many contacts
        (scene(velocity="-0.5 + 0.1*sin(3*x)"), "exact"),  # not linear
        (scene(gravity=[[0.0, 0.0], [0.0123, 0.0]]), "galerkin"),  # a change that is none
        (scene(gravity=[[0.0, 0.0], [3.5123, 0.1]]), "exact"),  # a change between layers
        (scene(solve={"accuracy": 1e-3}), "exact"),
        (scene(solve={"active_set": "snes_vi"}), "monolithic"),
        (scene(solve={"degree": 0}), "dg"),
        (scene(solve={"mesh": MESH}), "dg"),
        (scene(solve={"method": "newmark"}), "newmark"),
    ],
)
def test_method_follows_from_the_scene(case, method):
    plan = impactfem.plan(case)
    assert plan.method == method
    assert plan.reasons["method"]


def test_elements_put_the_events_on_layers():
    plan = impactfem.plan(scene(gap=0.5 * 41 / 43, duration=3.0))
    assert plan.elements == 43
    layer = 41 / 43 / plan.dt
    assert layer == pytest.approx(round(layer), abs=1e-9)


def test_beyond_the_stability_limit_is_refused_with_the_limit():
    with pytest.raises(impactfem.SceneError, match=r"courant = 1\.5.*omega_max.*conserving"):
        impactfem.plan(scene(solve={"method": "galerkin", "courant": 1.5}))
    assert impactfem.plan(scene(solve={"courant": 1.5})).method == "conserving"


@pytest.mark.parametrize(
    ("solve", "unknowns"),
    [  # 40 elements in 200 layers, a force for each: (40 + 1) (200 + 1) + 200
        ({"mesh": MESH, "method": "monolithic"}, 8441),
        ({"mesh": MESH, "method": "galerkin"}, 8441),
        ({"mesh": MESH}, 16000 * 6),  # dg: 6 values on each of two triangles of a cell
        ({"mesh": MESH, "degree": 0}, 16000 * 2),
    ],
)
def test_cost_with_a_mesh_file(solve, unknowns):
    plan = impactfem.plan(scene(solve=solve))
    assert (plan.unknowns, plan.contact_pairs) == (unknowns, 200)
    assert plan.memory_mib > 200
    assert plan.seconds > 0


def test_a_mesh_file_that_does_not_fit_is_noticed_before_the_run():
    with pytest.raises(
        impactfem.errors.MeshError, match="t runs from 0 to 5 s, the scene needs 0 to 4"
    ):
        impactfem.plan(scene(duration=4.0, solve={"mesh": MESH}))


@pytest.mark.parametrize("fitted", [True, False])
def test_cost_on_triangles_that_the_run_makes(fitted):
    case = scene(gap=0.5123, solve={"method": "dg", "elements": 20, "fitted": fitted})
    plan, summary = impactfem.plan(case), impactfem.solve(case).summary
    assert plan.unknowns == pytest.approx(summary["num_dofs"], rel=0.15)
    assert plan.contact_pairs == 100
    assert plan.seconds > 0
    assert impactfem.plan(case.with_settings({"solve.accuracy": 1e-3})).unknowns is None


@pytest.mark.parametrize(
    ("elements", "duration", "every", "measured"),
    [(3000, 5.0, 1, 1559.0), (40, 2e5, 10_000, 2906.0)],
    ids=["kept values", "layers"],
)
@pytest.mark.parametrize("method", ["galerkin", "exact"])
def test_memory_of_a_march_of_a_bar_is_that_of_runs(elements, duration, every, measured, method):
    """Kept fields, the exact ones beside them, the columns of the history: measured in MiB."""
    plan = impactfem.plan(impact(elements, duration, every, method))
    assert plan.memory_mib == pytest.approx(measured, rel=0.15)


def impact(elements, duration, every, method):
    scene = impactfem.Scene.from_toml(shipped_scenes()["bar_impact"])
    settings = {"duration": duration, "output.every": every, "solve.elements": elements}
    return scene.with_settings(settings | {"solve.method": method})


def test_what_does_not_fit_in_memory_now_is_refused_with_what_does(monkeypatch):
    """20 000 elements were planned with 6 GiB, and killed at 24."""
    monkeypatch.setattr("impactfem.sizing.free_mib", lambda: 16384.0)
    with pytest.raises(impactfem.SceneError) as caught:
        impactfem.plan(impact(20_000, 1.5, 1, "galerkin"))
    for part in ("solve.elements", "GiB, this machine has 16 free", "a larger output.every"):
        assert part in str(caught.value)
    assert impactfem.plan(impact(20_000, 1.5, 10, "galerkin")).memory_mib < 3000.0
    with pytest.raises(impactfem.SceneError, match='use method = "galerkin"'):
        impactfem.plan(impact(4000, 1.5, 1, "monolithic"))


def test_a_control_group_says_what_is_left(tmp_path):
    from impactfem.sizing import left_in

    assert left_in(tmp_path) == np.inf
    for name, text in {
        "memory.max": "max", "memory.current": "1000", "memory.stat": "anon 1\ninactive_file 300\n",
    }.items():  # fmt: skip
        (tmp_path / name).write_text(text)
    assert left_in(tmp_path) == np.inf
    (tmp_path / "memory.max").write_text("5000\n")
    assert left_in(tmp_path) == 4300.0


@pytest.mark.parametrize("name", shipped_scenes())
def test_planned_runs_do_not_gain_energy(name):
    shipped = impactfem.Scene.from_toml(shipped_scenes()[name])
    if shipped.bodies[0].kind != "bar":
        pytest.skip("solids: tests/demos/test_solid_demos.py")
    result = impactfem.solve(shipped.with_settings({"duration": min(shipped.duration, 20.0)}))
    assert result.summary["status"] == "completed"
    assert not result.summary["energy"]["grows"]
    assert result.summary["contact"]["max_penetration"] <= 1e-9


@pytest.mark.parametrize("accuracy", [3e-2, 1e-2])
def test_asked_accuracy_is_met(accuracy):
    wanted = scene(gap=0.5123, solve={"method": "galerkin", "accuracy": accuracy})
    assert impactfem.solve(wanted).summary["error"]["displacement_max"] <= accuracy


def test_fitted_bounces_in_gravity_are_exact_inside_the_bar():
    """An impact at the end of an edge must not count as contact during it, by a rounding error."""
    case = scene(
        duration=20.364696457612396,
        gravity=2.0,
        length=0.9377241466688315,
        gap=0.11308265232743195,
        velocity=-0.936562705214162,
    )
    result = impactfem.solve(case, method="dg")
    assert result.summary["details"]["fits"] == 1  # the events are known: one mesh
    assert result.summary["error"]["displacement_max"] <= 1e-10
    assert result.summary["energy"]["max_relative_drift"] <= 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_fitted_meshes_are_exact_for_random_single_impacts(seed):
    random = np.random.default_rng(seed)
    gap, speed = random.uniform(0.05, 1.0, 2)
    case = scene(
        duration=gap / speed + 2.5, gap=gap, velocity=-speed, gravity=random.choice([0.0, 0.2])
    )
    assert impactfem.plan(case).predicted_error <= 1e-9
    result = impactfem.solve(case, method="dg")
    assert result.summary["error"]["displacement_max"] <= 1e-9
    assert result.summary["energy"]["max_relative_drift"] <= 1e-9


def test_scene_as_used_reads_back_and_plans_the_same(tmp_path):
    for solve in ({}, {"accuracy": 1e-2, "method": "galerkin"}, {"fitted": True}):
        result = impactfem.solve(scene(gap=0.5123, solve=solve))
        folder = result.save(tmp_path / str(len(solve)), pictures=False)
        again = impactfem.plan(impactfem.Scene.from_toml(folder / "scene.toml"))
        assert again.method == result.summary["method"]
        assert again.elements == result.summary["plan"]["elements"]


SCENES = ("doyen_impact", "two_bars", "bouncing_ball", "dropped_disc")


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_has_one_kind_of_plan(name):
    """Its choices are those of ``plan --json``; each of its numbers is an attribute of it."""
    plan = impactfem.plan(impactfem.Scene.from_toml(shipped_scenes()[name]))
    assert type(plan) is impactfem.Plan
    told = plan.as_json()["choices"]
    assert told == [asdict(choice) for choice in plan.choices]
    assert {"film", "method", "model", "unknowns", "contact_pairs"} <= {c["key"] for c in told}
    for choice in plan.choices:
        if choice.key != "whole":  # a table of its own
            assert getattr(plan, choice.key) == choice.value
        assert choice.why == plan.reasons.get(choice.key)
    assert copy.deepcopy(plan) == plan
    assert replace(plan, film=True).dt == plan.dt
    with pytest.raises(AttributeError, match="colour"):
        _ = plan.colour


def test_whatever_solves_a_scene_is_planned_and_run():
    scenes = (impactfem.Scene.from_toml(path) for path in shipped_scenes().values())
    assert {scene.solver for scene in scenes} == {*PLANNERS} == {*RUNNERS}
    assert all(callable(runner(name)) for name in RUNNERS)


def sliding(count, steps):
    names = [f"p{k}" for k in range(count)]
    return impactfem.Scene(
        title="points that rub are marched",
        duration=1.0,
        gravity=[0.0, -9.81],
        bodies=[
            impactfem.Point(name=name, mass=1.0, position=[2.0 * k, 0.1], radius=0.1)
            for k, name in enumerate(names)
        ],
        obstacles=[impactfem.HalfSpace(name="floor", point=[0, 0], normal=[0, 1])],
        contacts=[
            impactfem.Contact(between=[name, "floor"], friction_coefficient=0.3) for name in names
        ],
        solve=impactfem.Solve(dt=1.0 / steps, estimate=False),
    )


@pytest.mark.parametrize(("count", "measured"), [(1, 272.8), (4, 317.8)])
def test_memory_of_a_march_without_meshes_counts_rows_of_each_body(count, measured):
    plan = impactfem.plan(sliding(count, 40_000))
    assert plan.memory_mib == pytest.approx(measured, rel=0.03)  # MiB, of such a run


def test_a_history_of_a_march_that_cannot_fit_is_refused(monkeypatch):
    monkeypatch.setattr("impactfem.sizing.free_mib", lambda: 300.0)
    impactfem.plan(sliding(1, 40_000))
    with pytest.raises(impactfem.SceneError, match=r"4e\+04 steps in the history need"):
        impactfem.plan(sliding(4, 40_000))


@pytest.mark.parametrize("formula", [False, True])
def test_a_damper_that_no_flight_can_follow_is_refused_and_a_long_one_foreseen(formula):
    """c / m = 1e9 1/s over 5 s: exact flights need 5e9 substeps long after it has died out."""

    def damped(rate):
        spring = {"anchor": [0.0], "stiffness": 40.0, "damping": 2.0 * rate}
        body = {"kind": "point", "name": "mass", "mass": 2.0, "position": [0.0], "velocity": [0.1]}
        force = [f"-{2.0 * rate!r}*vx - x**3"]
        body |= {"force": force} if formula else {"springs": [spring]}
        stop = {"kind": "half_space", "name": "stop", "point": [-0.05], "normal": [1.0]}
        given = {"title": "damper", "duration": 5.0, "body": [body], "obstacle": [stop]}
        return impactfem.plan(impactfem.Scene.from_dict(given))

    with pytest.raises(impactfem.SceneError, match=r"5e\+09 decay times .* less damping"):
        damped(1e9)
    assert damped(1e2).seconds is None
    assert damped(1e7).seconds > 5.0
