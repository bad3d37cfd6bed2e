"""Masses and springs: stiffness by pattern, elements, eigenvalues, conservation, contact."""

import math

import numpy as np
import pytest
from moving_scenes import check_restart
from surfaces import write_half_square

import impactfem
from impactfem import SceneError
from impactfem.marching.net import NetMidpoint
from impactfem.scene import PiecewiseVector
from impactfem.system.net import net_system

ROOT3 = math.sqrt(3.0)
STILL = PiecewiseVector((0.0,), ((0.0, 0.0),))


def scene_of(*bodies, duration=1.0, **more):
    more.setdefault("gravity", [0.0, 0.0])
    return impactfem.Scene(title="net", duration=duration, bodies=bodies, **more)


def net_of(size=(1.0, 0.3 * ROOT3), **more):
    given = {
        "shape": impactfem.shapes.Block(size=size),
        "mesh_size": 0.1,
        "mass": 2.0,
        "stiffness": 100.0,
    }
    body = impactfem.SpringNet(name="net", **{**given, **more})
    return net_system(scene_of(body), body)


def linear_stiffness(net):
    """Sum of k n n^T over the springs at rest, dense."""
    count, dim = net.mesh.points.shape
    matrix = np.zeros((count, dim, count, dim))
    for (a, b), k in zip(net.mesh.edges, net.mesh.stiffness, strict=True):
        way = net.mesh.points[b] - net.mesh.points[a]
        block = k * np.outer(way, way) / (way @ way)
        for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
            matrix[i, :, j] += sign * block
    return matrix.reshape(count * dim, -1)


@pytest.mark.parametrize(
    ("pattern", "diagonal", "c11", "c12"),
    [("triangles", None, 0.75 * ROOT3, 0.25 * ROOT3), ("squares", None, 1.0, 0.0),
     ("crossed", None, 1.5, 0.5), ("crossed", 80.0, 1.8, 0.8)],
)  # fmt: skip
def test_stiffness_by_pattern(pattern, diagonal, c11, c12):
    """C11 = k + kd, C12 = C66 = kd; triangles E = 2 k / sqrt 3; Poisson's ratio 1/3."""
    size = (1.0, 0.3 * ROOT3) if pattern == "triangles" else (1.0, 0.4)
    net = net_of(size, pattern=pattern, diagonal_stiffness=diagonal)
    moduli = net.mesh.moduli() / 100.0
    found = moduli[0, 0, 0, 0], moduli[1, 1, 1, 1], moduli[0, 0, 1, 1], moduli[0, 1, 0, 1]
    assert found == pytest.approx((c11, c11, c12, c12), rel=1e-12)
    assert moduli[0, 0, 0, 1] == pytest.approx(0.0, abs=1e-12)
    if diagonal is None and pattern != "squares":
        modulus = 100.0 * (2.0 / ROOT3 if pattern == "triangles" else 4.0 / 3.0)
        assert net.isotropic == pytest.approx((modulus, 1.0 / 3.0), rel=1e-12)
        assert "isotropic with E" in net.words
    else:
        assert net.isotropic is None
        assert "depends on the direction" in net.words


def test_turned_pattern_is_stiff_along_its_edges():
    shape = impactfem.shapes.Block(size=(1.0, 0.4), angle=0.25 * math.pi)
    moduli = net_of(shape=shape, pattern="squares").mesh.moduli() / 100.0
    found = moduli[0, 0, 0, 0], moduli[0, 0, 1, 1]
    assert found == pytest.approx((0.5, 0.5), rel=1e-12)


def test_triangles_are_linear_elements():
    """Of plane stress with E h = 2 k / sqrt 3 and nu = 1/3, edge for edge."""
    net = net_of()
    nu, modulus = 1.0 / 3.0, 200.0 / ROOT3
    law = modulus / (1.0 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, 0.5 * (1.0 - nu)]])
    count = len(net.mesh.points)
    expected = np.zeros((2 * count, 2 * count))
    for cell in net.mesh.cells:
        corners = np.column_stack([np.ones(3), net.mesh.points[cell]])
        slopes = np.linalg.inv(corners)[1:]
        strain = np.zeros((3, 6))
        strain[0, ::2], strain[1, 1::2] = slopes
        strain[2, ::2], strain[2, 1::2] = slopes[1], slopes[0]
        own = np.stack([2 * cell, 2 * cell + 1], axis=1).ravel()
        area = 0.5 * abs(np.linalg.det(corners))
        expected[np.ix_(own, own)] += area * strain.T @ law @ strain
    assert linear_stiffness(net) == pytest.approx(expected, abs=1e-10)
    third = net.node_mass.sum() / len(net.mesh.cells) / 3.0
    assert net.node_mass == pytest.approx(third * np.bincount(net.mesh.cells.ravel()), rel=1e-12)


