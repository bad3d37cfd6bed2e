"""Gaps whose directions turn with a patch: forces without sum and moment, blind to rigid motion."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from impactfem.contact.turning_gaps import TurningGaps


def cloud(dim, seed=3):
    """Places of ten nodes, weights of four gaps between the first and the last five, patches."""
    random = np.random.default_rng(seed)
    places = random.standard_normal((10, dim))
    patch, other = random.random((2, 4, 5))
    patch /= patch.sum(axis=1, keepdims=True)
    other /= other.sum(axis=1, keepdims=True)
    weights = np.hstack([patch, -other])
    patches = np.hstack([patch, np.zeros_like(other)])
    return places, weights, csr_matrix(patches)


def moment(places, forces):
    turned = places.T @ forces
    return turned - turned.T


@pytest.mark.parametrize("dim", [2, 3])
def test_forces_in_any_direction_have_neither_sum_nor_moment(dim):
    places, weights, patches = cloud(dim)
    turning = TurningGaps.of([(0, patches)], places, weights @ places)
    forces = np.random.default_rng(5).standard_normal((4, dim))
    nodal = weights.T @ forces - turning.spread(forces)
    assert np.abs(nodal.sum(axis=0)).max() <= 1e-13
    assert np.abs(moment(places, nodal)).max() <= 1e-12
    assert np.abs(moment(places, weights.T @ forces)).max() > 0.1  # without it


@pytest.mark.parametrize("dim", [2, 3])
def test_rigid_motions_change_no_way_and_both_maps_are_transposed(dim):
    places, weights, patches = cloud(dim)
    turning = TurningGaps.of([(0, patches)], places, weights @ places)
    random = np.random.default_rng(7)
    spin = random.standard_normal((dim, dim))
    rigid = places @ (spin - spin.T) + random.standard_normal(dim)
    assert np.abs(weights @ rigid - turning.relative(rigid)).max() <= 1e-13
    moved, forces = random.standard_normal((10, dim)), random.standard_normal((4, dim))
    assert np.sum(forces * turning.relative(moved)) == pytest.approx(
        np.sum(turning.spread(forces) * moved), rel=1e-12
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_patches_that_tell_no_spin_turn_nothing(dim):
    places, weights, _ = cloud(dim)
    single = np.zeros((4, 10))
    single[:, 0] = 1.0  # one node
    turning = TurningGaps.of([(0, csr_matrix(single))], places, weights @ places)
    assert not turning.relative(np.ones((10, dim))).any()
    assert TurningGaps.of([], places, weights @ places) is None
