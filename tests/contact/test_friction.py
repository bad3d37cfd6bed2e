"""Contact and friction of one layer: the coupled law, its solver, and the energy of the layer."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag
from scipy.optimize import brentq, minimize

from impactfem.contact import friction_solver
from impactfem.contact.cone_kernels import least_solution
from impactfem.contact.friction_kernels import sweep_cones
from impactfem.contact.friction_newton import (
    ConeProblem,
    newton,
)
from impactfem.contact.friction_solver import Solving, _swept, solve_cones
from impactfem.contact.layer_law import Layer, solve_layer
from impactfem.contact.speed_law import Halfway
from impactfem.errors import ConvergenceError

_SEEDS = st.integers(0, 2**32)
_DIMS = st.integers(2, 3)
_MUS = st.floats(0.01, 1.5)
_HOW = Solving.to(1e-15)


def at_speed(free, speed, response, place, friction, dt):
    """Nodes with mass only, without restitution."""
    rows = np.ones(len(free), dtype=bool)
    halfway = Halfway(rows, 0.5 * dt * speed, ~rows)
    before, static = (np.zeros_like(place), place), np.zeros_like(response)
    layer = Layer(free, response, static, before, friction, halfway=halfway)
    return solve_layer(layer, "middle", Solving.to(1e-15))


def _spd(rng, size):
    root = rng.standard_normal((size, size + 2))
    return root @ root.T / size


def _times(matrix, values):
    return (matrix @ values.ravel()).reshape(values.shape)


def _problem(seed, pairs, dim, mu):
    rng = np.random.default_rng(seed)
    friction = np.full(pairs, mu)
    base = np.zeros(pairs)
    return ConeProblem(_spd(rng, pairs * dim), rng.standard_normal((pairs, dim)), friction, base)


def _solved(problem):
    return solve_cones(problem, np.zeros_like(problem.offset), 1e-15, 1000)[0]


def _violation(problem, force):
    """The law in words: forces that push, open or closed, in the cone, and against the slip."""
    place = problem.answers(force)
    normal, tangential, slip = force[:, 0], force[:, 1:], place[:, 1:]
    bound = problem.friction * (problem.base + normal)
    size, speed = np.linalg.norm(tangential, axis=1), np.linalg.norm(slip, axis=1)
    against = tangential * speed[:, None] + bound[:, None] * slip
    return max(
        float(np.max(part))
        for part in (
            -normal, -place[:, 0], np.abs(normal * place[:, 0]), size - bound,
            np.linalg.norm(against, axis=1),
        )
    )  # fmt: skip


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(_SEEDS, st.integers(1, 12), _DIMS, _MUS)
def test_forces_obey_both_laws(seed, pairs, dim, mu):
    problem = _problem(seed, pairs, dim, mu)
    force = _solved(problem)
    scale = 1.0 + np.abs(force).max() + np.abs(problem.answers(force)).max()
    assert _violation(problem, force) <= 1e-10 * scale**2
    is_open = force[:, 0] == 0.0
    assert not force[is_open].any()


@settings(max_examples=25, deadline=None)
@given(_SEEDS, st.integers(1, 4), _DIMS, _MUS)
def test_forces_minimise_the_energy_for_their_bounds(seed, pairs, dim, mu):
    """The convex problem of fixed bounds, given to a general solver."""
    problem = _problem(seed, pairs, dim, mu)
    force = _solved(problem)
    radius = mu * force[:, 0]
    free = np.ones(force.shape, dtype=bool)  # open pairs have no tangential force to choose
    free[radius == 0.0, 1:] = False
    rows = np.flatnonzero(free)
    matrix, offset = problem.matrix[np.ix_(rows, rows)], problem.offset.ravel()[rows]

    def inside(x):
        parts = np.zeros(force.shape)
        parts[free] = x
        size = (parts[:, 1:] ** 2).sum(axis=1)[radius > 0.0]
        return np.concatenate([parts[:, 0], 1.0 - size / radius[radius > 0.0] ** 2])

    def energy(x):
        return 0.5 * x @ matrix @ x + x @ offset

    other = minimize(
        energy, np.zeros(len(rows)), method="SLSQP", jac=lambda x: matrix @ x + offset,
        constraints={"type": "ineq", "fun": inside}, options={"ftol": 1e-13, "maxiter": 300},
    )  # fmt: skip
    mine = energy(force[free])
    assert mine == pytest.approx(other.fun, abs=1e-7 * (1.0 + abs(mine)))


def _candidates(matrix, offset, mu):
    """All solutions of one pair with a slip in the plane, by the cases and a scan of angles."""
    if offset[0] >= 0.0:
        yield np.zeros(3)
    stuck = -np.linalg.solve(matrix, offset)
    if stuck[0] >= 0.0 and np.hypot(*stuck[1:]) <= mu * stuck[0]:
        yield stuck

    def sliding(angle):
        along = np.array([np.cos(angle), np.sin(angle)])
        shape = np.array([1.0, *(mu * along)])
        force = -offset[0] / (matrix[0] @ shape) * shape
        slip = (offset + matrix @ force)[1:]
        return along[0] * slip[1] - along[1] * slip[0], force, along @ slip

    angles = np.linspace(0.0, 2.0 * np.pi, 2001)
    crosses = [sliding(angle)[0] for angle in angles]
    for one, two, low, high in zip(crosses, crosses[1:], angles, angles[1:], strict=False):
        if one * two <= 0.0 and abs(one - two) < 1.0:
            angle = brentq(lambda a: sliding(a)[0], low, high, xtol=1e-14)
            _, force, along_slip = sliding(angle)
            if along_slip <= 0.0 and force[0] >= 0.0:
                yield force


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("mu", [0.1, 0.4, 0.9])
def test_one_pair_agrees_with_a_scan_of_all_directions(seed, mu):
    problem = _problem(seed, 1, 3, mu)
    force = _solved(problem)[0]
    found = list(_candidates(problem.matrix, problem.offset[0], mu))
    assert found
    assert min(np.abs(force - other).max() for other in found) <= 1e-9 * (1.0 + np.abs(force).max())


@settings(max_examples=60, deadline=None)
@given(_SEEDS, st.integers(1, 6), st.floats(0.01, 0.6))
def test_turned_axes_turn_the_forces(seed, pairs, mu):
    """Axes of each pair's plane are turned by another angle: a cone has no corners."""
    problem = _problem(seed, pairs, 3, mu)
    rng = np.random.default_rng(seed)
    turn = np.zeros((3 * pairs, 3 * pairs))
    for j, angle in enumerate(rng.uniform(0.0, 2.0 * np.pi, pairs)):
        c, s = np.cos(angle), np.sin(angle)
        turn[3 * j : 3 * j + 3, 3 * j : 3 * j + 3] = [[1, 0, 0], [0, c, -s], [0, s, c]]
    turned = ConeProblem(
        turn @ problem.matrix @ turn.T, _times(turn, problem.offset), problem.friction, problem.base
    )
    one, two = _times(turn, _solved(problem)), _solved(turned)
    assert two == pytest.approx(one, abs=1e-9 * (1.0 + np.abs(one).max()))


