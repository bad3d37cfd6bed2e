"""Plates whose middle stretches as they bend (von Karman) against independent computations."""

import math

import numpy as np
import pytest
from plate_cases import DISC, NU, SQUARE, grid, plate_of, tones
from scipy.integrate import quad, solve_bvp
from scipy.optimize import brentq
from scipy.special import ellipk, iv, jv

from impactfem.marching.plate_newton import PlateNewton
from impactfem.scene import PiecewiseVector

T = 0.01
STRETCHING = 12.0 / T**2
"""E t / (1 - nu^2) with D = 1."""
NEAR = 1e-3  # of the middle, where the equations of a disc are singular


def marched(plate, dt=0.01):
    still = PiecewiseVector(times=(0.0,), values=((0.0, 0.0, 0.0),))
    return PlateNewton(plate, still, dt, counts=True)


def at_rest(plate):
    rest = marched(plate).at_rest()
    q = rest.start.copy()
    for _ in range(20):
        change = rest.tangent(q)(rest.residual(q))
        q = q + change
        if np.abs(change).max() < 1e-12 * np.abs(q).max():
            return q
    raise AssertionError("no equilibrium")


def strains(plate, q):
    return plate.membrane.settled(plate.membrane.slopes(plate.deflection(q)))[0]


def stretched_disc(load):
    """A clamped disc under a pressure by its ordinary differential equations.

    D L w' = q r / 2 + N w', (r N)' = N_t with L = d2 + d1/r - 1/r^2; w, w', w'', u, N by r.
    """

    def rates(r, y):
        _, slope, bend, u, force = y
        strain = force / STRETCHING - NU * u / r
        around = STRETCHING * (u / r + NU * strain)
        return np.array(
            [slope, bend, load * r / 2 + force * slope - bend / r + slope / r**2,
             strain - slope**2 / 2, (around - force) / r]
        )  # fmt: skip

    def ends(a, b):
        near = a[3] - NEAR * a[4] / STRETCHING / (1 + NU)
        return np.array([a[1] - NEAR * a[2], near, b[0], b[1], b[3]])

    r = np.linspace(NEAR, 1.0, 200)
    guess = np.zeros((5, 200))
    guess[0], guess[1] = load / 640 * (1 - r**2) ** 2, -load / 160 * r * (1 - r**2)
    found = solve_bvp(rates, ends, r, guess, tol=1e-6, max_nodes=20_000)
    assert found.status == 0
    return found.sol


@pytest.mark.parametrize("load", [0.64, 10.0])
def test_deflection_and_stress_of_a_clamped_disc(load):
    """Deflections of .76 and 2.8 thicknesses; the linear plate has 1 and 15.6."""
    plate = plate_of(DISC, 0.07, "clamped", ("rim",), membrane="von_karman",
                     pressures=[{"face": "bottom", "value": load}])  # fmt: skip
    q, exact = at_rest(plate), stretched_disc(load)
    r = np.maximum(np.linalg.norm(plate.mesh.points, axis=1), NEAR)
    w, _, bend, _, force = exact(r)
    assert np.abs(plate.deflection(q) - w).max() < 6e-3 * w.max()
    # At the middle stresses are alike in all directions: N / t -+ 6 M / t^2, M = (1 + nu) w''.
    at = np.argmin(r)
    bottom, top = plate.stresses(q, strains(plate, q))[:, at, :2].mean(axis=1)
    bending = (1 + NU) * bend[at] * 6.0 / T**2
    assert 0.5 * (bottom + top) == pytest.approx(force[at] / T, rel=0.02)
    assert 0.5 * (bottom - top) == pytest.approx(bending, rel=0.02)


