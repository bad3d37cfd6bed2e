"""Shapes of solids: volumes against sampling, names of surfaces, cuts, axisymmetric bodies."""

import math

import numpy as np
import pytest

from impactfem.errors import SceneError
from impactfem.scene import Block, Cylinder, Disc, Ring, Sphere

QUARTER = math.pi / 2


def inside(shape, points):
    """Whether points (n, dim) lie in a shape: turned back, then compared with the definition."""
    centre = np.array(shape.centre)
    kept = np.ones(len(points), dtype=bool)
    for axis in shape.symmetry:
        kept &= (points - centre)[:, "xyz".index(axis)] >= 0
    c, s = math.cos(-shape.angle), math.sin(-shape.angle)
    own = points - centre
    own[:, 0], own[:, 1] = c * own[:, 0] - s * own[:, 1], s * own[:, 0] + c * own[:, 1]
    if shape.kind == "block":
        return kept & (np.abs(own) <= np.array(shape.size) / 2).all(axis=1)
    if shape.kind == "cylinder":
        across = np.delete(own, 1, axis=1)
        along = np.abs(own[:, 1]) <= shape.height / 2
        return kept & along & (np.linalg.norm(across, axis=1) <= shape.radius)
    distance = np.linalg.norm(own, axis=1)
    return kept & (distance <= shape.radius) & (distance >= getattr(shape, "inner_radius", 0))


def sampled(shape, *, axisymmetric=False, n=400_000):
    """Measure of a shape, volume of its revolution, and corners of the box that holds it."""
    # The sequence of R. Roberts' generalised golden ratio: evener than random numbers.
    ratio = {2: 1.32471795724474602596, 3: 1.22074408460575947536}[shape.dim]
    share = np.arange(1, n + 1)[:, None] * ratio ** -np.arange(1.0, shape.dim + 1) % 1.0
    across = 1.05 * math.hypot(*shape.half_extents[:2])
    reach = np.array([across, across, *(1.05 * half for half in shape.half_extents[2:])])
    low, high = np.array(shape.centre) - reach, np.array(shape.centre) + reach
    if axisymmetric:
        low[0] = 0.0
    points = low + (high - low) * share
    held = points[inside(shape, points)]
    cell = np.prod(high - low) / n
    return cell * len(held), 2 * math.pi * cell * held[:, 0].sum(), held.min(0), held.max(0)


SHAPES = [
    Block(size=[2, 1], corner=[0.3, -0.2], angle=0.4),
    Block(size=[1, 1], corner=[-0.5, 0], angle=math.pi / 4, symmetry=["x"]),
    Block(size=[2, 1], symmetry=["x", "y"]),
    Block(size=[2, 1, 0.5], corner=[0, 1, 2], angle=0.3),
    Block(size=[2, 1, 0.5], angle=QUARTER, symmetry=["x", "z"]),
    Disc(radius=0.5, center=[0, 0.52]),
    Disc(radius=0.5, center=[1, 2], symmetry=["y"]),
    Ring(inner_radius=0.3, radius=0.7, center=[1, 0], symmetry=["x", "y"]),
    Cylinder(radius=0.4, height=2, center=[1, 2, 3]),
    Cylinder(radius=0.4, height=2, angle=0.5),
    Cylinder(radius=0.4, height=2, symmetry=["x", "y", "z"], angle=QUARTER),
    Sphere(radius=0.8, center=[1, -1, 0]),
    Sphere(radius=0.8, symmetry=["z"]),
]


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_volume_and_bounds(shape):
    volume, _, low, high = sampled(shape)
    assert shape.volume == pytest.approx(volume, rel=3e-3)
    lower, upper = shape.bounds()
    # Samples fill the box but for its corners, which few of them reach.
    assert (low >= np.array(lower) - 1e-12).all()
    assert (high <= np.array(upper) + 1e-12).all()
    assert np.allclose(low, lower, atol=0.06)
    assert np.allclose(high, upper, atol=0.06)


