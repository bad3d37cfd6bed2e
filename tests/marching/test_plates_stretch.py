"""Plates whose middle stretches, marched: energy, contact, starts, company, restart, refusals."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError

STEEL = {"thickness": 0.01, "density": 100.0, "youngs_modulus": 12.0 * 0.91e6, "poisson_ratio": 0.3}
"""With D = rho t = 1."""
SIDES = ("left", "right", "bottom", "top")


def plate(membrane="von_karman", kind="clamped", held=SIDES, **more):
    return {
        "kind": "plate", "name": "plate", "mesh_size": 0.1, "membrane": membrane,
        "outline": {"kind": "rectangle", "size": [1.0, 1.0]},
        "supports": [{"edge": edge, "kind": kind} for edge in held],
    } | STEEL | more  # fmt: skip


def stop(low):
    """A flat stop below the middle of the plate, whose bottom face is at -0.005."""
    return {"kind": "half_space", "name": "stop", "point": [0.0, 0.0, -0.005 - low],
            "normal": [0.0, 0.0, 1.0]}  # fmt: skip


def scene(*bodies, duration=0.3, dt=5e-4, obstacles=(), **more):
    return Scene.from_dict(
        {"title": "stretching", "duration": duration, "gravity": [0.0, 0.0, 0.0],
         "body": list(bodies), "obstacle": list(obstacles), "output": {"fields": []},
         "solve": {"estimate": False, "dt": dt}} | more
    )  # fmt: skip


def thrown(speed=500.0, **more):
    """Thrown onto a flat stop, as fast as bends it by its thickness."""
    shape = f"-{speed}*(0.25-x**2)**2*(0.25-y**2)**2"
    return plate(velocity=shape, **more)


def test_energy_of_vibrations_and_of_contacts_is_kept_to_rounding():
    shape = "0.3*(x**2-0.25)*(y**2-0.25)"
    free = impactfem.solve(scene(plate(displacement=shape, mesh_size=0.14), dt=1e-3)).history
    energy = free["total_energy"].values
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-12
    assert free["kinetic_energy"].values.max() > 0.5 * energy[0]
    bouncing = scene(thrown(mesh_size=0.14), obstacles=[stop(0.008)], dt=1e-3)
    history = impactfem.solve(bouncing).history
    energy, force = history["total_energy"].values, history["contact_force"].values
    assert np.count_nonzero((force[1:] > 0.0) & (force[:-1] == 0.0)) > 3
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-9


def test_small_deflections_are_those_of_a_linear_plate():
    """To first order of the step: their laws of contact differ by where a layer closes a gap."""

    def motion(membrane):
        far = scene(thrown(1.0, membrane=membrane), obstacles=[stop(1e-5)], dt=2e-4, duration=0.1)
        history = impactfem.solve(far).history
        return history["plate.z"].values, 2e-4 * history["contact_force"].values.sum()

    (one, kick), (two, other) = (motion(membrane) for membrane in ("von_karman", "none"))
    assert kick > 0.0
    assert np.abs(one - two).max() < 0.02 * np.abs(two).max()
    assert kick == pytest.approx(other, rel=0.02)


def test_it_starts_in_equilibrium_and_stays_there():
    """Under a pressure that bends it by nearly twice its thickness, free and on a stop."""
    pressed = plate(pressures=[{"face": "top", "value": 40.0}])
    probe = [{"name": "middle", "body": "plate", "point": [0.0, 0.0, 0.0]}]

    def rest(body, *obstacles):
        more = {"start": "static", "probe": probe}
        return impactfem.solve(scene(body, obstacles=obstacles, duration=0.02, **more)).history

    held = rest(pressed)
    w = held["middle.uz"].values
    linear = rest(pressed | {"membrane": "none"})["middle.uz"].values[0]
    assert linear < -0.04
    assert -0.02 < w[0] < -0.015
    assert np.ptp(w) < 1e-11 * abs(w[0])
    lying = rest(pressed, stop(0.01))
    force = lying["contact_force"].values
    assert force[0] > 1.0
    assert np.ptp(force) < 1e-7 * force[0]
    assert np.ptp(lying["middle.uz"].values) < 1e-10


def test_a_ball_and_a_rubber_block_strike_it():
    """Momentum along the normal of a free plate and of what strikes it, and the energy of all."""
    ball = {"kind": "point", "name": "ball", "mass": 0.05, "position": [0.11, -0.07, 0.02],
            "velocity": [0.0, 0.0, -2.0], "radius": 0.01}  # fmt: skip
    block = {
        "kind": "solid", "name": "rubber", "model": "3d", "strain": "finite", "mesh_size": 0.1,
        "shape": {"kind": "block", "size": [0.2, 0.2, 0.2], "corner": [-0.3, -0.1, -0.21]},
        "density": 10.0, "youngs_modulus": 1e4, "poisson_ratio": 0.3, "velocity": [0.0, 0.0, 1.0],
        "contact_surfaces": ["front"], "material": "neo_hookean",
    }  # fmt: skip
    for membrane, others in (("von_karman", [ball]), ("none", [block])):
        made = scene(plate(membrane, held=()), *others, dt=2e-4, duration=0.012)
        history = impactfem.solve(made).history
        assert history["contact_force"].values.max() > 0.0
        momentum = history["momentum.z"].values
        assert np.ptp(momentum) < 1e-9 * np.abs(momentum).max()
        energy = history["total_energy"].values
        lost = energy[0] - energy[-1]  # a ball without restitution sends nothing back at once
        assert abs(lost) < (1e-3 if others == [block] else 0.5) * energy[0]
        assert np.diff(energy).max() < 1e-6 * energy[0]


def struck(membrane="von_karman", speed=0.2, exponent=1.5, **more):
    """By a ball, off the middle, on a contact that gives way; the plate's face is at 0.005."""
    ball = {"kind": "point", "name": "ball", "mass": 1.0, "radius": 0.05,
            "position": [0.06, 0.04, 0.05501], "velocity": [0.0, 0.0, -speed]}  # fmt: skip
    law = {"between": ["plate", "ball"], "stiffness": 1e5, "stiffness_exponent": exponent}
    return scene(plate(membrane), ball, contact=[law], **{"duration": 0.25, "dt": 2e-3} | more)


