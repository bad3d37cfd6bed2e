"""Two discs that meet aslant: momentum, angular momentum, energy, no penetration, no pulling."""

from dataclasses import replace

import numpy as np
import pytest
from solid_pairs import EXPLICIT, block, disc, scene

import impactfem
from impactfem import Contact
from impactfem.errors import SceneError
from impactfem.marching.composite import Composite

METHODS = ("massless", "conserving", "explicit", "moreau_jean")


def discs(method, normals, size=0.12, **more):
    """Discs of different mass on meshes that do not match."""
    bodies = [
        disc("light", [0.0, 0.0], 0.5, size, velocity=[0.1, 0.0], poisson_ratio=0.3),
        disc("heavy", [1.02, 0.4], 0.5, 0.83 * size, velocity=[-0.05, 0.01], density=2.0,
             poisson_ratio=0.3),
    ]  # fmt: skip
    steps = {} if method in EXPLICIT else {"dt": 0.03}
    return scene(bodies, duration=5.0, method=method, normals=normals, **steps | more)


def total_momentum(result, masses):
    """Linear momentum of both [kg m/s], (rows, 2)."""
    history = result.history
    each = [
        mass * np.stack([history[f"{name}.v{axis}"].values for axis in "xy"], axis=1)
        for name, mass in masses.items()
    ]
    return np.sum(each, axis=0)


def masses(case, model_of):
    parts = model_of(case).parts
    return {part.solid.name: part.system.total_mass for part in parts}


def model(case):
    from impactfem.models.solids import solids_model

    return solids_model(case, [1, 1], updated=case.solve.normals == "updated")


@pytest.mark.parametrize("normals", ["fixed", "updated"])
@pytest.mark.parametrize("method", METHODS)
def test_linear_momentum_is_kept_whatever_moves(method, normals):
    case = discs(method, normals)
    result = impactfem.solve(case)
    momentum = total_momentum(result, masses(case, model))
    assert result.history["contact_force"].values.max() > 1e-3
    np.testing.assert_allclose(momentum, momentum[:1].repeat(len(momentum), 0), atol=1e-12)
    assert result.history["contact_force"].values.min() >= 0.0
    if method != "moreau_jean":  # which acts on speeds
        followed = (method, normals) == ("conserving", "updated")  # holds what it finds closed
        deepest = 0.02 * 0.5 if followed else 1e-12  # of facets that pass
        assert result.history["gap"].values.min() >= -deepest


def spins(monkeypatch, case, *, current):
    """Angular momentum about the origin in every layer, by undeformed or present places."""
    found, finish = [], Composite.finish

    def watched(self, static):
        sums = finish(self, static)
        total = 0.0
        for part in self.parts:
            moving = part._times_mass(part.velocity).reshape(-1, 2).copy()
            places = part._system.positions
            if current:
                places = places + part.displacement.reshape(-1, 2)
            total += float((places[:, 0] * moving[:, 1] - places[:, 1] * moving[:, 0]).sum())
        found.append(total)
        return sums

    with monkeypatch.context() as patch:
        patch.setattr(Composite, "finish", watched)
        result = impactfem.solve(case)
    assert result.history["contact_force"].values.max() > 1e-3
    return np.array(found)


@pytest.mark.parametrize("method", ["massless", "conserving", "moreau_jean"])
def test_angular_momentum_of_small_sliding_is_kept(method, monkeypatch):
    # In the linear theory moments are about the undeformed places. No way across a gap turns it.
    found = spins(monkeypatch, discs(method, "fixed"), current=False)
    np.testing.assert_allclose(found, found[0], atol=1e-10 * 0.1)


def test_angular_momentum_of_blocks_is_kept(monkeypatch):
    bodies = [
        block("left", [0, 0], [1, 0.5], 0.12, velocity=[0.1, 0.0], poisson_ratio=0.3),
        block("right", [1.02, 0.2], [1, 0.5], 0.1, poisson_ratio=0.3),
    ]
    case = scene(bodies, duration=3.0, method="conserving", normals="fixed", dt=0.03)
    found = spins(monkeypatch, case, current=False)
    np.testing.assert_allclose(found, found[0], atol=1e-10 * 0.1)


def kept(result):
    """Drifts of energy and angular momentum, of their size."""
    history = result.history
    energy, turned = history["total_energy"].values, history["angular_momentum"].values
    rubbed = history["friction_work"].values if "friction_work" in history else 0.0
    scale = np.abs(turned).max()
    return np.ptp(energy - rubbed) / energy[0], np.ptp(turned) / scale


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_pairs_that_follow_keep_energy_and_angular_momentum(friction):
    # Moments are about places that move with the centres: small strains know no others.
    case = discs("conserving", "updated", dt=0.03)
    if friction:
        case = replace(
            case, contacts=(Contact(between=("light", "heavy"), friction_coefficient=friction),)
        )
    result = impactfem.solve(case)
    assert result.history["contact_force"].values.max() > 1e-3
    energy, turned = kept(result)
    assert energy <= 1e-10
    assert turned <= 1e-11


@pytest.mark.parametrize("method", ["conserving", "explicit"])
def test_energy_of_small_sliding_is_kept(method):
    energy = impactfem.solve(discs(method, "fixed")).history["total_energy"].values
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


def test_energy_of_massless_contact_never_grows():
    energy = impactfem.solve(discs("massless", "fixed")).history["total_energy"].values
    assert np.diff(energy).max() <= 1e-12 * energy[0]
    assert energy[-1] >= 0.995 * energy[0]


def test_energy_of_large_sliding_is_right_to_the_order_of_the_step():
    changes = []
    for dt in (0.04, 0.02):
        result = impactfem.solve(discs("massless", "updated", 0.08, dt=dt))
        energy = result.history["total_energy"].values
        changes.append(np.ptp(energy) / energy[0])
    assert changes[0] <= 0.15 * 0.04
    assert changes[0] / changes[1] >= 1.7  # first order


def test_massless_nodes_that_nothing_holds_are_refused():
    # In space a whole outside without mass needs more inside than a line of nodes.
    more = {"model": "3d", "velocity": [0.0, -0.1, 0.0]}
    bodies = [
        block("low", [0, 0, 0], [1, 0.6, 0.8], 0.2, model="3d"),
        block("high", [0.2, 0.62, 0.1], [0.5, 0.5, 0.5], 0.16, **more),
    ]
    case = scene(bodies, duration=0.2, method="massless", normals="updated", dt=0.05)
    with pytest.raises(SceneError, match=r"body high: its mesh has 2 nodes that carry no contact"):
        impactfem.solve(case)


def test_bodies_that_pass_each_other_are_left_alone():
    bodies = [
        disc("one", [0.0, 0.0], 0.5, 0.2, velocity=[0.1, 0.0]),
        disc("two", [0.0, 2.5], 0.5, 0.2, velocity=[-0.1, 0.0]),
    ]
    result = impactfem.solve(scene(bodies, duration=2.0, method="massless", dt=0.1))
    assert result.history["contact_force"].values.max() == 0.0
    energy = result.history["total_energy"].values
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)
