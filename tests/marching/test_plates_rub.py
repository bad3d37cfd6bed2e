"""Plates with friction: on a face, half the thickness off the mid-surface."""

import numpy as np
import pytest
from moving_scenes import FAR_3D, check_ranks, check_restart
from scipy.sparse.linalg import spsolve

import impactfem
from impactfem import Scene
from impactfem.contact.faces import Faces
from impactfem.scene import Plate
from impactfem.system.plate_making import discretised
from impactfem.system.plate_mesh import plate_mesh

SIDES = ("left", "right", "bottom", "top")
T = 0.02
UNIT = {"thickness": T, "density": 1.0 / T, "youngs_modulus": 12.0 / T**3, "poisson_ratio": 0.0}
"""With D = rho t = 1."""


def plate(*held, **more):
    return {
        "kind": "plate", "name": "plate", "mesh_size": 0.2, "thickness": T, "density": 2e3,
        "outline": {"kind": "rectangle", "size": [1.0, 1.0]}, "youngs_modulus": 2e11,
        "poisson_ratio": 0.3, "supports": [{"edge": edge, "kind": "clamped"} for edge in held],
    } | more  # fmt: skip


def floor(way="0", low=0.0):
    return {"kind": "half_space", "name": "floor", "point": [0.0, 0.0, -0.5 * T - low],
            "normal": [0.0, 0.0, 1.0], "motion": [way, "0", "0"]}  # fmt: skip


def scene(*bodies, on=None, mu=0.3, duration=0.03, dt=5e-4, gravity=0.0, law=None, **more):
    names = ["plate", bodies[1]["name"] if on is None else on["name"]]
    return Scene.from_dict(
        {"title": "rubbing", "duration": duration, "gravity": [0.0, 0.0, -gravity],
         "body": list(bodies), "obstacle": [] if on is None else [on],
         "contact": [{"between": names, "friction_coefficient": mu} | (law or {})],
         "output": {"fields": []}, "solve": {"estimate": False, "dt": dt}} | more
    )  # fmt: skip


def lost(history):
    """Share of the energy that neither motion, strain nor friction has."""
    energy = history["total_energy"].values
    return np.ptp(energy - history["friction_work"].values) / np.abs(energy).max()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_traction_on_a_face_is_a_moment_of_half_the_thickness(side):
    """A cantilever of moments m = s t/2 along it: w = m (L x^2/2 - x^3/6) / D."""
    strip = Plate(outline={"kind": "rectangle", "size": [1.0, 0.2]}, mesh_size=0.05,
                  supports=[{"edge": "left", "kind": "clamped"}], **UNIT)  # fmt: skip
    made = discretised(strip, plate_mesh(strip, None), touches=False, sprung=True, rubs=True)
    faces, areas = Faces(*made.faces), made.areas
    vertices, nodes = np.arange(len(areas)), len(made.radius)
    normals = np.tile([0.0, 0.0, side], (len(areas), 1))
    weights = faces.reached(np.eye(nodes)[vertices], normals)
    traction = weights.T @ np.outer(areas, [1.0, 0.0, 0.0])
    pushed = made.on_faces.pulled(made.on_faces.pressing(traction))
    w = made.deflection(spsolve(made.stiffness.tocsc(), pushed))
    x = made.mesh.points[:, 0] + 0.5
    # It touches the lower face where the normal looks up: the end of that face is drawn out.
    np.testing.assert_allclose(w, side * 0.5 * T * (x**2 / 2 - x**3 / 6), atol=0.01 * T / 6)


@pytest.mark.slow
def test_a_strip_on_a_bed_that_rubs_bends_at_its_ends():
    """On k the ends of a moment m along a strip lift and sink by 2 m l/k, l = (k/4D)^1/4."""
    mu, pressure, bed = 0.3, 1.0, 2e3
    strip = plate(
        mesh_size=0.1, outline={"kind": "rectangle", "size": [2.0, 0.2]}, theory="kirchhoff",
        pressures=[{"face": "top", "value": pressure}], rayleigh_mass=80.0, **UNIT,
    )  # fmt: skip
    probes = [{"name": n, "body": "plate", "point": [x, 0, 0]} for n, x in (("l", -1), ("r", 1))]
    history = impactfem.solve(
        scene(strip, on=floor("0.01*t"), law={"stiffness": bed}, dt=4e-3, duration=0.4,
              probe=probes)
    ).history  # fmt: skip
    tilt = 0.5 * (history["r.uz"].values - history["l.uz"].values)[-1]
    moment = mu * pressure * 0.5 * T
    assert tilt == pytest.approx(2.0 * moment * (bed / 4.0) ** 0.25 / bed, rel=0.05)