AXISYMMETRIC = [
    Block(size=[0.5, 1], corner=[0, 2]),
    Block(size=[0.5, 1], corner=[1, 2], symmetry=["y"]),
    Block(size=[0.5, 1], corner=[1, 2], angle=0.3),
    Disc(radius=0.5, center=[0, 1]),
    Disc(radius=0.5, center=[0, 1], symmetry=["y"]),
    Disc(radius=0.5, center=[2, 1]),
    Ring(inner_radius=0.3, radius=0.5, center=[0, 1]),
    Ring(inner_radius=0.3, radius=0.5, center=[2, 1], symmetry=["y"]),
    Cylinder(radius=0.5, height=3, center=[0, 1]),
    Cylinder(radius=0.5, height=3, center=[0, 1], symmetry=["y"]),
    Sphere(radius=0.5, center=[0, 1]),
    Sphere(radius=0.5, center=[0, 1], symmetry=["y"]),
]


@pytest.mark.parametrize("shape", AXISYMMETRIC, ids=str)
def test_volume_of_revolution(shape):
    shape.check_model("axisymmetric")
    _, volume, low, high = sampled(shape, axisymmetric=True)
    assert shape.revolved_volume == pytest.approx(volume, rel=3e-3)
    lower, upper = shape.bounds(axisymmetric=True)
    assert np.allclose(low, lower, atol=0.03)
    assert np.allclose(high, upper, atol=0.03)


@pytest.mark.parametrize(
    ("shape", "names"),
    [
        (Block(size=[1, 2]), "left right bottom top"),
        (Block(size=[1, 2, 3]), "left right bottom top back front"),
        (Block(size=[1, 2], symmetry=["x"]), "right bottom top symmetry_x"),
        (Block(size=[1, 2], symmetry=["y", "x"]), "right top symmetry_y symmetry_x"),
        # Turned by 90 degrees, bottom looks to the right and top to the left.
        (Block(size=[1, 2], symmetry=["x"], angle=QUARTER), "left right bottom symmetry_x"),
        (Block(size=[1, 2], symmetry=["y"], angle=-QUARTER), "left bottom top symmetry_y"),
        # On its corner: what looked to the left and to the top looks to the left now.
        (Block(size=[2, 2], symmetry=["x"], angle=math.pi / 4), "right bottom symmetry_x"),
        (
            Block(size=[1, 2, 3], symmetry=["z"], angle=0.3),
            "left right bottom top front symmetry_z",
        ),
        (Disc(radius=1, symmetry=["x"]), "rim symmetry_x"),
        (Ring(inner_radius=1, radius=2), "outer inner"),
        (Cylinder(radius=1, height=2), "side bottom top"),
        (Cylinder(radius=1, height=2, symmetry=["y"]), "side top symmetry_y"),
        (Cylinder(radius=1, height=2, symmetry=["x"], angle=QUARTER), "side bottom symmetry_x"),
        (Sphere(radius=1, symmetry=["x", "z"]), "surface symmetry_x symmetry_z"),
    ],
    ids=str,
)
def test_names_of_surfaces(shape, names):
    assert shape.surface_names() == tuple(names.split())


@pytest.mark.parametrize(
    ("shape", "names"),
    [
        (Block(size=[1, 2]), "right bottom top axis"),
        (Block(size=[1, 2], corner=[1, 0]), "left right bottom top"),
        (Block(size=[1, 2], symmetry=["y"]), "right top symmetry_y axis"),
        (Disc(radius=1, center=[0, 3]), "rim axis"),
        (Disc(radius=1, center=[2, 3]), "rim"),
        (Ring(inner_radius=1, radius=2, symmetry=["y"]), "outer inner symmetry_y axis"),
        (Cylinder(radius=1, height=2, center=[0, 0]), "side bottom top axis"),
        (Sphere(radius=1, center=[0, 0]), "surface axis"),
    ],
    ids=str,
)
def test_names_of_axisymmetric_surfaces(shape, names):
    assert shape.surface_names(axisymmetric=True) == tuple(names.split())


