"""Parameters from measurements with noise: answers, intervals and doubts."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError
from impactfem.cli import main
from impactfem.findings import Finding
from impactfem.inverse.written import identified_table

G = 9.81
TIMES = np.linspace(0.05, 1.95, 39)
TRUE = {"g": 9.7, "e": 0.7}


def scene(folder, **measure):
    """A ball whose gravity (as a force) and restitution are wanted."""
    return Scene.from_dict(
        {
            "title": "ball", "duration": 2.0,
            "body": [{"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0, 1.0],
                      "force": ["0", "-g"]}],
            "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                          "normal": [0.0, 1.0]}],
            "contact": [{"between": ["ball", "floor"], "restitution": 0.75}],
            "parameter": [{"name": "g", "start": 9.5, "bounds": [5.0, 15.0]},
                          {"name": "e", "key": "contact.0.restitution", "bounds": [0.0, 1.0]}],
            "measure": [{"name": "heights", "of": "ball.y", "data": "heights.csv"} | measure],
            "output": {"report": False, "pictures": False, "fields": []},
        },
        base=folder,
    )  # fmt: skip


def heights(g, e):
    """Closed form of the heights at TIMES."""
    found, start, speed = [], np.sqrt(2.0 / g), np.sqrt(2.0 * g)
    for t in TIMES:
        if t <= start:
            found.append(1.0 - 0.5 * g * t * t)
            continue
        at, up = start, e * speed
        while t > at + 2.0 * up / g:
            at, up = at + 2.0 * up / g, e * up
        found.append(up * (t - at) - 0.5 * g * (t - at) ** 2)
    return np.array(found)


def write(folder, sigma, seed):
    noise = sigma * np.random.default_rng(seed).standard_normal(len(TIMES))
    table = np.column_stack([TIMES, heights(**TRUE) + noise])
    np.savetxt(folder / "heights.csv", table, delimiter=",", header="time,value", comments="")


def bound():
    """Cramer-Rao bound of g and e for sigma 1, by differences of the closed form."""
    columns = []
    for name in ("g", "e"):
        near = [heights(**TRUE | {name: TRUE[name] + h}) for h in (1e-6, -1e-6)]
        columns.append((near[0] - near[1]) / 2e-6)
    slopes = np.column_stack(columns)
    return np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))


def test_without_noise_the_truth_is_found(tmp_path):
    write(tmp_path, 0.0, 0)
    found = impactfem.identify(scene(tmp_path))
    assert found.status == "converged"
    for name, value in TRUE.items():
        assert found.parameters[name].value == pytest.approx(value, rel=1e-8)
    assert found.objective["final"] < 1e-14


def test_intervals_cover_the_truth(tmp_path):
    """Normalised errors of 12 seeds have the size that the bound states; all doubts stay away."""
    wrong = []
    for seed in range(12):
        write(tmp_path, 0.01, seed)
        found = impactfem.identify(scene(tmp_path, sigma=0.01))
        sigmas = [found.parameters[name].sigma for name in TRUE]
        np.testing.assert_allclose(sigmas, 0.01 * bound(), rtol=0.05)
        wrong += [(found.parameters[n].value - TRUE[n]) / found.parameters[n].sigma for n in TRUE]
        assert found.trusted, found.doubts
        assert found.chi2_probability > 1e-3
    assert 0.5 < np.std(wrong) < 1.6
    assert np.mean(np.abs(wrong) < 1.96) > 0.8


def test_a_sigma_that_is_too_small_is_told(tmp_path):
    write(tmp_path, 0.01, 3)
    found = impactfem.identify(scene(tmp_path, sigma=0.002))
    assert any("too small" in doubt for doubt in found.doubts)
    free = impactfem.identify(scene(tmp_path))
    assert free.sigma_of_data == pytest.approx(0.01, rel=0.3)
    assert free.trusted


def test_what_the_data_do_not_tell_is_said(tmp_path):
    """Heights before the first impact know nothing of the restitution."""
    table = np.column_stack([TIMES[:7], heights(**TRUE)[:7]])
    np.savetxt(tmp_path / "heights.csv", table, delimiter=",")
    with pytest.raises(SceneError, match=r"parameter\[1\].*moves nothing"):
        impactfem.identify(scene(tmp_path))


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, 0.01, 5)
    path = tmp_path / "ball.toml"
    path.write_text(scene(tmp_path, sigma=0.01).to_toml(), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["identify", str(path), "--out", str(out)]) == 0
    told = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert told["status"] == "converged"
    low, high = told["parameters"]["g"]["interval95"]
    assert low < TRUE["g"] < high
    answer = Scene.from_toml(out / "optimum.toml")
    assert answer.parameters[0].start == told["parameters"]["g"]["value"]
    with (out / "iterations.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["objective"]) == pytest.approx(told["objective"]["final"])
    assert {"report.html", "identified.png", "verified"} <= {each.name for each in out.iterdir()}

    # What speaks against the run of the answer alone is told apart from the search.
    solve = impactfem.solve

    def coarse(scene):
        result = solve(scene)
        fault = Finding("error_large", "fault", "it is coarse", remedy="take a smaller step")
        result.summary["verdict"]["findings"].append(fault.as_dict())
        return result

    monkeypatch.setattr("impactfem.solving.solve", coarse)
    assert main(["identify", str(path), "--restart", str(out)]) == 3
    told = r"the search did well, but by its run \(.*verified\): it is coarse; take a smaller step"
    assert re.search(told, capsys.readouterr().err)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,value\n0.1,1\n9.0,2\n", "the run lasts"),
        ("time,value\n0.1,one\n", "line 2"),
        ("0.1,1\n0.2\n", "line 2 has 1"),
        ("0.1,1,0\n", "sigma"),
        ("time,value\n", "no numbers"),
        ("0.1,nan\n", "not finite"),
    ],
)
def test_bad_data_are_named(tmp_path, text, words):
    (tmp_path / "heights.csv").write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=rf"measure\[0\]\.data.*{words}"):
        impactfem.identify(scene(tmp_path))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(SceneError, match=r"measure\[0\]\.data.*no such file"):
        impactfem.identify(scene(tmp_path))


def test_another_run_is_data(tmp_path):
    data = {
        "title": "ball", "duration": 1.5, "gravity": [0.0, -9.81],
        "body": [{"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0, 1.0]}],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                      "normal": [0.0, 1.0]}],
        "contact": [{"between": ["ball", "floor"], "restitution": 0.8}],
        "output": {"report": False, "pictures": False, "fields": []},
    }  # fmt: skip
    impactfem.solve(Scene.from_dict(data)).save(tmp_path / "before")
    data["contact"][0]["restitution"] = 0.75
    data["parameter"] = [{"name": "e", "key": "contact.0.restitution", "bounds": [0.5, 1.0]}]
    data["measure"] = [{"name": "y", "of": "ball.y", "result": "before"}]
    scene = Scene.from_dict(data, tmp_path)
    found = impactfem.identify(scene)
    assert found.parameters["e"].value == pytest.approx(0.8, abs=1e-9)
    # A scene that is written elsewhere finds its data.
    there = tmp_path / "other" / "scene.toml"
    there.parent.mkdir()
    there.write_text(scene.to_toml(there.parent))
    assert Path(Scene.from_toml(there).measures[0].result) == (tmp_path / "before").resolve()
    wrong = ("ball.u", "before", "its history has no .ball.u."), ("ball.y", "after", "no complete")
    for of, result, words in wrong:
        data["measure"] = [{"name": "y", "of": of, "result": result}]
        with pytest.raises(SceneError, match=rf"measure\[0\].result = .*{words}"):
            impactfem.identify(Scene.from_dict(data, tmp_path))
    data["measure"][0]["value"] = 1.0
    with pytest.raises(SceneError, match="remove value"):
        Scene.from_dict(data, tmp_path)


@pytest.mark.parametrize("of", ["force.bar.wall", "impulse.bar.wall"])
def test_misfits_of_forces_have_a_note(tmp_path, of):
    """The misfit of a force that jumps has minima beside the truth; that of an impulse has not."""
    times = np.arange(0.013, 4.0, 0.05)
    pushed = 0.5 * np.clip(times - 1.0, 0.0, 2.0)  # a bar of 1 m at .5 m/s, with a gap of .5 m
    told = (
        pushed
        if of.startswith("impulse")
        else np.diff(pushed, prepend=0.0) / np.diff(times, prepend=0.0)
    )
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(times))
    np.savetxt(tmp_path / "pushed.csv", np.column_stack([times, told + noise]), delimiter=",")
    asked = Scene.from_dict(
        {
            "title": "bar", "duration": 4.0,
            "body": [{"kind": "bar", "name": "bar", "length": 1.0, "density": 1.0, "area": 1.0,
                      "youngs_modulus": 1.0, "gap": 0.45, "velocity": "-0.5"}],
            "obstacle": [{"kind": "wall", "name": "wall"}],
            "parameter": [{"name": "gap", "key": "body.bar.gap", "bounds": [0.1, 0.9]}],
            "measure": [{"name": "m", "of": of, "data": "pushed.csv", "sigma": 0.02}],
            "output": {"report": False, "pictures": False, "fields": []},
        },
        base=tmp_path,
    )  # fmt: skip
    found = impactfem.identify(asked)
    near = abs(found.parameters["gap"].value - 0.5) < 4.0 * found.parameters["gap"].sigma
    if of.startswith("impulse"):
        assert near
        assert found.trusted
        assert not found.notes
    else:
        assert not near
        assert not found.trusted
        assert any("impulse.PAIR" in note for note in found.notes)
        assert "impulse.PAIR" in identified_table(found)


def test_what_is_small_in_its_unit_is_not_held_at_a_bound(tmp_path):
    write(tmp_path, 0.01, 5)
    data = scene(tmp_path, sigma=0.01).to_dict()
    data["body"][0]["force"] = ["0", "-1e12*g"]
    data["parameter"][0] |= {"start": 9.5e-12, "bounds": [5e-12, 15e-12]}
    found = impactfem.identify(Scene.from_dict(data, base=tmp_path))
    assert found.trusted, found.doubts
    low, high = found.parameters["g"].interval95
    assert low < 1e-12 * TRUE["g"] < high
