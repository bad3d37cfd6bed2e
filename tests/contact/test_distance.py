"""Signed distances against sampled surfaces, finite differences and motions of the plane."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from impactfem.contact.distance import nearest_obstacle, signed_distance
from impactfem.errors import SceneError
from impactfem.scene.formula import Formula
from impactfem.scene.obstacles import OBSTACLES

Floats = NDArray[np.float64]

SEEDS = st.integers(0, 2**32 - 1)
SHAPES = (
    "half_space", "sphere", "sphere_in", "cylinder", "cylinder_in", "box", "polyline", "closed"
)  # fmt: skip


def obstacle(kind: str, **values: object) -> Any:
    """One of the scene's obstacles."""
    return OBSTACLES[kind](**{"name": "it", **values})


@dataclass(frozen=True)
class Sample:
    """An obstacle, a sample of its surface, and which points lie inside."""

    obstacle: Any
    surface: Floats
    spacing: float  # largest distance from a point of the surface to the sample


def unit(rng: np.random.Generator, dim: int) -> Floats:
    vector = rng.normal(size=dim)
    return vector / np.linalg.norm(vector)


def chain(rng: np.random.Generator, *, closed: bool) -> Floats:
    """A star-shaped closed chain, counterclockwise or clockwise, or a graph over x turned about."""
    if closed:
        angles = (np.arange(7) + rng.uniform(0, 0.8, 7)) * 2 * np.pi / 7
        points = rng.uniform(0.3, 1.0, 7)[:, None] * np.stack([np.cos(angles), np.sin(angles)], 1)
        points = np.concatenate([points, points[:1]])
        return points if rng.uniform() < 0.5 else points[::-1].copy()
    return np.stack([np.linspace(-1, 1, 6), rng.uniform(-0.4, 0.4, 6)], axis=1)


def make(shape: str, dim: int, rng: np.random.Generator) -> Sample:
    """A random obstacle near the origin with a dense sample of its surface in [-2, 2]^dim."""
    place = rng.uniform(-0.3, 0.3, dim)
    count = 4001 if dim == 2 else 201
    line = np.linspace(-6, 6, count)
    if shape == "half_space":
        normal = unit(rng, dim)
        basis = np.linalg.svd(normal[None])[2][1:]
        grid = np.stack(np.meshgrid(*[line] * (dim - 1)), axis=-1).reshape(-1, dim - 1)
        it = obstacle("half_space", point=tuple(place), normal=tuple(rng.uniform(0.5, 3) * normal))
        return Sample(it, place + grid @ basis, np.sqrt(dim - 1) * 6 / count)
    name, _, side = shape.partition("_")
    side = "inside" if side else "outside"
    radius = rng.uniform(0.3, 1.2)
    if dim == 2 and name in ("sphere", "cylinder"):
        angles = np.linspace(0, 2 * np.pi, count)
        surface = place + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        at = {"center": tuple(place)} if name == "sphere" else {"point": tuple(place), "axis": None}
        return Sample(obstacle(name, radius=radius, side=side, **at), surface, radius * 4 / count)
    if name == "sphere":
        golden = np.arange(40000) + 0.5
        z, turn = 1 - 2 * golden / 40000, np.pi * (1 + np.sqrt(5)) * golden
        flat = np.sqrt(1 - z * z)
        surface = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
        it = obstacle(name, center=tuple(place), radius=radius, side=side)
        return Sample(it, place + radius * surface, radius * 0.02)
    if name == "cylinder":
        axis = unit(rng, 3)
        basis = np.linalg.svd(axis[None])[2][1:]
        angles, heights = np.meshgrid(np.linspace(0, 2 * np.pi, 201), np.linspace(-6, 6, 401))
        ring = np.stack([np.cos(angles), np.sin(angles)], axis=-1).reshape(-1, 2) @ basis
        surface = place + radius * ring + heights.reshape(-1, 1) * axis
        it = obstacle(name, point=tuple(place), axis=tuple(2 * axis), radius=radius, side=side)
        return Sample(it, surface, 0.04)
    if shape == "box":
        size, angle = rng.uniform(0.4, 2.0, dim), rng.uniform(-4, 4)
        turn = np.eye(dim)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        across = np.linspace(-0.5, 0.5, 2001 if dim == 2 else 121)
        grid = np.stack(np.meshgrid(*[across] * (dim - 1)), axis=-1).reshape(-1, dim - 1)
        faces = [
            np.insert(grid, axis, at, axis=1) * size for axis in range(dim) for at in (-0.5, 0.5)
        ]
        surface = place + np.concatenate(faces) @ turn.T
        it = obstacle("box", center=tuple(place), size=tuple(size), angle=angle)
        return Sample(it, surface, np.sqrt(dim - 1) * 1.0 / (len(across) - 1))
    points = chain(rng, closed=shape == "closed")
    s = np.linspace(0, 1, 1501)[:, None]
    surface = np.concatenate([(1 - s) * a + s * b for a, b in pairwise(points)])
    it = obstacle("polyline", points=tuple(map(tuple, points)))
    return Sample(it, surface, 2.5 / 3000)


