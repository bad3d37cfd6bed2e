"""Joints, ties, masses and springs on solids under finite strain: energy, momenta, small strain."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
GLUE = {"name": "glue", "between": ["a/top", "b/bottom"]}


def block(name, corner, size, velocity, mesh_size=0.02, **more):
    shape = {"kind": "block", "size": size, "corner": corner}
    return {
        "kind": "solid", "name": name, "model": "plane_strain", "mesh_size": mesh_size,
        "shape": shape, "density": 1100.0, "youngs_modulus": 1e6, "poisson_ratio": 0.4,
        "strain": "finite", "velocity": velocity, **more,
    }  # fmt: skip


def pair(velocity, **more):
    """Two blocks of unlike meshes, one on the other, glued together."""
    lower = block("a", [0.0, 1e-3], [0.06, 0.02], velocity, **more)
    return [lower, block("b", [0.0, 0.021], [0.06, 0.03], velocity, 0.014, **more)]


def scene(bodies, duration, dt=1e-3, **tables):
    checkpoint = tables.pop("checkpoint", 0)
    return impactfem.Scene.from_dict(
        {
            "title": "held rubber", "duration": duration, "gravity": [0.0, 0.0], "body": bodies,
            "solve": {"dt": dt, "estimate": False, "method": tables.pop("method", "conserving")},
            "output": {"fields": [], "checkpoint": checkpoint}, **tables,
        }
    )  # fmt: skip


def apart(history, *names):
    """Largest change of columns."""
    return [np.ptp(history[name].values) for name in names]


def test_tied_rubber_that_spins_keeps_what_it_has():
    spin = ["-60*(y-0.02)", "60*(x-0.03)"]
    history = impactfem.solve(scene(pair(spin), 0.03, 1.5e-3, tie=[GLUE])).history
    energy, *others = apart(history, "total_energy", "momentum.x", "momentum.y", "angular_momentum")
    assert energy < 1e-11 * history["total_energy"].values[0]
    assert max(others) < 1e-12
    assert history["a.angle"].values[-1] > 1.5
    assert history["force.glue"].values.max() > 30.0


def test_tied_rubber_rubs_on_a_floor_without_a_change_of_energy():
    made = scene(
        pair(["1.0", "-2.0"]), 0.012, obstacle=[FLOOR], tie=[GLUE],
        contact=[{"between": ["a", "floor"], "friction_coefficient": 0.3}],
    )  # fmt: skip
    history = impactfem.solve(made).history
    energy = history["total_energy"].values - history["friction_work"].values
    assert history["contact_force"].values.max() > 1e3
    assert history["friction_work"].values[-1] < -0.05
    assert np.ptp(energy) < 1e-10 * energy[0]


def test_a_tie_lets_go_at_its_force():
    glue = GLUE | {"break_force": 500.0}
    result = impactfem.solve(scene(pair(["0", "-2.0"]), 0.012, obstacle=[FLOOR], tie=[glue]))
    known, force = result.summary["details"]["ties"]["glue"], result.history["force.glue"].values
    assert known["force_max"] > 500.0
    parted = round(known["parted_at"] / 1e-3)
    assert force[parted] > 500.0 > force[:parted].max()
    assert not force[parted + 1 :].any()
    assert apart(result.history, "total_energy")[0] < 1e-9


@pytest.mark.parametrize(
    "holds",
    [
        {"tie": [GLUE]},
        {"point_mass": [{"name": "m", "body": "b", "surface": "top", "mass": 2.0}]},
        {"spring": [{"name": "s", "between": ["b/top", "ground"], "stiffness": 3e4}]},
        {
            "joint": [
                {"name": "h", "kind": "revolute", "between": ["ground", "b/left"],
                 "point": [0.0, 0.036]},
            ]
        },
    ],
    ids=["tie", "mass", "spring", "hinge"],
)  # fmt: skip
def test_small_motions_are_those_of_small_strain(holds):
    """Strains and turns of 1e-4, by which both differ."""
    speed = ["0", "0.2*sin(20*y)*x"] if "joint" not in holds else ["-0.1*(y-0.036)", "0.1*x"]
    found = []
    for strain in ("finite", "small"):
        bodies = [each | {"strain": strain} for each in pair(speed)]
        if "tie" not in holds:
            bodies = bodies[1:]
        history = impactfem.solve(scene(bodies, 0.01, 5e-4, **holds)).history
        found.append(np.array([history[f"b.{name}"].values for name in ("x", "y", "vx", "vy")]))
        assert apart(history, "total_energy")[0] < 1e-10 * history["total_energy"].values.max()
    moved = [values - values[:, :1] * [[1.0], [1.0], [0.0], [0.0]] for values in found]
    for rows in (slice(0, 2), slice(2, 4)):
        assert np.abs(moved[0] - moved[1])[rows].max() < 2e-3 * np.abs(moved[1][rows]).max()


def test_rubber_on_a_hinge_swings_as_a_rigid_body_does():
    """Stiff enough to stretch by 1e-5; a hinge holds a region about its place."""
    turn = ["-8*y", "8*x"]
    shape = {"kind": "block", "size": [0.04, 0.2], "corner": [-0.02, -0.2]}
    hinge = {"name": "h", "kind": "revolute", "point": [0.0, 0.0]}
    soft = block("bar", shape["corner"], shape["size"], turn, youngs_modulus=1e8)
    stiff = {
        "kind": "rigid", "name": "bar", "model": "2d", "shape": shape, "density": 1100.0,
        "velocity": [0.8, 0.0], "angular_velocity": 8.0,
    }  # fmt: skip
    found = []
    for body, side in ((soft, "bar/top"), (stiff, "bar")):
        joint = [hinge | {"between": ["ground", side]}]
        pull = {"gravity": [0.0, -9.81]}
        found.append(impactfem.solve(scene([body], 0.2, 2e-3, joint=joint, **pull)).history)
    one, two = found
    # Each of 100 steps ends at the residual of its iterations: 2e-14 or 1.4e-10, by the solver.
    assert np.ptp(one["total_energy"].values) < 1e-9 * one["kinetic_energy"].values[0]
    assert one["h.q"].values[-1] > 0.7
    assert one["h.q"].values == pytest.approx(two["h.q"].values, abs=2e-4)


@pytest.mark.parametrize(("method", "dt"), [("conserving", 1e-3), ("explicit", 2e-4)])
def test_rubber_that_hangs_from_a_start_at_rest_stays(method, dt):
    body = block("bar", [0.0, 0.0], [0.1, 0.02], ["0", "0"])
    joint = {"name": "h", "kind": "fixed", "between": ["ground", "bar/left"], "point": [0.0, 0.01]}
    made = scene(
        [body], 0.01, dt, joint=[joint | {"radius": 1.0}], start="static", gravity=[0.0, -9.81],
        method=method,
    )  # fmt: skip
    history = impactfem.solve(made).history
    assert history["h.force"].values[0] == pytest.approx(2.2 * 9.81, rel=1e-9)
    assert np.ptp(history["bar.y"].values) < 1e-5  # its root turns by a mean
    assert history["bar.y"].values[0] < 0.0099


def test_explicit_steps_hold_rubber_to_second_order():
    """What is held spins and swings; momenta to rounding, against implicit steps of fine time."""
    spin = ["-60*(y-0.02)", "60*(x-0.03)"]
    made = [scene(pair(spin), 0.002, dt, tie=[GLUE], method="explicit") for dt in (1e-4, 5e-5)]
    made.append(scene(pair(spin), 0.002, 2.5e-5, tie=[GLUE], method="explicit"))
    found = [impactfem.solve(each).history for each in made]
    first, second, third = (
        np.array([history[name].values[::skip] for name in ("a.y", "b.y", "a.angle", "force.glue")])
        for history, skip in zip(found, (1, 2, 4), strict=True)
    )
    falls = np.abs(first - second).max(axis=1) / np.abs(second - third).max(axis=1)
    assert falls == pytest.approx(np.full(4, 4.0), rel=0.15)
    for history, most in zip(found, (4e-5, 1e-5, 2.5e-6), strict=True):
        energy, *others = apart(history, "total_energy", "momentum.x", "angular_momentum")
        assert energy < most * history["total_energy"].values[0]
        assert max(others) < 1e-12
    exact = impactfem.solve(scene(pair(spin), 0.002, 1e-4, tie=[GLUE])).history
    # Their masses are other ones: 2e-4 of the turn on cells half as wide as the blocks are thick.
    assert third[2] == pytest.approx(exact["a.angle"].values, abs=5e-4 * third[2, -1])


def test_explicit_steps_of_small_motions_are_those_of_small_strain():
    """A tie, a mass and a damped spring; energy less what the damper takes."""
    holds = {
        "tie": [GLUE], "point_mass": [{"name": "m", "body": "b", "surface": "top", "mass": 1.0}],
        "spring": [
            {"name": "s", "between": ["b/right", "ground"], "stiffness": 3e4, "damping": 5.0}
        ],
    }  # fmt: skip
    found = []
    for strain in ("finite", "small"):
        bodies = [each | {"strain": strain} for each in pair(["0", "0.02*sin(20*y)*x"])]
        made = scene(bodies, 0.004, 5e-5, method="explicit", **holds)
        history = impactfem.solve(made).history
        names = ("a.x", "b.y", "m.y", "s_x.q", "s_y.q")
        found.append(np.array([history[name].values - history[name].values[0] for name in names]))
        assert apart(history, "total_energy")[0] > 1e-2 * history["total_energy"].values[0]
        energy = history["total_energy"].values + history["s_x.lost"].values
        energy = energy + history["s_y.lost"].values
        assert np.ptp(energy) < 2e-3 * energy[0]
    assert np.abs(found[0] - found[1]).max() < 1e-3 * np.abs(found[1]).max()


def braked():
    held = {"between": ["ground", "a/top"], "point": [0.03, 0.021], "damping": 0.02}
    return scene(
        [pair(["-60*(y-0.021)", "60*(x-0.03)"])[0]], 0.016, obstacle=[FLOOR], checkpoint=4,
        joint=[{"name": "h", "kind": "revolute"} | held],
        contact=[{"between": ["a", "floor"], "friction_coefficient": 0.3}],
    )  # fmt: skip


def test_a_held_body_goes_on_as_if_it_had_not_stopped(tmp_path, monkeypatch):
    check_restart(braked(), 9, tmp_path, monkeypatch)


def beside(**more):
    """A box on a hinge on two glued blocks that fall on a floor, in explicit steps."""
    box = {
        "kind": "rigid", "name": "box", "model": "2d", "density": 500.0, "velocity": [0.0, -2.0],
        "shape": {"kind": "block", "size": [0.03, 0.02], "corner": [0.015, 0.0515]},
    }  # fmt: skip
    hinge = {"kind": "revolute", "name": "h", "between": ["b/top", "box"], "point": [0.03, 0.051]}
    return scene(
        [*pair(["0", "-2.0"]), box], 0.004, 1e-4, obstacle=[FLOOR], tie=[GLUE], joint=[hinge],
        contact=[{"between": ["a", "floor"], "friction_coefficient": 0.3}], method="explicit",
        **more,
    )  # fmt: skip


def test_held_bodies_in_explicit_steps_go_on_as_if_they_had_not_stopped(tmp_path, monkeypatch):
    whole, _ = check_restart(beside(checkpoint=15), 25, tmp_path, monkeypatch)
    assert whole.history["contact_force"].values.max() > 1e3
    assert whole.history["h.force"].values.max() > 100.0


@pytest.mark.parallel(2)
def test_ranks_agree_on_held_bodies(monkeypatch):
    bodies = pair(["0", "-2.0"])
    check_ranks(lambda: scene(bodies, 0.006, obstacle=[FLOOR], tie=[GLUE]), monkeypatch)


@pytest.mark.parallel(2)
def test_ranks_agree_on_held_bodies_in_explicit_steps(monkeypatch):
    check_ranks(beside, monkeypatch)
