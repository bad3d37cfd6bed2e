"""Matrices and loads of bodies against closed forms."""

import numpy as np
import pytest
from scipy.linalg import eigh
from solids import at, equilibrium, system, system_on, to_scipy
from structured import block

from impactfem.errors import MeshError
from impactfem.scene.loads import PiecewiseVector
from impactfem.system.massless import mass_transfer
from impactfem.system.matrices import rigid_motions, to_blocked
from impactfem.system.surface import SurfaceNodes

E, NU = 10.0, 0.3
MU, LAMBDA = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))

CELLS = {
    "triangle": (3, 3), "quadrilateral": (3, 3), "tetrahedron": (2, 2, 2), "hexahedron": (2, 2, 2),
}  # fmt: skip


def distorted(s):
    """A block without parallel faces inside; curved elements for degree 2."""
    x = 1.0 + s.copy()
    bump = np.prod(np.sin(np.pi * s), axis=1)
    x[:, 0] += 0.07 * bump
    x[:, 1] += 0.3 * s[:, 1] - 0.11 * bump
    return x


def linear(dim, model):
    """Gradient of a displacement, and its uniform stress (3, 3)."""
    gradient = np.array([[0.3, 0.2, -0.1], [-0.4, 0.5, 0.25], [0.15, 0.35, -0.2]])[:dim, :dim]
    if model == "axisymmetric":  # only u_r = a r leaves the stress uniform
        gradient = np.diag(gradient.diagonal())
    strain = np.zeros((3, 3))
    strain[:dim, :dim] = 0.5 * (gradient + gradient.T)
    if model == "axisymmetric":
        strain[2, 2] = gradient[0, 0]
    return gradient, strain


def von_mises(stress):
    deviator = stress - np.trace(stress) / 3 * np.eye(3)
    return np.sqrt(1.5 * np.sum(deviator**2))


@pytest.mark.parametrize("nu", [NU, 0.49])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(
    ("cell", "model"),
    [
        *((cell, "3d") for cell in ("tetrahedron", "hexahedron")),
        *(
            (cell, model)
            for cell in ("triangle", "quadrilateral")
            for model in ("plane_strain", "plane_stress", "axisymmetric")
        ),
    ],
)
def test_linear_displacement_leaves_no_force_inside_and_has_the_stress_of_hooke(
    cell, model, degree, nu
):
    body = system(cell, degree, CELLS[cell], distorted, model=model, poisson_ratio=nu)
    gradient, strain = linear(body.dim, model)
    u = body.positions @ gradient.T
    mu, lame = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
    if model == "plane_stress":
        strain[2, 2] = -nu / (1 - nu) * (strain[0, 0] + strain[1, 1])
    stress = lame * np.trace(strain) * np.eye(3) + 2 * mu * strain
    x = body.positions
    inside = np.all((x > x.min(axis=0) + 1e-9) & (x < x.max(axis=0) - 1e-9), axis=1)
    force = (to_scipy(body.stiffness) @ u.ravel()).reshape(u.shape)
    if model == "axisymmetric":
        # Equilibrium needs sigma_rr = sigma_theta, true for u_r = a r.
        assert stress[0, 0] == pytest.approx(stress[2, 2])
    assert np.abs(force[inside]).max() <= 1e-12 * np.abs(force).max()
    # von Mises is uniform, and the elastic energy that of the uniform stress in the volume.
    assert body.fields.at(u.ravel())["von_mises"][:, 0] == pytest.approx(
        von_mises(stress), rel=1e-12
    )
    volume = body.total_mass / 2.0
    energy = 0.5 * np.sum(stress * strain) * volume
    assert body.elastic_energy(u.ravel()) == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_rigid_motions_cost_no_energy_and_masses_sum_up(cell, degree):
    body = system(
        cell, degree, CELLS[cell], distorted, gravity=np.arange(1.0, len(CELLS[cell]) + 1)
    )
    stiffness, mass = to_scipy(body.stiffness), to_scipy(body.mass)
    for motion in rigid_motions(body.nodes):
        assert np.abs(stiffness @ motion).max() <= 1e-13 * E * np.abs(motion).max() * 10
    # 1 x 1.3 (x 1): the bump moves nodes inside only.
    expected = 2.0 * 1.3
    assert body.total_mass == pytest.approx(expected, rel=1e-13)
    assert mass.sum() == pytest.approx(body.dim * expected, rel=1e-13)
    assert abs(mass - mass.T).max() <= 1e-15
    assert abs(stiffness - stiffness.T).max() <= 1e-13
    weight = body.load(0.0).reshape(-1, body.dim).sum(axis=0)
    assert weight == pytest.approx(expected * np.arange(1.0, body.dim + 1), rel=1e-13)
    rows = np.asarray(mass.sum(axis=1)).ravel()
    assert np.repeat(body.node_mass, body.dim) == pytest.approx(rows, rel=1e-10, abs=1e-14)
    if degree == 1 or cell in {"quadrilateral", "hexahedron"}:
        assert body.lumped == pytest.approx(rows)
    else:
        assert body.lumped is None