@settings(max_examples=50, deadline=None)
@given(st.floats(0.0, 6.3), st.floats(0.05, 1.0))
def test_a_pair_slips_where_it_is_pushed(angle, mu):
    """Isotropic compliance: slip along the push, whatever its angle, with the right size."""
    along = np.array([np.cos(angle), np.sin(angle)])
    push = 3.0
    problem = ConeProblem(
        np.diag([2.0, 0.5, 0.5]), np.array([[-1.0, *(push * along)]]), np.array([mu]), np.zeros(1)
    )
    slip = problem.answers(_solved(problem))[0, 1:]
    expected = (push - 0.5 * mu * 0.5) * along  # pressed by 1 / 2, held back by mu times it
    assert slip == pytest.approx(expected, abs=1e-12)


def test_sweeps_lead_newton_where_it_does_not_converge_from_rest():
    """Strong coupling and mu = 2: some problems need the convex problems of frozen bounds."""
    failed = 0
    for seed in range(60):
        problem = _problem(seed, 8, 2, 2.0)
        _, missed, _ = newton(problem, np.zeros_like(problem.offset), 1e-15, 1000)
        failed += missed > 1.0
        force = _solved(problem)
        assert _violation(problem, force) <= 1e-10 * (1.0 + np.abs(force).max() ** 2)
    assert failed > 0


