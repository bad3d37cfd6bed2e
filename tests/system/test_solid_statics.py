"""Bodies in equilibrium against closed forms and published values."""

import numpy as np
import pytest
from solids import at, equilibrium, system, to_scipy

E, NU = 10.0, 0.3
INNER, OUTER, PRESSURE = 1.0, 2.0, 3.0


def quarter(s):
    """A quarter of a ring."""
    radius, angle = INNER + (OUTER - INNER) * s[:, 0], 0.5 * np.pi * s[:, 1]
    x = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return np.where(np.abs(x) < 1e-12, 0.0, x)


def lame(radius, nu):
    """Radial displacement of a tube in plane strain under inner pressure (S. Timoshenko)."""
    a, b = INNER, OUTER
    factor = (1 + nu) / E * PRESSURE * a**2 / (b**2 - a**2)
    return factor * ((1 - 2 * nu) * radius + b**2 / radius)


PUSHED = [{"surface": "s0-", "value": PRESSURE}]


def tube_error(cell, degree, n, *, nu=NU, axisymmetric=False):
    if axisymmetric:
        body = system(
            cell, degree, (n, n), lambda s: np.add(s, [INNER, 0.0]), model="axisymmetric",
            poisson_ratio=nu, pressures=PUSHED,
            supports=[{"surface": f"s1{side}", "kind": "symmetry"} for side in "-+"],
        )  # fmt: skip
        radius = body.positions[:, 0]
        exact = np.stack([lame(radius, nu), 0.0 * radius], axis=1)
    else:
        body = system(
            cell, degree, (n, n), quarter, poisson_ratio=nu, pressures=PUSHED,
            supports=[{"surface": f"s1{side}", "kind": "symmetry"} for side in "-+"],
        )  # fmt: skip
        radius = np.linalg.norm(body.positions, axis=1)
        exact = body.positions * (lame(radius, nu) / radius)[:, None]
    # Root mean square: the largest error has a factor |log h| for linear triangles.
    return np.linalg.norm(equilibrium(body) - exact) / np.linalg.norm(exact)


@pytest.mark.parametrize("axisymmetric", [False, True])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
@pytest.mark.parametrize("degree", [1, 2])
def test_tube_under_pressure_converges_to_lame(cell, degree, axisymmetric):
    n = 8 if degree == 1 else 4
    coarse, fine = (tube_error(cell, degree, k, axisymmetric=axisymmetric) for k in (n, 2 * n))
    assert np.log2(coarse / fine) >= (1.9 if degree == 1 else 3.3)
    assert fine <= (1e-2 if degree == 1 else 3e-4)


@pytest.mark.parametrize("axisymmetric", [False, True])
@pytest.mark.parametrize(
    ("cell", "degree"), [("quadrilateral", 1), ("quadrilateral", 2), ("triangle", 2)]
)
def test_tube_does_not_lock_when_nearly_incompressible(cell, degree, axisymmetric):
    ordinary = tube_error(cell, degree, 8, axisymmetric=axisymmetric)
    tight = tube_error(cell, degree, 8, nu=0.4999, axisymmetric=axisymmetric)
    assert tight <= max(10 * ordinary, 2e-2 if degree == 1 else 5e-3)


def cantilever_tip(cell, length):
    """Tip of a cantilever of depth 1 over that of Timoshenko's beam."""
    force = 1e-3
    body = system(
        cell, 2, (4 * int(length), 4), lambda s: s * [length, 1.0], model="plane_stress",
        youngs_modulus=1.0, supports=[{"surface": "s0-", "kind": "fixed"}],
        tractions=[{"surface": "s0+", "value": [0, f"-6*{force}*y*(1 - y)"]}],
    )  # fmt: skip
    tip = equilibrium(body)[at(body, (length, 0.5)), 1]
    bending, shear = force * length**3 / (3 / 12), 1.2 * force * length * 2 * (1 + NU)
    return -tip / (bending + shear)


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_cantilever_of_degree_two_bends_as_a_beam(cell):
    short, long = 1 - cantilever_tip(cell, 10.0), 1 - cantilever_tip(cell, 20.0)
    # The clamp stops the contraction across, which stiffens a piece of the order of the depth:
    # less than 1 % of the depth is lost, 3 times that share of the length in the tip.
    assert 0.0 < short <= 0.03 / 10
    assert short / long == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_pure_bending_is_exact_for_degree_two(cell):
    curvature = 0.02
    body = system(
        cell, 2, (3, 2), lambda s: (s - [0.0, 0.5]) * [3.0, 1.0], model="plane_stress",
        supports=[{"surface": "s0-", "kind": "symmetry"}],
        tractions=[{"surface": "s0+", "value": [f"{E * curvature}*y", 0]}],
    )  # fmt: skip
    x, y = body.positions.T
    exact = curvature * np.stack([x * y, -0.5 * x**2 - 0.5 * NU * y**2], axis=1)
    residual = to_scipy(body.stiffness) @ np.where(body.constrained, 0.0, exact.ravel())
    force = body.load(0.0)
    assert residual == pytest.approx(force, abs=1e-13)
    assert np.abs(force).max() > 1e-3


