"""The solver of contact with friction: dependent forces, islands, moments, against cones."""

from dataclasses import replace

import numpy as np
import pytest

from impactfem.contact.friction_newton import ConeProblem, residual
from impactfem.contact.friction_solver import solve_cones


def bodies(seed, contacts, count, mu, ratio=1.0):
    """Contacts between few rigid bodies in space: far more forces than motions."""
    rng = np.random.default_rng(seed)
    maps = np.zeros((3 * contacts, 6 * count))
    for k in range(contacts):
        frame = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        frame[0] *= np.sign(frame[0, 1])
        one = int(rng.integers(count))
        for body, sign in ((one, 1.0), (int(rng.integers(-1, one)), -1.0)):
            if body >= 0:
                arms = np.cross(rng.standard_normal(3), frame)
                own = slice(6 * body, 6 * body + 6)
                maps[3 * k : 3 * k + 3, own] = sign * np.hstack([frame, arms])
    light = np.repeat(ratio ** rng.uniform(-1.0, 0.0, count), 6)
    matrix = (maps * light) @ maps.T
    falls = np.tile([0.0, -1.0, 0.0, 0.0, 0.0, 0.0], count) + 0.2 * rng.standard_normal(6 * count)
    none = np.zeros(contacts)
    offset = (maps @ falls).reshape(contacts, 3)
    return ConeProblem(0.5 * (matrix + matrix.T), offset, none + mu, none)


def solved(problem):
    return solve_cones(problem, np.zeros_like(problem.offset), 1e-16, 4000)[0]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("mu", "ratio"), [(0.4, 1.0), (2.0, 1.0), (0.4, 1e6)])
def test_forces_that_depend_on_each_other_obey_the_law(seed, mu, ratio):
    problem = bodies(seed, 18, 3, mu, ratio)
    assert np.linalg.matrix_rank(problem.matrix) <= 18
    force = solved(problem)
    assert residual(problem, force) <= 1e-12
    assert (force[:, 0] >= 0.0).all()
    assert (problem.answers(force)[:, 0] >= -1e-9).all()


def test_islands_are_solved_apart():
    one, two = bodies(1, 5, 1, 0.5), bodies(2, 6, 1, 0.5)
    matrix = np.zeros((33, 33))
    matrix[:15, :15], matrix[15:, 15:] = one.matrix, two.matrix
    both = ConeProblem(matrix, np.vstack([one.offset, two.offset]), np.full(11, 0.5), np.zeros(11))
    np.testing.assert_array_equal(solved(both), np.vstack([solved(one), solved(two)]))


def test_moments_stay_within_what_presses_them():
    """A ball on a floor in units of its radius and mass: force, then moment, in one problem."""
    whirl = np.diag([0.0, 1.0, 1.0])
    turn = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    matrix = np.block([[np.eye(3) + 2.5 * whirl, 2.5 * turn], [2.5 * turn.T, 2.5 * np.eye(3)]])
    offset = np.array([[-1.0, 0.0, 0.0], [3.0, 2.0, -1.0]])  # rolls and spins
    problem = ConeProblem(
        matrix, offset, np.array([0.5, 0.02]), np.zeros(2), np.array([0, 0]), np.array([0.0, 0.05])
    )
    force = solved(problem)
    answer = problem.answers(force)
    assert force[0, 0] == pytest.approx(1.0)
    assert force[1, 0] == pytest.approx(-0.05)
    assert np.linalg.norm(force[1, 1:]) == pytest.approx(0.02)
    across = force[1, 1] * answer[1, 2] - force[1, 2] * answer[1, 1]
    assert across == pytest.approx(0.0, abs=1e-12)
    assert force[1, 1:] @ answer[1, 1:] < 0.0
    free = solved(replace(problem, offset=np.abs(offset)))
    assert not free.any()


def test_velocities_are_those_of_second_order_cones():
    """The law is a convex problem once the slip is known: Clarabel finds the same motion."""
    solver = pytest.importorskip("clarabel")
    from scipy.sparse import csc_matrix, triu

    problem = bodies(4, 8, 2, 0.4)
    mine = problem.answers(solved(problem))
    offset = problem.offset.copy()
    offset[:, 0] += 0.4 * np.linalg.norm(mine[:, 1:], axis=1)
    cones = -np.diag(np.tile([0.4, 1.0, 1.0], 8))
    settings = solver.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    found = solver.DefaultSolver(
        triu(csc_matrix(problem.matrix), format="csc"), offset.ravel(), csc_matrix(cones),
        np.zeros(24), [solver.SecondOrderConeT(3)] * 8, settings,
    ).solve()  # fmt: skip
    other = problem.answers(np.array(found.x).reshape(8, 3))
    assert other == pytest.approx(mine, abs=1e-5)
