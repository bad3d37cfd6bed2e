"""Plates against rigid bodies with edges, bars, solids and other plates."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError

HELD = {"supports": [{"edge": e, "kind": "clamped"} for e in ("left", "right", "bottom", "top")]}
WIDE = {"kind": "rectangle", "size": [0.3, 0.3]}
BUMP = "{}*(1-(x/0.1)**2)**2*(1-(y/0.1)**2)**2"


def plate(name="plate", z=0.0, **more):
    return {
        "kind": "plate", "name": name, "mesh_size": 0.04, "thickness": 0.002, "density": 2700.0,
        "outline": {"kind": "rectangle", "size": [0.2, 0.2]}, "youngs_modulus": 70e9,
        "poisson_ratio": 0.3, "center": [0.0, 0.0, z],
    } | more  # fmt: skip


def box(low, size=(0.06, 0.05, 0.04), **more):
    corner = [-0.025, -0.02, low]
    shape = {"kind": "block", "size": list(size), "corner": corner}
    return {"kind": "rigid", "name": "box", "mass": 0.05, "velocity": [0.0, 0.0, -1.0],
            "shape": shape} | more  # fmt: skip


def scene(*bodies, duration=2e-3, dt=4e-6, **more):
    return Scene.from_dict(
        {"title": "plates", "duration": duration, "gravity": [0.0, 0.0, 0.0], "body": list(bodies),
         "solve": {"estimate": False, "dt": dt}, "output": {"fields": []}} | more
    )  # fmt: skip


def test_two_plates_alike_meet_as_one_meets_a_stop():
    low = plate("low", -0.00125, velocity=BUMP.format(2.0), **HELD)
    high = plate("high", 0.00125, velocity=BUMP.format(-2.0), **HELD)
    stop = {"kind": "half_space", "name": "stop", "point": [0, 0, 0], "normal": [0, 0, -1]}
    both = impactfem.solve(scene(low, high, duration=6e-4)).history
    one = impactfem.solve(scene(low, obstacle=[stop], duration=6e-4)).history
    force = one["contact_force"].values
    assert force.max() > 200.0
    np.testing.assert_allclose(both["contact_force"].values, force, atol=1e-6 * force.max())
    energy = both["total_energy"].values
    assert np.ptp(energy) < 1e-7 * energy[0]


def test_a_heavy_box_presses_as_an_obstacle_that_moves():
    """It covers the plate, so that no corner of it touches."""
    heavy = box(0.0011, (0.5, 0.5, 0.1), mass=1e9)
    heavy["shape"]["corner"][:2] = [-0.25, -0.25]
    moving = {"kind": "half_space", "name": "stop", "point": [0.0, 0.0, 0.0011],
              "normal": [0.0, 0.0, -1.0], "motion": ["0", "0", "-t"]}  # fmt: skip
    free = plate(velocity=0.0)
    one = impactfem.solve(scene(free, heavy, duration=5e-4)).history
    two = impactfem.solve(scene(free, obstacle=[moving], duration=5e-4)).history
    force = two["contact_force"].values
    assert force.max() > 100.0
    np.testing.assert_allclose(one["contact_force"].values, force, atol=1e-6 * force.max())


@pytest.mark.parametrize("turned", [False, True])
def test_a_box_lands_flat_or_on_a_corner(turned):
    """A corner amid a triangle too: what it loses is the impulse, and energy stays."""
    more = {"orientation": {"axis": [1.0, 0.4, 0.0], "angle": 0.3}} if turned else {}
    run = impactfem.solve(
        scene(plate(**HELD), box(0.0103 if turned else 0.0011, **more), duration=8e-4)
    )
    history = run.history
    force, dt = history["contact_force"].values, np.diff(history["time"].values)[0]
    gained = 0.05 * np.diff(history["box.vz"].values[[0, -1]])[0]
    assert force.sum() * dt == pytest.approx(gained, rel=1e-5)  # but for how normals lean
    assert gained > 0.01
    assert (abs(history["box.wx"].values[-1]) > 1.0) >= turned
    energy = history["total_energy"].values
    assert np.ptp(energy) < 1e-5 * energy[0]


CUBE = {
    "kind": "solid", "name": "box", "model": "3d", "strain": "small", "mesh_size": 0.02,
    "shape": {"kind": "block", "size": [0.06, 0.05, 0.04], "corner": [-0.0237, -0.0191, 0.0011]},
    "density": 1200.0, "youngs_modulus": 1e8, "poisson_ratio": 0.3, "velocity": [0.0, 0.0, -1.0],
    "contact_surfaces": ["back"],
}  # fmt: skip
PARTNERS = {"box": box(0.0011), "plate": plate("box", 0.0023, velocity=-1.0), "cube": CUBE}


@pytest.mark.parametrize("name", PARTNERS)
def test_momentum_of_a_free_plate_and_its_partner(name):
    history = impactfem.solve(scene(plate(), PARTNERS[name], duration=5e-4)).history
    assert history["contact_force"].values.max() > 10.0
    momentum = history["momentum.z"].values
    assert np.ptp(momentum) < 1e-10 * abs(momentum[0])
    energy = history["total_energy"].values
    assert np.ptp(energy) < 1e-3 * energy[0]
    assert np.diff(energy).max() < 1e-4 * energy[0]


def test_a_bar_strikes_with_its_end():
    """Before waves are back it is braked as by a damper: F = Z (v - w), Z = rho c A."""
    bar = {"kind": "bar", "name": "bar", "length": 2.0, "density": 7800.0, "youngs_modulus": 210e9,
           "area": 1e-4, "far_end": "free", "point": [0.0, 0.0, 0.001], "axis": [0.0, 0.0, 1.0],
           "velocity": -1.0}  # fmt: skip
    made = scene(plate(mesh_size=0.008, outline=WIDE, **HELD), bar, duration=1.4e-4, dt=1e-6)
    history = impactfem.solve(made).history
    force, z = history["contact_force"].values, np.sqrt(7800.0 * 210e9) * 1e-4
    # The plate without end is a damper too: 8 sqrt(D rho t).
    wave = 8.0 * np.sqrt(70e9 * 0.002**3 / (12.0 * 0.91) * 2700.0 * 0.002)
    known = z * wave / (z + wave)
    time = history["time"].values
    later = time > 6e-5
    assert np.mean(force[later]) == pytest.approx(known, rel=0.05)


@pytest.mark.parametrize(
    ("bodies", "law", "message"),
    [
        ((plate(), PARTNERS["plate"]), {"stiffness": 1e6}, "may touch at many places"),
        ((plate(), PARTNERS["box"]), {"stiffness": 1e6}, "may touch at many places"),
        ((plate(theory="reissner_mindlin"), PARTNERS["box"]), {}, "press on a single place"),
    ],
)
def test_what_is_not_available_is_refused(bodies, law, message):
    with pytest.raises(SceneError, match=message):
        scene(*bodies, contact=[{"between": ["plate", "box"]} | law])


def mixed():
    return scene(
        plate(), CUBE, plate("low", center=[0.0031, 0.0017, -0.00201]), duration=4e-4, dt=8e-6,
        output={"fields": [], "checkpoint": 10},
    )  # fmt: skip


def test_a_run_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    whole, _ = check_restart(mixed(), 37, tmp_path, monkeypatch)
    assert whole.history["force.plate.low"].values.max() > 0.0


@pytest.mark.parallel(2)
def test_ranks_agree(monkeypatch):
    check_ranks(mixed, monkeypatch)
