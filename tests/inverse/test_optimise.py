"""Controls and optimisation: against closed forms, restarts, and what is refused or doubted."""

import json
import sys

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError
from impactfem.cli import main
from impactfem.inverse.evaluations import NAME
from impactfem.inverse.search import begun
from impactfem.inverse.solvers import Problem
from impactfem.inverse.varied import Varied

PLAIN = {"report": False, "pictures": False, "fields": []}


def block(pieces=4, **control):
    """A block that a control moves by 1 m in 1 s, from rest to rest."""
    push = {"name": "push", "acts": "body.block.force.x", "pieces": pieces} | control
    return {
        "title": "block", "duration": 1.0,
        "body": [{"kind": "point", "name": "block", "mass": 1.0, "position": [0.0],
                  "force": ["0"]}],
        "obstacle": [{"kind": "half_space", "name": "wall", "point": [5.0], "normal": [-1.0]}],
        "control": [push],
        "measure": [{"name": "place", "of": "block.x"}, {"name": "speed", "of": "block.vx"}],
        "objective": {
            "minimise": [{"term": "effort", "of": "push"}],
            "constraints": [
                {"term": "value", "of": "place", "min": 1.0, "max": 1.0},
                {"term": "value", "of": "speed", "min": 0.0, "max": 0.0},
            ],
        },
        "output": PLAIN,
    }  # fmt: skip


def landing(**point):
    """A mass on a spring that one pulse moves to a stop, so that it lands at rest and is held."""
    return {
        "title": "soft landing", "duration": 3.0,
        "body": [{"kind": "point", "name": "tip", "mass": 1.0, "position": [0.0],
                  "force": ["where(t < off, 2, where(t < on, 0, 1)) - x"]} | point],
        "obstacle": [{"kind": "half_space", "name": "stop", "point": [1.0], "normal": [-1.0]}],
        "contact": [{"between": ["tip", "stop"], "restitution": 0.5}],
        "parameter": [
            {"name": "off", "start": 0.49, "bounds": [0.05, 1.2]},
            {"name": "on", "start": 1.7, "bounds": [1.3, 2.8]},
        ],
        "measure": [{"name": "place", "of": "tip.x", "value": 1.0},
                    {"name": "speed", "of": "tip.vx", "value": 0.0}],
        "objective": {"minimise": [{"term": "misfit", "of": "place"},
                                   {"term": "misfit", "of": "speed"}]},
        "output": PLAIN,
    }  # fmt: skip


def least_effort(pieces):
    """Constant pieces: each the mean of a line through 0 in the middle; limits tell its slope."""
    middles = (np.arange(pieces) + 0.5) / pieces
    return pieces * (0.5 - middles) / np.square(0.5 - middles).sum()


@pytest.mark.parametrize("solver", ["trust_constr", "slsqp", "ipopt"])
def test_a_block_moved_with_least_effort(solver):
    if solver == "ipopt":
        pytest.importorskip("casadi")  # not of Debian
    data = block()
    data["objective"]["solver"] = solver
    found = impactfem.optimise(Scene.from_dict(data))
    values = [each["value"] for each in found.parameters.values()]
    assert values == pytest.approx(least_effort(4), abs=1e-6)
    assert found.objective["final"] == pytest.approx(12.0 / (1.0 - 1.0 / 16.0), rel=1e-9)
    assert found.objective["verified"] == pytest.approx(found.objective["final"], rel=1e-9)
    assert found.constraints == pytest.approx([1.0, 0.0], abs=1e-9)
    # dJ*/d(way) = 2 J*, and what a speed at the end would spare.
    assert found.multipliers == pytest.approx([-25.6, 12.8], rel=1e-6)
    assert found.kkt_residual < 1e-5
    assert found.trusted


@pytest.mark.parametrize("solver", ["trust_constr", "slsqp"])
def test_limits_hold_in_any_size(solver):
    """The same by a nanometre: limits are met in their sizes, not beside 1."""
    data = block(bounds=[-1e-8, 1e-8])
    data["objective"]["solver"] = solver
    data["objective"]["constraints"][0] |= {"min": 1e-9, "max": 1e-9}
    found = impactfem.optimise(Scene.from_dict(data))
    assert found.constraints == pytest.approx([1e-9, 0.0], rel=1e-6, abs=1e-15)
    assert found.objective["final"] == pytest.approx(12.8e-18, rel=1e-6)
    assert found.trusted