def test_defaults_are_the_origin():
    assert Block(size=[1, 2, 3]).corner == (0.0, 0.0, 0.0)
    assert Disc(radius=1).center == (0.0, 0.0)
    assert Cylinder(radius=1, height=2).center == (0.0, 0.0, 0.0)
    assert Cylinder(radius=1, height=2).centre == (0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: Block(size=[1]), ["block.size = [1]", "1 entries, not 2 or 3", "give a list"]),
        (lambda: Block(size=[1, 0]), ["block.size = [1, 0]", "must be > 0"]),
        (lambda: Block(size=1), ["block.size = 1", "a number, not a list"]),
        (lambda: Block(size=[1, "2"]), ['block.size[1] = "2"', "without quotes"]),
        (
            lambda: Block(size=[1, 2], corner=[0, 0, 0]),
            ["block.corner", "size = [1.0, 2.0]", "2 en"],
        ),
        (lambda: Block(size=[1, 2], angle=0.3, symmetry=["x"]), ["block.angle = 0.3", "1.5708"]),
        (lambda: Block(size=[1, 1], angle=0.3, symmetry=["y"]), ["block.angle = 0.3", "0.785398"]),
        (lambda: Disc(radius=0), ["disc.radius = 0", "must be > 0"]),
        (lambda: Disc(radius=1, center=[0, 0, 0]), ["disc.center", "3 entries, not 2"]),
        (lambda: Disc(radius=1, symmetry="x"), ["disc.symmetry", "write a list"]),
        (lambda: Disc(radius=1, symmetry=["u"]), ['"u" is not known', '"x"']),
        (lambda: Ring(inner_radius=1, radius=1), ["ring.inner_radius = 1.0", "radius = 1.0"]),
        (lambda: Cylinder(radius=1, height=1, angle=1, symmetry=["x"]), ["cylinder.angle = 1"]),
        (Sphere, ["sphere.radius is missing"]),
    ],
)
def test_wrong_shapes_are_explained(make, parts):
    with pytest.raises(SceneError) as caught:
        make()
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("shape", "model", "parts"),
    [
        (Disc(radius=1), "3d", ['disc.kind = "disc"', '"3d"', "block", "sphere"]),
        (Sphere(radius=1), "plane_strain", ['sphere.kind = "sphere"', '"disc"', '"ring"']),
        (Block(size=[1, 2]), "3d", ["block.kind", "coordinates have 2 entries; give 3"]),
        (Block(size=[1, 2, 3]), "plane_stress", ["block.kind", "have 3 entries; give 2"]),
        (Sphere(radius=1), "axisymmetric", ["sphere.kind", "have 3 entries; give 2"]),
        (Disc(radius=1, symmetry=["z"]), "plane_strain", ["disc.symmetry", "remove it"]),
        (Disc(radius=1, symmetry=["x"]), "axisymmetric", ["disc.symmetry", "remove it"]),
        (Block(size=[1, 2], corner=[-0.5, 0]), "axisymmetric", ["block.corner", "r = -0.5 < 0"]),
        (Block(size=[1, 2], corner=[0.1, 0], angle=1), "axisymmetric", ["block.corner", "< 0"]),
        (Block(size=[1, 2], angle=QUARTER * 2), "axisymmetric", ["block.angle", "remove it"]),
        (Disc(radius=1, center=[0.5, 0]), "axisymmetric", ["disc.center", "r = -0.5", "centre it"]),
        (Disc(radius=1, center=[1, 0]), "axisymmetric", ["disc.center", "in a point"]),
        (Disc(radius=1, center=[-1, 0]), "axisymmetric", ["disc.center", "r = -2 < 0"]),
        (Sphere(radius=1, center=[3, 0]), "axisymmetric", ["sphere.center", "its r is 0"]),
        (Cylinder(radius=1, height=1, center=[3, 0]), "axisymmetric", ["cylinder.center", "is 0"]),
    ],
)
def test_shapes_that_do_not_fit_the_model(shape, model, parts):
    with pytest.raises(SceneError) as caught:
        shape.check_model(model)
    for part in parts:
        assert part in str(caught.value)