def test_plane_bodies_have_thickness_and_axisymmetric_ones_the_whole_circumference():
    thick = system("triangle", 1, (2, 2), model="plane_stress", thickness=0.25)
    assert thick.total_mass == pytest.approx(2.0 * 0.25)

    def tube(s):
        return np.add(s, [0.5, 0.0])

    for cell in ("triangle", "quadrilateral"):
        for degree in (1, 2):
            round_body = system(cell, degree, (2, 2), tube, model="axisymmetric", gravity=(0, -3.0))
            mass = 2.0 * np.pi * (1.5**2 - 0.5**2)
            assert round_body.total_mass == pytest.approx(mass)
            weight = round_body.load(0.0).reshape(-1, 2)[:, 1].sum()
            assert weight == pytest.approx(-3.0 * mass)


def test_nodes_on_the_axis_are_held_there_and_have_mass():
    body = system("triangle", 1, (4, 4), model="axisymmetric", velocity=["x", "1"])
    on_axis = body.positions[:, 0] == 0.0
    held = body.constrained.reshape(-1, 2)
    assert on_axis.sum() == 5
    assert np.array_equal(held[:, 0], on_axis)
    assert not held[:, 1].any()
    assert body.node_mass.min() > 0.0
    # Opposite sides move apart with the same momentum.
    assert body.momentum(body.velocity) == pytest.approx([0.0, 2.0 * np.pi])
    assert body.center_of_mass == pytest.approx([0.0, 0.5])
    with pytest.raises(MeshError, match=r"reaches x = -0\.5 m.*x >= 0"):
        system("triangle", 1, (2, 2), lambda s: s - [0.5, 0.0], model="axisymmetric")


def test_rotation_has_the_momentum_of_a_rigid_body():
    velocity, spin = (0.3, -0.2), 1.7
    body = system("triangle", 1, (4, 3), velocity=velocity, angular_velocity=spin)
    assert body.momentum(body.velocity) == pytest.approx(2.0 * np.array(velocity), rel=1e-13)
    assert body.center_of_mass == pytest.approx([0.5, 0.5])
    v = body.velocity.reshape(-1, 2)
    corner = at(body, (1.0, 0.0))
    assert v[corner] == pytest.approx([0.3 + 1.7 * 0.5, -0.2 + 1.7 * 0.5])
    # kinetic energy: m v^2 / 2 + I omega^2 / 2 with I = m / 6 of the unit square
    expected = 0.5 * 2.0 * (0.3**2 + 0.2**2) + 0.5 * (2.0 / 6.0) * spin**2
    assert body.kinetic_energy(body.velocity) == pytest.approx(expected, rel=1e-13)
    turned = system("hexahedron", 1, (2, 2, 2), angular_velocity=(0.0, 2.0, 0.0))
    v = turned.velocity.reshape(-1, 3)[at(turned, (1.0, 0.0, 0.0))]
    assert v == pytest.approx([2.0 * -0.5, 0.0, -2.0 * 0.5])


