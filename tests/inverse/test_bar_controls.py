"""Controls and gradients of bars: known optima, one-sided slopes on layers, what is refused."""

import json

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError
from impactfem.cli import main

PLAIN = {"report": False, "pictures": False, "fields": []}
UNIT = {"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0}


def catch(start, pieces=2, **solve):
    """A bar that strikes at .5 s with .5 m/s, and is brought to rest from its far end."""
    return Scene.from_dict({
        "title": "catch", "duration": 2.5,
        "body": [UNIT | {"gap": 0.25, "velocity": -0.5}],
        "obstacle": [{"kind": "wall"}],
        "control": [{"name": "push", "acts": "body.bar.far_end_force", "pieces": pieces,
                     "from": 0.5, "until": 2.5, "start": start, "bounds": [-1.0, 1.0]}],
        "objective": {"minimise": [{"term": "terminal_energy"}]},
        "solve": solve, "output": PLAIN,
    })  # fmt: skip


@pytest.mark.parametrize("method", ["exact", "galerkin"])
def test_slope_of_the_energy_that_a_push_leaves(method):
    # A push f ds changes the energy by -v0 f ds before the first wave is back, then by +v0 f ds.
    found = impactfem.gradient(catch(0.0, 4, method=method))
    assert found.objective == pytest.approx(0.125, abs=1e-12)
    wanted = [-0.25, -0.25, 0.25, 0.25]
    np.testing.assert_allclose(list(found.gradient.values()), wanted, atol=1e-8)
    assert found.method == method
    assert found.trusted


@pytest.mark.parametrize(
    ("share", "energy"), [(0.0, 0.125), (0.5, 0.03125), (1.0, 0.0), (1.5, 0.03125)]
)
def test_energy_left_by_shares_of_the_best_push(share, energy):
    found = impactfem.gradient(catch([0.25 * share, -0.25 * share]))
    assert found.objective == pytest.approx(energy, abs=1e-12)  # lifts off early where it is 1.5


def test_a_bar_is_caught(tmp_path):
    path = tmp_path / "catch.toml"
    path.write_text(catch(0.0).to_toml(tmp_path))
    assert main(["optimise", str(path), "--out", str(tmp_path / "out")]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    values = [each["value"] for each in summary["parameters"].values()]
    np.testing.assert_allclose(values, [0.25, -0.25], atol=1e-9)
    assert summary["objective"]["final"] < 1e-18
    assert abs(summary["objective"]["verified"]) < 1e-15
    force = impactfem.Result.load(tmp_path / "out" / "verified").history
    t = np.asarray(force["time"])
    pressing = np.asarray(force["contact_force"])
    assert pressing[(t > 0.51) & (t < 1.49)] == pytest.approx(0.5, abs=1e-9)
    assert np.abs(pressing[t > 1.52]).max() < 1e-9


def test_a_load_is_switched_off_in_time():
    # p = .1 presses from the start; where it ends decides what vibrates after the release.
    found = impactfem.optimise(Scene.from_dict({
        "title": "late", "duration": 5.5, "gravity": [[0.0, 0.1], [1.4, 0.0]],
        "body": [UNIT | {"gap": 0.5, "velocity": -0.5}], "obstacle": [{"kind": "wall"}],
        "parameter": [{"name": "off", "key": "gravity.1.0", "bounds": [0.92, 2.9]}],
        "objective": {"minimise": [{"term": "speed", "body": "bar", "weight": -1.0},
                                   {"term": "vibration_energy", "weight": 10.0}]},
        "output": PLAIN,
    }))  # fmt: skip
    assert found.status == "converged"
    assert found.parameters["off"]["value"] == pytest.approx(1.6049719656, abs=2e-8)
    assert found.objective["final"] == pytest.approx(-0.6286861707, abs=1e-10)


def damped(pieces, weight):
    """Least effort and vibration of a released bar, independently: cells of its wave at the end.

    A wave w of the end is 2 (f of this pass and of the one before) later; vibration is the energy
    of what is not its mean.
    """
    half, dt = pieces // 2, 4.0 / pieces
    s = np.linspace(0.0, 2.0, 50 * half + 1)
    middles = 0.5 * (s[1:] + s[:-1])
    wave = np.where(middles < 1.0, 0.2 * middles, -0.2 * (2.0 - middles))  # comes to the far end
    cells = wave.reshape(half, 50)
    means = cells.mean(axis=1)
    # A free bar that is r in one pass: its energy is the mean of r^2 / 4 over 2 s.
    left = 0.5 * (0.2 * 2.0 / half) ** 2 / 12.0  # of lines in the cells less their means
    centred = np.eye(half) - 1.0 / half
    both = np.hstack([np.eye(half), np.eye(half)])
    # weight * (left + .25 dt |centred (means + 2 both f)|^2) + dt |f|^2
    a = weight * dt * both.T @ centred @ both + dt * np.eye(pieces)
    f = np.linalg.solve(a, -weight * 0.5 * dt * both.T @ centred @ means)
    rest = centred @ (means + 2.0 * both @ f)
    return f, weight * (left + 0.25 * dt * rest @ rest) + dt * f @ f


def test_a_released_bar_is_damped_from_its_end():
    pieces, weight = 8, 100.0
    found = impactfem.optimise(Scene.from_dict({
        "title": "damping", "duration": 4.0,
        "body": [UNIT | {"gap": 0.5, "velocity": 0.5, "displacement": "-0.2*(x - 0.5*x*x)"}],
        "obstacle": [{"kind": "wall"}],
        "control": [{"name": "push", "acts": "body.bar.far_end_force", "pieces": pieces,
                     "bounds": [-1.0, 1.0]}],
        "objective": {"minimise": [{"term": "effort", "of": "push"},
                                   {"term": "vibration_energy", "weight": weight}]},
        "output": PLAIN,
    }))  # fmt: skip
    wanted, cost = damped(pieces, weight)
    values = [each["value"] for each in found.parameters.values()]
    np.testing.assert_allclose(values, wanted, atol=1e-6)
    assert found.objective["final"] == pytest.approx(cost, rel=1e-6)
    assert found.trusted


def founding(gap, elements, method="galerkin"):
    """The impulse of the founding bar against that of a gap of .5 m: a misfit at its layers."""
    times = np.linspace(0.0, 4.0, 4 * elements + 1)
    return {
        "title": "founding", "duration": 4.0,
        "body": [UNIT | {"gap": gap, "velocity": -0.5}], "obstacle": [{"kind": "wall"}],
        "parameter": [{"name": "H", "key": "body.bar.gap", "bounds": [0.1, 1.0]}],
        "measure": [{"name": "p", "of": "impulse.bar.wall", "data": "impulse.csv"}],
        "solve": {"method": method, "elements": elements}, "output": PLAIN,
    }, np.column_stack([times, np.clip(0.5 * (times - 1.0), 0.0, 1.0)])  # fmt: skip


def slopes(tmp_path, *args):
    data, table = founding(*args)
    lines = [f"{t!r},{value!r}" for t, value in table.tolist()]
    (tmp_path / "impulse.csv").write_text("\n".join(["time,value", *lines]))
    return impactfem.gradient(Scene.from_dict(data, tmp_path))


@pytest.mark.parametrize("method", ["galerkin", "monolithic"])
def test_impacts_on_layers_have_two_slopes(tmp_path, method):
    # J = int (p - p*)^2 dt: .3825 below, .3775 above, their mean .38 is that of the exact solution.
    found = slopes(tmp_path, 0.6, 40, method)
    below, above = found.sides["H"]
    assert 0.05 * below == pytest.approx(0.3825, abs=1e-8)
    assert 0.05 * above == pytest.approx(0.3775, abs=1e-8)
    assert 0.05 * found.gradient["H"] == pytest.approx(0.38, abs=1e-8)
    assert found.error["H"] < 1e-8
    assert found.trusted
    assert found.as_dict()["check"]["strict_complementarity"] == 0.0


def test_slopes_off_layers_tell_how_far_they_are_off(tmp_path):
    found = slopes(tmp_path, 0.613, 40)
    assert found.sides is None
    assert found.check.rate == pytest.approx(2.0, abs=1e-4)
    assert 1e-3 < found.error["H"] < 0.9 / 40 * 8.5  # of the exact derivative 8.4775
    assert abs(found.gradient["H"] - 8.4775) == pytest.approx(found.error["H"], rel=1e-3)


def test_a_misspelt_place_to_act_on_is_refused():
    data = catch(0.0).to_dict()
    data["control"] = [{"name": "pull", "acts": "body.bar.far_end_forces", "pieces": 2}]
    with pytest.raises(SceneError, match="far_end_force"):
        Scene.from_dict(data)
    data["control"] = [{"name": "pull", "acts": "body.bars.far_end_force", "pieces": 2}]
    with pytest.raises(SceneError, match=r'no "bars"; write 0 or bar'):
        Scene.from_dict(data)


@pytest.mark.parametrize("method", ["exact", "galerkin"])
def test_the_largest_force_follows_the_speed(method):
    # rho A c v0, of a bar of two times the section.
    data = catch(0.0, method=method).to_dict()
    data["body"][0] |= {"area": 2.0, "gap": 0.3, "far_end_force": 0.0}
    data["control"] = []
    data["parameter"] = [{"name": "v", "key": "body.bar.velocity"}]
    data["objective"] = {"minimise": [{"term": "peak_force", "pair": "bar.wall"}]}
    found = impactfem.gradient(Scene.from_dict(data))
    assert found.objective == pytest.approx(1.0, rel=1e-9)
    assert found.gradient["v"] == pytest.approx(-2.0, rel=1e-7)
    data["objective"]["minimise"][0]["pair"] = "bar.floor"
    with pytest.raises(SceneError, match=r'pair = "bar.floor": there is bar.wall'):
        impactfem.gradient(Scene.from_dict(data))
    data["objective"]["minimise"][0].pop("pair")
    with pytest.raises(SceneError, match="pair is missing"):
        Scene.from_dict(data)
