"""Obstacles that move, and normals that follow the body: the same physics in other frames."""

import numpy as np
import pytest

from impactfem import solve
from impactfem.studies.hard.solid_facts import CONTROLLED, FLOOR, facts_of, solid_scene
from impactfem.studies.hard.solids import INSIDE


@pytest.mark.parametrize("method", CONTROLLED)
def test_a_floor_that_comes_strikes_as_a_body_that_is_thrown(method):
    """Galileo: only the relative speed counts, also for rules that act on velocities."""
    thrown = solve(solid_scene(3.0, mesh_size=0.25), method=method).history
    struck = solve(
        solid_scene(3.0, mesh_size=0.25, velocity=[0.0, 0.0],
                    obstacles=(FLOOR | {"motion": ["0", "0.1*t"]},)),
        method=method,
    ).history  # fmt: skip
    force = thrown["contact_force"].values
    assert force.max() > 0.03
    np.testing.assert_allclose(struck["contact_force"], force, rtol=0, atol=1e-12)
    np.testing.assert_allclose(struck["gap"], thrown["gap"], rtol=0, atol=1e-13)
    carried = struck["body.y"].values - 0.1 * struck["time"].values
    np.testing.assert_allclose(carried, thrown["body.y"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", ["conserving", "explicit", "galerkin", "moreau_jean"])
def test_a_floor_that_moves_does_the_work_that_the_energy_shows(method):
    scene = solid_scene(3.0, mesh_size=0.25, velocity=[0.0, 0.0],
                        obstacles=(FLOOR | {"motion": ["0", "0.1*t"]},))  # fmt: skip
    result = solve(scene, method=method)
    inside = (result.history["kinetic_energy"] + result.history["elastic_energy"]).values
    assert inside[-1] > 0.01  # the floor has thrown the body
    facts = facts_of(result)
    assert facts["growth"] <= 1e-9
    if method in {"conserving", "explicit"}:
        assert facts["drift"] <= 1e-9


def test_updated_normals_cost_little_energy_and_less_with_smaller_steps():
    """A tangent plane at the start of the way, instead of amid it, gained 3e-3 and 1.5e-3."""
    drift = [
        facts_of(solve(INSIDE, method="conserving", normals="updated", dt=dt))["drift"]
        for dt in (0.05, 0.025)
    ]
    assert drift[0] < 5e-4
    assert drift[1] < 0.55 * drift[0]
