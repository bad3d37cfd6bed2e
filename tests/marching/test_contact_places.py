"""Where contact forces act and their moments, against closed forms and the balance of momenta."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
SOLID = {
    "kind": "solid", "model": "plane_strain", "density": 1000.0, "youngs_modulus": 1e6,
    "poisson_ratio": 0.3, "mesh_size": 0.04,
}  # fmt: skip
ROD = {
    "kind": "rod", "name": "rod", "mass": 0.3, "length": 0.4, "center": [0.0, 0.3], "radius": 0.01,
    "inclination": 0.7, "velocity": [0.5, -1.0], "angular_velocity": 2.0,
}  # fmt: skip


def block(name, corner, size=(0.2, 0.1), velocity=(0.0, 0.0), **more):
    shape = {"kind": "block", "size": list(size), "corner": list(corner)}
    return SOLID | {"name": name, "shape": shape, "velocity": list(velocity)} | more


def solved(bodies, contacts, duration, obstacles=(FLOOR,), **solve):
    scene = Scene.from_dict(
        {
            "title": "places of forces", "duration": duration, "gravity": [0.0, -9.81],
            "body": bodies, "obstacle": list(obstacles), "contact": contacts,
            "solve": {"estimate": False} | solve, "output": {"fields": []},
        }
    )  # fmt: skip
    return impactfem.solve(scene).history


def column(history, name):
    return history[name].values


@pytest.mark.parametrize("method", ["conserving", "moreau_jean"])
def test_moments_are_what_changes_the_spin_of_solids(method):
    low = block("low", [0.0, 0.0])
    top = block("top", [0.02, 0.1], (0.1, 0.1), (0.5, -0.1))
    laws = [
        {"between": ["floor", "low"], "friction_coefficient": 0.3},
        {"between": ["top", "low"], "friction_coefficient": 0.2},
    ]
    history = solved([low, top], laws, 0.02, method=method)
    kicks = column(history, "moment.top.low")[1:] * history["time"].values[1]
    turned = np.diff(column(history, "top.spin"))
    inertia = float(kicks @ turned / (turned @ turned))
    np.testing.assert_allclose(kicks, inertia * turned, atol=1e-10 * np.abs(kicks).max())
    # Massless nodes take a part of the inertia m (a^2 + b^2) / 12 with them.
    whole = 10.0 * 0.02 / 12.0
    assert inertia == pytest.approx(whole, rel=1e-9 if method == "moreau_jean" else 0.3)


def test_a_pair_is_told_of_its_first_body():
    bodies = [block("low", [0.0, 0.0]), block("top", [0.02, 0.101], (0.1, 0.1), (0.0, -0.3))]
    laws = [{"between": ["floor", "low"]}, {"between": ["top", "low"]}]
    one = solved(bodies, laws, 0.01, method="moreau_jean", normals="fixed")
    laws[1] = {"between": ["low", "top"]}
    other = solved(bodies, laws, 0.01, method="moreau_jean", normals="fixed")
    on = column(one, "force.top.low") > 0.0
    for axis in "xy":
        a, b = column(one, f"center.top.low.{axis}"), column(other, f"center.low.top.{axis}")
        np.testing.assert_allclose(a[on], b[on], atol=5e-4)  # sides that slip a little
    # The same force has another arm about the other centre, 0.04 m aside.
    force = column(one, "force.top.low")[on]
    moments = column(one, "moment.top.low")[on], column(other, "moment.low.top")[on]
    arm = 0.1 - (0.02 + 0.05)
    # Small sliding keeps the arms of t = 0.
    np.testing.assert_allclose(moments[0] + moments[1], arm * force, rtol=1e-9)


def test_moments_are_what_changes_the_spin_of_a_rod():
    history = solved(
        [ROD], [{"between": ["rod", "floor"], "friction_coefficient": 0.4}], 0.6, dt=2e-3
    )
    kicks = column(history, "moment.rod.floor")[1:] * history["time"].values[1]
    turned = 0.3 * 0.4**2 / 12.0 * np.diff(column(history, "rod.spin"))
    quiet = column(history, "impulse.rod.floor")[1:] == 0.0
    # A rod that lies flat has none to the last bit, or rounding: how often differs by machine.
    assert np.count_nonzero(np.abs(kicks) > 1e-9) > 20
    np.testing.assert_allclose(kicks[quiet], turned[quiet], atol=1e-12)
    on = column(history, "force.rod.floor") > 0.0
    # One of its ends or both: never beyond them.
    away = column(history, "center.rod.floor.x") - column(history, "rod.x")
    assert (np.abs(away[on]) <= 0.2 + 1e-9).all()


@pytest.mark.parametrize("mu", [0.15, 0.3])
def test_friction_moves_the_normal_force_by_mu_times_the_height_of_the_centre(mu):
    upright = block(
        "block", [0.0, 0.0], (0.05, 0.1), (0.4, 0.0), mesh_size=0.0125, youngs_modulus=1e7,
        rayleigh_stiffness=1e-3,
    )  # fmt: skip
    history = solved(
        [upright], [{"between": ["block", "floor"], "friction_coefficient": mu}], 0.1,
        method="conserving", dt=5e-4,
    )  # fmt: skip
    late = (history["time"].values > 0.02) & (column(history, "block.vx") > 0.05)
    ahead = column(history, "center.block.floor.x") - column(history, "block.x")
    force = column(history, "force.block.floor")
    mean = (force * ahead)[late].sum() / force[late].sum()
    assert mean == pytest.approx(mu * 0.05, rel=0.02)
    moment = column(history, "moment.block.floor")[late]
    assert abs(moment.mean()) < 0.01 * force[late].mean() * 0.05


def test_without_a_force_places_go_along_with_the_body():
    ball = SOLID | {
        "name": "ball", "shape": {"kind": "disc", "radius": 0.1, "center": [0.3, 0.15]},
        "velocity": [0.2, -2.0],
    }  # fmt: skip
    point = {"kind": "point", "name": "dot", "mass": 0.1, "position": [1.0, 0.2], "radius": 0.05}
    history = solved([ball, point], [], 0.06)
    for body, low in (("ball", 0.1), ("dot", 0.0)):
        force = column(history, f"force.{body}.floor")
        place = column(history, f"center.{body}.floor.y")
        assert np.isfinite(place).all()
        before = np.cumsum(force > 0.0) == 0
        height = column(history, f"{body}.y")
        np.testing.assert_allclose(place[before], height[before] - low, atol=1e-9)
    assert (column(history, "force.ball.floor") > 0.0).any()
    assert (column(history, "moment.dot.floor") == 0.0).all()
    # The pair of both, which never meet.
    assert np.isfinite(column(history, "center.ball.dot.x")).all()


def test_what_is_cut_by_symmetry_is_told_of_the_whole():
    shape = {"kind": "disc", "radius": 0.1, "center": [0.0, 0.1]}
    ball = SOLID | {"name": "ball", "velocity": [0.0, -1.0]}
    for body in (
        ball | {"shape": shape | {"symmetry": ["x"]}},
        ball | {"shape": shape, "model": "axisymmetric"},
    ):
        history = solved([body], [], 0.01)
        assert (column(history, "force.ball.floor") > 0.0).any()
        assert (column(history, "center.ball.floor.x") == 0.0).all()
        assert (column(history, "moment.ball.floor") == 0.0).all()


@pytest.mark.parametrize("gap", [0.0, 1e-4])
def test_bodies_that_touch_flush_push_along_their_normal(gap):
    """Rounding of the gap is no way: its direction tilted forces by half a per cent."""
    low = block("low", [0.0, 0.0], (0.2, 0.05), (0.0, 0.0), mesh_size=0.01, cells="hexahedron")
    low |= {"supports": [{"surface": "bottom", "kind": "fixed"}], "youngs_modulus": 1e6}
    top = block("top", [0.12, 0.05 + gap], (0.1, 0.05), (0.0, 0.0), mesh_size=0.01)
    top |= {"cells": "hexahedron", "youngs_modulus": 1e6}
    history = solved(
        [low, top], [{"between": ["low", "top"]}], 0.02, method="conserving", normals="fixed",
        dt=1e-4,
    )  # fmt: skip
    pushed = column(history, "force.low.top").max()
    along = 5.0 * np.diff(column(history, "top.vx")) / 1e-4
    assert pushed > 10.0
    assert np.abs(along).max() < 1e-9 * pushed
