"""Layered space-time meshes: nodes, layers, boundaries, diagonals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.fem import MPI, cell_nodes
from impactfem.mesh.spacetime import BOUNDARIES, find_layers, finish, layered_mesh, nearest

TAGS = {"start": 1, "end": 2, "wall": 3, "far": 4}


@pytest.mark.parametrize(
    ("elements", "layers", "courant"), [(2, 1, 1.0), (10, 50, 1.0), (7, 3, 0.3), (40, 7, 1 / 3)]
)
@pytest.mark.parametrize("diagonal", ["outgoing", "incoming"])
def test_nodes_lie_exactly_on_layers(elements, layers, courant, diagonal):
    space = layered_mesh(MPI.COMM_SELF, elements, layers, courant, diagonal)
    x, layout = space.mesh.geometry.x, space.layout
    assert len(x) == layout.num_nodes == (elements + 1) * (layers + 1)
    assert len(layout.times) == layers + 1
    assert len(layout.nodes) == elements + 1
    assert layout.times[0] == layout.nodes[0] == 0.0
    # dt = courant * h / c, in units of the transit time.
    np.testing.assert_allclose(np.diff(layout.times), courant / elements, rtol=1e-11)
    np.testing.assert_allclose(layout.nodes, np.linspace(0, 1, elements + 1), rtol=0, atol=1e-15)
    grid = {(t, z) for t in layout.times for z in layout.nodes}
    assert {(t, z) for t, z in x[:, :2].tolist()} == grid
    assert (x[:, 2] == 0).all()


def test_boundaries_are_named_by_place():
    space = layered_mesh(MPI.COMM_SELF, 5, 8, 1.0)
    assert set(space.layout.tags) == set(BOUNDARIES)
    mesh = space.mesh
    mesh.topology.create_connectivity(1, 0)
    mesh.topology.create_connectivity(1, 2)
    from dolfinx.mesh import compute_midpoints

    places = {"start": (0, 0.0, 5), "end": (0, 1.6, 5), "wall": (1, 0.0, 8), "far": (1, 1.0, 8)}
    for name, (axis, value, count) in places.items():
        facets = space.facets(name)
        assert len(facets) == count
        middles = compute_midpoints(mesh, 1, facets)
        np.testing.assert_allclose(middles[:, axis], value, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("diagonal", "slope"), [("outgoing", 1.0), ("incoming", -1.0)])
def test_diagonals_follow_the_waves(diagonal, slope):
    space = layered_mesh(MPI.COMM_SELF, 4, 6, 1.0, diagonal)
    corners = space.mesh.geometry.x[cell_nodes(space.mesh)][:, :, :2]
    assert len(corners) == 2 * 4 * 6
    for triangle in corners:
        edges = np.roll(triangle, -1, axis=0) - triangle
        steep = [dx / dt for dt, dx in edges if abs(dt) > 1e-9 and abs(dx) > 1e-9]
        np.testing.assert_allclose(steep, [slope], rtol=1e-9)


def test_a_thousand_to_one_rectangle():
    space = layered_mesh(MPI.COMM_SELF, 2, 2000, 1.0)
    assert len(space.layout.times) == 2001
    assert space.layout.times[-1] == 1000.0


increasing = st.lists(st.floats(0.01, 10.0), min_size=1, max_size=7).map(
    lambda steps: np.concatenate([[0.0], np.cumsum(steps)])
)


def grid(times, nodes):
    return np.array([(t, x) for t in times for x in nodes])


@given(increasing, increasing, st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-12, 1e-11]))
def test_layers_are_found_in_any_order_and_in_spite_of_rounding(times, nodes, seed, noise):
    rng = np.random.default_rng(seed)
    points = grid(times, nodes)
    points += noise * np.array([times[-1], nodes[-1]]) * rng.uniform(-1, 1, points.shape)
    layout = find_layers(rng.permutation(points), TAGS)
    assert layout.num_nodes == len(points)
    assert layout.tags == TAGS
    np.testing.assert_allclose(layout.times, times, rtol=0, atol=3e-11 * times[-1])
    np.testing.assert_allclose(layout.nodes, nodes, rtol=0, atol=3e-11 * nodes[-1])


@given(st.integers(1, 40), st.integers(1, 40), st.floats(1e-9, 1e9), st.integers(0, 2**32 - 1))
def test_uniform_layers_become_exactly_uniform(layers, elements, duration, seed):
    times, nodes = np.linspace(0, duration, layers + 1), np.linspace(0, 1, elements + 1)
    rng = np.random.default_rng(seed)
    points = grid(times, nodes)
    points[:, 0] += 1e-12 * duration * rng.uniform(-1, 1, len(points))
    layout = find_layers(rng.permutation(points), TAGS)
    assert layout.times[0] == 0.0
    steps = np.diff(layout.times)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-13 * layers)


@settings(max_examples=50)
@given(increasing, increasing, st.data())
def test_a_grid_with_a_node_out_of_place_has_no_layers(times, nodes, data):
    points = grid(times, nodes)
    at = data.draw(st.integers(0, len(points) - 1))
    points[at] += 1e-4 * np.array([1.0, 1.0]) * min(np.diff(times).min(), np.diff(nodes).min())
    layout = find_layers(points, TAGS)
    assert layout.times is None or len(layout.times) * len(layout.nodes) == len(points)
    if len(times) > 2 and len(nodes) > 2:
        assert layout.times is None
        assert layout.nodes is None


def test_as_many_points_as_a_grid_are_not_a_grid():
    points = np.array([(0, 0), (1, 1), (2, 2), (0, 1), (1, 1), (2, 0)], dtype=float)[:4]
    points = np.array([(0.0, 0.0), (0.0, 0.0), (1.0, 1.0), (1.0, 0.0)])
    assert find_layers(points, TAGS).times is None


def test_nearest():
    levels = np.array([0.0, 1.0, 4.0])
    np.testing.assert_array_equal(nearest(levels, np.array([-9.0, 0.4, 0.6, 2.4, 2.6, 99.0])),
                                  [0, 0, 1, 1, 2, 2])  # fmt: skip


def test_a_mesh_without_layers_keeps_its_nodes():
    space = layered_mesh(MPI.COMM_SELF, 3, 3, 1.0)
    x = space.mesh.geometry.x
    x[4, 0] += 1e-3
    layout = find_layers(x[:, :2].copy(), space.layout.tags)
    before = x.copy()
    assert finish(space.mesh, space.facet_tags, layout).layout.times is None
    np.testing.assert_array_equal(x, before)
