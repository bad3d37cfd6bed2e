"""The discontinuous Galerkin method against closed forms and characteristics."""

import numpy as np
import pytest

import impactfem
from impactfem.exact import ExactBar
from impactfem.fem import MPI
from impactfem.reference.bar import exact_bar, measure
from impactfem.spacetime.discontinuous import DiscontinuousSettings, solve_discontinuous


def solve(scene, **settings):
    """Motion, figures, and errors against the characteristics solution."""
    motion, figures = solve_discontinuous(
        MPI.COMM_SELF,
        scene.bodies[0],
        scene.gravity,
        scene.duration,
        DiscontinuousSettings(**settings),
    )
    return motion, figures, measure(motion, exact_bar(scene))


def scene_of(duration, gravity=0.0, **bar):
    body = impactfem.Bar(**{"length": 1.0, "density": 1.0, "youngs_modulus": 1.0, **bar})
    if not isinstance(gravity, impactfem.bodies.PiecewiseConstant):
        gravity = impactfem.bodies.PiecewiseConstant((0.0,), (gravity,))
    return impactfem.Scene(
        title="test",
        duration=duration,
        gravity=gravity,
        bodies=[body],
        obstacles=[impactfem.Wall()],
    )


K1 = scene_of(5.0, gap=0.5, velocity=-0.5)


@pytest.mark.parametrize(
    ("degree", "tips"), [(1, (0.061, 0.036, 0.022)), (2, (0.031, 0.0172, 0.0100))]
)
def test_k1_on_unstructured_triangles_is_as_accurate_as_designed(degree, tips):
    exact = exact_bar(K1)
    for elements, tip in zip((8, 16, 32), tips, strict=True):
        motion, _, _ = solve(K1, degree=degree, elements=elements)
        assert np.abs(motion.gap - exact.gap(motion.times)).max() <= tip
        assert motion.multiplier.min() >= -0.6  # the force overshoots by less than a fifth
        assert motion.multiplier.max() <= 0.0
        assert motion.gap.min() >= -1e-12
        energy = motion.kinetic + motion.elastic
        assert energy.max() <= 0.125 * (1 + 1e-12)


def test_p0_finds_the_plateau_of_the_force():
    motion, _, _ = solve(K1, degree=0, elements=32)
    middle = 0.5 * (motion.times[1:] + motion.times[:-1])
    plateau = (middle > 1.1) & (middle < 1.3)
    assert motion.multiplier[plateau] == pytest.approx(-0.5, abs=1e-12)


@pytest.mark.parametrize("degree", [0, 1, 2])
@pytest.mark.parametrize("elements", [8, 16, 32])
def test_one_active_set_for_all_times_settles_in_three_iterations(degree, elements):
    decided, _, _ = solve(K1, degree=degree, elements=elements)
    iterated, _, _ = solve(K1, degree=degree, elements=elements, window="all")
    assert iterated.effort.converged
    assert iterated.effort.iterations <= 5
    assert np.array_equal(iterated.active, decided.active)
    assert np.abs(iterated.displacement - decided.displacement).max() <= 1e-12


def kinked_exact(bar, duration, nodes, velocity):
    """Exact solution with the kinks of the data among its nodes."""
    x = np.array(nodes) * bar.length
    return ExactBar(
        length=bar.length,
        wave_speed=bar.wave_speed,
        duration=duration,
        nodes=x,
        displacement=bar.initial_displacement(x=x),
        velocity=velocity,
    )


TAU = (np.sqrt(0.5**2 + 2 * 0.1 * 0.5) - 0.5) / 0.1  # impact of K2 and K3
FITTED = {
    "K1": K1,
    "K1 off the grid": scene_of(5.0, gap=0.5 + 0.5 * 0.4 / 160, velocity=-0.5),
    "K2": scene_of(4.0, 0.1, gap=0.5, velocity=-0.5),
    "K3": scene_of(
        4.0, impactfem.bodies.PiecewiseConstant((0.0, TAU), (0.1, 0.0)), gap=0.5, velocity=-0.5
    ),
    "load switched in contact": scene_of(
        6.0, impactfem.bodies.PiecewiseConstant((0.0, 1.9), (0.1, -0.2)), gap=0.5, velocity=-0.5
    ),
    "prestretched rod": scene_of(12.0, far_end="clamped", displacement="(1 - x)/2"),
    "Doyen bounces": scene_of(12.0, 10.0, length=10.0, youngs_modulus=900.0, gap=5.0),
    "irregular bounces": scene_of(15.0, 1.0, gap=0.5, velocity=-2.0),
    "waves and bounces overlap": scene_of(6.0, 2.0, gap=0.5, velocity=-0.1),
    "grazing clamped bar": scene_of(8.0, 0.2, gap=0.1, far_end="clamped", velocity="-0.3*(1 - x)"),
    "at rest on the wall": scene_of(6.0, 0.1, gap=0.0),
}


