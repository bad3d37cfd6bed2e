"""Turns and strains beyond small-strain elasticity: foreseen, measured, and never trusted."""

import pytest

import impactfem

FLOOR = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
MODEL = {"model_rotation", "model_strain"}


def rubber(name, shape, **keys):
    return {
        "name": name, "kind": "solid", "model": "plane_strain", "shape": shape,
        "mesh_size": 0.0125, "density": 1100.0, "youngs_modulus": 1e6, "poisson_ratio": 0.4,
    } | keys  # fmt: skip


def disc(name, centre, **keys):
    return rubber(name, {"kind": "disc", "radius": 0.05, "center": centre}, **keys)


def scene(duration, *bodies, **keys):
    tables = {"title": "limits", "duration": duration, "body": bodies, "output": {"fields": []}}
    return impactfem.Scene.from_dict(tables | keys)


def inclined(speed=1.0):
    """A beam-like block, dropped at 30 degrees."""
    shape = {"kind": "block", "size": [0.2, 0.05], "corner": [-0.1, 0.06], "angle": 0.5236}
    body = rubber("beam", shape, velocity=[0.0, -speed], mesh_size=0.025)
    return scene(0.15, body, obstacle=[FLOOR])


def spinning(speed=1.0):
    """Two discs, one at 20 rad/s."""
    left = disc("left", [-0.052, 0.0], velocity=[0.5 * speed, 0.0], angular_velocity=20.0 * speed)
    return scene(0.1, left, disc("right", [0.052, 0.0]))


def off_centre(speed=1.0):
    """A block that a disc strikes near its end."""
    block = rubber("block", {"kind": "block", "size": [0.05, 0.2], "corner": [0.0, -0.1]})
    shape = {"kind": "disc", "radius": 0.03, "center": [-0.032, 0.07]}
    return scene(0.2, block, rubber("ball", shape, velocity=[1.5 * speed, 0.0]))


def sliding(speed=1.0):
    """A disc that slides on a floor under gravity and should roll."""
    body = disc("disc", [0.0, 0.05], velocity=[0.5 * speed, 0.0])
    contact = [{"between": ["disc", "floor"], "friction_coefficient": 0.3}]
    return scene(0.4, body, obstacle=[FLOOR], contact=contact, gravity=[0.0, -9.81])


def fast(speed=1.0):
    """A disc at 12 m/s, 40 % of the speed of its waves."""
    return scene(0.008, disc("disc", [0.0, 0.051], velocity=[0.0, -12.0 * speed]), obstacle=[FLOOR])


def faults(findings):
    return {entry["code"] for entry in findings if entry["severity"] == "fault"} & MODEL


@pytest.mark.parametrize("case", [inclined, spinning, off_centre, sliding, fast])
def test_the_plan_foresees_it(case):
    found = [entry.as_dict() for entry in impactfem.plan(case()).findings]
    assert faults(found) == {"model_strain" if case is fast else "model_rotation"}
    slow = impactfem.plan(case(0.03)).findings
    assert not {entry.code for entry in slow} & MODEL


@pytest.mark.parametrize(
    ("case", "name", "code"),
    [(off_centre, "block", "model_rotation"), (fast, "disc", "model_strain")],
)
def test_the_run_measures_it_and_is_not_trusted(case, name, code):
    summary = impactfem.solve(case()).summary
    assert summary["status"] == "out_of_model"
    assert summary["verdict"]["level"] == "do_not_trust"
    assert code in faults(summary["verdict"]["findings"])
    (found,) = [
        entry for entry in summary["verdict"]["findings"]
        if (entry["code"], entry["subject"]) == (code, name)
    ]  # fmt: skip
    key = {"model_rotation": "rotation_max", "model_strain": "strain_99"}[code]
    assert found["value"] == summary["bodies"][name][key] > found["limit"]
    assert found["remedy"]


@pytest.mark.slow
@pytest.mark.parametrize("case", [inclined, spinning, sliding])
def test_other_turns_are_measured_too(case):
    summary = impactfem.solve(case(), estimate=False).summary
    assert faults(summary["verdict"]["findings"])
    assert summary["bodies"][case().bodies[0].name]["rotation_max"] > 0.3


@pytest.mark.parametrize(("case", "speed"), [(off_centre, 0.03), (fast, 0.015)])
def test_a_run_well_inside_the_limits_says_nothing_of_the_model(case, speed):
    summary = impactfem.solve(case(speed)).summary
    assert summary["status"] == "completed"
    assert not {entry["code"] for entry in summary["verdict"]["findings"]} & MODEL
    for body in summary["bodies"].values():
        assert body["rotation_max"] < 0.05
        assert body["strain_99"] < 0.025


def test_an_estimated_error_does_not_speak_for_the_model():
    from impactfem.report.page.verdict import reasons
    from impactfem.report.table import summary_rows

    summary = impactfem.solve(fast()).summary
    told = "it says nothing of the model"
    assert any(told in text for text in reasons(summary))
    assert told in dict(summary_rows(summary))["error"]
