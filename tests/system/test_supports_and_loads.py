"""Supports, motions in time and surface loads: what they hold, sum up to and refuse."""

import numpy as np
import pytest
from solids import at, equilibrium, system, system_on, to_scipy
from structured import block

from impactfem.errors import MeshError, SceneError
from impactfem.scene import Formula
from impactfem.scene.jets import motion_at

FIXED = {"surface": "s0-", "kind": "fixed"}


@pytest.mark.parametrize(
    ("text", "value", "rate", "second"),
    [
        ("0.1*sin(3*t)", lambda t: 0.1 * np.sin(3 * t), lambda t: 0.3 * np.cos(3 * t),
         lambda t: -0.9 * np.sin(3 * t)),
        ("exp(-t)*t**2", lambda t: np.exp(-t) * t**2, lambda t: np.exp(-t) * (2 * t - t**2),
         lambda t: np.exp(-t) * (2 - 4 * t + t**2)),
        ("1/(1 + t**2)", lambda t: 1 / (1 + t**2), lambda t: -2 * t / (1 + t**2) ** 2,
         lambda t: (6 * t**2 - 2) / (1 + t**2) ** 3),
        ("where(t < 0.5, 2*t, 1)", lambda t: 2 * t if t < 0.5 else 1, lambda t: 2.0 * (t < 0.5),
         lambda _: 0.0),
        ("t**t", lambda t: t**t, lambda t: t**t * (np.log(t) + 1),
         lambda t: t**t * ((np.log(t) + 1) ** 2 + 1 / t)),
        ("where(t < 2, sqrt(2 - t), 0)", lambda t: np.sqrt(2 - t), lambda t: -0.5 / np.sqrt(2 - t),
         lambda t: -0.25 * (2 - t) ** -1.5),
    ],
)  # fmt: skip
def test_motions_know_their_velocity_and_acceleration(text, value, rate, second):
    for t in (0.3, 0.7, 1.9):
        jet = motion_at(Formula(text, ("t",)), t)
        assert (jet.value, jet.rate, jet.second) == pytest.approx(
            (value(t), rate(t), second(t)), rel=1e-13, abs=1e-15
        )


@pytest.mark.parametrize(
    "text",
    ["tan(t)", "asin(t/2)", "acos(t/2)", "atan(t)", "sinh(t)", "cosh(t)", "tanh(t)", "log(t)",
     "abs(t - 2)**3", "min(t, 2*t - 1)*t", "max(t**2, 1 - t)", "2**t", "sqrt(t)", "-t**3/(2 - t)"],
)  # fmt: skip
def test_derivatives_agree_with_difference_quotients(text):
    formula, t, h = Formula(text, ("t",)), 0.83, 1e-4
    jet = motion_at(formula, t)
    left, here, right = (float(formula(t=t + k * h)) for k in (-1, 0, 1))
    assert jet.value == pytest.approx(here, rel=1e-14)
    assert jet.rate == pytest.approx((right - left) / (2 * h), rel=1e-6)
    assert jet.second == pytest.approx((right - 2 * here + left) / h**2, rel=1e-5, abs=1e-6)


def test_values_stay_finite_where_only_a_derivative_is_not():
    jet = motion_at(Formula("t**1.5", ("t",)), 0.0)
    assert (jet.value, jet.rate) == (0.0, 0.0)
    assert not np.isfinite(jet.second)
    later = motion_at(Formula("where(t < 1, 0, sqrt(t - 1))", ("t",)), 0.5)
    assert (later.value, later.rate, later.second) == (0.0, 0.0, 0.0)


def test_symmetry_holds_the_normal_of_each_face_of_its_surface():
    mesh = block("hexahedron", 1, (2, 2, 2))
    both = np.sort(np.concatenate([mesh.surfaces["s0-"], mesh.surfaces["s2+"]]))
    surfaces = dict(mesh.surfaces) | {"cut": both}
    object.__setattr__(mesh, "surfaces", surfaces)
    body = system_on(mesh, model="3d", supports=[{"surface": "cut", "kind": "symmetry"}])
    x, held = body.positions, body.constrained.reshape(-1, 3)
    assert np.array_equal(held, np.stack([x[:, 0] == 0, np.zeros(27, bool), x[:, 2] == 1], axis=1))


def test_inclined_symmetry_is_refused_by_name():
    def inclined(s):
        return s @ np.array([[1.0, 0.2], [0.0, 1.0]])

    with pytest.raises(MeshError, match=r"'s1\+' is inclined.*turn the body"):
        system("triangle", 1, (2, 2), inclined, supports=[{"surface": "s1+", "kind": "symmetry"}])


@pytest.mark.parametrize(
    "given",
    [
        {"supports": [{"surface": "rim", "kind": "fixed"}]},
        {"tractions": [{"surface": "rim", "value": [1, 0]}]},
        {"pressures": [{"surface": "rim", "value": 1}]},
    ],
)
def test_unknown_surfaces_are_refused_with_those_there_are(given):
    with pytest.raises(MeshError, match=r"'rim'.*s0-, s0\+, s1-, s1\+"):
        system("triangle", 1, (2, 2), **given)


def test_supports_that_meet_must_agree():
    top = {"surface": "s1+", "kind": "motion"}
    with pytest.raises(SceneError, match=r"\(0, 1\).*along y.*'0'.*'s0-'.*'0.1\*t'.*free"):
        system("triangle", 1, (2, 2), supports=[FIXED, top | {"value": ["", "0.1*t"]}])
    body = system("triangle", 1, (2, 2), supports=[FIXED, top | {"value": ["0", "0.0"]}])
    assert body.constrained.sum() == 10
    assert not body.supports.formulas


