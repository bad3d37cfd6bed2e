"""Updated normals: on a plane, whose normal is the same everywhere, they change nothing."""

import numpy as np
import pytest

from impactfem import Scene, solve

LEANING = [0.6, 0.8]


@pytest.fixture
def block():
    """A block thrown flat on an inclined plane, with several nodes in contact at once."""
    angle = float(np.arctan2(LEANING[1], LEANING[0]) - np.pi / 2)
    return Scene.from_dict(
        {
            "title": "block",
            "duration": 2.5,
            "body": [
                {
                    "kind": "solid", "model": "plane_strain", "density": 1.0,
                    "youngs_modulus": 1.0, "poisson_ratio": 0.3, "mesh_size": 0.2,
                    "shape": {"kind": "block", "size": [1.0, 0.6], "angle": angle,
                              "corner": [-0.5, -0.3]},
                    "velocity": [-0.06, -0.08],
                }
            ],
            "obstacle": [{"kind": "half_space", "name": "floor", "normal": LEANING,
                          "point": [-0.31 * LEANING[0], -0.31 * LEANING[1]]}],
        }
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("method", ["massless", "conserving", "explicit", "galerkin"])
def test_on_a_plane_updated_normals_are_the_fixed_ones(block, method):
    fixed, updated = (
        solve(block, method=method, normals=normals, estimate=False).history
        for normals in ("fixed", "updated")
    )
    assert fixed["active"].max() > 3
    for name in ("contact_force", "gap", "total_energy", "solid.x", "solid.vy"):
        scale = float(abs(fixed[name]).max())
        assert float(abs(fixed[name] - updated[name]).max()) < 1e-9 * scale, name
