"""The search for equilibrium asks bodies for residuals and tangents alone: any law may join."""

import numpy as np
import pytest

from impactfem.contact.complementarity import solve_by_active_set
from impactfem.contact.responses import Responses
from impactfem.errors import ConvergenceError
from impactfem.fem import MPI
from impactfem.marching.pressing import Pressing
from impactfem.marching.static_start import StaticStart


class Modes:
    """Of a body that springs hold."""

    def along(self, _):
        return np.zeros(0)

    def forces(self, _):
        return np.zeros(2)

    def moved(self, _):
        return np.zeros(0)

    def of_displacement(self, _):
        return np.zeros(2)


class Barrier:
    """A node on a stiffening spring along x, and along y one that cannot be squeezed to nothing.

    Forces 10 x + 500 x^3 and log(1 + y) / (1 + y).
    """

    name, modes, patience = "node", Modes(), 0

    def __init__(self, load):
        self.start, self.load, self.looks = np.zeros(2), np.array(load), 0

    def contact(self, place):
        return place[None]

    def moved(self, _, change):
        return change[None]

    def pulled(self, forces, _):
        return forces[0]

    def residual(self, place):
        self.looks += 1
        x, y = place
        if y <= -1.0:
            return np.full(2, np.nan)
        return self.load - [10.0 * x + 500.0 * x**3, np.log1p(y) / (1.0 + y)]

    def steady(self):
        return False

    def tangent(self, place):
        x, y = place
        stiff = np.array([10.0 + 1500.0 * x**2, max((1.0 - np.log1p(y)) / (1.0 + y) ** 2, 0.1)])
        return lambda forces: forces / stiff


class Floor:
    """One gap: the node stays above a parabola y >= low + x^2, with its normal where it is."""

    pairs = ("node.floor",)

    def __init__(self, low):
        self.low = low

    def at(self, displacement, *_):
        x, y = displacement[0]
        slope = np.array([-2.0 * x, 1.0]) / np.hypot(1.0, 2.0 * x)
        return np.array([(y - self.low - x**2) * slope[1]]), slope[None]

    def relative(self, values):
        return values

    def spread(self, forces):
        return forces

    def responses(self, columns, whole):
        return Responses(1, 2, None, columns, whole)


def find(load, low=-100.0):
    solver = solve_by_active_set(1e-13, 50)
    body = Barrier(load)
    return StaticStart(
        MPI.COMM_SELF, [body], [slice(0, 1)], Floor(low), Pressing(solver, 1e-13)
    ).find()


def test_a_nonlinear_body_comes_to_rest():
    rest = find([9.0, 0.0])
    ((x, y),) = rest.places
    assert 10.0 * x + 500.0 * x**3 == pytest.approx(9.0, rel=1e-11)
    assert y == pytest.approx(0.0, abs=1e-12)
    assert rest.iterations[0] <= 9  # as Newton's method does
    assert rest.residual < 1e-12


def test_steps_that_leave_no_body_are_halved():
    ((_, y),) = find([0.0, -5.0]).places
    assert np.log1p(y) / (1.0 + y) == pytest.approx(-5.0, rel=1e-11)


def test_a_nonlinear_body_lies_on_a_curved_floor():
    rest = find([3.0, -5.0], low=-0.3)
    ((x, y),) = rest.places
    assert y == pytest.approx(-0.3 + x**2, abs=1e-11)
    normal = np.array([-2.0 * x, 1.0]) / np.hypot(1.0, 2.0 * x)
    inner = np.array([10.0 * x + 500.0 * x**3, np.log1p(y) / (1.0 + y)])
    np.testing.assert_allclose(rest.multiplier[0] * normal + [3.0, -5.0], inner, rtol=1e-9)
    assert rest.multiplier[0] > 0.0


def test_what_has_no_equilibrium_is_told():
    with pytest.raises(ConvergenceError, match="no equilibrium was found in 80 passes"):
        find([0.0, 1.0])  # the spring gives way from 1 / e on