def inside(it: Any, points: Floats) -> NDArray[np.bool_]:
    """Which points lie in the obstacle, by definitions that know no distance."""
    x = points
    match it.kind:
        case "half_space":
            return (x - it.point) @ np.asarray(it.normal) < 0
        case "sphere" | "cylinder":
            arms = x - (it.center if it.kind == "sphere" else it.point)
            if it.kind == "cylinder" and x.shape[1] == 3:
                arms = np.cross(arms, it.axis) / np.linalg.norm(it.axis)
            return (np.linalg.norm(arms, axis=1) < it.radius) != (it.side == "inside")
        case "box":
            z = np.exp(-1j * it.angle) * ((x[:, 0] - it.center[0]) + 1j * (x[:, 1] - it.center[1]))
            local = np.stack([z.real, z.imag], axis=1)
            if x.shape[1] == 3:
                local = np.column_stack([local, x[:, 2] - it.center[2]])
            return (np.abs(local) < np.asarray(it.size) / 2).all(axis=1)
    chain = np.asarray(it.points)
    if (chain[0] == chain[-1]).all():  # winding number: 1, -1 or 0
        arms = (chain[:, 0] + 1j * chain[:, 1])[:, None] - (x[:, 0] + 1j * x[:, 1])
        turns = np.angle(arms[1:] / arms[:-1]).sum(axis=0) / (2 * np.pi)
        total = np.angle((chain @ [1, 1j])[1:] / (chain @ [1, 1j])[:-1]).sum()
        return turns < -0.5 if total < 0 else turns < 0.5
    return x[:, 1] < np.interp(x[:, 0], chain[:, 0], chain[:, 1])


