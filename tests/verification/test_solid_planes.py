"""Obstacles that are planes, or nearly, against planes; halves against whole bodies."""

import numpy as np
import pytest
from solid_blocks import floor, solid_scene

import impactfem

METHODS = ("massless", "conserving", "explicit", "moreau_jean")
BLOCK = {
    "shape": {"kind": "block", "size": [0.5, 1.0], "corner": [-0.25, 0.02]},
    "mesh_size": 0.125, "poisson_ratio": 0.3, "velocity": [0.02, -0.15], "angular_velocity": 0.1,
    "contact_surfaces": ["bottom"],
}  # fmt: skip
FLAT = {
    "box": {"kind": "box", "center": [0.0, -1.0], "size": [6.0, 2.0]},
    "polyline": {"kind": "polyline", "points": [[-3.0, 0.0], [0.1, 0.0], [3.0, 0.0]]},
}


def run(body, obstacle, **solve):
    return impactfem.solve(
        solid_scene(body, [obstacle], duration=1.5, **({"dt": 0.02} | solve))
    ).history


def differences(one, other, names=("contact_force", "body.x", "body.y", "body.vy", "gap")):
    return {
        name: float(np.abs(one[name] - other[name]).max() / np.abs(other[name]).max())
        for name in names
    }


@pytest.mark.parametrize("normals", ["fixed", "updated"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", FLAT)
def test_the_flat_side_of_an_obstacle_is_a_plane(kind, method, normals):
    plane = run(BLOCK, floor(2), method=method)
    found = run(BLOCK, FLAT[kind], method=method, normals=normals)
    assert plane["contact_force"].max() > 0.05
    # Gaps agree to 1e-15, forces as rounding of 75 layers lets them.
    worst = differences(found, plane)
    assert worst.pop("gap") <= 1e-13
    assert max(worst.values()) <= 1e-12, worst


def test_flat_sides_are_planes_in_space():
    body = BLOCK | {
        "model": "3d", "mesh_size": 0.25, "velocity": [0.02, -0.15, 0.0],
        "angular_velocity": [0.0, 0.0, 0.1],
        "shape": {"kind": "block", "size": [0.5, 1.0, 0.25], "corner": [-0.25, 0.02, -0.1]},
    }  # fmt: skip
    plane = run(body, floor(3), method="explicit")
    box = {"kind": "box", "center": [0.0, -1.0, 0.0], "size": [6.0, 2.0, 6.0]}
    for obstacle in (box, FLAT["polyline"]):
        found = run(body, obstacle, method="explicit")
        assert max(differences(found, plane).values()) <= 1e-12


@pytest.mark.parametrize("normals", ["fixed", "updated"])
@pytest.mark.parametrize("side", ["outside", "inside"])
@pytest.mark.parametrize("method", ["massless", "explicit"])
def test_round_obstacles_become_planes_as_1_over_their_radius(method, side, normals):
    """Measured: forces 5e-4 apart at radius 1e3, in proportion to 1 / radius."""
    plane = run(BLOCK, floor(2), method=method)
    worst = []
    for radius in (1e3, 1e5):
        center = [0.0, -radius if side == "outside" else radius]
        obstacle = {"kind": "cylinder", "point": center, "radius": radius, "side": side}
        found = run(BLOCK, obstacle, method=method, normals=normals)
        worst.append(differences(found, plane, ("contact_force", "body.y", "body.vy")))
    for name, first in worst[0].items():
        assert first <= 1e-3, name
        assert worst[1][name] <= 1.1e-2 * first + 1e-12, name


@pytest.mark.parametrize("normals", ["fixed", "updated"])
def test_a_sphere_becomes_a_plane_in_space(normals):
    body = BLOCK | {
        "model": "3d", "mesh_size": 0.25, "velocity": [0.02, -0.15, 0.0],
        "angular_velocity": [0.0, 0.0, 0.1],
        "shape": {"kind": "block", "size": [0.5, 1.0, 0.25], "corner": [-0.25, 0.02, -0.1]},
    }  # fmt: skip
    plane = run(body, floor(3), method="massless", dt=0.03)
    ball = {"kind": "sphere", "center": [0.0, -1e6, 0.0], "radius": 1e6}
    found = run(body, ball, method="massless", dt=0.03, normals=normals)
    assert max(differences(found, plane, ("contact_force", "body.y", "body.vy")).values()) <= 1e-6


def disc(size, cells, **shape):
    return {
        "shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 0.52]} | shape,
        "mesh_size": size, "cells": cells, "poisson_ratio": 0.3, "velocity": [0.0, -0.1],
    }  # fmt: skip


@pytest.mark.parametrize("method", ["massless", "conserving", "explicit"])
def test_half_a_disc_is_told_of_as_the_disc(method):
    """Its mapped mesh of quadrilaterals is half of the whole one."""
    half = run(disc(0.1, "hexahedron", symmetry=["x"]), floor(2), method=method)
    whole = run(disc(0.1, "hexahedron"), floor(2), method=method)
    assert whole["contact_force"].max() > 0.05
    for name in ("contact_force", "kinetic_energy", "elastic_energy", "momentum"):
        apart = np.abs(half[name] - whole[name]).max() / np.abs(whole[name]).max()
        assert apart <= 1e-10, name
    assert np.abs(half["body.y"] - whole["body.y"]).max() <= 1e-11
    assert not half["body.x"].any()
    assert not half["body.vx"].any()


def test_half_a_disc_of_triangles_agrees_as_far_as_meshes_do():
    """Two meshes of one size differ by less than two sizes; both differences shrink."""
    forces = {
        (size, cut): run(
            disc(size, "simplex", **({"symmetry": ["x"]} if cut else {})), floor(2),
            method="explicit", dt=0.005,
        )["contact_force"].values
        for size in (0.1, 0.05, 0.025) for cut in (False, True)
        if size > 0.03 or not cut
    }  # fmt: skip

    def apart(one, other):
        return float(np.abs(forces[one] - forces[other]).sum() / forces[other].sum())

    assert apart((0.05, True), (0.05, False)) <= apart((0.05, False), (0.025, False))
    assert apart((0.1, True), (0.1, False)) <= apart((0.1, False), (0.05, False))
    assert apart((0.05, True), (0.05, False)) <= 0.7 * apart((0.1, True), (0.1, False))
