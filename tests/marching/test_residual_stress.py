"""Solids with residual stress, held to closed forms."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart
from scipy.optimize import least_squares

from impactfem import Scene, solve
from impactfem.errors import SceneError

DENSITY, MODULUS, PULL = 1000.0, 1e9, 1e6


def strip(size, mesh_size, stress, **more):
    return {
        "kind": "solid", "name": "strip", "model": "plane_stress", "cells": "hexahedron",
        "shape": {"kind": "block", "size": size, "corner": [0.0, 0.0]}, "mesh_size": mesh_size,
        "density": DENSITY, "youngs_modulus": MODULUS, "poisson_ratio": 0.0,
        "residual_stress": stress,
    } | more  # fmt: skip


def scene(body, duration, dt, **more):
    return Scene.from_dict(
        {
            "title": "residual", "duration": duration, "body": [body], "gravity": [0.0, 0.0],
            "solve": {"dt": dt, "estimate": False, "method": "conserving"},
            "output": {"fields": [], "checkpoint": 4},
        } | more
    )  # fmt: skip


def probe(x, y, *quantities):
    return {"name": "p", "body": "strip", "point": [x, y], "quantities": list(quantities)}


def drift(values):
    return np.abs(values - values[0]).max()


def test_held_strip_swings_as_a_string():
    length, height = 0.2, 5e-4
    held = [{"surface": side, "kind": "fixed"} for side in ("left", "right")]
    speed = ["0", f"0.1*sin(pi*x/{length})"]
    body = strip([length, height], 0.0025, [PULL, 0, 0], supports=held, degree=2, velocity=speed)
    # Clamped, with little bending: N. H. Fletcher, J. Acoust. Soc. Am. 36 (1964) 203-209.
    bent = np.sqrt(MODULUS * height**2 / 12.0 / (PULL * length**2))
    rate = np.pi / length * np.sqrt(PULL / DENSITY)
    rate *= 1.0 + 2.0 * bent + (4.0 + 0.5 * np.pi**2) * bent**2
    period = 2.0 * np.pi / rate
    middle = probe(length / 2, height / 2, "displacement", "stress")
    history = solve(scene(body, 2 * period, period / 100, probe=[middle])).history
    time, y = history["time"].values, history["p.uy"].values

    def misfit(p):
        return p[0] * np.sin(p[1] * time) - y

    found = least_squares(misfit, [np.abs(y).max(), rate], x_scale=[np.abs(y).max(), rate])
    slow = (rate * period / 100) ** 2 / 12.0  # of the midpoint rule
    assert found.x[1] * (1.0 + slow) == pytest.approx(rate, rel=1e-3)
    # Its energy is what is left of terms (length / height) and modulus / pull times as large.
    assert drift(history["total_energy"].values) < 1e-7 * history["kinetic_energy"].values[0]
    assert history["p.sxx"].values[0] == PULL


def test_released_bar_sends_a_wave():
    body = strip([1.0, 0.05], 0.05, [PULL, 0, 0], supports=[{"surface": "left", "kind": "fixed"}])
    speed = np.sqrt(MODULUS / DENSITY)
    transit = 1.0 / speed
    end = probe(1.0, 0.025, "displacement")
    history = solve(scene(body, 4 * transit, transit / 40, probe=[end])).history
    time, moved = history["time"].values, history["p.ux"].values
    # A free end draws back with s / (rho c) until the wave has been to the support and back.
    back = PULL / (DENSITY * speed)
    want = -back * np.where(time < 2 * transit, time, 4 * transit - time)
    assert np.abs(moved - want).max() < 0.03 * back * 2 * transit
    assert drift(history["total_energy"].values) < 1e-10 * history["kinetic_energy"].values.max()


def test_free_strip_keeps_what_is_in_equilibrium():
    # Neither force nor moment: away from its ends the stress stays as it is.
    parabola = "1e6*(1 - 12*((y - 0.05)/0.1)**2)"
    body = strip([0.8, 0.1], 0.025, [parabola, 0, 0], degree=2)
    middle = probe(0.4, 0.09, "stress", "displacement")
    history = solve(scene(body, 2e-4, 1e-4, start="static", probe=[middle])).history
    want = 1e6 * (1.0 - 12.0 * 0.4**2)
    np.testing.assert_allclose(history["p.sxx"].values, want, rtol=2e-2)
    assert history["kinetic_energy"].values.max() < 1e-20
    released = solve(scene(body, 2e-4, 1e-4)).history
    assert released["kinetic_energy"].values.max() > 1.0


@pytest.mark.parallel([1, 2])
def test_restart_equals_the_whole_run(tmp_path, monkeypatch):
    body = strip([1.0, 0.1], 0.05, [PULL, 0, "1e5*x"])
    check_restart(scene(body, 2e-4, 1e-5), 11, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_ranks_agree(monkeypatch):
    body = strip([1.0, 0.1], 0.05, [PULL, 0, "1e5*x"])
    check_ranks(lambda: scene(body, 2e-4, 1e-5), monkeypatch)


@pytest.mark.parametrize(
    ("stress", "more", "words"),
    [
        ([PULL], {}, r"residual_stress"),
        ([PULL] * 6, {}, "has 6 entries: give sxx, syy, sxy"),
        ([PULL, 0, 0], {"strain": "finite"}, "strain: residual_stress is known"),
        ([PULL, 0, 0], {"model": "axisymmetric"}, "axisymmetric bodies take none"),
        ([PULL, 0, "log(x - 1)"], {}, "no finite value"),
    ],
)
def test_bad_stresses_are_refused(stress, more, words):
    with pytest.raises(SceneError, match=words):
        solve(scene(strip([0.1, 0.1], 0.05, stress, **more), 1e-4, 1e-4))
