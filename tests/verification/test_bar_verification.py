"""The founding benchmarks through the public interface, against closed forms and each other."""

import numpy as np
import pytest

import impactfem


def bar_scene(duration, *, gravity=0.0, solve=None, **bar):
    settings = {"length": 1.0, "density": 1.0, "youngs_modulus": 1.0, **bar}
    return impactfem.Scene(
        title="test",
        duration=duration,
        gravity=gravity,
        bodies=[impactfem.Bar(**settings)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(**(solve or {})),
    )


def k1(t, x, height=0.5, speed=0.5, length=1.0, c=1.0):
    """Closed form of the slides for a bar without load, written down independently of `exact`."""
    hit, leave = height / speed + x / c, height / speed + (2 * length - x) / c
    before = height - speed * t
    held = height - speed * hit
    return np.where(t < hit, before, np.where(t < leave, held, held + speed * (t - leave)))


@pytest.mark.parametrize("method", ["monolithic", "galerkin"])
@pytest.mark.parametrize("elements", [10, 20, 40, 80, 160])
def test_k1_is_exact_at_the_nodes(elements, method):
    scene = bar_scene(
        5.0,
        gap=0.5,
        velocity=-0.5,
        solve={"method": method, "elements": elements, "window": "all"},
    )
    result = impactfem.solve(scene)
    fields, summary, history = result.fields, result.summary, result.history
    expected = k1(fields.times[:, None], fields.positions[None, :])
    assert np.abs(fields.displacement - expected).max() <= 1e-11

    force = history["contact_force"].values[1:]
    middle = 0.5 * (fields.times[1:] + fields.times[:-1])
    pushed = (middle > 1.0) & (middle < 3.0)
    assert np.abs(force - 0.5 * pushed).max() <= 1e-10

    assert summary["active_set"]["iterations"] <= 4
    assert summary["active_set"]["set_changes"] == [4 * elements, 2 * elements, 0]
    assert summary["contact"]["max_penetration"] <= 1e-12
    assert summary["contact"]["intervals"] == pytest.approx(np.array([[1.0, 3.0]]), abs=1e-12)

    # That of the waves: what nodal values lack of it in contact, rho h v0^2 / 4, is in it.
    assert np.abs(history["total_energy"].values - 0.125).max() <= 1e-12


def test_k1_error_report_agrees_with_the_closed_form():
    result = impactfem.solve(
        bar_scene(5.0, gap=0.515, velocity=-0.5, solve={"elements": 10}), method="galerkin"
    )
    fields = result.fields
    expected = k1(fields.times[:, None], fields.positions[None, :], height=0.515)
    error = np.abs(fields.displacement - expected).max() / np.abs(expected).max()
    assert error > 1e-3
    assert result.summary["error"]["displacement_max"] == pytest.approx(error, rel=1e-9)


@pytest.mark.parametrize("elements", [20, 40])
def test_prestretched_rod_is_exact_over_four_impacts(elements):
    scene = bar_scene(
        12.0,
        far_end="clamped",
        displacement="(1 - x)/2",
        solve={"method": "monolithic", "elements": elements},
    )
    result = impactfem.solve(scene)
    t, gap = result.history["time"].values, result.history["gap"].values
    phase = np.mod(t + 1e-9, 3.0) - 1e-9
    expected = np.where(phase < 1, (1 - phase) / 2, np.where(phase < 2, 0.0, (phase - 2) / 2))
    assert np.abs(gap - expected).max() <= 1e-10
    middle = np.mod(0.5 * (t[1:] + t[:-1]), 3.0)
    force = np.where((middle > 1) & (middle < 2), 0.5, 0.0)
    assert np.abs(result.history["contact_force"].values[1:] - force).max() <= 1e-10
    assert len(result.summary["contact"]["intervals"]) == 4
    assert result.summary["error"]["displacement_max"] <= 1e-10
    # One active-set loop for four impacts: about n + 6 iterates.
    assert result.summary["active_set"]["iterations"] <= elements + 10


def test_doyen_impact_settles_in_four_iterations():
    scene = bar_scene(
        2.0,
        length=10.0,
        youngs_modulus=900.0,
        gap=5.0,
        velocity=-10.0,
        solve={"method": "monolithic", "elements": 40},
    )
    summary = impactfem.solve(scene).summary
    assert summary["active_set"]["iterations"] <= 4
    assert summary["error"]["displacement_max"] <= 1e-10
    assert summary["error"]["force_l1"] <= 1e-10
    assert summary["contact"]["max_force"] == pytest.approx(300.0, rel=1e-10)  # rho c v0
    assert summary["contact"]["intervals"][0] == pytest.approx([0.5, 0.5 + 2 / 3], abs=1e-10)


def order(sizes, errors):
    """Slope of the error against h in a log-log fit."""
    return -np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def test_impact_between_grid_points_is_of_first_order_without_oscillation():
    sizes, displacement, force = (10, 20, 40, 80), [], []
    for n in sizes:
        # The impact falls 0.4 of a layer after a grid time, at every n.
        scene = bar_scene(
            5.0,
            gap=0.5 * (1.0 + 0.4 / n),
            velocity=-0.5,
            solve={"method": "galerkin", "elements": n},
        )
        result = impactfem.solve(scene)
        displacement.append(result.summary["error"]["displacement_max"])
        force.append(result.summary["error"]["force_l1"])
        pushed = result.history["contact_force"].values
        assert pushed.min() >= 0.0
        # One rise and one fall, no overshoot beyond the plateau: nothing oscillates.
        assert pushed.max() <= 0.5 * (1 + 1e-9)
        assert np.abs(np.diff(pushed)).sum() <= 2 * 0.5 * (1 + 1e-9)
        assert result.summary["contact"]["max_penetration"] <= 1e-12
    assert order(sizes, displacement) >= 0.95
    assert order(sizes, force) >= 0.95


def test_bar_falling_in_gravity_has_the_force_of_the_slides():
    """K2: lambda = -c (v0 + p t) during contact, tau = (sqrt(v0^2 + 2 p H) - v0) / p."""
    v0, p = 0.5, 0.1
    sizes, errors = (20, 40, 80, 160), []
    for n in sizes:
        # Impact 0.4 of a layer after a grid time at every n, near H = 1/2.
        tau = (np.floor(0.91608 * n) + 0.4) / n
        height = v0 * tau + 0.5 * p * tau**2
        assert height == pytest.approx(0.5, abs=0.05)
        scene = bar_scene(
            4.0, gravity=p, gap=height, velocity=-v0, solve={"method": "galerkin", "elements": n}
        )
        result = impactfem.solve(scene)
        errors.append(result.summary["error"]["displacement_max"])
        t, force = result.history["time"].values, result.history["contact_force"].values
        inside = (t > tau + 4 / n) & (t < tau + 2 - 4 / n)
        slope, value = np.polyfit(t[inside], force[inside], 1)
        # The discrete bar hits up to a layer later and with that much more speed.
        assert slope == pytest.approx(p, abs=2.0 / n * p)
        assert slope * (tau + 0.5) + value == pytest.approx(v0 + p * (tau + 0.5), abs=0.2 / n)
        assert result.summary["contact"]["intervals"] == [
            pytest.approx([tau, tau + 2.0], abs=2.0 / n)
        ]
    assert order(sizes, errors) >= 0.95


def test_step_load_leaves_no_vibration():
    """K3: with the load switched off at impact the bar rebounds rigidly at v0 + p tau."""
    v0, p, tau = 0.5, 0.1, 1.0
    height = v0 * tau + 0.5 * p * tau**2
    scene = bar_scene(
        4.0, gravity=[[0.0, p], [tau, 0.0]], gap=height, velocity=-v0, solve={"method": "galerkin"}
    )
    result = impactfem.solve(scene)
    after = result.history.sel(time=slice(3.1, None))
    speed = v0 + p * tau
    assert after["bar.vx"].values == pytest.approx(speed, rel=2e-3)
    assert result.summary["contact"]["max_force"] == pytest.approx(speed, rel=2e-2)
    assert np.abs(after["elastic_energy"].values).max() <= 1e-3 * 0.5 * speed**2


def test_snes_vi_differs_from_the_active_set_only_from_release_on():
    """Pairing u_m with the residual of one test node loses the half force at release."""
    scene = bar_scene(5.0, gap=0.5, velocity=-0.5, solve={"method": "monolithic", "elements": 20})
    mine = impactfem.solve(scene)
    petsc = impactfem.solve(scene, active_set="snes_vi")
    assert petsc.summary["status"] == "completed"
    t = mine.history["time"].values
    difference = np.abs(mine.fields.displacement - petsc.fields.displacement)
    assert difference[t < 3.0 + 1e-9].max() <= 1e-10
    assert difference[t > 3.1].max() == pytest.approx(1 / 20, rel=1e-6)  # one h, of order 1
    lost = mine.history["total_energy"].values[-1] - petsc.history["total_energy"].values[-1]
    assert lost == pytest.approx(0.25 / 20 * 0.25, rel=1e-6)  # rho h v0^2 / 4
