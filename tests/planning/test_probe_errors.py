"""Errors of what probes tell, by closed forms and against a finer run."""

import numpy as np
import pytest
from solid_scenes import solid_scene

import impactfem
from impactfem.report.table import summary_rows
from impactfem.result.table import Series, Table
from impactfem.runs.probe_errors import apart, told
from impactfem.scene import Scene
from impactfem.scene.probes import Probe

TIMES = np.linspace(0.0, 1.0, 41)


def tells(times=TIMES, quantity="stress", **columns):
    """What a probe tells by its columns."""
    data = {f"tip.{name}": Series(("time",), values) for name, values in columns.items()}
    probe = Probe(name="tip", body="bar", point=(0.0, 0.0), quantities=(quantity,))
    return told(Table.over_time(times, data), (probe,))


def distance(one, other, times=(TIMES, TIMES)):
    (found,) = apart(one, other, times, times[1]).values()
    return found


def test_of_scaled_values_is_the_scale():
    push = np.sin(3.0 * TIMES)
    assert distance(tells(sxx=push), tells(sxx=1.1 * push)) == pytest.approx(0.1, rel=1e-12)
    assert distance(tells(sxx=push), tells(sxx=push * (1.0 + 1e-13))) == 0.0
    assert distance(tells(sxx=0.0 * push), tells(sxx=push)) == np.inf


def test_of_stresses_does_not_depend_on_axes():
    rng = np.random.default_rng(3)
    stress, off = rng.normal(size=(2, len(TIMES), 2, 2))
    stress, off = (each + each.transpose(0, 2, 1) for each in (stress, 0.1 * off))

    def seen(angle):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s], [s, c]])
        each = (turn @ values @ turn.T for values in (stress, stress + off))
        return distance(*(tells(sxx=a[:, 0, 0], syy=a[:, 1, 1], sxy=a[:, 0, 1]) for a in each))

    assert seen(0.7) == pytest.approx(seen(0.0), rel=1e-12)


def test_of_velocities_does_not_depend_on_who_watches():
    speed, other = np.cos(TIMES), np.cos(TIMES) + 0.01 * TIMES
    still = distance(*(tells(quantity="velocity", vx=v) for v in (speed, other)))
    moving = distance(*(tells(quantity="velocity", vx=v + 50.0) for v in (speed, other)))
    assert moving == pytest.approx(still, rel=1e-9)


@pytest.mark.parametrize("start", ["at rest", "in flight"])
def test_bodies_that_do_nothing_have_no_errors_by_rounding(start):
    """A block that rests on a floor has no velocity, one in flight no stress, but for rounding."""
    rests = start == "at rest"
    block = {"kind": "block", "size": [1.0, 1.0], "corner": [0.0, 0.0 if rests else 50.0]}
    data = solid_scene(
        shape=block, mesh_size=0.1, duration=1.0, velocity=[0.0, 0.0] if rests else [3.0, 1.0],
        solve={"estimate": True}, gravity=[0.0, -1e-3] if rests else None,
    ).to_dict()  # fmt: skip
    point = [0.5, 0.8 if rests else 50.8]
    probe = {"name": "a", "body": "body", "point": point,
             "quantities": ["velocity", "acceleration", "stress"]}  # fmt: skip
    data |= {"probe": [probe]} | ({"start": "static"} if rests else {})
    found = impactfem.solve(Scene.from_dict(data)).summary["error"]["probes"]
    still = ("a.velocity", "a.acceleration") if rests else tuple(found)
    for name in still:
        assert found[name] < 0.2


def test_means_over_steps_are_compared_over_the_longer_ones():
    fine, coarse = np.linspace(0.0, 1.0, 41), np.linspace(0.0, 1.0, 11)
    means = [np.diff(np.sin(t), prepend=np.nan) / (t[1] - t[0]) for t in (fine, coarse)]
    one, other = (
        tells(t, "acceleration", ax=np.append(m[1], m[1:]))
        for t, m in zip((fine, coarse), means, strict=True)
    )
    assert distance(one, other, (fine, coarse)) == 0.0


def test_a_run_tells_errors_of_probes_and_which_it_cannot_tell():
    """In a disc that strikes a floor, against elements four times finer.

    The filter asks for a row every 1/1800 s, which runs with longer steps do not have.
    """
    at = {"body": "body", "point": [0.25, 0.75]}
    probes = [
        {"name": "mid", "quantities": ["stress", "velocity"]} | at,
        {"name": "quick", "quantities": ["acceleration"], "filter": "CFC180"} | at,
    ]

    def run(mesh_size, *, estimate):
        data = solid_scene(
            mesh_size=mesh_size, duration=0.04, youngs_modulus=7500.0, velocity=[0.0, -1.25],
            solve={"method": "massless", "estimate": estimate},
        ).to_dict()  # fmt: skip
        return impactfem.solve(Scene.from_dict(data | {"probe": probes}))

    found, best = run(0.0625, estimate=True), run(0.015625, estimate=False)
    probed = dict(found.summary["error"]["probes"])
    assert probed.pop("quick.acceleration") is None
    assert "quick.acceleration none is told" in dict(summary_rows(found.summary))["error"]
    tables = [Table.of(each.history) for each in (found, best)]
    times = [each.coords["time"].values for each in tables]
    true = apart(*(told(each, found.scene.probes) for each in tables), tuple(times), times[0])
    assert set(probed) == {"mid.stress", "mid.velocity"}
    for name, value in probed.items():
        assert 0.5 <= value / true[name] <= 10.0
