"""Axes that cross others between nodes: least distances, forces without moment, and no jumps."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from impactfem.contact.ball_pairs import BallPair, Target
from impactfem.contact.convex_nodes import CornersOnFaces, NodesOnConvex, nearest
from impactfem.contact.convex_pairs import Marked
from impactfem.contact.crossings import AxisPair
from impactfem.system.convex import Convex

COUNT, THICK = 6, 0.02
BOX = Convex.of(np.array(list(np.ndindex(2, 2, 2))) * [0.2, 0.3, 0.1] - [0.1, 0.15, 0.05])
SHAPES = {
    "box": BOX,
    "wedge": Convex.of(np.array([[0, 0, 0], [0.3, 0, 0], [0.1, 0.3, 0], [0.1, 0.1, 0.2]]) - 0.1),
    "capsule": Convex.of(np.array([[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0]]), 0.03),
}  # fmt: skip


def chain(first, count=COUNT):
    """The axis of a beam among all contact nodes."""
    lines = np.arange(count - 1)[:, None] + [0, 1]
    return Target.of_axis(first + np.arange(count), lines, np.full(count, THICK))


def bent(random, axis, count=COUNT):
    """Nodes of a bent axis through about the origin."""
    s = np.linspace(-0.5, 0.5, count)
    bend = 0.03 * random.normal(size=3)
    turn = Rotation.align_vectors([axis], [[1.0, 0.0, 0.0]])[0].as_matrix()
    return np.stack([s, bend[0] * s**2, bend[1] * s**3 + bend[2] * s**2], axis=1) @ turn.T


def curve(nodes):
    """Many places of the curve whose slopes are those between neighbours."""
    if len(nodes) == 2:
        return nodes[0] + np.linspace(0.0, 1.0, 801)[:, None] * (nodes[1] - nodes[0])
    slopes = np.gradient(nodes, axis=0, edge_order=2)
    return CubicHermiteSpline(np.arange(len(nodes)), nodes, slopes)(
        np.linspace(0.0, len(nodes) - 1.0, 801)
    )


def two_chains(count=COUNT):
    one, two, total = chain(0), chain(COUNT, count), COUNT + count
    ends = BallPair(one.nodes, one.radius, two, total)
    others = BallPair(two.nodes, two.radius, one, total)
    return AxisPair(one, two, ends, others)


def chain_and(shape):
    one, markers = chain(0), 4 + 3 * shape.rounds
    body = Marked(shape, COUNT + np.arange(markers), 0.1, 3)
    total = COUNT + markers
    on_body = NodesOnConvex(one, body, total)
    return AxisPair(one, body, on_body, CornersOnFaces.of(body, one, total))


def pose(pair, nodes, centre, turn):
    markers = len(pair.other.nodes)
    arms = np.vstack([np.zeros(3), 0.1 * turn.T, np.zeros((markers - 4, 3))])
    return np.vstack([nodes, centre + arms])


@pytest.mark.parametrize("count", [2, 3, 7])
def test_the_least_gap_of_two_axes_is_their_distance(count):
    random, pair = np.random.default_rng(count), two_chains(count)
    crossed = 0
    for _ in range(40):
        axis = Rotation.random(random_state=random).apply([1.0, 0.0, 0.0])
        one, two = bent(random, [1.0, 0.0, 0.0]), bent(random, axis, count)
        two += 0.1 * np.cross([1.0, 0.0, 0.0], axis) + 0.2 * random.normal(size=3)
        places = np.vstack([one, two])
        met = pair(places, places)
        if (known := cdist(curve(one), curve(two)).min()) < THICK:
            continue  # one would have gone through the other
        found = np.argmin(met.gap)
        # Nodes are held off chords, which lie beside curves a little; crossings off curves.
        crossed += found >= COUNT + count
        slack = 1e-5 if found >= COUNT + count else 0.05 / (min(count, COUNT) - 1) ** 2
        assert met.gap[found] == pytest.approx(known - 2 * THICK, abs=slack)
    assert crossed > 10


@pytest.mark.parametrize("name", SHAPES)
def test_the_least_gap_of_an_axis_and_a_body_is_their_distance(name):
    random, shape = np.random.default_rng(3), SHAPES[name]
    pair, crossed = chain_and(shape), 0
    for _ in range(60):
        nodes = bent(random, [1.0, 0.0, 0.0])
        turn, centre = Rotation.random(random_state=random).as_matrix(), random.normal(size=3)
        centre *= 0.3 / np.linalg.norm(centre)
        known = nearest(shape, (curve(nodes) - centre) @ turn)[0].min() - THICK
        if known < -0.5 * THICK:
            continue
        places = pose(pair, nodes, centre, turn)
        met = pair(places, places)
        found = np.argmin(met.gap)
        moving = found >= pair.ends.count + pair.others.count
        crossed += moving
        # Corners are held off chords.
        assert met.gap[found] == pytest.approx(known, abs=1e-5 if moving else 2e-3)
    assert crossed > 8


@pytest.mark.parametrize("name", ["axis", *SHAPES])
def test_forces_have_no_sum_and_no_moment(name):
    random = np.random.default_rng(5)
    nodes, turn = bent(random, [1.0, 0.0, 0.0]), Rotation.from_rotvec([0.2, 0.7, 0.9]).as_matrix()
    if name == "axis":
        pair = two_chains()
        places = np.vstack(
            [nodes, bent(random, [0.3, 1.0, 0.1]) + np.array([0.03, 0.02, 2.1 * THICK])]
        )
        told = places
    else:
        pair, shape = chain_and(SHAPES[name]), SHAPES[name]
        lowest = (shape.vertices @ turn.T)[:, 2].min() - shape.radius
        places = pose(pair, nodes, np.array([0.03, 0.05, THICK - lowest]), turn)
        told = places.copy()
        told[COUNT:] += pair.other.arms
    met = pair(places, places)
    there = np.flatnonzero(met.gap < 1e9)
    assert there[-1] >= pair.ends.count + pair.others.count
    weights = met.weights[there]
    np.testing.assert_allclose(weights.sum(axis=1), 0.0, atol=1e-12)
    ways = weights @ told
    np.testing.assert_allclose(np.cross(ways, met.normal[there]), 0.0, atol=1e-12)
    assert (np.einsum("gd,gd->g", ways, met.normal[there]) > 0.0).all()


@pytest.mark.parametrize("name", ["axis", "box"])
def test_what_slides_over_nodes_has_a_force_without_jumps(name):
    """A bent axis that slides along itself: force on all nodes, and gap, step by step."""
    s = np.linspace(-0.5, 0.5, COUNT)
    nodes = np.stack([s, 0.03 * s**2, 0.05 * s**2], axis=1)  # its lowest place is amid it
    turn = Rotation.from_rotvec([0.0, 0.0, 0.7]) * Rotation.from_rotvec([0.0, 0.8, 0.0])
    if name == "axis":
        pair = two_chains()
        other = np.stack([0.2 * s, s, -0.05 * s**2 - 2.0 * THICK], axis=1)
    else:
        pair = chain_and(BOX)
        top = (BOX.vertices @ turn.as_matrix().T)[:, 2].max()
        other = pose(pair, nodes, np.array([0.0, 0.0, -THICK - top]), turn.as_matrix())[COUNT:]
    forces, gaps, step = [], [], 1e-3
    for moved in np.arange(-0.15, 0.15, step):
        places = np.vstack([nodes + (moved + 1e-5) * np.eye(3)[0], other])
        met = pair(places, places)
        row = np.argmin(met.gap)
        assert row >= pair.ends.count + pair.others.count
        forces.append(met.weights[[row]].T @ met.normal[[row]])
        gaps.append(met.gap[row])
    changes = np.abs(np.diff(forces, axis=0)).max(axis=(1, 2))
    assert changes.max() < 15.0 * step
    # By the middle slopes of a parabola .1 s (all other slopes are gaps of second order).
    slopes = np.diff(gaps) / step
    assert np.abs(np.diff(slopes)).max() < 0.3 * step


@pytest.mark.parametrize("at", [0.0, 0.1])
@pytest.mark.parametrize("other", [0.0, 0.1])
@pytest.mark.parametrize("angle", [0.03, 0.4, 1.2])
def test_axes_that_cross_at_nodes_touch_once(at, other, angle):
    """At a node, that is at 0.1, of one axis, of both, or of none."""
    s, way = np.linspace(-0.5, 0.5, COUNT), np.array([np.cos(angle), np.sin(angle), 0.0])
    one = np.outer(s - at, np.eye(3)[0])
    two = np.outer(s - other, way) - 2.0 * THICK * np.eye(3)[2]
    met = two_chains()(places := np.vstack([one, two]), places)
    assert (met.gap < 1e-9).sum() == 1
