"""The discontinuous Galerkin method against closed forms and characteristics."""

import numpy as np
import pytest

import impactfem
from impactfem.fem import MPI
from impactfem.reference import exact_bar, measure
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
    if not isinstance(gravity, impactfem.PiecewiseConstant):
        gravity = impactfem.PiecewiseConstant((0.0,), (gravity,))
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