def test_limits_that_are_passed_by_little_are_doubted():
    data = block(bounds=[-1e-8, 1e-8])
    data["objective"]["constraints"][0] |= {"min": 1e-9, "max": 1e-9}
    problem = Problem(begun(Scene.from_dict(data), None, None))
    below, above = problem.room(np.array([1.0001e-9, 0.0]))
    assert below[0] > 1.0
    assert above[0] < -1.0


def test_a_search_ends_where_little_is_won():
    data = landing()
    data["objective"]["gain"] = 0.5
    found = impactfem.optimise(Scene.from_dict(data))
    told = [each.objective for each in found.iterations]
    assert len(told) == 14  # half of what was won came before the last ten
    assert found.objective["final"] == min(told)
    assert found.status == "converged"
    assert "less than objective.gain = 0.5" in found.notes[-1]


def test_without_casadi_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    data = block()
    data["objective"]["solver"] = "ipopt"
    with pytest.raises(SceneError, match=r"ipopt.*impactfem\[optimise\]"):
        impactfem.optimise(Scene.from_dict(data))


@pytest.mark.parametrize("solver", ["lbfgs", "tao", "slsqp", "ipopt"])
def test_a_bound_that_holds(solver):
    """Of a push with bounds, as far as it can go against its effort: J = 2 f^2 - 4 x(1)."""
    if solver == "ipopt":
        pytest.importorskip("casadi")
    data = block(pieces=2, bounds=[-1.0, 0.9])
    data["objective"] = {
        "minimise": [{"term": "effort", "of": "push", "weight": 1.0},
                     {"term": "value", "of": "place", "weight": -4.0}],
        "solver": solver,
    }  # fmt: skip
    found = impactfem.optimise(Scene.from_dict(data))
    # x(1) = 3/8 f1 + 1/8 f2; without bounds f = (3/2, 1/2).
    assert [each["value"] for each in found.parameters.values()] == pytest.approx([0.9, 0.5])
    assert found.gradient["push.0"] == pytest.approx(0.9 - 1.5)
    assert found.kkt_residual < 1e-6
    assert found.trusted


def test_linear_pieces_and_their_effort():
    """A push that rises from 0 to 6 and falls again: place, effort and their gradient."""
    data = block(pieces=2, kind="linear", start=[0.0, 6.0, 0.0])
    scene = Scene.from_dict(data)
    (control,) = scene.controls
    assert control.effort(1.0) == pytest.approx(12.0)
    assert control.at([0.25, 0.5, 0.75, 1.5], 1.0) == pytest.approx([3.0, 6.0, 3.0, 0.0])
    varied = Varied.of(scene)
    q, jacobian, *_ = varied.jacobian(varied.start)
    assert q[:2] == pytest.approx([1.5, 3.0], rel=1e-10)
    hat = [1 / 8 * 5 / 6 * 2, 1 / 4, 1 / 24]  # integrals of (1 - t) times hats of half a second
    assert jacobian[0] == pytest.approx(hat, rel=1e-8)
    assert jacobian[1] == pytest.approx([0.25, 0.5, 0.25], rel=1e-8)
    assert jacobian[2] == pytest.approx([1.0, 4.0, 1.0], rel=1e-8)


@pytest.mark.slow
def test_a_soft_landing():
    """Off where x = d^2/(2 F), then it lands at rest (closed form); the objective has a kink."""
    found = impactfem.optimise(Scene.from_dict(landing()))
    off = np.arccos(1.0 - 0.25 / 2.0)  # x = 2 (1 - cos t) = 1/4
    speed = 2.0 * np.sin(off)
    lands = off + np.arctan2(speed, 0.25)
    assert found.parameters["off"]["value"] == pytest.approx(off, abs=1e-6)
    assert found.parameters["on"]["value"] == pytest.approx(lands, abs=1e-6)
    assert found.objective["final"] < 1e-11


