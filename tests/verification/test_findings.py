"""What plan and run of every shipped scene find, against the one list of it.

After a change that is meant: `python tests/verification/test_findings.py` writes the list anew;
read its difference. With the folder of the demos' results, as `.ci/run demos` makes them, it looks
only whether the long runs among them found what the list says.
"""

import json
import sys
from pathlib import Path

import pytest

import impactfem
from impactfem import Scene
from impactfem.shipped import shipped_scenes

GOLDEN = Path(__file__).with_name("findings.json")
# Demos that run for several seconds: tests look at their plans, `.ci/run demos` at their runs.
LONG = ("ball_on_plate", "block_on_sphere", "block_stack", "colliding_discs", "dropped_disc")


def listed():
    return json.loads(GOLDEN.read_text(encoding="utf-8"))


def foreseen(scene):
    """Code, severity and subject of what the plan finds."""
    found = impactfem.plan(scene).findings
    return {"plan": [[each.code, each.severity, each.subject] for each in found]}


def ended(summary):
    """Level and findings of a run: code, severity and subject of each."""
    found = summary["verdict"]["findings"]
    return {
        "run": [[each["code"], each["severity"], each["subject"]] for each in found],
        "level": summary["verdict"]["level"],
        "status": summary["status"],
    }


def found(name, run=True):
    scene = Scene.from_toml(shipped_scenes()[name]).with_settings(["output.fields=[]"])
    return foreseen(scene) | (ended(impactfem.solve(scene).summary) if run else {})


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_scenes())
def test_findings_of_shipped_scenes(name):
    told = found(name, run=name not in LONG)
    assert told == {key: listed()[name][key] for key in told}


def test_the_list_names_the_shipped_scenes():
    assert list(listed()) == sorted(shipped_scenes())


def differing(results):
    """What long runs in a folder of results found, and should have, where that is not the same."""
    wrong = {}
    for name in LONG:
        told = ended(json.loads((results / name / "summary.json").read_text(encoding="utf-8")))
        wanted = {key: listed()[name][key] for key in told}
        if told != wanted:
            wrong[name] = (told, wanted)
    return wrong


def test_a_run_that_finds_something_else_is_named(tmp_path):
    for name in LONG:
        known = listed()[name]
        texts = [dict(zip(("code", "severity", "subject"), each, strict=True))
                 for each in known["run"]]  # fmt: skip
        verdict = {"level": known["level"], "findings": texts}
        (tmp_path / name).mkdir()
        summary = {"status": known["status"], "verdict": verdict}
        (tmp_path / name / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    assert differing(tmp_path) == {}
    worse = {"status": "completed", "verdict": {"level": "do_not_trust", "findings": []}}
    (tmp_path / LONG[0] / "summary.json").write_text(json.dumps(worse), encoding="utf-8")
    assert list(differing(tmp_path)) == [LONG[0]]


if __name__ == "__main__":
    if len(sys.argv) > 1:
        sys.exit(str(wrong) if (wrong := differing(Path(sys.argv[1]))) else 0)
    told = {name: found(name) for name in sorted(shipped_scenes())}
    GOLDEN.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
