"""Nodes that touch several obstacles at once under finite strain: corners, seams, steps."""

import numpy as np
import pytest

import impactfem
from impactfem.contact.corners import several_gaps
from impactfem.scene.obstacles import HalfSpace, RigidBox, RigidPolyline

FLOOR = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
WALL = {"name": "wall", "kind": "half_space", "point": [0.0, 0.0], "normal": [1.0, 0.0]}
BLOCK = {
    "name": "b", "kind": "solid", "model": "plane_strain", "mesh_size": 0.05,
    "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.002, 0.002]},
    "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3, "material": "neo_hookean",
}  # fmt: skip


def solved(obstacles, duration, body=(), **more):
    data = {
        "title": "corner", "duration": duration, "body": [BLOCK | dict(body)],
        "obstacle": obstacles, "solve": {"estimate": False}, "output": {"fields": []},
    }  # fmt: skip
    result = impactfem.solve(impactfem.Scene.from_dict(data | more))
    assert result.summary["status"] == "completed"
    told = [finding["text"] for finding in result.summary["verdict"]["findings"]]
    assert not any("without contact unknowns" in text for text in told)
    h = result.history
    return {name: h[name].values for name in ("time", *h)}


@pytest.mark.parametrize(
    "obstacles",
    [
        [FLOOR, WALL],
        [{"name": "floor", "kind": "polyline", "points": [[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]}],
        [
            {"name": "floor", "kind": "box", "center": [0.5, -0.5], "size": [1.0, 1.0]},
            {"name": "wall", "kind": "box", "center": [-0.5, 0.0], "size": [1.0, 2.0]},
        ],
    ],
)
def test_a_block_bounces_out_of_a_corner(obstacles):
    """No step was found before, in which its corner reaches floor and wall at once."""
    h = solved(obstacles, 0.015, {"velocity": [-1.0, -0.5]})
    energy = h["total_energy"]
    assert np.ptp(energy) <= 1e-10 * energy[0]
    assert h["gap"].min() >= -0.01 * np.diff(h["time"]).max()  # of the way of a step
    # Momentum is what each wall gives along its normal, and both throw it back.
    assert h["b.vx"][-1] > 0.6
    assert h["b.vy"][-1] > 0.3
    if len(obstacles) == 2:
        dt = np.diff(h["time"])
        for name, axis, before in (("floor", "y", -0.5), ("wall", "x", -1.0)):
            impulse = float(h[f"force.b.{name}"][1:] @ dt)
            assert 10.0 * (h[f"b.v{axis}"][-1] - before) == pytest.approx(impulse, rel=1e-9)


def thrown(speed, method="explicit", friction=0.0, degrees=0.0, scale=1.0):
    """A square of E = .743, rho = 1 into a corner that may be turned; speeds across its sides."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    center = scale * turn @ [0.52, 0.53]
    shape = {
        "kind": "block", "size": [scale, scale], "corner": (center - 0.5 * scale).tolist(),
        "angle": np.radians(degrees),
    }  # fmt: skip
    body = {
        "mesh_size": 0.1 * scale, "shape": shape, "density": 1.0, "youngs_modulus": 0.743,
        "velocity": (turn @ [-speed, -speed]).tolist(),
    }  # fmt: skip
    sides = [FLOOR | {"normal": turn[:, 1].tolist()}, WALL | {"normal": turn[:, 0].tolist()}]
    contact = [{"between": ["b", o["name"]], "friction_coefficient": friction} for o in sides]
    h = solved(
        sides, 1.5 * scale, body, contact=contact, solve={"estimate": False, "method": method}
    )
    dt = np.diff(h["time"])
    left = turn.T @ [h["b.vx"][-1], h["b.vy"][-1]]
    pushed = [float(h[f"force.b.{o['name']}"][1:] @ dt) / scale**2 for o in sides]
    return h, left, pushed


@pytest.mark.parametrize(
    ("speed", "friction", "degrees", "scale"),
    [(0.1, 0.0, 0.0, 1.0), (0.1, 0.3, 30.0, 1.0), (0.25, 0.0, 0.0, 1e-3)],
)
def test_explicit_steps_bounce_out_of_a_corner(speed, friction, degrees, scale):
    """With a gap to the nearest side only none was found for the surface once both touched."""
    h, left, pushed = thrown(speed, "explicit", friction, degrees, scale)
    exact = thrown(speed, "conserving", friction, degrees, scale)
    energy = h["total_energy"] - h["friction_work"]
    assert energy.max() <= (1.0 + 1e-4) * energy[0]
    assert energy[-1] >= 0.995 * energy[0]
    assert h["gap"].min() >= -2.0 * speed * np.diff(h["time"]).max()
    np.testing.assert_allclose(left, exact[1], atol=0.03 * speed)
    np.testing.assert_allclose(pushed, exact[2], rtol=0.025)


def test_explicit_steps_know_no_seam():
    """A block slides from one plate to a flush one: what holds it is handed on."""
    body = {
        "velocity": [3.0, 0.0], "shape": BLOCK["shape"] | {"corner": [-0.12, 0.0]},
        "mesh_size": 0.025,
    }  # fmt: skip
    one = {"name": "one", "kind": "box", "center": [-0.5, -0.5], "size": [1.0, 1.0]}
    two = {"name": "two", "kind": "box", "center": [0.5, -0.5], "size": [1.0, 1.0]}
    rough = [{"between": ["b", name], "friction_coefficient": 0.3} for name in ("one", "two")]
    more = {"gravity": [0.0, -9.81], "solve": {"method": "explicit", "estimate": False}}
    wide = solved([one | {"size": [9.0, 1.0]}], 0.02, body, contact=rough[:1], **more)
    parts = solved([one, two], 0.02, body, contact=rough, **more)
    assert parts["force.b.two"].max() > 10.0
    for name in ("b.x", "b.y", "friction_work", "contact_force", "total_energy"):
        scale = np.abs(wide[name]).max()
        np.testing.assert_allclose(parts[name], wide[name], rtol=0.0, atol=1e-9 * scale)


def test_a_block_at_rest_in_a_corner_presses_on_both():
    flush = {"shape": BLOCK["shape"] | {"corner": [0.0, 0.0]}, "mesh_size": 0.025}
    h = solved([FLOOR, WALL], 0.004, flush, start="static", gravity=[-5.0, -9.0])
    np.testing.assert_allclose(h["force.b.floor"], 90.0, rtol=1e-8)
    np.testing.assert_allclose(h["force.b.wall"], 50.0, rtol=1e-8)
    assert np.ptp(h["b.y"]) <= 1e-12


@pytest.mark.slow
def test_a_seam_of_the_floor_is_none_and_each_part_has_its_own_friction():
    """A block slides from one plate to the next, flush one, which has no friction."""
    body = {"velocity": [3.0, 0.0], "shape": BLOCK["shape"] | {"corner": [-0.12, 0.0]}}
    one = {"name": "one", "kind": "box", "center": [-0.5, -0.5], "size": [1.0, 1.0]}
    two = {"name": "two", "kind": "box", "center": [0.5, -0.5], "size": [1.0, 1.0]}
    rough = {"between": ["b", "one"], "friction_coefficient": 0.3}
    more = {"gravity": [0.0, -9.81], "solve": {"dt": 1e-3, "estimate": False}}
    wide = solved([one | {"size": [9.0, 1.0]}], 0.02, body, contact=[rough], **more)
    alike = [rough, rough | {"between": ["b", "two"]}]
    parts = solved([one, two], 0.02, body, contact=alike, **more)
    for name in ("b.x", "b.y", "friction_work", "contact_force"):
        np.testing.assert_allclose(parts[name], wide[name], rtol=1e-7, atol=1e-8)
    h = solved([one, two], 0.05, body, contact=[rough, {"between": ["b", "two"]}], **more)
    beyond = h["b.x"] > 0.056
    assert np.ptp(h["friction_work"][beyond]) <= 1e-12
    # Of the weight the part on the first plate rubs, over .02 m all of it, then ever less.
    assert h["friction_work"][-1] == pytest.approx(-0.3 * 98.1 * (0.02 + 0.1 / 2), rel=0.15)


def carried(obstacles, place):
    count = len(obstacles)
    own = np.arange(count)
    at = np.tile(np.asarray(place, dtype=float), (count, 1))
    return several_gaps(obstacles, own, np.zeros(count, dtype=int), at, 1.0, 0.0)


def test_which_obstacles_a_node_can_touch():
    floor = HalfSpace(point=(0.0, 0.0), normal=(0.0, 1.0))
    wall = HalfSpace(point=(0.0, 0.0), normal=(1.0, 0.0))
    ramp = HalfSpace(point=(0.0, 0.0), normal=(-np.sin(0.2), np.cos(0.2)))
    for other, side in ((wall, 0.01), (ramp, -0.001)):
        for place in ((-1e-9, -2e-9), (1e-9, -1e-8), (0.0, 0.0), (side, 0.02)):
            by, gap, _ = carried([floor, other], place)
            assert by.tolist() == [0, 1]
            assert gap[0] == place[1]
    assert carried([floor, ramp], (0.01, 0.02))[0].tolist() == [1, 1]  # the floor lies below it
    # The same plane twice is one; so are parts of a floor, the upright sides of which lie inside.
    assert carried([floor, floor], (0.3, -1e-9))[0].tolist() == [0, 0]
    left = RigidBox(center=(-0.5, -0.5), size=(1.0, 1.0))
    right = RigidBox(center=(0.5, -0.5), size=(1.0, 1.0))
    for x, by in ((-1e-3, 0), (1e-3, 1), (-0.1, 0), (1e-7, 1)):
        assert carried([left, right], (x, -1e-9))[0].tolist() == [by, by]
    # A step of them is a wall, though but 1e-4 high.
    step = RigidBox(center=(0.5, -0.4999), size=(1.0, 1.0))
    assert carried([left, step], (-1e-3, -1e-9))[0].tolist() == [0, 1]
    # At the foot of a wall the nearest way out of a floor that ends there leads into the wall.
    stand = RigidBox(center=(-0.5, 0.0), size=(1.0, 2.0))
    for place in ((-1e-9, -1e-7), (1e-9, -1e-7), (1e-7, -1e-9), (-1e-7, -1e-9)):
        by, gap, normal = carried([right, stand], place)
        assert by.tolist() == [0, 1]
        np.testing.assert_allclose(normal, [[0.0, 1.0], [1.0, 0.0]], atol=1e-9)
        np.testing.assert_allclose(gap, place[::-1], atol=1e-15)


def test_chains_are_cut_where_they_bend_inwards():
    box = RigidPolyline(points=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)))
    parts = box.parts()
    assert len(parts) == 4
    places = np.random.default_rng(0).uniform(0.0, 1.0, (200, 2))
    each = np.array([part.gap(places)[0] for part in parts])
    np.testing.assert_allclose(each.min(axis=0), box.gap(places)[0], atol=1e-15)
    # Just behind a corner both sides are known.
    behind = np.sort([part.gap(np.array([[-1e-6, -2e-6]]))[0][0] for part in parts])
    np.testing.assert_allclose(behind[:2], [-2e-6, -1e-6], atol=1e-15)
    # Outward corners, and turns too weak for a node to sit between, stay.
    assert len(RigidPolyline(points=((0.0, 1.0), (1.0, 1.0), (1.0, 0.0))).parts()) == 1
    assert len(RigidPolyline(points=((0.0, 0.0), (1.0, 0.0), (2.0, 0.1))).parts()) == 1
