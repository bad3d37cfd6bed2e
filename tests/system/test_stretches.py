"""Rotation, stretches and ratio of volumes of a body, as seen from its places."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from pytest_mpi import parallel_assert
from scipy.spatial.transform import Rotation
from solids import system

from impactfem.marching.model_watch import ModelWatch
from impactfem.scene.solids import Solid
from impactfem.system.stretches import Look, Stretches

CASES = [
    ("triangle", 1, "plane_strain"),
    ("quadrilateral", 2, "plane_stress"),
    ("tetrahedron", 1, "3d"),
    ("tetrahedron", 2, "3d"),
    ("hexahedron", 1, "3d"),
]
TURN = 0.7


def solid(model):
    data = {"density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3}
    return Solid(model=model, mesh="structured.msh", **data)


def measured(cell, degree, model, supports=(), place=None):
    """A block of 3 x 1 (x 2), and what measures it."""
    divisions = (3, 2, 2) if model == "3d" else (4, 3)
    size = np.array([3.0, 1.0, 2.0][: len(divisions)])
    body = system(
        cell, degree, divisions, place or (lambda s: s * size), model=model, supports=supports
    )
    return body, Stretches(body, solid(model))


def turned(dim, angle=TURN):
    axis = [0.0, 0.0, 1.0] if dim == 2 else [1.0, -2.0, 2.0]
    return Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis)).as_matrix()[
        :dim, :dim
    ]


def look(body, stretches, gradient):
    """Where X becomes F X + 1."""
    return stretches.look((body.positions @ (gradient.T - np.eye(body.dim)) + 1.0).ravel())


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_rigid_rotation_is_a_rotation_without_strain(case):
    body, stretches = measured(*case)
    for angle in (TURN, 3.0, 1e-3, 0.0):
        seen = look(body, stretches, turned(body.dim, angle))
        assert seen.rotation == pytest.approx(angle, abs=1e-12)
        assert seen.strain_max < 1e-12
        assert seen.volume_ratio_min == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_stretch_is_itself_whether_or_not_it_is_turned(case):
    body, stretches = measured(*case)
    stretch = np.diag([1.2, 0.9, 1.05][: body.dim])
    across = 1.0 - 0.1 * 0.3 / 0.7 if case[2] == "plane_stress" else 1.0
    for rotation in (np.eye(body.dim), turned(body.dim)):
        seen = look(body, stretches, rotation @ stretch)
        assert seen.strain_max == pytest.approx(0.2, abs=1e-12)
        assert seen.strain_99 == pytest.approx(0.2, abs=1e-12)
        assert seen.volume_ratio_min == pytest.approx(np.linalg.det(stretch) * across, abs=1e-12)
        assert seen.rotation == pytest.approx(0.0 if rotation[0, 0] == 1.0 else TURN, abs=1e-12)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_turn_of_linear_elasticity_is_a_rotation_and_a_stretch(case):
    # Its strain sym(grad u) is zero: that is why it cannot be what is measured.
    body, stretches = measured(*case)
    gradient = np.eye(body.dim)
    gradient[:2, :2] += 0.5 * np.array([[0.0, -1.0], [1.0, 0.0]])
    seen = look(body, stretches, gradient)
    assert seen.rotation == pytest.approx(math.atan(0.5), abs=1e-12)
    assert seen.strain_99 == pytest.approx(math.sqrt(1.25) - 1.0, rel=1e-8)


def test_with_an_axis_the_hoop_is_stretched_and_nothing_turns():
    body, stretches = measured("quadrilateral", 1, "axisymmetric")
    seen = stretches.look((body.positions * [0.1, -0.05]).ravel())
    assert seen.strain_max == pytest.approx(0.1, abs=1e-12)
    assert seen.volume_ratio_min == pytest.approx(1.1**2 * 0.95, abs=1e-12)
    assert seen.rotation == 0.0
    mass = 2.0 * math.pi * 9.0
    sides = mass * (9.0 / 4.0 + 1.0 / 12.0)
    assert stretches.mass == pytest.approx(mass)
    assert stretches.inertia == pytest.approx(np.diag([sides, mass * 4.5, sides]))


def test_the_inertia_is_that_of_the_whole_body():
    _, stretches = measured("tetrahedron", 1, "3d")
    assert stretches.inertia == pytest.approx(np.diag([5.0, 13.0, 10.0]))
    cut = [{"surface": "s0-", "kind": "symmetry"}]  # the half with x >= 0 of 6 x 1
    _, half = measured("triangle", 1, "plane_strain", cut)
    assert half.mass == pytest.approx(12.0)
    assert half.inertia == pytest.approx(37.0)


def test_halves_that_turn_against_each_other_do_not_turn_the_whole():
    body, stretches = measured("tetrahedron", 1, "3d", [{"surface": "s0-", "kind": "symmetry"}])
    shear = np.eye(3)
    shear[1, 0] = 0.4  # undone by the mirror image beyond x = 0
    assert look(body, stretches, shear).rotation == pytest.approx(0.0, abs=1e-12)
    about_x = Rotation.from_rotvec([TURN, 0.0, 0.0]).as_matrix()
    assert look(body, stretches, about_x).rotation == pytest.approx(TURN, abs=1e-12)


def test_one_percent_of_the_volume_may_be_strained_more():
    # 400 equal cells along x of 1 m: the four with the largest strains do not count.
    body = system("quadrilateral", 1, (400, 1), lambda s: s * [400.0, 1.0])
    stretches = Stretches(body, solid("plane_strain"))
    x = np.rint(body.positions[:, 0]).astype(int)
    strain = 1e-3 * np.arange(1, 401)
    moved = np.concatenate([[0.0], np.cumsum(strain)])[x]
    seen = stretches.look(np.stack([moved, np.zeros_like(moved)], axis=1).ravel())
    assert seen.strain_max == pytest.approx(0.4)
    assert seen.strain_99 == pytest.approx(0.396)
    known = stretches.look(np.stack([moved, np.zeros_like(moved)], axis=1).ravel(), 0.398)
    assert known.strain_99 == 0.398


@pytest.mark.parallel(2)
@pytest.mark.parametrize("case", CASES[1:3], ids=str)
def test_several_ranks_see_the_same(case):
    from impactfem.fem import MPI

    def bent(s):
        return s * np.array([3.0, 1.0, 2.0][: s.shape[1]]) + 0.1 * np.sin(3 * s[:, ::-1])

    body, stretches = measured(*case, place=bent)
    x = body.positions
    seen = stretches.look((0.1 * np.sin(2 * x[:, ::-1]) * x).ravel(), 0.01)
    values = [seen.rotation, seen.strain_max, seen.strain_99, seen.volume_ratio_min]
    every = MPI.COMM_WORLD.allgather(values)
    parallel_assert(every[0] == every[-1])
    alone = _alone(case, bent)
    parallel_assert(np.allclose(values, alone, rtol=1e-12, atol=1e-13), msg=f"{values} {alone}")


def _alone(case, place):
    from solids import system_on
    from structured import block

    from impactfem.fem import MPI

    cell, degree, model = case
    divisions = (3, 2, 2) if model == "3d" else (4, 3)
    body = system_on(block(cell, degree, divisions, place, comm=MPI.COMM_SELF), model=model)
    stretches = Stretches(body, solid(model))
    x = body.positions
    seen = stretches.look((0.1 * np.sin(2 * x[:, ::-1]) * x).ravel(), 0.01)
    return [seen.rotation, seen.strain_max, seen.strain_99, seen.volume_ratio_min]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_look_that_knows_a_strain_finds_the_same_above_it(case):
    body, stretches = measured(*case)
    moved = (0.1 * np.sin(2 * body.positions[:, ::-1]) * body.positions).ravel()
    whole = stretches.look(moved)
    for known in (0.1, 0.5, 0.999):
        assert stretches.look(moved, known * whole.strain_99) == whole
    beyond = stretches.look(moved, 1.001 * whole.strain_max)
    assert beyond.strain_99 == 1.001 * whole.strain_max
    assert beyond.volume_ratio_min == whole.volume_ratio_min


@pytest.mark.parametrize(("strain", "looks"), [(0.02, 26), (0.045, 51)])
def test_bodies_far_from_the_limits_are_looked_at_half_as_often(strain, looks):
    """A look costs about as much as a layer: 5 % of a run of 800 layers."""
    seen = []

    class Body:
        def look(self, _, known):
            seen.append(known)
            return Look(0.0, strain, strain, 1.0)

    watch = ModelWatch({"body": Body()}, [1], 800, 0)
    for layer in range(801):
        watch(SimpleNamespace(layer=layer, force=np.zeros(1), displacement=np.zeros(1)))
    assert len(seen) == pytest.approx(looks, abs=1)