def cloud(rng: np.random.Generator, it: Any, dim: int, count: int = 60) -> Floats:
    """Points around; for an open chain those whose nearest point is not beyond its ends."""
    points = rng.uniform(-1.5, 1.5, (count, dim))
    if it.kind == "polyline" and it.points[0] != it.points[-1]:
        points[:, 0] = rng.uniform(-0.6, 0.6, count)
        points[:, 1] = rng.uniform(-0.6, 0.6, count)
        gap, normal = signed_distance(it, points, 0.0)
        at_end = np.abs(np.abs((points - gap[:, None] * normal)[:, 0]) - 1) < 1e-9
        points = points[~at_end]
    return points


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dim", [2, 3])
@given(seed=SEEDS)
@settings(max_examples=12, deadline=None)
def test_agrees_with_the_nearest_sample_of_the_surface(shape: str, dim: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    sample = make(shape, dim, rng)
    points = cloud(rng, sample.obstacle, dim, 40)
    gap, _ = signed_distance(sample.obstacle, points, 0.0)
    flat = points[:, : sample.surface.shape[1]]
    brute = np.array([np.linalg.norm(sample.surface - p, axis=1).min() for p in flat])
    # A sample never lies nearer than the surface, and within the spacing of its nearest point.
    assert (brute >= np.abs(gap) - 1e-12).all()
    assert (brute <= np.abs(gap) + sample.spacing).all()
    clear = np.abs(gap) > 1e-9
    np.testing.assert_array_equal((gap < 0)[clear], inside(sample.obstacle, points)[clear])


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dim", [2, 3])
@given(seed=SEEDS)
@settings(max_examples=20, deadline=None)
def test_normal_is_the_unit_gradient_and_leads_to_the_surface(
    shape: str, dim: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    it = make(shape, dim, rng).obstacle
    points = cloud(rng, it, dim)
    gap, normal = signed_distance(it, points, 0.0)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-12)
    assert np.abs(signed_distance(it, points - gap[:, None] * normal, 0.0)[0]).max() < 1e-12
    step = 1e-6
    ends = [
        signed_distance(it, points + sign * step * axis, 0.0)
        for axis in np.eye(dim)
        for sign in (1, -1)
    ]
    slopes = np.stack(
        [(a[0] - b[0]) / (2 * step) for a, b in zip(ends[::2], ends[1::2], strict=True)], axis=1
    )
    # Where the normal jumps within the step (the medial axis) there is no gradient.
    smooth = np.all([np.abs(n - normal).max(axis=1) < 1e-3 for _, n in ends], axis=0)
    assert smooth.mean() > 0.9
    np.testing.assert_allclose(slopes[smooth], normal[smooth], atol=1e-4)


@pytest.mark.parametrize("shape", [s for s in SHAPES if s != "polyline"])
@pytest.mark.parametrize("dim", [2, 3])
@given(seed=SEEDS)
@settings(max_examples=20, deadline=None)
def test_changes_no_faster_than_the_place(shape: str, dim: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    it = make(shape, dim, rng).obstacle
    a, b = cloud(rng, it, dim), cloud(rng, it, dim)
    change = signed_distance(it, a, 0.0)[0] - signed_distance(it, b, 0.0)[0]
    assert (np.abs(change) <= np.linalg.norm(a - b, axis=1) + 1e-12).all()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dim", [2, 3])
@given(seed=SEEDS)
@settings(max_examples=20, deadline=None)
def test_turns_and_moves_with_its_obstacle(shape: str, dim: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    it = make(shape, dim, rng).obstacle
    points = rng.uniform(-1.5, 1.5, (60, dim))
    gap, normal = signed_distance(it, points, 0.0)
    angle, shift = rng.uniform(-3, 3), rng.uniform(-2, 2, dim)
    turn = np.eye(dim)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    keys = ("normal", "axis", "point", "center")
    changed: dict[str, Any] = {
        key: (turn @ getattr(it, key)).tolist()
        for key in keys
        if getattr(it, key, None) is not None
    }
    if it.kind == "box":
        changed["angle"] = float(np.angle(np.exp(1j * (it.angle + angle))))
    if it.kind == "polyline":
        points_there = np.asarray(it.points) @ turn[:2, :2].T
        if (np.asarray(it.points)[0] == np.asarray(it.points)[-1]).all():
            points_there[-1] = points_there[0]
        changed["points"] = points_there.tolist()
    motion = tuple(Formula(f"{s!r}*t/2", ("t",)) for s in shift.tolist())
    turned = replace(it, motion=motion, **changed)
    moved_gap, moved_normal = signed_distance(turned, points @ turn.T + shift, 2.0)
    np.testing.assert_allclose(moved_gap, gap, atol=1e-12)
    np.testing.assert_allclose(moved_normal, normal @ turn.T, atol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dim", [2, 3])
def test_planes_and_round_obstacles_tell_their_place(shape: str, dim: int) -> None:
    if dim == 3 and shape in ("polyline", "closed"):
        return
    rng = np.random.default_rng(dim)
    it = make(shape, dim, rng).obstacle
    points = cloud(rng, it, dim)
    gap, _ = it.gap(points)
    assert (it.plane is not None) == (shape == "half_space")
    assert (it.core is not None) == shape.startswith(("sphere", "cylinder"))
    if it.plane is not None:
        assert (points - it.plane.point) @ it.plane.normal == pytest.approx(gap)
    if it.core is not None:
        arms = points - it.core.center
        if it.core.axis is not None:
            arms -= np.outer(arms @ it.core.axis, it.core.axis)
        assert it.core.side * (np.linalg.norm(arms, axis=1) - it.core.radius) == pytest.approx(gap)


def test_directions_where_the_distance_has_no_gradient() -> None:
    centre = np.zeros((1, 2))
    ball = obstacle("sphere", center=(0.0, 0.0), radius=2.0, side="outside")
    for it, gap, normal in (
        (ball, -2.0, [0, 1]),
        (obstacle("sphere", center=(0.0, 0.0), radius=2.0, side="inside"), 2.0, [0, -1]),
        (obstacle("box", center=(0.0, 0.0), size=(2.0, 2.0), angle=0.0), -1.0, [0, 1]),
        # A node on the corner of a flush box is pushed up, one on its side aside.
        (obstacle("box", center=(-1.0, -1.0), size=(2.0, 2.0), angle=0.0), 0.0, [0, 1]),
        (obstacle("box", center=(-1.0, 0.5), size=(2.0, 2.0), angle=0.0), 0.0, [1, 0]),
        # A corner of 90 degrees gives the mean of both normals, an end that of its segment.
        (obstacle("polyline", points=((-1.0, 0.0), (0.0, 0.0), (0.0, -1.0))), 0.0, [0.5**0.5] * 2),
        (obstacle("polyline", points=((0.0, 0.0), (1.0, 0.0))), 0.0, [0, 1]),
    ):
        found, direction = signed_distance(it, centre, 0.0)
        np.testing.assert_allclose(found, gap, atol=1e-15)
        np.testing.assert_allclose(direction, [normal], atol=1e-15)
    axis = obstacle("cylinder", point=(0, 0, 0), axis=(1.0, 1.0, 0.0), radius=1.0, side="outside")
    gaps, direction = signed_distance(axis, [[3.0, 3.0, 0.0]], 0.0)
    assert gaps[0] == pytest.approx(-1.0)
    np.testing.assert_allclose(direction, [[-(0.5**0.5), 0.5**0.5, 0.0]], atol=1e-12)


def test_an_open_chain_ends() -> None:
    shelf = obstacle("polyline", points=((0.0, 0.0), (1.0, 0.0)))
    points = np.array([[0.5, 0.1], [0.5, -0.1], [1.3, 0.4], [1.3, -0.4], [1.0, -1e-3], [0.0, -0.2]])
    gap, normal = signed_distance(shelf, points, 0.0)
    # Over the edge there is nothing; at the edge itself the face still holds.
    np.testing.assert_allclose(gap, [0.1, -0.1, 0.5, 0.5, -1e-3, -0.2], atol=1e-15)
    np.testing.assert_allclose(normal[2:4], [[0.6, 0.8], [0.6, -0.8]], atol=1e-15)
    np.testing.assert_allclose(normal[[0, 1, 4, 5]], [[0, 1]] * 4, atol=1e-15)


def test_sides_of_sharp_corners() -> None:
    # A spike towards the body (30 degrees) and a notch of the same angle: the sum of the normals
    # decides where the corner is nearest, on both sides of the bisector.
    spike = obstacle("polyline", points=((-0.5, -2.0), (0.0, 0.0), (0.5, -2.0)))
    notch = obstacle("polyline", points=((-0.5, 2.0), (0.0, 0.0), (0.5, 2.0)))
    around = np.array([[0.9, 0.05], [-0.9, 0.05], [0.0, 1.0], [0.7, 0.0], [-0.7, 0.0]])
    np.testing.assert_array_equal(signed_distance(spike, around, 0.0)[0] > 0, [True] * 5)
    np.testing.assert_array_equal(signed_distance(notch, -around, 0.0)[0] > 0, [False] * 5)
    within = np.array([[0.01, -1.0], [-0.01, -1.0]])
    assert (signed_distance(spike, within, 0.0)[0] < 0).all()
    assert (signed_distance(notch, -within, 0.0)[0] > 0).all()


def test_the_nearest_obstacle_wins_and_the_first_of_equals() -> None:
    floor = obstacle("half_space", point=(0.0, 0.0), normal=(0.0, 1.0))
    wall = obstacle("half_space", point=(2.0, 0.0), normal=(-1.0, 0.0))
    points = np.array([[0.0, 0.5], [1.9, 0.5], [1.0, 1.0]])
    index, gap, normal = nearest_obstacle([floor, wall], points, 0.0)
    assert index.tolist() == [0, 1, 0]
    np.testing.assert_allclose(gap, [0.5, 0.1, 1.0])
    np.testing.assert_allclose(normal, [[0, 1], [-1, 0], [0, 1]])


def test_a_motion_without_value_is_an_error_that_names_it() -> None:
    lift = obstacle(
        "half_space",
        name="lift",
        point=(0, 0),
        normal=(0, 1),
        motion=(Formula("0", ("t",)), Formula("log(1 - t)", ("t",))),
    )
    with pytest.raises(SceneError, match=r"'lift'.*log\(1 - t\).*t = 1 s; change the formula"):
        signed_distance(lift, [[0.0, 0.0]], 1.0)
