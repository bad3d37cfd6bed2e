"""Joints, ties, springs and masses on solids in explicit steps, held to exact solutions."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart
from scipy.linalg import eigh, null_space

from impactfem import Scene, solve
from impactfem.models.solids import solids_model

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
RUB = [{"between": ["a", "floor"], "friction_coefficient": 0.3}]


def block(name, low, mesh_size=0.025, **more):
    return {
        "kind": "solid", "name": name, "model": "plane_strain", "strain": "small",
        "shape": {"kind": "block", "size": [0.1, 0.05], "corner": [0.0, low]},
        "mesh_size": mesh_size, "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
    } | more  # fmt: skip


def scene(bodies, duration, dt, **more):
    return Scene.from_dict(
        {
            "title": "held in explicit steps", "duration": duration, "body": bodies,
            "solve": {"dt": dt, "estimate": False, "method": "explicit"},
            "output": {"fields": []}, "gravity": [0.0, 0.0],
        } | more
    )  # fmt: skip


def drift(values):
    return np.abs(values - values[0]).max()


def held(dt):
    """A block on a hinge and a spring carries a mass, and falls."""
    whole = {"radius": 1.0}
    pin = {"kind": "revolute", "name": "pin", "between": ["ground", "a/left"],
           "point": [0.0, 0.025]} | whole  # fmt: skip
    spring = {"name": "s", "between": ["ground", "a/right"], "stiffness": [3e5, 2e5]}
    mass = {"name": "m", "body": "a", "surface": "top", "mass": 2.0}
    return scene(
        [block("a", 0.0, cells="hexahedron")], 4e-3, dt, gravity=[0.0, -9.81],
        joint=[pin], spring=[spring], point_mass=[mass],
    )  # fmt: skip


def test_what_is_held_swings_as_its_equations_have_it_to_second_order():
    """M u'' + K u + k S^T S u = f with H u = 0, by the modes in the null space of H."""
    system = solids_model(held(2e-5), (1,), updated=True).parts[0].system
    # Named, as older petsc4py does not keep a matrix for its array.
    dense = system.stiffness.copy().convert("dense")
    stiff = dense.getDenseArray().copy()
    places, masses = system.positions, np.repeat(system.node_mass, 2)

    def means(axis, value):
        """Mean displacements of an edge, by lengths of its nodes, (2, dofs)."""
        on = np.flatnonzero(np.isclose(places[:, axis], value))
        along = places[on, 1 - axis]
        ends = np.isclose(along, along.min()) | np.isclose(along, along.max())
        weights = np.where(ends, 0.5, 1.0)
        found = np.zeros((2, 2 * len(places)))
        for k in range(2):
            found[k, 2 * on + k] = weights / weights.sum()
        return found

    pin, spring, carried = means(0, 0.0), means(0, 0.1), means(1, 0.05)
    mass = np.diag(masses) + 2.0 * carried.T @ carried
    stiff = stiff + spring.T @ np.diag([3e5, 2e5]) @ spring
    load = -9.81 * mass @ np.tile([0.0, 1.0], len(places))
    free = null_space(pin)
    squares, modes = eigh(free.T @ stiff @ free, free.T @ mass @ free)
    modes = free @ modes
    off = []
    for dt in (4e-5, 2e-5):
        history = solve(held(dt)).history
        time, energy = history["time"].values, history["total_energy"].values
        # Work of weight in the first, half step is told by whole ones.
        largest = history["kinetic_energy"].values.max()
        assert drift(np.delete(energy, 1)) < 1e-7 * largest
        assert drift(energy[2:]) < 1e-11 * largest
        # (1 - cos(w t)) / w^2, also of the turn about the pin, whose w is 0 but for rounding
        halves = np.sqrt(np.maximum(squares, 0.0)) * time[:, None] / 2.0
        moved = (modes.T @ load) * (time[:, None] * np.sinc(halves / np.pi)) ** 2 / 2.0
        want = 0.05 + moved @ (carried @ modes)[1]
        off.append(np.abs(history["m.y"].values - want).max() / drift(want))
    assert off[0] < 2e-3
    assert off[1] == pytest.approx(off[0] / 4.0, rel=0.05)


def test_blocks_of_one_mesh_are_one_block_that_strikes():
    keys = {"cells": "hexahedron", "velocity": [0.3, -1.0]}
    bodies = [block("a", 1e-4, **keys), block("b", 0.0501, **keys)]
    tie = [{"name": "glue", "between": ["a/top", "b/bottom"]}]
    one = block("a", 1e-4, **keys)
    one["shape"] = one["shape"] | {"size": [0.1, 0.1]}
    glued, whole = (
        solve(scene(each, 2e-3, 4e-5, obstacle=[FLOOR], **more)).history
        for each, more in ((bodies, {"tie": tie}), ([one], {}))
    )
    assert whole["contact_force"].values.max() > 1e3
    for name in ("contact_force", "kinetic_energy", "elastic_energy", "momentum.x", "momentum.y"):
        size = np.abs(whole[name].values).max()
        np.testing.assert_allclose(glued[name].values, whole[name].values, atol=1e-11 * size)


def test_constant_stress_passes_unlike_meshes():
    below = [{"surface": side, "kind": "symmetry"} for side in ("left", "bottom")]
    pull = [{"surface": "top", "value": [0.0, -2e3]}]
    bodies = [
        block("a", 0.0, 0.05, supports=below),
        block("b", 0.05, 0.034, supports=below[:1], tractions=pull),
    ]
    probes = [
        {"name": f"p{k}", "body": "ab"[k], "point": at, "quantities": ["stress"]}
        for k, at in enumerate([[0.021, 0.047], [0.077, 0.053]])
    ]
    tie = [{"name": "glue", "between": ["a/top", "b/bottom"]}]
    made = scene(bodies, 2e-3, 1e-4, start="static", tie=tie, probe=probes)
    history = solve(made).history
    for k in range(2):
        assert np.abs(history[f"p{k}.syy"].values + 2e3).max() < 1e-10 * 2e3
        assert np.abs(history[f"p{k}.sxy"].values).max() < 1e-10 * 2e3


def test_coordinates_that_are_driven_are_told_at_levels():
    dt, way = 2e-5, "1e-3*sin(500*t)**2"
    slide = {"kind": "prismatic", "name": "j", "between": ["a/top", "b/bottom"],
             "axis": [0.0, 1.0], "point": [0.05, 0.055], "position": way}  # fmt: skip
    bodies = [block("a", 0.0, 0.05), block("b", 0.06, 0.05)]
    history = solve(scene(bodies, 2e-3, dt, joint=[slide])).history
    want = 1e-3 * np.sin(500.0 * history["time"].values) ** 2
    off = np.abs(history["j.q"].values - want).max()
    assert off < 1.01 * dt**2 / 8.0 * 2e-3 * 500.0**2  # of q amid the step and its mean rate there
    assert drift(history["momentum.y"].values) < 1e-11


def assembly(dt=4e-5, duration=6e-3, strength=None, **more):
    """Two tied blocks with a mass and a weight on a hinge with friction and stops strike a floor.

    A spring holds a third block to them.
    """
    way = {"velocity": [0.3, -1.0]}
    tie = {"name": "glue", "between": ["a/top", "b/bottom"]}
    pin = {"kind": "revolute", "name": "pin", "between": ["b/top", "bob"], "friction": 0.01,
           "point": [0.05, 0.1005], "limits": [-0.01, 0.01], "restitution": 0.5}  # fmt: skip
    spring = {"name": "s", "between": ["b/right", "c/left"], "point": [0.105, 0.08],
              "stiffness": 1e4, "damping": 5.0}  # fmt: skip
    mass = {"name": "m", "body": "a", "point": [0.03, 0.03], "mass": 1.0}
    shape = {"kind": "disc", "radius": 0.02, "center": [0.05, 0.15]}
    bob = {"kind": "rigid", "name": "bob", "shape": shape, "mass": 1.0,
           "velocity": [0.3 - 2.0 * 0.0495, -1.0], "angular_velocity": 2.0}  # fmt: skip
    third = block("c", 0.0505, **way)
    third["shape"] = third["shape"] | {"corner": [0.11, 0.0505]}
    bodies = [block("a", 5e-4, **way), block("b", 0.0505, 0.034, **way), third, bob]
    return scene(
        bodies, duration, dt, obstacle=[FLOOR], contact=RUB, spring=[spring], point_mass=[mass],
        joint=[pin], tie=[tie | ({} if strength is None else {"break_force": strength})], **more,
    )  # fmt: skip


def test_an_assembly_that_strikes_keeps_momentum_and_energy():
    history = solve(assembly()).history
    kept = history["total_energy"].values - history["friction_work"].values
    for name in ("pin.lost", "s_x.lost", "s_y.lost"):
        kept = kept + history[name].values
    assert history["pin.lost"].values[-1] > 0.0
    assert history["contact_force"].values.max() > 1e3
    assert drift(kept) < 1e-9 * kept[0]  # what limits and hinges that turn miss is of third order
    gained = history["momentum.y"].values - history["momentum.y"].values[0]
    pushed = np.trapezoid(history["force.a.floor"].values, history["time"].values)
    assert gained[-1] == pytest.approx(pushed, rel=1e-10)  # momenta are those amid time steps


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    made = assembly(duration=2e-3, strength=200.0, output={"fields": [], "checkpoint": 10})
    whole, _ = check_restart(made, 25, tmp_path, monkeypatch)
    assert whole.history["contact_force"].values[20:].max() > 0.0
    assert whole.summary["details"]["ties"]["glue"]["parted_at"] is not None


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    check_ranks(lambda: assembly(duration=2e-3), monkeypatch)
