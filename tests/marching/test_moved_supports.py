"""A body whose supports move with the frame behaves as at rest, its held corners too."""

import numpy as np
import pytest

import impactfem
from impactfem.scene import Scene

RUBBER = {
    "kind": "solid", "model": "plane_strain", "density": 1000.0, "youngs_modulus": 1e6,
    "poisson_ratio": 0.3,
}  # fmt: skip


def struck(method, strain, speed):
    """A disc falls on the end of a block that is held at both ends, seen from a frame."""
    x, y = speed
    held = {"kind": "motion", "value": [f"{x}*t", f"{y}*t"]}
    block = {
        "name": "p", "shape": {"kind": "block", "size": [0.1, 0.02], "corner": [0.0, 0.0]},
        "mesh_size": 0.01, "velocity": [x, y], "strain": strain,
        "supports": [{"surface": side, **held} for side in ("left", "right")],
    }  # fmt: skip
    disc = {
        "name": "s", "shape": {"kind": "disc", "radius": 0.02, "center": [0.002, 0.0405]},
        "mesh_size": 0.01, "velocity": [x, y - 0.5], "strain": strain,
    }  # fmt: skip
    return impactfem.solve(Scene.from_dict({
        "title": "boosted", "duration": 0.002, "body": [RUBBER | block, RUBBER | disc],
        "solve": {"method": method, "estimate": False, "dt": 2e-5},
        "output": {"report": False, "pictures": False, "fields": []},
    }))  # fmt: skip


@pytest.mark.parametrize(
    ("method", "strain"),
    [
        ("explicit", "small"),
        ("massless", "small"),
        ("moreau_jean", "small"),
        ("massless", "finite"),
    ],
)
def test_held_corners_move_with_their_supports(method, strain):
    """Held contact nodes without mass stood where they were at t = 0: energy grew 30 fold."""
    speed = np.array([0.3, 0.1])
    rest, moved = struck(method, strain, (0.0, 0.0)), struck(method, strain, speed)
    force = rest.history["contact_force"].values
    assert force.max() > 10.0
    assert moved.history["contact_force"].values == pytest.approx(force, abs=1e-7 * force.max())
    elastic = rest.history["elastic_energy"].values
    found = moved.history["elastic_energy"].values
    assert found == pytest.approx(elastic, abs=1e-8 * elastic.max())
    times = rest.history["time"]
    for body in ("p", "s"):
        for axis, c in zip("xy", speed, strict=True):
            way = moved.history[f"{body}.{axis}"].values - rest.history[f"{body}.{axis}"].values
            assert way == pytest.approx(c * np.asarray(times), abs=1e-10)
            faster = (
                moved.history[f"{body}.v{axis}"].values - rest.history[f"{body}.v{axis}"].values
            )
            assert faster == pytest.approx(np.full(len(faster), c), abs=1e-7)