@settings(max_examples=30, deadline=None)
@given(_SEEDS, st.integers(1, 6), _DIMS)
def test_frozen_bounds_alone_find_the_forces_for_small_friction(seed, pairs, dim):
    problem = _problem(seed, pairs, dim, 0.05)
    one = _solved(problem)
    other = _swept(problem, np.zeros_like(problem.offset), 200, 0.5)
    assert other == pytest.approx(one, abs=1e-6 * (1.0 + np.abs(one).max()))


def test_a_sweep_keeps_forces_in_their_discs():
    problem = _problem(3, 5, 3, 0.3)
    force = np.zeros((5, 3))
    bound = np.array([0.0, 0.1, 0.2, 5.0, 100.0])
    law = np.ones(5), problem.masters, problem.spins, problem.base
    given = problem.matrix, problem.offset, *law, bound, force, False
    sweeps = sweep_cones(*given, 20000, 1e-14)
    assert sweeps < 20000
    size = np.linalg.norm(force[:, 1:], axis=1)
    assert (size <= bound * (1.0 + 1e-12)).all()
    slip = problem.answers(force)[:, 1:]
    inner = size < bound * (1.0 - 1e-9)
    assert inner.any()
    assert np.abs(slip[inner]).max() <= 1e-10
    against = (slip * force[:, 1:]).sum(axis=1)
    assert against == pytest.approx(-bound * np.linalg.norm(slip, axis=1), abs=1e-10)


def test_no_forces_found_is_an_error_with_its_remedy():
    with pytest.raises(ConvergenceError, match=r"friction_coefficient is 0\.4"):
        solve_cones(_problem(0, 10, 3, 0.4), np.zeros((10, 3)), 1e-15, 1)


def _state(rng, pairs, dim, mu):
    """Forces and places that obey the law at the start of a layer."""
    force, place = rng.standard_normal((2, pairs, dim))
    force[:, 0] = np.maximum(force[:, 0], 0.0)
    place[:, 0] = np.where(force[:, 0] > 0.0, 0.0, np.abs(place[:, 0]))
    size = np.linalg.norm(force[:, 1:], axis=1)
    force[:, 1:] *= (mu * force[:, 0] * rng.random(pairs) / size)[:, None]
    return force, place


def _layer(seed, pairs, dim, mu, rule):
    rng = np.random.default_rng(seed)
    compliance, response = _spd(rng, pairs * dim), _spd(rng, pairs * dim)
    old, place = _state(rng, pairs, dim, mu)
    inside = place - _times(compliance, old)
    free = inside + rng.standard_normal(inside.shape)
    layer = Layer(free, response, compliance, (old, place), np.full(pairs, mu))
    found = solve_layer(layer, rule, _HOW)
    change = free + _times(response, found.force) - inside
    new = found.multiplier
    stored = 0.5 * ((new * _times(compliance, new)).sum() - (old * _times(compliance, old)).sum())
    return found, place, float((found.force * change).sum() + stored)


@settings(max_examples=50, deadline=None)
@given(_SEEDS, st.integers(1, 4), st.integers(1, 4), _DIMS, st.sampled_from([0.0, 0.4]))
def test_what_strikes_elsewhere_changes_nothing(seed, pairs, more, dim, mu):
    rng = np.random.default_rng(seed)
    parts = [(_spd(rng, count * dim), _spd(rng, count * dim)) for count in (pairs, more)]
    states = [_state(rng, count, dim, mu) for count in (pairs, more)]
    free = [place - _times(part[1], old) + rng.standard_normal(old.shape)
            for part, (old, place) in zip(parts, states, strict=True)]  # fmt: skip
    whole = Layer(
        np.concatenate(free), *(block_diag(*each) for each in zip(*parts, strict=True)),
        tuple(np.concatenate(each) for each in zip(*states, strict=True)),
        np.full(pairs + more, mu),
    )  # fmt: skip
    both = solve_layer(whole, "conserving", _HOW)
    part = Layer(free[0], *parts[0], states[0], np.full(pairs, mu))
    alone = solve_layer(part, "conserving", _HOW)
    for name in ("force", "multiplier", "place", "work"):
        assert (getattr(both, name)[:pairs] == getattr(alone, name)).all()


