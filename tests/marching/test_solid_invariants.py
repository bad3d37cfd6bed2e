"""What every layer of every impact keeps: no penetration, no pull, energy, momentum."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import impactfem
from impactfem.marching.solids import SolidMarch
from impactfem.models.solids import solids_model
from impactfem.runs import loops


@pytest.fixture
def levels(monkeypatch):
    """Levels that a march shows, each with the multipliers of contact at its end."""
    seen = []

    class Watched(SolidMarch):
        def _observe(self, observers, force):
            def keep(level):
                seen.append((level.force.copy(), level.gap.copy(), self.contact.multiplier.copy()))

            super()._observe([*observers, keep], force)

    monkeypatch.setattr(loops, "SolidMarch", Watched)
    return seen


def numbers(low, high):
    return st.floats(low, high, allow_nan=False)


@st.composite
def impacts(draw):
    """A small body of any kind in a field, thrown at a plane in any direction."""
    method = draw(st.sampled_from(["massless", "conserving", "explicit"]))
    angle = draw(numbers(-np.pi, np.pi))
    normal = np.array([-np.sin(angle), np.cos(angle)])
    aside = np.array([normal[1], -normal[0]])
    gap = draw(st.sampled_from([0.0, 0.01, 0.1]))
    turn = angle + draw(st.sampled_from([0.0, 0.1, np.pi / 4]))
    center = 1.3 * normal
    shape = draw(
        st.sampled_from(
            [
                {"kind": "disc", "radius": 0.5, "center": center.tolist()},
                {"kind": "block", "size": [0.6, 1.0], "corner": (center - [0.3, 0.5]).tolist(),
                 "angle": float(turn)},
            ]
        )
    )  # fmt: skip
    velocity = -draw(numbers(0.0, 0.5)) * normal + draw(numbers(-0.3, 0.3)) * aside
    pull = -draw(numbers(0.0, 0.5)) * normal + draw(numbers(-0.2, 0.2)) * aside
    cells = draw(st.sampled_from(["simplex", "hexahedron"]))
    degree = 1 if method == "explicit" or cells == "hexahedron" else draw(st.sampled_from([1, 2]))
    solve = {"method": method, "estimate": False}
    if method == "explicit":
        solve["courant"] = draw(numbers(0.2, 1.0))
    else:
        solve["dt"] = draw(numbers(0.01, 0.3))
    body = {
        "name": "body", "kind": "solid", "model": "plane_strain", "cells": cells,
        "degree": degree, "shape": shape, "mesh_size": 0.25, "strain": "small",
        "density": draw(numbers(0.5, 2.0)),
        "youngs_modulus": draw(numbers(0.5, 2.0)), "poisson_ratio": draw(numbers(-0.3, 0.45)),
        "velocity": velocity.tolist(),
    }  # fmt: skip
    # The lowest corner is where the body would touch.
    lowest = 0.5
    if shape["kind"] == "block":
        corners = np.array([[x, y] for x in (-0.3, 0.3) for y in (-0.5, 0.5)])
        c, s = np.cos(turn), np.sin(turn)
        lowest = float(-(corners @ np.array([[c, s], [-s, c]]) @ normal).min())
    floor = {
        "kind": "half_space", "name": "floor", "normal": normal.tolist(),
        "point": ((1.3 - lowest - gap) * normal).tolist(),
    }  # fmt: skip
    return {
        "title": "random", "duration": 3.0, "gravity": pull.tolist(), "body": [body],
        "obstacle": [floor], "solve": solve, "output": {"fields": []},
    }  # fmt: skip


@pytest.mark.slow
@given(tables=impacts())
@settings(
    max_examples=40, deadline=None, derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)  # fmt: skip
def test_invariants_of_random_impacts(levels, tables):
    levels.clear()
    scene = impactfem.Scene.from_dict(tables)
    history = impactfem.solve(scene).history
    mass = solids_model(scene, [tables["body"][0]["degree"]]).parts[0].system.total_mass
    method, normal = tables["solve"]["method"], np.array(tables["obstacle"][0]["normal"])
    force, gap, multiplier = (np.array([level[k] for level in levels]) for k in range(3))
    size = np.hypot(0.6, 1.0)
    strongest = max(float(multiplier.max(initial=0.0)), float(force.max(initial=0.0)))

    # Signorini's conditions at every contact node and level.
    assert gap.min(initial=0.0) >= -1e-12 * size
    assert force.min(initial=0.0) >= 0.0
    assert multiplier.min(initial=0.0) >= 0.0
    assert (multiplier * np.maximum(gap, 0.0)).max(initial=0.0) <= 1e-12 * size * strongest

    # Energy never grows, and conserving schemes keep it.
    energy = history["total_energy"].values
    moving = (history["kinetic_energy"] + history["elastic_energy"]).values
    scale = max(moving.max(), float(np.abs(history["potential_energy"]).max()))
    assert (energy - energy[0]).max() <= 1e-9 * scale
    assert np.diff(energy).max() <= 1e-9 * scale
    # Row 0 of explicit layers is the energy at t = 0, half a layer earlier, with the exact one.
    rows = energy[1:] if method == "explicit" else energy
    if method != "massless":
        assert np.ptp(rows) <= 1e-9 * scale

    # Change of momentum = impulse of contact and gravity, in every layer; nothing pulls aside.
    dt = float(np.diff(history["time"].values[:2])[0])
    velocity = np.stack([history["body.vx"].values, history["body.vy"].values], axis=1)
    pull = np.array(tables["gravity"])
    weight = np.full(len(force) - 1, dt)
    if method == "explicit":  # velocities are those of the middles of layers
        weight[0] *= 0.5
    impulse = weight[:, None] * (force[1:].sum(axis=1)[:, None] * normal + mass * pull)
    wrong = mass * np.diff(velocity, axis=0) - impulse
    assert np.abs(wrong).max() <= 1e-10 * max(1.0, np.abs(impulse).max())


@pytest.mark.parametrize("sideways", [0.0, 10.0])
@pytest.mark.parametrize(("method", "duration", "steps", "left"), [
    ("conserving", 100.0, {"dt": 0.5}, []),
    ("massless", 1.0, {"dt": 0.005}, []),
    ("explicit", 0.01, {}, ["no_estimate"]),
])  # fmt: skip
def test_a_stiff_body_that_flies_slowly_stores_nothing(method, duration, steps, left, sideways):
    """Its way is large by what its speed would strain it: K loses that many digits of it."""
    body = {
        "kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.02,
        "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.0, 0.5]},
        "density": 7800.0, "youngs_modulus": 2.1e11, "poisson_ratio": 0.3, "strain": "small",
        "velocity": [sideways, -1e-3],
    }  # fmt: skip
    floor = {"kind": "half_space", "name": "floor", "point": [0, 0], "normal": [0, 1]}
    data = {
        "title": "flight", "duration": duration, "gravity": [0.0, 0.0], "body": [body],
        "obstacle": [floor], "solve": {"method": method} | steps, "output": {"fields": []},
    }  # fmt: skip
    result = impactfem.solve(impactfem.Scene.from_dict(data))
    slow = 0.5 * 78.0 * 1e-6  # kinetic energy of the fall [J/m]
    # Places are rounded, which strains: 1e-13 m of 1 km, where K is of order E.
    assert result.history["elastic_energy"].values.max() < 1e-7 * slow
    energy = result.history["total_energy"].values
    assert np.abs(energy - energy[0]).max() < 1e-11 * energy[0]
    codes = {finding["code"] for finding in result.summary["verdict"]["findings"]}
    assert codes <= {*left, "meets_nothing"}
