"""The swept methods against the assembled space-time system, closed forms and conservation laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import impactfem
from impactfem.marching.march import Marching, march
from impactfem.marching.schemes import SCHEMES
from impactfem.mesh.spacetime import layered_mesh
from impactfem.reference.bar import exact_bar
from impactfem.result.bar_motion import BarMotion
from impactfem.spacetime.galerkin import GalerkinSettings, solve_galerkin
from impactfem.system.chain import Chain

STILL = impactfem.bodies.PiecewiseConstant((0.0,), (0.0,))


def bar(**keys):
    return impactfem.Bar(**{"length": 1.0, "density": 1.0, "youngs_modulus": 1.0, **keys})


def energy(motion: BarMotion):
    return motion.kinetic + motion.elastic + motion.potential


def run(body, gravity, method, elements, layers, courant=1.0, **numbers):
    dt = courant * body.transit_time / elements
    positions = np.linspace(0.0, body.length, elements + 1)
    return march(body, gravity, positions, SCHEMES[method], Marching(dt, layers, **numbers))


BODIES = {
    "thrown": {"gap": 0.513, "velocity": -0.5, "length": 1.5, "youngs_modulus": 4.0},
    "clamped": {"far_end": "clamped", "displacement": "0.3*(1 - x)*(1 + 0.2*sin(3*x))"},
    "vibrating": {"gap": 0.2, "velocity": "-0.5 + 0.2*x", "displacement": "0.05*cos(3.1*x)"},
}


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("courant", [1.0, 0.9])
@pytest.mark.parametrize(
    "gravity", [STILL, impactfem.bodies.PiecewiseConstant((0.0, 0.43), (0.3, -0.2))]
)
def test_sweep_equals_the_assembled_system(name, courant, gravity):
    """The block triangular recursion is the Petrov-Galerkin system of the Gmsh mesh."""
    from impactfem.fem import MPI

    body, elements, layers = bar(**BODIES[name]), 12, 40
    space = layered_mesh(MPI.COMM_WORLD, elements, layers, courant)
    whole = solve_galerkin(space, body, gravity, GalerkinSettings())
    assert whole.effort.converged
    for window in (1, 7, layers):
        swept = run(body, gravity, "galerkin", elements, layers, courant, window=window)
        assert swept.effort.converged
        assert np.abs(swept.displacement - whole.displacement).max() <= 1e-11
        assert np.abs(swept.multiplier - whole.multiplier).max() <= 1e-9
        assert energy(swept)[1:] == pytest.approx(energy(whole)[1:], abs=1e-10)


@pytest.mark.parametrize("window", [3, 40, 200])
def test_windows_do_not_change_the_answer(window):
    body = bar(gap=0.47, velocity=-0.6)
    gravity = impactfem.bodies.PiecewiseConstant((0.0, 1.1), (0.7, 0.2))
    single = run(body, gravity, "galerkin", 20, 200, 0.8, max_iterations=500)
    windowed = run(body, gravity, "galerkin", 20, 200, 0.8, window=window, max_iterations=500)
    assert windowed.effort.converged
    assert windowed.displacement == pytest.approx(single.displacement, abs=1e-11)
    assert windowed.multiplier == pytest.approx(single.multiplier, abs=1e-8)


def test_founding_algorithm_takes_three_iterations_in_one_window():
    motion = run(bar(gap=0.5, velocity=-0.5), STILL, "galerkin", 40, 200, window=200)
    assert motion.effort.set_changes == (160, 80, 0)


def doyen(duration, method, elements=40, courant=1.0, **keys):
    scene = impactfem.Scene(
        title="bounces",
        duration=duration,
        gravity=10.0,
        bodies=[bar(length=10.0, youngs_modulus=900.0, gap=5.0)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method=method, elements=elements, courant=courant),
        output=impactfem.Output(**keys),
    )
    return impactfem.solve(scene)


def test_seven_bounces_are_exact_at_courant_one():
    result = doyen(20.0, "galerkin")
    exact = exact_bar(result.scene)
    found = np.array(result.summary["contact"]["intervals"])
    expected = np.array([[1 + 8 * k / 3, 5 / 3 + 8 * k / 3] for k in range(7)])
    assert np.array(exact.contacts)[:7] == pytest.approx(expected, abs=1e-9)
    assert found[:7] == pytest.approx(expected, abs=1e-9)
    assert result.summary["error"]["displacement_max"] <= 1e-9


@pytest.mark.parametrize("courant", [0.5, 1.0, 2.0])
def test_conserving_method_keeps_energy_over_750_bounces(courant):
    result = doyen(2000.0, "conserving", elements=20, courant=courant, every=1000)
    assert len(result.summary["contact"]["intervals"]) > 500
    assert result.summary["energy"]["max_relative_drift"] <= 1e-9


@pytest.mark.parametrize(
    ("method", "courant"),
    [
        *(("galerkin", c) for c in (0.1, 0.5, 0.999, 1.0)),
        *(("conserving", c) for c in (0.1, 0.5, 0.999, 1.0, 2.0)),
    ],
)
def test_energy_never_grows(method, courant):
    motion = run(
        bar(gap=0.513, velocity=-2.0),
        impactfem.bodies.PiecewiseConstant((0.0,), (1.0,)),
        method,
        20,
        int(300 / courant),
        courant,
    )
    total = energy(motion)
    assert motion.multiplier.min() < -1.0
    assert total.max() <= total[0] * (1 + 1e-9)


@settings(max_examples=40, deadline=None)
@given(
    st.floats(0.05, 1.0), st.floats(0.1, 3.0), st.floats(0.0, 2.0), st.floats(0.2, 3.0),
    st.sampled_from(["galerkin", "conserving"]), st.floats(0.1, 1.0),
)  # fmt: skip
def test_signorini_conditions_hold_in_every_layer(gap, speed, pull, length, method, courant):
    body = bar(gap=gap, velocity=-speed, length=length)
    gravity = impactfem.bodies.PiecewiseConstant((0.0,), (pull,))
    motion = run(body, gravity, method, 10, 120, courant)
    assert motion.gap.min() >= 0.0
    assert motion.multiplier.max() <= 0.0
    pushed = motion.multiplier < 0.0
    if method != "conserving":
        assert np.all(motion.gap[1:][pushed] == 0.0)
    total = energy(motion)
    allowed = 0.0
    if method == "galerkin":
        # The contact rows do work only at release: |lambda_b| u^{b+1} / 4 at the end b of contact.
        ends = np.flatnonzero(pushed[:-1] & ~pushed[1:])
        allowed = 0.25 * np.sum(-motion.multiplier[ends] * motion.gap[ends + 2])
    assert total.max() - total[0] <= allowed + 1e-10 * np.abs(motion.kinetic).max()


def test_force_of_the_conserving_method_off_the_grid():
    """Issue figure: K1 off the grid, courant 1/2, n = 160: L1 error <= 2 %, little overshoot."""
    scene = impactfem.Scene(
        title="K1 off the grid",
        duration=5.0,
        bodies=[bar(gap=0.5 * (1.0 + 0.4 / 160), velocity=-0.5)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method="conserving", elements=160, courant=0.5),
    )
    result = impactfem.solve(scene)
    assert result.summary["error"]["force_l1"] <= 0.02
    overshoot = result.summary["contact"]["max_force"] / 0.5 - 1.0
    assert overshoot <= 0.35


def test_conserving_method_converges_with_first_order():
    errors, sizes = [], (40, 80, 160, 320)
    for n in sizes:
        motion = run(bar(gap=0.513, velocity=-0.5), STILL, "conserving", n, 10 * n, 0.5)
        expected = np.where(
            motion.times < 1.026,
            0.513 - 0.5 * motion.times,
            np.where(motion.times < 3.026, 0.0, 0.5 * (motion.times - 3.026)),
        )
        errors.append(np.abs(motion.gap - expected).max())
    order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert 0.6 <= order <= 1.1  # shocks limit it below 1


def test_newmark_is_a_negative_control():
    result = doyen(20.0, "newmark")
    assert result.summary["status"] == "unstable"
    assert result.summary["energy"]["grows"]
    assert result.summary["energy"]["max_relative_growth"] > 10.0
    assert "negative control" in result.summary["plan"]["findings"][0]["text"]


def test_highest_frequency_of_equal_elements_is_two_c_over_h():
    chain = Chain.of_bar(bar(length=3.0, youngs_modulus=4.0), np.linspace(0, 3, 31))
    assert chain.highest_frequency == pytest.approx(2 * 2.0 / 0.1, rel=1e-12)
    limit = SCHEMES["galerkin"].stable_dt(chain)
    assert limit == pytest.approx(0.1 / 2.0, rel=1e-12)
    assert SCHEMES["conserving"].stable_dt(chain) == np.inf


def test_graded_elements_march_stably_up_to_the_computed_limit():
    positions = np.concatenate([[0.0], np.cumsum(np.geomspace(1e-3, 1.0, 30))])
    positions /= positions[-1]
    body = bar(gap=0.1, velocity=-0.5)
    chain = Chain.of_bar(body, positions)
    dt = SCHEMES["galerkin"].stable_dt(chain)
    layers = int(2.5 / dt)
    motion = march(body, STILL, positions, SCHEMES["galerkin"], Marching(dt, layers))
    total = energy(motion)
    assert (total[1:] - total[1]).max() <= 1e-9 * total[1]
    beyond = march(body, STILL, positions, SCHEMES["galerkin"], Marching(1.05 * dt, layers))
    assert not np.abs(beyond.displacement).max() < 1e6


def test_time_and_storage_follow_every():
    motion = run(bar(gap=0.5, velocity=-0.5), STILL, "galerkin", 20, 100, every=30)
    assert list(motion.kept) == [0, 30, 60, 90, 100]
    full = run(bar(gap=0.5, velocity=-0.5), STILL, "galerkin", 20, 100)
    assert np.array_equal(motion.displacement, full.displacement[motion.kept])
    assert motion.velocity == pytest.approx(full.velocity[motion.kept], abs=1e-13)