@settings(max_examples=150, deadline=None)
@given(_SEEDS, st.integers(1, 7), _DIMS, _MUS)
def test_conserving_rule_loses_exactly_the_frictional_work(seed, pairs, dim, mu):
    found, before, change = _layer(seed, pairs, dim, mu, "conserving")
    scale = 1.0 + np.abs(found.place).max() * np.abs(found.force).max()
    assert 0.0 <= found.theta <= 1.0
    assert change == pytest.approx(found.work.sum(), abs=1e-12 * pairs * scale)
    assert found.work.max() <= 0.0
    # It is the work of the layer's force along the slip, but where that would give energy.
    own = (found.force[:, 1:] * (found.place - before)[:, 1:]).sum(axis=1)
    assert found.work == pytest.approx(np.minimum(own, 0.0), abs=1e-14 * scale)


@settings(max_examples=100, deadline=None)
@given(_SEEDS, st.integers(1, 7), _DIMS, _MUS)
@example(250062, 1, 2, 1.5)  # theta jumps: on one side the pair opens and energy comes of nothing
def test_dissipative_rule_never_gives_energy(seed, pairs, dim, mu):
    found, _, change = _layer(seed, pairs, dim, mu, "dissipative")
    scale = 1.0 + np.abs(found.place).max() * np.abs(found.force).max()
    assert found.theta >= 0.5
    assert change <= found.work.sum() + 1e-12 * pairs * scale
    assert found.work.max() <= 0.0


@settings(max_examples=100, deadline=None)
@given(_SEEDS, st.integers(1, 7), _DIMS, _MUS, st.sampled_from(["conserving", "dissipative"]))
def test_levels_and_layers_stay_in_the_cone(seed, pairs, dim, mu, rule):
    found, before, _ = _layer(seed, pairs, dim, mu, rule)
    scale = 1.0 + np.abs(found.force).max() + np.abs(found.place).max()
    for forces in (found.multiplier, found.force):
        assert forces[:, 0].min() >= 0.0
        size = np.linalg.norm(forces[:, 1:], axis=1)
        assert (size <= mu * forces[:, 0] + 1e-12 * scale).all()
    assert found.place[:, 0].min() >= -1e-11 * scale
    assert np.abs(found.place[:, 0] * found.multiplier[:, 0]).max() <= 1e-10 * scale**2
    slip = (found.place - before)[:, 1:]
    speed, bound = np.linalg.norm(slip, axis=1), mu * found.multiplier[:, 0]
    against = found.multiplier[:, 1:] * speed[:, None] + bound[:, None] * slip
    assert np.abs(against).max() <= 1e-10 * scale**2


def test_without_friction_nothing_changes_and_no_cone_is_sought(monkeypatch):
    def forbidden(*_):
        raise AssertionError

    monkeypatch.setattr(friction_solver, "solve_cones", forbidden)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        pairs, dim = 5, 2 + seed % 2
        compliance, response = _spd(rng, pairs * dim), _spd(rng, pairs * dim)
        old, place = _state(rng, pairs, dim, 0.0)
        free = rng.standard_normal((pairs, dim))
        how = Solving.to(1e-14)
        layer = Layer(free, response, compliance, (old, place), np.zeros(pairs))
        found = solve_layer(layer, "conserving", how)
        part = np.ix_(range(0, pairs * dim, dim), range(0, pairs * dim, dim))
        normal = Layer(free[:, :1], response[part], compliance[part], (old[:, :1], place[:, :1]))
        expected = solve_layer(normal, "conserving", how)
        scale = 1.0 + np.abs(expected.force).max()
        for name in ("multiplier", "force"):
            one, other = getattr(found, name)[:, :1], getattr(expected, name)
            assert one == pytest.approx(other, abs=1e-13 * scale)
        assert found.theta == pytest.approx(expected.theta, abs=1e-12)
        assert not found.force[:, 1:].any()
        assert not found.work.any()
        velocity = at_speed(free, free, response, place, np.zeros(pairs), 0.1)
        assert not velocity.force[:, 1:].any()


