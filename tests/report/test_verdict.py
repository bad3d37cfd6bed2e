"""Verdict, findings and exit codes agree, and a run's findings replace those of its plan."""

import json

import pytest

import impactfem
from impactfem.cli import DONE, NOT_TRUSTED, main
from impactfem.findings import CODES, Finding, by_limits, level_of, settled, warning
from impactfem.planning import plan
from impactfem.planning.model_limits import measured_findings
from impactfem.scene import Scene
from impactfem.shipped import shipped_scenes

TURNS = Finding("model_rotation", "fault", "it will turn", "disc", 1.0, 0.3)


def test_a_code_that_nobody_knows_is_refused():
    with pytest.raises(ValueError, match="no code"):
        warning("surprise", "text")


def test_limits_make_warnings_and_faults():
    found = [by_limits("error_large", value, (0.05, 0.5), "text") for value in (0.05, 0.06, 0.6)]
    assert [[entry.severity for entry in each] for each in found] == [[], ["warning"], ["fault"]]
    assert found[2][0].limit == 0.5
    (lost,) = by_limits("error_large", float("nan"), (0.05, 0.5), "text")
    assert lost.severity == "fault"


@pytest.mark.parametrize(
    ("figures", "finite", "severity"),
    [
        ({"rotation_max": 0.09}, None, None),
        ({"rotation_max": 0.11}, None, "warning"),
        ({"rotation_max": 0.31}, None, "fault"),
        ({"strain_99": 0.045}, None, None),
        ({"strain_99": 0.055}, None, "warning"),
        ({"strain_99": 0.21}, None, "fault"),
        ({"volume_ratio_min": 0.51}, None, None),
        ({"volume_ratio_min": 0.49}, None, "warning"),
        ({"volume_ratio_min": -0.01}, None, "fault"),
        ({"volume_ratio_min": 0.61}, "linear", None),
        ({"volume_ratio_min": 0.59}, "linear", "warning"),
        ({"volume_ratio_min": 0.39}, "linear", "fault"),
        ({"volume_ratio_min": 0.39}, "neo_hookean", None),
    ],
)
def test_limits_of_the_model_stand_where_they_are_documented(figures, finite, severity):
    calm = {"rotation_max": 0.0, "strain_99": 0.0, "volume_ratio_min": 1.0}
    laws = {"disc": finite} if finite else {}
    found = list(measured_findings({"disc": calm | figures}, laws))
    assert [entry.severity for entry in found] == ([severity] if severity else [])


def test_what_was_measured_replaces_what_was_foreseen():
    assert settled([TURNS], []) == (TURNS,)
    assert settled([TURNS], [], ["model_rotation"]) == ()
    less = warning("model_rotation", "it turned a little", "disc")
    other = warning("model_rotation", "so did this", "block")
    assert settled([TURNS], [less]) == (less,)
    assert settled([TURNS], [other]) == (TURNS, other)  # the worst first


def test_the_worst_finding_decides():
    note = Finding("error_large", "note", "text")
    assert level_of([]) == level_of([note]) == "trust"
    assert level_of([note, warning("units", "text")]) == "care"
    assert level_of([warning("units", "text"), TURNS]) == "do_not_trust"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "level", "code"),
    [
        (("solve.elements=10",), "trust", None),
        (("solve.method=galerkin", "solve.courant=0.9"), "care", "ringing"),
        (("solve.method=newmark", "solve.elements=40"), "do_not_trust", "energy_growth"),
    ],
)
def test_exit_code_and_verdict_agree(tmp_path, capsys, settings, level, code):
    words = [word for text in settings for word in ("--set", text)]
    out = tmp_path / "out"
    assert main(["run", "bar_impact", *words, "--out", str(out), "--quiet"]) == (
        NOT_TRUSTED if level == "do_not_trust" else DONE
    )
    summary = json.loads((out / "summary.json").read_text())
    verdict = summary["verdict"]
    assert verdict["level"] == level
    found = {finding["code"]: finding for finding in verdict["findings"]}
    assert code is None or code in found
    assert set(found) <= set(CODES)
    if level == "do_not_trust":
        assert summary["status"] == "unstable"
        assert found[code]["remedy"] in capsys.readouterr().err
    assert impactfem.Result.load(out).summary["verdict"] == verdict


def test_the_plan_as_json(capsys):
    assert main(["plan", "bar_impact", "--json", "--set", "solve.method=newmark"]) == DONE
    made = json.loads(capsys.readouterr().out)
    assert made["method"] == "newmark"
    assert {"choices", "predicted_error", "findings", "cost"} <= set(made)
    (found,) = made["findings"]
    assert found["code"] == "control_method"
    chosen = {choice["key"]: choice for choice in made["choices"]}
    assert chosen["dt"]["unit"] == "s"
    assert chosen["elements"]["why"]
    assert set(made["cost"]) == {"seconds", "drawing_seconds", "memory_mib"}


def test_the_plan_counts_what_is_drawn():
    scene = Scene.from_toml(shipped_scenes()["bar_impact"])
    switches = ("pictures", "film", "report")
    told = [plan(scene).drawing_seconds]
    for switch in switches:
        scene = scene.with_settings({f"output.{switch}": False})
        told.append(plan(scene).drawing_seconds)
    assert told == sorted(told, reverse=True)
    assert len(set(told)) == 4
    assert told[-1] == 0.0
