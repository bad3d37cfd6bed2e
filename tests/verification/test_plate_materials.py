"""Orthotropic, layered, tapered, stretched plates and elastic edges against closed forms."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from plate_cases import SQUARE, deflected, grid, plate_of, tones
from scipy.linalg import eigh

from impactfem import SceneError
from impactfem.scene.laminate import Ply, Section
from impactfem.system.plate_tones import frequencies

WOOD = {"e1": 10.0, "e2": 0.8, "nu12": 0.35, "g12": 0.6}
"""Moduli [Pa] of what is stiffer along its grain."""
BARE = {"youngs_modulus": None, "poisson_ratio": None}


def wood(angle=0.0, n=32, kind="simply_supported", **more):
    orthotropic = WOOD | {"angle": angle}
    mesh = grid(n, more.pop("shift", 0.0))
    return plate_of(SQUARE, 0.1, kind, mesh=mesh, orthotropic=orthotropic, **BARE | more)


def rigidities(section):
    d = section.bending
    return d[0, 0], d[1, 1], d[0, 1] + 2.0 * d[2, 2], np.abs(d[:2, 2]).max()


def navier(section, count=10):
    """Frequencies of the simply supported square, and its deflection amid it under p = 1."""
    one, two, mixed, aslant = rigidities(section)
    assert aslant < 1e-12 * one
    m, n = np.meshgrid(np.arange(1, 200), np.arange(1, 200))
    stiff = math.pi**4 * (one * m**4 + 2.0 * mixed * m**2 * n**2 + two * n**4)
    sign = np.sin(m * math.pi / 2.0) * np.sin(n * math.pi / 2.0)
    middle = float((16.0 / (math.pi**2 * m * n) * sign / stiff).sum())
    return np.sort(np.sqrt(stiff / section.mass).ravel())[:count], middle


@pytest.mark.parametrize("angle", [0.0, math.pi / 2])
def test_wood_bends_as_navier_says(angle):
    plate = wood(angle, shift=0.1)
    known, middle = navier(plate.plate.section)
    assert tones(plate, 10) == pytest.approx(known, rel=6e-3)
    w, points = deflected(plate)
    assert w[np.argmin(np.linalg.norm(points, axis=1))] == pytest.approx(middle, rel=4e-3)
    one, two = np.diag(plate.plate.section.bending)[:2]
    assert (one > two) == (angle == 0.0)


def ritz(bending, mass, degree=9):
    """Lowest frequencies of a clamped square by polynomials, whatever its bending stiffness."""
    shapes = [Polynomial([-0.25, 0.0, 1.0]) ** 2 * Polynomial.basis(k) for k in range(degree)]
    x, weight = np.polynomial.legendre.leggauss(24)
    x, weight = 0.5 * x, 0.5 * weight
    each = [np.array([p.deriv(k)(x) if k else p(x) for p in shapes]) for k in range(3)]

    def product(i, j):
        return np.einsum("aq,q,bq->ab", each[i], weight, each[j])

    along = {(i, j): product(i, j) for i in range(3) for j in range(3)}
    parts = [(2, 0, 1.0), (0, 2, 1.0), (1, 1, 2.0)]
    stiff = sum(
        bending[a, b] * ca * cb * np.kron(along[ix, jx], along[iy, jy])
        for a, (ix, iy, ca) in enumerate(parts)
        for b, (jx, jy, cb) in enumerate(parts)
    )
    return np.sqrt(eigh(stiff, mass * np.kron(along[0, 0], along[0, 0]), eigvals_only=True))


def test_wood_aslant_vibrates_as_ritz_says():
    plate = wood(math.pi / 6, kind="clamped")
    section = plate.plate.section
    known = ritz(section.bending, section.mass)[:6]
    assert tones(plate, 6) == pytest.approx(known, rel=8e-3)
    alike = np.array([[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 0.35]])
    assert ritz(alike, 1.0)[0] == pytest.approx(35.985, abs=1e-2)  # Leissa's, of one material
    coarse = tones(wood(math.pi / 6, n=16, kind="clamped"), 6)
    assert np.abs(coarse / known - 1.0).max() > 3.0 * np.abs(tones(plate, 6) / known - 1.0).max()


def cross_ply(n=32, **more):
    ply = {"thickness": 0.0025, "density": 100.0}
    layers = [ply | {"orthotropic": WOOD, "angle": a} for a in (0.0, math.pi / 2) * 2]
    layers[2:] = layers[1::-1]
    none = BARE | {"density": None, "thickness": None}
    return plate_of(SQUARE, 0.1, "simply_supported", mesh=grid(n), layers=layers, **none | more)


def test_cross_plies_vibrate_as_navier_says():
    plate = cross_ply()
    section = plate.plate.section
    assert section.thickness == pytest.approx(0.01)
    assert section.mass == pytest.approx(1.0)
    assert section.coupled < 1e-14
    known, _ = navier(section)
    assert tones(plate, 10) == pytest.approx(known, rel=6e-3)


def test_a_sandwich_shears_in_its_core():
    """Faces of t on a core of c: S = G d^2 / c, d = c + t; its frequencies with shear."""
    t, c, face, core = 1e-3, 0.1, 1e5, 1.0
    layers = [
        {"thickness": t, "density": 10.0, "youngs_modulus": face, "poisson_ratio": 0.3},
        {"thickness": c, "density": 0.1, "youngs_modulus": core, "poisson_ratio": 0.3},
        {"thickness": t, "density": 10.0, "youngs_modulus": face, "poisson_ratio": 0.3},
    ]
    none = BARE | {"density": None, "thickness": None}
    plate = plate_of(
        SQUARE, 0.1, "simply_supported", mesh=grid(32), shears=True, layers=layers, **none
    )
    section = plate.plate.section
    shear, bending = section.shear[0, 0], section.bending[0, 0]
    assert shear == pytest.approx(core / 2.6 * (c + t) ** 2 / c, rel=2e-3)
    assert bending == pytest.approx(face / 0.91 * t * (c + t) ** 2 / 2.0, rel=2e-3)
    k2 = math.pi**2 * np.array([2.0, 5.0, 5.0, 8.0])
    m, j = section.mass, section.turning
    half = 0.5 * (shear * k2 * j + m * (bending * k2 + shear))
    known = np.sqrt((half - np.sqrt(half**2 - m * j * shear * bending * k2**2)) / (m * j))
    assert frequencies(plate.stiffness, plate.weight, 4) == pytest.approx(known, rel=3e-3)
    assert known[0] < 0.7 * math.sqrt(bending / m) * k2[0]  # shear matters


def test_sections_are_those_of_their_parts():
    whole = Section.of([Ply.isotropic(0.3, 2.0, 7.0, 0.25)])
    halves = Section.of([Ply.isotropic(each, 2.0, 7.0, 0.25) for each in (0.1, 0.2)])
    for name in ("thickness", "mass", "turning", "bending", "shear", "faces"):
        assert getattr(whole, name) == pytest.approx(getattr(halves, name), rel=1e-12), name
    assert whole.shear == pytest.approx(5.0 / 6.0 * 2.8 * 0.3 * np.eye(2), rel=1e-12, abs=1e-14)
    # Two metals: as a beam of both about their neutral axis, exactly.
    a, b, one, two = 0.1, 0.25, 3.0, 1.0
    pair = Section.of([Ply.isotropic(a, 1.0, one, 0.3), Ply.isotropic(b, 4.0, two, 0.3)])
    neutral = (one * a * a / 2.0 + two * b * (a + b / 2.0)) / (one * a + two * b)
    stiff = one * (a**3 / 12.0 + a * (neutral - a / 2.0) ** 2)
    stiff += two * (b**3 / 12.0 + b * (neutral - a - b / 2.0) ** 2)
    assert pair.bending[0, 0] == pytest.approx(stiff / 0.91, rel=1e-12)
    assert pair.coupled < 1e-14
    # At the faces, one over its curvature: E' times the way from the neutral axis.
    assert pair.faces[0, 0, 0] == pytest.approx(-one / 0.91 * neutral, rel=1e-12)
    assert pair.faces[1, 0, 0] == pytest.approx(two / 0.91 * (a + b - neutral), rel=1e-12)
    plies = [Ply.of(0.1, 1.0, (10.0, 1.0), 0.3, (0.5,) * 3, angle) for angle in (0.0, 1.0)]
    assert Section.of(plies).coupled > 0.05


def strip(kind, edges=("left", "right"), **more):
    """A strip along x with nu = 0: a beam."""
    return plate_of(SQUARE, 0.1, kind, edges, mesh=grid(32), poisson_ratio=0.0, **more)


def test_a_strip_on_elastic_edges():
    k, turn = 30.0, 5.0
    springs = {"stiffness": k, "rotational_stiffness": turn}
    plate = strip(
        None, supports=[{"edge": e, "kind": "elastic"} | springs for e in ("left", "right")]
    )
    w, points = deflected(plate)
    moment = turn / (12.0 * (turn + 2.0))  # at the ends, D = L = p = 1
    known = 0.5 / k + 5.0 / 384.0 - moment / 8.0
    assert w[np.argmin(np.linalg.norm(points, axis=1))] == pytest.approx(known, rel=1e-3)
    ends = points[:, 0] > 0.5 - 1e-9
    assert w[ends] == pytest.approx(0.5 / k, rel=1e-3)


def test_a_tapered_cantilever_vibrates_as_ritz_says():
    """T = t0 (1 - s / 2): bending as its cube."""
    plate = strip("clamped", ("left",), thickness="0.01*(0.75-0.5*x)")
    base = plate.plate.section
    scale = base.thickness / 0.005  # of the corner, where x = 1/2
    assert scale == pytest.approx(1.0)
    x, weight = np.polynomial.legendre.leggauss(24)
    s, weight = 0.5 * (x + 1.0), 0.5 * weight
    depth = 2.0 - s  # by that of the end
    shapes = [Polynomial.basis(k + 2) for k in range(8)]
    bent = np.array([p.deriv(2)(s) for p in shapes])
    moved = np.array([p(s) for p in shapes])
    stiff = base.bending[0, 0] * np.einsum("aq,q,bq->ab", bent, weight * depth**3, bent)
    mass = base.mass * np.einsum("aq,q,bq->ab", moved, weight * depth, moved)
    known = np.sqrt(eigh(stiff, mass, eigvals_only=True))[:2]
    found = tones(plate, 12)
    for each in known:  # among those that twist
        assert np.abs(found / each - 1.0).min() < 4e-3


def test_tension_and_pressure_in_the_plate():
    """w^2 = (D k^4 + N k^2) / rho t; pressed it buckles at N = -2 pi^2 D / L^2."""
    k2 = math.pi**2 * np.array([2.0, 5.0, 5.0, 8.0])
    for force in (-15.0, 50.0, 1e5):
        plate = plate_of(
            SQUARE, 0.1, "simply_supported", mesh=grid(32), residual_stress=force / 0.01
        )
        known = np.sqrt(k2**2 + force * k2)
        assert tones(plate, 4) == pytest.approx(known, rel=6e-3)
    with pytest.raises(SceneError, match=r"residual_stress = -2000 Pa buckles it, as -197\d"):
        plate_of(SQUARE, 0.1, "simply_supported", mesh=grid(32), residual_stress=-20.0 / 0.01)
    with pytest.raises(SceneError, match="needs all edges held"):
        plate_of(SQUARE, 0.1, "clamped", ("left",), mesh=grid(4), residual_stress=1.0)


def test_a_thickness_that_is_none_is_refused():
    with pytest.raises(SceneError, match=r"thickness = '0.01\*y' is -0.005 at \(x, y\) ="):
        plate_of(SQUARE, 0.1, "clamped", mesh=grid(4), thickness="0.01*y")
    with pytest.raises(SceneError, match=r"up to 0.14 m, is more than 0\.1 of the"):
        plate_of(SQUARE, 0.1, "clamped", mesh=grid(4), thickness="0.09-0.1*y", theory="kirchhoff")