def cook(s):
    """Cook's membrane: corners (0, 0), (48, 44), (48, 60), (0, 44)."""
    x = 48.0 * s[:, 0]
    low, high = 44.0 * s[:, 0], 44.0 + 16.0 * s[:, 0]
    return np.stack([x, low + (high - low) * s[:, 1]], axis=1)


def cook_tip(cell, degree, n, model, nu, modulus):
    """Vertical displacement in the middle of the loaded end, for the force 1."""
    body = system(
        cell, degree, (n, n), cook, model=model, youngs_modulus=modulus, poisson_ratio=nu,
        supports=[{"surface": "s0-", "kind": "fixed"}],
        tractions=[{"surface": "s0+", "value": [0, 1 / 16]}],
    )  # fmt: skip
    return equilibrium(body)[at(body, (48.0, 52.0)), 1]


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_cooks_membrane_has_the_published_tip(cell):
    # R. D. Cook, J. Struct. Div. ASCE 100 (1974) 1851-1863: 23.96 is the accepted value.
    assert cook_tip(cell, 2, 32, "plane_stress", 1 / 3, 1.0) == pytest.approx(23.96, abs=0.01)
    coarse, fine = (23.96 - cook_tip(cell, 1, n, "plane_stress", 1 / 3, 1.0) for n in (16, 32))
    assert 0.0 < fine < 0.4 * coarse


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_cooks_membrane_does_not_lock_when_nearly_incompressible(cell):
    coarse, fine = (cook_tip(cell, 2, n, "plane_strain", 0.4999, 2.40565) for n in (8, 16))
    assert coarse == pytest.approx(fine, rel=3e-3)
    if cell == "quadrilateral":  # linear ones converge to the same, as fast as without locking
        tips = [cook_tip(cell, 1, n, "plane_strain", 0.4999, 2.40565) for n in (8, 16, 32)]
        errors = 1 - np.array(tips) / 7.692
        assert np.all(errors[:-1] / errors[1:] >= 2.4)
        assert 0.0 < errors[-1] <= 0.01


def test_linear_triangles_lock_as_documented():
    soft = cook_tip("triangle", 2, 8, "plane_strain", 0.4999, 1.0)
    assert cook_tip("triangle", 1, 8, "plane_strain", 0.4999, 1.0) < 0.6 * soft


def test_hexahedra_in_a_plane_state_agree_with_quadrilaterals():
    held = [{"surface": "s0-", "kind": "fixed"}]
    pull = {"tractions": [{"surface": "s0+", "value": [0, 0.1]}]}
    for degree in (1, 2):
        for nu in (NU, 0.49):
            flat = system("quadrilateral", degree, (4, 3), supports=held, poisson_ratio=nu, **pull)
            deep = system(
                "hexahedron", degree, (4, 3, 1), poisson_ratio=nu,
                supports=[*held, *({"surface": f"s2{s}", "kind": "symmetry"} for s in "-+")],
                tractions=[{"surface": "s0+", "value": [0, 0.1, 0]}],
            )  # fmt: skip
            tip = equilibrium(deep)[at(deep, (1.0, 1.0, 0.0))]
            expected = equilibrium(flat)[at(flat, (1.0, 1.0))]
            # For degree 2 and nu > .45 the 3D pressure is linear along z too: no difference.
            assert tip == pytest.approx([*expected, 0.0], rel=1e-9, abs=1e-12)


def test_mass_and_stiffness_are_positive():
    body = system("quadrilateral", 2, (3, 3), quarter, poisson_ratio=0.4999)
    values = np.linalg.eigvalsh(to_scipy(body.stiffness).toarray())
    assert np.sum(np.abs(values) <= 1e-9 * values[-1]) == 3
    assert values[0] >= -1e-9 * values[-1]
    assert np.linalg.eigvalsh(to_scipy(body.mass).toarray())[0] > 0.0
