"""Thin plates against closed forms: deflections, frequencies, rigid motions, curvatures."""

import math

import numpy as np
import pytest
from plate_cases import DISC, NU, SQUARE, deflected, grid, plate_of, tones
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve
from scipy.special import iv, jv

from impactfem.marching.plate_shown import von_mises
from impactfem.scene.laminate import Ply, Section
from impactfem.system.kirchhoff import Triangles
from impactfem.system.plate_tones import frequencies


@pytest.mark.parametrize(
    ("kind", "exact", "found"),
    [("clamped", 0.00126532, 0.0012678), ("simply_supported", 0.00406235, 0.0040599)],
)
def test_deflection_of_squares(kind, exact, found):
    """As measured of this element beforehand, to five digits; second order; distorted meshes."""

    def middle(n, shift=0.0):
        w, points = deflected(plate_of(SQUARE, 0.1, kind, mesh=grid(n, shift)))
        return w[np.argmin(np.linalg.norm(points, axis=1))]

    fine = middle(32)
    assert fine == pytest.approx(found, abs=6e-8)
    ratio = (middle(16) - exact) / (fine - exact)
    assert ratio == pytest.approx(4.0, abs=0.3)
    assert middle(32, 0.2) == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize(
    ("kind", "edge"), [("clamped", 0.0), ("simply_supported", 4.0 / 1.3), ("soft_support", 4 / 1.3)]
)
def test_deflection_of_discs(kind, edge):
    """W = q (1 - r^2) (1 + e - r^2) / 64 D, e = 4 / (1 + nu) where the rim may turn.

    A polygon whose sides each held both slopes would be clamped: off by 75 %.
    """
    w, points = deflected(plate_of(DISC, 0.05, kind, ("rim",)))
    r2 = (points**2).sum(axis=1)
    exact = (1.0 - r2) * (1.0 + edge - r2) / 64.0
    assert np.abs(w - exact).max() < 1.5e-3 * exact.max()


def test_stress_at_the_faces_of_a_clamped_disc():
    """M = q (1 + nu - k r^2) / 16, k = 3 + nu along the radius and 1 + 3 nu around."""
    plate = plate_of(DISC, 0.05, "clamped", ("rim",))
    forces = plate.basis[::3].T @ plate.pressure(0.0, 0.0)
    q, none = spsolve(plate.stiffness.tocsc(), forces), np.zeros((0, 3))
    found = von_mises(plate.stresses(q, none)).max(axis=0)
    r2 = (plate.mesh.points**2).sum(axis=1)
    radial, around = (((1 + NU) - k * r2) / 16.0 * 6.0 / 0.01**2 for k in (3 + NU, 1 + 3 * NU))
    exact = np.sqrt(radial**2 - radial * around + around**2)
    inner = r2 < 0.9
    assert np.abs(found - exact)[inner].max() < 0.01 * exact.max()
    assert np.abs(found - exact).max() < 0.1 * exact.max()  # means over triangles, short of the rim


def test_deflection_of_a_ring_and_a_polygon():
    """A ring clamped at its hole, free outside; a strip of any angle that bends as a beam."""
    ring = {"kind": "ring", "inner_radius": 0.4, "radius": 1.0}
    w, points = deflected(plate_of(ring, 0.05, "clamped", ("inner",)))
    r = np.linalg.norm(points, axis=1)
    # w = r^4 / 64 + A r^2 + B log r + C + E r^2 log r, with the shear force that the load makes.
    a, b, nu = 0.4, 1.0, NU
    shear = -(b**2) / 8.0  # E: Q = -d(lap w)/dr = -(q r / 2 + 4 E / r) = 0 at b

    def slopes(x):
        return np.array([2 * x, 1 / x]), x**3 / 16 + shear * x * (2 * math.log(x) + 1)

    def bends(x):
        given = 3 * x**2 / 16 + shear * (2 * math.log(x) + 3)
        parts, rest = slopes(x)
        return np.array([2.0, -1 / x**2]) + nu / x * parts, given + nu / x * rest

    (one, first), (two, second) = slopes(a), bends(b)
    big, small = np.linalg.solve(np.array([one, two]), -np.array([first, second]))

    def form(x):
        return x**4 / 64 + shear * x**2 * np.log(x) + big * x**2 + small * np.log(x)

    exact = form(r) - form(a)
    assert np.abs(w - exact).max() < 0.01 * np.abs(exact).max()
    cosine, sine = math.cos(0.3), math.sin(0.3)
    corners = np.array([[-0.5, -0.05], [0.5, -0.05], [0.5, 0.05], [-0.5, 0.05]])
    turned = corners @ np.array([[cosine, sine], [-sine, cosine]])
    polygon = {"kind": "polygon", "points": turned.tolist()}
    strip = plate_of(polygon, 0.02, "simply_supported", ("edge_2", "edge_4"), poisson_ratio=0.0)
    w, _ = deflected(strip)
    assert w.max() == pytest.approx(5.0 / 384.0, rel=2e-3)


def test_frequencies_of_a_square():
    """The first ten of pi^2 (m^2 + n^2), with and without mass where it touches."""
    pairs = sorted(m * m + n * n for m in range(1, 8) for n in range(1, 8))
    exact = math.pi**2 * np.array(pairs[:10])
    whole = plate_of(SQUARE, 1 / 32, "simply_supported")
    assert tones(whole, 10) == pytest.approx(exact, rel=3e-3)
    light = plate_of(SQUARE, 1 / 32, "simply_supported", touches=True)
    assert light.massless
    assert not whole.massless
    assert tones(light, 10) == pytest.approx(exact, rel=3e-3)
    # What touches gives its mass away, but for what goes to edges that are held.
    assert light.node_mass[light.touch].max() == 0.0
    assert not light.mesh.neighbours[light.touch][:, light.touch].nnz


