"""Bodies under finite strain that start at rest, by the search that linear ones use."""

import numpy as np
import pytest

import impactfem
from impactfem.errors import ConvergenceError, SceneError
from impactfem.scene import Scene

FLOOR = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
DISC = {"kind": "disc", "radius": 0.5, "center": [0.0, 0.5]}
BLOCK = {"kind": "block", "size": [1.0, 0.5], "corner": [0.0, 0.0]}


def scene(body, gravity=(0.0, 0.0), floor=FLOOR, duration=1.0, method="conserving", **top):
    """A body of E = rho = 1."""
    keys = {
        "name": "body", "kind": "solid", "model": "plane_strain", "shape": BLOCK,
        "mesh_size": 0.125, "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3,
        "strain": "finite", "material": "neo_hookean",
    }  # fmt: skip
    return Scene.from_dict(
        {
            "title": "at rest", "duration": duration, "gravity": list(gravity), "start": "static",
            "body": [keys | body], "obstacle": [floor], "output": {"fields": []},
            "solve": {"method": method, "estimate": False}, **top,
        }
    )  # fmt: skip


def column(result, name):
    return result.history[name].values


@pytest.mark.parametrize("method", ["conserving", "massless"])
def test_a_soft_block_stays_at_rest(method):
    result = impactfem.solve(scene({}, (0.0, -0.4), duration=3.0, method=method))
    weight, elastic = 0.4 * 0.5, column(result, "elastic_energy")
    np.testing.assert_allclose(column(result, "contact_force"), weight, rtol=1e-9)
    assert column(result, "kinetic_energy").max() < 1e-18 * elastic[0]
    assert result.summary["bodies"]["body"]["strain_max"] > 0.1
    start = result.summary["details"]["start"]
    assert start["residual"] < 1e-11
    assert start["passes"] <= 6


def test_a_pressed_block_is_as_short_as_its_law_says():
    # Without lateral stiffness (nu = 0) P = mu (s - 1 / s) of the stretch s.
    body = {"poisson_ratio": 0.0, "tractions": [{"surface": "top", "value": ["0", "-0.2"]}]}
    probe = {"name": "top", "body": "body", "point": [0.5, 0.5]}
    result = impactfem.solve(scene(body, duration=0.1, probe=[probe]))
    stretch = 0.5 * (np.sqrt(0.4**2 + 4.0) - 0.4)
    np.testing.assert_allclose(column(result, "top.uy"), 0.5 * (stretch - 1.0), rtol=1e-9)


def test_a_disc_that_turns_keeps_its_stretch():
    rate = 0.5 / np.sqrt(2.6)  # half the speed of shear waves at the rim
    disc = {"kind": "disc", "radius": 1.0, "center": [0.0, 1.5]}
    body = {"shape": disc, "mesh_size": 0.15, "degree": 2, "angular_velocity": rate}
    probe = {"name": "rim", "body": "body", "point": [0.9999, 1.5]}
    far = FLOOR | {"point": [0.0, -100.0]}
    result = impactfem.solve(scene(body, floor=far, duration=4.0, probe=[probe]))
    place = np.array([0.9999 + column(result, "rim.ux"), column(result, "rim.uy")])
    stretch = np.linalg.norm(place, axis=0) / 0.9999
    # By ODE; small strains have 1 + rate^2 (1 + nu)(1 - 2 nu) / 4 = 1.0125.
    np.testing.assert_allclose(stretch, 1.01292569, atol=1.5e-4)
    assert column(result, "body.angle")[-1] > 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("radius", "size", "modulus"), [(0.05, 0.02, 1e6), (5e-5, 2e-5, 1e5)])