def test_pairs_without_friction_among_others_have_none():
    rng = np.random.default_rng(5)
    compliance, response = _spd(rng, 12), _spd(rng, 12)
    old = np.zeros((4, 3))
    place = np.abs(rng.standard_normal((4, 3)))
    mu = np.array([0.0, 0.5, 0.0, 0.5])
    free = place - 2.0
    layer = Layer(free, response, compliance, (old, place), mu)
    found = solve_layer(layer, "conserving", _HOW)
    assert not found.force[::2, 1:].any()
    assert found.force[1::2, 1:].any()


@settings(max_examples=60, deadline=None)
@given(_SEEDS, st.integers(1, 6), _DIMS, _MUS)
def test_nodes_with_mass_have_their_layer_force_in_the_cone(seed, pairs, dim, mu):
    rng = np.random.default_rng(seed)
    response = _spd(rng, pairs * dim)
    old, place = _state(rng, pairs, dim, mu)
    free = place + rng.standard_normal(place.shape)
    none = np.zeros_like(response)
    layer = Layer(free, response, none, (old, place), np.full(pairs, mu))
    found = solve_layer(layer, "middle", _HOW)
    scale = (1.0 + np.abs(found.force).max() + np.abs(found.place).max()) ** 2
    assert found.force[:, 0] == pytest.approx(0.5 * (old + found.multiplier)[:, 0])
    bound = mu * found.force[:, 0]
    slip = (found.place - place)[:, 1:]
    speed = np.linalg.norm(slip, axis=1)
    assert (np.linalg.norm(found.force[:, 1:], axis=1) <= bound + 1e-12 * scale).all()
    assert found.work == pytest.approx(-bound * speed, abs=1e-10 * scale)
    assert found.place == pytest.approx(free + _times(response, found.force), abs=1e-10 * scale)


@settings(max_examples=60, deadline=None)
@given(_SEEDS, st.integers(1, 6), _DIMS, _MUS)
def test_velocity_rule_acts_against_the_speed_at_the_end(seed, pairs, dim, mu):
    rng = np.random.default_rng(seed)
    response, dt = _spd(rng, pairs * dim), 0.1
    free, speed, place = rng.standard_normal((3, pairs, dim))
    found = at_speed(free, speed, response, place, np.full(pairs, mu), dt)
    end = speed + 2.0 / dt * _times(response, found.force)
    closed = free[:, 0] <= 0.0
    scale = (1.0 + np.abs(end).max()) * (1.0 + np.abs(found.force).max())
    assert not found.force[~closed].any()
    assert found.force[:, 0].min() >= 0.0
    assert end[closed, 0].min(initial=0.0) >= -1e-10 * scale
    assert np.abs(found.force[closed, 0] * end[closed, 0]).max(initial=0.0) <= 1e-10 * scale
    bound = mu * found.force[:, 0]
    against = (found.force[:, 1:] * end[:, 1:]).sum(axis=1)
    assert against == pytest.approx(-bound * np.linalg.norm(end[:, 1:], axis=1), abs=1e-9 * scale)


@given(_SEEDS, st.integers(1, 12), st.data())
@settings(deadline=None, max_examples=30)
def test_of_dependent_rows_the_least_solution_is_taken(seed, count, data):
    rank = data.draw(st.integers(0, count))
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((count, rank)) @ rng.standard_normal((rank, count))
    right = matrix @ rng.standard_normal(count)
    wanted = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
    np.testing.assert_allclose(least_solution(matrix, right), wanted, atol=1e-6)
