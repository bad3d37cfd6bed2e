"""Forces of many contacts, answers by their roots: the law as it is checked of arrays."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from impactfem.contact.friction_many import RESIDUAL, Accuracy, Many
from impactfem.contact.friction_newton import ConeProblem, residual
from impactfem.contact.friction_solutions import dependent
from impactfem.contact.friction_solver import solve_cones
from impactfem.contact.rooted import Rooted, among, full, own_blocks


def heap(seed, side, levels, mu, jolt=0.1):
    """Spheres of unit mass and radius on a lattice that is no more than touching, with weights."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 2, np.arange(levels)), axis=-1).reshape(-1, 3)
    places = 2.0 * grid + rng.uniform(-0.1, 0.1, grid.shape)
    gaps = np.linalg.norm(places[:, None] - places, axis=2)
    pairs = [(i, j) for i, j in np.argwhere(gaps < 2.15) if i < j]
    pairs += [(i, -1) for i in np.flatnonzero(grid[:, 2] == 0)]
    rows, columns, values = [], [], []
    for k, (i, j) in enumerate(pairs):
        normal = np.array([0.0, 0.0, 1.0]) if j < 0 else places[i] - places[j]
        normal = normal / np.linalg.norm(normal)
        first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        first /= np.linalg.norm(first)
        for c, way in enumerate((normal, first, np.cross(normal, first))):
            for body, sign in ((i, 1.0), (j, -1.0)):
                if body < 0:
                    continue
                turn = np.sqrt(2.5) * np.cross(-normal, way)
                rows += [3 * k + c] * 6
                columns += range(6 * body, 6 * body + 6)
                values += [*(sign * way), *turn]
    roots = csr_matrix((values, (rows, columns)), shape=(3 * len(pairs), 6 * len(places)))
    motion = jolt * rng.standard_normal((len(places), 6))
    motion[:, 2] -= 1.0
    offset = (roots @ motion.ravel()).reshape(-1, 3)
    none = np.zeros(len(pairs))
    return ConeProblem(Rooted(roots), offset, none + mu, none)


def test_rooted_answers_are_those_of_the_array():
    problem, rng = heap(0, 3, 2, 0.3), np.random.default_rng(1)
    matrix, force = full(problem.matrix), rng.standard_normal(problem.offset.shape)
    assert len(matrix) > 60
    np.testing.assert_allclose(problem.matrix @ force.ravel(), matrix @ force.ravel(), atol=1e-12)
    np.testing.assert_allclose(problem.matrix.diagonal(), np.diag(matrix), atol=1e-12)
    np.testing.assert_allclose(own_blocks(problem.matrix, 3), own_blocks(matrix, 3), atol=1e-12)
    np.testing.assert_allclose(full(np.float64(0.3) * problem.matrix), 0.3 * matrix, atol=1e-12)
    some = np.arange(3, 12)
    np.testing.assert_allclose(full(among(problem.matrix, some)), among(matrix, some), atol=1e-12)


@pytest.mark.parametrize(("seed", "mu"), [(0, 0.3), (1, 0.7), (2, 0.0)])
def test_forces_of_a_heap_obey_the_law(seed, mu):
    problem, accuracy = heap(seed, 5, 3, mu), Accuracy()
    assert len(problem.offset) > 100
    force, _ = solve_cones(problem, np.zeros_like(problem.offset), 1e-16, 4000, accuracy)
    dense = replace(problem, matrix=full(problem.matrix))
    assert residual(dense, force) <= RESIDUAL
    assert accuracy.reached <= RESIDUAL


@pytest.mark.parametrize("asked", [1e-2, 1e-4, 1e-6])
def test_what_is_asked_is_reached(asked):
    problem, accuracy = heap(3, 5, 3, 0.5), Accuracy(asked)
    force, _ = solve_cones(problem, np.zeros_like(problem.offset), 1e-16, 4000, accuracy)
    dense = replace(problem, matrix=full(problem.matrix))
    left = residual(dense, force)
    assert 0.0 < left <= asked
    assert accuracy.reached == pytest.approx(left, rel=1e-6)


def test_steps_of_newton_find_what_sweeps_leave():
    problem = heap(4, 5, 3, 0.5)
    many = Many(problem, 1e-16)
    start, wrong = many.swept(np.zeros_like(problem.offset), Accuracy(1e-2))
    assert not wrong.any()
    found, left, systems = many.polished(start, 1e-12, 400)
    assert many.residual(start) > 1e-4
    assert left <= 1e-12
    assert systems > 2
    assert left == pytest.approx(many.residual(found))


def test_islands_are_those_of_the_array():
    one, two = heap(5, 2, 2, 0.3), heap(6, 2, 1, 0.3)
    a, b = one.matrix.roots, two.matrix.roots
    apart = csr_matrix((a.shape[0], b.shape[1])), csr_matrix((b.shape[0], a.shape[1]))
    from scipy.sparse import bmat

    matrix = Rooted(csr_matrix(bmat([[a, apart[0]], [apart[1], b]])))
    offset = np.vstack([one.offset, two.offset])
    none = np.zeros(len(offset))
    both = ConeProblem(matrix, offset, none + 0.3, none)
    found = both.islands()
    expected = replace(both, matrix=full(matrix)).islands()
    key = sorted(map(tuple, found))
    assert len(found) > 1
    assert key == sorted(map(tuple, expected))


def test_forces_that_change_no_motion_are_seen_by_roots_too():
    problem = heap(7, 2, 2, 0.5, jolt=0.0)
    force, _ = solve_cones(problem, np.zeros_like(problem.offset), 1e-16, 4000)
    dense = replace(problem, matrix=full(problem.matrix))
    assert dependent(problem, force).shape == dependent(dense, force).shape