def test_a_search_goes_on_bit_by_bit(tmp_path, monkeypatch):
    """Interrupted after three runs, it ends with the same numbers as one that was not."""
    data = block(pieces=3, bounds=[-10.0, 10.0])
    scene = Scene.from_dict(data)
    whole = impactfem.optimise(scene, folder=tmp_path / "whole")
    real, count = Varied.jacobian, []

    def stopped(self, values):
        found = real(self, values)
        count.append(1)
        if len(count) > 6:
            raise KeyboardInterrupt
        return found

    with monkeypatch.context() as patch:
        patch.setattr(Varied, "jacobian", stopped)
        with pytest.raises(KeyboardInterrupt):
            impactfem.optimise(scene, folder=tmp_path / "part")
    part = (tmp_path / "part" / NAME).read_bytes()
    (tmp_path / "part" / NAME).write_bytes(part[:-7])  # as if it were interrupted while writing
    again = impactfem.optimise(scene, restart=tmp_path / "part")
    assert again.parameters == whole.parameters
    assert again.objective == whole.objective
    assert again.resumed > 0
    assert again.gradient_runs < whole.gradient_runs
    with pytest.raises(impactfem.errors.OutputError, match="another scene"):
        impactfem.optimise(scene.with_settings({"duration": 1.1}), restart=tmp_path / "part")
    with pytest.raises(impactfem.errors.OutputError, match="no search can go on"):
        impactfem.optimise(scene, restart=tmp_path / "none")


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    data = block(pieces=2, bounds=[-10.0, 10.0])
    del data["objective"]["constraints"]
    data["objective"]["minimise"] += [
        {"term": "misfit", "of": "place", "weight": 100.0},
        {"term": "misfit", "of": "speed", "weight": 100.0},
    ]
    data["measure"][0]["value"], data["measure"][1]["value"] = 1.0, 0.0
    (tmp_path / "scene.toml").write_text(Scene.from_dict(data).to_toml(), encoding="utf-8")
    assert main(["optimise", "scene.toml", "--out", "out"]) == 0
    assert "objective" in capsys.readouterr().out
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["status"] == "converged"
    optimum = Scene.from_toml(tmp_path / "out" / "optimum.toml")
    assert optimum.controls[0].values == tuple(
        each["value"] for each in summary["parameters"].values()
    )
    lines = (tmp_path / "out" / "control.csv").read_text().splitlines()
    assert lines[0] == "time,push"
    assert float(lines[1].split(",")[1]) == optimum.controls[0].values[0]
    for name in ("iterations.csv", "report.html", "optimised.png", "verified/summary.json"):
        assert (tmp_path / "out" / name).stat().st_size > 100


def change(**keys):
    return {"control": [block()["control"][0] | keys]}


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        (change(acts="body.block.force.3"), r'control\[0\].acts = "body.block.force.3"'),
        (change(acts="body.block.torque"), r"control\[0\].acts .*torque"),
        (change(acts="body.block.name"), r"body\[0\].name"),
        (change(acts="body.block.mass"), r"body\[0\].mass"),
        (change(name="t"), r'control.*name = "t" cannot stand in a formula'),
        (change(name="sin"), r"cannot stand in a formula"),
        (change(start=[1.0, 2.0]), r"start has 2 values: give one, or 4"),
        (change(start=30.0, bounds=[-1.0, 1.0]), r"bounds = .* excludes a start"),
        (change(until=2.0), r"until = 2 s is after the end"),
        ({"control": [change(**{"from": 0.6})["control"][0] | {"until": 0.4}]}, "is not after"),
        (change(pieces=0), r"pieces = 0"),
        ({"parameter": [{"name": "push", "start": 1.0}]}, r"control\[0\].name .* parameter\[0\]"),
        ({"objective": {"minimise": [{"term": "effort", "of": "pull"}]}}, r"pull.* none of push"),
        ({"objective": {"minimise": [{"term": "effort"}]}}, "effort needs it"),
        ({"objective": {"minimise": [{"term": "mass", "body": "block"}],
                        "constraints": [{"term": "mass", "body": "block"}]}}, "max is missing"),
        ({"objective": {"minimise": [{"term": "mass", "body": "block"}],
                        "constraints": [{"term": "mass", "body": "block", "min": 2, "max": 1}]}},
         "min = 2 is above max"),
    ],
)  # fmt: skip
def test_bad_input_is_named(tables, words):
    with pytest.raises(SceneError, match=words):
        Scene.from_dict(block() | tables)