def test_patch_of_uniform_strain_is_in_equilibrium():
    net = net_of((1.0, 0.4), pattern="crossed")
    strain = np.array([[1.0, 0.3], [0.3, -0.7]])
    forces = (linear_stiffness(net) @ (net.mesh.points @ strain).ravel()).reshape(-1, 2)
    inside = np.isclose(net.node_mass, net.node_mass.max())
    assert np.abs(forces[inside]).max() < 1e-11
    stress = np.einsum("ijkl,kl->ij", net.mesh.moduli(), strain)
    right = net.mesh.surfaces["right"]
    # Corners carry half an edge of the top and of the bottom, too, which cancel.
    assert forces[right].sum(axis=0) == pytest.approx(0.4 * stress[0], rel=1e-9)


def test_vibration_has_the_frequency_of_a_dense_eigenproblem():
    """Of the midpoint rule, tan(w' h / 2) = w h / 2, at a small amplitude."""
    net = net_of()
    mass = np.repeat(net.node_mass, 2)
    root = np.sqrt(mass)
    squares, modes = np.linalg.eigh(linear_stiffness(net) / np.outer(root, root))
    assert np.abs(squares[:3]).max() < 1e-10 < squares[3]
    omega, shape = math.sqrt(squares[3]), modes[:, 3] / root
    dt, steps = 0.05 / omega, 60
    march = NetMidpoint(net, STILL, dt, counts=True)
    march._v = 1e-7 * shape
    for k in range(steps):
        march.begin(k * march.dt, (k + 1) * march.dt)
        march.finish(np.zeros(0))
    turned = 2.0 * math.atan(0.5 * omega * dt) * steps
    moved = (march.coordinates - net.position) @ (mass * shape) / 1e-7
    assert moved * omega == pytest.approx(math.sin(turned), abs=1e-6)
    assert march._v @ (mass * shape) / 1e-7 == pytest.approx(math.cos(turned), abs=1e-6)


def test_free_net_keeps_energy_and_momenta():
    net = net_of((0.5, 0.1 * ROOT3))
    march = NetMidpoint(net, STILL, 0.02, counts=True)
    march._v = np.random.default_rng(1).normal(size=len(march._v))
    first = last = march.initial(np.zeros(0))[0]
    for k in range(200):
        march.begin(k * march.dt, (k + 1) * march.dt)
        (last,) = march.finish(np.zeros(0))
    assert last.elastic > 0.01 * first.kinetic
    assert last.kinetic + last.elastic == pytest.approx(first.kinetic, rel=1e-12)
    assert last.momentum == pytest.approx(first.momentum, abs=1e-12)
    assert last.angular_momentum == pytest.approx(first.angular_momentum, abs=1e-12)


def test_held_net_swings_as_the_chain_of_its_rows():
    """Squares pulled along a row: masses and springs in a chain, summed up by its modes."""
    body = impactfem.SpringNet(
        name="net", shape=impactfem.shapes.Block(size=(1.0, 0.4)), mesh_size=0.1, pattern="squares",
        mass=2.0, stiffness=100.0, velocity=[1e-6, 0.0],
        supports=[{"surface": "left", "kind": "fixed"}],
    )  # fmt: skip
    result = impactfem.solve(
        scene_of(
            body,
            duration=0.15,
            solve=impactfem.Solve(dt=1e-3, estimate=False),
            output=impactfem.Output(fields=[]),
        )
    )
    masses = np.full(10, 0.2)
    masses[-1] = 0.1
    chain = 400.0 * (2.0 * np.eye(10) - np.eye(10, k=1) - np.eye(10, k=-1))  # four rows of k
    chain[-1, -1] = 400.0
    root = np.sqrt(masses)
    squares, modes = np.linalg.eigh(chain / np.outer(root, root))
    omega, time = np.sqrt(squares), np.asarray(result.history["time"])
    start = modes.T @ (root * 1e-6)
    moved = (modes / root[:, None]) @ (
        start[:, None] * np.sin(omega[:, None] * time) / omega[:, None]
    )
    mean = masses @ moved / 2.0
    found = np.asarray(result.history["net.x"]) - 0.5
    assert np.abs(found - mean).max() < 2e-4 * np.abs(mean).max()


