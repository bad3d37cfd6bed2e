"""What plan and run of every shipped scene find, against the one list of it.

After a change that is meant: `python tests/verification/test_findings.py` writes the list anew;
read its difference.
"""

import json
from pathlib import Path

import pytest

import impactfem
from impactfem import Scene
from impactfem.shipped import shipped_scenes

GOLDEN = Path(__file__).with_name("findings.json")


def found(name):
    """Level and findings of a shipped scene: code, severity and subject of each."""
    scene = Scene.from_toml(shipped_scenes()[name]).with_settings(["output.fields=[]"])
    plan, summary = impactfem.plan(scene), impactfem.solve(scene).summary
    return {
        "plan": [[each.code, each.severity, each.subject] for each in plan.findings],
        "run": [
            [each["code"], each["severity"], each["subject"]]
            for each in summary["verdict"]["findings"]
        ],
        "level": summary["verdict"]["level"],
        "status": summary["status"],
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_scenes())
def test_findings_of_shipped_scenes(name):
    assert found(name) == json.loads(GOLDEN.read_text(encoding="utf-8"))[name]


def test_the_list_names_the_shipped_scenes():
    assert list(json.loads(GOLDEN.read_text(encoding="utf-8"))) == sorted(shipped_scenes())


if __name__ == "__main__":
    told = {name: found(name) for name in sorted(shipped_scenes())}
    GOLDEN.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
