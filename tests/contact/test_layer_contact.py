"""Contact of one layer: complementarity, no pulling force, and the energy that theta decides."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from impactfem.contact.complementarity import _murty, solve_by_active_set
from impactfem.contact.friction_solver import Solving
from impactfem.contact.layer_law import Layer, solve_layer, uncoupled
from impactfem.contact.snes_vi import solve_by_snes_vi
from impactfem.contact.speed_law import Halfway, rebound
from impactfem.errors import ConvergenceError

_TOLERANCE = 1e-14


def _spd(rng, size, rank=None):
    root = rng.standard_normal((size, rank or size + 2))
    return root @ root.T / size


_HOW = Solving.to(_TOLERANCE, 200)


def _solved(free, response, compliance, before, rule, halfway=None):
    """A layer without tangential parts: force, multiplier and gap, (pairs,) each, and theta."""
    before = before[0][:, None], before[1][:, None]
    found = solve_layer(
        Layer(free[:, None], response, compliance, before, halfway=halfway), rule, _HOW
    )
    return SimpleNamespace(
        force=found.force[:, 0], multiplier=found.multiplier[:, 0], gap=found.place[:, 0],
        theta=found.theta,
    )  # fmt: skip


def _potential(gap, compliance):
    """V(g) and its multipliers, by the active-set solver."""
    found, _ = solve_by_active_set(_TOLERANCE, 200)(compliance, gap, np.zeros(len(gap), dtype=bool))
    return 0.5 * found @ compliance @ found, found


def _layer(seed, size, rule):
    rng = np.random.default_rng(seed)
    compliance, response = _spd(rng, size), _spd(rng, size)
    gap_a = rng.standard_normal(size)
    before, old = _potential(gap_a, compliance)
    true_a = np.maximum(gap_a + compliance @ old, 0.0)
    free = gap_a + rng.standard_normal(size)
    found = _solved(free, response, compliance, (old, true_a), rule)
    gap_b = free + response @ found.force
    after, _ = _potential(gap_b, compliance)
    work = found.force @ (gap_b - gap_a)
    return found, gap_b + compliance @ found.multiplier, work, before - after


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 12))
def test_conserving_rule_does_exactly_the_work_of_the_potential(seed, size):
    found, gap, work, released = _layer(seed, size, "conserving")
    assert 0.0 <= found.theta <= 1.0
    assert found.force.min() >= 0.0
    assert found.multiplier.min() >= 0.0
    scale = 1.0 + np.abs(gap).max() + np.abs(found.multiplier).max()
    assert gap.min() >= -1e-11 * scale
    assert np.abs(gap * found.multiplier).max() <= 1e-10 * scale**2
    assert gap == pytest.approx(found.gap, abs=1e-10 * scale)
    assert work == pytest.approx(released, abs=1e-11 * scale**2)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 12))
def test_dissipative_rule_never_gives_energy(seed, size):
    found, _, work, released = _layer(seed, size, "dissipative")
    assert found.theta >= 0.5
    assert work <= released + 1e-11 * (1.0 + abs(work))


def test_middle_rule_can_give_energy():
    """The negative control of the two rules above: theta = 1/2 gains at releases."""
    gains = [work - released for _, _, work, released in (
        _layer(seed, 3, "middle") for seed in range(60)
    )]  # fmt: skip
    assert max(gains) > 1e-3


def _beside(one, two, order):
    """Two symmetric matrices as one without entries between them, its rows in an order."""
    both = np.zeros((len(one) + len(two),) * 2)
    both[: len(one), : len(one)], both[len(one) :, len(one) :] = one, two
    return both[np.ix_(order, order)]


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 2**32), st.integers(1, 6), st.integers(1, 6),
    st.sampled_from(["conserving", "dissipative", "middle"]),
)  # fmt: skip
def test_what_strikes_elsewhere_changes_nothing(seed, size, more, rule):
    rng = np.random.default_rng(seed)
    order = rng.permutation(size + more)
    parts = [[_spd(rng, count), _spd(rng, count)] for count in (size, more)]
    states = []
    for (_, compliance), count in zip(parts, (size, more), strict=True):
        gap = rng.standard_normal(count)
        _, old = _potential(gap, compliance)
        states.append(
            (gap + rng.standard_normal(count), old, np.maximum(gap + compliance @ old, 0))
        )
    free, old, gap = (np.concatenate(each)[order] for each in zip(*states, strict=True))
    response, compliance = (_beside(*each, order) for each in zip(*parts, strict=True))
    both = _solved(free, response, compliance, (old, gap), rule)
    mine = np.argsort(order)[:size]
    alone = _solved(states[0][0], *parts[0], states[0][1:], rule)
    for name in ("force", "multiplier", "gap"):
        expected = getattr(alone, name)
        scale = 1.0 + np.abs(expected).max()
        assert getattr(both, name)[mine] == pytest.approx(expected, abs=1e-9 * scale)


def test_rows_are_grouped_by_what_links_them():
    one, two = np.eye(5), np.eye(5)
    assert [rows.tolist() for rows in uncoupled(one, two)] == [[0], [1], [2], [3], [4]]
    one[0, 3] = one[3, 0] = two[3, 4] = two[4, 3] = -1.0
    assert [rows.tolist() for rows in uncoupled(one, two)] == [[0, 3, 4], [1], [2]]
    assert not uncoupled(one, np.ones((5, 5)))
    assert not uncoupled(np.eye(1))


def test_flight_and_lasting_contact_have_theta_one_half():
    compliance = np.array([[2.0, 0.5], [0.5, 1.0]])
    response = np.eye(2)
    pressed = np.linalg.solve(compliance, [1.0, 1.0])
    for free, old, gap in (
        (np.array([1.0, 2.0]), np.zeros(2), np.ones(2)),
        (np.array([-1.5, -1.4]), pressed, np.zeros(2)),
    ):
        found = _solved(free, response, compliance, (old, gap), "conserving")
        assert found.theta == 0.5


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 8))
@example(45223, 4)  # full Newton steps go in circles
def test_snes_vi_finds_the_same_forces(seed, size):
    rng = np.random.default_rng(seed)
    matrix, offset = _spd(rng, size), rng.standard_normal(size)
    nobody = np.zeros(size, dtype=bool)
    one, _ = solve_by_active_set(_TOLERANCE, 200)(matrix, offset, nobody)
    other, _ = solve_by_snes_vi(1e-12, 200)(matrix, offset, nobody)
    assert other == pytest.approx(one, abs=1e-7 * (1.0 + np.abs(one).max()))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 10))
def test_murty_pivots_agree_with_the_active_set_from_any_start(seed, size):
    rng = np.random.default_rng(seed)
    matrix, offset = _spd(rng, size), rng.standard_normal(size)
    one, _ = solve_by_active_set(_TOLERANCE, 200)(matrix, offset, np.zeros(size, dtype=bool))
    other, _ = _murty(matrix, offset, rng.random(size) < 0.5, _TOLERANCE)
    assert other == pytest.approx(one, abs=1e-9 * (1.0 + np.abs(one).max()))


def test_velocity_rule_stops_the_nodes_that_would_penetrate():
    response = np.diag([2.0, 1.0, 1.0])
    free, speed = np.array([-0.1, 0.2, -0.1]), np.array([-1.0, -1.0, 0.5])
    none = np.zeros(3)
    ways = rebound(none, speed, none, 0.05)[:, None]
    halfway = Halfway(np.ones(3, dtype=bool), ways, np.zeros(3, dtype=bool))
    found = _solved(free, response, np.zeros((3, 3)), (none, none), "middle", halfway)
    assert found.force == pytest.approx([1.0 / 40.0, 0.0, 0.0])
    assert found.gap == pytest.approx([-0.05, 0.2, -0.1])


def test_a_singular_set_whose_gaps_contradict_each_other_is_no_solution() -> None:
    # The same direction twice, one wall behind the other: only the nearer one is touched. With both
    # closed the least squares are a force of 2 in place of 3, which leaves a gap of -1.
    solver = solve_by_active_set(1e-12, 50)
    force, _ = solver(np.ones((2, 2)), np.array([-1.0, -3.0]), np.ones(2, dtype=bool))
    assert force == pytest.approx([0.0, 3.0], rel=1e-6, abs=1e-6)


def test_walls_that_overlap_are_refused() -> None:
    # Both walls push the same light body: what opens one gap closes the other.
    matrix = np.array([[1.0, -1.0], [-1.0, 1.0]])
    with pytest.raises(ConvergenceError, match="contact"):
        solve_by_active_set(1e-12, 50)(matrix, np.array([-1.0, -1.0]), np.ones(2, dtype=bool))


def test_a_singular_set_whose_gaps_agree_is_solved() -> None:
    # The same wall twice: each share of the force will do, their sum is known.
    force, _ = solve_by_active_set(1e-12, 50)(np.ones((2, 2)), np.full(2, -3.0), np.ones(2, bool))
    assert force.sum() == pytest.approx(3.0, rel=1e-12)
    assert (force >= 0.0).all()


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 6), st.sampled_from(["conserving", "dissipative"]))
def test_gaps_at_speed_beside_massless_ones_gain_no_energy(seed, size, rule):
    """All laws in one problem: V(g_a) - V(g_b) pays for the work of all forces."""
    rng = np.random.default_rng(seed)
    fast, ends = rng.random((2, size)) < 0.5
    ends &= ~fast
    alone = fast | ends
    response, compliance = _spd(rng, size), _spd(rng, size)
    compliance[alone] = compliance[:, alone] = 0.0
    old = np.where(alone | (rng.random(size) < 0.5), 0.0, rng.random(size))
    gap = np.where(old > 0.0, 0.0, rng.random(size))
    free, dt = gap + rng.standard_normal(size), 0.1
    before = rng.standard_normal(size)
    after = 2.0 / dt * (free - gap) - before  # of nodes with mass: their way is that of the gap
    lively = rng.random(size)
    law = np.where(ends, free, rebound(before, after, lively, 0.5 * dt))
    halfway = Halfway(alone, law[:, None], ends)
    found = _solved(free, response, compliance, (old, gap), rule, halfway)
    scale = 1.0 + np.abs(found.force).max() * np.abs(found.gap).max()
    end = after + 2.0 / dt * (response @ found.force)
    struck = fast & (free <= 0.0)
    rate = (end + np.where(before > 0.0, 1.0, lively) * before)[struck]
    assert rate.min(initial=0.0) >= -1e-9 * scale
    assert np.abs(rate * found.force[struck]).max(initial=0.0) <= 1e-9 * scale
    assert not found.force[fast & ~struck].any()
    work = found.force[fast] @ (0.5 * dt * (before + end))[fast]
    assert work <= 1e-9 * scale
    assert found.gap[ends].min(initial=0.0) >= -1e-9 * scale
    assert np.abs((found.gap * found.force)[ends]).max(initial=0.0) <= 1e-9 * scale
    assert found.force[ends] @ (found.gap - gap)[ends] <= 1e-9 * scale
    slow = ~alone
    way = (found.gap - compliance @ np.where(slow, found.multiplier, 0.0)) - (
        gap - compliance @ old
    )
    stored = [0.5 * m @ compliance @ m for m in (old, np.where(slow, found.multiplier, 0.0))]
    assert found.force[slow] @ way[slow] <= stored[0] - stored[1] + 1e-9 * scale
