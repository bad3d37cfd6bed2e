"""A beam that bends far under finite strain, against Euler's elastica."""

import numpy as np
import pytest
from scipy.integrate import solve_bvp

import impactfem

THICK = 0.02  # of a beam of length 1
STIFFNESS = 1e6 * THICK**3 / 12.0  # E I, nu = 0


def elastica(load, push):
    """Drop and shortening of a cantilever's end, lengths by L, forces by E I / L^2.

    Args:
        load: Force down on the middle of its end.
        push: Of a plane, up on the lower edge of it, which lies behind by half the thickness times
            the sine of the end's angle.
    """
    net = load - push

    def slopes(_, state):  # angle, x, drop, curvature
        return np.stack([state[3], np.cos(state[0]), np.sin(state[0]), -net * np.cos(state[0])])

    def ends(first, last):
        return np.array([*first[:3], last[3] - 0.5 * THICK * push * np.sin(last[0])])

    s = np.linspace(0.0, 1.0, 50)
    guess = np.stack([0.5 * s, s, 0.25 * s, net * (1.0 - s)])
    found = solve_bvp(slopes, ends, s, guess, tol=1e-8)
    assert found.success
    return found.y[2, -1], 1.0 - found.y[1, -1]


def bent(load, floor):
    """The same by quadrilaterals of degree 2, two across; and the force of the plane."""
    beam = {
        "name": "beam", "kind": "solid", "model": "plane_strain", "material": "neo_hookean",
        "cells": "hexahedron", "degree": 2, "mesh_size": 0.5 * THICK, "density": 1000.0,
        "youngs_modulus": 1e6, "poisson_ratio": 0.0, "contact_surfaces": ["right"],
        "shape": {"kind": "block", "size": [1.0, THICK], "corner": [0.0, -0.5 * THICK]},
        "supports": [{"surface": "left", "kind": "fixed"}],
        "tractions": [{"surface": "right", "value": [0.0, -load * STIFFNESS / THICK]}],
    }  # fmt: skip
    result = impactfem.solve(
        impactfem.Scene.from_dict(
            {
                "title": "elastica", "duration": 1e-3, "body": [beam], "start": "static",
                "obstacle": [{"kind": "half_space", "point": [0.0, -floor], "normal": [0.0, 1.0]}],
                "probe": [{"name": "end", "body": "beam", "point": [1.0, 0.0],
                           "quantities": ["displacement"]}],
                "solve": {"dt": 1e-3, "estimate": False}, "output": {"fields": []},
            }
        )
    )  # fmt: skip
    drop, short = (-result.history[f"end.{name}"].values[0] for name in ("uy", "ux"))
    return drop, short, result.history["contact_force"].values[0] / STIFFNESS


def test_the_reference_is_that_of_the_tables():
    assert elastica(2.0, 0.0) == pytest.approx((0.49345748, 0.16064172), abs=1e-7)


@pytest.mark.parametrize(("load", "floor"), [(2.0, 9.0), (5.0, 0.5)])
def test_a_beam_that_bends_far_is_the_elastica(load, floor):
    """To .1 %, of which most is its thickness: a quarter remains at half of it."""
    drop, short, push = bent(load, floor)
    assert (push > 0.0) == (floor < 1.0)
    assert (drop, short) == pytest.approx(elastica(load, push), rel=5e-4)