def test_moved_supports_stretch_the_body_and_start_it():
    body = system(
        "quadrilateral", 1, (3, 2), velocity=[0.0, 7.0],
        supports=[{"surface": "s0-", "kind": "symmetry"}, {"surface": "s1-", "kind": "symmetry"},
                  {"surface": "s0+", "kind": "motion", "value": ["0.2 + 0.3*t", ""]}],
    )  # fmt: skip
    # plane strain: eps_y = -nu / (1 - nu) eps_x
    stretch = 0.2 + 0.3 * 2.0
    expected = body.positions * [stretch, -0.3 / 0.7 * stretch]
    u = equilibrium(body, 2.0)
    assert u == pytest.approx(expected, abs=1e-13)
    modulus = 10.0 / (1 - 0.3**2)
    assert body.elastic_energy(u.ravel()) == pytest.approx(0.5 * modulus * stretch**2)
    pulled = at(body, (1.0, 0.0))
    assert body.displacement.reshape(-1, 2)[pulled] == pytest.approx([0.2, 0.0])
    assert body.velocity.reshape(-1, 2)[pulled] == pytest.approx([0.3, 0.0])
    assert body.velocity.reshape(-1, 2)[at(body, (1.0, 1.0))] == pytest.approx([0.3, 7.0])


def test_moved_supports_load_the_rest_by_stiffness_damping_and_mass():
    given = {
        "supports": [{"surface": "s0-", "kind": "motion", "value": ["t**3", "sin(t)"]}],
        "rayleigh_mass": 0.7, "rayleigh_stiffness": 0.2,
    }  # fmt: skip
    body = system("triangle", 2, (2, 2), **given)
    whole = system("triangle", 2, (2, 2))
    stiffness, mass = to_scipy(whole.stiffness), to_scipy(whole.mass)
    t = 1.3
    moved = body.constrained.reshape(-1, 2)[:, 0]
    u, v, a = (np.outer(moved, pair).ravel() for pair in
               ((t**3, np.sin(t)), (3 * t**2, np.cos(t)), (6 * t, -np.sin(t))))  # fmt: skip
    expected = -stiffness @ (u + 0.2 * v) - mass @ (a + 0.7 * v)
    free = ~body.constrained
    assert body.load(t)[free] == pytest.approx(expected[free], rel=1e-12, abs=1e-12)
    assert not body.load(t)[~free].any()
    static = -stiffness @ (u + 0.2 * v)
    assert body.load(t, lumped=True)[free] == pytest.approx(static[free], rel=1e-12, abs=1e-12)
    # energies with the moved nodes are those of the whole body
    x = np.random.default_rng(1).normal(size=len(u))
    assert body.elastic_energy(x) == pytest.approx(0.5 * x @ stiffness @ x)
    assert body.kinetic_energy(x) == pytest.approx(0.5 * x @ mass @ x)
    with pytest.raises(SceneError, match=r"'sqrt\(t\)'.*not finite at t = 0 s"):
        system("triangle", 1, (2, 2), supports=[
            {"surface": "s0-", "kind": "motion", "value": ["sqrt(t)", ""]}])  # fmt: skip


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_surface_loads_sum_up_to_their_integrals(cell, degree):
    dim = 2 if cell in {"triangle", "quadrilateral"} else 3
    value = ["y*t", "x**2 + y**2", "1"][:dim]
    given = {"thickness": 0.5} if dim == 2 else {}
    body = system(cell, degree, (2,) * dim, tractions=[{"surface": "s0+", "value": value}], **given)
    area = 0.5 if dim == 2 else 1.0
    expected = area * np.array([0.5 * 3.0, 1.0 + 1.0 / 3.0, 1.0])[:dim]
    assert body.load(3.0).reshape(-1, dim).sum(axis=0) == pytest.approx(expected, rel=1e-13)
    # The moment about the origin is right too where the formula is at most of degree 2.
    force = body.load(3.0).reshape(-1, dim)
    moment = body.positions[:, 0] @ force[:, 1] - body.positions[:, 1] @ force[:, 0]
    assert moment == pytest.approx(area * (4.0 / 3.0 - 3.0 / 3.0), rel=1e-12)
    assert not force[body.positions[:, 0] < 0.49].any()


def test_uniform_pressure_all_around_is_in_balance_and_squeezes():
    def bent(s):
        return np.stack([(1 + s[:, 0]) * np.cos(s[:, 1]), (1 + s[:, 0]) * np.sin(s[:, 1])], axis=1)

    pressures = [{"surface": f"s{a}{b}", "value": "4*(1 + t)"} for a in "01" for b in "-+"]
    body = system("quadrilateral", 2, (2, 3), bent, pressures=pressures)
    force = body.load(1.0).reshape(-1, 2)
    assert force.sum(axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)
    # virtual work in u = x: -p div x times the area of the mesh
    area = body.total_mass / 2.0
    assert np.sum(force * body.positions) == pytest.approx(-8.0 * 2.0 * area, rel=1e-12)
    assert np.array_equal(body.load(1.0), body.load(1.0))
    assert body.load(0.0) == pytest.approx(0.5 * body.load(1.0))


def test_formulas_without_finite_values_are_refused():
    with pytest.raises(SceneError, match=r"pressure on 's0\+' = '1/y' has no finite value"):
        system("triangle", 1, (2, 2), pressures=[{"surface": "s0+", "value": "1/y"}])
    body = system("triangle", 1, (2, 2), tractions=[{"surface": "s0+", "value": ["log(1-t)", 0]}])
    assert np.isfinite(body.load(0.5)).all()
    with pytest.raises(SceneError, match=r"x traction on 's0\+'.*t = 1 s"):
        body.load(1.0)
    with pytest.raises(SceneError, match=r"initial velocity along y, 'log\(x\)', is -inf"):
        system("triangle", 1, (2, 2), velocity=[0, "log(x)"])
