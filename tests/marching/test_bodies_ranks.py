"""Several solids on several ranks: the same as on one."""

import numpy as np
import pytest
from moving_scenes import alone
from pytest_mpi import parallel_assert

import impactfem

METHODS = ["explicit", "massless", "conserving", "moreau_jean"]


def discs(method, normals):
    """Discs that meet aslant."""
    plain = {
        "kind": "solid", "model": "plane_strain", "density": 1.0, "youngs_modulus": 1.0,
        "poisson_ratio": 0.3,
    }  # fmt: skip
    bodies = [
        {"name": "one", "mesh_size": 0.15, "velocity": [0.1, 0.0],
         "shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 0.0]}},
        {"name": "two", "mesh_size": 0.12, "velocity": [-0.05, 0.0],
         "shape": {"kind": "disc", "radius": 0.5, "center": [1.02, 0.4]}},
    ]  # fmt: skip
    return made([plain | body for body in bodies], method, normals, 4.0, 0.04)


def blocks(method, normals):
    """A block that falls on another one, which lies on a floor, in space."""
    plain = {
        "kind": "solid", "model": "3d", "density": 1.0, "youngs_modulus": 1.0,
        "poisson_ratio": 0.3,
    }  # fmt: skip
    bodies = [
        {"name": "low", "mesh_size": 0.2, "contact_surfaces": ["top", "bottom"],
         "shape": {"kind": "block", "size": [1.0, 0.6, 0.8], "corner": [0.0, 0.0, 0.0]}},
        {"name": "high", "mesh_size": 0.16, "contact_surfaces": ["bottom"],
         "velocity": [0.02, -0.1, 0.01],
         "shape": {"kind": "block", "size": [0.5, 0.5, 0.5], "corner": [0.2, 0.62, 0.1]}},
    ]  # fmt: skip
    floor = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0, 0.0],
             "normal": [0.0, 1.0, 0.0]}  # fmt: skip
    return made([plain | body for body in bodies], method, normals, 1.5, 0.05, [floor])


def made(bodies, method, normals, duration, dt, obstacles=()):
    step = {} if method == "explicit" else {"dt": dt}
    return impactfem.Scene.from_dict(
        {
            "title": "ranks", "duration": duration, "body": bodies, "obstacle": list(obstacles),
            "solve": {"method": method, "normals": normals} | step, "output": {"fields": []},
        }
    )  # fmt: skip


def compare(case, monkeypatch):
    with alone(monkeypatch):
        one = impactfem.solve(case)
    several = impactfem.solve(case)
    bad = {}
    for name in one.history.data_vars:
        a, b = one.history[name].values, several.history[name].values
        scale = max(np.nanmax(np.abs(a)), 0.1)
        apart = np.nanmax(np.abs(a - b)) if a.shape == b.shape else np.inf
        if not apart <= 1e-10 * scale:
            bad[name] = apart / scale
    parallel_assert(one.summary["contact"]["max_force"] > 0.0)
    parallel_assert(not bad, participating=True, msg=str(bad))


# On four ranks some hold no part of a body, or none that touches: an explicit and an implicit
# scheme with either kind of pairs will do.
FOUR = [("explicit", "fixed"), ("massless", "updated")]
TWO = [(m, n) for m in METHODS for n in ("fixed", "updated") if (m, n) not in FOUR]


@pytest.mark.parallel([2, 4])
@pytest.mark.parametrize(("method", "normals"), FOUR)
@pytest.mark.parametrize("bodies", [discs, blocks])
def test_bodies_agree(bodies, method, normals, monkeypatch):
    compare(bodies(method, normals), monkeypatch)


@pytest.mark.parallel(2)
@pytest.mark.parametrize(("method", "normals"), TWO)
def test_discs_agree(method, normals, monkeypatch):
    compare(discs(method, normals), monkeypatch)


@pytest.mark.parallel(2)
@pytest.mark.parametrize(("method", "normals"), [("explicit", "updated"), ("massless", "fixed")])
def test_blocks_in_space_agree(method, normals, monkeypatch):
    compare(blocks(method, normals), monkeypatch)
