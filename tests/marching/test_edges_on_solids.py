"""Rigid bodies with edges and faces that strike elastic solids, points and beams."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene
from impactfem.contact.ball_pairs import Target, rims_of
from impactfem.contact.convex_nodes import CornersOnFaces, NodesOnConvex, nearest
from impactfem.contact.convex_pairs import Marked
from impactfem.system.convex import Convex

RADIUS = 0.3
SHAPES = {
    "block": Convex.of(np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T * 0.2),
    "cylinder": Convex.cylinder(np.array([[0.0, -0.25, 0.0], [0.0, 0.25, 0.0]]), RADIUS),
    "capsule": Convex.of(np.array([[-0.3, 0.0, 0.0], [0.3, 0.0, 0.0]]), 0.2),
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_nearest_places_are_those_of_closed_forms(name):
    points = np.random.default_rng(1).uniform(-0.6, 0.6, (4000, 3))
    gap, at, normal = nearest(SHAPES[name], points)
    if name == "block":
        q = np.abs(points) - 0.2
    elif name == "cylinder":
        q = np.stack(
            [np.hypot(points[:, 0], points[:, 2]) - RADIUS, np.abs(points[:, 1]) - 0.25], 1
        )
    else:
        along = np.clip(points[:, 0], -0.3, 0.3)
        q = np.linalg.norm(points - along[:, None] * np.eye(3)[0], axis=1)[:, None] - 0.2
    known = np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)
    np.testing.assert_allclose(gap, known, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(nearest(SHAPES[name], at)[0], 0.0, atol=1e-13)
    np.testing.assert_allclose(at + gap[:, None] * normal, points, atol=1e-13)


def placed(name, low):
    """Contact nodes: a square of four, then markers and followers of a body turned above it."""
    shape, unit = SHAPES[name], 0.1
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    square = np.array([[x, y, 0.0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
    lowest = (shape.vertices @ turn.T)[:, 2].min() - shape.radius
    centre = np.array([0.07, -0.03, low - lowest])
    arms = np.vstack([np.zeros(3), unit * turn.T])
    followers = np.zeros((3 * shape.rounds, 3))
    body = Marked(shape, 4 + np.arange(4 + len(followers)), unit, 3)
    places = np.vstack([square, centre + arms, centre + followers])
    told = places.copy()
    told[8:] += unit * np.eye(3)[: len(followers)]  # where followers push
    return body, places, told


@pytest.mark.parametrize("low", [0.02, 0.0, -0.01])
@pytest.mark.parametrize("name", SHAPES)
def test_forces_on_both_sides_have_no_sum_and_no_moment(name, low):
    body, places, told = placed(name, low)
    own, none = np.arange(4), np.zeros(4)
    faces = np.array([[0, 2, 3], [0, 3, 1]])
    target = Target(own, faces, np.ones(2), none, rims_of(faces))
    for pair in (
        NodesOnConvex(target, body, len(places)),
        CornersOnFaces.of(body, target, len(places)),
    ):
        met = pair(places, places)
        there = np.abs(met.gap) < 1e9
        # Faces beside these nodes are nearer to sharp edges, which corners are held off.
        assert there.any() == (isinstance(pair, CornersOnFaces) or body.shape.rounds)
        np.testing.assert_allclose(met.weights[there].sum(axis=1), 0.0, atol=1e-12)
        ways = met.weights[there] @ told  # from one place to the other: along the normal
        np.testing.assert_allclose(
            np.einsum("ij,ij->i", ways, met.normal[there]),
            np.linalg.norm(ways, axis=1) * np.sign(np.einsum("ij,ij->i", ways, met.normal[there])),
            atol=1e-12,
        )
        if isinstance(pair, CornersOnFaces) and name == "block":
            assert met.gap.min() == pytest.approx(low, abs=1e-12)
        # Turning all changes no gap.
        spin = np.array([0.3, -0.2, 0.5])
        rates = met.weights[there] @ np.cross(spin, told)
        found = np.einsum("ij,ij->i", rates, met.normal[there])
        np.testing.assert_allclose(found, 0.0, atol=1e-12)


def strike(other, box, law=None, duration=4e-3, dt=2e-5, **more):
    told = {"between": ["box", other["name"]]} | (law or {})
    return Scene.from_dict(
        {"title": "edges", "duration": duration,
         "body": [other, {"kind": "rigid", "name": "box"} | box], "contact": [told],
         "solve": {"dt": dt, "estimate": False}, "output": {"fields": []}} | more
    )  # fmt: skip


def block(h, size=(1.2, 0.4), modulus=1e9, nu=0.3, **more):
    corner = [-0.5 * size[0], 0.0, *(-0.5 * each for each in size[2:])]
    return {
        "kind": "solid", "name": "block", "model": "plane_strain" if len(size) == 2 else "3d",
        "mesh_size": h, "density": 1e3, "youngs_modulus": modulus, "poisson_ratio": nu,
        "shape": {"kind": "block", "size": list(size), "corner": corner}, "strain": "small",
    } | more  # fmt: skip


def flat(size, bottom, mass=80.0, **more):
    shape = {"kind": "block", "size": list(size), "corner": [-0.5 * size[0], bottom]}
    return {"mass": mass, "velocity": [0.0, -1.0], "shape": shape} | more


def test_a_block_on_a_bar_rebounds_as_a_closed_form_says():
    """Of equal masses: it leaves at 3.068 L/c; force e^-t, and 2 (1 - s) e^-s more from 2 on."""
    c, leaves, errors = 1e3, 3.06783, []
    s = leaves - 2.0
    known = -np.exp(-leaves) + 2.0 * s * np.exp(-s)
    for h in (0.05, 0.0125):
        held = {"supports": [{"surface": "bottom", "kind": "fixed"}]}
        bar = block(h, (0.1, 1.0), nu=0.0, **held)
        box = flat([0.3, 0.1], 1.0, mass=100.0)  # wider than the bar: its corners hang beside
        law = {"between": ["box", "block/top"]}
        run = impactfem.solve(strike(bar, box, law, duration=3.6 / c, dt=h / c)).history
        force, time = run["contact_force"].values, run["time"].values * c
        errors.append(run["box.vy"].values[-1] / known - 1.0)
        half = np.interp(1.0, time, force) / 1e5
        assert half == pytest.approx(np.exp(-1.0), rel=h)
        assert time[np.flatnonzero(force)[-1]] == pytest.approx(leaves, abs=2.0 * h)
    assert abs(errors[1]) < 0.03
    assert abs(errors[1]) < 0.5 * abs(errors[0])


def test_a_rigid_box_is_as_a_stiff_one():
    solid = block(0.05, (0.4, 0.2), modulus=1e12, name="box", velocity=[0.0, -1.0])
    solid["shape"]["corner"] = [-0.2, 0.4005]
    two = {"between": ["box", "block"]}
    base = strike(block(0.05), flat([0.4, 0.2], 0.4005), duration=3e-3).to_dict()
    stiff = Scene.from_dict(base | {"body": [base["body"][0], solid], "contact": [two]})
    speeds = [
        impactfem.solve(each).history["box.vy"].values[-1]
        for each in (Scene.from_dict(base), stiff)
    ]
    assert speeds[0] + 1.0 == pytest.approx(speeds[1] + 1.0, rel=0.01)


@pytest.mark.parametrize(("dim", "mu"), [(2, 0.0), (2, 0.4), (3, 0.4)])
def test_a_corner_strikes_between_nodes(dim, mu):
    """No node of a coarse mesh is near it; momentum is kept, and no energy made."""
    size, still = ((1.2, 0.4) if dim == 2 else (0.8, 0.4, 0.8)), [0.0] * (dim - 2)
    turned = {"angle": 0.4} if dim == 2 else {"orientation": {"axis": [1, 0.3, 1], "angle": 0.6}}
    low = 0.2 * np.sin(0.4) + 0.1 * np.cos(0.4) if dim == 2 else 0.203
    shape = {"kind": "block", "size": [0.4, 0.2, 0.2][:dim],
             "corner": [-0.17, 0.401 + low - 0.1, -0.13][:dim]}  # fmt: skip
    box = {"mass": 50.0, "velocity": [0.2, -1.0, *still], "shape": shape} | turned
    run = impactfem.solve(strike(block(0.2, size), box, {"friction_coefficient": mu}, dt=4e-5))
    history = run.history
    assert history["contact_force"].values.max() > 1e4
    for axis in "xyz"[:dim]:
        assert np.ptp(history[f"momentum.{axis}"].values) < 1e-11 * 50.0
    total = history["total_energy"].values
    spun = total if mu == 0.0 else total - history["friction_work"].values
    assert np.diff(spun).max() < 3e-3 * total[0]


def test_a_cylinder_comes_to_roll_on_a_block():
    """It slides first, and then rolls with two thirds of its speed."""
    held = {"supports": [{"surface": "back", "kind": "fixed"}]}
    base = block(0.05, (0.4, 0.2, 0.1), modulus=1e10, **held)
    base["shape"]["corner"] = [-0.1, -0.1, -0.1]
    shape = {"kind": "cylinder", "radius": 0.05, "height": 0.1, "center": [0.0, -0.05, 0.05]}
    box = {"mass": 1.0, "velocity": [0.3, 0.0, 0.0], "shape": shape}
    law = {"between": ["box", "block/front"], "friction_coefficient": 0.4}
    made = strike(base, box, law, duration=0.035, dt=5e-4, gravity=[0.0, 0.0, -9.81])
    history = impactfem.solve(made).history
    slides = history["time"].values < 0.02
    np.testing.assert_allclose(
        history["box.vx"].values[slides],
        0.3 - 0.4 * 9.81 * history["time"].values[slides],
        atol=1e-3,
    )
    assert history["box.vx"].values[-1] == pytest.approx(0.2, rel=2e-3)
    assert 0.05 * history["box.wy"].values[-1] == pytest.approx(0.2, rel=2e-3)


def test_a_point_strikes_a_free_box_off_its_centre():
    shape = {"kind": "block", "size": [0.4, 0.2], "corner": [-0.2, -0.1]}
    ball = {"kind": "point", "name": "ball", "mass": 0.5, "radius": 0.01, "position": [0.15, 0.2],
            "velocity": [0.0, -2.0]}  # fmt: skip
    box = {"mass": 3.0, "shape": shape}
    made = strike(ball, box, {"restitution": 0.6}, duration=0.1, dt=1e-3)
    history = impactfem.solve(made).history
    inertia = 3.0 * (0.4**2 + 0.2**2) / 12.0
    impulse = 1.6 * 2.0 / (1.0 / 0.5 + 1.0 / 3.0 + 0.15**2 / inertia)
    assert history["box.vy"].values[-1] == pytest.approx(-impulse / 3.0, rel=1e-12)
    assert history["box.spin"].values[-1] == pytest.approx(-impulse * 0.15 / inertia, rel=1e-12)
    assert history["ball.vy"].values[-1] == pytest.approx(-2.0 + impulse / 0.5, rel=1e-12)


def test_a_beam_falls_on_the_corner_of_a_box():
    beam = {"kind": "beam", "name": "beam", "length": 0.4, "height": 0.01, "width": 0.01,
            "density": 7850.0, "youngs_modulus": 210e9, "elements": 3, "center": [0.03, 0.316],
            "velocity": [0.0, -1.0]}  # fmt: skip
    shape = {"kind": "block", "size": [0.05, 0.2], "corner": [-0.02, 0.1]}
    box = {"mass": 1.0, "angle": 0.02, "shape": shape}
    history = impactfem.solve(strike(beam, box, {"restitution": 0.5}, duration=0.02)).history
    assert history["box.vy"].values[-1] < -0.1
    assert np.ptp(history["momentum.y"].values) < 1e-12
    assert np.ptp(history["angular_momentum"].values) < 1e-8
    assert np.diff(history["total_energy"].values).max() < 1e-10
    assert history["gap"].values.min() > -1e-4


def test_what_falls_beside_a_named_surface_does_not_touch_it():
    """A named surface ends somewhere: what is lower, but beside it, is not inside."""
    ball = {"kind": "rigid", "name": "box", "mass": 1.0, "velocity": [0.0, -1.0],
            "shape": {"kind": "disc", "radius": 0.02, "center": [0.7, 0.45]}}  # fmt: skip
    made = strike(block(0.2), ball, {"between": ["box", "block/top"]}, duration=0.3, dt=1e-3)
    history = impactfem.solve(made).history
    assert history["contact_force"].values.max() == 0.0
    assert history["box.vy"].values[-1] == -1.0


def test_edges_that_cross_between_nodes_are_told():
    ridge = block(0.2, (0.6, 0.6, 1.2), modulus=1e10)
    ridge["shape"] |= {"angle": np.pi / 4, "corner": [-0.3, -0.3, -0.6]}
    shape = {"kind": "block", "size": [0.9, 0.04, 0.04], "corner": [-0.45, 0.0, 0.08]}
    box = {"mass": 5.0, "velocity": [0.0, -1.0, 0.0], "shape": shape,
           "orientation": {"axis": [1, 0, 0], "angle": np.pi / 4}}  # fmt: skip
    box["shape"]["corner"][1] = 0.3 * np.sqrt(2.0) - 0.02 + 0.02 * np.sqrt(2.0) + 1e-3
    made = strike(ridge, box, duration=0.01, dt=1e-4)
    said = [
        f
        for f in impactfem.solve(made).summary["verdict"]["findings"]
        if f["code"] == "penetration"
    ]
    assert any("an edge of box lies up to 0.00" in f["text"] for f in said)


def rocking():
    box = flat([0.3, 0.2], 0.401, mass=60.0) | {"angle": 0.05}
    box["shape"]["corner"][1] += 0.01
    return strike(
        block(0.1, modulus=1e8), box, {"friction_coefficient": 0.3}, duration=0.05, dt=2e-4,
        output={"fields": [], "checkpoint": 50},
    )  # fmt: skip


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    made = rocking()
    whole, _ = check_restart(made, 117, tmp_path, monkeypatch)
    assert whole.history["contact_force"].values.max() > 1e3


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    check_ranks(rocking, monkeypatch)


@pytest.mark.parametrize(
    ("method", "side"), [("conserving", 1.0), ("massless", 1.0), ("explicit", -1.0)]
)
def test_a_box_whose_corner_slides_past_a_node_is_not_caught_by_it(method, side):
    """A node that was beside the box is under it in the next step: it is pushed down, not aside.

    The box slides off, braked by friction and by what damping of the block takes.
    """
    block = {
        "kind": "solid", "name": "s", "model": "plane_strain", "strain": "small",
        "density": 1100.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3, "mesh_size": 0.025,
        "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [-0.05, 0.0]},
        "supports": [{"surface": "bottom", "kind": "fixed"}], "rayleigh_mass": 300.0,
    }  # fmt: skip
    box = {
        "kind": "rigid", "name": "b", "density": 1000.0, "velocity": [0.3 * side, 0.0],
        "shape": {"kind": "block", "size": [0.04, 0.04], "corner": [-0.02, 0.1]},
    }  # fmt: skip
    made = impactfem.Scene.from_dict(
        {
            "title": "slides past", "duration": 0.05, "gravity": [0.0, -9.81],
            "body": [block, box],
            "contact": [{"between": ["s", "b"], "friction_coefficient": 0.3}],
            "solve": {"method": method, "dt": 5e-5, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip
    history = impactfem.solve(made).history
    weight = 1.6 * 9.81
    assert history["contact_force"].values.max() < 2.0 * weight
    kept = history["total_energy"].values - history["friction_work"].values
    assert (kept - kept[0]).max() < 1e-9
    braked = 0.3 - 0.3 * 9.81 * 0.05
    assert side * history["b.vx"].values[-1] == pytest.approx(braked, abs=0.01)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_box_rests_on_a_block_of_its_width(dim):
    """The way from corner to corner is along the faces that touch: no force is along it."""
    base = {
        "kind": "solid", "name": "base", "model": "plane_strain" if dim == 2 else "3d",
        "shape": {"kind": "block", "size": [0.1, 0.05, 0.1][:dim], "corner": [0.0] * dim},
        "mesh_size": 0.025, "density": 1000.0, "youngs_modulus": 1e7, "poisson_ratio": 0.3,
        "supports": [{"surface": "bottom", "kind": "fixed"}], "strain": "small",
    }  # fmt: skip
    shape = {"kind": "block", "size": [0.1, 0.02, 0.1][:dim], "corner": [0.0, 0.05, 0.0][:dim]}
    box = {"kind": "rigid", "name": "box", "mass": 0.1, "shape": shape}
    result = impactfem.solve(Scene.from_dict({
        "title": "flush", "duration": 2e-3, "gravity": [0.0, -9.81, 0.0][:dim],
        "body": [base, box], "contact": [{"name": "met", "between": ["base", "box"]}],
        "solve": {"estimate": False, "dt": 4e-5}, "output": {"fields": []},
    }))  # fmt: skip
    history = result.history
    assert history["force.met"].values.max() < 8.0 * 0.981
    # What a box loses at first, over nodes without mass, is that of a wider one too.
    energy = history["total_energy"].values
    assert np.abs(energy).max() < 0.02 * history["kinetic_energy"].values.max() + 1e-6
    assert np.abs(history["box.vx"].values).max() < 1e-4
