"""The pass of kernels for laws on speeds, beside the law of a layer that it stands for."""

import numpy as np
import pytest

import impactfem
from impactfem.marching.rubbing_march import RubbingMarch

LAW = {"between": ["*", "*"], "friction_coefficient": 0.4, "restitution": 0.3}


def falling(floor, dim, duration=0.15):
    """Two bodies that fall on each other and on a floor that may move, one of them aslant."""
    if dim == 2:
        below = {"kind": "block", "size": [0.2, 0.1], "corner": [-0.1, 0.001]}
        above = {"kind": "disc", "radius": 0.05, "center": [0.06, 0.16]}
    else:
        below = {"kind": "block", "size": [0.2, 0.1, 0.2], "corner": [-0.1, 0.001, -0.1]}
        above = {"kind": "sphere", "radius": 0.05, "center": [0.06, 0.16, 0.03]}
    across = [0.0] * (dim - 2)
    bodies = [
        {"kind": "rigid", "name": "below", "mass": 1.0, "shape": below,
         "velocity": [0.5, -0.2, *across]},
        {"kind": "rigid", "name": "above", "mass": 0.3, "shape": above,
         "velocity": [0.0, -0.5, *across]},
    ]  # fmt: skip
    plane = {"kind": "half_space", "name": "floor", "point": [0.0] * dim,
             "normal": [0.0, 1.0, *across]}  # fmt: skip
    return impactfem.Scene.from_dict(
        {
            "title": "Falling", "duration": duration, "gravity": [0.0, -9.81, *across],
            "body": bodies, "obstacle": [plane | floor], "contact": [LAW],
            "solve": {"dt": 1e-3, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


@pytest.mark.parametrize("dim", [2, 3])
def test_kernels_of_speeds_find_what_the_law_of_a_layer_does(dim, monkeypatch):
    """Forces, work, slip and motion, on a floor that moves.

    In space until the force of one of four corners that depend on each other passes 0: which of
    them carry, and so their friction, then hangs on the residual of the forces.
    """
    motion = ["0.01*sin(40*t)", "0.002*sin(60*t)", *["0"] * (dim - 2)]
    scene = falling({"motion": motion}, dim, 0.15 if dim == 2 else 0.06)
    new = impactfem.solve(scene).history
    monkeypatch.setattr(RubbingMarch, "_at_speeds", False)
    old = impactfem.solve(scene).history
    sizes = {}
    for column in old.values():
        unit = column.attrs["units"]
        sizes[unit] = max(sizes.get(unit, 0.0), float(np.nanmax(np.abs(column.values))))
    for name, column in old.items():
        size = sizes[column.attrs["units"]]
        np.testing.assert_allclose(new[name].values, column.values, rtol=0.0, atol=1e-9 * size)
    assert np.abs(old["friction_work"].values).max() > 0.0