THICK = {
    "clamped": {0.1: 0.00150463, 0.01: 0.00126785, 1e-3: 0.00126535, 1e-4: 0.00126532},
    "simply_supported": {0.1: 0.00427284, 0.01: 0.00406446, 1e-3: 0.00406237, 1e-4: 0.00406235},
}
"""Deflections of Reissner-Mindlin squares by thickness, shear factor 5/6 [p L^4 / D]."""


def shear_of(t):
    return t**2 / (6.0 * 5.0 / 6.0 * (1.0 - NU))


@pytest.mark.parametrize("shift", [0.0, 0.2])
@pytest.mark.parametrize("kind", THICK)
def test_thick_squares_do_not_lock(kind, shift):
    for t, exact in THICK[kind].items():

        def middle(n, t=t):
            mesh = grid(n, shift)
            w, points = deflected(plate_of(SQUARE, 0.1, kind, mesh=mesh, shears=True, thickness=t))
            return w[np.argmin(np.linalg.norm(points, axis=1))]

        coarse, fine = (abs(middle(n) / exact - 1.0) for n in (16, 32))
        assert fine < 2.2e-3
        assert math.log2(coarse / fine) > 1.75


def test_a_thick_clamped_disc():
    """w = p R^4 / (64 D) + p R^2 / (4 kappa G t)."""
    t = 0.2
    w, points = deflected(plate_of(DISC, 0.05, "clamped", ("rim",), shears=True, thickness=t))
    exact = 1.0 / 64.0 + 0.25 * shear_of(t)
    middle = int(np.argmin(np.linalg.norm(points, axis=1)))
    r = float(np.linalg.norm(points[middle]))
    exact = (1.0 - r**2) ** 2 / 64.0 + 0.25 * shear_of(t) * (1.0 - r**2)
    assert w[middle] == pytest.approx(exact, rel=3e-3)


def test_frequencies_of_a_thick_square():
    """(S k^2 - m w^2) (D k^2 + S - J w^2) = S^2 k^2 with the rotary inertia J, S = kappa G t."""
    t = 0.1
    plate = plate_of(SQUARE, 1 / 32, "simply_supported", shears=True, thickness=t)
    squares = math.pi**2 * np.array(
        sorted(m * m + n * n for m in range(1, 8) for n in range(1, 8))[:10]
    )
    s, j = 1.0 / shear_of(t), t**2 / 12.0  # rho t = D = 1
    half = 0.5 * (j * s * squares + squares + s)
    exact = np.sqrt((half - np.sqrt(half**2 - j * s * squares**2)) / j)
    known = frequencies(plate.stiffness, plate.weight, 10)
    assert known == pytest.approx(exact, rel=3e-3)


def test_frequencies_of_a_free_disc():
    """Three rigid motions, then those of the Bessel functions J and I with free edges."""
    nu = NU

    def determinant(k, n):
        rows = []
        for f, sign in ((jv, -1.0), (iv, 1.0)):
            value = f(n, k)
            slope = k * (0.5 * (f(n - 1, k) + math.copysign(1.0, sign) * f(n + 1, k)))
            curve = sign * k**2 * value - slope + n**2 * value  # r^2 f''
            moment = curve + nu * (slope - n**2 * value)
            shear = sign * k**2 * slope - (1.0 - nu) * n**2 * (slope - value)
            rows.append((moment, shear))
        return rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]

    roots = []
    for n in range(4):
        ks = np.linspace(1.5, 4.7, 400)
        values = [determinant(k, n) for k in ks]
        for a, b, one, two in zip(ks, ks[1:], values, values[1:], strict=False):
            if one * two < 0.0:
                roots += [brentq(determinant, a, b, args=(n,)) ** 2] * (1 if n == 0 else 2)
    exact = np.sort(roots)[:7]
    assert (exact[0], exact[2]) == pytest.approx((5.3583, 9.0031), abs=1e-4)  # as tables have them
    found = tones(plate_of(DISC, 0.05), 10)
    assert found[:3] == pytest.approx(0.0, abs=1e-3)
    assert found[3:] == pytest.approx(exact, rel=4e-3)


def test_constant_curvature_and_rigid_motions_are_exact():
    """The patch test of plates, on an irregular mesh."""
    mesh = plate_of(DISC, 0.3).mesh
    section = Section.of([Ply.isotropic(1.0, 1.0, 24.0 * (1.0 - NU**2), NU)])
    triangles = Triangles(mesh, section, np.ones(len(mesh.cells)))
    stiffness = triangles.stiffness
    values = np.linalg.eigvalsh(stiffness.toarray())
    assert np.count_nonzero(values < 1e-10 * values[-1]) == 3
    (x, y), (a, b, c) = mesh.points.T, (0.7, -0.4, 0.3)
    field = np.stack([a * x**2 + b * x * y + c * y**2, 2 * a * x + b * y, b * x + 2 * c * y], 1)
    density = (1 - NU) * (4 * a**2 + 2 * b**2 + 4 * c**2) + NU * (2 * a + 2 * c) ** 2
    bent = (triangles.curvatures @ field.ravel()).reshape(-1, 3)
    assert bent == pytest.approx(np.tile([2 * a, 2 * c, 2 * b], (len(x), 1)), abs=1e-10)
    energy = field.ravel() @ (stiffness @ field.ravel())
    assert energy == pytest.approx(2.0 * density * mesh.areas.sum(), rel=1e-12)
