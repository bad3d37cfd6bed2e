"""The demos of bodies of different kinds: scenes are the shipped ones, pages hold."""

import re
from pathlib import Path

import pytest
from demo_process import script

from impactfem.shipped import shipped_scenes

DEMO = Path(__file__).resolve().parents[2] / "demos" / "hammer_bar"


def test_scene_of_the_demo_is_the_shipped_one():
    mine = (DEMO / "scene.toml").read_text(encoding="utf-8")
    assert mine == shipped_scenes()["hammer_bar"].read_text(encoding="utf-8")


@pytest.mark.slow
def test_hammers_leave_as_the_page_says(tmp_path):
    page = (DEMO / "README.md").read_text(encoding="utf-8")
    said = script(DEMO / "script.py", tmp_path)
    assert (tmp_path / "hammers.png").read_bytes().startswith(b"\x89PNG")
    ends = re.findall(r"(?m)^\| [12] \| (\d\.\d+)", page)
    assert ends == re.findall(r"ends at (\d\.\d+) L/c", said)
    assert "lasts beyond 4.000" in said
    (error,) = re.findall(r"over Z v: (\d\.\de-\d+) for equal", page)
    assert f"right to {error}" in said
