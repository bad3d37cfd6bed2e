"""The active set on small problems whose solution is known otherwise."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactfem.contact.active_set import primal_dual_active_set


def complementarity(matrix, load):
    """gap = M^{-1} (load - multiplier), gap >= 0, multiplier <= 0: an obstacle problem."""

    def solve(active):
        size = len(load)
        # [M I; selection] (gap, multiplier) = (load, 0)
        left = np.block([[matrix, np.eye(size)], [np.diag(active), np.diag(~active)]]).astype(float)
        both = np.linalg.solve(left, np.concatenate([load, np.zeros(size)]))
        return both[:size], both[size:]

    return solve


def by_enumeration(solve, size):
    """Try every set; an M-matrix has exactly one solution."""
    for chosen in itertools.product([False, True], repeat=size):
        gap, multiplier = solve(np.array(chosen))
        if gap.min() >= -1e-10 and multiplier.max() <= 1e-10:
            return gap, multiplier
    raise AssertionError("no set solves the problem")


@st.composite
def problems(draw):
    size = draw(st.integers(1, 6))
    numbers = st.floats(-1, 1, allow_nan=False)
    coupling = np.array(draw(st.lists(numbers, min_size=size * size, max_size=size * size)))
    matrix = -np.abs(coupling.reshape(size, size))
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, 0.5 - matrix.sum(axis=1))  # diagonally dominant: an M-matrix
    load = np.array(draw(st.lists(st.floats(-2, 2), min_size=size, max_size=size)))
    return matrix, load


@given(problems(), st.sampled_from([1e-3, 1.0, 1e3]))
def test_finds_the_solution_of_an_obstacle_problem(problem, gamma):
    matrix, load = problem
    solve = complementarity(matrix, load)
    gap, multiplier = by_enumeration(solve, len(load))
    result = primal_dual_active_set(
        solve, len(load), gamma=gamma, tolerance=1e-12, max_iterations=100
    )
    assert result.converged
    assert result.set_changes[-1] == 0
    assert len(result.set_changes) == result.iterations
    assert result.gap == pytest.approx(gap, abs=1e-8)
    assert result.multiplier == pytest.approx(multiplier, abs=1e-8)


def test_a_cycle_is_recognised_and_said():
    # A P-matrix fails here on purpose: each set calls for the other one.
    def solve(active):
        return (np.array([1.0]), np.array([0.0])) if active[0] else (np.array([-1.0]), np.zeros(1))

    result = primal_dual_active_set(solve, 1, gamma=1.0, tolerance=0.0, max_iterations=50)
    assert not result.converged
    assert result.iterations == 2
    assert "cycle with period 2" in result.message


def test_the_iteration_limit_is_kept_and_said():
    count = itertools.count(1)

    def solve(active):
        gap = np.ones(8)
        gap[[int(b) for b in f"{next(count):08b}"].index(1) :] = -1.0
        return gap + 2.0 * active, np.zeros(8)

    result = primal_dual_active_set(solve, 8, gamma=1.0, tolerance=0.0, max_iterations=1)
    assert result.iterations == 1
    assert "after 1 iterations" in result.message


def test_numbers_that_are_not_finite_stop_the_iteration():
    def solve(_):
        return np.array([np.nan]), np.array([0.0])

    result = primal_dual_active_set(solve, 1, gamma=1.0, tolerance=0.0, max_iterations=50)
    assert not result.converged
    assert "finite" in result.message


def test_rounding_does_not_move_a_degenerate_pair():
    def solve(active):
        return np.array([-1e-15]), np.where(active, 1e-15, 0.0)

    result = primal_dual_active_set(solve, 1, gamma=1.0, tolerance=1e-12, max_iterations=50)
    assert result.converged
    assert not result.active[0]


def test_a_pressed_pair_stays_where_its_gap_is_rounding():
    """One threshold for joining and leaving would let a pair that just lies there alternate."""
    rounding = 1e-15

    def solve(active):
        gap = np.where(active, 0.0, -2.0 * rounding)  # free, it lies in the obstacle by rounding
        return gap, np.where(active, -rounding, 0.0)  # pressed by as little

    for start, expected in (([True], True), ([False], False)):
        result = primal_dual_active_set(
            solve, 1, gamma=1.0, tolerance=1e-12, max_iterations=10, start=np.array(start)
        )
        assert result.converged
        assert result.iterations == 1
        assert result.active.tolist() == [expected]