@pytest.mark.parametrize("name", FITTED)
@pytest.mark.parametrize("degree", [1, 2])
def test_fitted_meshes_are_exact(name, degree):
    scene = FITTED[name]
    motion, figures, errors = solve(scene, degree=degree, elements=12, fitted=True)
    exact = exact_bar(scene)
    assert errors.displacement_max <= 1e-10
    ends = [t for contact in exact.contacts for t in contact if t < scene.duration]
    found = [event["time"] for event in figures["events"] if event["kind"] != "load"]
    assert found == pytest.approx(ends, abs=1e-11)
    borders = motion.times[1:-1][np.diff(motion.active.astype(int)) != 0]
    assert borders == pytest.approx([t for t in ends if t > 0], abs=1e-10)
    energy = motion.kinetic + motion.elastic + motion.potential
    scale = max(np.abs(energy).max(), np.abs(motion.potential).max())
    assert np.abs(energy - energy[0]).max() <= 1e-9 * scale
    # The multiplier is the mean over each interval: that is exact too.
    mean = exact.force_integral(motion.times[:-1], motion.times[1:]) / np.diff(motion.times)
    assert motion.multiplier == pytest.approx(mean, abs=1e-9 * np.abs(mean).max())


def test_p0_is_exact_on_fitted_meshes_where_the_fields_are_piecewise_constant():
    for name in ("K1", "K1 off the grid", "prestretched rod"):
        _, _, errors = solve(FITTED[name], degree=0, elements=6, fitted=True)
        assert errors.displacement_max <= 1e-11
        assert errors.force_l1 <= 1e-11


def test_kinks_and_jumps_of_the_initial_state_are_fitted():
    scene = scene_of(
        6.0, gap=0.3, velocity="where(x < 0.3, -0.5, -0.2)", displacement="0.1*abs(x - 0.6)"
    )
    motion, figures, _ = solve(scene, elements=10, fitted=True)
    velocity = [[-0.5, -0.5], [-0.2, -0.2], [-0.2, -0.2]]
    exact = kinked_exact(scene.bodies[0], 6.0, [0, 0.3, 0.6, 1.0], velocity)
    t, x = motion.times[:, None], motion.positions[None, :]
    assert np.abs(motion.displacement - exact.displacement(t, x)).max() <= 1e-11
    assert figures["characteristics"] >= 6


@pytest.mark.parametrize(("degree", "order"), [(1, 1.2), (2, 2.5)])
def test_smooth_data_converge_with_high_order_on_fitted_meshes(degree, order):
    scene = scene_of(
        4.0, 0.1, far_end="clamped", gap=0.3, velocity="-0.5*cos(pi*x/2)", displacement="0.05*x*x"
    )
    errors = []
    for elements in (8, 24):
        motion, _, _ = solve(scene, degree=degree, elements=elements, fitted=True)
        x = np.linspace(0, 1, 8193)
        exact = ExactBar(
            length=1.0, wave_speed=1.0, duration=4.0, nodes=x,
            displacement=0.3 + 0.05 * x * x, velocity=-0.5 * np.cos(np.pi * x / 2),
            midpoints=0.3 + 0.0125 * (x[1:] + x[:-1]) ** 2,
            gravity_values=[0.1], far_end="clamped", resolution=40000,
        )  # fmt: skip
        t, place = motion.times[:, None], motion.positions[None, :]
        errors.append(np.abs(motion.displacement - exact.displacement(t, place)).max())
    assert np.log(errors[0] / errors[1]) / np.log(3.0) >= order


@pytest.mark.parametrize(
    ("scene", "accuracy"),
    [(K1, 2e-2), (FITTED["K2"], 6e-3), (scene_of(5.0, gap=0.37, velocity="-0.5 + 0.2*x"), 2e-2)],
    ids=["K1", "K2", "sheared"],
)
def test_refinement_reaches_the_accuracy_it_reports(scene, accuracy):
    motion, figures, errors = solve(scene, degree=2, elements=8, accuracy=accuracy)
    assert motion.effort.converged
    assert figures["estimated_error"] <= accuracy
    assert errors.displacement_max <= 2.0 * figures["estimated_error"]
    counts = [level["triangles"] for level in figures["levels"]]
    assert counts == sorted(counts)


def test_refinement_says_what_it_could_not_reach(monkeypatch):
    from impactfem.spacetime import discontinuous

    monkeypatch.setattr(discontinuous, "MAX_TRIANGLES", 2000)
    motion, figures, _ = solve(K1, elements=8, accuracy=1e-5)
    assert not motion.effort.converged
    assert "fitted" in motion.effort.message
    assert figures["estimated_error"] > 1e-5


def test_fitted_refinement_stops_at_once_where_it_is_exact():
    _, figures, errors = solve(K1, elements=8, fitted=True, accuracy=1e-9)
    assert len(figures["levels"]) == 2
    assert errors.displacement_max <= 1e-11


@pytest.mark.parametrize("seed", range(6))
def test_fitted_meshes_are_exact_for_random_data_over_decades(seed):
    random = np.random.default_rng(seed)
    length, c, density = 10 ** random.uniform([-3, 0, 0], [2, 3, 4])
    transit = length / c
    speed = 10 ** random.uniform(-3, 1)
    gravity = speed / transit * 10 ** random.uniform(-2, 0.5)
    scene = scene_of(
        transit * random.uniform(5, 25),
        gravity,
        length=length,
        density=density,
        youngs_modulus=density * c**2,
        gap=speed * transit * 10 ** random.uniform(-1, 1),
        velocity=-speed,
        far_end="clamped" if random.random() < 0.3 else "free",
    )
    _, _, errors = solve(scene, elements=8, fitted=True)
    assert errors.displacement_max <= 1e-9
