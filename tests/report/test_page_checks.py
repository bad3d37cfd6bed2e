"""Checks in the report tell runs that obey the contact conditions from those that do not."""

import numpy as np
import pytest
from synthetic import solid_result

from impactfem import Result, Scene
from impactfem.report.page.checks import checks, complementarity
from impactfem.runs.verdict import judge


@pytest.fixture
def result(tmp_path):
    return solid_result(tmp_path / "fields.vtkhdf")


def answers(result):
    return {check.name: check.holds for check in checks(result)}


def verdict(result):
    return judge(result.scene, result.history, result.summary, [], [])["verdict"]


def codes(result):
    return [finding["code"] for finding in verdict(result)["findings"]]


def severity(result, code):
    """Of the finding of a code; None if there is none."""
    found = [each["severity"] for each in verdict(result)["findings"] if each["code"] == code]
    return found[0] if found else None


def changed(result, **columns):
    history = result.history.copy(deep=True)
    for name, values in columns.items():
        history[name].values[:] = values
    return Result(result.scene, history, result.summary)


def test_a_pulse_with_closed_gap_passes_all_checks(result):
    assert all(answers(result).values())


def test_an_obstacle_that_pulls_is_found(result):
    force = result.history["contact_force"].values.copy()
    force[len(force) // 2 + 5] = -10.0
    assert answers(changed(result, contact_force=force))["Obstacles push, never pull"] is False


def test_force_across_an_open_gap_is_found(result):
    """A force that acts at the middle of the flight back, with the gap half open."""
    gap, force = result.history["gap"].values, result.history["contact_force"].values.copy()
    row = int(np.argmin(np.abs(gap[-8:] - 0.5 * gap.max()))) + len(gap) - 8
    force[row] = 0.3 * force.max()
    found = complementarity(changed(result, contact_force=force))
    assert found.holds is False
    expected = 0.3 * min(gap[row - 1], gap[row]) / gap.max()
    assert float(found.found.split("at most ")[1].split()[0]) == pytest.approx(expected, rel=5e-3)


def test_penetration_counts_by_the_size_of_the_body(result):
    contact = result.summary["contact"]
    # The disc is 1 m wide; a tenth of a body inside is no contact, a thousandth calls for care.
    for depth, told in ((9e-4, None), (1.1e-3, "warning"), (0.09, "warning"), (0.11, "fault")):
        summary = {**result.summary, "contact": {**contact, "max_penetration": depth}}
        judged = Result(result.scene, result.history, summary)
        assert answers(judged)["Bodies do not penetrate"] is (told is None)
        assert severity(judged, "penetration") == told


@pytest.mark.parametrize(
    ("error", "level"),
    [(None, "care"), (0.045, "trust"), (0.055, "care"), (0.45, "care"), (0.55, "do_not_trust")],
)
def test_the_size_of_the_error_decides_how_far_to_trust(result, error, level):
    figures = error and {
        "reference": "same on elements twice as large", "measured": False,
        "displacement_max": error, "displacement_l2": error, "force_l1": error,
    }  # fmt: skip
    judged = Result(result.scene, result.history, {**result.summary, "error": figures})
    assert verdict(judged)["level"] == level


@pytest.mark.parametrize(
    ("normals", "growth", "level", "why"),
    [
        ("updated", 1.1e-6, "care", "contact that follows the bodies"),
        ("fixed", 9e-3, "care", "nothing feeds it"),
        ("updated", 1.1e-2, "do_not_trust", "contact that follows the bodies"),
        ("aloft", 9e-3, "care", "nothing touches: its steps ("),
        ("fixed", 9e-7, "care", None),  # for want of an estimate
    ],
)
def test_growth_of_energy_is_judged_by_its_size(result, normals, growth, level, why):
    summary = {**result.summary, "plan": {**result.summary["plan"], "normals": normals}}
    summary["energy"] = {**summary["energy"], "grows": True, "max_relative_growth": growth}
    if normals == "aloft":
        summary["contact"] = {**summary["contact"], "impulse": 0.0}
    found = verdict(Result(result.scene, result.history, summary))
    assert found["level"] == level
    texts = [each["text"] for each in found["findings"] if each["code"] == "energy_growth"]
    assert [why in text for text in texts] == [True] * (why is not None)


@pytest.mark.parametrize(
    ("lost", "damping", "told"), [(0.055, 0.0, True), (0.045, 0.0, False), (0.1, 2.0, False)]
)
def test_energy_that_nothing_takes_is_missed(result, lost, damping, told):
    scene = result.scene.with_settings({"body.body.rayleigh_mass": damping})
    summary = {**result.summary, "energy": {**result.summary["energy"], "unexplained": -lost}}
    assert ("energy_loss" in codes(Result(scene, result.history, summary))) is told


def test_bodies_without_elements_are_not_told_to_make_them_smaller(result):
    point = {"kind": "point", "name": "body", "mass": 1.0, "position": [0.0, 1.0]}
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    tables = {"title": "point", "duration": 1.0, "body": [point], "obstacle": [floor]}
    scene = Scene.from_dict(tables)
    figures = {
        "reference": "", "measured": False, "displacement_max": 0.1, "displacement_l2": 0.1,
        "force_l1": 0.1,
    }  # fmt: skip
    energy = {**result.summary["energy"], "unexplained": -0.1, "max_relative_growth": 0.1}
    for error in (figures, None):  # a plan that says how it estimates is no reason for no estimate
        reasons = {"estimate": "by runs with larger steps"}
        more = {"normals": "updated", "reasons": reasons, "estimate": True}
        plan = {**result.summary["plan"], **more}
        judged = {**result.summary, "energy": energy, "error": error, "plan": plan}
        for found in verdict(Result(scene, result.history, judged))["findings"]:
            assert "element" not in found["text"] + found["remedy"]
            assert "mesh" not in found["text"]
            assert "by runs" not in found["text"]
