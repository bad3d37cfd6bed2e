"""Explicit steps under finite strain: what they keep, what contact does, how they end."""

from dataclasses import replace

import numpy as np
import pytest
from test_finite import RUBBER, columns, scene, spread

import impactfem
from impactfem import SceneError
from impactfem.marching.level_march import LevelMarch

SPACE = {"point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}
BALL = {
    "model": "3d", "mesh_size": 0.0125, "velocity": [0.0, 0.0, -2.0],
    "angular_velocity": [0.0, 30.0, 0.0],
    "shape": {"kind": "sphere", "radius": 0.05, "center": [0.0, 0.0, 0.0505]},
}  # fmt: skip


def run(duration, body=(), obstacle=(), courant=0.6, **more):
    solve = {"method": "explicit", "courant": courant, "dt": None}
    return impactfem.solve(scene(duration, body, obstacle, solve, **more))


def test_a_body_that_flies_keeps_its_momenta():
    flying = {"velocity": [1.0, 3.0], "angular_velocity": 60.0}
    result = run(0.1, flying)
    names = ("total_energy", "angular_momentum", "momentum.x", "momentum.y", "disc.angle")
    energy, spun, x, y, angle = columns(result, *names)
    for values in (x, y):
        assert spread(values) <= 1e-13 * np.abs(values).max()
    assert spread(spun) <= 1e-12 * np.abs(spun).max()
    assert spread(energy) <= 5e-6 * energy.max()
    assert angle[-1] == pytest.approx(6.0, rel=5e-3)
    assert result.summary["method"] == "explicit"


def test_a_bounce_is_that_of_fine_steps():
    result = run(0.012)
    energy, force, gap, speed = columns(result, "total_energy", "contact_force", "gap", "disc.vy")
    assert np.abs(energy / energy[0] - 1.0).max() <= 1e-3
    assert force.min() >= 0.0
    assert np.abs(np.diff(force)).sum() <= 2.6 * force.max()  # it rises and falls once
    assert gap.min() >= -2.0 * result.history["time"].values[1]  # the way of a step
    # Reference of finer meshes: 1.871 m/s and 5520 N at h -> 0; here h = R / 4.
    assert speed[-1] == pytest.approx(1.871, rel=0.03)
    assert force.max() == pytest.approx(5520.0, rel=0.04)
    # What the body gains the floor has given.
    (momentum,) = columns(result, "momentum.y")
    impulse = force[1:].sum() * result.history["time"].values[1]
    assert momentum[-1] - momentum[0] == pytest.approx(impulse, rel=1e-12)


def test_contact_gives_energy_where_first_and_last_forces_are_not_cut(monkeypatch):
    """The negative control of `LevelMarch._turning`: a gain of second order in the step."""
    (energy,) = columns(run(0.02, BALL, SPACE), "total_energy")
    assert -4e-4 <= energy[-1] / energy[0] - 1.0 <= 1e-5
    monkeypatch.setattr(
        LevelMarch, "_turning", lambda _, last: replace(last, force=0.0 * last.force)
    )
    (energy,) = columns(run(0.02, BALL, SPACE), "total_energy")
    assert energy[-1] / energy[0] - 1.0 >= 1e-4


def test_a_ball_keeps_what_its_floor_cannot_change():
    result = run(0.02, BALL, SPACE)
    names = ("angular_momentum.y", "angular_momentum.z", "momentum.x", "momentum.z")
    spun, upright, aside, up = columns(result, *names)
    assert spread(upright) <= 1e-12 * spun.max()
    assert spread(aside) <= 1e-12 * up.max()
    (force,) = columns(result, "contact_force")
    assert np.abs(np.diff(force)).sum() <= 2.1 * force.max()


def test_a_floor_that_rises_is_a_body_that_falls():
    coarse = {"mesh_size": 0.02}
    falls = run(0.03, coarse)
    rises = run(0.03, coarse | {"velocity": [0.0, 0.0]}, {"motion": ["0", "2*t"]})
    one, other = (next(columns(result, "contact_force")) for result in (falls, rises))
    assert np.abs(one - other).max() <= 1e-10 * one.max()
    (energy,) = columns(rises, "total_energy")
    assert spread(energy) <= 1e-4 * one.max() * 0.05


@pytest.mark.parametrize(
    "more",
    [
        {"supports": [{"surface": "left", "kind": "motion", "value": ["0", "0.02*sin(100*t)"]}]},
        {"supports": [{"surface": "left", "kind": "fixed"}],
         "tractions": [{"surface": "right", "value": ["0", "-5000*sin(50*t)"]}]},
    ],
)  # fmt: skip
def test_loads_and_moved_supports_do_the_work_that_the_body_gains(more):
    block = {
        "shape": {"kind": "block", "size": [0.1, 0.02], "corner": [0.0, 0.5]},
        "velocity": [0.0, 0.0], "mesh_size": 0.01,
    }  # fmt: skip
    result = run(0.03, block | more, {"point": [0.0, 0.3]})
    energy, kinetic = columns(result, "total_energy", "kinetic_energy")
    assert kinetic.max() > 0.5
    assert spread(energy) <= 1e-3 * kinetic.max()  # of second order in the step
    dt = result.history["time"].values[1]
    fine = run(0.03, block | more, {"point": [0.0, 0.3]}, 0.3)
    assert fine.history["time"].values[1] < 0.6 * dt
    assert spread(next(columns(fine, "total_energy"))) <= 0.4 * spread(energy)


def test_a_body_at_rest_stays_at_rest():
    still = {"velocity": [0.0, 0.0]}
    result = run(0.01, still, gravity=[0.0, -50.0], start="static")
    kinetic, force = columns(result, "kinetic_energy", "contact_force")
    weight = 50.0 * result.summary["bodies"]["disc"]["mass"]
    assert np.abs(force - weight).max() <= 1e-9 * weight
    assert kinetic.max() <= 1e-15


def test_ten_bounces_lose_little_and_gain_nothing():
    result = run(0.4, {"mesh_size": 0.02}, courant=0.6, gravity=[0.0, -100.0])
    energy, force = columns(result, "total_energy", "contact_force")
    assert np.count_nonzero((force[1:] > 0.0) & (force[:-1] == 0.0)) >= 8
    assert energy.max() <= (1.0 + 2e-3) * energy[0]
    assert energy[-1] >= 0.99 * energy[0]


def test_squeezed_cells_get_shorter_steps_or_an_end(monkeypatch):
    pieces = []
    settle = LevelMarch._settle

    def watch(self, *times):
        pieces.append(times)
        return settle(self, *times)

    monkeypatch.setattr(LevelMarch, "_settle", watch)
    result = run(0.006, {"velocity": [0.0, -8.0]}, courant=0.9)
    assert len(pieces) > result.summary["num_steps"]
    (energy,) = columns(result, "total_energy")
    assert energy[-1] == pytest.approx(energy[0], rel=0.06)  # a cut amid contact gives some
    told = [found["text"] for found in result.summary["verdict"]["findings"]]
    assert any("shorter steps" in text for text in told)
    broken = run(0.006, {"velocity": [0.0, -40.0]})
    assert broken.summary["status"] == "not_converged"
    assert "inside out" in broken.summary["active_set"]["message"]


@pytest.mark.parametrize(
    ("body", "more", "key"),
    [
        ({"rayleigh_stiffness": 1e-5}, {}, "body[0].rayleigh_stiffness"),
        ({"degree": 2}, {}, "degree = 2"),
        ({"element": "mean_dilatation", "cells": "hexahedron"}, {}, "body[0].element"),
        ({"poisson_ratio": 0.499, "cells": "hexahedron"}, {}, "6.6 times as short"),
    ],
)  # fmt: skip
def test_what_explicit_steps_do_not_do_is_refused_by_its_key(body, more, key):
    with pytest.raises(SceneError) as error:
        impactfem.plan(scene(0.01, body, solve={"method": "explicit", "dt": 1e-5}, **more))
    assert key in str(error.value)


def test_small_strain_does_not_go_beside():
    data = scene(0.01, solve={"method": "explicit", "dt": 1e-5}).to_dict()
    shape = RUBBER["shape"] | {"center": [0.0, 0.2]}
    small = {"name": "other", "shape": shape, "strain": "small", "material": "linear"}
    data["body"] = [RUBBER, RUBBER | small]
    data["contact"] = [{"between": ["disc", name]} for name in ("floor", "other")]
    with pytest.raises(SceneError, match=r'body\[1\].strain = "small" of other') as error:
        impactfem.Scene.from_dict(data)
    assert "conserving" in str(error.value)