def test_frequency_hardens_as_a_clamped_disc_does():
    """At a deflection of its thickness the first frequency is 1.16 times that of small ones.

    A single mode gives 1.171 with the shape of small vibrations, which is too stiff; the first term
    of its Fourier series 1.173.
    """
    k = brentq(lambda x: jv(0, x) * iv(1, x) + iv(0, x) * jv(1, x), 3.0, 3.4)
    share = jv(0, k) / iv(0, k)

    def mode(r):
        return (jv(0, k * r) - share * iv(0, k * r)) / (1.0 - share)

    def slope(r):
        return -k * (jv(1, k * r) + share * iv(1, k * r)) / (1.0 - share)

    def bend(r):
        return (slope(r + 1e-6) - slope(r - 1e-6)) / 2e-6

    def rates(r, y):
        given = slope(r) * bend(r) + (1 - NU) / (2 * r) * slope(r) ** 2
        return np.array([y[1], y[0] / r**2 - y[1] / r - given])

    r = np.linspace(NEAR, 1.0, 200)
    plane = solve_bvp(rates, lambda a, b: np.array([a[0], b[0]]), r, np.zeros((2, 200)), tol=1e-6)

    def energy(x):
        u, du = plane.sol(x)
        e, g = du + slope(x) ** 2 / 2, u / x
        return 0.5 * STRETCHING * (e * e + g * g + 2 * NU * e * g) * x

    weight = quad(lambda x: mode(x) ** 2 * x, 0.0, 1.0)[0]
    hardening = 4.0 * quad(energy, NEAR, 1.0)[0] * T**2 / (weight * k**4)
    ritz = math.pi * math.sqrt(1 + hardening) / (2 * ellipk(hardening / (2 * (1 + hardening))))
    assert ritz == pytest.approx(1.171, abs=1e-3)

    plate = plate_of(DISC, 0.1, "clamped", ("rim",), membrane="von_karman", pressures=[])
    first = tones(plate, 1)[0]
    found = [frequency(plate, share, mode, first) / first for share in (0.02, 1.0)]
    assert found[0] == pytest.approx(1.0, abs=5e-4)
    assert 0.99 * ritz < found[1] / found[0] < ritz


def frequency(plate, share, mode, first):
    """Of a vibration from rest in a shape, by the zeros of the deflection amid it."""
    steps = 200
    march = marched(plate, 2 * math.pi / first / steps)
    radius = np.linalg.norm(plate.mesh.points, axis=1)
    q = np.asarray(plate.basis[::3].T @ (share * T * mode(radius)))
    march._settle_slopes(q)
    march._q = q
    none = np.zeros((len(plate.touch), 3))
    at, seen = np.argmin(radius), []
    for layer in range(int(1.7 * steps)):
        march.begin(layer * march.dt, (layer + 1) * march.dt)
        while march.unbalanced(none) > 1.0:
            march.linearise()
            march.correct(none)
        march.accept()
        seen.append(plate.deflection(march._q)[at])
    w = np.array(seen)
    before = np.flatnonzero(w[:-1] * w[1:] < 0.0)
    zeros = before + w[before] / (w[before] - w[before + 1])
    return math.pi * (len(zeros) - 1) / ((zeros[-1] - zeros[0]) * march.dt)


def test_tension_is_the_derivative_of_the_energy():
    """Forces by differences of the energy; turned in its plane it is the same; laminates."""
    plate = plate_of(SQUARE, 0.2, "clamped", membrane="von_karman", mesh=grid(6, 0.2))
    rest = marched(plate).at_rest()
    rng = np.random.default_rng(3)
    q, way = (rng.normal(size=len(plate.position)) * T for _ in range(2))
    loads = rest.residual(np.zeros_like(q))
    force = (loads - rest.residual(q)) @ way
    more, less = (plate.elastic(p, strains(plate, p)) for p in (q + 1e-6 * way, q - 1e-6 * way))
    by_energy = (more - less) / 2e-6
    assert force == pytest.approx(by_energy, rel=1e-7)
    moved = rest.residual(q) - rest.residual(q + 1e-6 * way)
    assert rest.tangent(q)(moved) == pytest.approx(1e-6 * way, abs=1e-3 * 1e-6 * np.abs(way).max())


def test_a_strip_whose_ends_slide_does_not_stretch():
    """Bent into a cylinder, free in its plane: as the linear one. Held it is far stiffer."""
    strip = {"kind": "rectangle", "size": [1.0, 0.2]}

    def middle(in_plane, **more):
        plate = plate_of(
            strip, 0.05, poisson_ratio=0.0,
            supports=[{"edge": edge, "kind": "simply_supported"} | in_plane
                      for edge in ("left", "right")], **more,
        )  # fmt: skip
        return np.abs(plate.deflection(at_rest(plate))).max()

    linear = middle({})
    free = middle({"in_plane": "free"}, membrane="von_karman")
    held = middle({}, membrane="von_karman")
    assert free == pytest.approx(linear, rel=0.02)
    # Of a strip N = E t / L int w'^2 / 2 and a half wave: x + x^3 / 4 (a / r)^2, r^2 = t^2 / 12.
    x = brentq(lambda x: x + 0.25 * 12.0 * (linear / T) ** 2 * x**3 - 1.0, 0.0, 1.0)
    assert held == pytest.approx(x * linear, rel=0.03)
