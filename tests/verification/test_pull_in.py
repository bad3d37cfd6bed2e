"""Plates that are pulled by what grows as the gap closes, as by a voltage."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.optimize import fsolve

import impactfem
from impactfem import Scene, SceneError

STOP = 0.8  # of the gap, where the plate is caught


def ritz_pull_in(count=5):
    """Largest L for which a clamped disc has D w'''' = L / (1 - w)^2, radius and gap 1."""
    x, weight = np.polynomial.legendre.leggauss(40)
    r, weight = 0.5 * (x + 1.0), 0.5 * weight
    rim = Polynomial([1.0, 0.0, -1.0]) ** 2
    shapes = [rim * Polynomial.basis(2 * k) for k in range(count)]
    moved = np.array([p(r) for p in shapes])
    bent = np.array([p.deriv(2)(r) + p.deriv()(r) / r for p in shapes])
    stiff = np.einsum("aq,q,bq->ab", bent, weight * r, bent)
    pulls, guess = [], np.zeros(count + 1)
    for middle in np.linspace(0.02, 0.7, 35):

        def left(each, middle=middle):
            w = each[:-1] @ moved
            load = each[-1] * (moved * (weight * r)) @ (1.0 - w) ** -2.0
            return np.append(stiff @ each[:-1] - load, each[0] - middle)

        guess = fsolve(left, guess)
        pulls.append(guess[-1])
    return max(pulls)


def disc(pull, **more):
    """With D = rho t = R = 1 and a gap of 1e-3 to where pressures would be infinite."""
    t, d = 0.01, 1e-3
    value = f"{pull * d**3}/({(1.0 - STOP) * d}+gap)**2"
    body = {
        "kind": "plate", "outline": {"kind": "disc", "radius": 1.0}, "mesh_size": 0.17,
        "thickness": t, "density": 1.0 / t, "youngs_modulus": 12.0 * 0.91 / t**3,
        "poisson_ratio": 0.3, "supports": [{"edge": "rim", "kind": "clamped"}],
        "pressures": [{"face": "bottom", "value": f"-{value}"}],
    }  # fmt: skip
    stop = {"kind": "half_space", "name": "stop", "point": [0, 0, -0.5 * t - STOP * d],
            "normal": [0, 0, 1]}  # fmt: skip
    return Scene.from_dict(
        {"title": "pull", "gravity": [0.0, 0.0, 0.0], "body": [body], "obstacle": [stop],
         "solve": {"estimate": False, "dt": 0.03}, "output": {"fields": []},
         "probe": [{"name": "middle", "body": "plate", "point": [0.0, 0.0, 0.0]}]} | more
    )  # fmt: skip


@pytest.mark.parametrize(("share", "closes"), [(0.97, False), (1.03, True)])
def test_a_disc_is_pulled_in_as_ritz_says(share, closes):
    """Damped so that it creeps: it comes to rest short of the known pull, and falls beyond it."""
    made = disc(share * ritz_pull_in(), duration=40.0)
    table = made.to_dict()
    table["body"][0]["rayleigh_mass"] = 30.0
    run = impactfem.solve(Scene.from_dict(table))
    force, middle = run.history["contact_force"].values, run.history["middle.uz"].values
    assert (force.max() > 0.0) == closes
    if not closes:
        assert -0.6e-3 < middle[-1] < -0.3e-3
        assert abs(middle[-1] - middle[-100]) < 1e-6


def test_gaps_are_taken_amid_the_step():
    """So motions, here without damping, are right to second order of the step."""
    ends = []
    for dt in (0.004, 0.002, 0.0005):
        made = disc(7.0, duration=0.6, solve={"estimate": False, "dt": dt})
        w = impactfem.solve(made).history["middle.uz"].values
        ends.append(w[-1])
        assert -0.7e-3 < w.min() < -0.15e-3
    one, two = (abs(each - ends[2]) for each in ends[:2])
    assert one < 1e-6
    assert one > 3.0 * two


def test_a_face_that_sees_nothing_is_refused():
    table = disc(1.0, duration=0.1).to_dict()
    table["body"][0]["pressures"][0]["face"] = "top"
    with pytest.raises(SceneError, match="this face sees no obstacle"):
        impactfem.solve(Scene.from_dict(table))