@pytest.mark.slow
def test_balls_on_contacts_that_give_way_keep_energy():
    """And meet a linear plate where they hardly bend it, which keeps energy to their turning."""
    for exponent in (1.0, 1.5):
        history = impactfem.solve(struck(exponent=exponent, dt=4e-3)).history
        energy, force = history["total_energy"].values, history["contact_force"].values
        assert force.max() > 0.0
        assert force[-1] == 0.0
        assert np.abs(energy / energy[0] - 1.0).max() < 1e-10  # 3e-14 measured
    one, two = (
        impactfem.solve(struck(membrane, 2e-3)).history["ball.vz"].values
        for membrane in ("von_karman", "none")
    )
    assert one == pytest.approx(two, abs=1e-3 * 2e-3)


def test_a_layer_on_a_stop_gives_way_under_it():
    law = [{"between": ["plate", "stop"], "stiffness": 1e8}]
    soft = scene(thrown(mesh_size=0.14), obstacles=[stop(0.008)], contact=law, duration=0.08)
    history = impactfem.solve(soft).history
    energy = history["total_energy"].values
    assert history["contact_force"].values.max() > 0.0
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-10


def test_it_starts_in_equilibrium_on_a_layer_and_stays_there():
    law = [{"between": ["plate", "stop"], "stiffness": 1e8}]
    pressed = plate(mesh_size=0.14, pressures=[{"face": "top", "value": "2e3"}])
    more = {"start": "static", "duration": 0.05}
    history = impactfem.solve(scene(pressed, obstacles=[stop(0.004)], contact=law, **more)).history
    force, place = history["contact_force"].values, history["plate.z"].values
    assert force.min() > 1e3
    assert np.ptp(force) < 1e-9 * force[0]  # 0 and 1e-16 measured
    assert np.ptp(place) < 1e-9 * abs(place[0])


@pytest.mark.parametrize(
    ("change", "more", "match"),
    [
        ({"membrane": "none", "supports": [{"edge": "left", "kind": "clamped",
                                            "in_plane": "free"}]},
         {}, r"supports\[0\].in_plane = \"free\": the plate does not stretch"),
        ({"residual_stress": 1e3, "supports": [
            {"edge": edge, "kind": "clamped", "in_plane": "free"} for edge in SIDES]},
         {}, "residual_stress = 1000 Pa needs all edges held"),
        ({}, {"solve": {"method": "newmark"}}, 'solve.*method.*membrane = "von_karman"'),
    ],
)  # fmt: skip
def test_what_it_does_not_do_is_refused(change, more, match):
    ball = {"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0, 0.0, 0.1]}
    with pytest.raises(SceneError, match=match):
        impactfem.solve(scene(plate(**change), ball, **more))


def test_layers_that_stretch_as_they_bend_are_refused():
    one = {"thickness": 0.005, "density": 100.0, "youngs_modulus": 1e7, "poisson_ratio": 0.3}
    layers = [one, one | {"youngs_modulus": 2e7, "poisson_ratio": 0.1}]
    given = {key: value for key, value in plate().items() if key not in STEEL}
    with pytest.raises(SceneError, match="symmetric about the middle"):
        scene(given | {"layers": layers})


def moving():
    return scene(
        thrown(damping_ratio=[0.02, 0.01], mesh_size=0.2), obstacles=[stop(0.008)],
        duration=0.04, dt=1e-3,
        output={"fields": [], "checkpoint": 5},
    )  # fmt: skip


def dented():
    return struck(duration=0.08, output={"fields": [], "checkpoint": 5})


@pytest.mark.parallel([1, 2])
@pytest.mark.parametrize("made", [moving, dented])
def test_a_run_goes_on_where_it_was_stopped(made, tmp_path, monkeypatch):
    check_restart(made(), 27, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("made", [moving, dented])
def test_ranks_agree(made, monkeypatch):
    check_ranks(made, monkeypatch)
