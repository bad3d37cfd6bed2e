"""Overlap of surfaces at the start: closed forms of depth and place, and what is none."""

import numpy as np
import pytest
from mortar_surfaces import facing, segment, sphere, square

from impactfem.contact.mortar_check import _pieces, _signed, self_check
from impactfem.contact.mortar_surface import Kind, Surface, surface

NAMES = ("ball", "plate")


def box(low: list[float], high: list[float], count: int) -> Surface:
    """The whole outside of a rectangle."""
    s = np.arange(count) / count
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    loop = np.concatenate(
        [corner[k] + s[:, None] * (corner[(k + 1) % 4] - corner[k]) for k in range(4)]
    )
    points = np.array(low) + loop * (np.array(high) - low)
    faces = np.stack([np.arange(len(loop)), np.roll(np.arange(len(loop)), -1)], axis=1)
    return facing(surface(points, faces, "interval"), points[faces].mean(axis=1) - points.mean(0))


@pytest.mark.parametrize("degree", [1, 2])
def test_spheres_overlap_by_the_depth_of_their_poles(degree: int) -> None:
    low = sphere(2000, 1.0, np.zeros(3), degree)
    message = self_check(low, sphere(2000, 1.0, np.array([0, 0, 1.9]), degree), NAMES)
    assert message is not None
    assert "'ball' and 'plate'" in message
    depth = float(message.split("overlap by ")[1].split()[0])
    assert depth == pytest.approx(0.1, rel=0.03)  # both poles are a sagitta short
    place = [float(x) for x in message.split("(")[1].split(")")[0].split(",")]
    assert np.linalg.norm(place[:2]) < 0.1
    assert place[2] == pytest.approx(0.95, abs=0.06)
    assert self_check(low, sphere(2000, 1.0, np.array([0, 0, 2.001]), degree), NAMES) is None


@pytest.mark.parametrize("count", [4, 40])
def test_signed_distance_of_a_box(count: int) -> None:
    rng = np.random.default_rng(count)
    points = rng.uniform(-1, 3, (500, 2))
    body = box([0.0, 0.0], [2.0, 1.0], count)
    away = np.maximum(np.abs(points - [1.0, 0.5]) - [1.0, 0.5], -np.inf)
    outside = np.linalg.norm(np.maximum(away, 0), axis=1)
    exact = np.where((away < 0).all(axis=1), away.max(axis=1), outside)
    np.testing.assert_allclose(_signed(points, _pieces(body)), exact, atol=1e-13)


def test_boxes_that_touch_or_stand_apart_do_not_overlap() -> None:
    low = box([0.0, 0.0], [2.0, 1.0], 7)
    assert self_check(low, box([0.5, 1.0], [1.5, 2.0], 3), NAMES) is None
    assert self_check(low, box([2.0, 1.0], [3.0, 2.0], 3), NAMES) is None
    assert self_check(low, box([0.5, 1.2], [1.5, 2.0], 3), NAMES) is None
    deep = self_check(low, box([0.5, 0.7], [1.5, 2.0], 3), NAMES)
    assert deep is not None
    assert "overlap by 0.3 m" in deep
    inside = self_check(low, box([0.9, 0.4], [1.1, 0.6], 1), NAMES)  # swallowed whole
    assert inside is not None
    assert "overlap by 0.5 m" in inside  # the middle of its side, on the middle of the other


@pytest.mark.parametrize("kind", ["triangle", "quadrilateral"])
@pytest.mark.parametrize("degree", [1, 2])
def test_an_open_bowl(kind: Kind, degree: int) -> None:
    x = np.linspace(0, 1, 15)
    bowl = square(kind, x, x, degree)
    bowl = bowl.moved(bowl.points + np.outer((bowl.points[:, :2] ** 2).sum(axis=1), [0, 0, 1.0]))
    plate = square(kind, np.linspace(0.4, 0.6, 3), np.linspace(0.4, 0.6, 3), degree, up=False)

    def at(height: float, aside: float = 0.0) -> str | None:
        return self_check(plate.moved(plate.points + np.array([aside, 0.0, height])), bowl, NAMES)

    assert at(0.73) is None  # above the bowl, which is 0.72 high at the plate's last corner
    assert at(0.4, aside=0.7) is None  # beside it
    message = at(0.4)
    assert message is not None
    assert "(0.6, 0.6, 0.4)" in message
    r = np.linspace(0, 1, 100_001)  # nearest point of z = x^2 + y^2 on the diagonal
    depth = np.hypot(np.sqrt(2) * (r - 0.6), 2 * r**2 - 0.4).min()
    assert float(message.split("overlap by ")[1].split()[0]) == pytest.approx(depth, rel=0.01)


def test_lines_of_degree_two_use_their_middles() -> None:
    arch = segment(np.linspace(-1, 1, 3), 2)
    arch = arch.moved(np.stack([arch.points[:, 0], 1 - arch.points[:, 0] ** 2], axis=1))
    tip = segment(np.array([-0.6, -0.5, -0.4]), 1, height=0.7, up=False)
    message = self_check(tip, arch, NAMES)
    assert message is not None  # the chord from (-1, 0) to (0, 1) alone is below it