def test_a_ball_on_a_node_rolls_to_a_face(radius, size, modulus):
    """Its weight makes tangents negative along turns: no contact forces were found."""
    pull = 9.81 * 0.05 / radius
    body = {
        "model": "3d", "mesh_size": size, "density": 1000.0, "youngs_modulus": modulus,
        "shape": {"kind": "sphere", "radius": radius, "center": [0.0, 0.0, radius]},
    }  # fmt: skip
    floor = FLOOR | {"point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}
    result = impactfem.solve(scene(body, (0.0, 0.0, -pull), floor, 0.04 * radius))
    weight = result.summary["bodies"]["body"]["mass"] * pull
    np.testing.assert_allclose(column(result, "contact_force"), weight, rtol=1e-6)
    np.testing.assert_allclose(column(result, "gap"), 0.0, atol=1e-9 * radius)
    assert column(result, "active")[0] >= 3
    kinetic, elastic = column(result, "kinetic_energy"), column(result, "elastic_energy")
    assert kinetic.max() <= 1e-9 * elastic[0]
    assert result.summary["verdict"]["level"] != "do not trust"


def test_what_nothing_holds_is_named():
    slope = FLOOR | {"normal": [np.sin(0.3), np.cos(0.3)]}
    with pytest.raises(SceneError, match=r"nothing holds body body against its translation along"):
        impactfem.solve(scene({}, (0.0, -0.1), slope))


def part(name, bottom, height, size):
    """A block as wide as the others, of which the left side may slide up and down."""
    return {
        "name": name, "kind": "solid", "model": "plane_strain", "strain": "finite",
        "material": "neo_hookean", "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3,
        "shape": {"kind": "block", "size": [1.0, height], "corner": [0.0, bottom]},
        "mesh_size": size, "supports": [{"surface": "left", "kind": "motion", "value": ["0", ""]}],
    }  # fmt: skip


@pytest.mark.slow
def test_blocks_that_press_each_other_hard_are_found_in_parts_of_passes():
    """By 17 % of their height at once: as one block is, whose state is known to be uniform."""
    pressed = {"pressures": [{"surface": "top", "value": 0.2}]}
    ends = []
    for bodies in (
        [part("one", 0.0, 0.8, 0.2) | pressed],
        [part("low", 0.0, 0.4, 0.12), part("high", 0.4, 0.4, 0.17) | pressed],
    ):
        result = impactfem.solve(
            Scene.from_dict(scene({}).to_dict() | {"duration": 0.05, "body": bodies})
        )
        ends.append((column(result, "elastic_energy")[0], column(result, "contact_force")[0]))
    assert ends[1][0] == pytest.approx(ends[0][0], rel=1e-6)
    assert ends[1][1] == pytest.approx(2.0 * ends[0][1], rel=1e-6)  # floor and interface


@pytest.mark.slow
def test_a_start_that_is_not_found_tells_how_far_it_came():
    with pytest.raises(ConvergenceError, match=r"no .*with forces that grow .* of them were"):
        impactfem.solve(scene({"shape": DISC}, (0.0, -30.0)))


@pytest.mark.parametrize(("cells", "degree"), [("simplex", 1), ("hexahedron", 1), ("simplex", 2)])
def test_pressed_blocks_of_other_meshes_are_as_one(cells, degree):
    """The patch test: one stress everywhere, though nodes do not match."""

    def block(name, bottom, height, size):
        return part(name, bottom, height, size) | {"cells": cells, "degree": degree}

    pressed = {"pressures": [{"surface": "top", "value": 0.02}]}
    ends = []
    for bodies in (
        [block("one", 0.0, 0.8, 0.2) | pressed],
        [block("low", 0.0, 0.4, 0.12), block("high", 0.4, 0.4, 0.17) | pressed],
    ):
        data = scene({}).to_dict() | {"duration": 0.05, "body": bodies}
        data["output"] = {"fields": ["vtkhdf"]}
        result = impactfem.solve(Scene.from_dict(data))
        stress = result.fields.read(0)["cauchy_stress"]
        assert np.ptp(stress, axis=0).max() <= 1e-10 * np.abs(stress).max()
        ends.append((column(result, "elastic_energy")[0], column(result, "contact_force")[0]))
    assert ends[1][0] == pytest.approx(ends[0][0], rel=1e-10)
    assert ends[1][1] == pytest.approx(2.0 * ends[0][1], rel=1e-10)  # floor and interface