def test_ball_falls_into_a_net_and_energy_is_accounted_for():
    """A strip held at both ends catches a ball, which touches masses and edges."""
    net = impactfem.SpringNet(
        name="net", shape=impactfem.shapes.Block(size=(1.0, 0.1 * ROOT3)), mesh_size=0.1, mass=0.2,
        stiffness=2000.0, radius=0.01,
        supports=[{"surface": "left", "kind": "fixed"}, {"surface": "right", "kind": "fixed"}],
    )  # fmt: skip
    ball = impactfem.Point(
        name="ball", mass=0.3, position=[0.53, 0.1 * ROOT3 + 0.07], radius=0.05,
        velocity=[0.0, -3.0],
    )  # fmt: skip
    law = impactfem.Contact(between=("ball", "net"), friction_coefficient=0.3)
    result = impactfem.solve(
        scene_of(
            net,
            ball,
            contacts=[law],
            duration=0.15,
            gravity=[0.0, -9.81],
            solve=impactfem.Solve(dt=5e-4, estimate=False),
            output=impactfem.Output(fields=[]),
        )
    )
    summary = result.summary
    assert summary["status"] == "completed"
    assert abs(summary["energy"]["unexplained"]) < 1e-3
    assert not summary["energy"]["grows"]
    lowest = result.history["ball.y"].min()
    assert lowest < 0.1 * ROOT3  # it sank in, and was thrown back
    assert result.history["ball.vy"][-1] > 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shape": None}, "neither is given"),
        ({"mesh": "net.msh"}, "both are given"),
        ({"mesh_size": None}, "mesh_size is missing"),
        ({"pattern": "triangles", "diagonal_stiffness": 1.0}, "diagonal_stiffness"),
        ({"shape": {"kind": "block", "size": [1, 1, 1]}}, "in the plane"),
        ({"shape": {"kind": "block", "size": [1, 1], "symmetry": ["x"]}}, "symmetry"),
        ({"supports": [{"surface": "rim", "kind": "fixed"}]}, "give left or right"),
        ({"supports": [{"surface": "left", "kind": "symmetry"}]}, 'give "fixed"'),
        ({"velocity": [1.0, 0.0, 0.0]}, "give 2"),
        ({"model": "3d"}, "plane"),
    ],
)
def test_what_cannot_be_is_refused(change, message):
    given = {"shape": {"kind": "block", "size": [1.0, 0.5]}, "mesh_size": 0.1, "mass": 1.0,
             "stiffness": 1.0, **change}  # fmt: skip
    with pytest.raises(SceneError, match=message):
        impactfem.SpringNet(**given)


def test_nets_too_fine_too_coarse_or_held_all_over_are_refused():
    for change, message in (
        ({"mesh_size": 1e-4}, "more than 20000"),
        ({"shape": impactfem.shapes.Disc(radius=0.04)}, "no cell"),
    ):
        with pytest.raises(SceneError, match=message):
            net_of(**change)
    held = [{"surface": side, "kind": "fixed"} for side in ("left", "right")]
    with pytest.raises(impactfem.ImpactError, match="hold all of it"):
        net_of((0.1, 0.1), pattern="squares", supports=held)


def falling(**more):
    net = impactfem.SpringNet(
        name="net", shape=impactfem.shapes.Disc(radius=0.2, center=[0.0, 0.19]), mesh_size=0.1,
        mass=0.5, stiffness=500.0, velocity=[0.5, -1.0],
    )  # fmt: skip
    return scene_of(
        net,
        obstacles=[impactfem.HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 1.0])],
        contacts=[impactfem.Contact(between=("net", "floor"), friction_coefficient=0.3)],
        duration=0.08, gravity=[0.0, -9.81],
        solve=impactfem.Solve(dt=1e-3, estimate=False), **more,
    )  # fmt: skip


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    scene = falling(output=impactfem.Output(checkpoint=20))
    whole, _ = check_restart(scene, 67, tmp_path, monkeypatch)
    assert whole.summary["contact"]["impulse"] > 0.0


