"""Solids that rub keep momentum and lose the frictional work, no more, on any number of ranks."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rubbing import oblique, thrown, work
from solid_pairs import velocity

import impactfem
import impactfem.models.solids
import impactfem.runs.loops
from impactfem.errors import SceneError


def momenta(result):
    """Momentum of both blocks of `oblique` [N s], (2, layers)."""
    history = result.history
    return np.array(
        [0.5 * history[f"low.v{a}"].values + 0.48 * history[f"top.v{a}"].values for a in "xy"]
    )


@pytest.mark.parametrize("normals", ["fixed", "updated"])
@pytest.mark.parametrize("method", ["conserving", "massless", "explicit", "moreau_jean"])
def test_bodies_that_rub_keep_their_momentum(method, normals):
    result = impactfem.solve(oblique(0.3, method, normals))
    both = momenta(result)
    assert np.abs(both - both[:, :1]).max() < 1e-10 * 0.48 * 0.05
    # Friction acted: without it the struck block would not move sideways.
    assert velocity(result, "low")[0] > 0.1 * 0.05


def angular_momenta(result, *, moved):
    """Of both blocks of `oblique` about the origin, at undeformed places [N m s], (fields,).

    Args:
        result: With fields.
        moved: Whether the mass of contact nodes is where massless methods put it: at the mean of
            their neighbours inside.
    """
    fields, cells = result.fields, result.fields.cells
    points = fields.points[:, :2].copy()
    first = fields.read(0, "velocity", "gap")
    one, two = (points[cells[:, k]] - points[cells[:, 0]] for k in (1, 2))
    mass = 0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    mass[np.abs(first["velocity"][cells]).max(axis=(1, 2)) > 1e-9] *= 2.0  # the upper block
    consistent = (np.ones((3, 3)) + np.eye(3)) / 12.0
    contact = np.isfinite(first["gap"])
    inner = {}
    for node in np.flatnonzero(contact & moved):
        near = cells[(cells == node).any(axis=1)].ravel()
        inner[node] = near[~contact[near]]
        points[node] = points[inner[node]].mean(axis=0)
    found = []
    for layer in range(len(fields)):
        speed = fields.read(layer, "velocity")["velocity"][:, :2].copy()
        for node, near in inner.items():
            speed[node] = speed[near].mean(axis=0)
        place, way = points[cells], speed[cells]
        arms = np.einsum("e,ij,eia,ejb->ab", mass, consistent, place, way)
        found.append(arms[0, 1] - arms[1, 0])
    return np.array(found)


@pytest.mark.parametrize("gap", [0.0, 0.01])
@pytest.mark.parametrize("method", ["conserving", "massless", "moreau_jean"])
def test_bodies_that_rub_keep_their_angular_momentum(method, gap):
    """But for the arm of friction over the gap of t = 0, across which bodies of fixed pairs rub."""
    case = oblique(0.3, method).with_settings(
        {"output.fields": ["vtkhdf"], "output.every": 1, "body.top.shape.corner": [0.1, 0.5 + gap]}
    )
    result = impactfem.solve(case)
    spin = angular_momenta(result, moved=method != "moreau_jean")
    pushed_along = 0.5 * result.history["low.vx"].values
    assert pushed_along[-1] > 0.1 * 0.48 * 0.05
    assert np.abs(spin - spin[0] - gap * pushed_along).max() < 1e-10 * abs(spin[0])


def test_energy_of_bodies_falls_by_the_frictional_work():
    energy = (result := impactfem.solve(oblique(0.3))).history["total_energy"].values
    assert work(result) < -0.01 * energy[0]
    assert energy[-1] - energy[0] == pytest.approx(work(result), abs=1e-8 * energy[0])
    assert np.diff(energy).max() <= 1e-12 * energy[0]


@settings(max_examples=6, deadline=None)
@given(
    st.sampled_from(["conserving", "massless"]), st.floats(0.02, 1.2), st.floats(-0.1, 0.1),
    st.floats(-0.1, -0.01),
)  # fmt: skip
def test_a_thrown_block_obeys_the_cone_and_loses_the_frictional_work(method, mu, along, down):
    result = impactfem.solve(thrown(mu, (along, down), method))
    history, dt = result.history, result.summary["details"]["dt"]
    energy, force = history["total_energy"].values, history["contact_force"].values
    assert force.max() > 0.0
    assert force.min() >= 0.0
    assert np.nanmin(history["gap"].values) >= -1e-12
    drag = 0.5 * np.diff(history["block.vx"].values) / dt
    assert (np.abs(drag) <= mu * force[1:] + 1e-11).all()
    scale = np.abs(energy).max()
    assert np.diff(energy).max() <= 1e-12 * scale
    lost = energy[-1] - energy[0] - work(result)
    assert lost <= 1e-10 * scale
    if method == "conserving":
        assert lost >= -1e-10 * scale


def test_explicit_layers_lose_the_frictional_work():
    result = impactfem.solve(thrown(0.4, (0.1, -0.05), "explicit", height=0.03))
    history = result.history
    # Energies belong to the middle of layers. In flight at both ends nothing is cut in half; the
    # first one starts g^2 dt^2 m / 8 low.
    force = history["contact_force"].values
    assert not force[:3].any()
    assert not force[-3:].any()
    energy = history["total_energy"].values
    assert work(result) < -0.05 * energy[1]
    assert energy[-1] - energy[1] == pytest.approx(work(result), abs=1e-10 * energy[1])


def test_coefficient_zero_takes_the_path_without_friction(monkeypatch):
    def never(*_):
        raise AssertionError("a march with friction was made")

    monkeypatch.setattr(impactfem.runs.loops, "RubbingMarch", never)
    zero, absent = (impactfem.solve(oblique(mu)) for mu in (0.0, None))
    for name in absent.history.data_vars:
        assert np.array_equal(zero.history[name], absent.history[name], equal_nan=True), name
    assert zero.summary["num_dofs"] == absent.summary["num_dofs"]
    assert work(zero) == 0.0


def test_a_trace_of_friction_is_next_to_none():
    """The march with friction tends to the one without."""
    none, trace = (impactfem.solve(oblique(mu)) for mu in (0.0, 1e-10))
    assert work(trace) < 0.0
    for name in ("low.vx", "low.vy", "top.vx", "total_energy", "contact_force"):
        assert trace.history[name].values == pytest.approx(none.history[name].values, abs=1e-9)


def forget_models():
    """Have the next run mesh anew."""
    for kept in vars(impactfem.models.solids).values():
        if hasattr(kept, "cache_clear"):
            kept.cache_clear()


@pytest.mark.parallel(2)
def test_two_ranks_agree_with_one(monkeypatch):
    from impactfem.fem import MPI

    scenes = oblique(0.3), oblique(0.3, normals="updated"), thrown(0.4, (0.1, -0.05))
    shared = [impactfem.solve(scene) for scene in scenes]
    own = SimpleNamespace(COMM_WORLD=MPI.COMM_SELF, MAX=MPI.MAX)
    monkeypatch.setattr(impactfem.models.solids, "MPI", own)
    forget_models()
    alone = [impactfem.solve(scene) for scene in scenes]
    forget_models()
    for one, two in zip(alone, shared, strict=True):
        assert work(one) < 0.0
        assert work(two) == pytest.approx(work(one), rel=1e-10)
        for name in one.history.data_vars:
            a, b = one.history[name].values, two.history[name].values
            scale = max(float(np.nanmax(np.abs(a))), 0.05)
            assert b == pytest.approx(a, abs=1e-10 * scale, nan_ok=True), name


@pytest.mark.parametrize("mu", [-0.1, math.inf, -math.inf, math.nan])
def test_impossible_coefficients_are_refused(mu):
    with pytest.raises(SceneError, match=r"friction_coefficient = .* >= 0"):
        thrown(mu, (0.1, -0.05))