def test_bar_without_lateral_contraction_swings_at_its_closed_form():
    body = system(
        "quadrilateral", 2, (8, 1), lambda s: s * [2.0, 0.1], poisson_ratio=0.0,
        supports=[{"surface": "s0-", "kind": "fixed"}, {"surface": "s1-", "kind": "symmetry"},
                  {"surface": "s1+", "kind": "symmetry"}],
    )  # fmt: skip
    free = np.flatnonzero(~body.constrained)
    stiffness = to_scipy(body.stiffness).toarray()[np.ix_(free, free)]
    mass = to_scipy(body.mass).toarray()[np.ix_(free, free)]
    lowest = np.sqrt(eigh(stiffness, mass, eigvals_only=True)[:3])
    speed = np.sqrt(E / 2.0)
    # Quadratic elements are of fourth order in the eigenvalue: (k h)^4 / 720 relative, k h = 0.98.
    expected = (2 * np.arange(3) + 1) * np.pi * speed / (2 * 2.0)
    wave = expected / speed * 0.25
    assert np.all(np.abs(lowest / expected - 1) <= 1e-3 * wave**4 + 1e-12)
    assert np.all(lowest >= expected * (1 - 1e-12))


def test_blocks_of_both_formats_agree():
    body = system("tetrahedron", 1, (3, 3, 3))
    assert body.stiffness.getBlockSize() == 3
    blocked = to_blocked(body.stiffness)
    x, y = body.stiffness.createVecs()
    z = y.duplicate()
    x.setRandom()
    body.stiffness.mult(x, y)
    blocked.mult(x, z)
    assert "baij" in blocked.getType()
    assert (y - z).norm() <= 1e-14 * y.norm()
    assert body.stiffness.getNearNullSpace().getVecs()[5].norm() == pytest.approx(1.0)


def test_gravity_changes_at_its_times():
    gravity = PiecewiseVector((0.0, 1.0), ((0.0, -9.0), (3.0, 0.0)))
    body = system("triangle", 1, (2, 2), gravity=gravity)
    for t, expected in ((0.5, (0.0, -18.0)), (1.0, (6.0, 0.0))):
        assert body.load(t).reshape(-1, 2).sum(axis=0) == pytest.approx(expected)
    mean = body.load(2.0, start=0.0).reshape(-1, 2).sum(axis=0)
    assert mean == pytest.approx([3.0, -9.0])


def test_unusable_elements_are_refused():
    mesh = block("triangle", 1, (2, 2), lambda s: s * [1.0, 0.0])
    with pytest.raises(MeshError, match="must be positive"):
        system_on(mesh)
    broken = block("triangle", 1, (2, 2))
    broken.mesh.geometry.x[0, 0] = np.nan
    with pytest.raises(MeshError, match="not finite"):
        system_on(broken)


def test_equilibrium_of_a_uniform_pull_is_exact():
    body = system(
        "tetrahedron", 1, (2, 2, 2),
        supports=[{"surface": f"s{axis}-", "kind": "symmetry"} for axis in range(3)],
        tractions=[{"surface": "s0+", "value": [1.5, 0, 0]}],
    )  # fmt: skip
    expected = body.positions * [1.5 / E, -NU * 1.5 / E, -NU * 1.5 / E]
    assert equilibrium(body) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(
    ("cell", "divisions"), [("quadrilateral", (5, 3)), ("hexahedron", (3, 4, 2))]
)
def test_massless_nodes_give_their_mass_as_the_consistent_mass_couples_them(cell, divisions):
    """On a regular grid the weights of inner neighbours are those of the rows of M."""
    mesh = block(cell, 1, divisions)
    body = system_on(mesh, **({"model": "3d"} if len(divisions) == 3 else {}))
    nodes = np.flatnonzero(body.positions[:, -1] == 0.0)
    surface = SurfaceNodes.of(body.comm, body.dim, np.sort(body.numbers[nodes]), body.numbers)
    transfer = mass_transfer(body, surface, mesh)
    weights = to_scipy(transfer).toarray()[:: body.dim, :: body.dim]
    transfer.destroy()
    coupled = to_scipy(body.mass).toarray()[:: body.dim, :: body.dim]
    inner = np.setdiff1d(np.arange(len(weights)), nodes)
    coupled = coupled[np.ix_(nodes, inner)]
    expected = coupled / coupled.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(weights[np.ix_(nodes, inner)], expected, atol=1e-14)
    np.testing.assert_array_equal(weights[np.ix_(inner, inner)], np.eye(len(inner)))
    assert not weights[:, nodes].any()
