"""Bodies of which no face looks at the other's at t = 0, and which meet later."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene


def block(name, corner, **more):
    return {
        "kind": "solid", "name": name, "model": "plane_strain", "mesh_size": 0.05,
        "shape": {"kind": "block", "size": [0.1, 0.1], "corner": corner}, "density": 1100.0,
        "youngs_modulus": 1e6, "poisson_ratio": 0.3, "degree": 1, **more,
    }  # fmt: skip


def scene(*bodies, gravity=(0.0, 0.0), duration=0.08):
    return Scene.from_dict(
        {
            "title": "late", "duration": duration, "gravity": list(gravity), "body": list(bodies),
            "contact": [{"between": ["a", "b"]}],
            "solve": {"dt": 5e-4, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


@pytest.mark.parametrize("strain", ["small", "finite"])
def test_a_body_that_flies_round_a_corner_lands_on_the_other(strain):
    """It moves aside and falls: its lower face is above the other's only from 20 ms on."""
    made = scene(
        block("a", [0.0, 0.0], supports=[{"surface": "bottom", "kind": "fixed"}], strain=strain),
        block("b", [0.13, 0.12], velocity=[-1.5, 0.0], strain=strain), gravity=(0.0, -9.81),
    )  # fmt: skip
    history = impactfem.solve(made).history
    time, gap = history["time"].values, history["gap.a.b"].values
    force = history["contact_force"].values
    begins = np.sqrt(2 * 0.02 / 9.81)
    assert time[np.flatnonzero(force)[0]] == pytest.approx(begins, abs=1.5e-3)
    assert np.nanmin(gap) > -1e-3
    assert force.max() > 100.0
    reason = impactfem.plan(made).reasons["normals"]
    assert "face each other later" in reason or strain == "finite"


def test_bodies_that_pass_each_other_at_a_distance_keep_what_is_fixed():
    made = scene(block("a", [0.0, 0.0]), block("b", [0.13, 0.12], velocity=[1.0, 0.5]))
    plan = impactfem.plan(made)
    assert plan.reasons["normals"] == "fixed: nothing can touch"