def test_a_control_stands_only_where_there_is_time():
    data = block()
    data["control"][0]["acts"] = None
    data["body"][0] |= {"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0}
    for name in ("mass", "position", "force"):
        del data["body"][0][name]
    data["body"][0]["velocity"] = "push"
    with pytest.raises(SceneError, match="changes with t, and this does not"):
        Scene.from_dict(data)


def test_solvers_that_know_no_constraints_are_refused():
    data = block()
    data["objective"]["solver"] = "tao"
    with pytest.raises(SceneError, match="knows no constraints"):
        impactfem.optimise(Scene.from_dict(data))


def test_least_sum_of_places_on_a_circle_of_speeds():
    """An SQP with a closed answer: min x + y where |v| <= sqrt(2), x = v after 1 s."""
    found = impactfem.optimise(Scene.from_dict({
        "title": "circle", "duration": 1.0,
        "body": [{"kind": "point", "name": "p", "mass": 1.0, "position": [0.0, 0.0],
                  "velocity": [0.3, -0.2]}],
        "obstacle": [{"kind": "half_space", "name": "far", "point": [9.0, 0.0],
                      "normal": [-1.0, 0.0]}],
        "parameter": [{"name": n, "key": f"body.p.velocity.{k}"} for k, n in enumerate("ab")],
        "measure": [{"name": n, "of": f"p.{n}"} for n in "xy"],
        "objective": {"minimise": [{"term": "value", "of": n} for n in "xy"],
                      "constraints": [{"term": "speed", "body": "p", "max": 2**0.5}]},
        "output": PLAIN,
    }))  # fmt: skip
    assert found.status == "converged"
    assert [found.parameters[n]["value"] for n in "ab"] == pytest.approx([-1.0, -1.0], abs=1e-5)
    assert found.objective["final"] == pytest.approx(-2.0, abs=1e-7)
    assert found.multipliers == pytest.approx((2**0.5,), abs=1e-4)  # 1 + multiplier v / |v| = 0


@pytest.mark.parametrize("solver", ["least_squares", "gauss_newton", "lbfgs"])
def test_misfits_become_least_by_each_solver(solver):
    # Where a thrown point is at .3 and .6 s, by its speed and the force that brakes it.
    times = np.array([0.3, 0.6])
    places = 2.0 * times - 0.5 * 0.7 * times**2
    data = {
        "title": "braked", "duration": 1.0,
        "body": [{"kind": "point", "name": "p", "mass": 1.0, "position": [0.0],
                  "velocity": [1.5], "force": ["-f"]}],
        "obstacle": [{"kind": "half_space", "name": "far", "point": [9.0], "normal": [-1.0]}],
        "parameter": [{"name": "f", "start": 0.2, "bounds": [0.0, 5.0]},
                      {"name": "v", "key": "body.p.velocity.0"}],
        "measure": [{"name": f"at{k}", "of": "p.x", "at": t, "value": x}
                    for k, (t, x) in enumerate(zip(times.tolist(), places.tolist(), strict=True))],
        "objective": {"minimise": [{"term": "misfit", "of": f"at{k}"} for k in (0, 1)],
                      "solver": solver},
        "output": PLAIN,
    }  # fmt: skip
    found = impactfem.optimise(Scene.from_dict(data))
    assert found.status == "converged"
    rough = 1e-4 if solver == "lbfgs" else 1e-8
    assert found.parameters["f"]["value"] == pytest.approx(0.7, rel=rough)
    assert found.parameters["v"]["value"] == pytest.approx(2.0, rel=rough)
    if solver == "gauss_newton":  # the places are linear in both
        assert found.gradient_runs <= 4
        same = impactfem.identify(Scene.from_dict(data))
        assert same.parameters["f"].value == pytest.approx(0.7, rel=1e-8)
    if solver != "lbfgs":
        data["objective"]["minimise"] = [{"term": "speed", "body": "p"}]
        with pytest.raises(SceneError, match="misfits with positive weights"):
            impactfem.optimise(Scene.from_dict(data))


def test_an_objective_of_any_size_and_where_a_parameter_moves_nothing():
    """The way of a point pushed until off, times 1e-12: the longer the better, up to the end."""
    data = {
        "title": "push", "duration": 1.0,
        "body": [{"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0],
                  "force": ["where(t < off, 1e-12, -1e-12)"]}],
        "obstacle": [{"kind": "half_space", "name": "stop", "point": [9.0], "normal": [-1.0]}],
        "parameter": [{"name": "off", "start": 0.3, "bounds": [0.1, 0.8]}],
        "measure": [{"name": "way", "of": "ball.x", "value": 0.0}],
        "objective": {"minimise": [{"term": "value", "of": "way", "weight": -1.0}]},
        "output": PLAIN,
    }  # fmt: skip
    found = impactfem.optimise(Scene.from_dict(data))
    assert found.parameters["off"]["value"] == pytest.approx(0.8)  # its bound
    assert found.trusted
    assert not found.notes
    data["parameter"][0]["bounds"] = [0.1, 9.0]
    varied = Varied.of(Scene.from_dict(data))
    for off, still in ((0.3, []), (1.0, []), (3.0, ["off"])):
        told = varied.jacobian(np.array([off]))
        found = varied.still(np.array([off]), told.numbers, told.jacobian)
        assert [each.name for each in found] == still