@pytest.mark.parametrize("membrane", ["none", "von_karman"])
def test_a_sphere_slides_then_rolls(membrane):
    """As on a half-space: it keeps 5/7 of its speed, and rolls by its radius, not more."""
    form = {"kind": "sphere", "radius": 0.05, "center": [-0.03, 0.02, 0.05 + 0.5 * T]}
    ball = {"kind": "rigid", "name": "ball", "mass": 0.1, "shape": form,
            "velocity": [0.3, 0.0, 0.0]}  # fmt: skip
    made = scene(plate(*SIDES, membrane=membrane, youngs_modulus=2e12), ball, gravity=9.81)
    history = impactfem.solve(made.with_settings({"duration": 0.045})).history
    assert history["ball.vx"].values[-1] == pytest.approx(5.0 / 7.0 * 0.3, rel=2e-3)
    assert 0.05 * history["ball.wy"].values[-1] == pytest.approx(5.0 / 7.0 * 0.3, rel=2e-3)
    assert lost(history) < (1e-9 if membrane == "von_karman" else 1e-4)


@pytest.mark.parametrize("theory", ["kirchhoff", "reissner_mindlin"])
@pytest.mark.parametrize("membrane", ["none", "von_karman"])
def test_a_floor_moves_along_under_a_pressed_plate(theory, membrane):
    """It slips, turns back and sticks; all of the energy is kept but for the work of friction."""
    body = plate(
        "left", membrane=membrane, theory=theory, thickness=0.1, youngs_modulus=2e8,
        pressures=[{"face": "top", "value": "1e3*(1-cos(200*t))"}],
    )  # fmt: skip
    history = impactfem.solve(scene(body, on=floor("1e-3*sin(150*t)", 0.04))).history
    force, rubbing = history["contact_force"], history["tangential_force.plate.floor.x"]
    force, rubbing = force.values, rubbing.values
    assert force.max() > 500.0
    assert np.abs(rubbing).max() == pytest.approx(0.3 * force.max(), rel=0.3)
    assert (np.abs(rubbing) <= 0.3 * force * (1.0 + 1e-9) + 1e-9).all()
    assert rubbing.min() < 0.0 < rubbing.max()
    assert lost(history) < 1e-9


@pytest.mark.slow
def test_a_strip_on_a_floor_that_slides_is_stretched():
    """N' = mu p from its free end on: u = mu p L^2 / 2 E t there."""
    mu, pressure = 0.4, 200.0
    strip = plate(
        "left", mesh_size=0.05, outline={"kind": "rectangle", "size": [1.0, 0.2]},
        membrane="von_karman", thickness=T, density=100.0, youngs_modulus=1e7, poisson_ratio=0.0,
        pressures=[{"face": "top", "value": pressure}], rayleigh_mass=50.0,
    )  # fmt: skip
    end = [{"name": "end", "body": "plate", "point": [0.5, 0.0, 0.0]}]
    history = impactfem.solve(
        scene(strip, on=floor("0.2*t"), mu=mu, dt=1e-3, duration=0.06, start="static", probe=end)
    ).history
    u = 0.5 * (history["end.ux"].values[1:] + history["end.ux"].values[:-1])
    known = mu * pressure / (2.0 * 1e7 * T)
    assert u[0] == pytest.approx(0.0, abs=0.6 * known)
    assert u[-1] == pytest.approx(known, rel=0.05)


def test_two_plates_rub():
    """One free, askew: its momentum is what presses, and it does not move in its plane."""
    other = plate(outline={"kind": "rectangle", "size": [0.5, 0.5]}, velocity=-1.0) | {
        "name": "other", "center": [0.1, 0.05, T + 1e-5],
    }  # fmt: skip
    made = scene(plate(*SIDES, membrane="von_karman"), other, duration=5e-3, dt=1e-4)
    history = impactfem.solve(made).history
    force = history["contact_force"].values
    assert history["friction_work"].values[-1] < 0.0
    assert lost(history) < 1e-9
    gained = np.diff(history["other.vz"].values[[0, -1]])[0] * 0.25 * 2e3 * T
    assert force.sum() * 1e-4 == pytest.approx(gained, rel=1e-2)


def moving(*others, **body):
    ball = {"kind": "point", "name": "ball", "mass": 0.1, "radius": 0.02,
            "position": [-0.15, 0.03, 0.02 + 0.5 * T], "velocity": [1.0, 0.2, -0.1]}  # fmt: skip
    more = {"output": {"fields": [], "checkpoint": 5}, "gravity": 9.81}
    return lambda: scene(plate(*SIDES, **body), ball, *others, dt=1e-3, **more)


SCENES = {
    "bending": moving(), "beside rubber": moving(FAR_3D),
    "stretching": moving(membrane="von_karman"),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_a_point_is_braked_by_mu_times_what_presses(name):
    """As on a half-space; in iterates, as beside rubber, all of the energy is kept."""
    history = impactfem.solve(SCENES[name]()).history
    speed = np.hypot(history["ball.vx"].values, history["ball.vy"].values)
    braked = 0.3 * 1e-3 * history["contact_force"].values.sum() / 0.1
    assert speed[0] - speed[-1] == pytest.approx(braked, rel=1e-3)
    assert braked > 0.1
    assert lost(history) < (1e-3 if name == "bending" else 1e-9)


@pytest.mark.parallel([1, 2])
@pytest.mark.parametrize("name", SCENES)
def test_a_run_goes_on_where_it_was_stopped(name, tmp_path, monkeypatch):
    check_restart(SCENES[name](), 17, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("name", SCENES)
def test_ranks_agree(name, monkeypatch):
    check_ranks(SCENES[name], monkeypatch)