def test_net_of_a_mesh_file(tmp_path):
    write_half_square(tmp_path / "net.geo", size=0.3, foot=1)
    given = {"mesh": "net.geo", "mass": 1.0, "stiffness": 10.0}
    held = impactfem.SpringNet(**given, supports=[{"surface": "foot", "kind": "fixed"}])
    net = net_system(scene_of(held, folder=tmp_path), held)
    points = net.mesh.points
    assert net.mesh.size == pytest.approx(0.5, rel=1e-12)
    assert set(net.free) == set(np.flatnonzero(points[:, 1] > 1e-12))
    nodes, cells = len(points), len(net.mesh.cells)
    assert len(net.mesh.edges) == nodes + cells - 1  # Euler's formula
    wrong = impactfem.SpringNet(**given, supports=[{"surface": "head", "kind": "fixed"}])
    with pytest.raises(impactfem.errors.MeshError, match="head"):
        net_system(scene_of(wrong, folder=tmp_path), wrong)


def on_rubber(mu=0.0, **output):
    """A net that falls on a block of rubber under finite strain."""
    block = {
        "kind": "solid", "name": "pad", "model": "plane_strain", "mesh_size": 0.025,
        "strain": "finite", "material": "neo_hookean", "density": 1100.0, "youngs_modulus": 1e6,
        "poisson_ratio": 0.3, "supports": [{"surface": "bottom", "kind": "fixed"}],
        "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [-0.1, -0.1]},
    }  # fmt: skip
    net = {
        "kind": "springs", "name": "net", "pattern": "crossed", "mass": 0.5, "stiffness": 2e4,
        "shape": {"kind": "block", "size": [0.1, 0.05], "corner": [-0.05, 0.01]},
        "mesh_size": 0.025, "radius": 0.002, "velocity": [0.1, -1.0],
    }  # fmt: skip
    return impactfem.Scene.from_dict({
        "title": "net", "duration": 0.03, "body": [block, net],
        "contact": [{"between": ["net", "pad"], "friction_coefficient": mu}],
        "solve": {"dt": 5e-4, "estimate": False}, "output": {"fields": []} | output,
    })  # fmt: skip


@pytest.mark.slow
def test_a_net_on_rubber_of_finite_strain_keeps_its_energy():
    history = impactfem.solve(on_rubber()).history
    energy = history["total_energy"].values
    assert history["contact_force"].values.max() > 300.0
    assert history["net.vy"].values[-1] > 0.5
    assert np.ptp(energy) < 1e-7 * energy[0]  # as exactly as springs settle


@pytest.mark.parallel([1, 2])
@pytest.mark.slow
def test_a_net_on_rubber_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    check_restart(on_rubber(0.2, checkpoint=10), 25, tmp_path, monkeypatch)


def test_a_net_spins_about_its_centre_and_keeps_what_it_has():
    with pytest.raises(SceneError, match="does not fit 2 coordinates: give a number"):
        impactfem.SpringNet(
            mass=1.0, stiffness=1e3, mesh_size=0.1, angular_velocity=[0.0, 0.0, 3.0],
            shape=impactfem.shapes.Block(size=[0.2, 0.2], corner=[0.1, 0.0]),
        )  # fmt: skip
    net = impactfem.SpringNet(
        name="net", mass=1.0, stiffness=1e3, mesh_size=0.1, velocity=[1.0, 0.5],
        angular_velocity=3.0, shape=impactfem.shapes.Block(size=[0.2, 0.2], corner=[0.1, 0.0]),
    )  # fmt: skip
    scene = impactfem.Scene(
        title="spin", duration=2.5, gravity=[0.0, 0.0], bodies=[net],
        solve=impactfem.Solve(dt=1e-2, estimate=False), output=impactfem.Output(fields=[]),
    )  # fmt: skip
    found = impactfem.solve(scene).history
    assert found["net.spin"].values[0] == pytest.approx(3.0, rel=1e-12)
    assert found["net.angle"].values[-1] == pytest.approx(7.5, rel=2e-2)  # it stretches
    for name in ("net.vx", "net.vy", "total_energy", "angular_momentum"):
        assert np.ptp(found[name].values) < 1e-12
